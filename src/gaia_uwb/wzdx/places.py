"""Geometries: enough positions, in their range, longitude before latitude, inside the bbox."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any, TypeGuard

from gaia_uwb._shared import shown
from gaia_uwb.wzdx.problems import Problem, json_path

Step = str | int
_Number = int | float  # JSON does not tell them apart

_SOUTHERNMOST_ROAD_DEG = -60.0  # beyond it a latitude is a longitude in the wrong place
_BBOX_SLACK_DEG = 1e-6


def check_geometry(
    geometry: dict[str, Any], allowed: Sequence[str], place: Sequence[Step], bbox: Any
) -> Iterator[Problem]:
    """Yield what is wrong with a feature's geometry.

    Parameters
    ----------
    geometry
        A GeoJSON geometry.
    allowed
        Types that a feature of this kind may have.
    place
        The geometry's place in the document.
    bbox
        The feed's bounding box, None without one; a wrong one is ignored here.
    """
    kind, coordinates = geometry.get("type"), geometry.get("coordinates")
    if kind not in allowed:
        expected = " or ".join(allowed)
        yield Problem(json_path(*place, "type"), f"expected {expected}, got {shown(kind)}")
        return
    if kind == "Point":
        yield from check_position(coordinates, [*place, "coordinates"], bbox)
        return
    if not isinstance(coordinates, list) or not coordinates:
        path = json_path(*place, "coordinates")
        yield Problem(path, f"expected a list of positions, got {shown(coordinates)}")
        return
    sound = True
    for k, position in enumerate(coordinates):
        for problem in check_position(position, [*place, "coordinates", k], bbox):
            sound &= not problem.is_error
            yield problem
    if sound and kind == "LineString":
        yield from _check_line(coordinates, json_path(*place, "coordinates"))


def check_position(position: Any, place: Sequence[Step], bbox: Any) -> Iterator[Problem]:
    """Yield what is wrong with one position."""
    path = json_path(*place)
    if not _are_numbers(position) or len(position) not in (2, 3):
        yield Problem(path, f"expected [longitude, latitude], got {shown(position)}")
        return
    lon, lat = position[:2]
    if abs(lon) > 180.0:
        yield Problem(path, f"expected a longitude between -180 and 180 first, got {lon}")
    elif abs(lat) > 90.0:
        swapped = ": longitude comes first" if abs(lon) <= 90.0 and abs(lat) <= 180.0 else ""
        yield Problem(path, f"expected a latitude between -90 and 90 second, got {lat}{swapped}")
    elif _is_box(bbox) and not _is_inside(lon, lat, bbox):
        yield Problem(path, f"[{lon}, {lat}] is outside the feed's bbox")
    elif lat < _SOUTHERNMOST_ROAD_DEG:
        # Only a warning: one of the official example feeds has its numbers in that order.
        text = f"latitude {lat} is south of every road: longitude comes first"
        yield Problem(path, text, is_error=False)


def check_bbox(bbox: Any) -> Iterator[Problem]:
    """Yield what is wrong with a feed's bounding box."""
    path = json_path("bbox")
    if not _is_box(bbox):
        expected = "expected [west, south, east, north]"
        yield Problem(path, f"{expected}, got {shown(bbox)}")
        return
    west, south, east, north = _edges(bbox)
    if not (abs(west) <= 180.0 and abs(east) <= 180.0 and -90.0 <= south <= north <= 90.0):
        expected = "expected [west, south, east, north] in degrees, south before north"
        yield Problem(path, f"{expected}, got {shown(bbox)}")


def heading_deg(coordinates: Sequence[Sequence[float]]) -> float:
    """Return the direction from a line's first to its last position, clockwise from north."""
    (lon, lat), (last_lon, last_lat) = coordinates[0][:2], coordinates[-1][:2]
    east = (last_lon - lon + 180.0) % 360.0 - 180.0
    return math.degrees(math.atan2(east * math.cos(math.radians(lat)), last_lat - lat)) % 360.0


def _check_line(coordinates: list[list[float]], path: str) -> Iterator[Problem]:
    distinct = {tuple(position[:2]) for position in coordinates}
    if len(distinct) < 2:
        yield Problem(path, "expected a line of at least two different positions")
    elif coordinates[0][:2] == coordinates[-1][:2]:
        text = "a closed ring: a road event is a line from upstream to downstream"
        yield Problem(path, text, is_error=False)


def _are_numbers(value: Any) -> TypeGuard[list[float]]:
    return isinstance(value, list) and all(
        isinstance(number, (int, float)) and not isinstance(number, bool) and math.isfinite(number)
        for number in value
    )


def _is_box(bbox: Any) -> TypeGuard[list[float]]:
    return _are_numbers(bbox) and len(bbox) in (4, 6)


def _edges(bbox: Sequence[_Number]) -> tuple[_Number, _Number, _Number, _Number]:
    half = len(bbox) // 2  # with heights there are three numbers to a corner
    return bbox[0], bbox[1], bbox[half], bbox[half + 1]


def _is_inside(lon: _Number, lat: _Number, bbox: Sequence[_Number]) -> bool:
    west, south, east, north = _edges(bbox)
    between = west - _BBOX_SLACK_DEG <= lon <= east + _BBOX_SLACK_DEG
    if west > east:  # a box across the 180th meridian
        between = lon >= west - _BBOX_SLACK_DEG or lon <= east + _BBOX_SLACK_DEG
    return between and south - _BBOX_SLACK_DEG <= lat <= north + _BBOX_SLACK_DEG
