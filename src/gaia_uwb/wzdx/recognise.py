"""What a document is: one of the two feeds, a feed in a wrapping, or something else.

>>> from gaia_uwb.wzdx.recognise import what_it_is_instead
>>> feed = {"type": "FeatureCollection", "feed_info": {}, "features": []}
>>> print(what_it_is_instead({"data": feed}))
$: the feed is in $.data: give that object alone
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from typing import Any, Literal, TypeAlias

from gaia_uwb._shared import shown
from gaia_uwb.wzdx.problems import Problem, json_path

FeedKind: TypeAlias = Literal["WorkZoneFeed", "DeviceFeed"]

_INFO = ("feed_info", "road_event_feed_info")
_DEEPEST_WRAPPING = 3
_WIDEST_WRAPPING = 20  # members or items looked at
_WGS84 = ("CRS84", "4326")


def feed_kind(document: Any) -> FeedKind:
    """Recognise a device feed by what most features are; without any it is a work-zone feed."""
    features = document.get("features") if isinstance(document, dict) else None
    details = map(core_details, features if isinstance(features, list) else [])
    counted = Counter(
        "DeviceFeed" if "device_type" in each else "WorkZoneFeed"
        for each in details
        if "device_type" in each or "event_type" in each
    )
    return "DeviceFeed" if counted["DeviceFeed"] > counted["WorkZoneFeed"] else "WorkZoneFeed"


def core_details(feature: Any) -> dict[str, Any]:
    """Return a feature's core details, nothing where it has none."""
    properties = feature.get("properties") if isinstance(feature, dict) else None
    details = properties.get("core_details") if isinstance(properties, dict) else None
    return details if isinstance(details, dict) else {}


def feed_info(document: dict[str, Any]) -> dict[str, Any]:
    """Return what a feed says of itself, under the name of today or that of before 4.1."""
    info = next((document[name] for name in _INFO if name in document), None)
    return info if isinstance(info, dict) else {}


def what_it_is_instead(document: Any) -> Problem | None:
    """Say what a document is that is no feed; None where it may be one.

    Parameters
    ----------
    document
        Plain JSON values.
    """
    if isinstance(document, dict) and _may_be_feed(document):
        return None
    place = _feed_inside(document, [])
    if place is not None:
        return Problem("$", f"the feed is in {json_path(*place)}: give that object alone")
    if isinstance(document, dict):
        return None  # what it lacks is said member by member
    got = type(document).__name__
    if isinstance(document, str) and document.lstrip().startswith(("{", "[")):
        got = "a text that holds JSON: written twice over"
    elif isinstance(document, list) and document and isinstance(document[0], dict):
        got = "a list of objects: features belong in a FeatureCollection with feed_info"
    return Problem("$", f"expected a feed, which is a JSON object, got {got}")


def in_the_wrong_feed(feature: Any, kind: FeedKind) -> tuple[str, str] | None:
    """Return the member that shows that a feature belongs in another feed, and the words for it."""
    details = core_details(feature)
    if kind == "WorkZoneFeed" and "device_type" in details and "event_type" not in details:
        return "device_type", "a field device among road events: it belongs in a DeviceFeed"
    if kind == "DeviceFeed" and "event_type" in details and "device_type" not in details:
        return "event_type", "a road event among field devices: it belongs in a WorkZoneFeed"
    if details.get("event_type") == "restriction":
        return "event_type", "a restriction is no work zone: it belongs in a restriction feed"
    return None


def check_system(document: dict[str, Any]) -> Iterator[Problem]:
    """Yield that a feed names a coordinate system, which GeoJSON no longer lets it choose."""
    for name in ("crs", "spatialReference"):
        if name not in document:
            continue
        written = str(document[name])[:1000]
        if document[name] is None or any(known in written for known in _WGS84):
            text = "GeoJSON has no such member any more (RFC 7946)"
            yield Problem(json_path(name), text, is_error=False)
        else:
            expected = "expected WGS84 longitude and latitude"
            yield Problem(
                json_path(name), f"{expected}, got coordinates in {_named(document[name])}"
            )


def _named(system: Any) -> str:
    properties = system.get("properties") if isinstance(system, dict) else None
    name = properties.get("name") if isinstance(properties, dict) else None
    return shown(system if name is None else name)


def _may_be_feed(document: dict[str, Any]) -> bool:
    return "features" in document or any(name in document for name in _INFO)


def _feed_inside(document: Any, place: list[str | int]) -> list[str | int] | None:
    """Return the place of an object in a document that looks like a feed; the outermost one."""
    if isinstance(document, dict):
        if place and _may_be_feed(document):
            return place
        items: list[tuple[str | int, Any]] = list(document.items())[:_WIDEST_WRAPPING]
    elif isinstance(document, list):
        items = list(enumerate(document[:_WIDEST_WRAPPING]))
    else:
        return None
    if len(place) == _DEEPEST_WRAPPING:
        return None
    inside = (_feed_inside(value, [*place, key]) for key, value in items)
    return next((found for found in inside if found is not None), None)
