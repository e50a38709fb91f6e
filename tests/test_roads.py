"""The drives along roads are what they say: geometry, errors, and nothing of the simulator's."""

from __future__ import annotations

import ast
from pathlib import Path

import numpy as np
import pytest

import roads
from roads import KINDS, TAG_UP_M, Radios, Road, road_drives


def test_a_bend_is_an_arc_and_a_straight_road_is_its_limit() -> None:
    along_m = np.linspace(0.0, 300.0, 7)
    bend = Road(0.3, 1 / 200.0)
    centre = 200.0 * np.array([-np.sin(0.3), np.cos(0.3)])
    for left_m in (-3.0, 0.0, 5.0):
        away_m = np.hypot(*(bend.place(along_m, left_m) - centre).T)
        np.testing.assert_allclose(away_m, 200.0 - left_m, rtol=1e-12)
    straight, nearly = (Road(0.3, curvature).place(along_m, 2.0) for curvature in (0.0, 1e-12))
    np.testing.assert_allclose(straight, nearly, atol=1e-6)


@pytest.mark.parametrize("kind", KINDS)
def test_ranges_are_true_but_for_the_errors_asked_for(kind: str) -> None:
    radios = Radios(noise_m=0.0, bias_m=0.15, delay_m=0.0, offset_s=0.12, trucks_per_s=0.0)
    for scene in road_drives(kind, 3, radios=radios):
        assert scene.truth is not None
        assert scene.truth.range_m is not None
        t_s = scene.ranges.t_s - 0.12
        drive = scene.trajectory
        tag = np.stack([np.interp(t_s, drive.t_s, axis) for axis in drive.position_m.T], axis=1)
        flat_m = np.hypot(*(tag - scene.truth.anchor_m[scene.ranges.anchor]).T)
        true_m = np.hypot(flat_m, TAG_UP_M - roads.CONE_UP_M)
        np.testing.assert_allclose(scene.ranges.range_m, true_m + 0.15, atol=1e-9)
        np.testing.assert_allclose(scene.truth.range_m, true_m, atol=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_the_vehicle_drives_like_one(kind: str) -> None:
    for seed in range(5):
        for scene in road_drives(kind, seed):
            step_m = np.hypot(*np.diff(scene.trajectory.position_m, axis=0).T)
            assert step_m.max() * roads.POSES_PER_S < 25.0
            assert 20 <= scene.n_anchors <= 40
            assert scene.truth is not None
            path = scene.trajectory.position_m
            away_m = [np.hypot(*(path - cone).T).min() for cone in scene.truth.anchor_m]
            assert min(away_m) > 1.0  # it drives over no cone
            assert max(away_m) < 20.0


def test_the_same_seed_is_the_same_drive_and_another_is_not() -> None:
    one, same, other = (road_drives("single", seed)[0] for seed in (1, 1, 2))
    np.testing.assert_array_equal(one.ranges.range_m, same.ranges.range_m)
    assert len(one.ranges) != len(other.ranges)


def test_a_truck_makes_ranges_longer_and_is_labelled() -> None:
    scene = road_drives("single", 4, radios=Radios(noise_m=0.0, delay_m=0.0, trucks_per_s=0.5))[0]
    truth = scene.truth
    assert truth is not None
    assert truth.nlos is not None
    assert truth.range_m is not None
    error_m = scene.ranges.range_m - truth.range_m
    np.testing.assert_allclose(error_m[~truth.nlos], 0.15, atol=1e-9)
    assert truth.nlos.any()
    assert (error_m[truth.nlos] > 0.15).all()


def test_no_code_is_shared_with_the_simulator() -> None:
    tree = ast.parse(Path(roads.__file__).read_text(encoding="utf-8"))
    named = {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    assert {name for name in named if name and name.startswith("gaia_uwb")} == {"gaia_uwb.scene"}
