"""Zones along a road made by hand, for the tests of what is written about them.

>>> boundary = make_road(make_zone(STRAIGHT))
>>> [zone.form.value for zone in boundary.zones], boundary.zones[0].length_m
(['one-row'], 180.0)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from factories import SITE, make_fix, make_reconstruction
from gaia_uwb.reconstruction import Reconstruction
from gaia_uwb.roadside import (
    ClosedArea,
    DrivenPath,
    DroveThrough,
    Edge,
    EdgeBand,
    FreeWidth,
    Gap,
    RoadBoundary,
    RoadLine,
    RoadSide,
    Taper,
    WidthSource,
    WorkZone,
    ZoneEnd,
    ZoneForm,
)
from gaia_uwb.scene import LocalFrame
from gaia_uwb.zone import Region, make_boundary

BAND_M = 0.25
"""Half the width of every band here."""
STRAIGHT = RoadLine.through(np.array([[-20.0, -4.0], [400.0, -4.0]]))
AT_M = np.array([100.0, 120.0, 140.0, 160.0, 180.0, 240.0, 260.0, 280.0])
"""Stations of the cones of a zone: 20 m apart, with a gap of 60 m."""
OTHER_M = np.array([0.5, -7.0])
"""From the place of a cone to its mirror position."""
BESIDE_M = np.array([6.0, 4.2, 3.0, 3.1, 2.9, 3.0, 3.0, 3.0])
"""How far beside the path they stand: the first three are a taper."""


def bend(radius_m: float = 800.0, length_m: float = 400.0) -> RoadLine:
    """Return a road that bends to the left, from the origin to the north."""
    angle = np.linspace(0.0, length_m / radius_m, 81)
    return RoadLine.through(
        radius_m * np.column_stack([np.cos(angle) - 1.0, np.sin(angle)]) + [0.0, -40.0]
    )


def s_curve(length_m: float = 400.0) -> RoadLine:
    """Return a road that bends to the left, then to the right."""
    along_m = np.linspace(0.0, length_m, 201)
    return RoadLine.through(np.column_stack([along_m, 25.0 * np.sin(along_m * np.pi / 200.0)]))


def ids_of(count: int, prefix: str = "cone") -> tuple[str, ...]:
    return tuple(f"{prefix}-{k}" for k in range(count))


def make_edge(
    line: RoadLine,
    ids: Sequence[str],
    *,
    side: RoadSide = RoadSide.RIGHT,
    station_m: np.ndarray = AT_M,
    beside_m: np.ndarray = BESIDE_M,
    taper_rows: tuple[int, int] | None = (0, 2),
    unlocated: tuple[str, ...] = (),
    side_probability: float = 1.0,
) -> Edge:
    """Return an edge; where cones are more than 30 m apart it has a gap."""
    offset_m = side.sign * beside_m
    place_m = line.place(station_m, offset_m)
    gaps = tuple(
        Gap(ids[k], ids[k + 1], int(k), float(np.hypot(*(place_m[k + 1] - place_m[k]))), 20.0,
            place_m[k : k + 2], unlocated)
        for k in np.flatnonzero(np.diff(station_m) > 30.0)
    )  # fmt: skip
    cuts = [0, *(gap.row + 1 for gap in gaps), len(ids)]
    rows = [slice(a, b) for a, b in pairwise(cuts)]
    at_m = np.concatenate([np.linspace(*station_m[r][[0, -1]], 9) for r in rows])
    middle_m = np.interp(at_m, station_m, offset_m)
    least = int(np.argmin(beside_m))
    tapers = ()
    if taper_rows is not None:
        first, last = taper_rows
        tapers = (Taper(
            True, end_at(ids[first], station_m[first], place_m[first]),
            end_at(ids[last], station_m[last], place_m[last]), place_m[first : last + 1],
            float(station_m[last] - station_m[first]), float(beside_m[first] - beside_m[last]),
            78.0,
        ),)  # fmt: skip
    return Edge(
        side=side, side_probability=side_probability, cones=tuple(ids), place_m=place_m,
        station_m=station_m, offset_m=offset_m, beside_m=beside_m,
        lines=tuple(place_m[r] for r in rows),
        band=EdgeBand(at_m, middle_m - side.sign * BAND_M, middle_m + side.sign * BAND_M,
                      tuple(_ring(line, station_m[r], offset_m[r]) for r in rows)),
        gaps=gaps, tapers=tapers,
        free=FreeWidth(float(beside_m.min()), float(beside_m.min()) - BAND_M,
                       float(station_m[least]),
                       line.place(np.full(2, station_m[least]), np.array([0.0, offset_m[least]]))),
    )  # fmt: skip


def end_at(cone: str, station_m: float, place_m: np.ndarray) -> ZoneEnd:
    return ZoneEnd(cone, float(station_m), place_m, 0.2)


def _ring(line: RoadLine, station_m: np.ndarray, offset_m: np.ndarray) -> np.ndarray:
    """Return the band about a piece as a ring, counter-clockwise."""
    low_m = line.place(station_m, offset_m - BAND_M)
    high_m = line.place(station_m, offset_m + BAND_M)
    return np.concatenate([low_m, high_m[::-1]])


def strip(line: RoadLine, from_m: float, to_m: float, offsets_m: tuple[float, float]) -> Region:
    """Return the ground between two stations and two offsets."""
    at_m = np.linspace(from_m, to_m, 21)
    low_m = line.place(at_m, np.full(21, min(offsets_m)))
    high_m = line.place(at_m, np.full(21, max(offsets_m)))
    ring_m = np.concatenate([low_m, high_m[::-1]])
    return Region(((ring_m,),), abs(offsets_m[1] - offsets_m[0]) * (to_m - from_m))


def closed_strip(line: RoadLine, from_m: float = 100.0, to_m: float = 280.0) -> ClosedArea:
    """Return a closed area right of the road, as wide as was stated."""
    return ClosedArea(
        region=strip(line, from_m, to_m, (-3.0, -6.6)),
        inner=strip(line, from_m + 1.0, to_m - 1.0, (-3.3, -6.3)),
        outer=strip(line, from_m - 1.0, to_m + 1.0, (-2.7, -6.9)),
        width_source=WidthSource.CLOSED_WIDTH,
        width_m=3.6,
    )


def make_zone(
    line: RoadLine,
    *edges: Edge,
    form: ZoneForm = ZoneForm.ONE_ROW,
    probability: Mapping[ZoneForm, float] | None = None,
    closed: ClosedArea | None = None,
    drove_through: DroveThrough | None = None,
    speed_mps: float = 25.0,
) -> WorkZone:
    """Return a zone with these edges, by default one row on the right without a width."""
    edges = edges or (make_edge(line, ids_of(len(AT_M))),)
    ends = [(e.station_m[k], e.cones[k], e.place_m[k]) for e in edges for k in (0, -1)]
    (first_m, first, start_m), (last_m, last, end_m) = min(ends, key=_at), max(ends, key=_at)
    share = dict.fromkeys(ZoneForm, 0.0) | {form: 1.0} | dict(probability or {})
    lane = None
    if form is ZoneForm.LANE_BETWEEN:
        across_m = line.place(np.full(2, first_m), np.array([edges[0].offset_m[0],
                                                             edges[1].offset_m[0]]))  # fmt: skip
        lane = FreeWidth(6.0, 5.5, float(first_m), across_m)
    return WorkZone(
        form=form, form_probability=share,
        cones=tuple(cone for edge in edges for cone in edge.cones),
        start=end_at(first, first_m, start_m), end=end_at(last, last_m, end_m),
        length_m=float(last_m - first_m), edges=edges, closed=closed,
        open_strip=None if closed else strip(line, first_m, last_m, (-3.0, -6.6)),
        lane=lane, speed_mps=speed_mps, drove_through=drove_through,
    )  # fmt: skip


def _at(end: tuple[float, str, np.ndarray]) -> float:
    return float(end[0])


def lane_between(line: RoadLine) -> WorkZone:
    """Return two rows with the driven lane between them."""
    n, beside_m = len(AT_M), np.full(len(AT_M), 3.0)
    left, right = (
        make_edge(line, ids_of(n, side.value), side=side, beside_m=beside_m, taper_rows=None)
        for side in RoadSide
    )
    return make_zone(line, left, right, form=ZoneForm.LANE_BETWEEN)


def make_road(
    *zones: WorkZone, line: RoadLine = STRAIGHT, unlocated: tuple[str, ...] = ()
) -> RoadBoundary:
    """Return zones along a road that was driven once, in the direction of its line."""
    offset_m = np.zeros(len(line.vertex_m))
    path = DrivenPath("a drive", 1, line.station_m / 25.0, line.vertex_m, line.station_m, offset_m)
    return RoadBoundary(line, (path,), zones, unlocated)


def make_road_result(
    boundary: RoadBoundary, *, frame: LocalFrame | None = SITE, name: str = "a drive"
) -> Reconstruction:
    """Return a drive along the road past the cones of its zones."""
    edges = [edge for zone in boundary.zones for edge in zone.edges]
    ids = tuple(cone for edge in edges for cone in edge.cones)
    place_m = np.concatenate([edge.place_m for edge in edges])
    spread_m2 = np.diag([0.02, 0.02])
    fixes = {k: make_fix(i, p, covariance_m2=spread_m2, mirror_position_m=p + OTHER_M)
             for k, (i, p) in enumerate(zip(ids, place_m, strict=True))}  # fmt: skip
    result = make_reconstruction(
        place_m, anchor_ids=ids, changed=fixes, n_steps=400, frame=frame, name=name
    )
    line = boundary.line
    at_m = np.linspace(0.0, line.length_m, 400)
    path_m = line.place(at_m, np.zeros(400))
    range_m = np.hypot(*(path_m[:, None] - place_m).transpose(2, 0, 1))
    episode = replace(
        result.episode, position_m=path_m, range_m=np.where(result.episode.valid, range_m, np.nan)
    )
    result = replace(result, episode=episode, boundary=make_boundary(place_m))
    return with_road(result, boundary)


def with_road(result: Reconstruction, boundary: RoadBoundary | None) -> Reconstruction:
    """Return the result with what its property would keep when first asked for."""
    vars(result)["road_boundary"] = boundary
    return result
