"""Every feed that is written is valid, says what was found, and is the same each time."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from factories import make_fix, make_reason, make_reconstruction, make_unlocated
from gaia_uwb._shared.errors import ConfigError, InputError
from gaia_uwb._shared.files import visible
from gaia_uwb.config import make_config
from gaia_uwb.estimate import AnchorStatus, ReasonKind
from gaia_uwb.projection import to_local
from gaia_uwb.reconstruction import Reconstruction
from gaia_uwb.scene import LocalFrame
from gaia_uwb.wzdx import FeedConfig, Feeds, make_feeds, validate_document, write_feeds, zone_of
from gaia_uwb.wzdx.feeds import DEVICE_FILE, WORK_ZONE_FILE, feed_text
from wzdx_cases import CWZ, feed_config, official_schemas, passes, zone_pass

DATE = datetime(2026, 11, 22, 10, tzinfo=UTC)
ROAD_M = np.array([[-50.0, 0.0], [0.0, 0.0], [50.0, 0.0]])
EAST, WEST = np.array([20.0, 4.0]), np.array([-20.0, 4.0])
CONES = (make_fix("east", EAST), make_fix("west", WEST), make_fix("mid", np.array([0.0, 7.0])))


def feeds_of(result: Reconstruction, config: FeedConfig | None = None) -> Feeds:
    return make_feeds(zone_of(result), config or feed_config(), DATE)


def read_back(feed: Any) -> Any:
    return json.loads(feed_text(feed))


def event(feeds: Feeds) -> Any:
    (feature,) = read_back(feeds.work_zone)["features"]
    return feature


def devices(feeds: Feeds) -> Any:
    return {f["properties"]["core_details"]["name"]: f for f in read_back(feeds.device)["features"]}


def found_officially(feed: Any, kind: str) -> list[str]:
    """Return what the official schemas say; our own rules were asked when the feed was made."""
    return list(map(str, official_schemas().problems(read_back(feed), kind, "wzdx-4.2")))


@settings(max_examples=settings().max_examples // 2)  # 500 with HYPOTHESIS_PROFILE=search
@given(passes(), st.booleans(), st.booleans(), st.booleans())
def test_every_feed_is_valid(
    make: Callable[[], Reconstruction], old: bool, more: bool, back: bool
) -> None:
    config = feed_config(deprecated_members=old, extension=more, against_traffic=back)
    zone = zone_of(make())
    try:
        feeds = make_feeds(zone, config, DATE)
    except InputError as error:
        assert "180th meridian" in str(error)
        return
    assert found_officially(feeds.work_zone, "WorkZoneFeed") == []
    assert found_officially(feeds.device, "DeviceFeed") == []
    line = np.array(event(feeds)["geometry"]["coordinates"])
    places = np.array([f["geometry"]["coordinates"] for f in read_back(feeds.device)["features"]])
    assert (np.diff(zone.parts[0].along_m) >= 0).all()
    for found, expected_m in (
        (line, zone.parts[0].line_m),
        (places, [c.position_m for c in zone.cones]),
    ):
        local_m, _ = to_local(zone.frame, found[:, 1], found[:, 0])
        ordered_m = np.asarray(expected_m)[:: -1 if back else 1]
        assert np.abs(local_m[[0, -1]] - ordered_m[[0, -1]]).max() < 0.02


@settings(max_examples=settings().max_examples // 4)
@given(passes())
def test_every_feed_is_a_valid_cwz_feed_by_our_rules(make: Callable[[], Reconstruction]) -> None:
    try:
        feeds = feeds_of(make(), feed_config(**CWZ, project_id="P 7"))
    except InputError as error:
        assert "180th meridian" in str(error)
        return
    for feed in (feeds.work_zone, feeds.device):
        assert read_back(feed)["feed_info"]["version"] == "1.0"
        assert not [p for p in validate_document(read_back(feed)) if p.is_error]
    assert event(feeds)["properties"]["core_details"]["project_id"] == "P 7"


@pytest.mark.parametrize("westward", [False, True])
def test_upstream_to_downstream_is_the_way_of_travel(westward: bool) -> None:
    path_m = ROAD_M[::-1] if westward else ROAD_M
    feeds = feeds_of(zone_pass(path_m, CONES))
    lon = np.array(event(feeds)["geometry"]["coordinates"])[:, 0]
    assert (np.diff(lon) < 0).all() if westward else (np.diff(lon) > 0).all()
    order = ["west", "mid", "east"][:: -1 if westward else 1]
    assert list(devices(feeds)) == order
    marked = [[m["type"] for m in d["properties"]["marked_locations"]]
              for d in devices(feeds).values()]  # fmt: skip
    assert marked == [["delineator", "work-zone-start"], ["delineator"],
                      ["delineator", "work-zone-end"]]  # fmt: skip


def test_the_same_zone_gives_the_same_bytes() -> None:
    once, again = (feeds_of(zone_pass(ROAD_M, CONES)) for _ in range(2))
    assert feed_text(once.work_zone) == feed_text(again.work_zone)
    assert feed_text(once.device) == feed_text(again.device)


def test_a_log_of_the_other_carriageway_is_turned_around() -> None:
    there = feeds_of(zone_pass(ROAD_M, CONES))
    turned = feeds_of(zone_pass(ROAD_M, CONES), feed_config(against_traffic=True))
    line = event(there)["geometry"]["coordinates"]
    assert event(turned)["geometry"]["coordinates"] == line[::-1]
    assert list(devices(turned)) == list(devices(there))[::-1]


def test_coordinates_are_longitude_latitude_of_the_cones() -> None:
    place = devices(feeds_of(zone_pass(ROAD_M, CONES)))["east"]["geometry"]["coordinates"]
    local_m, _ = to_local(
        LocalFrame(42.0, -93.5, 270.0), np.array([place[1]]), np.array([place[0]])
    )
    assert np.abs(local_m[0] - EAST).max() < 0.01
    assert place == [round(x, 7) for x in place]


def test_ids_are_stable_and_can_be_given() -> None:
    result = zone_pass(ROAD_M, CONES, name="drive 1")
    again = zone_pass(ROAD_M[::-1], CONES, name="drive 2")
    ids = {name: d["id"] for name, d in devices(feeds_of(result)).items()}
    assert len({*ids.values(), event(feeds_of(result))["id"]}) == 4
    assert devices(feeds_of(again))["mid"]["id"] != ids["mid"]
    named = [feeds_of(r, feed_config(zone="bridge")) for r in (result, again)]
    assert event(named[0])["id"] == event(named[1])["id"]
    assert devices(named[0])["mid"]["id"] == devices(named[1])["mid"]["id"]
    given_ids = feeds_of(result, feed_config(event_id="E1", device_ids={"mid": "D1"}))
    assert event(given_ids)["id"] == "E1"
    assert devices(given_ids)["mid"]["id"] == "D1"
    assert devices(given_ids)["mid"]["properties"]["core_details"]["road_event_ids"] == ["E1"]
    assert devices(given_ids)["east"]["id"] == ids["east"]


def test_ids_do_not_change_with_the_version() -> None:
    assert event(feeds_of(zone_pass(ROAD_M, CONES)))["id"] == "55ba4361-ab06-52b9-be3c-72b4ebea5358"


def test_dates_are_written_in_utc() -> None:
    berlin = timezone(timedelta(hours=1))
    zone = zone_of(zone_pass(ROAD_M, CONES))
    feeds = make_feeds(zone, feed_config(), datetime(2026, 11, 22, 11, tzinfo=berlin))
    assert read_back(feeds.work_zone)["feed_info"]["update_date"] == "2026-11-22T10:00:00Z"
    with pytest.raises(ConfigError, match="update date: expected a date with its time zone"):
        make_feeds(zone, feed_config(), datetime(2026, 11, 22))


def test_positions_are_verified_where_the_end_cones_are_known_well() -> None:
    def verified(result: Reconstruction, **changes: object) -> tuple[bool, bool]:
        properties = event(feeds_of(result, feed_config(**changes)))["properties"]
        return properties["is_start_position_verified"], properties["is_end_position_verified"]

    vague = make_fix("east", EAST, covariance_m2=np.eye(2))
    assert verified(zone_pass(ROAD_M, CONES)) == (True, True)
    assert verified(zone_pass(ROAD_M, (vague, *CONES[1:]))) == (True, False)
    assert verified(zone_pass(ROAD_M, (vague, *CONES[1:])), verified_below_m=3.0) == (True, True)
    ambiguous = make_fix("west", WEST, status=AnchorStatus.AMBIGUOUS, mirror_probability=0.3)
    assert verified(zone_pass(ROAD_M, (CONES[0], ambiguous))) == (False, True)
    assert verified(zone_pass(ROAD_M, CONES, reasons=(make_reason("the clocks: x"),))) == (
        False,
        False,
    )
    assert verified(zone_pass(ROAD_M, CONES), start_position="estimated") == (False, True)
    told = replace(zone_pass(ROAD_M, CONES), config=make_config({"prior": {"side": "left"}}))
    assert verified(told) == (False, False)
    description = event(feeds_of(told, feed_config()))["properties"]["core_details"]["description"]
    assert "Stated, not measured: all cones are on the left." in description


def test_doubts_reach_the_reader() -> None:
    lost = make_unlocated("lost")
    ambiguous = make_fix("west", WEST, status=AnchorStatus.AMBIGUOUS, mirror_probability=0.3)
    reason = make_reason("anchor west: any words", ReasonKind.AMBIGUOUS)
    feeds = feeds_of(zone_pass(ROAD_M, (CONES[0], ambiguous, lost), reasons=(reason,)))
    description = event(feeds)["properties"]["core_details"]["description"]
    assert "Not located: lost" in description
    assert reason.text in description
    details = {name: d["properties"]["core_details"] for name, d in devices(feeds).items()}
    assert {name: d["device_status"] for name, d in details.items()} == {
        "west": "warning", "east": "ok"
    }  # fmt: skip
    assert "probability of the mirror position 0.30" in details["west"]["status_messages"]
    whole = feeds_of(zone_pass(ROAD_M, CONES, reasons=(make_reason("the clocks: unknown"),)))
    for device in devices(whole).values():
        assert device["properties"]["core_details"]["device_status"] == "warning"
        assert "the clocks: unknown" in device["properties"]["core_details"]["status_messages"]


def test_cones_on_one_line_have_a_feed_without_doubts() -> None:
    result = zone_pass(
        ROAD_M, CONES[:2],
        reasons=(make_reason("on one line", ReasonKind.COLLINEAR),),
    )  # fmt: skip
    feeds = feeds_of(result, feed_config(extension=True))
    assert event(feeds)["properties"]["is_start_position_verified"] is True
    assert event(feeds)["properties"]["gaia"]["hull"] is None
    assert {d["properties"]["core_details"]["device_status"] for d in devices(feeds).values()} == {
        "ok"
    }


def test_deprecated_members_and_extension_come_when_asked_for() -> None:
    plain = event(feeds_of(zone_pass(ROAD_M, CONES)))["properties"]
    assert not {"beginning_accuracy", "event_status", "gaia"} & set(plain)
    config = feed_config(deprecated_members=True, extension=True, event_status="active")
    feeds = feeds_of(zone_pass(ROAD_M, CONES), config)
    properties = event(feeds)["properties"]
    assert properties["beginning_accuracy"] == "verified"
    assert properties["start_date_accuracy"] == "estimated"
    assert properties["event_status"] == "active"
    assert len(properties["gaia"]["hull"]["coordinates"][0]) == 4
    covariance_m2 = devices(feeds)["mid"]["properties"]["gaia"]["covariance_m2"]
    assert covariance_m2 == [[0.04, 0.01], [0.01, 0.02]]


def test_what_cannot_be_a_feed_is_refused() -> None:
    with pytest.raises(InputError, match="its position on Earth is unknown"):
        zone_of(make_reconstruction(frame=None))
    with pytest.raises(InputError, match="at least two located cones, got 1"):
        zone_of(zone_pass(ROAD_M, (CONES[0], make_unlocated("lost"))))
    with pytest.raises(InputError, match="does not pass along the cones"):
        zone_of(zone_pass(np.zeros((3, 2)), CONES))
    with pytest.raises(InputError, match="180th meridian"):
        feeds_of(zone_pass(ROAD_M, CONES, frame=LocalFrame(-17.0, 179.9999999)))
    with pytest.raises(ConfigError, match="device_ids: a drive has no cone 'nobody'"):
        feeds_of(zone_pass(ROAD_M, CONES), feed_config(device_ids={"nobody": "D"}))
    with pytest.raises(InputError, match="would be invalid"):  # a device with the id of another
        other = devices(feeds_of(zone_pass(ROAD_M, CONES)))["mid"]["id"]
        feeds_of(zone_pass(ROAD_M, CONES), feed_config(device_ids={"east": other}))


def test_files_are_written_and_replaced_whole(tmp_path: Path) -> None:
    feeds = feeds_of(zone_pass(ROAD_M, CONES))
    paths = write_feeds(feeds, tmp_path / "out")
    assert [path.name for path in paths] == [WORK_ZONE_FILE, DEVICE_FILE]
    first = [path.read_bytes() for path in paths]
    write_feeds(feeds, tmp_path / "out")
    assert [path.read_bytes() for path in paths] == first
    assert sorted(path.name for path in visible(tmp_path / "out")) == sorted(
        [WORK_ZONE_FILE, DEVICE_FILE]
    )
