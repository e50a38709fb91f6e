"""One work zone along the road: its cones, its line and its edges, in the order of travel.

A log may hold several. The line is the vehicle's path from abeam of the first device that a driver
meets to abeam of the last one, as the specifications ask for: a road event's geometry is the whole
path along it, from upstream to downstream.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gaia_uwb._shared import Array, Float64
from gaia_uwb.estimate import AnchorFix
from gaia_uwb.roadside import RoadBoundary
from gaia_uwb.wzdx.travel import stretch

_FARTHEST_M = 1e7  # no place of a site is farther off
_LONGEST_TEXT = 1000


@dataclass(frozen=True)
class RoadZone:
    """What a reconstruction says of one zone along the road.

    Parameters
    ----------
    cones
        Ids of its cones, upstream to downstream.
    within_m
        Of its start and its end: half the width of the 90 % interval along the road, in metres;
        NaN where it is unknown.
    edges_m : tuple of (L, 2)
        The edges in the direction of travel, in pieces between gaps, in metres.
    closed_m
        Polygons of the closed area, each with its rings, in metres; none where it is unknown.
    """

    cones: tuple[str, ...]
    within_m: tuple[float, float]
    edges_m: tuple[Float64[Array, "_ 2"], ...]
    closed_m: tuple[tuple[Float64[Array, "_ 2"], ...], ...]

    def turned(self) -> RoadZone:
        """Return the zone as seen by those who drive the other way."""
        return replace(
            self,
            cones=self.cones[::-1],
            within_m=self.within_m[::-1],
            edges_m=tuple(line_m[::-1] for line_m in reversed(self.edges_m)),
        )


@dataclass(frozen=True)
class FeedPart:
    """One work zone: a road event of a feed.

    Parameters
    ----------
    cones
        The located anchors, in the order in which the vehicle passed them; at least two.
    along_m : (K,)
        Where along the path each was passed, in metres from the start of the line.
    line_m : (P, 2)
        The vehicle's path from the first cone to the last one, in metres.
    road
        What is known of its edges; None where that is unknown.
    """

    cones: tuple[AnchorFix, ...]
    along_m: Float64[Array, "K"]
    line_m: Float64[Array, "P 2"]
    road: RoadZone | None


def road_zones(boundary: RoadBoundary | None) -> tuple[RoadZone, ...]:
    """Return what a reconstruction says of its zones; none where they are unknown.

    Parameters
    ----------
    boundary
        The zones along the road.
    """
    return tuple(
        RoadZone(
            cones=zone.cones,
            within_m=(zone.start.within_m, zone.end.within_m),
            edges_m=tuple(line_m for edge in zone.edges for line_m in edge.lines),
            closed_m=() if zone.closed is None else zone.closed.region.polygons,
        )
        for zone in (() if boundary is None else boundary.zones)
    )


def read_road_zones(road: Any) -> tuple[RoadZone, ...]:
    """Return the same from the member ``road_boundary`` of a report.

    Parameters
    ----------
    road
        What was read of it; None where there was none.

    Raises
    ------
    KeyError, TypeError, ValueError
        If it is not what was written.
    """
    return () if road is None else tuple(map(_read_zone, _list(road["zones"])))


def _read_zone(zone: Any) -> RoadZone:
    ends = [zone[name]["within_m"] for name in ("start", "end")]
    start_m, end_m = (np.nan if within_m is None else float(within_m) for within_m in ends)
    closed = zone["closed"]
    return RoadZone(
        cones=tuple(map(_text, _list(zone["cones"]))),
        within_m=(start_m, end_m),
        edges_m=tuple(_places(line) for edge in zone["edges"] for line in edge["lines"]),
        closed_m=tuple(
            tuple(map(_places, rings))
            for rings in ([] if closed is None else closed["region"]["polygons_m"])
        ),
    )


def _list(value: object) -> list[Any]:
    if not isinstance(value, list):
        raise TypeError("expected a list")
    return value


def _text(value: object) -> str:
    if not isinstance(value, str) or len(value) > _LONGEST_TEXT:
        raise ValueError(f"expected text of at most {_LONGEST_TEXT} characters")
    return value


def _places(value: object) -> Float64[Array, "_ 2"]:
    places_m = np.array(value, dtype=np.float64).reshape(-1, 2)
    if not (np.abs(places_m) <= _FARTHEST_M).all():
        raise ValueError(f"expected positions within {_FARTHEST_M:g} m")
    return places_m


def make_parts(
    path_m: Float64[Array, "T 2"],
    cones: Sequence[AnchorFix],
    at_m: Float64[Array, "N"],
    zones: Sequence[RoadZone],
) -> tuple[FeedPart, ...]:
    """Return the zones in the order in which they were driven past.

    Parameters
    ----------
    path_m : (T, 2)
        East and north of the path, in metres.
    cones
        The N located ones.
    at_m : (N,)
        Distance along the path at which each was passed, in metres.
    zones
        What is known of the zones along the road.

    Returns
    -------
    tuple of FeedPart
        One for each zone with two cones or more and a length; without any, one for all cones, or
        none where these have no length either.
    """
    ids = [cone.anchor_id for cone in cones]
    members = [_members(ids, at_m, zone, zones) for zone in zones]
    found = [_part(path_m, cones, at_m, rows, zone)
             for rows, zone in zip(members, zones, strict=True)]  # fmt: skip
    parts = sorted((part for part in found if part is not None), key=lambda part: part[0])
    if not parts:
        only = zones[0] if len(zones) == 1 else None
        whole = _part(path_m, cones, at_m, np.arange(len(cones)), only)
        parts = [] if whole is None else [whole]
    return tuple(part for _, part in parts)


def _members(
    ids: Sequence[str], at_m: Float64[Array, "N"], zone: RoadZone, zones: Sequence[RoadZone]
) -> Array:
    """Return the rows of a zone's cones, and of those of no zone that were passed within it.

    A cone whose ranges fit no position shapes no edge, but it is a device there.
    """
    own = np.array([name in zone.cones for name in ids])
    if own.any():
        of_none = np.array([not any(name in each.cones for each in zones) for name in ids])
        own |= of_none & (at_m >= at_m[own].min()) & (at_m <= at_m[own].max())
    return np.flatnonzero(own)


def _part(
    path_m: Float64[Array, "T 2"],
    cones: Sequence[AnchorFix],
    at_m: Float64[Array, "N"],
    rows: Array,
    road: RoadZone | None,
) -> tuple[float, FeedPart] | None:
    """Return where along the path a zone begins, and the zone; None if it has no length."""
    if len(rows) < 2:
        return None
    own_m = at_m[rows]
    start_m = float(own_m.min())
    line_m = stretch(path_m, start_m, float(own_m.max()))
    if len(line_m) < 2:
        return None
    order = np.argsort(own_m, kind="stable")
    if road is not None:
        at = {cones[k].anchor_id: float(at_m[k]) for k in rows}
        own = [at[name] for name in road.cones if name in at]
        if own and own[0] > own[-1]:  # the road's line is another pass, the other way
            road = road.turned()
    passed = tuple(cones[k] for k in rows[order])
    return start_m, FeedPart(passed, own_m[order] - start_m, line_m, road)
