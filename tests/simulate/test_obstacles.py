"""A box cuts exactly the rays that shapely finds crossing its footprint below its top."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, strategies as st
from shapely import LineString, box

from gaia_uwb._shared.arrays import Array, Bool, Float64
from gaia_uwb.simulate.layouts import plan_zone
from gaia_uwb.simulate.obstacles import Obstacles, place_obstacles
from gaia_uwb.simulate.rows import PassRows
from gaia_uwb.simulate.settings import ClosureConfig, PassConfig, RoadConfig

EAST = RoadConfig(direction_rad=0.0, curvature_per_m=0.0)


def obstacles_of(config: PassConfig, seed: int = 0) -> Obstacles:
    rows = PassRows.of(config, [{}])
    return place_obstacles(rows, [lambda _: np.random.default_rng(seed)])


def cut(
    obstacles: Obstacles,
    tag_m: Float64[Array, "M P 2"],
    tag_up_m: float,
    anchor_m: Float64[Array, "N 2"],
    anchor_up_m: Float64[Array, "N"],
) -> Bool[Array, "N P"]:
    """Tell which lines of sight the obstacles of one pass cut."""
    n = len(anchor_m)
    tags_m = np.broadcast_to(tag_m, (n, *tag_m.shape[1:]))
    return obstacles.cut(tags_m, np.full((n, 1), tag_up_m), anchor_m, anchor_up_m, [n])


@given(seed=st.integers(0, 2**32), up_m=st.floats(0.5, 3.0))
def test_a_box_cuts_the_rays_through_it_that_are_lower(seed: int, up_m: float) -> None:
    # A box of 4 m by 2 m about the origin; tags and anchors outside of it.
    one = Obstacles(
        start_m=np.array([[-2.0, -1.0], [-2.0, 1.0]]),
        end_m=np.array([[2.0, 1.0], [2.0, -1.0]]),
        up_m=np.array([up_m, up_m]),
        counts=(2,),
    )
    rng = np.random.default_rng(seed)
    tag_m, anchor_m = rng.uniform(-10, 10, (2, 30, 2))
    anchor_m[:, 1] = np.sign(anchor_m[:, 1]) * (1.5 + np.abs(anchor_m[:, 1]))
    tag_m[:, 1] = np.sign(tag_m[:, 1]) * (1.5 + np.abs(tag_m[:, 1]))
    flat = cut(one, tag_m[None], 0.0, anchor_m, np.zeros(30))
    footprint = box(-2, -1, 2, 1)
    expected = [[footprint.intersects(LineString([t, a])) for t in tag_m] for a in anchor_m]
    np.testing.assert_array_equal(flat, expected)
    above = cut(one, tag_m[None], 3.5, anchor_m, np.full(30, 3.1))
    assert not above.any()


def test_a_low_barrier_hides_low_anchors_behind_it_only() -> None:
    barrier = Obstacles(np.array([[-9.0, 0.0]]), np.array([[9.0, 0.0]]), np.array([1.0]), (1,))
    tag_m = np.array([[[0.0, -2.0]]])  # the ray falls from 1.6 m to the anchor, over 2.5 m of road
    anchors_m, up_m = np.array([[0.0, 0.5], [0.0, 0.5], [0.0, -0.5]]), np.array([0.6, 0.9, 0.1])
    np.testing.assert_array_equal(
        cut(barrier, tag_m, 1.6, anchors_m, up_m)[:, 0], [True, False, False]
    )


@pytest.mark.parametrize("closed_lane", ["right", "left"])
def test_trucks_and_people_stand_in_the_work_space(closed_lane: str) -> None:
    road = EAST.model_copy(update={"closed_lane": closed_lane})
    config = PassConfig(road=road, closure=ClosureConfig(n_trucks=3, n_crew=4))
    found = obstacles_of(config)
    assert len(found.up_m) == 14  # two diagonals each
    middle_m = (found.start_m + found.end_m) / 2
    plan = plan_zone(config)
    assert middle_m[:, 0].min() >= plan.work_along_m[0]
    assert middle_m[:, 0].max() <= plan.work_along_m[1]
    closed_m = middle_m[:, 1] * (1 if closed_lane == "left" else -1)
    assert closed_m.min() > -0.5
    length_m = np.abs(found.end_m - found.start_m)[:, 0]
    assert sorted(set(length_m.round(9))) == [0.5, 8.0]
    assert set(found.up_m) == {1.8, 3.0}


def test_barrier_hides_the_anchors_of_the_work_space_from_the_lane() -> None:
    config = PassConfig(road=EAST, closure=ClosureConfig(barrier_up_m=1.4))
    found = obstacles_of(config)
    plan = plan_zone(config)
    middle_m = plan.work_along_m.mean()
    anchor_m = np.array([[middle_m, 0.0], [5.0, -3.6]])
    hidden = cut(found, np.array([[[middle_m + 1, 1.8]]]), 1.6, anchor_m, np.array([0.9, 0.9]))
    np.testing.assert_array_equal(hidden[:, 0], [True, False])


def test_nothing_stands_in_the_way_by_default() -> None:
    found = obstacles_of(PassConfig())
    assert not cut(found, np.zeros((1, 5, 2)), 1.6, np.ones((3, 2)), np.ones(3)).any()
