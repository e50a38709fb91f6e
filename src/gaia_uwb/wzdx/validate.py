"""Check feeds: member by member, by the rules between members, and by the official schemas.

>>> from gaia_uwb.wzdx import validate_document
>>> for problem in validate_document({"type": "FeatureCollection", "features": []}):
...     print(problem)
$.feed_info: required
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain, islice
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from gaia_uwb._shared import shown
from gaia_uwb.wzdx import models
from gaia_uwb.wzdx.places import Positions, Step, check_bbox, check_geometry
from gaia_uwb.wzdx.problems import Problem, json_path
from gaia_uwb.wzdx.recognise import (
    FeedKind,
    check_system,
    core_details,
    feed_info,
    feed_kind,
    in_the_wrong_feed,
    what_it_is_instead,
)
from gaia_uwb.wzdx.rules import check_device, check_event, check_heading, check_offsets
from gaia_uwb.wzdx.schemas import OfficialSchemas
from gaia_uwb.wzdx.strict_json import read_json
from gaia_uwb.wzdx.words import DEPRECATED, VERSIONS, Profile

_LIKE_4 = re.compile(r"^\D*4\.")
MOST_PROBLEMS = 100
"""Most problems listed per feed; more would only repeat the same."""


def validate_files(
    paths: Sequence[Path], schemas: OfficialSchemas | None = None
) -> dict[Path, list[Problem]]:
    """Check feeds, and the references between them.

    Parameters
    ----------
    paths
        Files with one feed each.
    schemas
        The official schemas, also checked.

    Returns
    -------
    dict
        Problems of each file, at most :data:`MOST_PROBLEMS`.

    Raises
    ------
    InputError
        If a file cannot be read or is not strict JSON.
    ConfigError
        If the schemas do not cover a feed.
    """
    documents = {path: read_json(path) for path in paths}
    found = {path: validate_document(documents[path], schemas) for path in documents}
    kinds = {path: feed_kind(documents[path]) for path in documents}
    if len(set(kinds.values())) > 1:
        event_ids = set(
            chain.from_iterable(_ids(documents[p]) for p in paths if kinds[p] == "WorkZoneFeed")
        )
        for path in paths:
            if kinds[path] == "DeviceFeed":
                dangling = _dangling_events(documents[path], event_ids)
                found[path] += islice(dangling, MOST_PROBLEMS - len(found[path]))
    return found


def validate_document(document: Any, schemas: OfficialSchemas | None = None) -> list[Problem]:
    """Check one feed.

    Parameters
    ----------
    document
        Plain JSON values.
    schemas
        The official schemas, also checked.

    Returns
    -------
    list of Problem
        At most :data:`MOST_PROBLEMS`, in the document's order; the schemas' come last.

    Raises
    ------
    ConfigError
        If the schemas do not cover this feed.
    """
    return list(islice(_each_once(_problems(document, schemas)), MOST_PROBLEMS))


def _problems(document: Any, schemas: OfficialSchemas | None) -> Iterator[Problem]:
    other = what_it_is_instead(document)
    if other is not None:
        yield other
        return
    check = _Check(document)
    yield from check.problems()
    if not check.is_of_our_time:
        return
    if schemas is None:
        yield from _unchecked(document)
    else:
        profile = _profile(feed_info(document))
        yield from schemas.problems(document, feed_kind(document), profile)


def _each_once(problems: Iterator[Problem]) -> Iterator[Problem]:
    seen = set()
    for problem in problems:
        if problem not in seen:
            seen.add(problem)
            yield problem


@dataclass
class _Check:
    """One walk through a feed."""

    document: Any
    profile: Profile = "wzdx-4.2"
    seen: dict[str, int] = field(default_factory=dict)
    is_of_our_time: bool = True
    positions: Positions = field(default_factory=lambda: Positions(None))
    sources: set[str] | None = None

    def problems(self) -> Iterator[Problem]:
        kind = feed_kind(self.document)
        yield from self._head(kind)
        if not self.is_of_our_time:
            return
        outside = list(_model_problems(models.Collection, self.document, []))
        yield from outside
        if outside:
            return
        if "bbox" in self.document:
            yield from check_bbox(self.document["bbox"])
        system = list(check_system(self.document))
        yield from system
        in_degrees = not any(problem.is_error for problem in system)
        self.positions = Positions(self.document.get("bbox"), in_degrees=in_degrees)
        for k, feature in enumerate(self.document["features"]):
            yield from self._feature(feature, k, kind)
        yield from self.positions.together()
        yield from check_offsets(self.document)
        if kind == "WorkZoneFeed":
            yield from self._related()

    def _head(self, kind: FeedKind) -> Iterator[Problem]:
        old = "road_event_feed_info"
        old_name = kind == "WorkZoneFeed" and "feed_info" not in self.document
        name = old if old_name and old in self.document else "feed_info"
        if name not in self.document:
            yield Problem(json_path(name), "required")
            return
        info = self.document[name]
        version = info.get("version") if isinstance(info, dict) else None
        if isinstance(version, str) and version not in VERSIONS:
            known = "4.2 (WZDx) or 1.0 (CWZ)"
            # All that was valid in 4.0 is in 4.2; before, every member had another place.
            self.is_of_our_time = _LIKE_4.search(version) is not None
            then = "checked as 4.2" if self.is_of_our_time else "the rest is not checked"
            text = f"expected {known}, got {shown(version)}: {then}"
            yield Problem(json_path(name, "version"), text)
            if not self.is_of_our_time:
                return
        self.profile = _profile(info)
        model = models.CwzFeedInfo if self.profile == "cwz-1.0" else models.FeedInfo
        wrong = list(_model_problems(model, info, [name]))
        yield from wrong
        if not wrong:
            ids = [source["data_source_id"] for source in info["data_sources"]]
            self.sources = set(ids)
            for k, data_source_id in enumerate(ids):
                if data_source_id in ids[:k]:
                    path = json_path(name, "data_sources", k, "data_source_id")
                    yield Problem(path, f"the id {shown(data_source_id)} is used twice")

    def _feature(self, feature: Any, k: int, kind: FeedKind) -> Iterator[Problem]:
        place: list[Step] = ["features", k]
        outside = list(_model_problems(models.Feature, feature, place))
        yield from outside
        if outside:
            return
        yield from self._unique(feature["id"], k)
        stranger = in_the_wrong_feed(feature, kind)
        if stranger is not None:
            yield Problem(
                json_path(*place, "properties", "core_details", *stranger[:1]), stranger[1]
            )
            return
        geometry = check_geometry(
            feature["geometry"], self._allowed(kind), [*place, "geometry"], self.positions
        )
        misplaced = list(geometry)
        yield from misplaced
        properties, inside = feature["properties"], [*place, "properties"]
        wrong = list(_model_problems(_model(kind, feature), properties, inside))
        yield from wrong
        if wrong:
            return
        yield from self._source(properties["core_details"], inside)
        check = check_event if kind == "WorkZoneFeed" else check_device
        yield from check(properties, inside, self.profile)
        if kind == "WorkZoneFeed" and not any(problem.is_error for problem in misplaced):
            yield from check_heading(feature, place)

    def _allowed(self, kind: FeedKind) -> tuple[str, ...]:
        if kind == "DeviceFeed":
            return ("Point",)
        return ("LineString", "Point" if self.profile == "cwz-1.0" else "MultiPoint")

    def _unique(self, feature_id: str, k: int) -> Iterator[Problem]:
        first = self.seen.setdefault(feature_id, k)
        if first != k:
            text = f"the id {shown(feature_id)} is already used by features[{first}]"
            yield Problem(json_path("features", k, "id"), text)

    def _source(self, details: dict[str, Any], place: Sequence[Step]) -> Iterator[Problem]:
        source = details["data_source_id"]
        if self.sources is not None and source not in self.sources:
            text = f"{shown(source)} is not in feed_info.data_sources"
            yield Problem(json_path(*place, "core_details", "data_source_id"), text)

    def _related(self) -> Iterator[Problem]:
        """Yield references to events that are not in this feed; they may be in another one."""
        for k, feature in enumerate(self.document["features"]):
            related = core_details(feature).get("related_road_events")
            for j, other in enumerate(related if isinstance(related, list) else []):
                other_id = other.get("id") if isinstance(other, dict) else None
                if isinstance(other_id, str) and other_id not in self.seen:
                    place = ("features", k, "properties", "core_details", "related_road_events", j)
                    text = f"{shown(other_id)} is not an event in this feed"
                    yield Problem(json_path(*place, "id"), text, is_error=False)


def _unchecked(document: dict[str, Any]) -> Iterator[Problem]:
    """Yield a warning with the members that only the official schemas know."""
    if not isinstance(document.get("features"), list):
        return
    kind, names = feed_kind(document), set()
    for feature in document["features"]:
        properties = feature.get("properties") if isinstance(feature, dict) else None
        if isinstance(properties, dict):
            names |= properties.keys() - _model(kind, feature).model_fields.keys()
    names -= {"gaia", *DEPRECATED}
    if names:
        text = f"not checked without --schemas: {shown(sorted(names))}"
        yield Problem("$.features", text, is_error=False)


def _model(kind: FeedKind, feature: dict[str, Any]) -> type[models.Part]:
    details = core_details(feature)
    if kind == "DeviceFeed":
        is_marker = details.get("device_type") == "location-marker"
        return models.LocationMarker if is_marker else models.Device
    return models.RoadEvent if details.get("event_type") == "detour" else models.WorkZone


def _model_problems(
    model: type[models.Part], value: Any, place: Sequence[Step]
) -> Iterator[Problem]:
    try:
        model.model_validate(value)
    except ValidationError as error:
        for details in error.errors(include_url=False, include_context=False):
            yield Problem(json_path(*place, *details["loc"]), _said(details))


def _said(details: Mapping[str, Any]) -> str:
    if details["type"] == "missing":
        return "required"
    if details["type"] in ("model_type", "dict_type"):
        return f"expected an object, got {shown(details['input'])}"
    message = str(details["msg"]).removeprefix("Value error, ").removeprefix("Input should be ")
    expected = message if message.startswith("expected") else f"expected {message}"
    return f"{expected}, got {shown(details['input'])}"


def _profile(info: Any) -> Profile:
    """Return the specification that a feed says to follow; unless it says so, it is WZDx 4.2."""
    version = info.get("version") if isinstance(info, dict) else None
    return VERSIONS.get(version, "wzdx-4.2") if isinstance(version, str) else "wzdx-4.2"


def _ids(document: Any) -> Iterator[str]:
    for feature in document["features"] if isinstance(document.get("features"), list) else []:
        if isinstance(feature, dict) and isinstance(feature.get("id"), str):
            yield feature["id"]


def _dangling_events(document: Any, event_ids: set[str]) -> Iterator[Problem]:
    """Yield references of devices to road events that none of the feeds holds."""
    for k, feature in enumerate(document["features"]):
        references: list[tuple[list[Step], Any]] = []
        listed = core_details(feature).get("road_event_ids")
        for j, event_id in enumerate(listed if isinstance(listed, list) else []):
            references.append((["core_details", "road_event_ids", j], event_id))
        properties = feature.get("properties") if isinstance(feature, dict) else None
        markers = properties.get("marked_locations") if isinstance(properties, dict) else None
        for j, marker in enumerate(markers if isinstance(markers, list) else []):
            if isinstance(marker, dict) and "road_event_id" in marker:
                where: list[Step] = ["marked_locations", j, "road_event_id"]
                references.append((where, marker["road_event_id"]))
        for steps, event_id in references:
            if isinstance(event_id, str) and event_id not in event_ids:
                path = json_path("features", k, "properties", *steps)
                yield Problem(path, f"{shown(event_id)} is not an event in the given feeds")
