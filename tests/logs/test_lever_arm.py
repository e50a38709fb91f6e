from __future__ import annotations

import numpy as np
import pytest

from gaia_uwb._shared.errors import InputError
from gaia_uwb.logs._lever_arm import LeverArm, move_to_tag


def test_a_circle_is_analytic() -> None:
    t_s = np.linspace(0, 60, 1201)
    angle, radius_m = t_s / 10, 30.0
    path_m = radius_m * np.column_stack([np.cos(angle), np.sin(angle)])  # counter-clockwise
    moved_m, up_m = move_to_tag(t_s, path_m, np.ones(1201), LeverArm(left_m=2.0, up_m=0.5))
    inner = (t_s > 1) & (t_s < 59)
    np.testing.assert_allclose(np.hypot(*moved_m[inner].T), radius_m - 2.0, atol=1e-6)
    np.testing.assert_allclose(np.hypot(*moved_m.T), radius_m - 2.0, atol=0.01)
    assert up_m is not None
    assert set(up_m) == {1.5}
    ahead_m, _ = move_to_tag(t_s, path_m, None, LeverArm(forward_m=3.0))
    np.testing.assert_allclose(np.hypot(*ahead_m[inner].T), np.hypot(radius_m, 3.0), atol=1e-6)


@pytest.mark.parametrize("azimuth_rad", [0.0, 1.0, 2.5, -3.0])
def test_any_direction(azimuth_rad: float) -> None:
    way = np.array([np.cos(azimuth_rad), np.sin(azimuth_rad)])
    left = np.array([-way[1], way[0]])
    t_s = np.arange(20.0)
    path_m = t_s[:, None] * 3 * way
    moved_m, _ = move_to_tag(t_s, path_m, None, LeverArm(forward_m=-1.0, left_m=0.5))
    np.testing.assert_allclose(moved_m, path_m - way + 0.5 * left, atol=1e-9)


def test_noise_at_a_standstill_does_not_turn_the_vehicle() -> None:
    rng = np.random.default_rng(1)
    t_s = np.arange(300.0)
    east_m = np.concatenate([np.arange(100.0), np.full(100, 99.0), 99 + np.arange(100.0)])
    path_m = np.column_stack([east_m, np.zeros(300)]) + rng.normal(0, 0.02, (300, 2))
    moved_m, _ = move_to_tag(t_s, path_m, None, LeverArm(forward_m=2.0))
    assert np.abs(moved_m - path_m - [2.0, 0.0]).max() < 0.2


def test_a_vehicle_that_never_moves_has_no_heading() -> None:
    with pytest.raises(InputError, match="never gets 1 m from its start"):
        move_to_tag(np.arange(3.0), np.zeros((3, 2)), None, LeverArm(left_m=1.0))
