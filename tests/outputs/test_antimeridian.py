"""What crosses the 180th meridian is cut there: nothing runs round the globe, nothing is lost."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from itertools import pairwise
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from hypothesis import given, strategies as st
from shapely import affinity, make_valid, union_all
from shapely.geometry import LinearRing, LineString, Polygon, shape

from factories import SQUARE_M, make_reconstruction
from gaia_uwb.outputs import boundary_geojson, cut_at_antimeridian
from gaia_uwb.outputs.antimeridian import bounding_box
from gaia_uwb.outputs.geopackage import geopackage
from gaia_uwb.outputs.kml import kml
from gaia_uwb.scene import LocalFrame

FIJI = LocalFrame(lat_deg=-16.8, lon_deg=179.99998)  # 2.1 m west; the square is 4 m wide
ROLES = ("path", "hull", "outline", "ellipse", "cone")


def wrapped(positions: np.ndarray) -> list[list[float]]:
    """Return longitudes as a geodetic library gives them."""
    lon_deg = (positions[:, 0] + 180.0) % 360.0 - 180.0
    return np.column_stack([lon_deg, positions[:, 1]]).tolist()


def lines_of(geometry: Any) -> list[Any]:
    kind, coordinates = geometry["type"], geometry["coordinates"]
    if kind == "Point":
        return [[coordinates]]
    return {
        "LineString": lambda: [coordinates],
        "MultiPolygon": lambda: [ring for polygon in coordinates for ring in polygon],
    }.get(kind, lambda: coordinates)()


def longest_step_deg(geometry: Any) -> float:
    steps = [abs(a[0] - b[0]) for line in lines_of(geometry) for a, b in pairwise(line)]
    return max(steps, default=0.0)


def unwrapped(geometry: Any) -> Any:
    """Return the pieces of a cut geometry side by side again, east of 0."""
    pieces = [
        affinity.translate(piece, xoff=360.0) if piece.bounds[0] < 0.0 else piece
        for piece in getattr(shape(geometry), "geoms", [shape(geometry)])
    ]
    return union_all(pieces)


@st.composite
def stars(draw: st.DrawFn) -> np.ndarray:
    """Return a ring without self-crossings about a place near the meridian."""
    n = draw(st.integers(3, 30))
    reach_deg = np.array(draw(st.lists(st.floats(0.001, 0.9), min_size=n, max_size=n)))
    angle = np.arange(n) * (2.0 * np.pi / n)
    centre = [180.0 + draw(st.floats(-0.8, 0.8)), draw(st.floats(-80.0, 80.0))]
    ring = centre + np.column_stack([np.cos(angle), np.sin(angle)]) * reach_deg[:, None]
    ring = np.roll(ring, draw(st.integers(0, n - 1)), axis=0)
    return np.concatenate([ring, ring[:1]])


@given(stars(), st.booleans())
def test_polygons_keep_their_area_and_place(ring: np.ndarray, hollow: bool) -> None:
    inside = ring.mean(axis=0) + (ring[::-1] - ring.mean(axis=0)) * 0.2
    hole = inside if hollow and Polygon(ring).contains(LinearRing(inside)) else None
    rings = [ring] if hole is None else [ring, hole]
    cut = cut_at_antimeridian({"type": "Polygon", "coordinates": [wrapped(r) for r in rings]})
    whole = Polygon(rings[0], rings[1:])
    assert longest_step_deg(cut) < 180.0
    assert shape(cut).is_valid
    assert shape(cut).area == pytest.approx(whole.area, abs=1e-7)
    assert unwrapped(cut).symmetric_difference(whole).area == pytest.approx(0.0, abs=1e-7)
    for polygon in shape(cut).geoms if cut["type"] == "MultiPolygon" else []:
        assert polygon.exterior.is_ccw and not any(hole.is_ccw for hole in polygon.interiors)


@given(st.lists(st.tuples(st.floats(179.0, 181.0), st.floats(-60.0, 60.0)), min_size=2))
def test_lines_keep_their_length_and_order(places: list[tuple[float, float]]) -> None:
    line = np.array(places)
    cut = cut_at_antimeridian({"type": "LineString", "coordinates": wrapped(line)})
    assert longest_step_deg(cut) < 180.0
    assert shape(cut).length == pytest.approx(LineString(line).length, abs=1e-6)
    first, last = lines_of(cut)[0][0], lines_of(cut)[-1][-1]
    ends = np.array([first, last]) - line[[0, -1]]
    assert np.abs((ends + 180.0) % 360.0 - 180.0).max() < 1e-8


def test_a_drive_there_and_back_stays_two_lines() -> None:
    there = np.array([[179.0, 0.0], [181.0, 0.0], [179.0, 0.0]])
    cut = cut_at_antimeridian({"type": "LineString", "coordinates": wrapped(there)})
    assert cut["coordinates"] == [
        [[179.0, 0.0], [180.0, 0.0]],
        [[-180.0, 0.0], [-179.0, 0.0], [-180.0, 0.0]],
        [[180.0, 0.0], [179.0, 0.0]],
    ]


@pytest.mark.parametrize("edge_deg", [180.0, -180.0])
def test_what_only_touches_the_meridian_stays_in_one_piece(edge_deg: float) -> None:
    line = {"type": "LineString", "coordinates": [[179.5, 1.0], [edge_deg, 2.0], [179.5, 3.0]]}
    assert shape(cut_at_antimeridian(line)).length == pytest.approx(np.hypot(0.5, 1.0) * 2)
    assert longest_step_deg(cut_at_antimeridian(line)) < 180.0
    ring = [[179.5, 0.0], [edge_deg, 0.0], [edge_deg, 1.0], [179.5, 1.0], [179.5, 0.0]]
    polygon = shape(cut_at_antimeridian({"type": "Polygon", "coordinates": [ring]}))
    assert polygon.area == pytest.approx(0.5)
    assert polygon.bounds == (179.5, 0.0, 180.0, 1.0)


def test_an_outline_that_crosses_itself_is_cut_as_well() -> None:
    bow = np.array([[179.0, 0.0], [181.0, 1.0], [181.0, 0.0], [179.0, 1.0], [179.0, 0.0]])
    cut = cut_at_antimeridian({"type": "Polygon", "coordinates": [wrapped(bow)]})
    assert longest_step_deg(cut) < 180.0
    assert shape(cut).area == pytest.approx(make_valid(Polygon(bow)).area)


def test_several_polygons_become_one_list_of_pieces() -> None:
    squares = [[wrapped(np.array([[lon - 1, 0], [lon + 1, 0], [lon, 1], [lon - 1, 0]]))]
               for lon in (170.0, 180.0, 190.0)]  # fmt: skip
    cut = cut_at_antimeridian({"type": "MultiPolygon", "coordinates": squares})
    assert len(cut["coordinates"]) == 4
    assert shape(cut).area == pytest.approx(3.0)


@pytest.mark.parametrize("kind", ["Point", "LineString", "Polygon", "MultiPolygon"])
def test_elsewhere_nothing_changes(kind: str) -> None:
    ring = [[-0.5, 51.0], [0.5, 51.0], [0.0, 52.0], [-0.5, 51.0]]
    coordinates = {"Point": ring[0], "LineString": ring, "Polygon": [ring]}.get(kind, [[ring]])
    geometry = {"type": kind, "coordinates": coordinates}
    assert cut_at_antimeridian(geometry) is geometry


def test_boxes_run_from_west_to_east() -> None:
    point = {"type": "Point", "coordinates": [-179.5, -17.0]}
    line = {"type": "LineString", "coordinates": [[179.0, -16.0], [179.5, -18.0]]}
    assert bounding_box([point, line]) == [179.0, -18.0, -179.5, -16.0]
    assert bounding_box([line]) == [179.0, -18.0, 179.5, -16.0]
    ends = {"type": "LineString", "coordinates": [[179.0, 1.0], [180.0, 2.0]]}
    assert bounding_box([ends]) == [179.0, 1.0, 180.0, 2.0]


def test_every_shape_of_a_zone_across_the_meridian_is_cut(tmp_path: Path) -> None:
    collection: Any = boundary_geojson(make_reconstruction(frame=FIJI))
    for feature in collection["features"]:
        assert longest_step_deg(feature["geometry"]) < 1e-3, feature["properties"]["role"]
    kinds = {f["properties"]["role"]: f["geometry"]["type"] for f in collection["features"]}
    assert kinds["path"] == "MultiLineString"
    assert kinds["hull"] == kinds["outline"] == "MultiPolygon"
    west, south, east, north = collection["bbox"]
    assert 179.99 < west < 180.0 and -180.0 < east < -179.99 and south < north < -16.0


def test_the_box_is_in_degrees_or_nowhere() -> None:
    collection: Any = boundary_geojson(make_reconstruction())
    everything = shape({"type": "GeometryCollection",
                        "geometries": [f["geometry"] for f in collection["features"]]})  # fmt: skip
    assert collection["bbox"] == pytest.approx(everything.bounds, abs=1e-8)
    assert "bbox" not in boundary_geojson(make_reconstruction(frame=None))
    assert "bbox" not in boundary_geojson(make_reconstruction(), local=True)


def test_kml_of_a_zone_across_the_meridian() -> None:
    text = kml(boundary_geojson(make_reconstruction(frame=FIJI)))
    space = {"k": "http://www.opengis.net/kml/2.2"}
    for element in ET.fromstring(text).iterfind(".//k:coordinates", space):
        places = [[float(n) for n in pair.split(",")] for pair in (element.text or "").split()]
        assert all(abs(lon) <= 180.0 for lon, _ in places)
        assert all(abs(a[0] - b[0]) < 1e-3 for a, b in pairwise(places))
    assert "<MultiGeometry><LineString>" in text


def test_geopackage_of_a_zone_across_the_meridian(tmp_path: Path) -> None:
    pyogrio = pytest.importorskip("pyogrio")
    from shapely import from_wkb

    collection: Any = boundary_geojson(make_reconstruction(frame=FIJI))
    path = tmp_path / "boundary.gpkg"
    path.write_bytes(geopackage(collection))
    for role in ROLES:
        features = [f for f in collection["features"] if f["properties"]["role"] == role]
        _, _, blobs, _ = pyogrio.raw.read(path, layer=role)
        for blob, feature in zip(blobs, features, strict=True):
            found = from_wkb(blob)
            assert found.equals(shape(feature["geometry"]))
            for piece in getattr(found, "geoms", [found]):
                assert piece.bounds[2] - piece.bounds[0] < 1e-3
    with closing(sqlite3.connect(path)) as database:
        extents = database.execute("SELECT min_x, max_x FROM gpkg_contents").fetchall()
    assert len(extents) == len(ROLES)
    assert all(west > 179.99 and east < -179.99 for west, east in extents)


def test_square_lies_on_both_sides() -> None:
    # What the tests above rest on.
    collection: Any = boundary_geojson(make_reconstruction(frame=FIJI))
    cones = [f for f in collection["features"] if f["properties"]["role"] == "cone"]
    signs = {np.sign(cone["geometry"]["coordinates"][0]) for cone in cones}
    assert signs == {1.0, -1.0} and len(cones) == len(SQUARE_M)
