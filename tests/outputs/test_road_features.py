"""What a driver sees of a zone reaches a GIS: every role, whole, in order, wherever it lies."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Callable
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from shapely.geometry import LinearRing, shape

from factories import HOSTILE, SQUARE_M, make_reconstruction
from gaia_uwb.outputs.geojson import boundary_geojson
from gaia_uwb.outputs.geopackage import geopackage
from gaia_uwb.outputs.kml import kml
from gaia_uwb.roadside import RoadBoundary, RoadLine, RoadSide, ZoneForm
from gaia_uwb.scene import LocalFrame
from gaia_uwb.zone import Region
from road_zones import (
    AT_M,
    STRAIGHT,
    bend,
    closed_strip,
    ids_of,
    lane_between,
    make_edge,
    make_road,
    make_road_result,
    make_zone,
    with_road,
)

FIJI = LocalFrame(lat_deg=-16.8, lon_deg=179.997655)  # 250 m west of the 180th meridian
IN_THE_GAP = LocalFrame(lat_deg=-16.8, lon_deg=179.998)  # 213 m west of it
ROAD_ROLES = {
    "edge", "edge-band", "closed-area", "closed-area-inner", "closed-area-outer", "open-strip",
    "gap", "taper",
}  # fmt: skip


def collect(boundary: RoadBoundary, frame: LocalFrame | None = None) -> Any:
    """Return the collection as a strict reader of the file sees it."""
    collection = boundary_geojson(make_road_result(boundary, frame=frame))
    return json.loads(json.dumps(collection, allow_nan=False))


def by_role(collection: Any, role: str) -> list[Any]:
    return [f for f in collection["features"] if f["properties"]["role"] == role]


def one(collection: Any, role: str) -> Any:
    (feature,) = by_role(collection, role)
    return feature


def closed_road(line: RoadLine = STRAIGHT) -> RoadBoundary:
    edge = make_edge(line, ids_of(len(AT_M)))
    return make_road(make_zone(line, edge, closed=closed_strip(line)), line=line)


def test_an_open_row_has_every_role_but_areas() -> None:
    collection = collect(make_road(make_zone(STRAIGHT)))
    roles = [f["properties"]["role"] for f in collection["features"]]
    assert set(roles) & ROAD_ROLES == {"open-strip", "edge-band", "edge", "taper", "gap"}
    assert "area_m2" not in one(collection, "open-strip")["properties"]
    assert "no area is claimed" in one(collection, "open-strip")["properties"]["note"]


def test_areas_lie_below_bands_and_bands_below_lines() -> None:
    roles = [f["properties"]["role"] for f in collect(closed_road())["features"]]
    order = [role for role in dict.fromkeys(roles) if role in ROAD_ROLES]
    assert order == ["closed-area-outer", "closed-area", "closed-area-inner", "edge-band", "edge",
                     "taper", "gap"]  # fmt: skip
    assert roles.index("hull") < roles.index("closed-area-outer")
    assert roles.index("gap") < roles.index("cone")


def test_an_edge_runs_downstream_in_pieces_between_gaps() -> None:
    collection = collect(make_road(make_zone(STRAIGHT)))
    edge = one(collection, "edge")
    assert edge["geometry"]["type"] == "MultiLineString"
    pieces = [np.array(piece) for piece in edge["geometry"]["coordinates"]]
    assert [len(piece) for piece in pieces] == [5, 3]
    assert (np.diff(np.concatenate(pieces)[:, 0]) > 0.0).all()
    gap = one(collection, "gap")
    assert gap["geometry"]["coordinates"] == [pieces[0][-1].tolist(), pieces[1][0].tolist()]
    assert gap["properties"] == {
        "role": "gap", "zone": 1, "side": "right", "from_cone": "cone-4", "to_cone": "cone-5",
        "length_m": pytest.approx(60.0, abs=0.01), "usual_m": 20.0, "unlocated_ids": [],
    }  # fmt: skip


def test_an_edge_without_a_gap_is_one_line_and_a_lone_cone_is_none() -> None:
    even_m = 20.0 * np.arange(5.0)
    row = make_edge(STRAIGHT, ids_of(5), station_m=even_m, beside_m=np.full(5, 3.0),
                    taper_rows=None)  # fmt: skip
    assert one(collect(make_road(make_zone(STRAIGHT, row))), "edge")["geometry"]["type"] == (
        "LineString"
    )
    apart_m = np.array([0.0, 20.0, 100.0])
    row = make_edge(STRAIGHT, ids_of(3), station_m=apart_m, beside_m=np.full(3, 3.0),
                    taper_rows=None)  # fmt: skip
    line = one(collect(make_road(make_zone(STRAIGHT, row))), "edge")["geometry"]
    assert (line["type"], len(line["coordinates"])) == ("LineString", 2)
    alone = make_edge(STRAIGHT, ids_of(2), station_m=np.array([0.0, 100.0]),
                      beside_m=np.full(2, 3.0), taper_rows=None)  # fmt: skip
    collection = collect(make_road(make_zone(STRAIGHT, alone)))
    assert by_role(collection, "edge") == []
    assert len(by_role(collection, "gap")) == 1


def test_properties_tell_side_width_length_and_form() -> None:
    shares = {ZoneForm.ONE_ROW: 0.97, ZoneForm.AREA: 0.03}
    collection = collect(make_road(make_zone(STRAIGHT, probability=shares, speed_mps=np.nan)))
    assert one(collection, "edge")["properties"] == {
        "role": "edge", "zone": 1, "side": "right", "side_probability": 1.0,
        "anchor_ids": list(ids_of(8)),
        "from_station_m": 100.0, "to_station_m": 280.0, "nearest_beside_m": 2.9,
        "farthest_beside_m": 6.0, "free_m": 2.9, "free_at_least_m": pytest.approx(2.65),
        "free_station_m": 180.0, "n_gaps": 1, "form": "one-row", "form_probability": 0.97,
        "zone_length_m": 180.0, "start_cone": "cone-0", "start_within_m": 0.2,
        "end_cone": "cone-7", "end_within_m": 0.2, "speed_mps": None,
    }  # fmt: skip
    assert one(collection, "taper")["properties"] == {
        "role": "taper", "zone": 1, "side": "right", "leads": "in", "from_cone": "cone-0",
        "to_cone": "cone-2", "length_m": 40.0, "width_m": 3.0, "asked_length_m": 78.0,
        "is_long_enough": False,
    }  # fmt: skip


def test_a_closed_area_tells_its_size_and_what_tells_its_width() -> None:
    collection = collect(closed_road())
    assert one(collection, "closed-area")["properties"] == {
        "role": "closed-area", "zone": 1, "form": "one-row", "form_probability": 1.0,
        "area_m2": pytest.approx(648.0), "width_source": "closed-width", "width_m": 3.6,
    }  # fmt: skip
    areas_m2 = [shape(one(collection, f"closed-area{end}")["geometry"]).area
                for end in ("-inner", "", "-outer")]  # fmt: skip
    assert areas_m2 == sorted(areas_m2)
    assert one(collection, "closed-area-inner")["properties"]["probability"] == 0.9


@pytest.mark.parametrize("frame", [None, LocalFrame(48.1, 11.5)])
@pytest.mark.parametrize("line", [STRAIGHT, bend()])
def test_rings_are_closed_counter_clockwise_and_geometries_valid(
    line: RoadLine, frame: LocalFrame | None
) -> None:
    collection = collect(closed_road(line), frame)
    seen = 0
    for feature in collection["features"]:
        if feature["properties"]["role"] not in ROAD_ROLES:
            continue
        geometry = feature["geometry"]
        assert shape(geometry).is_valid
        polygons = {"Polygon": [geometry["coordinates"]]}.get(geometry["type"], ())
        if geometry["type"] == "MultiPolygon":
            polygons = geometry["coordinates"]
        for exterior, *_ in polygons:
            seen += 1
            assert exterior[0] == exterior[-1]
            assert LinearRing(exterior).is_ccw
    assert seen == 5  # three areas, and a band in two pieces


def test_two_edges_and_two_zones_are_told_apart() -> None:
    far = make_edge(STRAIGHT, ids_of(8, "far"), station_m=AT_M + 100.0)
    boundary = make_road(lane_between(STRAIGHT), make_zone(STRAIGHT, far))
    collection = collect(boundary)
    edges = [
        (f["properties"]["zone"], f["properties"]["side"]) for f in by_role(collection, "edge")
    ]
    assert edges == [(1, "left"), (1, "right"), (2, "right")]
    assert [f["properties"]["zone"] for f in by_role(collection, "gap")] == [1, 1, 2]


@pytest.mark.parametrize("boundary", [None, make_road()])
def test_without_zones_only_the_hull_is_left(boundary: RoadBoundary | None) -> None:
    result = with_road(make_reconstruction(), boundary)
    roles = {f["properties"]["role"] for f in boundary_geojson(result)["features"]}  # type: ignore[attr-defined]
    assert roles == {"path", "hull", "outline", "ellipse", "cone"}


def test_the_hull_is_said_to_be_the_papers() -> None:
    hull = one(collect(make_road(make_zone(STRAIGHT))), "hull")
    assert hull["properties"]["note"] == (
        "the paper's boundary: the convex hull of all located cones"
    )


def test_empty_regions_are_left_out() -> None:
    nothing = replace(closed_strip(STRAIGHT), inner=Region((), 0.0))
    zone = make_zone(STRAIGHT, make_edge(STRAIGHT, ids_of(8)), closed=nothing)
    collection = collect(make_road(zone))
    assert by_role(collection, "closed-area-inner") == []
    assert len(by_role(collection, "closed-area")) == 1


# ---- across the 180th meridian --------------------------------------------------------------


def pieces_of(geometry: Any) -> list[Any]:
    whole = shape(geometry)
    return list(getattr(whole, "geoms", [whole]))


def test_every_shape_across_the_meridian_is_cut() -> None:
    collection, whole = collect(closed_road(), FIJI), collect(closed_road())
    for role in sorted(ROAD_ROLES - {"open-strip", "taper", "gap"}):
        feature = one(collection, role)
        pieces = pieces_of(feature["geometry"])
        assert {np.sign(piece.bounds[0]) for piece in pieces} == {1.0, -1.0}, role
        assert all(piece.bounds[2] - piece.bounds[0] < 0.01 for piece in pieces)
        assert len(pieces) == len(pieces_of(one(whole, role)["geometry"])) + 1, role
        assert feature["properties"] == one(whole, role)["properties"]
    for piece in pieces_of(one(collection, "closed-area")["geometry"]):
        assert piece.exterior.is_ccw
    assert one(collection, "taper")["geometry"]["type"] == "LineString"  # it lies on one side
    gap = one(collect(closed_road(), IN_THE_GAP), "gap")
    assert gap["geometry"]["type"] == "MultiLineString"


def test_geopackage_and_kml_have_the_same_roles_across_the_meridian(tmp_path: Path) -> None:
    pyogrio = pytest.importorskip("pyogrio")
    from shapely import from_wkb

    collection = collect(closed_road(), FIJI)
    path = tmp_path / "boundary.gpkg"
    path.write_bytes(geopackage(collection))
    roles = list(dict.fromkeys(f["properties"]["role"] for f in collection["features"]))
    assert pyogrio.list_layers(path)[:, 0].tolist() == roles
    for role in sorted(ROAD_ROLES - {"open-strip"}):
        meta, _, blobs, columns = pyogrio.raw.read(path, layer=role)
        (geometry,), feature = from_wkb(blobs), one(collection, role)
        assert geometry.equals(shape(feature["geometry"]))
        read = dict(zip(meta["fields"], (values[0] for values in columns), strict=True))
        for name in ("zone", "side", "length_m", "area_m2", "form"):
            assert read.get(name) == feature["properties"].get(name)
    with closing(sqlite3.connect(path)) as database:
        west, east = database.execute(
            "SELECT min_x, max_x FROM gpkg_contents WHERE table_name = 'edge'"
        ).fetchone()
    assert west > 179.9 and east < -179.9
    space = {"k": "http://www.opengis.net/kml/2.2"}
    document = ET.fromstring(kml(collection))
    told = [each.text for each in document.iterfind(".//k:Data[@name='role']/k:value", space)]
    assert told == [f["properties"]["role"] for f in collection["features"]]


# ---- names, and which shape leads in KML ----------------------------------------------------


def hidden_roles(boundary: RoadBoundary) -> set[str | None]:
    space = {"k": "http://www.opengis.net/kml/2.2"}
    document = ET.fromstring(kml(collect(boundary, LocalFrame(48.1, 11.5))))
    return {
        each.findtext(".//k:Data[@name='role']/k:value", namespaces=space)
        for each in document.iterfind(".//k:Placemark", space)
        if each.findtext("k:visibility", namespaces=space) == "0"
    }


@pytest.mark.parametrize(
    ("make", "hidden"),
    [
        (lambda: make_zone(STRAIGHT), {"hull", "outline"}),
        (lambda: make_zone(STRAIGHT, form=ZoneForm.AREA), set()),
    ],
)
def test_kml_hides_the_hull_of_a_row(make: Callable[[], Any], hidden: set[str]) -> None:
    assert hidden_roles(make_road(make())) == hidden


def test_hostile_ids_stay_text(tmp_path: Path) -> None:
    ids = (*HOSTILE, *ids_of(4))
    boundary = make_road(make_zone(STRAIGHT, make_edge(STRAIGHT, ids, unlocated=HOSTILE[:1])))
    collection = collect(boundary, LocalFrame(48.1, 11.5))
    assert one(collection, "edge")["properties"]["anchor_ids"] == list(ids)
    assert one(collection, "gap")["properties"]["unlocated_ids"] == [HOSTILE[0]]
    ET.fromstring(kml(collection))
    geopackage(collection)
    with closing(sqlite3.connect(":memory:")) as database:
        database.deserialize(geopackage(collection))
        (listed,) = database.execute('SELECT "anchor_ids" FROM "edge"').fetchone()
    assert json.loads(listed) == list(ids)


def test_the_sides_are_those_of_travel() -> None:
    # What the tests above rest on: on the right of a road to the east is south of it.
    right = make_edge(STRAIGHT, ids_of(8))
    left = make_edge(STRAIGHT, ids_of(8), side=RoadSide.LEFT)
    assert (right.place_m[:, 1] < -4.0).all() and (left.place_m[:, 1] > -4.0).all()
    assert len(SQUARE_M) == 4
