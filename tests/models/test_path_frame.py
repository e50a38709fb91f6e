from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, strategies as st

from gaia_uwb.models.path_frame import PathFrame, road_parabola


def bent_path(seed: int) -> np.ndarray:
    """Return two paths (2, T, 2) with a clear direction of travel."""
    rng = np.random.default_rng(seed)
    along_m = np.linspace(0, 60, 40)
    left_m = rng.normal(size=(2, 1)) * along_m**2 / 500 + rng.normal(scale=0.2, size=(2, 40))
    return np.stack([np.broadcast_to(along_m, left_m.shape), left_m], axis=-1)


def turned(points: np.ndarray, angle_rad: float) -> np.ndarray:
    cos, sin = np.cos(angle_rad), np.sin(angle_rad)
    return points @ np.array([[cos, sin], [-sin, cos]])


@given(st.integers(0, 1000), st.floats(-3, 3), st.floats(-1e4, 1e4))
def test_a_scene_that_is_moved_and_turned_looks_the_same(
    seed: int, angle_rad: float, shift_m: float
) -> None:
    path_m = bent_path(seed)
    seen = PathFrame.of(path_m).enter(path_m)
    moved = turned(path_m, angle_rad) + np.array([shift_m, -2 * shift_m])
    np.testing.assert_allclose(PathFrame.of(moved).enter(moved), seen, atol=1e-6)


@given(st.integers(0, 1000))
def test_a_mirrored_scene_is_mirrored(seed: int) -> None:
    path_m = bent_path(seed)
    seen = PathFrame.of(path_m).enter(path_m)
    mirrored = path_m * [1, -1]
    np.testing.assert_allclose(PathFrame.of(mirrored).enter(mirrored), seen * [1, -1], atol=1e-9)


def test_the_vehicle_drives_ahead_and_back_again_in_its_own_frame() -> None:
    path_m = bent_path(3)
    for driven_m in (path_m, path_m[:, ::-1]):
        seen = PathFrame.of(driven_m).enter(driven_m)
        assert (seen[:, -1, 0] > seen[:, 0, 0]).all()


def test_leaving_undoes_entering_and_covariances_turn_along() -> None:
    rng = np.random.default_rng(0)
    path_m = turned(bent_path(5), 0.7) + np.array([300.0, -20.0])
    frame = PathFrame.of(path_m)
    places_m = rng.normal(scale=30, size=(2, 6, 2))
    np.testing.assert_allclose(frame.leave(frame.enter(places_m)), places_m, atol=1e-9)
    # The covariance of points that leave the frame is the frame's covariance, turned.
    cloud = rng.normal(size=(2, 4000, 2)) * [3.0, 0.5]
    inside = np.stack([np.cov(points.T) for points in cloud])
    outside = np.stack([np.cov(points.T) for points in frame.leave(cloud)])
    found = frame.turn_covariance(inside[:, None])[:, 0]
    np.testing.assert_allclose(found, outside, atol=1e-9)


@pytest.mark.parametrize("bend_per_m", [-0.004, 0.0, 0.002])
def test_the_parabola_continues_an_arc(bend_per_m: float) -> None:
    along_m = np.linspace(-40, 40, 81)
    path_m = np.stack([along_m, bend_per_m * along_m**2 + 0.3 + 0.01 * along_m], axis=-1)
    found = road_parabola(path_m[None])[0]
    # A slight pull to the straight line is there on purpose: for paths that stand still.
    off = np.abs(found - [0.3, 0.01, bend_per_m])
    assert (off < [0.03, 1e-4, 5e-5]).all()


def test_a_vehicle_that_stands_still_is_on_a_straight_road() -> None:
    rng = np.random.default_rng(1)
    path_m = rng.normal(scale=0.01, size=(1, 64, 2))
    frame = PathFrame.of(path_m)
    assert np.isfinite(frame.axes).all()
    assert abs(road_parabola(frame.enter(path_m))[0, 2]) < 1e-3
