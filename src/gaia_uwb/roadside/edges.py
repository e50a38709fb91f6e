"""The edge of a zone: the line through the cones that face traffic, its band, gaps and width."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from gaia_uwb._shared import Array, Float64
from gaia_uwb.roadside.road_boundary import Edge, EdgeBand, FreeWidth, Gap, RoadSide
from gaia_uwb.roadside.road_line import DrivenPath, RoadLine
from gaia_uwb.roadside.tapers import find_tapers
from gaia_uwb.roadside.zone_cones import PROBABILITY, SideCones, least_beside_m

_GAP = 2.5  # times the usual spacing: with one cone missing, a spacing is doubled
_NEIGHBOURS = 3  # spacings before and after one that tell what is usual there


def make_edge(
    line: RoadLine,
    paths: Sequence[DrivenPath],
    row: SideCones,
    speed_mps: float,
    unlocated: tuple[str, ...],
) -> Edge:
    """Return the edge through the cones of a row.

    Parameters
    ----------
    line
        Along the road.
    paths
        All runs on this road.
    row
        The cones that face traffic on one side.
    speed_mps
        Driven along the zone; NaN if unknown.
    unlocated
        Ids of cones that were not located.
    """
    cones, rows = row.cones, row.rows
    station_m, offset_m = cones.station_m[rows], cones.offset_m[rows]
    ids = tuple(cones.ids[k] for k in rows)
    gaps = _gaps(ids, cones.place_m[rows], unlocated)
    grid_m = row.grid_m
    scenes_m = _or_estimate(row.scene_lines_m(grid_m), row.line_m(grid_m))
    cuts = [0, *(gap.row + 1 for gap in gaps), len(rows)]
    parts = [
        np.flatnonzero((grid_m >= station_m[a]) & (grid_m <= station_m[b - 1]))
        for a, b in pairwise(cuts)
    ]
    return Edge(
        side=row.side,
        side_probability=_side_probability(row),
        cones=ids,
        place_m=cones.place_m[rows],
        station_m=station_m,
        offset_m=offset_m,
        beside_m=least_beside_m(paths, station_m, offset_m),
        lines=tuple(line.place(grid_m[part], row.line_m(grid_m[part])) for part in parts),
        band=_band(line, row.side, grid_m, scenes_m, parts),
        gaps=gaps,
        tapers=find_tapers(row, speed_mps),
        free=_free(line, paths, row, np.concatenate(parts), scenes_m),
    )


def _or_estimate(
    scenes_m: Float64[Array, "S G"], estimate_m: Float64[Array, "G"]
) -> Float64[Array, "_ G"]:
    """Return the lines of the scenes that have one; the estimate's where no scene has."""
    there_m = scenes_m[np.isfinite(scenes_m).all(axis=1)]
    return there_m if len(there_m) else estimate_m[None]


def _side_probability(row: SideCones) -> float:
    """Return in which share of the scenes most cones of the row are on its side."""
    are_here = row.side.holds(row.cones.scene_offset_m[:, row.rows])
    return float(np.mean(are_here.mean(axis=1) > 0.5))


def _gaps(
    ids: Sequence[str], place_m: Float64[Array, "K 2"], unlocated: tuple[str, ...]
) -> tuple[Gap, ...]:
    spacing_m = np.hypot(*np.diff(place_m, axis=0).T)
    found = []
    for k, length_m in enumerate(spacing_m):
        before, after = spacing_m[max(k - _NEIGHBOURS, 0) : k], spacing_m[k + 1 :][:_NEIGHBOURS]
        around_m = np.concatenate([before, after])
        if len(around_m) < 2:
            continue
        usual_m = float(np.median(around_m))
        if length_m > _GAP * usual_m:
            found.append(
                Gap(ids[k], ids[k + 1], k, float(length_m), usual_m, place_m[k : k + 2], unlocated)
            )
    return tuple(found)


def _band(
    line: RoadLine,
    side: RoadSide,
    grid_m: Float64[Array, "G"],
    scenes_m: Float64[Array, "S G"],
    parts: Sequence[Array],
) -> EdgeBand:
    """Return the central interval of the scenes' offsets at every station."""
    out = 0.5 * (1.0 - PROBABILITY)
    low_m, high_m = np.quantile(scenes_m, [out, 1.0 - out], axis=0)
    near_m, far_m = (low_m, high_m) if side is RoadSide.LEFT else (high_m, low_m)
    rings = []
    for part in parts:
        if len(part) > 1:
            right_m = line.place(grid_m[part], low_m[part])
            left_m = line.place(grid_m[part], high_m[part])
            rings.append(np.concatenate([right_m, left_m[::-1]]))
    kept = np.concatenate(parts)
    return EdgeBand(grid_m[kept], near_m[kept], far_m[kept], tuple(rings))


def _free(
    line: RoadLine,
    paths: Sequence[DrivenPath],
    row: SideCones,
    kept: Array,
    scenes_m: Float64[Array, "S G"],
) -> FreeWidth:
    """Return the least distance of an edge from the nearest driven path, its gaps left out."""
    grid_m, there_m = row.grid_m[kept], scenes_m[:, kept]
    at_all_m = least_beside_m(paths, np.broadcast_to(grid_m, there_m.shape), there_m).min(axis=1)
    # Of two cones abeam of each other, the line at their station is one.
    offset_m = np.concatenate([row.line_m(grid_m), row.cones.offset_m[row.rows]])
    grid_m = np.concatenate([grid_m, row.cones.station_m[row.rows]])
    beside_m = least_beside_m(paths, grid_m, offset_m)
    k = int(np.argmin(beside_m))
    across_m = np.array([_nearest_path_m(paths, grid_m[k], offset_m[k]), offset_m[k]])
    return FreeWidth(
        least_m=float(beside_m[k]),
        at_least_m=float(np.quantile(at_all_m, 1.0 - PROBABILITY)),
        station_m=float(grid_m[k]),
        place_m=line.place(np.full(2, grid_m[k]), across_m),
    )


def _nearest_path_m(paths: Sequence[DrivenPath], station_m: float, offset_m: float) -> float:
    at_m = [0.0, *(float(path.offset_at(np.array(station_m))) for path in paths)]
    return min((abs(offset_m - each_m), each_m) for each_m in at_m if np.isfinite(each_m))[1]


def lane_width(line: RoadLine, left: SideCones, right: SideCones) -> FreeWidth | None:
    """Return the least width between two edges; None where they never run side by side.

    Parameters
    ----------
    line
        Along the road.
    left, right
        The cones that face traffic on both sides.
    """
    grid_m = np.union1d(left.grid_m, right.grid_m)
    low_m = max(left.grid_m[0], right.grid_m[0])
    high_m = min(left.grid_m[-1], right.grid_m[-1])
    grid_m = grid_m[(grid_m >= low_m) & (grid_m <= high_m)]
    if not len(grid_m):
        return None
    offsets_m = np.stack([right.line_m(grid_m), left.line_m(grid_m)])
    k = int(np.argmin(np.diff(offsets_m, axis=0)[0]))
    scenes_m = left.scene_lines_m(grid_m) - right.scene_lines_m(grid_m)
    scenes_m = _or_estimate(scenes_m, offsets_m[1] - offsets_m[0]).min(axis=1)
    return FreeWidth(
        least_m=float(offsets_m[1, k] - offsets_m[0, k]),
        at_least_m=float(np.quantile(scenes_m, 1.0 - PROBABILITY)),
        station_m=float(grid_m[k]),
        place_m=line.place(np.full(2, grid_m[k]), offsets_m[:, k]),
    )
