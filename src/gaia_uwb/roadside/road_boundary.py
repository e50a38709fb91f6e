"""What a work zone is to a driver: an edge that traffic must not cross, and the area behind it.

Everything is told twice. *On the road* a place has a station, in metres along a line that follows
the road in the direction of travel, and an offset from that line, positive to its left; on the
*ground* it is east and north in metres. Both belong together: :class:`RoadLine` goes from one to
the other.

Edges, pieces, gaps and tapers are those of the estimated places of the cones. Probabilities, bands
and regions are from possible places of all cones together (:mod:`gaia_uwb.zone`).

>>> from gaia_uwb.roadside import ZoneForm
>>> ZoneForm("one-row").message
'one row of cones beside the path'
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise

import numpy as np

from gaia_uwb._shared import Array, Bool, Float64
from gaia_uwb.roadside.road_line import DrivenPath, RoadLine
from gaia_uwb.zone import Region, convex_hull, polygon_area

_CONVEX = 0.9  # of its convex hull, that an area covers at least


class ZoneForm(StrEnum):
    """How the cones of a zone stand, as seen from the road; the value is what people see."""

    ONE_ROW = "one-row"
    LANE_BETWEEN = "lane-between"
    WORKS_BETWEEN = "works-between"
    AREA = "area"

    @property
    def message(self) -> str:
        """The form in a few words."""
        return _FORMS[self]


_FORMS = {
    ZoneForm.ONE_ROW: "one row of cones beside the path",
    ZoneForm.LANE_BETWEEN: "two rows of cones, with the lane that was driven between them",
    ZoneForm.WORKS_BETWEEN: "two rows of cones on one side of the path, with the works between",
    ZoneForm.AREA: "cones around an area",
}


class RoadSide(StrEnum):
    """A side of the driven path, in the direction of travel."""

    LEFT = "left"
    RIGHT = "right"

    @property
    def sign(self) -> int:
        """Of offsets on this side: 1 on the left, -1 on the right."""
        return 1 if self is RoadSide.LEFT else -1

    def holds(self, offset_m: Float64[Array, "*shape"]) -> Bool[Array, "*shape"]:
        """Return which offsets are on this side; the line itself is taken to be on the right.

        Parameters
        ----------
        offset_m : (...)
            In metres, positive to the left.
        """
        return np.asarray((offset_m > 0) == (self is RoadSide.LEFT))


class WidthSource(StrEnum):
    """What tells how far a closed area reaches away from traffic; the value is what people see."""

    CONES = "cones"
    CLOSED_WIDTH = "closed-width"
    CLOSED_LANES = "closed-lanes"
    ROAD_EDGE = "road-edge"


@dataclass(frozen=True)
class ZoneEnd:
    """Where a zone or a taper begins or ends.

    Parameters
    ----------
    cone
        Id of the cone that stands there.
    station_m
        Along the road line, in metres.
    place_m : (2,)
        East and north of the cone, in metres.
    within_m
        Half the width, along the road, of the interval around ``station_m`` that holds the true
        station with 90 % probability; in metres.
    """

    cone: str
    station_m: float
    place_m: Float64[Array, "2"]
    within_m: float


@dataclass(frozen=True)
class EdgeBand:
    """The band across the road that holds the edge with 90 % probability, station by station.

    Parameters
    ----------
    station_m : (J,)
        Increasing, from the first cone to the last, in metres; every gap is left out.
    near_m, far_m : (J,)
        Offsets of the band's two sides, in metres: the one towards traffic and the other.
    rings : tuple of (P, 2)
        The same on the ground: one ring for each piece of the edge, counter-clockwise, not closed,
        in metres.
    """

    station_m: Float64[Array, "J"]
    near_m: Float64[Array, "J"]
    far_m: Float64[Array, "J"]
    rings: tuple[Float64[Array, "_ 2"], ...]


@dataclass(frozen=True)
class Gap:
    """A gap in an edge: longer than the cones' spacing there, such as an opening for access.

    Parameters
    ----------
    from_cone, to_cone
        Ids of the cones before and after it, in the direction of travel.
    row
        Row of ``from_cone`` among the edge's places; ``to_cone`` is in the next one.
    length_m
        Between these cones, in metres.
    usual_m
        Usual distance between cones of this edge, in metres.
    place_m : (2, 2)
        East and north of these cones, in metres.
    unlocated
        Ids of cones that were not located; when there are any, one may stand in the gap.
    """

    from_cone: str
    to_cone: str
    row: int
    length_m: float
    usual_m: float
    place_m: Float64[Array, "2 2"]
    unlocated: tuple[str, ...] = ()


@dataclass(frozen=True)
class Taper:
    """Where an edge moves sideways into the road, or out of it, over its first or last cones.

    Parameters
    ----------
    is_upstream
        Whether it leads into the zone; else it leads out.
    start, end
        Its first and last cone, in the direction of travel.
    place_m : (K, 2)
        East and north of its cones, in the direction of travel, in metres.
    length_m
        Along the road, in metres.
    width_m
        How far the edge moves across the road, in metres.
    asked_m
        The length that the manual asks for, for this width at the speed that was driven, in metres;
        NaN for a taper that leads out, for which it asks no such length.
    """

    is_upstream: bool
    start: ZoneEnd
    end: ZoneEnd
    place_m: Float64[Array, "K 2"]
    length_m: float
    width_m: float
    asked_m: float

    @property
    def is_long_enough(self) -> bool | None:
        """Whether it is as long as the manual asks; None where the manual asks for no length."""
        return None if np.isnan(self.asked_m) else self.length_m >= self.asked_m


@dataclass(frozen=True)
class FreeWidth:
    """The least width that traffic has.

    Parameters
    ----------
    least_m
        In metres: from the driven path to an edge, or from edge to edge.
    at_least_m
        With 90 % probability it is not less than this, in metres.
    station_m
        Where that is, along the road line, in metres.
    place_m : (2, 2)
        East and north of both ends of the narrowest line across, in metres.
    """

    least_m: float
    at_least_m: float
    station_m: float
    place_m: Float64[Array, "2 2"]


@dataclass(frozen=True)
class Edge:
    """A line that traffic must not cross: through the cones that face it, in travel's direction.

    Parameters
    ----------
    side
        On which side of the driven path it runs.
    side_probability
        Probability of that side; the band is given that it is right.
    cones : tuple of K str
        Ids of its cones, upstream to downstream.
    place_m : (K, 2)
        East and north of its cones, in metres.
    station_m : (K,)
        Along the road line, in metres; not decreasing.
    offset_m : (K,)
        From the road line, in metres; positive to its left.
    beside_m : (K,)
        From the nearest driven path, in metres: how far beside it each cone stands.
    lines : tuple of (L, 2)
        The edge on the ground, one line for each piece between gaps, in metres: through the cones,
        and between two cones along the road, so that it does not cut a bend. A piece of a single
        cone is one point.
    band
        Where the edge may run instead.
    gaps
        In the direction of travel.
    tapers
        At most one that leads in, and one that leads out.
    free
        Least width between the driven path and this edge.
    """

    side: RoadSide
    side_probability: float
    cones: tuple[str, ...]
    place_m: Float64[Array, "K 2"]
    station_m: Float64[Array, "K"]
    offset_m: Float64[Array, "K"]
    beside_m: Float64[Array, "K"]
    lines: tuple[Float64[Array, "_ 2"], ...]
    band: EdgeBand
    gaps: tuple[Gap, ...]
    tapers: tuple[Taper, ...]
    free: FreeWidth

    @property
    def pieces(self) -> tuple[slice, ...]:
        """The rows of ``place_m`` between gaps, in order; a piece may be a single cone."""
        cuts = [0, *(gap.row + 1 for gap in self.gaps), len(self.cones)]
        return tuple(slice(a, b) for a, b in pairwise(cuts))


@dataclass(frozen=True)
class ClosedArea:
    """The ground that is closed to traffic; the path that was driven is never inside.

    Parameters
    ----------
    region
        What is closed, by the estimated places.
    inner
        With 90 % probability all of it is closed.
    outer
        With 90 % probability nothing that is closed lies outside of it.
    width_source
        What tells how far it reaches away from traffic.
    width_m
        What was stated of that, in metres; NaN where cones or a road's edge tell it.
    """

    region: Region
    inner: Region
    outer: Region
    width_source: WidthSource
    width_m: float


@dataclass(frozen=True)
class DroveThrough:
    """The vehicle crossed an edge between two of its cones, or drove through the closed area.

    Parameters
    ----------
    probability
        That it did, at the likeliest place.
    from_station_m, to_station_m
        Between the first and the last of these cones along the road line, in metres.
    cones
        Ids of the cones that it more likely than not drove over, or past on the way through.
    """

    probability: float
    from_station_m: float
    to_station_m: float
    cones: tuple[str, ...]


@dataclass(frozen=True)
class WorkZone:
    """One work zone along the road.

    Parameters
    ----------
    form
        The form by the estimated places, or the one that was stated.
    form_probability
        Probability of every form by the possible places, whatever was stated.
    cones
        Ids of its cones, upstream to downstream.
    start, end
        Its first and last cone in the direction of travel.
    length_m
        From ``start`` to ``end`` along the road, in metres.
    edges
        One; with ``lane-between`` the left one and the right one.
    closed
        The closed area; None where nothing tells how far it reaches.
    open_strip
        Where there is no closed area: the ground just behind the edge, one lane wide, *for drawing
        only*. No area is claimed.
    lane
        Least width between the two edges of ``lane-between``; None for other forms.
    speed_mps
        Median speed of the drives along it, in metres per second; NaN where they stood or times
        are unknown.
    drove_through
        Where a drive led through it more likely than not, else None.
    """

    form: ZoneForm
    form_probability: Mapping[ZoneForm, float]
    cones: tuple[str, ...]
    start: ZoneEnd
    end: ZoneEnd
    length_m: float
    edges: tuple[Edge, ...]
    closed: ClosedArea | None
    open_strip: Region | None
    lane: FreeWidth | None
    speed_mps: float
    drove_through: DroveThrough | None


@dataclass(frozen=True)
class RoadBoundary:
    """The zones along one road.

    Parameters
    ----------
    line
        The line along the road, from which stations and offsets count.
    paths
        All drives on it, each cut where it turns back; see :class:`DrivenPath`.
    zones
        In the order of the line.
    unlocated
        Ids of the cones that no zone has: they were not located, or their positions are nothing to
        go by.
    """

    line: RoadLine
    paths: tuple[DrivenPath, ...]
    zones: tuple[WorkZone, ...]
    unlocated: tuple[str, ...]

    @property
    def hull_is_zone(self) -> bool:
        """Whether the convex hull is the zone: its cones stand around a convex area.

        Around a closed lane in a bend, the hull covers the lane that is open, too.
        """
        return all(zone.form is ZoneForm.AREA and _is_convex(zone.closed) for zone in self.zones)


def _is_convex(closed: ClosedArea | None) -> bool:
    if closed is None:
        return True
    corners_m = np.concatenate([rings[0] for rings in closed.region.polygons])
    return closed.region.area_m2 > _CONVEX * polygon_area(convex_hull(corners_m))
