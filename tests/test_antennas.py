"""Paths of antennas: lever arms turned by heading or course, and one scene per tag."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gaia_uwb import InputError
from gaia_uwb.scene import ConeRanges, RangeLog, Scene, Tag, Trajectory, Truth
from gaia_uwb.scene.antennas import antenna_path, tag_scenes

RADIUS_M = 30.0
T_S = np.linspace(0, 60, 1201)
ROUND = RADIUS_M * np.column_stack([np.cos(T_S / 10), np.sin(T_S / 10)])  # counter-clockwise
HEADING_RAD = T_S / 10 + np.pi / 2


def moved(path: Trajectory, forward_m: float = 0.0, left_m: float = 0.0) -> np.ndarray:
    return antenna_path(path, forward_m, left_m, 0.0).position_m


def test_a_circle_by_course_is_analytic() -> None:
    moved_path = antenna_path(Trajectory(T_S, ROUND, np.ones(1201)), 0.0, 2.0, 0.5)
    inner = (T_S > 1) & (T_S < 59)
    np.testing.assert_allclose(np.hypot(*moved_path.position_m[inner].T), 28.0, atol=1e-6)
    np.testing.assert_allclose(np.hypot(*moved_path.position_m.T), 28.0, atol=0.01)
    assert set(moved_path.up_m.tolist()) == {1.5}
    ahead_m = moved(Trajectory(T_S, ROUND), forward_m=3.0)
    np.testing.assert_allclose(np.hypot(*ahead_m[inner].T), np.hypot(RADIUS_M, 3.0), atol=1e-5)


def test_a_circle_by_heading_is_exact_and_need_not_point_along_the_path() -> None:
    """A vehicle that drives sideways, with its front to the middle of the circle."""
    inwards = replace(Trajectory(T_S, ROUND), heading_rad=T_S / 10 + np.pi)
    path = antenna_path(inwards, 3.0, 0.0, 0.0)
    np.testing.assert_allclose(path.position_m, 0.9 * ROUND, atol=1e-12)
    np.testing.assert_allclose(path.lever_m, -0.1 * ROUND, atol=1e-12)
    rightward = ROUND + 2.0 * np.column_stack([-np.sin(T_S / 10), np.cos(T_S / 10)])
    np.testing.assert_allclose(moved(inwards, left_m=-2.0), rightward, atol=1e-12)


def test_where_the_heading_is_unknown_the_course_stands_for_it() -> None:
    gap = (T_S > 20) & (T_S < 40)
    some = replace(Trajectory(T_S, ROUND), heading_rad=np.where(gap, np.nan, HEADING_RAD + 0.1))
    known = replace(Trajectory(T_S, ROUND), heading_rad=HEADING_RAD + 0.1)
    path_m = moved(some, forward_m=3.0)
    np.testing.assert_array_equal(path_m[~gap], moved(known, forward_m=3.0)[~gap])
    np.testing.assert_array_equal(path_m[gap], moved(Trajectory(T_S, ROUND), forward_m=3.0)[gap])


def test_between_headings_that_are_near_it_is_interpolated() -> None:
    """A heading once a second, for positions at 20 Hz, past north where angles begin anew."""
    rare = np.where(np.arange(1201) % 20 == 0, np.angle(np.exp(1j * (HEADING_RAD + 0.4))), np.nan)
    some = replace(Trajectory(T_S, ROUND), heading_rad=rare)
    every = replace(Trajectory(T_S, ROUND), heading_rad=HEADING_RAD + 0.4)
    expected_m = moved(every, forward_m=3.0)
    np.testing.assert_allclose(moved(some, forward_m=3.0), expected_m, atol=1e-9)
    stands = replace(Trajectory(T_S, 0 * ROUND), heading_rad=rare)
    assert moved(stands, left_m=1.0).shape == (1201, 2)


@pytest.mark.parametrize("azimuth_rad", [0.0, 1.0, 2.5, -3.0])
def test_any_direction(azimuth_rad: float) -> None:
    way = np.array([np.cos(azimuth_rad), np.sin(azimuth_rad)])
    left = np.array([-way[1], way[0]])
    t_s = np.arange(20.0)
    path_m = t_s[:, None] * 3 * way
    moved_m = moved(Trajectory(t_s, path_m), -1.0, 0.5)
    np.testing.assert_allclose(moved_m, path_m - way + 0.5 * left, atol=1e-9)


def test_noise_at_a_standstill_does_not_turn_the_vehicle() -> None:
    rng = np.random.default_rng(1)
    t_s = np.arange(300.0)
    east_m = np.concatenate([np.arange(100.0), np.full(100, 99.0), 99 + np.arange(100.0)])
    path_m = np.column_stack([east_m, np.zeros(300)]) + rng.normal(0, 0.02, (300, 2))
    moved_m = moved(Trajectory(t_s, path_m), forward_m=2.0)
    assert np.abs(moved_m - path_m - [2.0, 0.0]).max() < 0.2


def test_a_vehicle_that_stands_in_a_bend_keeps_its_course() -> None:
    """It turns as it drives, not as time passes."""
    angle = np.concatenate([np.linspace(0, 1, 200), np.full(400, 1.0), np.linspace(1, 2, 200)])
    path_m = RADIUS_M * np.column_stack([np.cos(angle), np.sin(angle)])
    lever_m = antenna_path(Trajectory(np.arange(800.0), path_m), 2.0, 0.0, 0.0).lever_m
    inner = slice(10, -10)
    ahead_m = 2.0 * np.column_stack([-np.sin(angle), np.cos(angle)])
    np.testing.assert_allclose(lever_m[inner], ahead_m[inner], atol=1e-5)
    assert np.ptp(lever_m[200:600], axis=0).max() == 0.0


def test_a_vehicle_that_never_moves_needs_a_heading() -> None:
    stands = Trajectory(np.arange(3.0), np.zeros((3, 2)))
    with pytest.raises(InputError, match="never gets 1 m from its start"):
        moved(stands, left_m=1.0)
    east = replace(stands, heading_rad=np.zeros(3))
    np.testing.assert_allclose(moved(east, left_m=1.0), [[0.0, 1.0]] * 3)
    with pytest.raises(InputError, match="never gets 1 m from its start"):
        moved(replace(stands, heading_rad=np.array([0.0, np.nan, np.nan])), left_m=1.0)


@pytest.mark.parametrize(
    ("arm", "roll", "pitch", "expected"),
    [
        ((2.0, 0.0, 0.0), 0.0, np.pi / 6, (np.sqrt(3.0), 0.0, -1.0)),  # the nose is down
        ((0.0, 2.0, 0.0), np.pi / 6, 0.0, (0.0, np.sqrt(3.0), 1.0)),  # the left side is up
        ((0.0, 0.0, 2.0), 0.0, np.pi / 6, (1.0, 0.0, np.sqrt(3.0))),  # the roof goes forward
        ((0.0, 0.0, 2.0), np.pi / 6, 0.0, (0.0, -1.0, np.sqrt(3.0))),  # the roof goes to the right
        ((0.0, 2.0, 0.0), np.pi / 2, np.pi / 2, (2.0, 0.0, 0.0)),  # first rolled, then pitched
        ((0.0, 0.0, 2.0), np.nan, np.nan, (0.0, 0.0, 2.0)),  # unknown: level
    ],
)
def test_roll_and_pitch_as_in_rep_103(
    arm: tuple[float, float, float], roll: float, pitch: float, expected: tuple[float, ...]
) -> None:
    level = Trajectory(np.arange(2.0), np.array([[0.0, 0.0], [5.0, 0.0]]), np.zeros(2))
    path = antenna_path(
        replace(level, roll_rad=np.full(2, roll), pitch_rad=np.full(2, pitch)), *arm
    )
    lever = (*path.lever_m[0].tolist(), path.up_m[0])
    np.testing.assert_allclose(lever, expected, atol=1e-12)


DRIVE = Trajectory(np.arange(3.0), np.array([[0.0, 0.0], [0.0, 5.0], [0.0, 10.0]]), np.ones(3))
LOG = RangeLog(
    t_s=np.array([0.1, 0.1, 0.5, 0.7]),
    anchor=np.array([0, 0, 1, 0]),
    range_m=np.array([5.0, 6.0, 7.0, 8.0]),
    rssi_dbm=np.array([-80.0, -81.0, -82.0, -83.0]),
    tag=np.array([0, 1, 1, 0]),
    azimuth_rad=np.array([0.1, np.nan, 0.3, 0.4]),
)
SCENE = Scene(
    name="pass",
    trajectory=DRIVE,
    ranges=LOG,
    anchor_ids=("a", "b"),
    anchor_up_m=np.array([0.9, np.nan]),
    truth=Truth(
        np.zeros((2, 2)),
        nlos=np.array([True, False, True, False]),
        range_m=np.array([4.0, 5.0, 6.0, 7.0]),
        bias_m=np.array([0.1, 0.2, 0.3, 0.4]),
        clock_offset_s=0.3,
    ),
    notes=("read twice",),
    tags=(Tag("f", forward_m=2.0, up_m=0.5), Tag("l", left_m=1.0, own_clock=True)),
    cone_ranges=ConeRanges(np.array([0]), np.array([1]), np.array([6.0])),
)


def test_each_tag_has_its_own_path_and_readings() -> None:
    front, left = tag_scenes(SCENE)
    assert (front.name, left.name) == ("pass (tag f)", "pass (tag l)")
    np.testing.assert_allclose(front.trajectory.position_m[:, 1], [2.0, 7.0, 12.0])
    np.testing.assert_allclose(left.trajectory.position_m[:, 0], [-1.0, -1.0, -1.0])
    assert front.trajectory.up_m.tolist() == [1.5, 1.5, 1.5]
    assert front.ranges.range_m.tolist() == [5.0, 8.0]
    assert left.ranges.anchor.tolist() == [0, 1]
    assert left.ranges.rssi_dbm.tolist() == [-81.0, -82.0]
    np.testing.assert_array_equal(left.ranges.azimuth_rad, [np.nan, 0.3])
    assert left.ranges.tag is None
    assert front.truth.range_m.tolist() == [4.0, 7.0]
    assert left.truth.nlos.tolist() == [False, True]
    assert left.truth.bias_m.tolist() == [0.2, 0.3]
    assert front.truth.outlier is None
    assert left.truth.clock_offset_s == 0.3
    for one in (front, left):
        assert one.anchor_ids == SCENE.anchor_ids
        assert one.notes == SCENE.notes
        assert one.cone_ranges is SCENE.cone_ranges
        assert tag_scenes(one) == (one,)
    assert (front.tags, left.tags) == ((SCENE.tags[0],), (SCENE.tags[1],))
    assert {front.drive, left.drive} == {SCENE.name}


def test_a_scene_without_lever_arms_comes_back_as_it_is() -> None:
    plain = replace(SCENE, tags=(), ranges=replace(LOG, tag=None, anchor=np.array([0, 1, 1, 0])))
    assert tag_scenes(plain)[0] is plain


def test_a_tag_without_readings_has_no_scene() -> None:
    more = replace(SCENE, tags=(*SCENE.tags, Tag("roof")))
    assert [one.tags[0].tag_id for one in tag_scenes(more)] == ["f", "l"]


def test_one_tag_with_a_lever_arm_takes_all_readings() -> None:
    (one,) = tag_scenes(
        replace(
            SCENE, tags=SCENE.tags[:1], ranges=replace(LOG, tag=None, anchor=np.array([0, 1, 1, 0]))
        )
    )
    assert len(one.ranges) == 4
    assert one.trajectory.position_m[0].tolist() == pytest.approx([0.0, 2.0])


def test_a_lever_arm_without_a_heading_names_the_scene() -> None:
    stands = replace(SCENE, trajectory=replace(DRIVE, position_m=np.zeros((3, 2))))
    with pytest.raises(InputError, match=r"^pass, column tags: a lever arm needs a heading"):
        tag_scenes(stands)
