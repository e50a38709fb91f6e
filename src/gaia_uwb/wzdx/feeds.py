"""From a reconstructed work zone to WZDx 4.2 or CWZ 1.0: a WorkZoneFeed and a DeviceFeed.

Nothing here reads a clock or draws a random number: the same zone, settings and date give the same
bytes. Coordinates are WGS84 longitude and latitude with seven decimals (1 cm). What is uncertain
is stated where a reader looks for it: positions that are not verified, devices with a warning, and
the reasons in the event's description and the devices' messages.
"""

from __future__ import annotations

import json
import math
import uuid
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any, Literal

import numpy as np

from gaia_uwb._shared import Array, ConfigError, Float64, InputError, OutputFolder
from gaia_uwb.estimate import AnchorFix, AnchorStatus
from gaia_uwb.outputs import Json, lon_lat
from gaia_uwb.wzdx.dates import date_text
from gaia_uwb.wzdx.parts import FeedPart, RoadZone
from gaia_uwb.wzdx.settings import FeedConfig
from gaia_uwb.wzdx.validate import validate_document
from gaia_uwb.wzdx.wording import (
    cone_extension,
    cone_messages,
    confidence_radius_m,
    listed,
    shortened,
)
from gaia_uwb.wzdx.words import CC0, VERSIONS
from gaia_uwb.wzdx.zone import FeedZone

WORK_ZONE_FILE, DEVICE_FILE = "work-zone-feed.geojson", "device-feed.geojson"
DECIMALS = 7

_NAMESPACE = uuid.UUID("5b0f6c52-9f0c-5c3a-8d1e-6a1f0d6a7e42")  # ours; changing it changes all ids


@dataclass(frozen=True)
class Feeds:
    """The two feeds of one work zone, as strict JSON values.

    Parameters
    ----------
    work_zone
        The ``WorkZoneFeed``.
    device
        The ``DeviceFeed``.
    """

    work_zone: Json
    device: Json


def make_feeds(zone: FeedZone, config: FeedConfig, update_date: datetime) -> Feeds:
    """Return both feeds of a log's work zones: a road event for each, and a device for each cone.

    Parameters
    ----------
    zone
        What was found, see :func:`gaia_uwb.wzdx.zone_of`.
    config
        What no log knows.
    update_date
        When the information was current, with its time zone.

    Raises
    ------
    ConfigError
        If ``device_ids`` names a cone that the zone does not have, or the date has no time zone.
    InputError
        If a feed cannot describe the zone, for example because it crosses the 180th meridian.
    """
    writer = _Writer.of(zone, config, update_date)
    feeds = Feeds(
        work_zone=writer.collection(list(writer.events())),
        device=writer.collection(list(writer.devices())),
    )
    for feed in (feeds.work_zone, feeds.device):
        errors = [problem for problem in validate_document(feed) if problem.is_error]
        if errors:
            raise InputError(f"the feed would be invalid: {errors[0]}", source=zone.name)
    return feeds


def write_feeds(feeds: Feeds, folder: Path) -> list[Path]:
    """Write both feeds, each whole or not at all, and return their paths.

    Parameters
    ----------
    feeds
        What to write.
    folder
        Created if missing.

    Raises
    ------
    ConfigError
        If the folder or a file in it cannot be written.
    """
    output = OutputFolder(folder)
    return [
        output.write(name, feed_text(feed))
        for name, feed in ((WORK_ZONE_FILE, feeds.work_zone), (DEVICE_FILE, feeds.device))
    ]


def feed_text(feed: Json) -> str:
    """Return a feed as the text of its file."""
    return json.dumps(feed, indent=1, allow_nan=False) + "\n"


@dataclass(frozen=True)
class _Writer:
    """Makes the members of both feeds."""

    zone: FeedZone
    config: FeedConfig
    date: str
    events_found: tuple[_Event, ...]  # upstream to downstream

    @classmethod
    def of(cls, zone: FeedZone, config: FeedConfig, update_date: datetime) -> _Writer:
        try:
            date = date_text(update_date)
        except ValueError as error:
            raise ConfigError(f"update date: {error}") from error
        unknown = set(config.device_ids) - {cone.anchor_id for cone in zone.cones}
        unknown -= set(zone.unlocated)
        if unknown:
            raise ConfigError(f"device_ids: {zone.name} has no cone {sorted(unknown)[0]!r}")
        step: Literal[-1, 1] = -1 if config.against_traffic else 1
        events = [_Event.of(part, zone, step) for part in zone.parts[::step]]
        return cls(zone, config, date, tuple(events))

    def collection(self, features: Sequence[Json]) -> Json:
        shapes: list[Any] = [feature["geometry"] for feature in features]
        places = np.concatenate([np.array(s["coordinates"]).reshape(-1, 2) for s in shapes])
        if np.ptp(places[:, 0]) > 180.0:
            problem = "it crosses the 180th meridian, which a feed's line must not"
            raise InputError(problem, source=self.zone.name)
        return {
            "feed_info": self.feed_info(),
            "type": "FeatureCollection",
            "bbox": [*places.min(axis=0).tolist(), *places.max(axis=0).tolist()],
            "features": list(features),
        }

    def feed_info(self) -> Json:
        config, source = self.config, self.config.data_source
        version = next(v for v, profile in VERSIONS.items() if profile == config.profile)
        return _present(
            {
                "publisher": config.publisher,
                "contact_name": config.contact_name,
                "contact_email": config.contact_email,
                "update_frequency": config.update_frequency_s,
                "update_date": self.date,
                "version": version,
                "license": None if config.license is None else CC0,
                "data_sources": [
                    _present(
                        {
                            "data_source_id": self.data_source_id,
                            "organization_name": source.organization_name,
                            "contact_name": source.contact_name,
                            "contact_email": source.contact_email,
                            "update_frequency": source.update_frequency_s,
                            "update_date": self.date,
                        }
                    )
                ],
            }
        )

    @property
    def data_source_id(self) -> str:
        source = self.config.data_source
        return source.data_source_id or _derived("data-source", source.organization_name)

    def event_id(self, number: int) -> str:
        """Return the id of an event; the first one's is what it is without any others."""
        if self.config.event_id:
            return self.config.event_id if number == 1 else f"{self.config.event_id}-{number}"
        return self._id("event") if number == 1 else self._id("event", str(number))

    def _id(self, *words: str) -> str:
        return _derived(self.data_source_id, self.config.zone or self.zone.name, *words)

    def events(self) -> Iterator[Json]:
        for number, event in enumerate(self.events_found, start=1):
            yield self.event(event, number)

    def event(self, event: _Event, number: int) -> Json:
        config = self.config
        first, last = event.cones[0], event.cones[-1]
        start_m, end_m = event.within_m
        properties: dict[str, object] = {
            "core_details": self._core_details(event),
            "start_date": date_text(config.start_date),
            "end_date": date_text(config.end_date),
            "is_start_date_verified": config.start_date_verified,
            "is_end_date_verified": config.end_date_verified,
            "is_start_position_verified": self._is_verified(config.start_position, first, start_m),
            "is_end_position_verified": self._is_verified(config.end_position, last, end_m),
            "location_method": "channel-device-method",
            "vehicle_impact": config.vehicle_impact,
            "work_zone_type": config.work_zone_type,
            "lanes": [lane.model_dump() for lane in config.lanes] or None,
            "reduced_speed_limit_kph": config.reduced_speed_limit_kph,
            "event_status": config.event_status,
        }
        if config.deprecated_members:
            properties |= _deprecated(properties)
        if config.extension:
            properties["gaia"] = self._zone_extension(event)
        geometry = {"type": "LineString", "coordinates": event.line_degrees}
        return _feature(self.event_id(number), _present(properties), geometry)

    def _core_details(self, event: _Event) -> Json:
        config = self.config
        return _present(
            {
                "event_type": "work-zone",
                "data_source_id": self.data_source_id,
                "road_names": list(config.road_names),
                "direction": config.direction,
                "name": config.name,
                "description": self._description(event),
                "creation_date": config.creation_date and date_text(config.creation_date),
                "update_date": self.date,
                "project_id": config.project_id,
            }
        )

    def _description(self, event: _Event) -> str:
        n = len(event.cones)
        words = [self.config.description] if self.config.description else []
        words.append(f"Located by UWB ranging from a vehicle to {n} cones.")
        if self.zone.stated:
            words.append(f"Stated, not measured: {listed(self.zone.stated)}.")
        if self.zone.unlocated:
            words.append(f"Not located: {listed(self.zone.unlocated)}.")
        if not self.zone.reliable:
            reasons = "; ".join(self.zone.reasons or self.zone.doubts)
            words.append(f"Unreliable: {shortened(reasons)}.")
        return " ".join(words)

    def _is_verified(
        self, wanted: Literal["auto", "verified", "estimated"], cone: AnchorFix, within_m: float
    ) -> bool:
        if wanted != "auto":
            return wanted == "verified"
        radius_m = within_m if math.isfinite(within_m) else confidence_radius_m(cone)
        within = radius_m is not None and radius_m <= self.config.verified_below_m
        doubted = self.zone.doubts or self.zone.stated
        return within and cone.status is AnchorStatus.OK and not doubted

    def devices(self) -> Iterator[Json]:
        for number, event in enumerate(self.events_found, start=1):
            event_id = self.event_id(number)
            for k, (cone, place) in enumerate(zip(event.cones, event.cone_degrees, strict=True)):
                properties: dict[str, object] = {
                    "core_details": self._device_details(cone, event_id),
                    "marked_locations": self._marked_locations(k, len(event.cones), event_id),
                }
                if self.config.extension:
                    properties["gaia"] = cone_extension(cone)
                geometry = {"type": "Point", "coordinates": place}
                device_id = self.config.device_ids.get(cone.anchor_id)
                yield _feature(device_id or self._id("cone", cone.anchor_id), properties, geometry)

    def _device_details(self, cone: AnchorFix, event_id: str) -> Json:
        config = self.config
        doubtful = cone.status is not AnchorStatus.OK or bool(self.zone.doubts)
        return {
            "device_type": "location-marker",
            "data_source_id": self.data_source_id,
            "device_status": "warning" if doubtful else "ok",
            "update_date": self.date,
            "has_automatic_location": config.has_automatic_location,
            "road_direction": config.direction,
            "road_names": list(config.road_names),
            "name": cone.anchor_id,
            "status_messages": [*cone_messages(cone), *map(shortened, self.zone.doubts)],
            "is_moving": False,
            "road_event_ids": [event_id],
        }

    def _marked_locations(self, k: int, n_cones: int, event_id: str) -> list[Json]:
        kinds = ["delineator"]
        if self.config.mark_ends and k == 0:
            kinds.append("work-zone-start")
        if self.config.mark_ends and k == n_cones - 1:
            kinds.append("work-zone-end")
        return [{"type": kind, "road_event_id": event_id} for kind in kinds]

    def _zone_extension(self, event: _Event) -> Json:
        """Return what the specifications have no member for: edges, closed area and hull."""
        hull = _degrees(self.zone, self.zone.hull_m)
        road = event.road
        lines = [] if road is None else [_degrees(self.zone, m) for m in road.edges_m if len(m) > 1]
        closed = [] if road is None else [
            [_ring(_degrees(self.zone, ring_m)) for ring_m in rings_m] for rings_m in road.closed_m
        ]  # fmt: skip
        return {
            "edges": _geometry("MultiLineString", lines),
            "closed_area": _geometry("MultiPolygon", closed),
            "hull": _geometry("Polygon", [_ring(hull)] if len(hull) > 2 else []),
            "status": "ok" if self.zone.reliable else "unreliable",
            "reasons": list(self.zone.reasons),
            "unlocated": list(self.zone.unlocated),
        }


@dataclass(frozen=True)
class _Event:
    """One work zone, upstream to downstream."""

    cones: tuple[AnchorFix, ...]
    cone_degrees: list[list[float]]
    line_degrees: list[list[float]]
    within_m: tuple[float, float]
    road: RoadZone | None

    @classmethod
    def of(cls, part: FeedPart, zone: FeedZone, step: Literal[-1, 1]) -> _Event:
        """Return a part of a zone as it is, or turned around."""
        cones, line_m = part.cones[::step], part.line_m[::step]
        line = _without_repeats(_degrees(zone, line_m))
        if len(line) < 2:
            raise InputError("its line is shorter than a centimetre", source=zone.name)
        places = _degrees(zone, np.array([cone.position_m for cone in cones]))
        road = part.road if part.road is None or step > 0 else part.road.turned()
        within_m = (math.nan, math.nan) if road is None else road.within_m
        return cls(cones, places, line, within_m, road)


def _ring(places: list[list[float]]) -> list[list[float]]:
    return [*places, places[0]]


def _geometry(kind: str, coordinates: Sequence[object]) -> Json | None:
    """Return a geometry; None without any coordinates."""
    return {"type": kind, "coordinates": list(coordinates)} if coordinates else None


def _degrees(zone: FeedZone, position_m: Float64[Array, "K 2"]) -> list[list[float]]:
    found: list[list[float]] = lon_lat(zone.frame, position_m).round(DECIMALS).tolist()
    return found


def _without_repeats(line: list[list[float]]) -> list[list[float]]:
    return [place for k, place in enumerate(line) if k == 0 or place != line[k - 1]]


def _feature(feature_id: str, properties: Json, geometry: Mapping[str, object]) -> Json:
    return {"id": feature_id, "type": "Feature", "properties": properties, "geometry": geometry}


def _present(members: Mapping[str, object]) -> Json:
    """Leave out what is None: a feed has no null."""
    return {name: value for name, value in members.items() if value is not None}


def _deprecated(properties: Mapping[str, object]) -> Json:
    """Return the words that readers of WZDx before 4.1 look for."""
    old = {
        "start_date_accuracy": "is_start_date_verified",
        "end_date_accuracy": "is_end_date_verified",
        "beginning_accuracy": "is_start_position_verified",
        "ending_accuracy": "is_end_position_verified",
    }
    return {name: "verified" if properties[new] else "estimated" for name, new in old.items()}


def _derived(*words: str) -> str:
    """Return an id that the same words give again, on every machine."""
    return str(uuid.uuid5(_NAMESPACE, json.dumps(words)))
