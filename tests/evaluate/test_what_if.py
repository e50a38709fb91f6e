from dataclasses import replace

import numpy as np
import pytest

from gaia_uwb.config import make_config
from gaia_uwb.episode import DriveErrors, ErrorSizes, RangeReadings
from gaia_uwb.estimate import Reason, ReasonKind
from gaia_uwb.evaluate import improvements
from gaia_uwb.evaluate.drives_again import Cones, Drive, driven
from gaia_uwb.pipeline import prepare, reconstruct
from gaia_uwb.scene import Trajectory
from gaia_uwb.simulate import PRESETS, simulate_pass
from road_tags import road_drive_with_tags

ONE, ACROSS = [(0.0, 0.0)], [(0.0, 0.8), (0.0, -0.8)]
NONE = ErrorSizes(0.0, 0.0, 0.0, np.zeros(4), 0.0, 0.0)
WEAVE, OTHER_WAY = "weave once while passing", "drive past once more, in the other direction"
TWO_TAGS = "mount a second tag, 1.6 m beside the first"


@pytest.fixture(scope="module")
def straight():
    """A straight, steady drive at 60 km/h: it tells neither sides nor clocks."""
    return reconstruct(road_drive_with_tags(1, ONE), make_config({"denoiser": "raw"}))


@pytest.fixture(scope="module")
def proposed(straight):
    return {each.name: each for each in improvements(straight)}


def test_a_good_result_needs_no_improvement():
    assert not improvements(reconstruct(simulate_pass(PRESETS["lane-closure"], seed=0)))


def test_a_log_that_has_to_be_mended_is_not_computed_with(straight):
    spoilt = replace(straight, reasons=(*straight.reasons, Reason(ReasonKind.MISFIT, "metres?")))
    assert not improvements(spoilt)


def test_the_same_drive_again_would_tell_as_little(straight, proposed):
    again = proposed["this drive again"]
    assert next(iter(proposed)) == again.name
    assert again.n_cones == 20 and again.n_ok == 0
    stated_m = np.median([fix.semi_axes_90_m[0] for fix in straight.anchors])
    assert again.radius_90_m == pytest.approx(stated_m, rel=0.7)


def test_what_tells_sides_and_clocks_settles_them(proposed):
    assert proposed[OTHER_WAY].n_ok == 20
    assert proposed[OTHER_WAY].radius_90_m < 0.4
    assert proposed[TWO_TAGS].n_open == proposed[WEAVE].n_open == 0
    assert proposed["calibrate the vehicle"].radius_90_m < 0.4
    assert proposed[f"{TWO_TAGS}, and calibrate"].n_ok == 20


def test_two_tags_are_computed_as_they_turn_out(proposed):
    drive = road_drive_with_tags(1, ACROSS)
    real = reconstruct(drive, make_config({"denoiser": "raw"}))
    assert sum(fix.side_is_open for fix in real.anchors) == proposed[TWO_TAGS].n_open
    real_m = np.median([fix.semi_axes_90_m[0] for fix in real.anchors])
    assert proposed[TWO_TAGS].radius_90_m == pytest.approx(real_m, rel=0.5)


def test_what_was_done_is_not_proposed_again():
    known = {"vehicles": {"": {"clock_offset_s": {"value": 0.12, "sigma": 0.001}}}}
    result = reconstruct(road_drive_with_tags(1, ONE), make_config(known | {"denoiser": "raw"}))
    assert "calibrate the vehicle" not in [each.name for each in improvements(result)]
    tags = reconstruct(road_drive_with_tags(1, ACROSS), make_config({"denoiser": "raw"}))
    assert TWO_TAGS not in [each.name for each in improvements(tags)]


def test_truth_has_no_say(straight, proposed):
    blind = replace(straight, episode=replace(straight.episode, truth=None))
    assert {each.name: each for each in improvements(blind)} == proposed


def make_drive(path, t_s, anchor, sizes=NONE, mean=(0.0,) * 8):
    like = replace(
        prepare(simulate_pass(PRESETS["straight"], seed=0)),
        errors=DriveErrors(np.asarray(mean, dtype=np.float64), np.eye(8), sizes),
    )
    return Drive(like, path, t_s, anchor, "again")


def east(length_m=400.0, speed_mps=10.0):
    t_s = np.arange(0.0, length_m / speed_mps, 0.05)
    return Trajectory(t_s, np.stack([speed_mps * t_s, np.zeros(len(t_s))], axis=1))


def cones_at(place_m, sizes=NONE, seed=0):
    ids = [f"c{k}" for k in range(len(place_m))]
    return Cones.draw(ids, np.array(place_m), None, sizes, np.random.default_rng(seed))


def error_m(drive, cones, seed=0):
    """Return each reading's error, and the readings."""
    readings = driven(drive, cones, np.random.default_rng(seed)).own_times
    at_m = RangeReadings(
        readings.t_s, readings.anchor, np.zeros(len(readings.t_s)), drive.path
    ).position_at(readings.t_s)
    return readings.range_m - np.hypot(*(cones.place_m[readings.anchor] - at_m).T), readings


def test_without_errors_ranges_are_distances_less_what_clock_and_bias_do():
    t_s = np.arange(0.0, 39.0, 0.1)
    drive = make_drive(east(), t_s, np.zeros(len(t_s), dtype=np.int64))
    cones = cones_at([[200.0, 5.0]])
    assert np.abs(error_m(drive, cones)[0]).max() < 1e-3
    late = make_drive(east(), t_s, drive.anchor, mean=[0.3, 0.0, 0.2, 0.1, 0, 0, 0, 0])
    off_m, readings = error_m(late, cones)
    at_m = 10.0 * (readings.t_s - 0.2)
    expected_m = np.hypot(200.0 - at_m, 5.0) - np.hypot(200.0 - 10.0 * readings.t_s, 5.0) + 0.4
    assert off_m == pytest.approx(expected_m, abs=1e-3)


def test_errors_are_as_large_and_as_much_alike_as_the_sizes_say():
    sizes = ErrorSizes(0.1, 0.8, 0.25, np.array([0.0, 0.0, 0.2, 0.0]), 0.0, 0.0)
    n = 30
    t_s = np.tile(np.arange(0.0, 69.0, 0.1), n)
    anchor = np.repeat(np.arange(n), len(t_s) // n)
    cones = cones_at([[350.0, 500.0 + k] for k in range(n)])
    noise_m, readings = error_m(
        make_drive(east(700.0), t_s, anchor, replace(sizes, field_m=np.zeros(4))), cones
    )
    assert len(noise_m) == pytest.approx(0.75 * len(t_s), rel=0.02)
    assert noise_m.std() == pytest.approx(0.1, rel=0.05)
    next_to = (np.diff(readings.anchor) == 0) & (np.diff(readings.t_s) < 0.15)
    alike = (noise_m[1:] * noise_m[:-1])[next_to].mean() / noise_m.var()
    assert alike == pytest.approx(0.8, abs=0.03)
    slow_m, readings = error_m(
        make_drive(east(700.0), t_s, anchor, replace(sizes, noise_m=0.0)), cones, seed=1
    )
    assert slow_m.std() == pytest.approx(0.2, rel=0.15)
    step = np.round(readings.t_s / 0.1).astype(int)
    field_m = np.full((n, step.max() + 1), np.nan)
    field_m[readings.anchor, step] = slow_m
    apart = np.nanmean(field_m[:, 10:] * field_m[:, :-10]) / slow_m.var()  # 10 m
    assert apart == pytest.approx(np.exp(-10.0 / 16.0), abs=0.06)
