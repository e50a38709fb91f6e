"""From a reconstructed work zone to WZDx 4.2 or CWZ 1.0: a WorkZoneFeed and a DeviceFeed.

Nothing here reads a clock or draws a random number: the same zone, settings and date give the same
bytes. Coordinates are WGS84 longitude and latitude with seven decimals (1 cm). What is uncertain
is stated where a reader looks for it: positions that are not verified, devices with a warning, and
the reasons in the event's description and the devices' messages.
"""

from __future__ import annotations

import json
import uuid
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Literal

import numpy as np

from gaia_uwb._shared import Array, ConfigError, Float64, InputError, OutputFolder
from gaia_uwb.estimate import AnchorFix, AnchorStatus
from gaia_uwb.outputs import Json, lon_lat
from gaia_uwb.wzdx.dates import date_text
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
    """Return both feeds of a work zone.

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
        work_zone=writer.collection([writer.event()], writer.line_degrees),
        device=writer.collection(list(writer.devices()), writer.cone_degrees),
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
    cones: tuple[AnchorFix, ...]  # upstream to downstream
    cone_degrees: list[list[float]]
    line_degrees: list[list[float]]

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
        step = -1 if config.against_traffic else 1
        cones, line_m = zone.cones[::step], zone.line_m[::step]
        cones_m = np.array([cone.position_m for cone in cones])
        line = _without_repeats(_degrees(zone, line_m))
        if len(line) < 2:
            raise InputError("its line is shorter than a centimetre", source=zone.name)
        return cls(zone, config, date, cones, _degrees(zone, cones_m), line)

    def collection(self, features: Sequence[Json], degrees: list[list[float]]) -> Json:
        places = np.array(degrees)
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

    @property
    def event_id(self) -> str:
        return self.config.event_id or self._id("event")

    def _id(self, *words: str) -> str:
        return _derived(self.data_source_id, self.config.zone or self.zone.name, *words)

    def event(self) -> Json:
        config = self.config
        properties: dict[str, object] = {
            "core_details": self._core_details(),
            "start_date": date_text(config.start_date),
            "end_date": date_text(config.end_date),
            "is_start_date_verified": config.start_date_verified,
            "is_end_date_verified": config.end_date_verified,
            "is_start_position_verified": self._is_verified(config.start_position, self.cones[0]),
            "is_end_position_verified": self._is_verified(config.end_position, self.cones[-1]),
            "location_method": "channel-device-method",
            "vehicle_impact": config.vehicle_impact,
            "work_zone_type": config.work_zone_type,
            "reduced_speed_limit_kph": config.reduced_speed_limit_kph,
            "event_status": config.event_status,
        }
        if config.deprecated_members:
            properties |= _deprecated(properties)
        if config.extension:
            properties["gaia"] = self._zone_extension()
        geometry = {"type": "LineString", "coordinates": self.line_degrees}
        return _feature(self.event_id, _present(properties), geometry)

    def _core_details(self) -> Json:
        config = self.config
        return _present(
            {
                "event_type": "work-zone",
                "data_source_id": self.data_source_id,
                "road_names": list(config.road_names),
                "direction": config.direction,
                "name": config.name,
                "description": self._description(),
                "creation_date": config.creation_date and date_text(config.creation_date),
                "update_date": self.date,
                "project_id": config.project_id,
            }
        )

    def _description(self) -> str:
        n = len(self.cones)
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
        self, wanted: Literal["auto", "verified", "estimated"], cone: AnchorFix
    ) -> bool:
        if wanted != "auto":
            return wanted == "verified"
        radius_m = confidence_radius_m(cone)
        within = radius_m is not None and radius_m <= self.config.verified_below_m
        doubted = self.zone.doubts or self.zone.stated
        return within and cone.status is AnchorStatus.OK and not doubted

    def devices(self) -> Iterator[Json]:
        for k, (cone, place) in enumerate(zip(self.cones, self.cone_degrees, strict=True)):
            properties: dict[str, object] = {
                "core_details": self._device_details(cone),
                "marked_locations": self._marked_locations(k),
            }
            if self.config.extension:
                properties["gaia"] = cone_extension(cone)
            geometry = {"type": "Point", "coordinates": place}
            device_id = self.config.device_ids.get(cone.anchor_id)
            yield _feature(device_id or self._id("cone", cone.anchor_id), properties, geometry)

    def _device_details(self, cone: AnchorFix) -> Json:
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
            "road_event_ids": [self.event_id],
        }

    def _marked_locations(self, k: int) -> list[Json]:
        kinds = ["delineator"]
        if self.config.mark_ends and k == 0:
            kinds.append("work-zone-start")
        if self.config.mark_ends and k == len(self.cones) - 1:
            kinds.append("work-zone-end")
        return [{"type": kind, "road_event_id": self.event_id} for kind in kinds]

    def _zone_extension(self) -> Json:
        hull = _degrees(self.zone, self.zone.hull_m)
        boundary = {"type": "Polygon", "coordinates": [[*hull, hull[0]]]} if len(hull) > 2 else None
        return {
            "boundary": boundary,
            "status": "ok" if self.zone.reliable else "unreliable",
            "reasons": list(self.zone.reasons),
            "unlocated": list(self.zone.unlocated),
        }


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
