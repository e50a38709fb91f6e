"""From drives past a row of cones to its files: all of them tell one edge, and none the hull first.

The drives are simulated by ``road_forms.py``, on a curve and with both rows, each in two lanes.
"""

from __future__ import annotations

import json
import re
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from shapely import LineString, union_all
from shapely.geometry import shape

from browser import Browser
from gaia_uwb.config import make_config
from gaia_uwb.outputs import write_all
from gaia_uwb.pipeline import reconstruct
from gaia_uwb.reconstruction import Reconstruction
from gaia_uwb.roadside import RoadSide, ZoneForm
from gaia_uwb.wzdx import make_feeds, read_zone
from gaia_uwb.wzdx.feeds import feed_text
from map_looks import DESKTOP, show, texts
from road_forms import road_form
from wzdx_cases import feed_config, official_schemas

CURVE, BOTH_ROWS = 1066, 1089


@pytest.fixture(scope="module", params=[CURVE, BOTH_ROWS])
def written(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Reconstruction, Path]:
    """Return a result and the folder of its files; on the curve, one lane is said to be closed."""
    seed = request.param
    drives = [drive.without_truth() for drive in road_form(seed).drives]
    stated = {"closed_lanes": 1} if seed == CURVE else {}
    result = reconstruct(drives, make_config({"boundary": stated}))
    folder = tmp_path_factory.mktemp(f"road-{seed}")
    write_all(result, folder, gis=True)
    return result, folder


def features(folder: Path, role: str) -> list[Any]:
    collection = json.loads((folder / "boundary.geojson").read_text())
    return [f for f in collection["features"] if f["properties"]["role"] == role]


def test_the_zone_has_the_form_that_was_driven_past(written: tuple[Reconstruction, Path]) -> None:
    result, _ = written
    assert result.road_boundary is not None
    (zone,) = result.road_boundary.zones
    sides = [edge.side for edge in zone.edges]
    if zone.form is ZoneForm.ONE_ROW:
        assert sides == [RoadSide.RIGHT]
    else:
        assert zone.form is ZoneForm.LANE_BETWEEN and set(sides) == set(RoadSide)


def test_the_report_tells_the_edge_that_the_geojson_draws(
    written: tuple[Reconstruction, Path],
) -> None:
    _, folder = written
    first = (folder / "report.md").read_text().splitlines()[2]
    told = re.findall(
        r"edge runs ([\d.]+) to ([\d.]+) m (left|right) of your path from (\d+) to (\d+) m", first
    )
    edges = [edge["properties"] for edge in features(folder, "edge")]
    assert [(side, int(a), int(b)) for _, _, side, a, b in told] == [
        (e["side"], round(e["from_station_m"]), round(e["to_station_m"])) for e in edges
    ]
    for (near, far, *_), edge in zip(told, edges, strict=True):
        assert edge["nearest_beside_m"] - 0.051 <= float(near) <= float(far)
        assert float(far) <= edge["farthest_beside_m"] + 0.051
    assert "The work zone covers" not in first


def test_nothing_that_is_closed_or_an_edge_meets_a_driven_path(
    written: tuple[Reconstruction, Path],
) -> None:
    _, folder = written
    path = union_all([shape(f["geometry"]) for f in features(folder, "path")])
    for role in ("closed-area", "closed-area-inner", "edge", "edge-band"):
        for feature in features(folder, role):
            assert not shape(feature["geometry"]).intersects(path), role


def test_bands_hold_their_edges_and_cones(written: tuple[Reconstruction, Path]) -> None:
    result, folder = written
    bands = features(folder, "edge-band")
    for edge, band in zip(features(folder, "edge"), bands, strict=True):
        line, area = shape(edge["geometry"]), shape(band["geometry"]).buffer(1e-6)
        assert line.intersection(area).length > 0.9 * line.length
    located = {fix.anchor_id for fix in result.anchors if fix.status.has_position}
    assert {i for e in features(folder, "edge") for i in e["properties"]["anchor_ids"]} <= located


def test_the_feed_runs_from_the_first_device_to_the_last(
    written: tuple[Reconstruction, Path],
) -> None:
    result, folder = written
    assert result.road_boundary is not None
    zone = read_zone(folder)
    feeds = make_feeds(zone, feed_config(extension=True), datetime(2026, 11, 22, tzinfo=UTC))
    for feed, kind in ((feeds.work_zone, "WorkZoneFeed"), (feeds.device, "DeviceFeed")):
        read = json.loads(feed_text(feed))
        assert list(map(str, official_schemas().problems(read, kind, "wzdx-4.2"))) == []
    (part,), (found,) = zone.parts, result.road_boundary.zones
    assert (part.cones[0].anchor_id, part.cones[-1].anchor_id) == (
        found.start.cone, found.end.cone,
    )  # fmt: skip
    assert LineString(part.line_m).length == pytest.approx(found.length_m, rel=0.02)


def test_the_map_shows_the_edge_and_hides_the_hull(
    chromium: Browser, written: tuple[Reconstruction, Path]
) -> None:
    _, folder = written
    show(chromium, folder / "map.html", DESKTOP)
    assert "edge runs" in texts(chromium, "#status")[0]
    assert chromium.evaluate("getComputedStyle(hull).display") == "none"
    drawn = chromium.evaluate("document.querySelectorAll('#map path.edge').length")
    assert drawn == len(features(folder, "edge"))


def test_the_report_for_programs_has_the_same_edges(written: tuple[Reconstruction, Path]) -> None:
    _, folder = written
    road = json.loads((folder / "report.json").read_text())["road_boundary"]
    (zone,) = road["zones"]
    for edge, drawn in zip(zone["edges"], features(folder, "edge"), strict=True):
        assert edge["cones"] == drawn["properties"]["anchor_ids"]
        assert np.diff(edge["station_m"]).min() >= 0.0
