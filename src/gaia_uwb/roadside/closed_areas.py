"""The ground behind an edge: what the cones enclose, or a strip as wide as was stated.

On the straightened road a closed area is one or two *strips*: between two stations, from the edge
to a far side. So possible scenes are compared station by station:

- **inner region**: between the scenes' mean edge and mean far side, less k standard deviations at
  every station and at both ends, with the least k for which it is closed *everywhere at once* in
  90 % of the scenes;
- **outer region**: the same, plus k standard deviations, and for each side on which the cones may
  stand, so that in 90 % of the scenes nothing is closed outside.

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
from gaia_uwb.roadside.zone_cones import PROBABILITY, Rows, lines_through
from gaia_uwb.zone import Region

if TYPE_CHECKING:
    from shapely import Geometry

VEHICLE_WIDTH_M = 2.0
"""Of any vehicle: its path is open that wide."""

_SIMPLIFY_M, _LEAST_M2, _DRIVEN_M = 0.005, 0.01, 0.05
_LEAST_SIGMA_M = 1e-6
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
    """What is closed on one side in every scene; distances grow away from traffic.

    Parameters
    ----------
    side
        Of the driven path.
    grid_m : (G,)
        Stations, in metres.
    near_m, far_m : (S, G)
        Distances from the line, in metres; NaN in scenes that close nothing on this side.
    first_m, last_m : (S,)
        Stations of both ends, in metres; NaN as well.
    """

    side: RoadSide
    grid_m: Float64[Array, "G"]
    near_m: Float64[Array, "S G"]
    far_m: Float64[Array, "S G"]
    first_m: Float64[Array, "S"]
    last_m: Float64[Array, "S"]

    @classmethod
    def of(
        cls,
        rows: Rows,
        far_side: FarSide | None,
        station_m: Float64[Array, "S M"],
        offset_m: Float64[Array, "S M"],
    ) -> _Strip:
        """Take the cones on one side; the far side is stated, or that of the cones behind.

        Where cones enclose the area, both sides begin at the first of all and end at the last.
        """
        side = rows.near.side
        near = rows.near.counted(offset_m)
        far = rows.behind & side.holds(offset_m)
        closing = near if far_side else near | far
        at_m = np.where(closing, station_m, np.nan)
        has_any = closing.any(axis=1)
        first, last = (np.zeros(len(at_m), dtype=np.int64) for _ in range(2))
        first[has_any] = np.nanargmin(at_m[has_any], axis=1)
        last[has_any] = np.nanargmax(at_m[has_any], axis=1)
        each = np.arange(len(at_m))
        first_m, last_m = at_m[each, first], at_m[each, last]
        if not far_side:
            for end in (first, last):
                near[each[has_any], end[has_any]] = True
                far[each[has_any], end[has_any]] = True
        grid_m = np.union1d(rows.near.cones.station_m, rows.near.grid_m)
        if has_any.any():
            grid_m = np.union1d(grid_m, [np.nanmin(first_m), np.nanmax(last_m)])
        near_m = lines_through(station_m, offset_m, near, grid_m)
        if far_side is None:
            far_m = lines_through(station_m, offset_m, far, grid_m)
        else:
            far_m = far_side(np.broadcast_to(grid_m, near_m.shape), near_m)
        return cls(side, grid_m, side.sign * near_m, side.sign * far_m, first_m, last_m)

    @cached_property
    def closes(self) -> Bool[Array, "S"]:
        """In which scenes there is ground between both ends."""
        return np.asarray(self.last_m > self.first_m)

    def bounds(self) -> tuple[Float64[Array, "S _"], ...]:
        """Return what bounds the strip in every scene; the larger, the less is closed."""
        ends = self.first_m[:, None], -self.last_m[:, None]
        return self.near_m, -self.far_m, *ends

    @cached_property
    def means(self) -> tuple[Float64[Array, "_"], ...]:
        """The mean of each of :meth:`bounds` over the scenes that close something."""
        return tuple(each[self.closes].mean(axis=0) for each in self.bounds())

    @cached_property
    def sigmas(self) -> tuple[Float64[Array, "_"], ...]:
        """Their standard deviations."""
        return tuple(each[self.closes].std(axis=0) for each in self.bounds())

    def worst(self, *, inner: bool) -> Float64[Array, "C"]:
        """Return by how many standard deviations a region has to give way to suit each scene.

        The inner region gives way to bounds above their means, the outer one to those below,
        between the ends of each of the C scenes that close something.
        """
        sign = 1.0 if inner else -1.0
        near, far, first, last = (
            sign * (bound[self.closes] - mean) / np.maximum(sigma, _LEAST_SIGMA_M)
            for bound, mean, sigma in zip(self.bounds(), self.means, self.sigmas, strict=True)
        )
        first_m, last_m = (each[self.closes, None] for each in (self.first_m, self.last_m))
        inside = (self.grid_m >= first_m) & (self.grid_m <= last_m)
        across = np.where(inside, np.maximum(near, far), -np.inf).max(axis=1)
        return np.asarray(np.maximum(across, np.maximum(first, last)[:, 0]))

    def giving_way(self, line: RoadLine, factor: float, *, inner: bool) -> Any:
        """Return the strip whose bounds are so many standard deviations from their means."""
        by = factor if inner else -factor
        near_m, far_m, first_m, last_m = (
            mean + by * sigma for mean, sigma in zip(self.means, self.sigmas, strict=True)
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
        """Return the strip between two stations on the ground, where its sides do not cross."""
        from shapely import Polygon, make_valid, union_all

        kept = (self.grid_m > first_m) & (self.grid_m < last_m)
        at_m = np.concatenate([[first_m], self.grid_m[kept], [last_m]])
        near_m, far_m = (np.interp(at_m, self.grid_m, each_m) for each_m in (near_m, far_m))
        is_open = (far_m >= near_m - _LEAST_SIGMA_M) & (last_m > first_m)
        ends = np.flatnonzero(np.diff(np.pad(is_open, 1).astype(np.int8)))
        parts = []
        for start, stop in ends.reshape(-1, 2):
            if stop - start > 1:
                part = slice(start, stop)
                there = line.place(at_m[part], self.side.sign * near_m[part])
                back = line.place(at_m[part], self.side.sign * far_m[part])
                parts.append(make_valid(Polygon(np.concatenate([there, back[::-1]]))))
        return union_all(parts)


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
    region = region_of(_estimated(line, rows, width), driven)
    if region.area_m2 < _LEAST_M2:
        return None
    strips = [_strip(line, each, width) for each in rows]
    others = [] if len(strips) > 1 else _other_side(line, rows[0], width)
    return ClosedArea(
        region=region,
        inner=region_of(_inner(line, strips), driven),
        outer=region_of(_outer(line, strips, others), driven),
        width_source=WidthSource.CONES if width is None else width.source,
        width_m=np.nan if width is None else width.width_m,
    )


def _far_side(line: RoadLine, rows: Rows, width: Width | None) -> FarSide | None:
    return None if width is None else width.far_side(line, rows.near.side)


def _strip(line: RoadLine, rows: Rows, width: Width | None) -> _Strip:
    cones, far_side = rows.near.cones, _far_side(line, rows, width)
    return _Strip.of(rows, far_side, cones.scene_station_m, cones.scene_offset_m)


def _estimated(line: RoadLine, rows: Sequence[Rows], width: Width | None) -> list[Any]:
    found = []
    for each in rows:
        cones, far_side = each.near.cones, _far_side(line, each, width)
        strip = _Strip.of(each, far_side, cones.station_m[None], cones.offset_m[None])
        ends_m = float(strip.first_m[0]), float(strip.last_m[0])
        found.append(strip.polygon(line, strip.near_m[0], strip.far_m[0], *ends_m))
    return found


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
    return region_of(_estimated(line, rows, width), driven)


def _other_side(line: RoadLine, rows: Rows, width: Width | None) -> list[_Strip]:
    """Return the same cones across the path; nothing where they are seldom there."""
    side = RoadSide.RIGHT if rows.near.side is RoadSide.LEFT else RoadSide.LEFT
    there = Rows(replace(rows.near, side=side), rows.behind)
    strip = _strip(line, there, width)
    return [strip] if strip.closes.mean() >= _LEAST_SHARE else []


def _inner(line: RoadLine, strips: Sequence[_Strip]) -> list[Any]:
    """Return what all but a few scenes have closed."""
    score = np.full(len(strips[0].first_m), -np.inf)
    for strip in strips:
        closes = strip.closes
        score[~closes] = np.inf
        if closes.any():
            score[closes] = np.maximum(score[closes], strip.worst(inner=True))
    factor = _in_most(score)
    if np.isinf(factor):
        return []
    return [strip.giving_way(line, factor, inner=True) for strip in strips]


def _outer(line: RoadLine, strips: Sequence[_Strip], others: Sequence[_Strip]) -> list[Any]:
    """Return what no scene but a few has closed."""
    score = np.full(len(strips[0].first_m), -np.inf)
    closing = [strip for strip in (*strips, *others) if strip.closes.any()]
    for strip in closing:
        score[strip.closes] = np.maximum(score[strip.closes], strip.worst(inner=False))
    if not closing:
        return []
    # Others close something across the path, where that is too unlikely to be shown.
    is_shown = np.isfinite(score)
    factor = min(_in_most(np.where(is_shown, score, np.inf)), float(score[is_shown].max()))
    return [strip.giving_way(line, factor, inner=False) for strip in closing]


def _in_most(score: Float64[Array, "S"]) -> float:
    """Return the least number that is enough for 90 % of the scenes."""
    return float(np.sort(score)[int(np.ceil(PROBABILITY * len(score))) - 1])


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
