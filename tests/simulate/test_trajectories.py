"""The vehicle keeps its speed and its lane, and merges before the taper."""

from __future__ import annotations

import numpy as np
import pytest

from gaia_uwb._shared.arrays import Array, Float64
from gaia_uwb.simulate.layouts import plan_zone
from gaia_uwb.simulate.settings import ClosureConfig, DriveConfig, PassConfig, RoadConfig
from gaia_uwb.simulate.trajectories import PHASES, Drive, plan_drive, record_positions

EAST = RoadConfig(direction_rad=0.0, curvature_per_m=0.0)  # along is east, open is north
STEADY = DriveConfig(speed_variation=0.0, sway_m=0.0, position_sigma_m=0.0)


def drive_of(config: PassConfig, seed: int = 0) -> Drive:
    return plan_drive(config, plan_zone(config), np.random.default_rng(seed).random(PHASES))


def lane_offset_m(config: PassConfig, along_m: Float64[Array, "K"]) -> Float64[Array, "K"]:
    """Return how far north of the lane line the vehicle is where it passes these places."""
    drive = config.drive
    middle_m = plan_zone(config).end_m / 2
    t_s = drive.duration_s / 2 + (along_m - middle_m) / drive.speed_mps
    position_m = drive_of(config).position_m(t_s)
    np.testing.assert_allclose(position_m[:, 0], along_m, atol=1e-9)
    return position_m[:, 1]


def test_vehicle_merges_before_the_taper_and_moves_back_behind_the_closure() -> None:
    config = PassConfig(road=EAST, drive=STEADY)
    end_m = plan_zone(config).end_m
    places = np.array([-70, -60, -40, -20, 0, end_m, end_m + 20, end_m + 40, end_m + 60])
    np.testing.assert_allclose(
        lane_offset_m(config, places), [-1.8, -1.8, 0, 1.8, 1.8, 1.8, 1.8, 0, -1.8], atol=1e-9
    )


def test_without_lane_change_the_path_is_straight() -> None:
    drive = STEADY.model_copy(update={"lane_change": False})
    offset_m = lane_offset_m(PassConfig(road=EAST, drive=drive), np.linspace(-100, 300, 50))
    np.testing.assert_allclose(offset_m, 1.8, atol=1e-9)


def test_lane_change_is_smooth() -> None:
    config = PassConfig(road=EAST, drive=STEADY)
    along_m = np.linspace(-80, 320, 4001)
    slope = np.gradient(lane_offset_m(config, along_m), along_m)
    assert np.abs(slope).max() == pytest.approx(3.6 * 1.875 / 40, rel=1e-3)  # minimum jerk
    assert np.abs(np.gradient(slope, along_m)).max() < 0.02  # no corner


def test_sway_has_its_root_mean_square() -> None:
    drive = DriveConfig(lane_change=False, sway_m=0.2, position_sigma_m=0.0)
    config = PassConfig(road=EAST, drive=drive)
    t_s = np.arange(0.0, 60.0, 0.5)
    sway_m = [drive_of(config, k).position_m(t_s)[:, 1] - 1.8 for k in range(200)]
    assert np.sqrt(np.mean(np.square(sway_m))) == pytest.approx(0.2, rel=0.05)
    assert abs(np.mean(sway_m)) < 0.02


def test_recording_has_its_noise() -> None:
    true_m = np.zeros((1, 5000, 2))
    settings, rng = DriveConfig(position_sigma_m=0.05), np.random.default_rng(4)
    position_m, known = record_positions(true_m, settings, [lambda _: rng])
    assert position_m.std() == pytest.approx(0.05, rel=0.04)
    assert known.all()


def test_recorded_positions_are_off_by_a_constant_and_walk_away() -> None:
    quiet = DriveConfig(position_sigma_m=0.0, rate_hz=10.0)
    biased = quiet.model_copy(update={"position_bias_m": 0.5})
    walking = quiet.model_copy(update={"position_walk_m": 0.2})
    rng = np.random.default_rng(5)
    many = [lambda _: rng] * 1000
    offsets, _ = record_positions(np.zeros((1000, 9, 2)), biased, many)
    assert np.ptp(offsets, axis=1).max() == 0
    assert np.std(offsets) == pytest.approx(0.5, rel=0.05)
    ends = record_positions(np.zeros((1000, 90, 2)), walking, many)[0][:, -1]
    assert np.std(ends) == pytest.approx(0.2 * 3, rel=0.08)  # after 9 s


def test_positioning_fails_for_its_share_of_the_time() -> None:
    failing = DriveConfig(
        position_sigma_m=0.0, position_outage_per_s=0.1, position_outage_s=2.5, rate_hz=10.0
    )
    rng = np.random.default_rng(6)
    known = record_positions(np.zeros((1, 40_000, 2)), failing, [lambda _: rng])[1]
    assert known[:, [0, -1]].all()
    assert known.mean() == pytest.approx(10 / 12.5, abs=0.03)


def test_stop_holds_the_vehicle_and_leaves_the_rest_of_the_drive_as_it_was() -> None:
    stopping = STEADY.model_copy(update={"stop_s": 5.0, "lane_change": False})
    t_s = np.arange(0, 60, 0.01)
    going, stopped = (
        drive_of(PassConfig(road=EAST, drive=drive)).position_m(t_s)[:, 0]
        for drive in (stopping.model_copy(update={"stop_s": 0.0}), stopping)
    )
    speed_mps = np.gradient(stopped, t_s)
    assert np.sum(speed_mps < 1e-3) * 0.01 == pytest.approx(5, abs=0.1)
    assert np.abs(np.diff(speed_mps)).max() < 0.05  # brakes and starts gently
    np.testing.assert_allclose(stopped[t_s > 26], going[t_s > 26], atol=1e-9)
    np.testing.assert_allclose(speed_mps[t_s < 14], 6, atol=1e-6)
    assert speed_mps.max() < 6.001


def test_u_turn_comes_back_on_the_other_carriageway() -> None:
    drive = STEADY.model_copy(
        update={"turn_after_m": 50.0, "lane_change": False, "duration_s": 120.0}
    )
    config = PassConfig(road=EAST, drive=drive, closure=ClosureConfig(median_m=8.0))
    t_s = np.arange(0, 120, 0.01)
    position_m = drive_of(config).position_m(t_s)
    turn_m = plan_zone(config).end_m + 50
    assert position_m[:, 0].max() == pytest.approx(turn_m + 3.6 + 4, abs=0.01)
    back_m = position_m[-1]
    assert back_m[1] == pytest.approx(1.8 + 2 * (3.6 + 4))  # the carriageway's far lane
    assert np.diff(position_m[-100:, 0]).max() < 0
    steps_m = np.hypot(*np.diff(position_m, axis=0).T)
    np.testing.assert_allclose(steps_m, 0.06, rtol=1e-3)  # the speed is kept through the turn


def test_speed_swings_about_its_mean() -> None:
    drive = STEADY.model_copy(update={"speed_variation": 0.4, "duration_s": 170.0})  # ten periods
    config = PassConfig(road=EAST, drive=drive)
    t_s = np.linspace(0, 170, 17001)
    east_m = drive_of(config, 6).position_m(t_s)[:, 0]
    speed_mps = np.gradient(east_m, t_s)
    assert speed_mps.min() == pytest.approx(6 * 0.6, rel=1e-3)
    assert speed_mps.max() == pytest.approx(6 * 1.4, rel=1e-3)
    assert east_m[-1] - east_m[0] == pytest.approx(170 * 6)
    assert east_m[8500] == pytest.approx(plan_zone(config).end_m / 2)


def test_speed_is_kept_along_the_road() -> None:
    config = PassConfig(drive=STEADY)
    position_m = drive_of(config).position_m(np.linspace(0, 60, 601))
    assert np.hypot(*np.diff(position_m, axis=0).T).sum() == pytest.approx(60 * 6, rel=0.01)


def test_parked_vehicle_stands_beside_the_middle() -> None:
    config = PassConfig(road=EAST, drive=DriveConfig(speed_mps=0.0, sway_m=0.0))
    position_m = drive_of(config).position_m(np.linspace(0, 60, 9))
    np.testing.assert_allclose(position_m, [[plan_zone(config).end_m / 2, 1.8]] * 9, atol=1e-9)
