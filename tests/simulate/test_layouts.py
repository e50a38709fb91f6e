"""The closure has the MUTCD's shape, on the declared side, however the road lies."""

from __future__ import annotations

from typing import get_args

import numpy as np
import pytest
from hypothesis import given, strategies as st

from gaia_uwb._shared.arrays import Array, Float64
from gaia_uwb.simulate.layouts import (
    place_anchors,
    plan_zone,
    road_to_local,
    taper_m,
)
from gaia_uwb.simulate.settings import (
    ClosureConfig,
    DriveConfig,
    PassConfig,
    RoadConfig,
    ZoneKind,
)

FOOT_M = 0.3048
EXACT = ClosureConfig(placement_sigma_m=0.0, antenna_up_sigma_m=0.0)

roads = st.builds(
    RoadConfig,
    closed_lane=st.sampled_from(["right", "left"]),
    direction_rad=st.floats(-7, 7),
    curvature_per_m=st.floats(-0.005, 0.005),
)
distances_m = st.floats(-500, 500)


def placed(config: PassConfig, seed: int) -> tuple[Float64[Array, "N 2"], Float64[Array, "N"]]:
    n = config.closure.n_anchors
    return place_anchors(config, np.arange(n), np.random.default_rng(seed).standard_normal((n, 3)))


@pytest.mark.parametrize(
    ("speed_mph", "taper_ft"),
    # The MUTCD's formulas worked by hand for a lane of 12 ft.
    [(20, 80), (25, 125), (30, 180), (35, 245), (40, 320), (45, 540), (55, 660), (75, 900)],
)
def test_merging_taper_follows_the_mutcd(speed_mph: int, taper_ft: float) -> None:
    assert taper_m(12 * FOOT_M, speed_mph) == pytest.approx(taper_ft * FOOT_M)
    assert taper_m(10 * FOOT_M, speed_mph) == pytest.approx(taper_ft * FOOT_M * 10 / 12)


WIDTH_M, SHOULDER_M, SHIFT_M, MEDIAN_M = 12 * FOOT_M, 10 * FOOT_M, 6 * FOOT_M, 28 * FOOT_M
CROSSED_M = WIDTH_M + MEDIAN_M


@pytest.mark.parametrize(
    ("kind", "first_m", "last_m", "outside_m", "inside_m"),
    # Worked by hand from the MUTCD's tapers at 45 mph: L = 45 W in feet.
    [
        ("lane-closure", 540 * FOOT_M, 20.0, -WIDTH_M, 0.0),
        ("shoulder-closure", 150 * FOOT_M, 20.0, -WIDTH_M - SHOULDER_M, -WIDTH_M),
        ("lane-shift", 135 * FOOT_M, 135 * FOOT_M, -WIDTH_M, SHIFT_M - WIDTH_M),
        ("median-crossover", 900 * FOOT_M, 900 * FOOT_M, 0.0, CROSSED_M),
        ("mobile-operation", 50 * FOOT_M, 20.0, -WIDTH_M, 0.0),
    ],
)
def test_zones_have_the_mutcd_tapers(
    kind: ZoneKind, first_m: float, last_m: float, outside_m: float, inside_m: float
) -> None:
    config = PassConfig(
        road=RoadConfig(lane_width_m=WIDTH_M, speed_limit_mph=45),
        closure=ClosureConfig(
            kind=kind,
            buffer_m=100.0,
            work_m=50.0,
            downstream_taper_m=20.0,
            shoulder_m=SHOULDER_M,
            shift_m=SHIFT_M,
            median_m=MEDIAN_M,
            sign_spacing_m=100.0,
        ),
    )
    plan = plan_zone(config)
    corners_m = [0, first_m, first_m + 150, first_m + 150 + last_m]
    np.testing.assert_allclose(plan.corner_along_m, corners_m, rtol=1e-12)
    np.testing.assert_allclose(
        plan.corner_open_m, [outside_m, inside_m, inside_m, outside_m], atol=1e-12
    )
    np.testing.assert_allclose(plan.work_along_m, [first_m + 100, first_m + 150])
    np.testing.assert_array_equal(plan.sign_along_m, [-300, -200, -100])


@given(
    kind=st.sampled_from(get_args(ZoneKind)),
    closed_lane=st.sampled_from(["right", "left"]),
    both_sides=st.booleans(),
    lane_change=st.booleans(),
    speed_mph=st.sampled_from([25, 45, 65]),
    n=st.integers(1, 30),
)
def test_anchors_stand_on_the_declared_side_of_the_lane_that_is_driven(
    kind: ZoneKind, closed_lane: str, both_sides: bool, lane_change: bool, speed_mph: int, n: int
) -> None:
    road = RoadConfig.model_validate({
        "closed_lane": closed_lane, "direction_rad": 0.0, "curvature_per_m": 0.0,
        "speed_limit_mph": speed_mph,
    })  # fmt: skip
    closure = EXACT.model_copy(update={"kind": kind, "both_sides": both_sides, "n_anchors": n})
    config = PassConfig(road=road, closure=closure, drive=DriveConfig(lane_change=lane_change))
    plan = plan_zone(config)
    anchor_m, _ = placed(config, 0)
    open_m = anchor_m[:, 1] if closed_lane == "right" else -anchor_m[:, 1]
    beside_m = open_m - plan.lane_m(anchor_m[:, 0])
    across = both_sides & (np.arange(n) % 2 == 1)
    assert (beside_m[across] > 1.8).all()
    assert (beside_m[~across] < -1.79).all()


def test_a_mirrored_road_mirrors_the_scene() -> None:
    def anchors(closed_lane: str, sign: int) -> Float64[Array, "N 2"]:
        road = RoadConfig.model_validate(
            {
                "closed_lane": closed_lane,
                "direction_rad": 0.4 * sign,
                "curvature_per_m": 0.002 * sign,
                "s_curve": True,
            }
        )
        config = PassConfig(road=road, closure=ClosureConfig(both_sides=True))
        return placed(config, 3)[0]

    np.testing.assert_allclose(anchors("left", -1), anchors("right", 1) * [1, -1], atol=1e-9)


@given(bend_m=st.floats(-200, 200), along_m=distances_m)
def test_an_s_curve_turns_back(bend_m: float, along_m: float) -> None:
    road = RoadConfig(direction_rad=0.3, curvature_per_m=0.004, s_curve=True, inflection_m=bend_m)
    along = np.array([along_m, along_m + 1e-3])
    step = np.diff(road_to_local(road, along, np.zeros(2)), axis=0)[0] / 1e-3
    first_m = min(along_m, bend_m) if bend_m >= 0 else max(along_m, bend_m)
    heading_rad = 0.3 + 0.004 * (2 * first_m - along_m)
    np.testing.assert_allclose(step, [np.cos(heading_rad), np.sin(heading_rad)], atol=1e-5)


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
    def anchors(direction_rad: float) -> Float64[Array, "N 2"]:
        road = RoadConfig(direction_rad=direction_rad)
        return placed(PassConfig(road=road), 5)[0]

    c, s = np.cos(1.2), np.sin(1.2)
    turned = anchors(0.3) @ np.array([[c, s], [-s, c]])
    np.testing.assert_allclose(anchors(1.5), turned, atol=1e-9)


@pytest.mark.parametrize("closed_lane", ["right", "left"])
def test_anchors_follow_the_edge_of_the_closed_lane(closed_lane: str) -> None:
    road = RoadConfig.model_validate(
        {"closed_lane": closed_lane, "direction_rad": 0.0, "curvature_per_m": 0.0}
    )
    config = PassConfig(road=road, closure=EXACT)
    anchor_m, up_m = placed(config, 0)
    corners_m = plan_zone(config).corner_along_m
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
    place_m, up_m = placed(PassConfig(closure=closure), 1)
    mark_m, _ = placed(PassConfig(closure=exact), 1)
    assert np.std(place_m - mark_m) == pytest.approx(0.2, rel=0.07)
    assert np.std(up_m) == pytest.approx(0.05, rel=0.1)
    assert up_m.mean() == pytest.approx(0.9, abs=0.01)


@given(n=st.integers(1, 40), more=st.integers(1, 10), both_sides=st.booleans())
def test_more_anchors_leave_the_others_where_they_are(n: int, more: int, both_sides: bool) -> None:
    few_anchors, many_anchors = (
        ClosureConfig(n_anchors=m, both_sides=both_sides) for m in (n, n + more)
    )
    few, few_up = placed(PassConfig(closure=few_anchors), 2)
    many, many_up = placed(PassConfig(closure=many_anchors), 2)
    assert len(few) == n
    np.testing.assert_array_equal(few, many[:n])
    np.testing.assert_array_equal(few_up, many_up[:n])
