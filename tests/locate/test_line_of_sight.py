"""Lines of sight: a hidden Markov chain, compared with all of its states written out."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import t as student

from gaia_uwb.locate.line_of_sight import DEGREES, SightChains

Numbers = NDArray[np.float64]

NOISE_M, SHARE, ALIKE, STEP_S = 0.05, 0.2, 0.6, 0.1
KEPT_S, LIKE_BEFORE, DRIFT_M = 1.5, 0.7, 0.2


def log_new(left_m: float) -> float:
    """Log density of a reading that is hidden, and whose error has nothing to do with others'."""
    sign = 0.9 if left_m > 0 else 0.1
    size_m = abs(left_m)
    return float(np.log(sign * (0.9 * np.exp(-size_m) + 0.1 * np.exp(-size_m / 50) / 50)))


def log_student(left_m: float, scale_m: float) -> float:
    return float(student.logpdf(left_m, DEGREES, scale=scale_m))


def by_enumeration(left_m: Numbers) -> tuple[float, Numbers]:
    """Return the log evidence and the probability of each reading's being visible."""
    same = np.exp(-STEP_S / KEPT_S)
    weights = []
    # Between two readings the state is kept or drawn anew: both are written out.
    histories = list(itertools.product((0, 1), (0, 1), repeat=len(left_m)))
    seen = np.zeros(len(left_m))
    for history in histories:
        state, kept = history[::2], history[1::2]
        if kept[0]:
            continue  # nothing comes before the first
        total = 0.0
        for r, (hidden, stays) in enumerate(zip(state, kept, strict=True)):
            if stays and hidden != state[r - 1]:
                total = -np.inf
                break
            draw = SHARE if hidden else 1.0 - SHARE
            total += np.log(same) if stays else np.log((1.0 - same if r else 1.0) * draw)
            if not stays:
                alone = log_new(left_m[r]) if hidden else log_student(left_m[r], NOISE_M)
                total += alone
            elif hidden:
                wide_m = np.sqrt(2 * NOISE_M**2 + 2 * DRIFT_M**2 * (1 - same))
                like = log_student(left_m[r] - left_m[r - 1], wide_m) + np.log(LIKE_BEFORE)
                total += np.logaddexp(like, log_new(left_m[r]) + np.log(1 - LIKE_BEFORE))
            else:
                new_m = NOISE_M * np.sqrt(1 - ALIKE**2)
                total += log_student(left_m[r] - ALIKE * left_m[r - 1], new_m)
        weights.append(total)
        seen += np.exp(total) * (1 - np.array(state))
    evidence = float(np.logaddexp.reduce(weights))
    return evidence, seen / np.exp(evidence)


@pytest.mark.parametrize("seed", range(4))
def test_all_states_written_out_give_the_same(seed: int) -> None:
    rng = np.random.default_rng(seed)
    left_m = NOISE_M * rng.normal(size=6) + np.array([0.0, 0.0, 0.5, 0.5, 0.15, 0.0]) * (seed > 0)
    chains = SightChains(np.zeros(6, np.int64), STEP_S * np.arange(6.0))
    full = np.full(6, 1.0)
    found = chains.solve(left_m, NOISE_M * full, SHARE * full, ALIKE * full)
    evidence, visible = by_enumeration(left_m)
    assert -found.loss.sum() == pytest.approx(evidence, abs=1e-9)
    assert found.visible == pytest.approx(visible, abs=1e-9)


def test_chains_are_independent_and_in_the_order_of_time() -> None:
    rng = np.random.default_rng(1)
    t_s = rng.permutation(40) * 0.1
    chain = rng.integers(0, 3, 40)
    left_m = 0.1 * rng.normal(size=40)
    noise_m, share, alike = np.full(40, 0.05), np.full(40, 0.1), np.full(40, 0.3)
    together = SightChains(chain, t_s).solve(left_m, noise_m, share, alike)
    for k in range(3):
        own = np.flatnonzero(chain == k)
        own = own[np.argsort(t_s[own])]
        zeros = np.zeros(len(own), np.int64)
        alone = SightChains(zeros, t_s[own]).solve(
            left_m[own], noise_m[own], share[own], alike[own]
        )
        for name in ("visible", "loss", "information", "products", "squares"):
            assert getattr(together, name)[own] == pytest.approx(getattr(alone, name), abs=1e-12)


def test_a_stretch_is_judged_as_one_thing() -> None:
    """Twelve hidden readings in a row cost little more than one, not twelve times as much."""
    one, many = np.zeros(60), np.zeros(60)
    one[30], many[24:36] = 0.4, 0.4
    chains = SightChains(np.zeros(60, np.int64), 0.1 * np.arange(60.0))
    full = np.ones(60)
    nothing, single, stretch = (
        chains.solve(left_m, 0.05 * full, 0.1 * full, 0.0 * full) for left_m in (0 * one, one, many)
    )
    assert (stretch.visible[24:36] < 0.01).all() and (stretch.visible[:23] > 0.98).all()
    cost = [sight.loss.sum() - nothing.loss.sum() for sight in (single, stretch)]
    assert cost[1] < 4.0 * cost[0]


def test_without_hidden_readings_all_are_visible() -> None:
    chains = SightChains(np.zeros(5, np.int64), 0.1 * np.arange(5.0))
    left_m = np.array([0.0, 30.0, 0.0, -4.0, 0.0])
    sight = chains.solve(left_m, np.full(5, 0.05), np.zeros(5), np.zeros(5))
    assert (sight.visible == 1.0).all() and np.isfinite(sight.loss).all()


def test_how_alike_noise_is_shows_in_neighbours() -> None:
    rng = np.random.default_rng(2)
    left_m = np.zeros(4000)
    for r in range(1, 4000):
        left_m[r] = 0.7 * left_m[r - 1] + 0.05 * np.sqrt(1 - 0.7**2) * rng.normal()
    chains = SightChains(np.zeros(4000, np.int64), 0.1 * np.arange(4000.0))
    full = np.ones(4000)
    sight = chains.solve(left_m, 0.05 * full, 0.05 * full, 0.7 * full)
    assert sight.products.sum() / sight.squares.sum() == pytest.approx(0.7, abs=0.05)
    assert sight.information[1:] == pytest.approx(0.3 / 1.7)
