"""The closure has the MUTCD's shape, on the declared side, however the road lies."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gaia_uwb.simulate.layouts import (
    corners_along_m,
    merging_taper_m,
    place_anchors,
    road_to_local,
)
from gaia_uwb.simulate.presets import ClosureConfig, PassConfig, RoadConfig

FOOT_M = 0.3048
EXACT = ClosureConfig(placement_sigma_m=0.0, antenna_up_sigma_m=0.0)

roads = st.builds(
    RoadConfig,
    closed_lane=st.sampled_from(["right", "left"]),
    direction_rad=st.floats(-7, 7),
    curvature_per_m=st.floats(-0.005, 0.005),
)
distances_m = st.floats(-500, 500)


@pytest.mark.parametrize(
    ("speed_mph", "taper_ft"),
    # The MUTCD's formulas worked by hand for a lane of 12 ft.
    [(20, 80), (25, 125), (30, 180), (35, 245), (40, 320), (45, 540), (55, 660), (75, 900)],
)
def test_merging_taper_follows_the_mutcd(speed_mph: int, taper_ft: float) -> None:
    assert merging_taper_m(12 * FOOT_M, speed_mph) == pytest.approx(taper_ft * FOOT_M)
    assert merging_taper_m(10 * FOOT_M, speed_mph) == pytest.approx(taper_ft * FOOT_M * 10 / 12)


def test_corners_are_taper_buffer_and_work_and_downstream_taper() -> None:
    config = PassConfig(
        road=RoadConfig(lane_width_m=12 * FOOT_M, speed_limit_mph=45),
        closure=ClosureConfig(buffer_m=100.0, work_m=50.0, downstream_taper_m=20.0),
    )
    taper_m = 540 * FOOT_M
    np.testing.assert_allclose(
        corners_along_m(config), [0, taper_m, taper_m + 150, taper_m + 170], rtol=1e-12
    )


@given(road=roads, along_m=distances_m, open_m=st.floats(-10, 10))
def test_road_coordinates_are_an_arc_and_its_normal(
    road: RoadConfig, along_m: float, open_m: float
) -> None:
    along = np.array([along_m, along_m, along_m + 1e-3])
    line, beside, ahead = road_to_local(road, along, np.array([0.0, open_m, 0.0]))
    direction = (ahead - line) / 1e-3
    heading_rad = road.direction_rad + road.curvature_per_m * along_m
    np.testing.assert_allclose(direction, [np.cos(heading_rad), np.sin(heading_rad)], atol=1e-5)
    left = np.array([-np.sin(heading_rad), np.cos(heading_rad)])
    sign = 1 if road.closed_lane == "right" else -1
    np.testing.assert_allclose(beside - line, sign * open_m * left, atol=1e-9)


@given(curvature=st.floats(1e-4, 5e-3), along_m=distances_m)
def test_a_bend_keeps_its_radius(curvature: float, along_m: float) -> None:
    road = RoadConfig(direction_rad=0.0, curvature_per_m=curvature)
    place = road_to_local(road, np.array([along_m]), np.array([0.0]))[0]
    assert np.hypot(place[0], place[1] - 1 / curvature) == pytest.approx(1 / curvature)


def test_turning_the_road_turns_the_scene() -> None:
    def anchors(direction_rad: float) -> np.ndarray:
        road = RoadConfig(direction_rad=direction_rad)
        return place_anchors(PassConfig(road=road), np.random.default_rng(5))[0]

    c, s = np.cos(1.2), np.sin(1.2)
    turned = anchors(0.3) @ np.array([[c, s], [-s, c]])
    np.testing.assert_allclose(anchors(1.5), turned, atol=1e-9)


@pytest.mark.parametrize("closed_lane", ["right", "left"])
def test_anchors_follow_the_edge_of_the_closed_lane(closed_lane: str) -> None:
    road = RoadConfig.model_validate(
        {"closed_lane": closed_lane, "direction_rad": 0.0, "curvature_per_m": 0.0}
    )
    config = PassConfig(road=road, closure=EXACT)
    anchor_m, up_m = place_anchors(config, np.random.default_rng(0))
    corners_m = corners_along_m(config)
    closed_m = anchor_m[:, 1] if closed_lane == "left" else -anchor_m[:, 1]
    np.testing.assert_allclose(anchor_m[:4, 0], corners_m)
    np.testing.assert_allclose(closed_m[:4], [3.6, 0, 0, 3.6], atol=1e-12)
    # Every other anchor stands on the edge between its corners.
    np.testing.assert_allclose(
        closed_m, np.interp(anchor_m[:, 0], corners_m, [3.6, 0, 0, 3.6]), atol=1e-12
    )
    np.testing.assert_allclose(anchor_m[4:, 0] / corners_m[-1], [1 / 2, 1 / 4, 3 / 4, 1 / 8])
    np.testing.assert_array_equal(up_m, 0.9)


def test_placement_scatters_by_its_sigma() -> None:
    closure = ClosureConfig(n_anchors=1000, placement_sigma_m=0.2, antenna_up_sigma_m=0.05)
    exact = closure.model_copy(update={"placement_sigma_m": 0.0, "antenna_up_sigma_m": 0.0})
    place_m, up_m = place_anchors(PassConfig(closure=closure), np.random.default_rng(1))
    mark_m, _ = place_anchors(PassConfig(closure=exact), np.random.default_rng(1))
    assert np.std(place_m - mark_m) == pytest.approx(0.2, rel=0.07)
    assert np.std(up_m) == pytest.approx(0.05, rel=0.1)
    assert up_m.mean() == pytest.approx(0.9, abs=0.01)


@given(n=st.integers(1, 40), more=st.integers(1, 10))
def test_more_anchors_leave_the_others_where_they_are(n: int, more: int) -> None:
    few, few_up = place_anchors(
        PassConfig(closure=ClosureConfig(n_anchors=n)), np.random.default_rng(2)
    )
    many, many_up = place_anchors(
        PassConfig(closure=ClosureConfig(n_anchors=n + more)), np.random.default_rng(2)
    )
    assert len(few) == n
    np.testing.assert_array_equal(few, many[:n])
    np.testing.assert_array_equal(few_up, many_up[:n])
