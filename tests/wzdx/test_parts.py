"""A feed has one road event for each work zone along the road, with what is known of its edges."""

from __future__ import annotations

import json
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from factories import make_fix
from gaia_uwb._shared.errors import ConfigError, InputError
from gaia_uwb.estimate import AnchorStatus
from gaia_uwb.outputs.geojson import boundary_geojson
from gaia_uwb.outputs.report import make_report
from gaia_uwb.projection import to_local
from gaia_uwb.reconstruction import Reconstruction
from gaia_uwb.roadside import RoadBoundary
from gaia_uwb.wzdx import FeedConfig, Feeds, FeedZone, make_feeds, read_zone, zone_of
from gaia_uwb.wzdx.feeds import feed_text
from gaia_uwb.wzdx.parts import RoadZone
from road_zones import (
    AT_M,
    BESIDE_M,
    STRAIGHT,
    bend,
    closed_strip,
    ids_of,
    make_edge,
    make_road,
    make_road_result,
    make_zone,
    with_road,
)
from wzdx_cases import CWZ, IOWA, feed_config, official_schemas

DATE = datetime(2026, 11, 22, 10, tzinfo=UTC)
LANES = [
    {"order": 1, "status": "open"},
    {"order": 2, "status": "closed"},
    {"order": 3, "status": "closed", "type": "shoulder"},
]


def result_of(boundary: RoadBoundary) -> Reconstruction:
    return make_road_result(boundary, frame=IOWA)


def two_zones() -> RoadBoundary:
    """Return two zones, in the wrong order: of the road, not of the driver."""
    near = make_edge(STRAIGHT, ids_of(4), station_m=AT_M[:4], beside_m=np.full(4, 3.0),
                     taper_rows=None)  # fmt: skip
    far = make_edge(STRAIGHT, ids_of(4, "far"), station_m=AT_M[:4] + 220.0,
                    beside_m=np.full(4, 3.0), taper_rows=None)  # fmt: skip
    return make_road(make_zone(STRAIGHT, far), make_zone(STRAIGHT, near))


def feeds_of(zone: FeedZone, config: FeedConfig | None = None) -> Feeds:
    return make_feeds(zone, config or feed_config(), DATE)


def features(feed: Any) -> list[Any]:
    found: list[Any] = json.loads(feed_text(feed))["features"]
    return found


def stations_m(event: Any) -> np.ndarray:
    lon_deg, lat_deg = np.array(event["geometry"]["coordinates"]).T
    return STRAIGHT.locate(to_local(IOWA, lat_deg, lon_deg)[0])[:, 0]


def test_every_zone_is_an_event_from_its_first_device_to_its_last() -> None:
    feeds = feeds_of(zone_of(result_of(two_zones())))
    first, second = features(feeds.work_zone)
    assert stations_m(first)[[0, -1]] == pytest.approx([100.0, 160.0], abs=0.05)
    assert stations_m(second)[[0, -1]] == pytest.approx([320.0, 380.0], abs=0.05)
    told: dict[str, list[str]] = {}
    for device in features(feeds.device):
        (event_id,) = device["properties"]["core_details"]["road_event_ids"]
        told.setdefault(event_id, []).append(device["properties"]["core_details"]["name"])
        assert {m["road_event_id"] for m in device["properties"]["marked_locations"]} == {event_id}
    assert told == {first["id"]: list(ids_of(4)), second["id"]: list(ids_of(4, "far"))}
    for feed, kind in ((feeds.work_zone, "WorkZoneFeed"), (feeds.device, "DeviceFeed")):
        problems = official_schemas().problems(json.loads(feed_text(feed)), kind, "wzdx-4.2")
        assert list(map(str, problems)) == []


def test_each_zone_has_a_start_and_an_end_device() -> None:
    feeds = feeds_of(zone_of(result_of(two_zones())))
    marked = [[m["type"] for m in device["properties"]["marked_locations"]][1:]
              for device in features(feeds.device)]  # fmt: skip
    assert marked == [["work-zone-start"], [], [], ["work-zone-end"]] * 2


def test_a_log_of_the_other_carriageway_turns_the_zones_and_their_ends_around() -> None:
    feeds = feeds_of(zone_of(result_of(two_zones())), feed_config(against_traffic=True))
    first, second = features(feeds.work_zone)
    assert stations_m(first)[[0, -1]] == pytest.approx([380.0, 320.0], abs=0.05)
    assert stations_m(second)[[0, -1]] == pytest.approx([160.0, 100.0], abs=0.05)


def test_ids_of_further_events_are_derived_and_can_be_given() -> None:
    alone = features(feeds_of(zone_of(result_of(make_road(make_zone(STRAIGHT))))).work_zone)
    both = features(feeds_of(zone_of(result_of(two_zones()))).work_zone)
    assert both[0]["id"] == alone[0]["id"] != both[1]["id"]
    feeds = feeds_of(zone_of(result_of(two_zones())), feed_config(event_id="E"))
    assert [event["id"] for event in features(feeds.work_zone)] == ["E", "E-2"]


def test_ends_are_verified_by_how_well_they_are_known_along_the_road() -> None:
    boundary = make_road(make_zone(STRAIGHT))  # 0.2 m; the cones' 95 % radius is 0.35 m
    for below_m, verified in ((0.3, True), (0.1, False)):
        config = feed_config(verified_below_m=below_m, deprecated_members=True)
        (event,) = features(feeds_of(zone_of(result_of(boundary)), config).work_zone)
        assert event["properties"]["is_start_position_verified"] is verified
        assert event["properties"]["is_end_position_verified"] is verified
        word = "verified" if verified else "estimated"
        assert event["properties"]["beginning_accuracy"] == word
        assert event["properties"]["ending_accuracy"] == word


def test_lanes_are_those_that_the_user_names() -> None:
    zone = zone_of(result_of(make_road(make_zone(STRAIGHT))))
    (event,) = features(feeds_of(zone).work_zone)
    assert "lanes" not in event["properties"]
    for more in ({}, CWZ):
        feeds = feeds_of(zone, feed_config(lanes=LANES, **more))
        (event,) = features(feeds.work_zone)
        assert event["properties"]["lanes"] == [{"type": "general", **lane} for lane in LANES]
    problems = official_schemas().problems(
        json.loads(feed_text(feeds_of(zone, feed_config(lanes=LANES)).work_zone)),
        "WorkZoneFeed", "wzdx-4.2",
    )  # fmt: skip
    assert list(map(str, problems)) == []


@pytest.mark.parametrize("lanes", [LANES[1:], [*LANES, LANES[0]]])
def test_lanes_are_named_all_or_none(lanes: object) -> None:
    with pytest.raises(ConfigError, match="lanes: expected every lane once"):
        feed_config(lanes=lanes)


@pytest.mark.parametrize("line", [STRAIGHT, bend()])
def test_the_extension_has_edges_and_closed_area(line: Any) -> None:
    zone = make_zone(line, make_edge(line, ids_of(8)), closed=closed_strip(line))
    result = result_of(make_road(zone, line=line))
    (event,) = features(feeds_of(zone_of(result), feed_config(extension=True)).work_zone)
    told = event["properties"]["gaia"]
    assert (told["edges"]["type"], len(told["edges"]["coordinates"])) == ("MultiLineString", 2)
    assert told["closed_area"]["type"] == "MultiPolygon"
    ((ring,),) = told["closed_area"]["coordinates"]
    assert ring[0] == ring[-1]
    assert told["hull"]["type"] == "Polygon"
    open_row = result_of(make_road(make_zone(line), line=line))
    (event,) = features(feeds_of(zone_of(open_row), feed_config(extension=True)).work_zone)
    assert event["properties"]["gaia"]["closed_area"] is None


@pytest.mark.parametrize("make", [two_zones, lambda: make_road(make_zone(STRAIGHT))])
def test_a_folder_of_results_gives_the_same_feeds(tmp_path: Path, make: Any) -> None:
    result = result_of(make())
    (tmp_path / "report.json").write_text(json.dumps(make_report(result)))
    (tmp_path / "boundary.geojson").write_text(json.dumps(boundary_geojson(result)))
    config = feed_config(extension=True)
    ours, read = (feeds_of(zone, config) for zone in (zone_of(result), read_zone(tmp_path)))
    for one, other in ((ours.work_zone, read.work_zone), (ours.device, read.device)):
        assert len(features(one)) == len(features(other))
        for a, b in zip(features(one), features(other), strict=True):
            assert a["properties"] == b["properties"]
            assert np.array(a["geometry"]["coordinates"]) == pytest.approx(
                np.array(b["geometry"]["coordinates"]), abs=2e-7
            )


def test_reports_without_a_road_are_still_read(tmp_path: Path) -> None:
    result = result_of(two_zones())
    report: Any = make_report(result)
    (tmp_path / "boundary.geojson").write_text(json.dumps(boundary_geojson(result)))
    for old in ({k: v for k, v in report.items() if k != "road_boundary"},
                {**report, "road_boundary": None}):  # fmt: skip
        (tmp_path / "report.json").write_text(json.dumps(old))
        (part,) = read_zone(tmp_path).parts
        assert (len(part.cones), part.road) == (8, None)


@pytest.mark.parametrize(
    "road", [7, {}, {"zones": [{}]}, {"zones": 7}, {"zones": [7]}, [1], "x", {"zones": "xy"}]
)
def test_a_road_that_is_none_is_refused(tmp_path: Path, road: object) -> None:
    report: Any = make_report(result_of(two_zones()))
    (tmp_path / "report.json").write_text(json.dumps({**report, "road_boundary": road}))
    with pytest.raises(InputError, match="not a report of this version"):
        read_zone(tmp_path)


@pytest.mark.parametrize("value", ["x", 1e308, [[1.0]], None, [["a", "b"]], {"a": 1}])
@pytest.mark.parametrize("member", ["lines", "cones", "start"])
def test_members_that_are_none_are_refused(tmp_path: Path, member: str, value: object) -> None:
    report: Any = json.loads(json.dumps(make_report(result_of(two_zones()))))
    zone = report["road_boundary"]["zones"][0]
    if member == "lines":
        zone["edges"][0]["lines"] = value
    else:
        zone[member] = value
    (tmp_path / "report.json").write_text(json.dumps(report))
    with pytest.raises(InputError, match="not a report of this version"):
        read_zone(tmp_path)


def test_a_cone_that_shapes_no_edge_is_a_device_of_the_zone_that_it_stands_in() -> None:
    edge = make_edge(STRAIGHT, ids_of(8))
    result = result_of(make_road(make_zone(STRAIGHT, edge)))
    kept = make_edge(STRAIGHT, [f"cone-{k}" for k in (0, 1, 2, 4, 5, 6, 7)],
                     station_m=np.delete(AT_M, 3), beside_m=np.delete(BESIDE_M, 3))  # fmt: skip
    fixes = list(result.anchors)
    fixes[3] = make_fix("cone-3", fixes[3].position_m, status=AnchorStatus.DOES_NOT_FIT)
    result = with_road(replace(result, anchors=tuple(fixes)), make_road(make_zone(STRAIGHT, kept)))
    (part,) = zone_of(result).parts
    assert [cone.anchor_id for cone in part.cones] == list(ids_of(8))
    by_name = {d["properties"]["core_details"]["name"]: d["properties"]["core_details"]
               for d in features(feeds_of(zone_of(result)).device)}  # fmt: skip
    assert by_name["cone-3"]["device_status"] == "warning"


def test_a_cone_alone_is_left_out_and_named() -> None:
    row = make_edge(STRAIGHT, ids_of(4), station_m=AT_M[:4], beside_m=np.full(4, 3.0),
                    taper_rows=None)  # fmt: skip
    lone = make_edge(STRAIGHT, ("lone",), station_m=np.array([380.0]), beside_m=np.full(1, 3.0),
                     taper_rows=None)  # fmt: skip
    zone = zone_of(result_of(make_road(make_zone(STRAIGHT, row), make_zone(STRAIGHT, lone))))
    (part,) = zone.parts
    assert [cone.anchor_id for cone in part.cones] == list(ids_of(4))
    assert zone.reasons == ("in no work zone with two cones, and left out: lone",)
    assert zone.reliable


def test_a_zone_seen_from_the_other_direction_is_turned_as_a_whole() -> None:
    line_m = np.array([[0.0, 0.0], [10.0, 1.0]])
    zone = RoadZone(("a", "b"), (0.1, 0.7), (line_m, line_m + 20.0), ())
    turned = zone.turned()
    assert (turned.cones, turned.within_m) == (("b", "a"), (0.7, 0.1))
    assert [line.tolist() for line in turned.edges_m] == [
        [[30.0, 21.0], [20.0, 20.0]],
        [[10.0, 1.0], [0.0, 0.0]],
    ]
