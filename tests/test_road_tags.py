"""Drives with several tags are what they say: geometry, angles, ranges among cones, errors."""

from __future__ import annotations

import ast
from pathlib import Path

import numpy as np
import pytest

import road_tags
from gaia_uwb.scene import Scene, Tag, tag_scenes
from road_tags import road_drive_with_tags, vehicle_with_tags
from roads import Numbers, Radios

ACROSS = [(0.5, 0.8), (0.5, -0.8, 0.3)]
PERFECT = Radios(noise_m=0.0, bias_m=0.0, delay_m=0.0, offset_s=0.0, trucks_per_s=0.0)


@pytest.fixture
def exact(monkeypatch: pytest.MonkeyPatch) -> None:
    """Vehicles of which all is true that a log states."""
    for name in ("POSITION_SIGMA_M", "LEVER_SIGMA_M", "HEADING_SIGMA_RAD", "TAG_DELAY_SIGMA_M"):
        monkeypatch.setattr(road_tags, name, 0.0)
    for name in ("ANGLE_BIAS_SIGMA_RAD", "WILD_ANGLES"):
        monkeypatch.setattr(road_tags, name, 0.0)


def seen(scene: Scene) -> tuple[Numbers, Numbers]:
    """Return distance and bearing of each reading's cone from its tag, by the stated lever arms."""
    assert scene.truth is not None
    range_m, bearing_rad = [], []
    for one in tag_scenes(scene):
        path, log = one.trajectory, one.ranges
        assert path.up_m is not None
        at_m = [np.interp(log.t_s, path.t_s, axis) for axis in (*path.position_m.T, path.up_m)]
        east_m, north_m = scene.truth.anchor_m[log.anchor].T - at_m[:2]
        range_m.append(np.hypot(np.hypot(east_m, north_m), at_m[2] - road_tags.CONE_UP_M))
        bearing_rad.append(np.arctan2(north_m, east_m))
    return np.concatenate(range_m), np.concatenate(bearing_rad)


@pytest.mark.usefixtures("exact")
@pytest.mark.parametrize("radius_m", [None, 150.0])
def test_without_errors_ranges_and_angles_are_those_of_the_stated_antennas(
    radius_m: float | None,
) -> None:
    scene = road_drive_with_tags(2, ACROSS, radius_m=radius_m, radios=PERFECT, angle_sigma_deg=1e-9)
    assert scene.tags == (Tag("t0", 0.5, 0.8), Tag("t1", 0.5, -0.8, 0.3))
    of_tags = tag_scenes(scene)
    range_m, bearing_rad = seen(scene)
    np.testing.assert_allclose(
        np.concatenate([one.ranges.range_m for one in of_tags]), range_m, atol=0.01
    )
    for one, bearings_rad in zip(
        of_tags, np.split(bearing_rad, [len(of_tags[0].ranges)]), strict=True
    ):
        azimuth_rad = one.ranges.azimuth_rad
        assert azimuth_rad is not None
        step_m = np.gradient(one.trajectory.position_m, axis=0)
        course_rad = np.unwrap(np.arctan2(step_m[:, 1], step_m[:, 0]))
        ahead_rad = np.interp(one.ranges.t_s, one.trajectory.t_s, course_rad)
        off_rad = np.angle(np.exp(1j * (azimuth_rad + ahead_rad - bearings_rad)))
        assert np.abs(off_rad).max() < 0.02  # the course at the antenna and at the reference point


def test_what_a_log_states_of_its_vehicle_is_not_quite_true() -> None:
    vehicles = [vehicle_with_tags(seed, ACROSS) for seed in range(400)]
    levers_m = np.stack([one.levers_m for one in vehicles])
    np.testing.assert_allclose(levers_m.mean(axis=0)[:, :2], [[0.5, 0.8], [0.5, -0.8]], atol=0.005)
    np.testing.assert_allclose(levers_m.std(axis=0)[:, :2], 0.02, rtol=0.15)
    np.testing.assert_allclose(np.std([one.turned_rad for one in vehicles]), 0.01745, rtol=0.15)
    np.testing.assert_allclose(np.std([one.delays_m for one in vehicles]), 0.05, rtol=0.15)
    np.testing.assert_allclose(np.std([one.patterns_m for one in vehicles]), 0.03, rtol=0.15)


def test_errors_are_those_of_the_vehicle() -> None:
    quiet = Radios(noise_m=0.0, delay_m=0.0, trucks_per_s=0.0, tag_pattern_m=0.0)
    scene = road_drive_with_tags(3, ACROSS, radios=quiet, vehicle=7, angle_sigma_deg=5.0)
    own = vehicle_with_tags(7, ACROSS, quiet)
    for k, one in enumerate(tag_scenes(scene)):
        assert one.truth is not None
        assert one.truth.range_m is not None
        error_m = one.ranges.range_m - one.truth.range_m
        np.testing.assert_allclose(error_m, 0.15 + own.delays_m[k], atol=1e-9)


def test_drives_of_one_seed_differ_in_what_they_are_asked_for_alone() -> None:
    one = road_drive_with_tags(5, ACROSS[:1])
    two = tag_scenes(road_drive_with_tags(5, ACROSS, angle_sigma_deg=10.0, cone_to_cone=True))[0]
    np.testing.assert_array_equal(one.ranges.range_m, two.ranges.range_m)
    np.testing.assert_array_equal(one.trajectory.t_s, two.trajectory.t_s)
    assert one.cone_ranges is None
    assert one.ranges.azimuth_rad is None
    other = road_drive_with_tags(6, ACROSS[:1])
    assert len(other.ranges) != len(one.ranges)


def test_half_of_the_seeds_have_cones_on_both_sides() -> None:
    for seed in range(6):
        scene = road_drive_with_tags(seed, [(0.0, 0.0)])
        assert scene.truth is not None
        path = scene.trajectory.position_m
        way = path[-1] - path[0]
        to_cone = scene.truth.anchor_m - path[0]
        left = way[0] * to_cone[:, 1] - way[1] * to_cone[:, 0] > 0
        assert left.sum() in ((10,) if seed % 2 else (0, 20))
        aside_m = np.abs(way[0] * to_cone[:, 1] - way[1] * to_cone[:, 0]) / np.hypot(*way)
        assert aside_m.min() > 1.5
        assert aside_m.max() < 6.0


def test_a_steady_drive_keeps_its_speed_and_its_line() -> None:
    steady, other = (
        road_drive_with_tags(4, [(0.0, 0.0)], steady=steady).trajectory for steady in (True, False)
    )
    uneven_m, aside_m = [], []
    for path in (steady, other):
        way = path.position_m[-1] - path.position_m[0]
        along_m, left_m = (
            path.position_m @ (unit / np.hypot(*way)) for unit in (way, way[::-1] * [-1, 1])
        )
        line = np.polynomial.Polynomial.fit(path.t_s, along_m, 1)
        uneven_m.append(np.std(along_m - line(path.t_s)))
        aside_m.append(np.std(left_m))
    assert uneven_m[0] < 0.012  # the noise of positions
    assert uneven_m[1] > 0.1
    assert aside_m[0] < 0.04
    assert aside_m[1] > 0.08


def test_cones_range_their_neighbours_through_the_delays_of_both() -> None:
    scene = road_drive_with_tags(1, [(0.0, 0.0)], cone_to_cone=True, neighbours=3)
    assert scene.truth is not None
    assert scene.cone_ranges is not None
    a, b = scene.cone_ranges.anchor_a, scene.cone_ranges.anchor_b
    apart_m = np.hypot(*(scene.truth.anchor_m[a] - scene.truth.anchor_m[b]).T)
    assert apart_m.max() < 40.0
    pairs, counts = np.unique(np.stack([a, b]), axis=1, return_counts=True)
    assert (pairs[0] < pairs[1]).all()
    assert (counts == 20).all()
    assert set(pairs.ravel().tolist()) == set(range(20))
    error_m = (scene.cone_ranges.range_m - apart_m).reshape(-1, 20)
    assert 0.05 < np.sqrt(error_m.var(axis=1).mean()) < 0.07
    assert abs(error_m.mean() - 0.15) < 0.03
    quiet = road_drive_with_tags(
        1, [(0.0, 0.0)], cone_to_cone=True, neighbours=3, radios=Radios(noise_m=0.0, bias_m=0.0)
    )
    assert quiet.cone_ranges is not None
    error_m = quiet.cone_ranges.range_m - apart_m
    both = np.zeros((len(a), 20))
    both[np.arange(len(a)), a] = both[np.arange(len(a)), b] = 1.0
    delays_m = np.linalg.lstsq(both, error_m)[0]
    np.testing.assert_allclose(both @ delays_m, error_m, atol=1e-9)
    assert 0.02 < delays_m.std() < 0.05


def test_angles_have_a_bias_their_noise_and_some_that_say_nothing() -> None:
    scene = road_drive_with_tags(2, ACROSS, angle_sigma_deg=4.0)
    own = vehicle_with_tags(2, ACROSS)
    _, bearing_rad = seen(scene)
    of_tags = tag_scenes(scene)
    way = scene.trajectory.position_m[-1] - scene.trajectory.position_m[0]
    ahead_rad = np.arctan2(way[1], way[0]) + own.turned_rad
    starts = np.cumsum([0, *(len(one.ranges) for one in of_tags)])
    for k, one in enumerate(of_tags):
        assert one.ranges.azimuth_rad is not None
        assert one.truth is not None
        assert one.truth.range_m is not None
        far = one.truth.range_m > 40.0  # stamps are late, and the bearing of a near cone turns fast
        turned_rad = one.ranges.azimuth_rad + ahead_rad - bearing_rad[starts[k] : starts[k + 1]]
        off_rad = np.angle(np.exp(1j * turned_rad))[far]
        middle_rad = np.median(off_rad)
        assert abs(middle_rad - own.angle_biases_rad[k]) < np.radians(0.6)
        inner = np.abs(off_rad - middle_rad) < np.radians(16.0)
        assert 0.02 < 1 - inner.mean() < 0.08
        np.testing.assert_allclose(np.std(off_rad[inner]), np.radians(4.0), rtol=0.15)


def test_no_code_is_shared_with_the_simulator() -> None:
    tree = ast.parse(Path(road_tags.__file__).read_text(encoding="utf-8"))
    named = {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    assert {name for name in named if name and name.startswith("gaia_uwb")} == {"gaia_uwb.scene"}
