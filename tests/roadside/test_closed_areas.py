"""Closed areas: what was stated, what was driven over, and how often regions are right."""

from __future__ import annotations

import numpy as np
import pytest
from shapely import Polygon

from cones_beside import BEND, STRAIGHT, drive, ground, inside_m, only_zone
from gaia_uwb._shared import ConfigError
from gaia_uwb.config import BoundaryConfig
from gaia_uwb.projection import to_geodetic
from gaia_uwb.roadside import WidthSource, find_zones
from gaia_uwb.scene import LocalFrame
from roads import Numbers, Road

STATION_M = 100.0 + 15.0 * np.arange(20)
SITE = LocalFrame(lat_deg=48.1, lon_deg=11.5, alt_m=520.0)


def edge_of_road(line: Road, left_m: float, frame: LocalFrame = SITE) -> BoundaryConfig:
    lat, lon, _ = to_geodetic(frame, line.place(np.linspace(50.0, 450.0, 9), left_m))
    return BoundaryConfig(road_edge=tuple(zip(lon.tolist(), lat.tolist(), strict=True)))


def found(line: Road, left_m: float, config: BoundaryConfig, frame: LocalFrame | None) -> object:
    cones_m = line.place(STATION_M, left_m)
    ids = [f"c{k}" for k in range(len(cones_m))]
    drives = [drive(line, 0.0, 500.0)]
    result = find_zones(drives, ids, cones_m, cones_m[None], config, frame)
    assert result is not None
    return result.zones[0].closed


@pytest.mark.parametrize(
    ("stated", "width_m", "source"),
    [
        ({"closed_width_m": 2.5}, 2.5, WidthSource.CLOSED_WIDTH),
        ({"closed_lanes": 2}, 7.2, WidthSource.CLOSED_LANES),
        ({"closed_lanes": 2, "lane_width_m": 3.0}, 6.0, WidthSource.CLOSED_LANES),
    ],
)
@pytest.mark.parametrize("side", [1, -1])
def test_a_strip_is_as_wide_as_was_stated(
    stated: dict[str, float], width_m: float, source: WidthSource, side: int
) -> None:
    config = BoundaryConfig.model_validate(stated)
    cones_m = STRAIGHT.place(STATION_M, side * 3.0)
    zone = only_zone([drive(STRAIGHT, 0.0, 500.0)], cones_m, config=config)
    assert zone.closed is not None
    assert (zone.closed.width_source, zone.closed.width_m) == (source, pytest.approx(width_m))
    far_m = STRAIGHT.place(STATION_M[[-1, 0]], side * (3.0 + width_m))
    expected = Polygon([*cones_m[[0, -1]], *far_m])
    assert ground(zone.closed.region).symmetric_difference(expected).area < 0.5
    assert zone.open_strip is None


def test_a_road_edge_ends_the_strip() -> None:
    closed = found(BEND, -3.0, edge_of_road(BEND, -7.5), SITE)
    assert getattr(closed, "width_source", None) is WidthSource.ROAD_EDGE
    # The line's points are 50 m apart: chords of the bend, 0.26 m inside of it in the middle.
    assert closed.region.area_m2 == pytest.approx(285.0 * 4.5, rel=0.06)  # type: ignore[attr-defined]


def test_a_road_edge_across_the_path_closes_nothing() -> None:
    assert found(STRAIGHT, -3.0, edge_of_road(STRAIGHT, 7.5), SITE) is None


def test_a_road_edge_needs_a_place_on_the_earth() -> None:
    with pytest.raises(ConfigError, match="where the local frame is on the Earth"):
        found(STRAIGHT, -3.0, edge_of_road(STRAIGHT, -7.5), None)


def test_ground_that_was_driven_over_is_open() -> None:
    cones_m = BEND.place(STATION_M, 3.0)
    first, second = drive(BEND, 0.0, 500.0), drive(BEND, 0.0, 500.0, 7.0)
    stated = BoundaryConfig(closed_width_m=6.0)
    alone = only_zone([first], cones_m, sigma_m=0.05, config=stated)
    both = only_zone([first, second], cones_m, sigma_m=0.05, config=stated)
    assert alone.closed is not None
    assert both.closed is not None
    assert inside_m(alone.closed.region, second) > 280.0
    for region in (both.closed.region, both.closed.inner, both.closed.outer):
        assert inside_m(region, second) == 0.0
        assert inside_m(region, first) == 0.0
    lost_m2 = alone.closed.region.area_m2 - both.closed.region.area_m2
    assert lost_m2 == pytest.approx(285.0 * 2.0, rel=0.02), "as wide as a vehicle"


@pytest.mark.parametrize("form", ["strip", "works"])
def test_regions_are_right_in_nine_of_ten_zones(form: str) -> None:
    """True places are drawn as the scenes are, about estimates that are off as much."""
    rng = np.random.default_rng(8)
    near_m = BEND.place(STATION_M, -3.0)
    cones_m = near_m if form == "strip" else np.concatenate([near_m, BEND.place(STATION_M, -7.0)])
    config = BoundaryConfig(closed_width_m=4.0) if form == "strip" else BoundaryConfig()
    drives, sigma_m = [drive(BEND, 0.0, 500.0)], 0.15
    ids = [f"c{k}" for k in range(len(cones_m))]

    def closed(place_m: Numbers, scene_m: Numbers):  # type: ignore[no-untyped-def]
        result = find_zones(drives, ids, place_m, scene_m, config)
        assert result is not None
        assert result.zones[0].closed is not None
        return result.zones[0].closed

    inner, outer = [], []
    for _ in range(60):
        place_m = cones_m + rng.normal(0.0, sigma_m, cones_m.shape)
        scene_m = place_m + rng.normal(0.0, sigma_m, (256, *cones_m.shape))
        here = closed(place_m, scene_m)
        true = ground(closed(cones_m, cones_m[None]).region)
        inner.append(ground(here.inner).difference(true.buffer(0.02)).is_empty)
        outer.append(true.difference(ground(here.outer).buffer(0.02)).is_empty)
    assert 0.8 < np.mean(inner) < 1.0
    assert 0.8 < np.mean(outer) < 1.0
