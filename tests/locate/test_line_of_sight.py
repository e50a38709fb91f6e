"""Lines of sight: a hidden Markov chain, compared with all of its states written out."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import t as student

from gaia_uwb.locate.evidence import Motion
from gaia_uwb.locate.range_model import Averages, Guess, RangeModel
from readings_by_hand import of_cones

Numbers = NDArray[np.float64]

DEGREES = 4.0
NOISE_M, SHARE, ALIKE, STEP_S = 0.05, 0.2, 0.6, 0.1
KEPT_S, LIKE_BEFORE, DRIFT_M = 1.5, 0.7, 0.2


def looked_at(
    left_m: Numbers,
    *,
    noise_m: float = NOISE_M,
    share: float = SHARE,
    alike: float = 0.0,
    t_s: Numbers | None = None,
    cone: NDArray[np.int64] | None = None,
) -> Averages:
    """Look at readings whose residuals are given, of a tag that stands 10 m from every cone."""
    n = len(left_m)
    cone = np.zeros(n, np.int64) if cone is None else cone
    t_s = STEP_S * np.arange(n) if t_s is None else t_s
    evidence = of_cones(t_s, 10.0 + 1e-9 + left_m, cone)  # no distance is below a nanometre
    n_cones = len(evidence.cones)
    guess = Guess(
        own=np.tile([10.0, 0.0, 0.0, 0.0, 0.0], (2, n_cones, 1)),
        errors=np.tile([0.0, 0.0, noise_m, alike, share, 0.0, 0.0, 0.0, 0.0], (n_cones, 1)),
        slow_m=np.zeros((2, n)),
        variance_m2=np.zeros((2, n)),
    )
    motion = Motion(np.zeros((n, 2)), np.zeros((n, 2)), np.zeros(n))
    return RangeModel(evidence).average(motion, guess)


def visible(left_m: Numbers, found: Averages, *, noise_m: float = NOISE_M) -> Numbers:
    """Return how likely each of some readings of independent noise was visible."""
    weight = (DEGREES + 1) / (DEGREES + (left_m / noise_m) ** 2) / noise_m**2
    return np.asarray(found.information[0] / weight)


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
    found = looked_at(left_m, alike=ALIKE)
    evidence, seen = by_enumeration(left_m)
    assert -found.loss[0, 0] == pytest.approx(evidence, abs=1e-9)
    assert found.hidden[0, 0] == pytest.approx(6 - seen.sum(), abs=1e-9)
    worth = np.concatenate([[1.0], np.full(5, (1 - ALIKE) / (1 + ALIKE))])
    likely = seen > 0.01  # the others' cells have the least information that a cell has
    assert visible(left_m, found)[likely] == pytest.approx((worth * seen)[likely], abs=1e-9)


def test_chains_are_independent_and_in_the_order_of_time() -> None:
    rng = np.random.default_rng(1)
    t_s = rng.permutation(40) * 0.1
    cone = np.sort(rng.integers(0, 3, 40))
    left_m = 0.1 * rng.normal(size=40)
    together = looked_at(left_m, alike=0.3, t_s=t_s, cone=cone)
    for k in range(3):
        own = np.flatnonzero(cone == k)
        own = own[np.argsort(t_s[own])]
        alone = looked_at(left_m[own], alike=0.3, t_s=t_s[own])
        assert together.information[:, own] == pytest.approx(alone.information, abs=1e-12)
        for name in ("loss", "hidden", "square", "pairs"):
            assert getattr(together, name)[0, k] == pytest.approx(getattr(alone, name)[0, 0])


def test_a_stretch_is_judged_as_one_thing() -> None:
    """Twelve hidden readings in a row cost little more than one, not twelve times as much."""
    one, many = np.zeros(60), np.zeros(60)
    one[30], many[24:36] = 0.4, 0.4
    nothing, single, stretch = (looked_at(left_m, share=0.1) for left_m in (0 * one, one, many))
    seen = visible(many, stretch)
    assert (seen[24:36] < 0.01).all() and (seen[:23] > 0.98).all()
    cost = [found.loss[0, 0] - nothing.loss[0, 0] for found in (single, stretch)]
    assert cost[1] < 4.0 * cost[0]


def test_without_hidden_readings_all_are_visible() -> None:
    found = looked_at(np.array([0.0, 30.0, 0.0, -4.0, 0.0]), share=0.0)
    assert not found.hidden.any() and np.isfinite(found.loss).all()


def test_no_range_is_too_far_off_for_a_likelihood() -> None:
    found = looked_at(np.array([0.0, 1e9, 0.0, 1e9, 0.0, -1e9, 1e5]), noise_m=1e-3)
    assert np.isfinite(found.loss).all() and np.isfinite(found.mean).all()
    assert found.hidden[0, 0] < 7.0


def test_how_alike_noise_is_shows_in_neighbours() -> None:
    rng = np.random.default_rng(2)
    left_m = np.zeros(4000)
    for r in range(1, 4000):
        left_m[r] = 0.7 * left_m[r - 1] + 0.05 * np.sqrt(1 - 0.7**2) * rng.normal()
    products, squares = looked_at(left_m, share=0.05, alike=0.7).pairs[0, 0]
    assert products / squares == pytest.approx(0.7, abs=0.05)


def test_readings_whose_noise_is_alike_add_less() -> None:
    found = looked_at(np.zeros(9), share=0.0, alike=0.7)
    weight = (DEGREES + 1) / DEGREES / NOISE_M**2
    assert found.information[0, 0] == pytest.approx(weight)
    assert found.information[0, 1:] == pytest.approx(0.3 / 1.7 * weight)
