"""The specifications' closed vocabularies, as far as feeds are made or checked with them."""

from __future__ import annotations

from typing import Literal, TypeAlias

Profile: TypeAlias = Literal["wzdx-4.2", "cwz-1.0"]
VERSIONS: dict[str, Profile] = {"4.2": "wzdx-4.2", "1.0": "cwz-1.0"}
"""From ``feed_info.version`` to the profile; CWZ counts its versions from 1.0 again."""

CC0 = "https://creativecommons.org/publicdomain/zero/1.0/"

Direction: TypeAlias = Literal[
    "northbound",
    "eastbound",
    "southbound",
    "westbound",
    "inner-loop",
    "outer-loop",
    "undefined",
    "unknown",
]
EventStatus: TypeAlias = Literal["planned", "pending", "active", "completed", "cancelled"]
Verification: TypeAlias = Literal["estimated", "verified"]
VehicleImpact: TypeAlias = Literal[
    "all-lanes-closed",
    "some-lanes-closed",
    "all-lanes-open",
    "alternating-one-way",
    "some-lanes-closed-merge-left",
    "some-lanes-closed-merge-right",
    "all-lanes-open-shift-left",
    "all-lanes-open-shift-right",
    "some-lanes-closed-split",
    "flagging",
    "temporary-traffic-signal",
    "unknown",
]
WorkZoneType: TypeAlias = Literal["static", "moving", "planned-moving-area"]
LocationMethod: TypeAlias = Literal[
    "channel-device-method", "sign-method", "junction-method", "other", "unknown"
]
LaneStatus: TypeAlias = Literal[
    "open", "closed", "shift-left", "shift-right", "merge-left", "merge-right", "alternating-flow"
]
LaneType: TypeAlias = Literal[
    "general",
    "exit-lane",
    "exit-ramp",
    "entrance-lane",
    "entrance-ramp",
    "sidewalk",
    "bike-lane",
    "shoulder",
    "parking",
    "median",
    "two-way-center-turn-lane",
    "center-left-turn-lane",
]
DeviceStatus: TypeAlias = Literal["ok", "warning", "error", "unknown"]
DeviceType: TypeAlias = Literal[
    "arrow-board",
    "camera",
    "dynamic-message-sign",
    "flashing-beacon",
    "hybrid-sign",
    "location-marker",
    "roadside-unit",
    "traffic-sensor",
    "traffic-signal",
]
MarkedLocationType: TypeAlias = Literal[
    "afad",
    "delineator",
    "flagger",
    "lane-shift",
    "lane-closure",
    "personal-device",
    "temporary-traffic-signal",
    "ramp-closure",
    "road-closure",
    "road-event-start",
    "road-event-end",
    "work-truck-with-lights-flashing",
    "work-zone-start",
    "work-zone-end",
]

ONLY_WZDX_MARKERS = frozenset({"road-event-start", "road-event-end"})
ONLY_CWZ_DEVICES = frozenset({"roadside-unit"})
DEPRECATED = (
    "event_status",
    "start_date_accuracy",
    "end_date_accuracy",
    "beginning_accuracy",
    "ending_accuracy",
)
"""Members of a road event that WZDx 4.2 keeps for old readers and CWZ 1.0 dropped."""
