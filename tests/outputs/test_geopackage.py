"""A reader that is not ours finds in the GeoPackage what the GeoJSON says."""

from __future__ import annotations

import sqlite3
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from shapely.geometry import shape

from factories import SQUARE_M, make_fix, make_reconstruction
from gaia_uwb.estimate import AnchorStatus
from gaia_uwb.outputs.geojson import boundary_geojson
from gaia_uwb.outputs.geopackage import geopackage

pyogrio = pytest.importorskip("pyogrio")


def make_collection(frame: Any = "site") -> Any:
    fix = make_fix('<A> "x"; DROP', SQUARE_M[0], status=AnchorStatus.AMBIGUOUS)
    changes = {} if frame == "site" else {"frame": None}
    return boundary_geojson(make_reconstruction(changed={0: fix}, **changes))


def write(collection: Any, folder: Path) -> Path:
    path = folder / "boundary.gpkg"
    path.write_bytes(geopackage(collection))
    return path


def test_every_layer_holds_the_features_of_its_role(tmp_path: Path) -> None:
    collection = make_collection()
    path = write(collection, tmp_path)
    roles = list(dict.fromkeys(f["properties"]["role"] for f in collection["features"]))
    assert pyogrio.list_layers(path)[:, 0].tolist() == roles
    for role in roles:
        features = [f for f in collection["features"] if f["properties"]["role"] == role]
        meta, _, blobs, columns = pyogrio.raw.read(path, layer=role)
        assert meta["crs"] == "EPSG:4326"
        found = shapely.from_wkb(blobs)
        for geometry, feature in zip(found, features, strict=True):
            assert geometry.is_valid
            assert geometry.equals(shape(feature["geometry"]))
        for name, values in zip(meta["fields"], columns, strict=True):
            for value, feature in zip(values, features, strict=True):
                told = feature["properties"].get(name)
                if isinstance(told, (str, float, int)) and not isinstance(told, bool):
                    assert value == told
                elif told is None:
                    assert value is None or np.isnan(value)


def test_the_file_says_what_it_is(tmp_path: Path) -> None:
    database = sqlite3.connect(write(make_collection(), tmp_path))
    assert database.execute("PRAGMA application_id").fetchone() == (0x47504B47,)
    assert database.execute("PRAGMA integrity_check").fetchone() == ("ok",)
    assert database.execute("PRAGMA foreign_key_check").fetchall() == []
    box = database.execute(
        "SELECT min_x, min_y, max_x, max_y FROM gpkg_contents WHERE table_name = 'cone'"
    ).fetchone()
    lon_deg, lat_deg = zip(
        *(f["geometry"]["coordinates"] for f in make_collection()["features"]
          if f["properties"]["role"] == "cone"), strict=True
    )  # fmt: skip
    assert box == (min(lon_deg), min(lat_deg), max(lon_deg), max(lat_deg))
    database.close()


def test_without_a_place_on_earth_it_is_in_metres(tmp_path: Path) -> None:
    path = write(make_collection(frame=None), tmp_path)
    database = sqlite3.connect(path)
    systems = database.execute("SELECT DISTINCT srs_id FROM gpkg_geometry_columns").fetchall()
    database.close()
    assert systems == [(-1,)]
    blobs = pyogrio.raw.read(path, layer="cone")[2]
    assert [list(p.coords[0]) for p in shapely.from_wkb(blobs)] == SQUARE_M.tolist()


def test_one_result_gives_one_file() -> None:
    assert geopackage(make_collection()) == geopackage(make_collection())
