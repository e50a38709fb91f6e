"""Geometries across the 180th meridian, cut there as RFC 7946 asks for (3.1.9).

A line from longitude 179.999 to -179.999 is a few metres long, but whatever draws it goes the other
way round the globe. Cut in two at the meridian, each piece lies on one side and is drawn right.

Shapely cuts polygons. The package antimeridian was tried: it rounds the cuts to 1 cm and leaves
pieces without area, and a zone is metres across.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby
from typing import Any, TypeAlias

import numpy as np

from gaia_uwb._shared import Array, Float64

Geometry: TypeAlias = dict[str, Any]

_DECIMALS = 9


def cut_at_antimeridian(geometry: Geometry) -> Geometry:
    """Return a geometry of which no edge runs round the globe.

    Parameters
    ----------
    geometry
        A GeoJSON Point, (Multi)LineString or (Multi)Polygon in WGS84, less than 180 degrees wide
        and not around a pole: positions further apart are neighbours across the 180th meridian.

    Returns
    -------
    dict
        The same geometry where it does not cross the meridian. Otherwise a MultiLineString or a
        MultiPolygon, whose pieces end at longitude 180 or -180; exterior rings run
        counter-clockwise, holes clockwise.

    Examples
    --------
    >>> from gaia_uwb.outputs import cut_at_antimeridian
    >>> line = {"type": "LineString", "coordinates": [[179.5, 10.0], [-179.5, 11.0]]}
    >>> cut_at_antimeridian(line)["coordinates"]
    [[[179.5, 10.0], [180.0, 10.5]], [[-180.0, 10.5], [-179.5, 11.0]]]
    """
    kind, coordinates = geometry["type"], geometry["coordinates"]
    if kind == "Point":
        return geometry
    wrapped: dict[str, list[Any]] = {
        "LineString": [[coordinates]],
        "MultiLineString": [coordinates],
        "Polygon": [coordinates],
    }
    parts = wrapped.get(kind) or coordinates
    if not any(_crosses(positions) for rings in parts for positions in rings):
        return geometry
    if kind.endswith("LineString"):
        lines = [piece for line in parts[0] for piece in _cut_line(line)]
        return {"type": "MultiLineString", "coordinates": lines}
    pieces = [piece for rings in parts for piece in _cut_polygon(rings)]
    return {"type": "MultiPolygon", "coordinates": pieces}


def bounding_box(geometries: Sequence[Geometry]) -> list[float]:
    """Return ``[west, south, east, north]`` of geometries; across the meridian west exceeds east.

    Parameters
    ----------
    geometries
        At least one; as for :func:`cut_at_antimeridian`, cut or not, all within 180 degrees.
    """
    positions = np.array([p for each in geometries for p in _positions(each["coordinates"])])
    lon_deg, lat_deg = positions.T
    # Counted from any one of them, none is on the other side of the globe.
    from_first_deg = (lon_deg - lon_deg[0] + 180.0) % 360.0 - 180.0
    west, east = lon_deg[0] + from_first_deg.min(), lon_deg[0] + from_first_deg.max()
    edges = [_normal(west), lat_deg.min(), _normal(east), lat_deg.max()]
    return [round(float(edge), _DECIMALS) for edge in edges]


def _crosses(positions: Sequence[Sequence[float]]) -> bool:
    lon_deg = np.array([position[0] for position in positions])
    return bool((np.abs(np.diff(lon_deg)) > 180.0).any())


def _cut_line(line: Sequence[Sequence[float]]) -> Iterator[list[list[float]]]:
    """Yield the pieces of a line, in its order; it may run over itself, so nothing is merged."""
    positions = _side_by_side(line)
    turns = np.round(positions[:, 0] / 360.0)
    start, piece = positions[0], [positions[0] - [turns[0] * 360.0, 0.0]]
    for turn, next_turn, end in zip(turns, turns[1:], positions[1:], strict=False):
        if next_turn != turn:
            meridian_deg = 180.0 * (turn + next_turn)
            share = (meridian_deg - start[0]) / (end[0] - start[0])
            cut = np.array([meridian_deg, start[1] + share * (end[1] - start[1])])
            yield from _longer_than_a_point([*piece, cut - [turn * 360.0, 0.0]])
            piece = [cut - [next_turn * 360.0, 0.0]]
        piece.append(end - [next_turn * 360.0, 0.0])
        start = end
    yield from _longer_than_a_point(piece)


def _longer_than_a_point(positions: Sequence[Float64[Array, "2"]]) -> Iterator[list[list[float]]]:
    listed = [position for position, _ in groupby(_listed(positions))]
    if len(listed) > 1:
        yield listed


def _cut_polygon(rings: Sequence[Any]) -> Iterator[list[list[list[float]]]]:
    """Yield the rings of each piece of a polygon."""
    from shapely import affinity, box, get_parts, make_valid
    from shapely.geometry import Polygon
    from shapely.geometry.polygon import orient

    ends = np.cumsum([len(ring) for ring in rings])[:-1]
    # A hole follows the exterior, and so lands on the same turn around the globe.
    outer, *holes = np.split(_side_by_side([position for ring in rings for position in ring]), ends)
    world = box(-180.0, -90.0, 180.0, 90.0)
    # An outline that touches itself becomes several polygons, and perhaps lines between them.
    for part in get_parts(get_parts(make_valid(Polygon(outer, holes)))):
        for turn_deg in (0.0, -360.0, 360.0):
            for piece in get_parts(affinity.translate(part, xoff=turn_deg).intersection(world)):
                if piece.area > 0.0:
                    turned = orient(piece)
                    yield [_listed(ring.coords) for ring in (turned.exterior, *turned.interiors)]


def _side_by_side(positions: Sequence[Sequence[float]]) -> Float64[Array, "K 2"]:
    """Return positions with longitudes beyond 180, so that neighbours are neighbours."""
    moved = np.array(positions, dtype=np.float64)
    turns = np.round((np.unwrap(moved[:, 0], period=360.0) - moved[:, 0]) / 360.0)
    moved[:, 0] += 360.0 * turns  # exact, so that a ring stays closed
    return moved


def _listed(coordinates: Any) -> list[list[float]]:
    positions: list[list[float]] = np.array(coordinates).round(_DECIMALS).tolist()
    return positions


def _positions(coordinates: Any) -> Iterator[Sequence[float]]:
    if isinstance(coordinates[0], float):
        yield coordinates
    else:
        for each in coordinates:
            yield from _positions(each)


def _normal(lon_deg: float) -> float:
    """Return a longitude within 180 degrees, and 180 itself as it is."""
    return lon_deg if abs(lon_deg) <= 180.0 else (lon_deg + 180.0) % 360.0 - 180.0
