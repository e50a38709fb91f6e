"""Zones along a road whose truth is known: edges, ends, gaps, tapers and widths."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cones_beside import BEND, STRAIGHT, drive, inside_m, only_zone, there_and_back, zones_of
from gaia_uwb.config import BoundaryConfig
from gaia_uwb.roadside import RoadSide, WorkZone, ZoneForm, find_zones
from gaia_uwb.roadside.tapers import merging_taper_m
from gaia_uwb.zone import Region, convex_hull
from road_forms import SCurve
from roads import Numbers, Road

ROADS = {"straight": STRAIGHT, "bend": BEND, "s-curve": SCurve(BEND, 250.0)}
STATION_M = 100.0 + 15.0 * np.arange(20)
TAPER = np.clip(1.0 - np.arange(20) / 6.0, 0.0, 1.0)


def row(line: Road | SCurve, left_m: Numbers | float) -> Numbers:
    return line.place(STATION_M, left_m)


@pytest.mark.parametrize("side", RoadSide)
@pytest.mark.parametrize("road", ROADS)
def test_the_edge_of_a_row_runs_beside_the_path(road: str, side: RoadSide) -> None:
    line = ROADS[road]
    zone = only_zone([drive(line, 0.0, 500.0)], row(line, side.sign * 3.0), sigma_m=0.1)
    (edge,) = zone.edges
    assert (zone.form, edge.side, edge.side_probability) == (ZoneForm.ONE_ROW, side, 1.0)
    assert edge.cones == tuple(f"c{k:02d}" for k in range(20))
    np.testing.assert_allclose(edge.offset_m, side.sign * 3.0, atol=0.03)
    np.testing.assert_allclose(edge.beside_m, 3.0, atol=0.03)
    assert edge.free.least_m == pytest.approx(3.0, abs=0.03)
    # Independent errors of 0.1 m: the least of twenty is about 2 standard deviations below.
    assert edge.free.at_least_m == pytest.approx(2.75, abs=0.05)
    assert not edge.gaps
    assert not edge.tapers
    assert zone.start.station_m == pytest.approx(100.0, abs=0.1)
    assert zone.length_m == pytest.approx(285.0, abs=1.5)
    assert zone.start.within_m == pytest.approx(0.164, abs=0.03)
    assert zone.speed_mps == pytest.approx(15.0, abs=0.05)
    assert zone.drove_through is None
    assert zone.closed is None
    assert zone.open_strip is not None


def test_the_band_is_as_wide_as_places_are_uncertain() -> None:
    zone = only_zone([drive(STRAIGHT, 0.0, 500.0)], row(STRAIGHT, -3.0), sigma_m=0.2)
    band = zone.edges[0].band
    at_cone = np.isin(band.station_m.round(3), zone.edges[0].station_m.round(3))
    width_m = np.abs(band.far_m - band.near_m)
    assert np.mean(width_m[at_cone]) == pytest.approx(2 * 1.645 * 0.2, rel=0.05)
    assert (width_m[~at_cone] < width_m[at_cone].max()).all(), "between cones errors even out"
    assert (np.abs(band.near_m) < np.abs(band.far_m)).all()


def test_outside_of_a_bend_the_area_is_behind_the_edge_and_the_hull_over_the_lane() -> None:
    """The case of the issue: a bend of 800 m with 20 cones along its outside."""
    cones_m = BEND.place(np.linspace(100.0, 1100.0, 20), -3.0)
    path = drive(BEND, 0.0, 1200.0)
    stated = BoundaryConfig(closed_lanes=1)
    zone = only_zone([path], cones_m, sigma_m=0.13, config=stated)
    assert zone.closed is not None
    for region in (zone.closed.region, zone.closed.inner, zone.closed.outer):
        assert inside_m(region, path) == 0.0
    assert zone.closed.region.area_m2 == pytest.approx(1000.0 * 3.6, rel=0.02)
    assert 0.75 < zone.closed.inner.area_m2 / zone.closed.region.area_m2 < 1.0
    assert 1.0 < zone.closed.outer.area_m2 / zone.closed.region.area_m2 < 1.3
    assert zone.edges[0].free.least_m == pytest.approx(3.0, abs=0.05)
    for line_m in zone.edges[0].lines:
        np.testing.assert_allclose(np.hypot(*(line_m - centre(BEND)).T), 803.0, atol=0.1)
    hull = Region(((convex_hull(cones_m),),), np.nan)
    assert inside_m(hull, path) > 400.0, "what the hull does"


def centre(bend: Road) -> Numbers:
    left = np.array([-np.sin(bend.heading_rad), np.cos(bend.heading_rad)])
    return np.asarray(left / bend.curvature_per_m)


@pytest.mark.parametrize("road", ROADS)
def test_two_rows_have_two_edges_and_the_lane_between(road: str) -> None:
    line = ROADS[road]
    cones_m = np.concatenate([row(line, -2.0 - 2.5 * TAPER), row(line, 5.6)])
    zone = only_zone([drive(line, 0.0, 500.0)], cones_m)
    assert zone.form is ZoneForm.LANE_BETWEEN
    assert {edge.side: edge.cones for edge in zone.edges} == {
        RoadSide.RIGHT: tuple(f"c{k:02d}" for k in range(20)),
        RoadSide.LEFT: tuple(f"c{k:02d}" for k in range(20, 40)),
    }
    assert zone.lane is not None
    assert zone.lane.least_m == pytest.approx(7.6, abs=0.05)
    assert zone.closed is None, "the lane between is open"


def test_two_rows_close_what_was_stated_on_both_sides() -> None:
    cones_m = np.concatenate([row(BEND, -2.0), row(BEND, 2.5)])
    path = drive(BEND, 0.0, 500.0)
    zone = only_zone([path], cones_m, sigma_m=0.1, config=BoundaryConfig(closed_width_m=4.0))
    assert zone.closed is not None
    assert zone.closed.region.area_m2 == pytest.approx(2 * 285.0 * 4.0, rel=0.02)
    assert inside_m(zone.closed.outer, path) == 0.0


@pytest.mark.parametrize("road", ROADS)
def test_works_between_two_rows_are_closed(road: str) -> None:
    line = ROADS[road]
    cones_m = np.concatenate([row(line, 2.2), row(line, 6.2)])
    zone = only_zone([drive(line, 0.0, 500.0)], cones_m, sigma_m=0.05)
    assert zone.form is ZoneForm.WORKS_BETWEEN
    assert zone.closed is not None
    assert zone.closed.region.area_m2 == pytest.approx(285.0 * 4.0, rel=0.06)
    assert zone.edges[0].free.least_m == pytest.approx(2.2, abs=0.03)
    assert 2.0 < zone.edges[0].free.at_least_m < 2.2


def test_a_closed_lane_with_both_tapers_is_an_area() -> None:
    away_m = 2.0 + 3.6 * (TAPER + TAPER[::-1])
    zone = only_zone([drive(BEND, 0.0, 500.0)], row(BEND, -away_m))
    assert zone.form is ZoneForm.AREA
    assert len(zone.edges[0].cones) == 20, "all of them face traffic"
    assert [taper.is_upstream for taper in zone.edges[0].tapers] == [True, False]
    assert zone.closed is not None
    assert zone.closed.region.area_m2 == pytest.approx(3.6 * (285.0 - 6 * 15.0), rel=0.03)


def test_the_upstream_taper_is_measured_and_compared_with_the_manual() -> None:
    zone = only_zone([drive(BEND, 0.0, 500.0)], row(BEND, -2.0 - 3.0 * TAPER), sigma_m=0.05)
    (taper,) = zone.edges[0].tapers
    assert (taper.is_upstream, taper.start.cone, taper.end.cone) == (True, "c00", "c06")
    assert taper.length_m == pytest.approx(90.0, abs=0.6)
    assert taper.width_m == pytest.approx(3.0, abs=0.03)
    for end in (taper.start, taper.end):
        assert end.within_m == pytest.approx(1.645 * 0.05, rel=0.2)
    assert taper.asked_m == pytest.approx(merging_taper_m(3.0, 15.0), rel=0.02)
    assert taper.is_long_enough
    slow = [replace(each, t_s=each.t_s / 2) for each in [drive(BEND, 0.0, 500.0)]]
    (taper,) = only_zone(slow, row(BEND, -2.0 - 3.0 * TAPER)).edges[0].tapers
    assert not taper.is_long_enough, "at 30 m/s it is too short"


def test_the_manual_asks_for_these_lengths() -> None:
    mph = 0.44704
    feet = [round(merging_taper_m(12 * 0.3048, s * mph) / 0.3048) for s in (20, 25, 40, 45, 70)]
    assert feet == [80, 125, 320, 540, 840]
    assert np.isnan(merging_taper_m(3.0, np.nan))


def test_a_gap_is_named_and_no_wall() -> None:
    station_m = STATION_M + 60.0 * (np.arange(20) > 11)
    zone = only_zone([drive(BEND, 0.0, 600.0)], BEND.place(station_m, -3.0), sigma_m=0.1)
    edge = zone.edges[0]
    (gap,) = edge.gaps
    assert (gap.from_cone, gap.to_cone) == ("c11", "c12")
    assert gap.length_m == pytest.approx(75.0, abs=0.5)
    assert gap.usual_m == pytest.approx(15.0, abs=0.1)
    assert [part.stop - part.start for part in edge.pieces] == [12, 8]
    assert len(edge.lines) == len(edge.band.rings) == 2
    inside = (edge.band.station_m > edge.station_m[11] + 1) & (
        edge.band.station_m < edge.station_m[12] - 1
    )
    assert not inside.any()


def test_a_taper_of_closer_cones_is_no_gap_after_it() -> None:
    spacing_m = np.where(np.arange(19) < 7, 6.0, 14.0)
    station_m = 100.0 + np.concatenate([[0.0], np.cumsum(spacing_m)])
    zone = only_zone([drive(STRAIGHT, 0.0, 500.0)], STRAIGHT.place(station_m, -2.0 - 3.0 * TAPER))
    assert not zone.edges[0].gaps


def test_a_cone_that_was_not_located_leaves_the_edge_and_is_named() -> None:
    cones_m = row(BEND, -3.0)
    cones_m[8:10] = np.nan
    found = zones_of([drive(BEND, 0.0, 500.0)], cones_m, sigma_m=0.1)
    assert found.unlocated == ("c08", "c09")
    (gap,) = found.zones[0].edges[0].gaps
    assert gap.unlocated == ("c08", "c09")
    assert found.zones[0].cones == tuple(f"c{k:02d}" for k in range(20) if k not in (8, 9))


def test_u_turns_and_other_passes_change_nothing_but_the_paths() -> None:
    cones_m = row(BEND, -3.0)
    alone = drive(BEND, 0.0, 500.0)
    for drives, along in (
        ([there_and_back(BEND, 0.0, 500.0, 14.4)], [1, -1]),
        ([alone, drive(BEND, 500.0, 0.0, 7.2)], [1, -1]),
        ([drive(BEND, 500.0, 0.0, 7.2), alone], [-1, 1]),
        ([alone, drive(BEND, 0.0, 500.0, 3.6)], [1, 1]),
    ):
        found = zones_of(drives, cones_m, sigma_m=0.1)
        assert [path.along for path in found.paths] == along
        (zone,) = found.zones
        assert zone.edges[0].side is RoadSide.RIGHT
        np.testing.assert_allclose(zone.edges[0].beside_m, 3.0, atol=0.03)
        assert zone.length_m == pytest.approx(285.0, abs=1.5)
        assert zone.drove_through is None


def test_a_drive_along_a_part_tells_its_speed_there() -> None:
    slow = drive(BEND, 250.0, 330.0, 3.6)
    drives = [
        drive(BEND, 0.0, 500.0),
        replace(slow, t_s=2 * slow.t_s),
        replace(slow, t_s=50 + slow.t_s),
    ]
    zone = only_zone(drives, row(BEND, -3.0))
    assert zone.speed_mps == pytest.approx(15.0, abs=0.05)


def test_a_row_that_is_passed_against_traffic_faces_the_nearest_drive() -> None:
    """The far lane was driven against the line, which starts where the near one does."""
    cones_m = row(BEND, 3.0)
    near = drive(BEND, 500.0, 0.0)
    zone = only_zone([drive(BEND, 0.0, 500.0, -3.6), near], cones_m)
    assert zone.edges[0].side is RoadSide.RIGHT, "of the nearest drive, which comes back"
    assert zone.edges[0].cones[0] == "c19"


def test_two_zones_in_one_log() -> None:
    cones_m = np.concatenate([row(STRAIGHT, -3.0), STRAIGHT.place(STATION_M + 700.0, 3.5)])
    first, second = zones_of([drive(STRAIGHT, 0.0, 1300.0)], cones_m, sigma_m=0.1).zones
    assert (first.edges[0].side, second.edges[0].side) == (RoadSide.RIGHT, RoadSide.LEFT)
    assert (first.end.cone, second.start.cone) == ("c19", "c20")


def moved(turn_rad: float, shift_m: Numbers, *, mirror: bool) -> WorkZone:
    """Return the only zone of a scene that was mirrored, turned and shifted."""

    def move(place_m: Numbers) -> Numbers:
        place_m = place_m * [1.0, -1.0] if mirror else place_m
        cosine, sine = np.cos(turn_rad), np.sin(turn_rad)
        return np.asarray(place_m @ np.array([[cosine, sine], [-sine, cosine]]) + shift_m)

    path = drive(BEND, 0.0, 500.0)
    cones_m = np.concatenate([row(BEND, 2.2 + 3.0 * TAPER), row(BEND, 6.2)])
    return only_zone([replace(path, position_m=move(path.position_m))], move(cones_m))


@pytest.mark.parametrize("turn_rad", [0.0, 1.0, 2.5])
@pytest.mark.parametrize("mirror", [False, True])
def test_where_a_scene_lies_makes_no_difference(turn_rad: float, mirror: bool) -> None:
    plain = moved(0.0, np.zeros(2), mirror=False)
    other = moved(turn_rad, np.array([4.5e5, -5.3e6]), mirror=mirror)
    sign = -1.0 if mirror else 1.0
    assert (other.form, other.cones) == (plain.form, plain.cones)
    np.testing.assert_allclose(other.edges[0].offset_m, sign * plain.edges[0].offset_m, atol=0.005)
    np.testing.assert_allclose(other.edges[0].station_m, plain.edges[0].station_m, atol=0.02)
    assert other.closed is not None
    assert plain.closed is not None
    assert other.closed.region.area_m2 == pytest.approx(plain.closed.region.area_m2, rel=1e-3)


def test_driven_backwards_upstream_is_downstream() -> None:
    cones_m = row(BEND, -2.0 - 3.0 * TAPER)
    there = only_zone([drive(BEND, 0.0, 500.0)], cones_m)
    back = only_zone([drive(BEND, 500.0, 0.0)], cones_m)
    assert back.cones == there.cones[::-1]
    assert (there.edges[0].side, back.edges[0].side) == (RoadSide.RIGHT, RoadSide.LEFT)
    np.testing.assert_allclose(back.edges[0].offset_m, -there.edges[0].offset_m[::-1], atol=0.02)
    assert not back.edges[0].tapers[0].is_upstream
    assert np.isnan(back.edges[0].tapers[0].asked_m)
    assert back.edges[0].tapers[0].is_long_enough is None


@pytest.mark.parametrize("n", [1, 2])
def test_one_or_two_cones(n: int) -> None:
    cones_m = STRAIGHT.place(100.0 + 20.0 * np.arange(n), -3.0)
    zone = only_zone([drive(STRAIGHT, 0.0, 300.0)], cones_m, sigma_m=0.1)
    assert (zone.form, len(zone.edges[0].cones)) == (ZoneForm.ONE_ROW, n)
    assert zone.edges[0].free.least_m == pytest.approx(3.0, abs=0.02)
    assert zone.length_m == pytest.approx(20.0 * (n - 1), abs=0.1)


def test_open_sides_are_told_as_such() -> None:
    rng = np.random.default_rng(6)
    cones_m, mirrored_m = row(STRAIGHT, -3.0), row(STRAIGHT, 3.0)
    is_mirrored = np.arange(400) < 120
    scene_m = np.where(is_mirrored[:, None, None], mirrored_m, cones_m)
    scene_m = scene_m + rng.normal(0.0, 0.1, scene_m.shape)
    found = find_zones(
        [drive(STRAIGHT, 0.0, 500.0)], [f"c{k}" for k in range(20)], cones_m, scene_m,
        BoundaryConfig(closed_width_m=3.0),
    )  # fmt: skip
    assert found is not None
    (zone,) = found.zones
    assert zone.form_probability[ZoneForm.ONE_ROW] == 1.0
    assert zone.edges[0].side_probability == pytest.approx(0.7)
    width_m = np.abs(zone.edges[0].band.far_m - zone.edges[0].band.near_m)
    assert width_m.max() < 0.5, "given the side"
    assert zone.closed is not None
    assert zone.closed.inner.area_m2 == 0.0
    assert zone.closed.outer.area_m2 > 2 * zone.closed.region.area_m2


def test_a_stated_form_is_taken() -> None:
    cones_m = np.concatenate([row(BEND, 2.2), row(BEND, 6.2)])
    stated = BoundaryConfig(form="area")
    zone = only_zone([drive(BEND, 0.0, 500.0)], cones_m, config=stated)
    assert zone.form is ZoneForm.AREA
    assert zone.form_probability[ZoneForm.WORKS_BETWEEN] == 1.0, "by the places"
