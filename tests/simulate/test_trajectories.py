"""The vehicle keeps its speed and its lane, and merges before the taper."""

from __future__ import annotations

import numpy as np
import pytest

from gaia_uwb._typing import Array, Float64
from gaia_uwb.simulate.layouts import corners_along_m
from gaia_uwb.simulate.presets import DriveConfig, PassConfig, RoadConfig
from gaia_uwb.simulate.trajectories import plan_drive, record_trajectory

EAST = RoadConfig(direction_rad=0.0, curvature_per_m=0.0)  # along is east, open is north
STEADY = DriveConfig(speed_variation=0.0, sway_m=0.0, position_sigma_m=0.0)


def lane_offset_m(config: PassConfig, along_m: Float64[Array, "K"]) -> Float64[Array, "K"]:
    """Return how far north of the lane line the vehicle is where it passes these places."""
    drive = config.drive
    middle_m = corners_along_m(config)[-1] / 2
    t_s = drive.duration_s / 2 + (along_m - middle_m) / drive.speed_mps
    position_m = plan_drive(config, np.random.default_rng(0)).position_m(t_s)
    np.testing.assert_allclose(position_m[:, 0], along_m, atol=1e-9)
    return position_m[:, 1]


def test_vehicle_merges_before_the_taper_and_moves_back_behind_the_closure() -> None:
    config = PassConfig(road=EAST, drive=STEADY)
    end_m = corners_along_m(config)[-1]
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
    rng = np.random.default_rng(3)
    t_s = np.arange(0.0, 60.0, 0.5)
    sway_m = [plan_drive(config, rng).position_m(t_s)[:, 1] - 1.8 for _ in range(200)]
    assert np.sqrt(np.mean(np.square(sway_m))) == pytest.approx(0.2, rel=0.05)
    assert abs(np.mean(sway_m)) < 0.02


def test_recording_has_its_rate_height_and_noise() -> None:
    config = PassConfig(drive=DriveConfig(rate_hz=10.0, position_sigma_m=0.05))
    rng = np.random.default_rng(4)
    drive = plan_drive(config, rng)
    path = record_trajectory(drive, rng)
    np.testing.assert_allclose(path.t_s, np.arange(601) / 10)
    np.testing.assert_array_equal(path.up_m, 1.6)
    noise_m = path.position_m - drive.position_m(path.t_s)
    assert noise_m.std() == pytest.approx(0.05, rel=0.1)


def test_speed_swings_about_its_mean() -> None:
    drive = STEADY.model_copy(update={"speed_variation": 0.4, "duration_s": 170.0})  # ten periods
    config = PassConfig(road=EAST, drive=drive)
    t_s = np.linspace(0, 170, 17001)
    east_m = plan_drive(config, np.random.default_rng(6)).position_m(t_s)[:, 0]
    speed_mps = np.gradient(east_m, t_s)
    assert speed_mps.min() == pytest.approx(6 * 0.6, rel=1e-3)
    assert speed_mps.max() == pytest.approx(6 * 1.4, rel=1e-3)
    assert east_m[-1] - east_m[0] == pytest.approx(170 * 6)
    assert east_m[8500] == pytest.approx(corners_along_m(config)[-1] / 2)


def test_speed_is_kept_along_the_road() -> None:
    config = PassConfig(drive=STEADY)
    path = record_trajectory(plan_drive(config, np.random.default_rng(0)), np.random.default_rng(0))
    assert path.path_length_m == pytest.approx(60 * 6, rel=0.01)


def test_parked_vehicle_stands_beside_the_middle() -> None:
    config = PassConfig(road=EAST, drive=DriveConfig(speed_mps=0.0, sway_m=0.0))
    position_m = plan_drive(config, np.random.default_rng(0)).position_m(np.linspace(0, 60, 9))
    np.testing.assert_allclose(position_m, [[corners_along_m(config)[-1] / 2, 1.8]] * 9, atol=1e-9)
