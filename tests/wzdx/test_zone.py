"""Zones of reconstructions, and of the files that they have left."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from factories import SITE, make_fix, make_reconstruction, make_unlocated
from gaia_uwb._shared.errors import InputError
from gaia_uwb.outputs.geojson import boundary_geojson
from gaia_uwb.outputs.report import make_report
from gaia_uwb.scene import LocalFrame
from gaia_uwb.wzdx import make_feeds, read_zone, zone_of
from wzdx_cases import feed_config, zone_pass


def test_a_drive_across_the_zone_is_a_doubt() -> None:
    cones = [make_fix(name, np.array([0.1 * k, 10.0 * k])) for k, name in enumerate("abc")]
    zone = zone_of(zone_pass([[-30.0, 0.0], [30.0, 0.0]], cones))
    assert not zone.reliable
    assert "their order along the road is unknown" in zone.doubts[0]


@pytest.mark.parametrize(
    ("slant_deg", "along"), [(0.0, True), (45.0, True), (65.0, False), (80.0, False)]
)
def test_a_drive_must_lead_along_the_zone_and_not_past_its_side(
    slant_deg: float, along: bool
) -> None:
    """Past a row of cones at an angle, they are passed within its cosine of the row's length."""
    slant_rad = np.radians(slant_deg)
    row_m = 10.0 * np.array([np.cos(slant_rad), np.sin(slant_rad)])
    cones = [make_fix(name, k * row_m) for k, name in enumerate("abcd")]
    zone = zone_of(zone_pass([[-30.0, -3.0], [60.0, -3.0]], cones))
    assert zone.parts[0].along_m[-1] == pytest.approx(30.0 * np.cos(slant_rad))
    assert zone.reliable == along
    assert bool(zone.reasons) != along


def test_results_read_back_give_the_same_zone(tmp_path: Path) -> None:
    result = make_reconstruction(changed={1: make_unlocated("cone-1")})
    (tmp_path / "report.json").write_text(json.dumps(make_report(result)))
    (tmp_path / "boundary.geojson").write_text(json.dumps(boundary_geojson(result)))
    zone, read = zone_of(result), read_zone(tmp_path)
    assert [cone.anchor_id for cone in read.cones] == [cone.anchor_id for cone in zone.cones]
    assert read.unlocated == ("cone-1",)
    assert read.frame == SITE
    assert read.parts[0].line_m == pytest.approx(zone.parts[0].line_m, abs=1e-3)
    for one, other in zip(read.cones, zone.cones, strict=True):
        assert one.covariance_m2 == pytest.approx(other.covariance_m2)
        assert (one.status, one.n_ranges) == (other.status, other.n_ranges)


def test_a_drive_across_the_180th_meridian_is_one_path_again(tmp_path: Path) -> None:
    # The road leads across, twice; the zone lies on this side of the meridian.
    road_m = np.array([[x, 20.0 * (k % 2)] for k, x in enumerate([-60.0, -5.0, 25.0, -25.0])])
    cones = [make_fix(name, np.array([-55.0 + 20 * k, 4.0])) for k, name in enumerate("abc")]
    result = zone_pass(road_m, cones, frame=LocalFrame(lat_deg=-16.8, lon_deg=179.99999))
    (tmp_path / "report.json").write_text(json.dumps(make_report(result)))
    geojson: Any = boundary_geojson(result)
    (tmp_path / "boundary.geojson").write_text(json.dumps(geojson))
    assert len(geojson["features"][0]["geometry"]["coordinates"]) == 3
    assert read_zone(tmp_path).parts[0].line_m == pytest.approx(
        zone_of(result).parts[0].line_m, abs=1e-3
    )
    date = datetime(2026, 11, 22, tzinfo=UTC)
    event: Any = make_feeds(read_zone(tmp_path), feed_config(), date).work_zone["features"]
    assert all(lon > 179.9 for lon, _ in event[0]["geometry"]["coordinates"])


@pytest.mark.parametrize("coordinates", [[], [[]], [[[0.0, 1.0]]], 7, [7, 8]])
def test_a_path_in_pieces_that_is_none(tmp_path: Path, coordinates: object) -> None:
    result = make_reconstruction()
    geojson: Any = boundary_geojson(result)
    geojson["features"][0]["geometry"] = {"type": "MultiLineString", "coordinates": coordinates}
    (tmp_path / "report.json").write_text(json.dumps(make_report(result)))
    (tmp_path / "boundary.geojson").write_text(json.dumps(geojson))
    with pytest.raises(InputError, match="expected a feature with the role 'path'"):
        read_zone(tmp_path)


@pytest.mark.parametrize(
    ("report", "geojson", "problem"),
    [
        ("{}", "{}", "not a report of this version"),
        ("[1]", "{}", "not a report of this version"),
        ("nonsense", "{}", "not usable JSON"),
        (None, "{}", "expected a feature with the role 'path'"),
        (None, '{"gaia": {"scene": "another"}}', "expected the scene 'a drive'"),
    ],
)
def test_results_that_are_none(
    tmp_path: Path, report: str | None, geojson: str, problem: str
) -> None:
    good = json.dumps(make_report(make_reconstruction()))
    (tmp_path / "report.json").write_text(good if report is None else report)
    (tmp_path / "boundary.geojson").write_text(geojson)
    with pytest.raises(InputError, match=problem):
        read_zone(tmp_path)


@pytest.mark.parametrize("line", [[[[1.0], [2.0]]] * 2, [[1.0]], [[1.0, 2.0, 3.0]], [], [7], "x"])
def test_a_path_that_is_none_is_refused(tmp_path: Path, line: object) -> None:
    result = make_reconstruction()
    (tmp_path / "report.json").write_text(json.dumps(make_report(result)))
    geojson: Any = boundary_geojson(result)
    for feature in geojson["features"]:
        if feature["properties"]["role"] == "path":
            feature["geometry"]["coordinates"] = line
    (tmp_path / "boundary.geojson").write_text(json.dumps(geojson))
    with pytest.raises(InputError, match="path"):
        read_zone(tmp_path)


@pytest.mark.parametrize("value", [1e308, -1e308, 1e18, None])
@pytest.mark.parametrize(
    "path",
    [("anchors", 1, "east_m"), ("boundary", "hull_m", 0, 1), ("anchors", 0, "covariance_m2")],
)
def test_numbers_that_no_site_has_are_refused(
    tmp_path: Path, path: tuple[str | int, ...], value: float | None
) -> None:
    report: Any = json.loads(json.dumps(make_report(make_reconstruction())))
    node = report
    for step in path[:-1]:
        node = node[step]
    node[path[-1]] = [[1.0, 0.0], [0.0, value]] if path[-1] == "covariance_m2" else value
    (tmp_path / "report.json").write_text(json.dumps(report))
    (tmp_path / "boundary.geojson").write_text(json.dumps(boundary_geojson(make_reconstruction())))
    if path[-1] == "covariance_m2" and value in (1e18, None):
        assert read_zone(tmp_path).cones  # a poor fix, or an unknown one
        return
    with pytest.raises(InputError, match="not a report of this version"):
        read_zone(tmp_path)


@pytest.mark.parametrize("value", [7, {"a": {}}, "x" * 70_000])
@pytest.mark.parametrize("member", ["scene", "reasons", "id"])
def test_texts_that_are_none_are_refused(tmp_path: Path, member: str, value: object) -> None:
    report: Any = make_report(make_reconstruction())
    match member:
        case "scene":
            report["scene"] = value
        case "reasons":
            report |= {"status": "unreliable", "reasons": [{"kind": "clock", "text": value}]}
        case _:
            report["anchors"][0]["id"] = value
    (tmp_path / "report.json").write_text(json.dumps(report))
    with pytest.raises(InputError, match="not a report of this version") as caught:
        read_zone(tmp_path)
    assert len(str(caught.value)) < 600


def test_a_report_without_place_is_refused(tmp_path: Path) -> None:
    result = make_reconstruction(frame=None)
    (tmp_path / "report.json").write_text(json.dumps(make_report(result)))
    with pytest.raises(InputError, match="position on Earth is unknown"):
        read_zone(tmp_path)
