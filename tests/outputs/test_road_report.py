"""The report has all that was found of a road's zones, in strict JSON."""

from __future__ import annotations

import json
from dataclasses import fields
from typing import Any

import numpy as np

from factories import make_reconstruction
from gaia_uwb.outputs.report import make_report
from gaia_uwb.outputs.road_report import road_report
from gaia_uwb.roadside import (
    ClosedArea,
    DroveThrough,
    Edge,
    EdgeBand,
    FreeWidth,
    Gap,
    RoadBoundary,
    Taper,
    WorkZone,
    ZoneEnd,
    ZoneForm,
)
from road_zones import (
    AT_M,
    STRAIGHT,
    closed_strip,
    ids_of,
    lane_between,
    make_edge,
    make_road,
    make_road_result,
    make_zone,
)


def read_back(boundary: RoadBoundary) -> Any:
    """Return the member of the report as a strict reader sees it."""
    report = make_report(make_road_result(boundary))
    return json.loads(json.dumps(report, allow_nan=False))["road_boundary"]


def names(kind: type) -> set[str]:
    return {each.name for each in fields(kind)}


def test_nothing_that_was_found_is_left_out() -> None:
    passed = DroveThrough(0.8, 100.0, 110.0, ("cone-0", "cone-1"))
    zone = make_zone(STRAIGHT, make_edge(STRAIGHT, ids_of(8)), closed=closed_strip(STRAIGHT),
                     drove_through=passed)  # fmt: skip
    road = read_back(make_road(zone, lane_between(STRAIGHT), unlocated=("lost",)))
    assert set(road) == names(RoadBoundary)
    first, second = road["zones"]
    assert set(first) == names(WorkZone)
    (edge,) = first["edges"]
    assert set(edge) == names(Edge) | {"pieces"}
    for found, kind, more in (
        (edge["band"], EdgeBand, set()),
        (edge["gaps"][0], Gap, set()),
        (edge["tapers"][0], Taper, {"is_long_enough"}),
        (edge["free"], FreeWidth, set()),
        (first["closed"], ClosedArea, set()),
        (first["start"], ZoneEnd, set()),
        (first["drove_through"], DroveThrough, set()),
        (second["lane"], FreeWidth, set()),
    ):
        assert set(found) == names(kind) | more, kind
    assert set(first["closed"]["region"]) == {"area_m2", "polygons_m"}
    assert road["unlocated"] == ["lost"]


def test_numbers_and_words_are_those_of_the_zone() -> None:
    shares = {ZoneForm.ONE_ROW: 0.97, ZoneForm.AREA: 0.03}
    boundary = make_road(make_zone(STRAIGHT, probability=shares, speed_mps=np.nan))
    road = read_back(boundary)
    (zone,) = road["zones"]
    assert zone["form"] == "one-row"
    assert zone["form_probability"] == {
        "one-row": 0.97, "lane-between": 0.0, "works-between": 0.0, "area": 0.03,
    }  # fmt: skip
    assert zone["speed_mps"] is None and zone["closed"] is None and zone["lane"] is None
    (edge,) = zone["edges"]
    assert (edge["side"], edge["cones"], edge["pieces"]) == ("right", list(ids_of(8)),
                                                             [[0, 5], [5, 8]])  # fmt: skip
    assert edge["station_m"] == AT_M.tolist()
    assert edge["tapers"][0]["is_long_enough"] is False
    assert road["line"] == {"vertex_m": STRAIGHT.vertex_m.tolist(), "length_m": 420.0}
    assert road["paths"] == [{"name": "a drive", "along": 1, "station_m": [0.0, 420.0]}]


def test_without_a_road_it_is_null() -> None:
    assert make_report(make_reconstruction())["road_boundary"] is None
    assert road_report(None) is None
