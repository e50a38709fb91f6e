"""The ground behind an edge: what the cones enclose, or a strip as wide as was stated.

On the straightened road a closed area is one or two *strips*: between two stations, from the edge
to a far side. So possible scenes are compared station by station:

- **inner region**: at every station the part that all but a few scenes have closed, with as few
  left out as leave it right *everywhere at once* in 90 % of the scenes;
- **outer region**: the same for what no scene but a few has closed, for each side on which the
  cones may stand, together.

What was driven over is taken out of all three, with half the width of a vehicle on either side: it
was open when it was driven.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from gaia_uwb._shared import Array, Bool, Float64
from gaia_uwb.roadside.road_boundary import ClosedArea, RoadSide, WidthSource
from gaia_uwb.roadside.road_line import RoadLine
from gaia_uwb.roadside.zone_cones import PROBABILITY, Rows
from gaia_uwb.zone import Region

if TYPE_CHECKING:
    from shapely import Geometry

VEHICLE_WIDTH_M = 2.0
"""Of any vehicle: its path is open that wide."""

_SIMPLIFY_M, _LEAST_M2, _DRIVEN_M = 0.005, 0.01, 0.05
_LEAST_SHARE = 0.5 * (1.0 - PROBABILITY)  # of the scenes, for a side to be in the outer region

FarSide = Callable[[Float64[Array, "*shape"], Float64[Array, "*shape"]], Float64[Array, "*shape"]]
"""From stations and the edge's distances to the left of the line to those of the far side."""


@dataclass(frozen=True)
class Width:
    """How far a zone of one row reaches away from traffic.

    Parameters
    ----------
    source
        Who says so.
    width_m
        In metres; NaN for a road's edge.
    road_edge_m : (E, 2), optional
        East and north of a road's edge, in metres.
    """

    source: WidthSource
    width_m: float
    road_edge_m: Float64[Array, "E 2"] | None = None

    def far_side(self, line: RoadLine, side: RoadSide) -> FarSide:
        """Return where the far side is, given the edge.

        Parameters
        ----------
        line
            Along the road.
        side
            Of the driven path.
        """
        if self.road_edge_m is None:
            return lambda station_m, near_m: near_m + side.sign * self.width_m
        road_m = line.locate(_densified(self.road_edge_m))
        at_m, offset_m = road_m[np.argsort(road_m[:, 0], kind="stable")].T

        def far_side(
            station_m: Float64[Array, "*shape"], near_m: Float64[Array, "*shape"]
        ) -> Float64[Array, "*shape"]:
            far_m = np.interp(station_m, at_m, offset_m, left=np.nan, right=np.nan)
            return np.where(np.isnan(far_m), near_m, far_m)

        return far_side


def _densified(line_m: Float64[Array, "E 2"]) -> Float64[Array, "_ 2"]:
    from shapely import LineString, get_coordinates, segmentize

    return np.asarray(get_coordinates(segmentize(LineString(line_m), 2.0)))


@dataclass(frozen=True)
class _Strip:
    """What is closed on one side: by estimate, and in every scene; ``away`` grows from traffic.

    Parameters
    ----------
    side
        Of the driven path.
    grid_m : (G,)
        Stations, in metres.
    near_m, far_m : (G,)
        By the estimated places, away from the line, in metres.
    scene_near_m, scene_far_m : (S, G)
        In the scenes; NaN in those that close nothing on this side.
    first_m, last_m : (S,)
        Stations of both ends, in metres.
    """

    side: RoadSide
    grid_m: Float64[Array, "G"]
    near_m: Float64[Array, "G"]
    far_m: Float64[Array, "G"]
    scene_near_m: Float64[Array, "S G"]
    scene_far_m: Float64[Array, "S G"]
    first_m: Float64[Array, "S"]
    last_m: Float64[Array, "S"]

    @classmethod
    def of(cls, rows: Rows, side: RoadSide, far_side: FarSide | None) -> _Strip:
        """Take the cones on one side; the far side is that of the cones behind, or stated."""
        near, far = rows.near, rows.far
        first_m, last_m = near.scene_ends_m() if far_side else _both_ends(rows)
        around_m = [np.nanmin(first_m), np.nanmax(last_m)] if np.isfinite(first_m).any() else []
        grid_m = np.union1d(np.union1d(near.grid_m, far.grid_m), around_m)
        near_m, scene_near_m = near.line_m(grid_m), near.scene_lines_m(grid_m)
        if far_side is None:
            far_m, scene_far_m = far.line_m(grid_m), far.scene_lines_m(grid_m)
        else:
            far_m = far_side(grid_m, near_m)
            scene_far_m = far_side(np.broadcast_to(grid_m, scene_near_m.shape), scene_near_m)
        sign = side.sign
        return cls(side, grid_m, sign * near_m, sign * far_m, sign * scene_near_m,
                   sign * scene_far_m, first_m, last_m)  # fmt: skip

    @cached_property
    def closes(self) -> Bool[Array, "S"]:
        """In which scenes there is ground between both ends."""
        return np.asarray(self.last_m > self.first_m)

    def bounds(self) -> tuple[Float64[Array, "S _"], ...]:
        """Return what bounds the strip in every scene; the larger, the less is closed."""
        ends = self.first_m[:, None], -self.last_m[:, None]
        return self.scene_near_m, -self.scene_far_m, *ends

    def worst(self, ranks: Sequence[Float64[Array, "S _"]]) -> Float64[Array, "S"]:
        """Return the highest rank of each scene that closes something, between its own ends."""
        near, far, first, last = ranks
        first_m, last_m = (each[self.closes, None] for each in (self.first_m, self.last_m))
        inside = (self.grid_m >= first_m) & (self.grid_m <= last_m)
        across = np.where(inside, np.maximum(near, far), 0.0).max(axis=1)
        return np.asarray(np.maximum(across, np.maximum(first, last)[:, 0]))

    def at_level(self, line: RoadLine, level: float, *, inner: bool) -> Any:
        """Return the strip that a share of the scenes holds at each of its bounds."""
        n = np.count_nonzero(self.closes)
        below = int(np.clip(np.ceil(level * n), 1, n))  # so many scenes a bound is right for
        row = below - 1 if inner else n - below
        near_m, far_m, first_m, last_m = (
            np.sort(each[self.closes], axis=0)[row] for each in self.bounds()
        )
        return self.polygon(line, near_m, -far_m, float(first_m[0]), float(-last_m[0]))

    def polygon(
        self,
        line: RoadLine,
        near_m: Float64[Array, "G"],
        far_m: Float64[Array, "G"],
        first_m: float,
        last_m: float,
    ) -> Any:
        """Return the strip between two stations on the ground."""
        from shapely import Polygon, make_valid

        kept = (self.grid_m > first_m) & (self.grid_m < last_m)
        at_m = np.concatenate([[first_m], self.grid_m[kept], [last_m]])
        near_m = np.interp(at_m, self.grid_m, near_m)
        far_m = np.maximum(np.interp(at_m, self.grid_m, far_m), near_m)
        if last_m <= first_m or not (far_m > near_m).any():
            return Polygon()
        sign = self.side.sign
        there, back = line.place(at_m, sign * near_m), line.place(at_m, sign * far_m)
        return make_valid(Polygon(np.concatenate([there, back[::-1]])))


def _both_ends(rows: Rows) -> tuple[Float64[Array, "S"], Float64[Array, "S"]]:
    ends = [row.scene_ends_m() for row in (rows.near, rows.far)]
    return np.fmin(ends[0][0], ends[1][0]), np.fmax(ends[0][1], ends[1][1])


def closed_area(
    line: RoadLine, driven: Geometry, rows: Sequence[Rows], width: Width | None
) -> ClosedArea | None:
    """Return what is closed, and what is with 90 % probability; None where it has no area.

    Parameters
    ----------
    line
        Along the road.
    driven
        The ground that was driven over: from :func:`driven_ground`.
    rows
        The rows on each side on which the zone is.
    width
        What was stated of one row's width; None where cones enclose the area.
    """
    strips = [_strip(line, each, each.near.side, width) for each in rows]
    found = [s.polygon(line, s.near_m, s.far_m, *_estimated_ends(s, rows)) for s in strips]
    region = region_of(found, driven)
    if region.area_m2 < _LEAST_M2:
        return None
    others = [] if len(strips) > 1 else [_other_side(line, rows[0], width)]
    source = WidthSource.CONES if width is None else width.source
    return ClosedArea(
        region=region,
        inner=region_of(_inner(line, strips), driven),
        outer=region_of(_outer(line, strips, [s for s in others if s is not None]), driven),
        width_source=source,
        width_m=np.nan if width is None else width.width_m,
    )


def _strip(line: RoadLine, rows: Rows, side: RoadSide, width: Width | None) -> _Strip:
    return _Strip.of(rows, side, None if width is None else width.far_side(line, side))


def _estimated_ends(strip: _Strip, rows: Sequence[Rows]) -> tuple[float, float]:
    row = next(each.near for each in rows if each.near.side is strip.side)
    at_m = row.cones.station_m[row.rows]
    return float(at_m[0]), float(at_m[-1])


def open_strip(
    line: RoadLine, driven: Geometry, rows: Sequence[Rows], lane_width_m: float
) -> Region:
    """Return the ground just behind edges, one lane wide, for drawing.

    Parameters
    ----------
    line, driven, rows
        As in :func:`closed_area`.
    lane_width_m
        In metres.
    """
    width = Width(WidthSource.CLOSED_LANES, lane_width_m)
    strips = [_strip(line, each, each.near.side, width) for each in rows]
    found = [s.polygon(line, s.near_m, s.far_m, *_estimated_ends(s, rows)) for s in strips]
    return region_of(found, driven)


def _other_side(line: RoadLine, rows: Rows, width: Width | None) -> _Strip | None:
    """Return the same cones across the path; None where they are seldom there."""
    side = RoadSide.RIGHT if rows.near.side is RoadSide.LEFT else RoadSide.LEFT
    there = Rows(replace(rows.near, side=side), replace(rows.far, side=side))
    strip = _strip(line, there, side, width)
    return strip if strip.closes.mean() >= _LEAST_SHARE else None


def _inner(line: RoadLine, strips: Sequence[_Strip]) -> list[Any]:
    """Return what all but a few scenes have closed."""
    score = np.zeros(len(strips[0].first_m))
    for strip in strips:
        bounds = strip.bounds()
        closes = strip.closes
        score[~closes] = np.inf
        ranks = [_rank(each[closes]) for each in bounds]
        score[closes] = np.maximum(score[closes], strip.worst(ranks))
    level = float(np.sort(score)[int(np.ceil(PROBABILITY * len(score))) - 1])
    if level > 1.0:
        return []
    return [strip.at_level(line, level, inner=True) for strip in strips]


def _outer(line: RoadLine, strips: Sequence[_Strip], others: Sequence[_Strip]) -> list[Any]:
    """Return what no scene but a few has closed."""
    score = np.zeros(len(strips[0].first_m))
    known = np.zeros(len(score), dtype=np.bool_)
    for strip in (*strips, *others):
        closes = strip.closes
        known |= closes
        ranks = [_rank(-each[closes]) for each in strip.bounds()]
        score[closes] = np.maximum(score[closes], strip.worst(ranks))
    score[~known] = np.inf  # they close something across the path, where it is unlikely
    level = float(np.sort(score)[int(np.ceil(PROBABILITY * len(score))) - 1])
    level = min(level, 1.0)
    return [strip.at_level(line, level, inner=False) for strip in (*strips, *others)]


def _rank(value: Float64[Array, "S G"]) -> Float64[Array, "S G"]:
    """Return in which share of the scenes each value is not exceeded, column by column."""
    order = np.argsort(value, axis=0, kind="stable")
    rank = np.empty(value.shape)
    share = np.arange(1, len(value) + 1) / max(len(value), 1)
    np.put_along_axis(rank, order, np.broadcast_to(share[:, None], value.shape), axis=0)
    return rank


def driven_ground(paths_m: Sequence[Float64[Array, "_ 2"]]) -> Geometry:
    """Return the ground that vehicles drove over.

    Parameters
    ----------
    paths_m : sequence of (P, 2)
        Of all drives, with their turns, in metres.
    """
    from shapely import LineString, MultiLineString

    lines = [LineString(path_m).simplify(_DRIVEN_M) for path_m in paths_m if len(path_m) > 1]
    return MultiLineString(lines).buffer(0.5 * VEHICLE_WIDTH_M, quad_segs=4)


def region_of(found: Sequence[Any], driven: Geometry) -> Region:
    """Return polygons without the ground that was driven over.

    Parameters
    ----------
    found
        Polygons, or collections that hold some.
    driven
        From :func:`driven_ground`.
    """
    from shapely import get_parts, union_all
    from shapely.geometry.polygon import orient

    left = union_all(list(found)).difference(driven).simplify(_SIMPLIFY_M)
    polygons = [
        orient(part)
        for part in get_parts(get_parts(left))
        if part.geom_type == "Polygon" and part.area >= _LEAST_M2
    ]
    rings = tuple(
        tuple(np.array(ring.coords)[:-1] for ring in (part.exterior, *part.interiors))
        for part in polygons
    )
    return Region(rings, float(sum(part.area for part in polygons)))
