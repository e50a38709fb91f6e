"""The clock offset: recovered with an honest error, and left alone where nothing tells it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy.stats

from drives_past import log_past
from gaia_uwb.alignment import clock
from gaia_uwb.alignment.clock import estimate_clock_offset
from gaia_uwb.config import AlignmentConfig
from gaia_uwb.episode import ClockOffset
from gaia_uwb.scene import RangeLog, Scene, Trajectory
from gaia_uwb.simulate import PRESETS, PassConfig, simulate, simulate_pass

CONFIG = AlignmentConfig()
PASS = PRESETS["lane-closure"]
CONES_M = np.array([[-15.0, 4.0], [0.0, 5.0], [15.0, 4.5]])


def with_offset(offset_s: float, config: PassConfig = PASS) -> PassConfig:
    ranging = config.ranging.model_copy(update={"clock_offset_s": offset_s})
    return config.model_copy(update={"ranging": ranging})


def drive_past(
    path_m: np.ndarray, *, offset_s: float, noise_m: float = 0.05, seed: int = 0
) -> Scene:
    """Make a log of cones read 10 times a second along a path sampled as often, with noise."""
    t_s = np.arange(len(path_m)) * 0.1
    at_s = t_s[:-1, None] + [0.01, 0.04, 0.07]
    return log_past(t_s, path_m, CONES_M, at_s, late_s=offset_s, noise_m=noise_m, seed=seed)


def straight_path(speed_mps: float, n: int = 300) -> np.ndarray:
    return np.stack([speed_mps * 0.1 * (np.arange(n) - n / 2), np.zeros(n)], axis=1)


def loop_path(n: int = 600) -> np.ndarray:
    turn = np.linspace(0.0, 4 * np.pi, n)
    return np.stack([25.0 * np.sin(turn), 12.0 * np.sin(2 * turn)], axis=1)


def estimate(scene: Scene, **settings: object) -> ClockOffset:
    return estimate_clock_offset(scene, CONFIG.model_copy(update=settings))


def test_offsets_come_back_with_an_honest_error() -> None:
    found = [estimate(simulate_pass(PASS, seed)) for seed in range(40)]
    assert all(clock.applied for clock in found)
    z = np.array([(clock.offset_s - 0.2) / clock.sigma_s for clock in found])
    assert 0.6 < z.std() < 1.6
    assert (np.abs(z) < 3.0).mean() >= 0.9
    assert np.abs([clock.offset_s - 0.2 for clock in found]).max() < 0.03


@pytest.mark.parametrize("heavy", [False, True])
def test_the_standard_error_is_what_the_offset_errs_by(heavy: bool) -> None:
    exact = drive_past(loop_path(), offset_s=0.2, noise_m=0.0)
    z = []
    for seed in range(60):
        rng, n = np.random.default_rng(seed), len(exact.ranges)
        noise_m = 0.05 * (rng.standard_t(4, n) if heavy else rng.standard_normal(n))
        range_m = np.maximum(exact.ranges.range_m + noise_m, 0.01)
        found = estimate(replace(exact, ranges=replace(exact.ranges, range_m=range_m)))
        z.append((found.offset_s - 0.2) / found.sigma_s)
    assert 0.7 < np.sqrt(np.mean(np.square(z))) < 1.15
    assert (np.abs(z) < 2.0).mean() > 0.92


def test_two_equal_clocks_are_hardly_ever_told_apart() -> None:
    found = [estimate(simulate_pass(with_offset(0.0), seed)) for seed in range(40)]
    assert sum(clock.applied for clock in found) <= 4
    assert all(clock.sigma_s >= abs(clock.offset_s) for clock in found if not clock.applied)
    assert "not significantly different from zero" in {clock.reason for clock in found}


@pytest.mark.parametrize("offset_s", [-1.85, -0.3, 0.05, 1.85])
def test_a_late_stamp_is_a_positive_offset(offset_s: float) -> None:
    clock = estimate(drive_past(loop_path(), offset_s=offset_s))
    assert clock.applied
    assert abs(clock.offset_s - offset_s) < 3 * clock.sigma_s
    assert clock.sigma_s < 0.01
    assert clock.applied_s == clock.offset_s
    assert "standard errors from zero" in clock.reason


def test_noise_free_ranges_give_the_offset_exactly() -> None:
    clock = estimate(drive_past(loop_path(), offset_s=0.2, noise_m=0.0))
    assert clock.offset_s == pytest.approx(0.2, abs=1e-4)


def test_turning_and_moving_the_scene_changes_nothing() -> None:
    scene = drive_past(loop_path(), offset_s=0.15)
    turn = np.array([[np.cos(2.0), -np.sin(2.0)], [np.sin(2.0), np.cos(2.0)]])
    moved = replace(scene.trajectory, position_m=scene.trajectory.position_m @ turn.T + [3e3, -5e3])
    expected, found = estimate(scene), estimate(replace(scene, trajectory=moved))
    assert found.offset_s == pytest.approx(expected.offset_s, abs=1e-4)
    assert found.sigma_s == pytest.approx(expected.sigma_s, rel=0.05)


def test_shifting_all_times_changes_nothing() -> None:
    scene = drive_past(loop_path(), offset_s=0.15)
    later = replace(
        scene,
        trajectory=replace(scene.trajectory, t_s=scene.trajectory.t_s + 1.73e9),
        ranges=replace(scene.ranges, t_s=scene.ranges.t_s + 1.73e9),
    )
    expected, found = estimate(scene), estimate(later)
    assert found.offset_s == pytest.approx(expected.offset_s, abs=1e-4)
    assert found.sigma_s == pytest.approx(expected.sigma_s, rel=0.05)


@pytest.mark.parametrize("path_noise_m", [0.0, 0.01])
@pytest.mark.parametrize("seed", range(5))
def test_a_straight_path_at_constant_speed_cannot_tell(path_noise_m: float, seed: int) -> None:
    scene = drive_past(straight_path(10.0), offset_s=0.2, seed=seed)
    noise_m = path_noise_m * np.random.default_rng(seed + 100).standard_normal((300, 2))
    path = replace(scene.trajectory, position_m=scene.trajectory.position_m + noise_m)
    clock = estimate(replace(scene, trajectory=path))
    assert clock == ClockOffset(
        0.0, 0.5, False, "the drive is too straight and too steady to determine it"
    )


@pytest.mark.parametrize("seed", range(5))
def test_a_parked_vehicle_cannot_tell(seed: int) -> None:
    clock = estimate(simulate_pass(PRESETS["parked"], seed))
    assert not clock.applied
    assert clock.sigma_s == CONFIG.clock_offset_sigma_s
    still = drive_past(np.zeros((300, 2)), offset_s=0.2, seed=seed)
    assert estimate(still).sigma_s == CONFIG.clock_offset_sigma_s


def test_what_is_known_beforehand_bounds_what_is_left_open() -> None:
    scene = drive_past(straight_path(10.0), offset_s=0.2)
    assert estimate(scene, clock_offset_sigma_s=0.03).sigma_s == 0.03


@pytest.mark.parametrize("offset_s", [2.6, -2.6])
def test_an_offset_beyond_the_search_is_not_applied(offset_s: float) -> None:
    clock = estimate(drive_past(loop_path(), offset_s=offset_s))
    assert not clock.applied
    assert clock.sigma_s > 1.5
    assert "limit of the search range of 2 s; check the clocks" in clock.reason
    wider = estimate(drive_past(loop_path(), offset_s=offset_s), max_clock_offset_s=4.0)
    assert wider.applied
    assert wider.offset_s == pytest.approx(offset_s, abs=0.01)


def test_clocks_that_are_trusted() -> None:
    clock = estimate(drive_past(loop_path(), offset_s=0.2), clock_offset="off")
    assert (clock.offset_s, clock.sigma_s, clock.applied) == (0.0, 0.0, False)
    assert "as set" in clock.reason


@pytest.mark.parametrize("n", [2, 45])
def test_a_drive_shorter_than_the_search_says_nothing(n: int) -> None:
    clock = estimate(drive_past(loop_path()[:n], offset_s=0.2))
    assert clock == ClockOffset(0.0, 0.5, False, "too few ranges along the path to determine it")


def test_one_anchor_is_enough() -> None:
    scene = drive_past(loop_path(), offset_s=0.2)
    own = scene.ranges.anchor == 0
    log = RangeLog(scene.ranges.t_s[own], scene.ranges.anchor[own], scene.ranges.range_m[own])
    clock = estimate(replace(scene, ranges=log, anchor_ids=("a",)))
    assert clock.applied
    assert abs(clock.offset_s - 0.2) < 4 * clock.sigma_s


def test_silent_anchors_have_no_say() -> None:
    scene = drive_past(loop_path(), offset_s=0.2)
    log = scene.ranges
    more = replace(
        scene,
        ranges=RangeLog(log.t_s, log.anchor + 1, log.range_m),
        anchor_ids=("silent", "a", "b", "c", "mute"),
    )
    assert estimate(more).offset_s == pytest.approx(estimate(scene).offset_s, abs=1e-9)


def test_readings_near_an_outage_are_left_out_for_every_offset() -> None:
    scene = drive_past(loop_path(), offset_s=0.2)
    path = scene.trajectory
    there = (path.t_s < 20.0) | (path.t_s > 30.0)
    broken = Trajectory(path.t_s[there], path.position_m[there])
    clock = estimate(replace(scene, trajectory=broken))
    assert clock.applied
    assert abs(clock.offset_s - 0.2) < 4 * clock.sigma_s
    # What was read around the outage has no pose under some offset, so it may be anything.
    near = (scene.ranges.t_s > 18.1) & (scene.ranges.t_s < 31.9)
    junk = replace(scene.ranges, range_m=np.where(near, 99.0, scene.ranges.range_m))
    assert estimate(replace(scene, trajectory=broken, ranges=junk)) == clock


def test_a_long_log_is_thinned(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = drive_past(loop_path(), offset_s=0.2)
    monkeypatch.setattr("gaia_uwb.alignment.clock._MAX_READINGS", 300)
    clock = estimate(scene)
    assert clock.applied
    assert abs(clock.offset_s - 0.2) < 4 * clock.sigma_s


def test_blocks_make_no_difference(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = simulate_pass(PASS, seed=0)
    expected = estimate(scene)
    monkeypatch.setattr("gaia_uwb.alignment.readings._BLOCK", 1000)
    found = estimate(scene)
    assert found.offset_s == pytest.approx(expected.offset_s, abs=1e-9)
    assert found.sigma_s == pytest.approx(expected.sigma_s, rel=1e-6)


def test_the_truth_is_not_looked_at() -> None:
    scene = simulate_pass(PASS, seed=0)
    assert estimate(scene.without_truth()) == estimate(scene)


@pytest.mark.real_data
def test_the_outdoor_runs(outdoor_dir: Path) -> None:
    from gaia_uwb.logs import outdoor_uwb

    found = [estimate(scene) for scene in outdoor_uwb.load(outdoor_dir / "outdoor-uwb")]
    assert len(found) == 8
    for one in found:
        assert one.applied
        assert 0.15 < one.offset_s < 0.21
        assert one.sigma_s < 0.03


def test_few_stretches_of_time_need_more_standard_errors() -> None:
    degrees = clock._DEGREES[:-1]
    expected = scipy.stats.t.ppf(1.0 - 0.5 * 0.0027, degrees)
    np.testing.assert_allclose(clock._STANDARD_ERRORS[:-1], expected, rtol=2e-3)
    config = AlignmentConfig()
    assert clock._decide(0.2, 0.05, 30, config).applied
    assert not clock._decide(0.2, 0.05, 5, config).applied
    short = clock._decide(0.2, 0.001, 1, config)
    assert not short.applied
    assert short.sigma_s == config.clock_offset_sigma_s
    assert "too short" in short.reason


def test_no_offset_is_made_up_in_short_passes_with_heavy_errors() -> None:
    passes = simulate(PRESETS["stress"], 12, seed=7)
    assert not any(estimate_clock_offset(scene, AlignmentConfig()).applied for scene in passes)
