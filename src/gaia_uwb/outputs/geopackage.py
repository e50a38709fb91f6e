"""The reconstruction as a GeoPackage (OGC 12-128r19), one file for a GIS.

A GeoPackage is an SQLite database with tables that the standard names; SQLite comes with Python and
the features come from ``geojson.py``, so no other library is needed. One layer per role that has
features, with the GeoJSON's properties as columns. Coordinates are WGS84 (EPSG:4326, longitude
first), or, where the scene has no geographic reference, metres in an undefined Cartesian system
(``srs_id`` -1).

>>> from gaia_uwb.outputs.geopackage import geopackage
>>> geopackage({"type": "FeatureCollection", "gaia": {"coordinates": "local"}, "features": []})[:15]
b'SQLite format 3'
"""

from __future__ import annotations

import json
import sqlite3
import struct
from collections.abc import Sequence
from contextlib import closing
from typing import Any

import numpy as np

from gaia_uwb.outputs.antimeridian import bounding_box
from gaia_uwb.outputs.geojson import WGS84, Json

_APPLICATION_ID = 0x47504B47  # "GPKG"
_VERSION = 10300
_WGS84_ID = 4326
_CHANGED = "2000-01-01T00:00:00.000Z"  # asked for by the standard; one log gives one file
# One type per layer, so that of everything but points there may be several pieces.
_TYPES = {
    "Point": "POINT",
    "LineString": "MULTILINESTRING",
    "MultiLineString": "MULTILINESTRING",
    "Polygon": "MULTIPOLYGON",
    "MultiPolygon": "MULTIPOLYGON",
}
_COLUMNS = {str: "TEXT", float: "REAL", int: "INTEGER", bool: "BOOLEAN"}

_TABLES = """
CREATE TABLE gpkg_spatial_ref_sys (srs_name TEXT NOT NULL, srs_id INTEGER NOT NULL PRIMARY KEY,
  organization TEXT NOT NULL, organization_coordsys_id INTEGER NOT NULL, definition TEXT NOT NULL,
  description TEXT);
CREATE TABLE gpkg_contents (table_name TEXT NOT NULL PRIMARY KEY, data_type TEXT NOT NULL,
  identifier TEXT UNIQUE, description TEXT DEFAULT '', last_change DATETIME NOT NULL DEFAULT
  (strftime('%Y-%m-%dT%H:%M:%fZ','now')), min_x DOUBLE, min_y DOUBLE, max_x DOUBLE, max_y DOUBLE,
  srs_id INTEGER, CONSTRAINT fk_gc_r_srs_id FOREIGN KEY (srs_id) REFERENCES
  gpkg_spatial_ref_sys(srs_id));
CREATE TABLE gpkg_geometry_columns (table_name TEXT NOT NULL, column_name TEXT NOT NULL,
  geometry_type_name TEXT NOT NULL, srs_id INTEGER NOT NULL, z TINYINT NOT NULL,
  m TINYINT NOT NULL, CONSTRAINT pk_geom_cols PRIMARY KEY (table_name, column_name),
  CONSTRAINT uk_gc_table_name UNIQUE (table_name), CONSTRAINT fk_gc_tn FOREIGN KEY (table_name)
  REFERENCES gpkg_contents(table_name), CONSTRAINT fk_gc_srs FOREIGN KEY (srs_id) REFERENCES
  gpkg_spatial_ref_sys (srs_id));
"""
_WGS84_WKT = (
    'GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257223563,'
    'AUTHORITY["EPSG","7030"]],AUTHORITY["EPSG","6326"]],PRIMEM["Greenwich",0,'
    'AUTHORITY["EPSG","8901"]],UNIT["degree",0.0174532925199433,AUTHORITY["EPSG","9122"]],'
    'AUTHORITY["EPSG","4326"]]'
)
_SYSTEMS = [
    ("Undefined Cartesian SRS", -1, "NONE", -1, "undefined", None),
    ("Undefined geographic SRS", 0, "NONE", 0, "undefined", None),
    ("WGS 84 geodetic", _WGS84_ID, "EPSG", _WGS84_ID, _WGS84_WKT, "longitude/latitude in degrees"),
]


def geopackage(collection: Json) -> bytes:
    """Return a feature collection as the content of a GeoPackage file.

    Parameters
    ----------
    collection
        From :func:`gaia_uwb.outputs.boundary_geojson`.
    """
    content: Any = collection
    system = _WGS84_ID if content["gaia"]["coordinates"] == WGS84 else -1
    layers: dict[str, list[Any]] = {}
    for feature in content["features"]:
        layers.setdefault(feature["properties"]["role"], []).append(feature)
    with closing(sqlite3.connect(":memory:")) as database:
        database.execute(f"PRAGMA application_id = {_APPLICATION_ID}")
        database.execute(f"PRAGMA user_version = {_VERSION}")
        database.executescript(_TABLES)
        database.executemany("INSERT INTO gpkg_spatial_ref_sys VALUES (?, ?, ?, ?, ?, ?)", _SYSTEMS)
        for role, features in layers.items():
            _add_layer(database, role, features, system)
        database.commit()
        return database.serialize()


def _add_layer(
    database: sqlite3.Connection, role: str, features: Sequence[Any], system: int
) -> None:
    """Add one table of features; its name is a role of ours, its columns are our properties."""
    columns: dict[str, str] = {}
    for feature in features:
        for name, value in feature["properties"].items():
            kind = "TEXT" if value is None else _COLUMNS.get(type(value), "TEXT")
            if name != "role" and (name not in columns or value is not None):
                columns[name] = kind
    listed = "".join(f', "{name}" {kind}' for name, kind in columns.items())
    database.execute(
        f'CREATE TABLE "{role}" (fid INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, geom BLOB{listed})'
    )
    boxes = []
    marks = ", ".join("?" * (1 + len(columns)))
    names = ", ".join(["geom", *(f'"{name}"' for name in columns)])
    for feature in features:
        blob, box = _geometry(feature["geometry"], system)
        boxes.append(box)
        values = [_plain(feature["properties"].get(name)) for name in columns]
        statement = f'INSERT INTO "{role}" ({names}) VALUES ({marks})'  # noqa: S608 - our names
        database.execute(statement, [blob, *values])
    extent = [*np.min(boxes, axis=0)[:2].tolist(), *np.max(boxes, axis=0)[2:].tolist()]
    if system == _WGS84_ID:
        # As in the GeoJSON, west exceeds east across the 180th meridian: -180 to 180 is the globe.
        extent = bounding_box([feature["geometry"] for feature in features])
    database.execute(
        "INSERT INTO gpkg_contents VALUES (?, 'features', ?, '', ?, ?, ?, ?, ?, ?)",
        [role, role, _CHANGED, *extent, system],
    )
    kind = _TYPES[features[0]["geometry"]["type"]]
    database.execute(
        "INSERT INTO gpkg_geometry_columns VALUES (?, 'geom', ?, ?, 0, 0)", [role, kind, system]
    )


def _plain(value: object) -> object:
    return json.dumps(value, ensure_ascii=False) if isinstance(value, (list, dict)) else value


def _geometry(geometry: Any, system: int) -> tuple[bytes, tuple[float, float, float, float]]:
    """Return a geometry as GeoPackage binary (a header and well-known binary), and its box."""
    kind, coordinates = geometry["type"], geometry["coordinates"]
    if kind == "Point":
        body, points = struct.pack("<BI2d", 1, 1, *coordinates), [coordinates]
    elif _TYPES[kind] == "MULTILINESTRING":
        lines = [coordinates] if kind == "LineString" else coordinates
        points = [point for line in lines for point in line]
        body = struct.pack("<BII", 1, 5, len(lines)) + b"".join(map(_line, lines))
    else:
        polygons = [coordinates] if kind == "Polygon" else coordinates
        points = [point for polygon in polygons for ring in polygon for point in ring]
        body = struct.pack("<BII", 1, 6, len(polygons)) + b"".join(map(_polygon, polygons))
    east, north = zip(*points, strict=True)
    box = (min(east), min(north), max(east), max(north))
    # Little-endian, with an envelope of x and y where the geometry is no point.
    flags, envelope = (1, b"") if kind == "Point" else (3, struct.pack(
        "<4d", box[0], box[2], box[1], box[3]))  # fmt: skip
    return struct.pack("<2sBBi", b"GP", 0, flags, system) + envelope + body, box


def _line(positions: Any) -> bytes:
    return struct.pack("<BI", 1, 2) + _positions(positions)


def _polygon(rings: Any) -> bytes:
    return struct.pack("<BII", 1, 3, len(rings)) + b"".join(map(_positions, rings))


def _positions(points: Any) -> bytes:
    flat = [number for point in points for number in point]
    return struct.pack(f"<I{len(flat)}d", len(points), *flat)
