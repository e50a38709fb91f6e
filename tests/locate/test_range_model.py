"""What readings say near a guess: derivatives, weights, likelihoods, and all of it by hand."""

from dataclasses import fields, replace

import numpy as np
import pytest

from gaia_uwb.episode import RangeReadings
from gaia_uwb.locate._readings import average_readings
from gaia_uwb.locate.evidence import Heard, Motion, gather
from gaia_uwb.locate.range_model import Averages, Guess, RangeModel
from gaia_uwb.scene import Trajectory
from readings_by_hand import by_hand, of_cones

N = 60
# What the columns of the means are derivatives by, but for the clock.
UNKNOWN = {i: ("own", i) for i in range(5)} | {5: ("errors", 0), 6: ("errors", 1)}
UNKNOWN |= {8: ("errors", 0)} | {9 + i: ("errors", 5 + i) for i in range(4)}
CLOCK, TURNED, RESIDUAL = 7, slice(9, 13), 13


def average(motion, range_m, guess):
    """Look at readings of which none follows another, each of a cone of its own."""
    alone = of_cones(np.zeros(N), range_m, np.arange(N))
    return RangeModel(alone).average(motion, guess)


def drive(seed=0, speed_mps=8.0, share=0.0):
    """Return motions, ranges and a guess that are all over the place."""
    rng = np.random.default_rng(seed)
    course = rng.uniform(-np.pi, np.pi, N)
    motion = Motion(
        position_m=rng.uniform(-40.0, 40.0, (N, 2)),
        velocity_mps=speed_mps * np.stack([np.cos(course), np.sin(course)], axis=1),
        gap_m=rng.uniform(-2.0, 2.0, N),
    )
    sizes = {"bias": rng.normal(0.1, 0.01, N), "growth": rng.normal(0.05, 0.01, N)}
    pattern_m = rng.normal(0.0, 0.03, (N, 4))
    own_m = rng.normal(0.0, [5.0, 5.0, 0.03, 0.02, 0.02], (N, 5))
    guess = Guess(
        own=own_m + 0.01 * np.arange(2.0)[:, None, None],  # sides are much alike
        errors=np.column_stack(
            [*sizes.values(), np.full(N, 0.1), np.zeros(N), np.full(N, share), pattern_m]
        ),
        slow_m=np.zeros((2, N)),
        variance_m2=np.zeros((2, N)),
    )
    off_m = guess.own[0, :, :2] - motion.position_m
    distance_m = np.sqrt((off_m**2).sum(axis=1) + motion.gap_m**2)
    return motion, distance_m + rng.normal(0.1, 0.3, N), guess


def moved(guess, name, index, by):
    values = np.array(getattr(guess, name))
    values[..., index] += by
    return replace(guess, **{name: values})


def flattened(guess):
    """Leave out how patterns and growth change with the cone's place, which counts for little."""
    return replace(
        guess,
        own=guess.own * [1.0, 1.0, 1.0, 0.0, 0.0],
        errors=guess.errors * [1.0, 0.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0],
    )


@pytest.mark.parametrize("column", UNKNOWN)
def test_derivatives_are_those_of_the_range(column):
    motion, range_m, guess = drive()
    flat = flattened(guess)
    ahead, behind = (
        average(motion, range_m, moved(flat, *UNKNOWN[column], by)).mean[..., RESIDUAL]
        for by in (1e-5, -1e-5)
    )
    found = average(motion, range_m, flat).mean[..., column]
    assert found == pytest.approx(-(ahead - behind) / 2e-5, abs=1e-6)


def test_a_later_clock_puts_the_tag_back_along_its_way():
    motion, range_m, guess = drive()
    guess = flattened(guess)

    def residual_m(offset_s):
        earlier = motion.position_m - offset_s * motion.velocity_mps
        return average(replace(motion, position_m=earlier), range_m, guess).mean[..., RESIDUAL]

    found = average(motion, range_m, guess).mean[..., CLOCK]
    assert found == pytest.approx(-(residual_m(1e-5) - residual_m(-1e-5)) / 2e-5, abs=1e-6)


def test_the_tags_pattern_turns_with_the_vehicle():
    motion, range_m, guess = drive()
    east_m, north_m = np.moveaxis(guess.own[..., :2] - motion.position_m, -1, 0)
    course = np.arctan2(motion.velocity_mps[:, 1], motion.velocity_mps[:, 0])
    turned = np.arctan2(north_m, east_m) - course
    expected = np.stack([f(i * turned) for i in (1, 2) for f in (np.cos, np.sin)], axis=-1)
    assert average(motion, range_m, guess).mean[..., TURNED] == pytest.approx(expected, abs=1e-8)


def test_a_tag_that_stands_still_has_no_pattern():
    motion, range_m, guess = drive(speed_mps=0.1)
    assert not np.any(average(motion, range_m, guess).mean[..., TURNED])
    assert np.any(average(*drive(speed_mps=0.3)).mean[..., TURNED])


def test_its_loss_is_that_of_a_density():
    motion, range_m, guess = drive(share=0.3)
    exact_m = range_m - average(motion, range_m, guess).mean[0, :, RESIDUAL]
    fine_m, coarse_m = np.arange(-3.0, 3.0, 0.002), np.arange(3.0, 600.0, 0.1)
    off_m = np.concatenate([-coarse_m[::-1], fine_m, coarse_m])
    loss = np.array([average(motion, exact_m + m, guess).loss[0] for m in off_m])
    assert np.trapezoid(np.exp(-loss), off_m, axis=0) == pytest.approx(1.0, abs=2e-3)


def test_readings_far_off_are_hidden_and_rather_too_long_than_too_short():
    motion, range_m, guess = drive(share=0.05)
    exact_m = range_m - average(motion, range_m, guess).mean[0, :, RESIDUAL]
    near, long, short = (average(motion, exact_m + m, guess) for m in (0.05, 3.0, -3.0))
    assert near.hidden[0].max() < 0.05
    assert long.hidden[0].min() > 0.95
    assert (long.loss[0] < short.loss[0]).all()
    assert (near.information[0] > 20.0 * long.information[0]).all()


def wandering(rng, cones_m, counts, *, up_m=None):
    """Return a drive that stops halfway; so many readings of each cone, some of them hidden."""
    t_s = 0.1 * np.arange(600)
    speed_mps = np.where((t_s > 20.0) & (t_s < 35.0), 0.0, 8.0)
    course = 0.3 * np.sin(t_s / 5.0)
    step_m = 0.1 * speed_mps[:, None] * np.stack([np.cos(course), np.sin(course)], axis=1)
    path = Trajectory(t_s, np.cumsum(step_m, axis=0) - [180.0, 0.0], up_m)
    anchor = np.repeat(np.arange(len(counts)), counts)
    at_s = np.sort(rng.uniform(-1.0, 61.0, len(anchor)))  # beyond both ends, too
    at_s[1::7] = at_s[::7][: len(at_s[1::7])]  # some at the same time
    readings = RangeReadings(at_s, rng.permutation(anchor), np.ones(len(anchor)), path)
    distance_m = np.hypot(*(cones_m[readings.anchor] - readings.position_at(at_s)).T)
    range_m = distance_m + 0.1 * rng.standard_normal(len(anchor)) + 2.0 * (at_s % 9.0 < 2.0)
    return replace(readings, range_m=range_m)


@pytest.mark.parametrize("alike", [0.0, 0.6])
@pytest.mark.parametrize("seed", range(4))
def test_written_out_by_hand_it_is_the_same(seed, alike):
    rng = np.random.default_rng(seed)
    cones_m = rng.uniform([-180.0, -12.0], [100.0, 12.0], (6, 2))
    counts = np.array([[90, 1, 0, 40, 5, 0], [60, 30, 0, 1, 0, 2]])
    up_m = (None, np.linspace(1.5, 2.0, 600))
    drives = [wandering(rng, cones_m, n, up_m=up) for n, up in zip(counts, up_m, strict=True)]
    heights_m = np.array([np.nan, 0.5, 0.5, np.nan, 0.5, 0.5])
    heard = [Heard(each, np.arange(6), heights_m) for each in drives]
    (evidence,) = gather(heard, 6, np.zeros(2))
    n_blocks, n_cells = len(evidence.block_cone), len(evidence.cell_block)
    own_m = np.zeros((2, 6, 5))
    own_m[..., :2] = cones_m * np.array([[[1.0, 1.0]], [[1.0, -1.0]]])
    own_m += rng.normal(0.0, [0.3, 0.3, 0.03, 0.02, 0.02], own_m.shape)
    share = 0.0 if seed == 0 else 0.1
    sizes = np.tile([0.1, 0.02, 0.08, alike, share, 0.0, 0.0, 0.0, 0.0], (n_blocks, 1))
    guess = Guess(
        own=own_m[:, evidence.block_cone],
        errors=sizes + rng.normal(0.0, 0.02, sizes.shape) * [1, 1, 0, 0, 0, 1, 1, 1, 1],
        slow_m=rng.normal(0.0, 0.05, (2, n_cells)),
        variance_m2=rng.uniform(0.0, 0.02, (2, n_cells)),
    )
    motion = evidence.motion(rng.normal(0.0, 0.05, 2))
    found = RangeModel(evidence).average(motion, guess)
    expected = by_hand(evidence, motion, guess)
    for name in (field.name for field in fields(Averages)):
        assert getattr(found, name) == pytest.approx(getattr(expected, name), rel=1e-9, abs=1e-9)
    assert (found.hidden[0].max() > 5.0) == (share > 0.0)


def test_cones_without_readings_say_nothing():
    path = Trajectory(np.array([0.0, 1.0]), np.zeros((2, 2)))
    nothing = RangeReadings(np.empty(0), np.empty(0, np.int64), np.empty(0), path)
    (evidence,) = gather([Heard(nothing, np.arange(2), np.zeros(2))], 2, np.zeros(1))
    empty = np.empty((2, 0))
    guess = Guess(np.empty((2, 0, 5)), np.empty((0, 9)), empty, empty)
    found = RangeModel(evidence).average(evidence.motion(np.zeros(1)), guess)
    assert found.information.shape == (2, 0)
    assert (found.nearest == -1).all() and not found.loss.any()


def _arguments():
    """Return what the compiled part takes for two cones, with three readings in three cells."""
    own, errors = np.ones((2, 2, 5)), np.full((2, 9), 0.1)
    by_reading = [np.ones((3, 2)), np.ones((3, 2)), np.ones(3), np.ones(3)]
    chains = [np.array([1, 0, 0]), np.ones(3)]
    bounds = [np.arange(4), np.array([0, 2, 3]), np.array([0, 1])]
    out = [np.empty((2, 3)), np.empty((2, 3, 14)), np.zeros((2, 2, 5)), np.zeros((2, 2), np.int64)]
    return [*by_reading, *chains, *bounds, own, errors, np.zeros((2, 3)), np.zeros((2, 3)), *out]


def test_the_compiled_part_takes_what_fits():
    arguments = _arguments()
    average_readings(*arguments)
    assert np.isfinite(arguments[14]).all()


@pytest.mark.parametrize("index", range(17))
def test_the_compiled_part_refuses_sizes_that_do_not_fit(index):
    arguments = _arguments()
    arguments[index] = np.concatenate([arguments[index].ravel(), arguments[index].ravel()[:1]])
    with pytest.raises(ValueError, match="do not fit"):
        average_readings(*arguments)


@pytest.mark.parametrize(
    ("index", "value"),
    [
        (4, [2, 0, 0]),  # a reading of the next block
        (4, [-1, 0, 0]),
        (6, [0, 1, 2, 4]),  # beyond the last reading
        (6, [0, 2, 1, 3]),
        (6, [0, 1, 1, 3]),  # a cell without readings
        (7, [0, 4, 3]),
        (7, [1, 2, 3]),
        (8, [0, 2]),  # no such cone
        (8, [-1, 1]),
        (8, [1, 0]),  # not sorted
    ],
)
def test_the_compiled_part_refuses_indices_that_lead_astray(index, value):
    arguments = _arguments()
    arguments[index] = np.array(value)
    with pytest.raises(ValueError, match="do not fit"):
        average_readings(*arguments)
