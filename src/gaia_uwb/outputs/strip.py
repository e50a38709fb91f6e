"""Zones along a road, straightened: stations to the right, offsets upwards, each in its own scale.

From above, a zone of half a kilometre is a line: what is a few metres beside the path cannot be
seen. Here a metre across the road is as wide as many metres along it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from gaia_uwb._shared import CHI_SQUARE_90, SIGMAS_90, Array, Float64
from gaia_uwb.outputs.drawn_cones import INK, PATH, TAPER, WARNING, ZONE, DrawnCones, tidy
from gaia_uwb.outputs.road_words import hull_leads
from gaia_uwb.roadside import Edge, RoadBoundary, RoadLine, WorkZone
from gaia_uwb.zone import Region

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_SURE = "#7A4FA3"
_LONG = 4.0  # times as long as wide
Line = Callable[[Float64[Array, "K 2"]], Float64[Array, "L 2"]]
"""From points on the ground to those in the picture."""

_MARGIN = 0.04  # of the zones' length, at both ends
_STEPS, _LEAST_STEP_M = 400, 1.0  # along the zones, of lines and rings that are straightened
_MOST_BEHIND_M = 8.0  # of a closed area is shown behind the cones


def needs_strip(boundary: RoadBoundary | None) -> bool:
    """Return whether zones are too long to be seen from above, and are no area.

    Parameters
    ----------
    boundary
        The zones along the road; None where they are unknown.
    """
    if boundary is None or hull_leads(boundary):
        return False
    edges = [edge for zone in boundary.zones for edge in zone.edges]
    offset_m = np.concatenate([edge.offset_m for edge in edges])
    start_m, end_m = _extent_m(boundary)
    across_m = max(offset_m.max(), 0.0) - min(offset_m.min(), 0.0)
    return bool(end_m - start_m > _LONG * across_m)


def draw_strip(axes: Axes, boundary: RoadBoundary, cones: DrawnCones) -> Float64[Array, "P 2"]:
    """Draw what is along the road: driven paths, closed areas, bands, edges and cones.

    Parameters
    ----------
    axes
        Where to draw.
    boundary
        The zones; at least one.
    cones
        The cones with stations and offsets, see :meth:`DrawnCones.along`.

    Returns
    -------
    (P, 2)
        Stations and offsets along the edges, which names must not cover, in metres.
    """
    start_m, end_m = _extent_m(boundary)
    margin_m = max(_MARGIN * (end_m - start_m), 5.0)
    axes.set_xlim(start_m - margin_m, end_m + margin_m)
    _draw_paths(axes, boundary)
    step_m = max((end_m - start_m) / _STEPS, _LEAST_STEP_M)
    straightened = partial(_straightened, boundary.line, step_m)
    _draw_zones(axes, boundary, straightened)
    _draw_cones(axes, cones)
    _set_height(axes, boundary, cones)
    axes.set_xlabel("along the road (m)", size=9)
    axes.set_ylabel("left of the road's line (m)", size=9)
    tidy(axes)
    edges = [edge for zone in boundary.zones for edge in zone.edges]
    lines_m = [line_m for edge in edges for line_m in edge.lines]
    return np.concatenate(list(map(straightened, lines_m)))


def draw_zones(axes: Axes, boundary: RoadBoundary) -> None:
    """Draw the zones from above: closed areas, bands, edges and gaps.

    Parameters
    ----------
    axes
        Where to draw, in east and north.
    boundary
        The zones.
    """
    _draw_zones(axes, boundary, np.asarray)


class _Labels:
    """Gives each label once, so that a legend has one entry of a kind."""

    def __init__(self) -> None:
        self._given: set[str] = set()

    def __call__(self, label: str) -> str | None:
        if label in self._given:
            return None
        self._given.add(label)
        return label


def _extent_m(boundary: RoadBoundary) -> tuple[float, float]:
    return (
        min(zone.start.station_m for zone in boundary.zones),
        max(zone.end.station_m for zone in boundary.zones),
    )


def _draw_paths(axes: Axes, boundary: RoadBoundary) -> None:
    low_m, high_m = axes.get_xlim()
    for k, path in enumerate(boundary.paths):
        label = "path of the vehicle's antenna" if k == 0 else None
        axes.plot(path.station_m, path.offset_m, color=PATH, lw=1.2, label=label, zorder=1)
        arrows_m = low_m + np.array([0.06, 0.5, 0.94]) * (high_m - low_m)
        marker = ">" if path.along > 0 else "<"
        axes.plot(arrows_m, path.offset_at(arrows_m), marker, color=PATH, ms=6, zorder=1)


def _draw_zones(axes: Axes, boundary: RoadBoundary, to: Line) -> None:
    once = _Labels()
    for zone in boundary.zones:
        _draw_areas(axes, to, zone, once)
        for edge in zone.edges:
            _draw_edge(axes, to, edge, once)


def _draw_areas(axes: Axes, to: Line, zone: WorkZone, once: _Labels) -> None:
    if zone.closed is not None:
        _fill(axes, to, _rings(zone.closed.region), fc=ZONE, alpha=0.4, zorder=1.5,
              label=once("closed to traffic"))  # fmt: skip
        for region, style, label in (
            (zone.closed.inner, "-", "closed for sure (90 %)"),
            (zone.closed.outer, "-.", "contains what is closed (90 %)"),
        ):
            for ring_m in _rings(region):
                axes.plot(*to(ring_m).T, style, color=_SURE, lw=1.0, label=once(label), zorder=2)
    if zone.open_strip is not None:
        _fill(axes, to, _rings(zone.open_strip), fc=ZONE, alpha=0.18, zorder=1.5,
              label=once("behind the edge: no width known"))  # fmt: skip


def _rings(region: Region) -> Iterator[Float64[Array, "_ 2"]]:
    """Yield all rings of a region, closed."""
    for rings_m in region.polygons:
        yield from map(_closed, rings_m)


def _closed(ring_m: Float64[Array, "K 2"]) -> Float64[Array, "L 2"]:
    return np.concatenate([ring_m, ring_m[:1]])


def _fill(axes: Axes, to: Line, rings_m: Iterable[Float64[Array, "_ 2"]], **look: Any) -> None:
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    paths = [Path(to(ring_m), closed=True) for ring_m in rings_m]
    if paths:
        axes.add_patch(PathPatch(Path.make_compound_path(*paths), lw=0, **look))


def _draw_edge(axes: Axes, to: Line, edge: Edge, once: _Labels) -> None:
    _fill(axes, to, map(_closed, edge.band.rings), fc=INK, alpha=0.16, zorder=2,
          label=once("contains the edge (90 %)"))  # fmt: skip
    for line_m in edge.lines:
        axes.plot(*to(line_m).T, color=INK, lw=2.2, label=once("edge"), zorder=3)
    for taper in edge.tapers:
        axes.plot(*to(taper.place_m).T, color=TAPER, lw=1.2, label=once("taper"), zorder=3.5)
    for gap in edge.gaps:
        ends_m = to(gap.place_m)[[0, -1]]
        axes.plot(*ends_m.T, ":", color=INK, lw=1.6, label=once("gap"), zorder=3)


def _straightened(
    line: RoadLine, step_m: float, place_m: Float64[Array, "K 2"]
) -> Float64[Array, "L 2"]:
    """Return stations and offsets along a line on the ground, which may bend between its points."""
    from shapely import LineString, get_coordinates

    if len(place_m) < 2:
        return line.locate(place_m)
    return line.locate(get_coordinates(LineString(place_m).segmentize(step_m)))


def _reach_m(cones: DrawnCones) -> Float64[Array, "K 2"]:
    """Return half the 90 % intervals along and across the road; 0 where they are unknown."""
    # Of the 90 % ellipse in two dimensions, to 90 % in one.
    reach_m = np.abs(cones.ellipse_m - cones.position_m[:, None]).max(axis=1)
    return np.asarray(np.nan_to_num(reach_m * SIGMAS_90 / np.sqrt(CHI_SQUARE_90)))


def _draw_cones(axes: Axes, cones: DrawnCones) -> None:
    from matplotlib.collections import LineCollection

    reach_m = _reach_m(cones)
    for axis in (0, 1):
        apart_m = np.zeros_like(cones.position_m)
        apart_m[:, axis] = reach_m[:, axis]
        bars = np.stack([cones.position_m - apart_m, cones.position_m + apart_m], axis=1)
        drawn = LineCollection(list(bars), colors=cones.colours, lw=1.2, zorder=5)
        axes.add_collection(drawn, autolim=False)
    station_m, offset_m = cones.position_m.T
    axes.scatter(station_m, offset_m, s=16, c=cones.colours, label="cone, ± 90 %", zorder=6)
    if len(cones.mirror_m):
        links = LineCollection(list(cones.mirror_m), colors=WARNING, ls=":", lw=0.9, zorder=4)
        axes.add_collection(links, autolim=False)
        axes.plot(*cones.mirror_m[:, 1].T, "o", mfc="white", mec=WARNING, ms=5.5, zorder=5,
                  label="other possible position of a cone")  # fmt: skip


def _set_height(axes: Axes, boundary: RoadBoundary, cones: DrawnCones) -> None:
    """Show cones, bands and paths whole, and of error bars and closed areas what is near."""
    low_m, high_m = axes.get_xlim()
    bars_m = np.minimum(_reach_m(cones)[:, 1], _MOST_BEHIND_M)
    offset_m = cones.position_m[:, 1]
    seen = [offset_m - bars_m, offset_m + bars_m, cones.mirror_m[:, 1, 1]]
    for path in boundary.paths:
        seen.append(path.offset_m[(path.station_m > low_m) & (path.station_m < high_m)])
    for zone in boundary.zones:
        for edge in zone.edges:
            seen += [edge.band.near_m, edge.band.far_m]
    core_m = np.concatenate(seen)
    bottom_m, top_m = core_m.min(), core_m.max()
    for zone in boundary.zones:
        region = zone.open_strip if zone.closed is None else zone.closed.outer
        for ring_m in () if region is None else (r for rings in region.polygons for r in rings):
            ring_offset_m = boundary.line.locate(ring_m)[:, 1]
            bottom_m = min(bottom_m, max(ring_offset_m.min(), core_m.min() - _MOST_BEHIND_M))
            top_m = max(top_m, min(ring_offset_m.max(), core_m.max() + _MOST_BEHIND_M))
    margin_m = 0.08 * (top_m - bottom_m) + 0.3
    axes.set_ylim(bottom_m - margin_m, top_m + margin_m)
