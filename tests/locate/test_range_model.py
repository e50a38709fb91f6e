"""What single readings say near a guess: derivatives, weights and likelihoods."""

from dataclasses import replace

import numpy as np
import pytest

from gaia_uwb.locate.evidence import Motion
from gaia_uwb.locate.line_of_sight import SightChains
from gaia_uwb.locate.range_model import Guess, linearise as linearise_in_chains

N = 60
# What the columns are derivatives by, but for the clock.
UNKNOWN = {0: ("own", 0), 1: ("own", 1), 2: ("own", 3), 3: ("own", 4), 4: ("growth_m", None)}
UNKNOWN |= {6 + i: ("pattern_m", i) for i in range(4)}


def linearise(motion, range_m, guess):
    """Linearise readings of which none follows another."""
    return linearise_in_chains(motion, range_m, SightChains(np.arange(N), np.zeros(N)), guess)


def drive(seed=0, speed_mps=8.0):
    """Return motions, ranges and a guess that are all over the place."""
    rng = np.random.default_rng(seed)
    course = rng.uniform(-np.pi, np.pi, N)
    motion = Motion(
        position_m=rng.uniform(-40.0, 40.0, (N, 2)),
        velocity_mps=speed_mps * np.stack([np.cos(course), np.sin(course)], axis=1),
        gap_m=rng.uniform(-2.0, 2.0, N),
    )
    guess = Guess(
        own=rng.normal(0.0, [[5.0], [5.0], [0.03], [0.02], [0.02]], (5, N)),
        bias_m=rng.normal(0.1, 0.01, N),
        growth_m=rng.normal(0.05, 0.01, N),
        pattern_m=list(rng.normal(0.0, 0.03, (4, N))),
        noise_m=np.full(N, 0.1),
        alike=np.zeros(N),
        hidden_share=np.full(N, 0.05),
        slow_m=np.zeros(N),
        variance_m2=np.zeros(N),
    )
    flat_m = guess.own[:2].T - motion.position_m
    distance_m = np.sqrt((flat_m**2).sum(axis=1) + motion.gap_m**2)
    return motion, distance_m + rng.normal(0.1, 0.3, N), guess


def moved(guess, name, index, by):
    value = getattr(guess, name)
    if index is None:
        return replace(guess, **{name: value + by})
    rows = np.array(value)
    rows[index] += by
    return replace(guess, **{name: rows if isinstance(value, np.ndarray) else list(rows)})


@pytest.mark.parametrize("column", UNKNOWN)
def test_derivatives_are_those_of_the_range(column):
    name, index = UNKNOWN[column]
    motion, range_m, guess = drive()
    flat = replace(guess, own=guess.own * [[1.0], [1.0], [1.0], [0.0], [0.0]],
                   growth_m=np.zeros(N), pattern_m=list(np.zeros((4, N))))  # fmt: skip
    # How a pattern or a growth changes with the cone's place is too little to count.
    ahead = linearise(motion, range_m, moved(flat, name, index, 1e-5)).residual_m
    behind = linearise(motion, range_m, moved(flat, name, index, -1e-5)).residual_m
    found = linearise(motion, range_m, flat).derivatives[column]
    assert found == pytest.approx(-(ahead - behind) / 2e-5, abs=1e-6)


def test_a_later_clock_puts_the_tag_back_along_its_way():
    motion, range_m, guess = drive()
    guess = replace(guess, growth_m=np.zeros(N), pattern_m=list(np.zeros((4, N))),
                    own=guess.own * [[1.0], [1.0], [1.0], [0.0], [0.0]])  # fmt: skip

    def residual_m(offset_s):
        earlier = motion.position_m - offset_s * motion.velocity_mps
        return linearise(replace(motion, position_m=earlier), range_m, guess).residual_m

    found = linearise(motion, range_m, guess).derivatives[5]
    assert found == pytest.approx(-(residual_m(1e-5) - residual_m(-1e-5)) / 2e-5, abs=1e-6)


def test_the_tags_pattern_turns_with_the_vehicle():
    motion, range_m, guess = drive()
    north_m, east_m = (guess.own[1::-1].T - motion.position_m[:, ::-1]).T
    course = np.arctan2(motion.velocity_mps[:, 1], motion.velocity_mps[:, 0])
    turned = np.arctan2(north_m, east_m) - course
    expected = [f(i * turned) for i in (1, 2) for f in (np.cos, np.sin)]
    found = linearise(motion, range_m, guess).derivatives[6:]
    assert np.array(found) == pytest.approx(np.array(expected), abs=1e-8)


def test_a_tag_that_stands_still_has_no_pattern():
    motion, range_m, guess = drive(speed_mps=0.1)
    harmonics = linearise(motion, range_m, guess).derivatives[6:]
    assert not np.any(harmonics)
    assert np.any(linearise(*drive(speed_mps=0.3)).derivatives[6:])


def test_its_loss_is_that_of_a_density():
    motion, range_m, guess = drive()
    guess = replace(guess, hidden_share=np.full(N, 0.3))
    exact_m = range_m - linearise(motion, range_m, guess).residual_m
    fine_m, coarse_m = np.arange(-3.0, 3.0, 0.002), np.arange(3.0, 600.0, 0.1)
    off_m = np.concatenate([-coarse_m[::-1], fine_m, coarse_m])
    loss = np.array([linearise(motion, exact_m + m, guess).loss for m in off_m])
    assert np.trapezoid(np.exp(-loss), off_m, axis=0) == pytest.approx(1.0, abs=2e-3)


def test_readings_far_off_are_hidden_and_rather_too_long_than_too_short():
    motion, range_m, guess = drive()
    exact_m = range_m - linearise(motion, range_m, guess).residual_m
    near, long, short = (linearise(motion, exact_m + m, guess) for m in (0.05, 3.0, -3.0))
    assert near.hidden.max() < 0.05
    assert long.hidden.min() > 0.95
    assert (long.loss < short.loss).all()
    assert (near.information > 20.0 * long.information).all()
