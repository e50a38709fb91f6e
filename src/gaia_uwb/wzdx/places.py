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
_FARTHEST_DEG = 1000.0  # no mistake in degrees is as large


class Positions:
    """Checks the positions of one feed, and says only once what is wrong with many of them.

    Parameters
    ----------
    bbox
        The feed's bounding box, None without one; a wrong one is ignored here.
    in_degrees
        Whether the feed claims longitudes and latitudes; nothing else is in range.
    """

    def __init__(self, bbox: Any, *, in_degrees: bool = True) -> None:
        self._bbox = None if any(check_bbox(bbox)) else _edges(bbox)
        self._in_degrees = in_degrees
        self._checked = self._n_outside = self._n_south = 0
        self._first = ""
        self._first_south: tuple[str, _Number] = ("", 0)
        self._looks_swapped = True

    def check(self, position: Any, place: Sequence[Step]) -> Iterator[Problem]:
        """Yield what is wrong with one position by itself."""
        path = json_path(*place)
        if not _are_numbers(position) or len(position) not in (2, 3):
            yield Problem(path, f"expected [longitude, latitude], got {shown(position)}")
            return
        if not self._in_degrees:
            return
        self._checked += 1
        lon, lat = position[:2]
        if max(abs(lon), abs(lat)) > _FARTHEST_DEG:
            self._in_degrees = False
            text = (
                f"expected degrees, got {position}: metres of a map projection, such as EPSG:3857?"
            )
            yield Problem(path, text)
        elif abs(lon) > 180.0:
            yield Problem(path, f"expected a longitude between -180 and 180 first, got {lon}")
        elif abs(lat) > 90.0:
            swapped = ": longitude comes first" if abs(lon) <= 90.0 and abs(lat) <= 180.0 else ""
            text = f"expected a latitude between -90 and 90 second, got {lat}{swapped}"
            yield Problem(path, text)
        elif self._bbox is not None and not _is_inside(lon, lat, self._bbox):
            self._n_outside += 1
            if self._n_outside == 1:
                self._first = f"first {path} with [{lon}, {lat}]"
            self._looks_swapped &= _is_inside(lat, lon, self._bbox)
        elif lat < _SOUTHERNMOST_ROAD_DEG:
            self._n_south += 1
            if self._n_south == 1:
                self._first_south = (path, lat)

    def together(self) -> Iterator[Problem]:
        """Yield, after all positions, what many of them share: outside the box, swapped."""
        if self._n_south:
            path, lat = self._first_south
            more = f"; {self._n_south - 1} more like it" if self._n_south > 1 else ""
            text = f"latitude {lat} is south of every road: longitude comes first{more}"
            # Only a warning: one of the official example feeds has its numbers in that order.
            yield Problem(path, text, is_error=False)
        if self._n_outside:
            text = f"{self._n_outside} of {self._checked} positions are outside, {self._first}"
            hint = ": the box or the positions have latitude first" if self._looks_swapped else ""
            yield Problem(json_path("bbox"), f"{text}{hint}")


def check_geometry(
    geometry: dict[str, Any], allowed: Sequence[str], place: Sequence[Step], positions: Positions
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
    positions
        Checks those of the whole feed.
    """
    kind, coordinates = geometry.get("type"), geometry.get("coordinates")
    if kind not in allowed:
        expected = " or ".join(allowed)
        yield Problem(json_path(*place, "type"), f"expected {expected}, got {shown(kind)}")
        return
    if kind == "Point":
        yield from positions.check(coordinates, [*place, "coordinates"])
        return
    path = json_path(*place, "coordinates")
    if not isinstance(coordinates, list) or not coordinates:
        yield Problem(path, f"expected a list of positions, got {shown(coordinates)}")
        return
    sound = True
    for k, position in enumerate(coordinates):
        for problem in positions.check(position, [*place, "coordinates", k]):
            sound &= not problem.is_error
            yield problem
    if sound:
        yield from (_check_line if kind == "LineString" else _check_ends)(coordinates, path)


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


def heading_deg(coordinates: Sequence[Sequence[_Number]]) -> float:
    """Return the direction from a line's first to its last position, clockwise from north."""
    (lon, lat), (last_lon, last_lat) = coordinates[0][:2], coordinates[-1][:2]
    east = (last_lon - lon + 180.0) % 360.0 - 180.0
    return math.degrees(math.atan2(east * math.cos(math.radians(lat)), last_lat - lat)) % 360.0


def _check_line(coordinates: Sequence[Sequence[_Number]], path: str) -> Iterator[Problem]:
    distinct = {tuple(position[:2]) for position in coordinates}
    if len(distinct) < 2:
        yield Problem(path, "expected a line of at least two different positions")
    elif coordinates[0][:2] == coordinates[-1][:2]:
        text = "a closed ring: a road event is a line from upstream to downstream"
        yield Problem(path, text, is_error=False)


def _check_ends(coordinates: Sequence[Sequence[_Number]], path: str) -> Iterator[Problem]:
    """Look at a MultiPoint, which means a start and an end."""
    if len(coordinates) == 1:
        text = "one position: a MultiPoint is a start and an end"
        yield Problem(path, text, is_error=False)
    elif len(coordinates) > 2:
        text = (
            f"{len(coordinates)} positions: a MultiPoint is a start and an end, a LineString more"
        )
        yield Problem(path, text, is_error=False)
    elif coordinates[0][:2] == coordinates[1][:2]:
        yield Problem(path, "start and end are the same position", is_error=False)


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


def _is_inside(lon: _Number, lat: _Number, edges: tuple[_Number, ...]) -> bool:
    west, south, east, north = edges
    between = west - _BBOX_SLACK_DEG <= lon <= east + _BBOX_SLACK_DEG
    if west > east:  # a box across the 180th meridian
        between = lon >= west - _BBOX_SLACK_DEG or lon <= east + _BBOX_SLACK_DEG
    return between and south - _BBOX_SLACK_DEG <= lat <= north + _BBOX_SLACK_DEG
