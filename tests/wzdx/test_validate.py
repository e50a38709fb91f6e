"""The official examples are valid; whatever is damaged in a feed is found and named."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from factories import make_fix
from gaia_uwb._shared.errors import ConfigError
from gaia_uwb.scene import LocalFrame
from gaia_uwb.wzdx import (
    OfficialSchemas,
    make_feeds,
    validate_document,
    validate_files,
    zone_of,
)
from gaia_uwb.wzdx.validate import MOST_PROBLEMS
from wzdx_cases import CWZ, OFFICIAL, feed_config, official_schemas, zone_pass

EXAMPLES = sorted((OFFICIAL / "wzdx-examples").glob("*.geojson"))
OHIO = LocalFrame(lat_deg=40.0, lon_deg=-82.0)  # both numbers could be latitudes
ROAD_M = np.array([[-50.0, 0.0], [50.0, 0.0]])
CONES = (make_fix("a", np.array([-20.0, 4.0])), make_fix("b", np.array([20.0, 4.0])))


def written(kind: str, **changes: object) -> Any:
    config = feed_config(**{"direction": "eastbound"} | changes)
    zone = zone_of(zone_pass(ROAD_M, CONES, frame=OHIO))
    feeds = make_feeds(zone, config, datetime(2026, 11, 22, tzinfo=UTC))
    return json.loads(json.dumps(feeds.work_zone if kind == "event" else feeds.device))


def errors(document: Any, schemas: OfficialSchemas | None = None) -> list[str]:
    return [str(p) for p in validate_document(document, schemas) if p.is_error]


def warnings(document: Any) -> list[str]:
    return [str(p) for p in validate_document(document) if not p.is_error]


def put(document: Any, path: str, value: object) -> Any:
    """Return a copy with one value replaced, or removed where the value is ``...``."""
    changed = copy.deepcopy(document)
    *steps, last = (int(s) if s.isdecimal() else s for s in path.split("/"))
    node = changed
    for step in steps:
        node = node[step]
    if value is ...:
        del node[last]
    else:
        node[last] = value
    return changed


def test_all_official_examples_are_here_or_none() -> None:
    if not OFFICIAL.is_dir():
        pytest.skip("left out: the official example feeds are not here (shared/schemas beside us)")
    assert len([path for path in EXAMPLES if path.name.startswith("examples_")]) == 11


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_official_examples_are_valid(path: Path) -> None:
    found = validate_files([path], official_schemas())[path]
    assert [str(problem) for problem in found if problem.is_error] == []


@pytest.mark.parametrize("profile", [{}, CWZ], ids=["wzdx", "cwz"])
@pytest.mark.parametrize("kind", ["event", "device"])
def test_what_we_write_is_valid(kind: str, profile: dict[str, object]) -> None:
    assert validate_document(written(kind, **profile)) == []


HEAD = ("feed_info", "type", "features", "feed_info/publisher", "feed_info/version",
        "feed_info/update_date", "feed_info/data_sources",
        "feed_info/data_sources/0/data_source_id",
        "feed_info/data_sources/0/organization_name", "features/0/id", "features/0/type",
        "features/0/properties", "features/0/geometry", "features/0/geometry/type",
        "features/0/geometry/coordinates", "features/0/properties/core_details",
        "features/0/properties/core_details/data_source_id")  # fmt: skip
EVENT = ("core_details/event_type", "core_details/road_names", "core_details/direction",
         "start_date", "end_date", "is_start_date_verified", "is_end_date_verified",
         "is_start_position_verified", "is_end_position_verified", "location_method",
         "vehicle_impact")  # fmt: skip
DEVICE = ("core_details/device_type", "core_details/device_status", "core_details/update_date",
          "core_details/has_automatic_location", "marked_locations",
          "marked_locations/0/type")  # fmt: skip
REQUIRED = [
    *(("event", path) for path in HEAD),
    *(("device", path) for path in HEAD),
    *(("event", f"features/0/properties/{path}") for path in EVENT),
    *(("device", f"features/0/properties/{path}") for path in DEVICE),
]


@pytest.mark.parametrize(("kind", "path"), REQUIRED)
def test_every_required_member_is_missed(kind: str, path: str) -> None:
    damaged = put(written(kind), path, ...)
    last = path.rsplit("/", maxsplit=1)[-1]
    assert any(last in line for line in errors(damaged)) or path.endswith("_type")
    assert errors(damaged)
    if OFFICIAL.is_dir():  # and the official schemas say so as well
        assert any("official schema" in line for line in errors(damaged, official_schemas()))


@pytest.mark.parametrize(("kind", "path"), REQUIRED)
def test_null_is_no_value(kind: str, path: str) -> None:
    assert errors(put(written(kind), path, None))


E0 = "features/0/properties/"
DAMAGES: list[tuple[str, str, object, str]] = [
    ("event", "features/0/geometry/coordinates/0", [42.0, -103.5], "longitude comes first"),
    ("device", "features/0/geometry/coordinates", [-193.5, 42.0], "longitude between"),
    ("device", "features/0/geometry/coordinates", [-93.5, 42.0, 1, 2], "expected [longitude"),
    ("device", "features/0/geometry/coordinates", [True, 42.0], "expected [longitude"),
    ("device", "features/0/geometry/coordinates", "here", "expected [longitude"),
    ("device", "features/0/geometry/coordinates", [[1.0, 2.0]], "expected [longitude"),
    ("device", "features/1/id", "SAME", "is already used by features[0]"),
    ("event", "bbox", [1, 2], "expected [west"),
    ("event", "bbox", [-93.6, 43.0, -93.4, 41.0], "south before north"),
    ("event", "features/0/geometry/type", "Polygon", "expected LineString or MultiPoint"),
    ("event", "features/0/geometry/coordinates", [], "expected a list of positions"),
    ("event", "features/0/geometry/coordinates", [[-82.0, 40.0]] * 2, "two different positions"),
    ("event", E0 + "end_date", "2026-11-22T08:00:00Z", "after start_date"),
    ("event", E0 + "end_date", "2026-11-22T09:00:00Z", "after start_date"),
    ("event", E0 + "end_date", "2026-02-30T08:00:00Z", "expected a date like"),
    ("event", E0 + "end_date", "yesterday", "expected a date like"),
    ("event", E0 + "end_date", "2026-11-22 17:00:00Z", "expected a date like"),
    ("event", E0 + "end_date", 7, "valid string, got 7"),
    ("event", E0 + "vehicle_impact", "none", "got 'none'"),
    ("event", E0 + "core_details/direction", "north", "got 'north'"),
    ("event", E0 + "core_details/road_names", [], "at least 1 item"),
    ("event", E0 + "core_details/road_names", [3], "road_names[0]"),
    ("event", E0 + "core_details/event_type", "incident", "got 'incident'"),
    ("event", E0 + "core_details/event_type", "restriction", "belongs in a restriction feed"),
    ("event", E0 + "core_details/data_source_id", "x", "not in feed_info.data_sources"),
    ("event", E0 + "is_start_date_verified", "yes", "valid boolean, got 'yes'"),
    ("event", "feed_info/version", "4.2.1", "expected 4.2 (WZDx) or 1.0 (CWZ), got '4.2.1'"),
    ("event", "feed_info/license", "MIT", "feed_info.license"),
    ("event", "feed_info/update_frequency", 0, "feed_info.update_frequency"),
    ("event", "features/0", 3, "expected an object, got 3"),
    ("event", "features/0/properties", [], "got []"),
    ("device", E0 + "core_details/device_type", "cone", "got 'cone'"),
    ("device", E0 + "core_details/device_type", "roadside-unit", "WZDx 4.2 has no roadside-unit"),
    ("device", E0 + "marked_locations", [], "at least 1 item"),
    ("device", E0 + "marked_locations/0/type", "cone", "got 'cone'"),
]  # fmt: skip


@pytest.mark.parametrize(("kind", "path", "value", "said"), DAMAGES)
def test_damages_are_found(kind: str, path: str, value: object, said: str) -> None:
    feed = written(kind)
    if value == "SAME":
        value = feed["features"][0]["id"]
    found = errors(put(feed, path, value))
    assert any(said in line for line in found), found
    place = "".join(f"[{s}]" if s.isdecimal() else f".{s}" for s in path.split("/"))
    assert any(line.startswith(f"${place}") for line in found)


def test_every_position_swapped_is_found() -> None:
    feed = written("event")
    for position in feed["features"][0]["geometry"]["coordinates"]:
        position.reverse()
    (once,) = errors(feed)
    assert once.startswith("$.bbox: 2 of 2 positions are outside, first $.features[0].geometry")
    assert once.endswith(": the box or the positions have latitude first")
    del feed["bbox"]  # then nothing in the document contradicts, but no road is there
    assert errors(feed) == []
    (found,) = warnings(feed)
    assert found.endswith("is south of every road: longitude comes first; 1 more like it")


@pytest.mark.parametrize(
    ("path", "value", "said"),
    [
        (E0 + "core_details/direction", "westbound", "from upstream to downstream"),
        (E0 + "core_details/creation_date", "2026-12-24T00:00:00Z", "is after update_date"),
        (E0 + "core_details/related_road_events",
         [{"type": "first-in-sequence", "id": "?"}], "'?' is not an event in this feed"),
        (E0 + "lanes", [{"order": 2, "status": "open", "type": "general"}], "the orders 1 to 1"),
    ],
)  # fmt: skip
def test_what_only_looks_wrong_is_a_warning(path: str, value: object, said: str) -> None:
    feed = put(written("event"), path, value)
    assert errors(feed) == []
    assert any(said in line for line in warnings(feed))


@pytest.mark.parametrize(("impact", "lane", "warned"), [
    ("all-lanes-open", ("closed", "general"), True),
    ("all-lanes-open-shift-left", ("closed", "general"), True),
    ("all-lanes-closed", ("open", "general"), True),
    ("all-lanes-open", ("closed", "shoulder"), False),
    ("all-lanes-closed", ("open", "sidewalk"), False),
    ("some-lanes-closed", ("closed", "general"), False),
    ("unknown", ("open", "general"), False),
])  # fmt: skip
def test_lanes_that_contradict_the_impact(impact: str, lane: tuple[str, str], warned: bool) -> None:
    status, kind = lane
    feed = put(written("event"), E0 + "lanes", [{"order": 1, "status": status, "type": kind}])
    feed = put(feed, E0 + "vehicle_impact", impact)
    assert errors(feed) == []
    assert any("but vehicle_impact is" in line for line in warnings(feed)) == warned


@pytest.mark.parametrize(("off_deg", "warned"), [(0, False), (100, False), (150, True)])
@pytest.mark.parametrize("sense", [-1, 1])
@pytest.mark.parametrize("direction", ["northbound", "eastbound", "southbound", "westbound"])
def test_a_line_that_runs_back_is_noticed_before_it_is_quite_opposite(
    direction: str, sense: int, off_deg: int, warned: bool
) -> None:
    # A road that is signed as one that leads east may lead south here, and a little back.
    signed_deg = 90.0 * ["northbound", "eastbound", "southbound", "westbound"].index(direction)
    runs_rad = np.radians(signed_deg + sense * off_deg)
    lon, lat = OHIO.lon_deg, OHIO.lat_deg
    east_deg = 1e-3 * np.sin(runs_rad) / np.cos(np.radians(lat))
    line = [[lon, lat], [lon + east_deg, lat + 1e-3 * np.cos(runs_rad)]]
    feed = put(written("event"), "bbox", ...)
    feed = put(feed, "features/0/geometry/coordinates", line)
    feed = put(feed, E0 + "core_details/direction", direction)
    assert any("from upstream to downstream" in line for line in warnings(feed)) == warned


@pytest.mark.parametrize(
    ("lon", "inside"), [(179.5, True), (-179.5, True), (179.0, True), (178.0, False), (0.0, False),
                        (-178.0, False), (-82.0, False)],
)  # fmt: skip
def test_a_box_across_the_180th_meridian_holds_only_what_lies_in_it(
    lon: float, inside: bool
) -> None:
    feed = put(written("event"), "bbox", [179.0, 39.0, -179.0, 41.0])
    feed = put(feed, "features/0/geometry/coordinates", [[lon, 40.0], [lon, 40.001]])
    outside = [line for line in errors(feed) if "2 of 2 positions are outside" in line]
    assert (outside == []) == inside


def test_a_line_is_short_whatever_a_feed_holds() -> None:
    feed = written("event")
    for path in ("bbox", "feed_info/version", "features/0/geometry/coordinates", "features/0/id"):
        for value in ([feed] * 50, {"a": [feed] * 50}, "x" * 10**6):
            assert all(len(line) < 500 for line in errors(put(feed, path, value)))


def test_a_ring_is_a_warning() -> None:
    feed = written("event")
    line = feed["features"][0]["geometry"]["coordinates"]
    feed["features"][0]["geometry"]["coordinates"] = [*line, line[0]]
    assert errors(feed) == []
    assert any("closed ring" in line for line in warnings(feed))


@pytest.mark.parametrize(
    ("kind", "path", "value", "said"),
    [
        ("event", "feed_info/license", ..., "$.feed_info.license: required"),
        ("event", "feed_info/update_frequency", ..., "$.feed_info.update_frequency: required"),
        ("event", "feed_info/data_sources/0/update_date", ..., "update_date: required"),
        ("event", E0 + "event_status", "active", "CWZ 1.0 has no such member"),
        ("event", "features/0/geometry/type", "MultiPoint", "expected LineString or Point"),
        ("device", E0 + "marked_locations/0/type", "road-event-start", "CWZ 1.0 has no road-event"),
    ],
)
def test_cwz_requires_more(kind: str, path: str, value: object, said: str) -> None:
    assert any(said in line for line in errors(put(written(kind, **CWZ), path, value)))


def test_whole_numbers_of_degrees_are_numbers() -> None:
    feed = written("event")
    west, south, east, north = feed["bbox"]
    feed["bbox"] = [int(west) - 1, int(south) - 1, int(east) + 1, int(north) + 1]
    assert errors(feed) == []
    feed["features"][0]["geometry"]["coordinates"][0] = [10, 50]
    (found,) = errors(feed)
    assert found == ("$.bbox: 1 of 2 positions are outside, first "
                     "$.features[0].geometry.coordinates[0] with [10, 50]")  # fmt: skip


def test_a_wrong_box_is_named_and_not_every_position_for_it() -> None:
    south, west = OHIO.lat_deg, OHIO.lon_deg
    feed = put(written("event"), "bbox", [west - 9, south - 1, west - 8, south + 1])
    assert errors(put(feed, "bbox", [south, -93.5, south + 1, -93.4])) == [
        f"$.bbox: expected [west, south, east, north] in degrees, south before north, "
        f"got [{south}, -93.5, {south + 1}, -93.4]"
    ]
    (once,) = errors(feed)
    assert once.startswith("$.bbox: 2 of 2 positions are outside")


@pytest.mark.parametrize(
    ("positions", "said"),
    [
        ([[-82.0, 40.0]], "one position: a MultiPoint is a start and an end"),
        ([[-82.0, 40.0], [-81.99, 40.0]], ""),
        ([[-82.0, 40.0], [-82.0, 40.0, 200.0]], "start and end are the same position"),
        ([[-82.0 + k / 100, 40.0] for k in range(7)], "7 positions: a MultiPoint is a start"),
    ],
)
def test_a_multipoint_is_a_start_and_an_end(positions: list[list[float]], said: str) -> None:
    feed = put(written("event"), "bbox", ...)
    feed = put(feed, "features/0/geometry", {"type": "MultiPoint", "coordinates": positions})
    assert errors(feed) == []
    found = [line for line in warnings(feed) if ".geometry.coordinates: warning:" in line]
    assert len(found) == bool(said) and all(said in line for line in found)


WRAPPINGS: list[tuple[Callable[[Any], Any], str]] = [
    (lambda feed: {"data": feed}, "$: the feed is in $.data: give that object alone"),
    (lambda feed: {"status": 200, "a b": {"feed": feed}}, "$: the feed is in $['a b'].feed: give"),
    (lambda feed: [feed], "$: the feed is in $[0]: give that object alone"),
    (lambda feed: feed["features"], "a list of objects: features belong in a FeatureCollection"),
    (json.dumps, "a text that holds JSON: written twice over"),
    (lambda _: [], "expected a feed, which is a JSON object, got list"),
    (lambda _: None, "expected a feed, which is a JSON object, got NoneType"),
]


@pytest.mark.parametrize(("wrap", "said"), WRAPPINGS)
@pytest.mark.parametrize("kind", ["event", "device"])
def test_a_feed_in_a_wrapping_is_one_line(kind: str, wrap: Callable[[Any], Any], said: str) -> None:
    schemas = official_schemas() if OFFICIAL.is_dir() else None
    (found,) = errors(wrap(written(kind)), schemas)
    assert said in found


def test_a_wrapping_is_looked_into_only_so_far() -> None:
    feed: Any = written("event")
    deep = {"a": {"b": {"c": {"d": feed}}}}
    assert "the feed is in" not in errors(deep)[0]
    wide = {f"member {k}": {} for k in range(1000)} | {"data": feed}
    assert "the feed is in" not in errors(wide)[0]


def project(feed: Any, system: object) -> Any:
    """Return a feed with coordinates in metres, as a GIS exports it."""
    changed = put(feed, "bbox", ...)
    for feature in changed["features"]:
        point = feature["geometry"]["type"] == "Point"
        metres = [-9128204.2, 4865942.3]
        feature["geometry"]["coordinates"] = metres if point else [metres, [-9128104.2, 4865942.3]]
    return changed if system is ... else changed | {"crs": system}


@pytest.mark.parametrize("kind", ["event", "device"])
def test_another_coordinate_system_is_said_once(kind: str) -> None:
    name = {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::3857"}}
    (found,) = errors(project(written(kind), name))
    assert found == ("$.crs: expected WGS84 longitude and latitude, "
                     "got coordinates in 'urn:ogc:def:crs:EPSG::3857'")  # fmt: skip
    (found,) = errors(project(written(kind), ...))
    assert "coordinates" in found and "metres of a map projection, such as EPSG:3857?" in found


@pytest.mark.parametrize("system", [
    None,
    {"type": "name", "properties": {"name": "urn:ogc:def:crs:OGC:1.3:CRS84"}},
    {"type": "name", "properties": {"name": "EPSG:4326"}},
])  # fmt: skip
def test_the_system_that_is_meant_anyway_may_be_named(system: object) -> None:
    feed = written("event") | {"crs": system}
    assert errors(feed) == []
    assert any(line.startswith("$.crs: warning:") for line in warnings(feed))


def test_a_device_among_events_and_an_event_among_devices() -> None:
    event, device = written("event")["features"][0], written("device")["features"][0]
    event["id"] = "another"
    events, devices = written("event"), written("device")
    events["features"] = [device, *events["features"], event]
    events["feed_info"]["data_sources"] += devices["feed_info"]["data_sources"]
    assert [line for line in errors(events) if "used twice" not in line] == [
        "$.features[0].properties.core_details.device_type: a field device among road events: "
        "it belongs in a DeviceFeed"
    ]
    devices["features"].insert(0, event)
    assert errors(devices) == [
        "$.features[0].properties.core_details.event_type: a road event among field devices: "
        "it belongs in a WorkZoneFeed"
    ]


@pytest.mark.parametrize(("version", "goes_on"), [
    ("4.1", True), ("4.0", True), ("4.2.1", True), ("v4.2", True), ("3.1", False), ("2", False),
    ("5.0", False), ("", False),
])  # fmt: skip
def test_other_versions_are_one_line(version: str, goes_on: bool) -> None:
    feed = put(written("event"), "feed_info/version", version)
    then = "checked as 4.2" if goes_on else "the rest is not checked"
    assert errors(feed) == [
        f"$.feed_info.version: expected 4.2 (WZDx) or 1.0 (CWZ), got {version!r}: {then}"
    ]
    flood = put(feed, E0 + "core_details", ...)
    assert (len(errors(flood)) > 1) == goes_on


def test_dates_with_an_offset_are_one_warning() -> None:
    feed = put(written("event"), E0 + "start_date", "2026-11-22T03:00:00-06:00")
    feed = put(feed, E0 + "end_date", "2026-11-22T11:00:00-06:00")
    assert errors(feed) == []
    assert [line for line in warnings(feed) if "offset" in line] == [
        "$.features[0].properties.start_date: warning: '2026-11-22T03:00:00-06:00' has an offset, "
        "but dates are in UTC and end in Z; 1 more like it"
    ]
    early = put(feed, E0 + "end_date", "2026-11-22T08:59:59Z")  # the start is 09:00 in UTC
    assert any("after start_date" in line for line in errors(early))


@pytest.mark.parametrize("date", [
    "9999-12-31T23:59:59Z", "9999-12-31T23:59:59-05:00", "2026-12-31T23:59:60Z",
    "2026-11-22T17:00:00.1234567Z", "2026-11-22t17:00:00z",
])  # fmt: skip
def test_dates_that_are_legal_are_valid(date: str) -> None:
    schemas = official_schemas() if OFFICIAL.is_dir() else None
    assert errors(put(written("event"), E0 + "end_date", date), schemas) == []


@pytest.mark.parametrize("date", ["2026-11-22T17:60:00Z", "2026-11-22T24:00:00+99:00", "2026-W01-1",
                                  "2026-11-22T17:00:00", "11/22/2026 17:00"])  # fmt: skip
def test_dates_that_are_none_are_invalid(date: str) -> None:
    (found,) = errors(put(written("event"), E0 + "end_date", date))
    assert found.endswith(f"end_date: expected a date like 2026-11-22T10:00:00Z, got {date!r}")


def test_members_that_only_the_schemas_know_are_named() -> None:
    feed = put(written("event"), E0 + "worker_presence", {"are_workers_present": "yes"})
    feed = put(feed, E0 + "types_of_work", [])
    found = (
        "$.features: warning: not checked without --schemas: ['types_of_work', 'worker_presence']"
    )
    assert found in warnings(feed)
    assert not any("--schemas" in line for line in warnings(written("event", extension=True)))
    if OFFICIAL.is_dir():
        lines = [str(problem) for problem in validate_document(feed, official_schemas())]
        assert any("are_workers_present: official schema" in line for line in lines)
        assert not any("--schemas" in line for line in lines)


@pytest.mark.parametrize("path", ["core_details/direction", "core_details/description",
                                  "vehicle_impact"])  # fmt: skip
def test_no_line_comes_twice(path: str) -> None:
    for value in (None, ...):
        found = [str(p) for p in validate_document(put(written("event"), E0 + path, value),
                                                   official_schemas())]  # fmt: skip
        assert len(found) == len(set(found))


def test_references_between_files(tmp_path: Path) -> None:
    event, device = tmp_path / "event.json", tmp_path / "device.json"
    event.write_text(json.dumps(written("event")))
    device.write_text(json.dumps(written("device")))
    assert validate_files([event, device]) == {event: [], device: []}
    device.write_text(json.dumps(written("device", event_id="another")))
    assert validate_files([device]) == {device: []}  # alone, nothing is known of its events
    found = list(map(str, validate_files([event, device])[device]))
    assert len(found) == 2 + 4  # two cones with two marks each
    assert found[0].endswith("road_event_ids[0]: 'another' is not an event in the given feeds")


def test_schemas_name_the_branch_that_is_meant() -> None:
    damaged = put(written("event"), E0 + "vehicle_impact", ...)
    found = [line for line in errors(damaged, official_schemas()) if "official" in line]
    assert found == ["$.features[0].properties: official schema: 'vehicle_impact' is a required "
                     "property"]  # fmt: skip
    damaged = put(written("event"), E0 + "start_date", "yesterday")
    assert any("official schema: 'yesterday' is not a 'date-time'" in line
               for line in errors(damaged, official_schemas()))  # fmt: skip


def test_folders_that_hold_no_schemas(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="expected a folder"):
        OfficialSchemas(tmp_path / "nowhere")
    with pytest.raises(ConfigError, match="contains no JSON schema"):
        OfficialSchemas(tmp_path)
    address = "https://example.org/wzdx/main/schemas/4.2/DeviceFeed.json"
    schema = {"$id": address, "$ref": "https://example.org/absent.json"}
    (tmp_path / "a.json").write_text(json.dumps(schema))
    with pytest.raises(ConfigError, match="contains no schema of a WorkZoneFeed of wzdx"):
        validate_document(written("event"), OfficialSchemas(tmp_path))
    with pytest.raises(ConfigError, match="lacks a schema that DeviceFeed refers to"):
        validate_document(written("device"), OfficialSchemas(tmp_path))


JSON_VALUES: st.SearchStrategy[Any] = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner),
    max_leaves=8,
)


def paths_of(node: Any, path: tuple[str, ...] = ()) -> list[str]:
    items = node.items() if isinstance(node, dict) else enumerate(node)
    found = []
    for key, value in items:
        found.append("/".join((*path, str(key))))
        if isinstance(value, (dict, list)):
            found += paths_of(value, (*path, str(key)))
    return found


WRITTEN: dict[str, Any] = {}


@settings(max_examples=settings().max_examples * 2)
@given(st.data(), st.sampled_from(["event", "device"]), JSON_VALUES)
def test_any_damage_gives_lines_and_no_traceback(data: Any, kind: str, value: Any) -> None:
    feed = WRITTEN.setdefault(kind, written(kind, extension=True))
    path = data.draw(st.sampled_from(paths_of(feed)))
    for line in validate_document(put(feed, path, value)):
        assert "\n" not in str(line).replace(repr(value), "")


@given(JSON_VALUES)
def test_any_document_gives_lines_and_no_traceback(value: Any) -> None:
    assert all(len(str(problem)) < 1000 for problem in validate_document(value))
    assert errors(value)


@pytest.mark.parametrize("make", [
    lambda feed: put(feed, "features", [3] * 1_000_000),
    lambda feed: put(feed, "features", feed["features"] * 2000),
    lambda feed: put(feed, E0 + "core_details/road_names", [3] * 1_000_000),
])  # fmt: skip
def test_many_problems_are_listed_in_part(make: Callable[[Any], Any]) -> None:
    assert 1 <= len(errors(make(written("device")))) <= MOST_PROBLEMS
