"""A receiver's noise is no motion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from gaia_uwb.alignment import align
from gaia_uwb.locate import find_places
from gaia_uwb.locate.path_noise import smooth_path, speed_noise_mps
from gaia_uwb.locate.slow_errors import RADIOS
from gaia_uwb.scene import Trajectory
from roads import road_drives

Numbers = NDArray[np.float64]


def turning(t_s: Numbers) -> Numbers:
    """Return a path that goes round at 4 m/s, on a radius of 7 m."""
    return 7.0 * np.stack([np.cos(4.0 / 7.0 * t_s), np.sin(4.0 / 7.0 * t_s)], axis=1)


def test_noise_goes_and_a_tight_turn_stays() -> None:
    t_s = np.arange(0.0, 60.0, 0.05)
    rng = np.random.default_rng(0)
    noisy = Trajectory(t_s, turning(t_s) + 0.02 * rng.normal(size=(len(t_s), 2)))
    left_m = (smooth_path(noisy).position_m - turning(t_s))[10:-10]
    assert left_m.std() < 0.4 * 0.02
    clean_m = smooth_path(Trajectory(t_s, turning(t_s))).position_m - turning(t_s)
    assert np.abs(clean_m).max() < 0.001


def test_a_corner_stays() -> None:
    t_s = np.arange(0.0, 40.0, 0.1)
    there_and_back = np.stack([np.abs(8.0 * (t_s - 20.0)), np.zeros(len(t_s))], axis=1)
    rng = np.random.default_rng(0)
    noisy = Trajectory(t_s, there_and_back + 0.02 * rng.normal(size=(len(t_s), 2)))
    assert np.abs(smooth_path(noisy).position_m - there_and_back).max() < 0.15


def test_gaps_and_uneven_paths_stay_as_they_are() -> None:
    t_s = np.arange(0.0, 20.0, 0.05)
    keep = (t_s < 8.0) | (t_s > 12.0)
    path = Trajectory(t_s[keep], turning(t_s[keep]) + 0.01)
    beside = np.abs(path.t_s - 10.0) < 2.4
    assert np.array_equal(smooth_path(path).position_m[beside], path.position_m[beside])
    rng = np.random.default_rng(0)
    uneven_s = np.sort(rng.uniform(0.0, 20.0, 400))
    uneven = Trajectory(uneven_s, turning(uneven_s) + 0.01 * rng.normal(size=(400, 2)))
    moved = np.abs(smooth_path(uneven).position_m - uneven.position_m).max(axis=1) > 0.0
    assert moved.mean() < 0.05


@pytest.mark.parametrize("step_s", [0.02, 0.125, 0.5])
def test_what_is_left_in_the_speed_is_known(step_s: float) -> None:
    t_s = np.arange(0.0, 400.0, step_s)
    rng = np.random.default_rng(1)
    noisy = Trajectory(t_s, 0.02 * rng.normal(size=(len(t_s), 2)))
    smooth_m = smooth_path(noisy).position_m
    apart = max(round(0.5 / step_s), 1)
    speed_mps = (smooth_m[apart:] - smooth_m[:-apart]) / (apart * step_s)
    assert speed_noise_mps(noisy, 0.5) == pytest.approx(speed_mps.std(), rel=0.1)


def test_a_noisy_path_does_not_tell_the_clock_of_a_steady_drive() -> None:
    off, sigma_s = [], []
    for seed in range(8):
        (scene,) = road_drives("single", seed, radius_m=1e9)
        path = scene.trajectory
        rng = np.random.default_rng(seed)
        noisy = Trajectory(
            path.t_s, path.position_m + 0.02 * rng.normal(size=(len(path), 2)), path.up_m
        )
        log = replace(scene, trajectory=noisy, truth=None)
        episode = align(log)
        errors = find_places([[episode]])[0].errors[0]
        assert scene.truth is not None and scene.truth.clock_offset_s is not None
        applied_s = 0.0 if episode.clock is None else episode.clock.applied_s
        off.append(applied_s + errors.mean[RADIOS] - scene.truth.clock_offset_s)
        sigma_s.append(errors.covariance[RADIOS, RADIOS] ** 0.5)
    scaled = np.abs(np.array(off)) / np.array(sigma_s)
    assert np.median(scaled) < 1.5 and scaled.max() < 4.0
