"""Whether a vehicle drove through a zone: over a cone, or from one side of an edge to the other.

Cones on both sides of the path may be two rows with the lane between. They are one row that the
vehicle drove through where all cones on one side come before all on the other, and the step from
the last to the first is no longer than others.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gaia_uwb._shared import Array, Bool, Float64
from gaia_uwb.roadside.road_boundary import DroveThrough
from gaia_uwb.roadside.road_line import DrivenPath
from gaia_uwb.roadside.zone_cones import Rows, ZoneCones, least_beside_m

_HALF_VEHICLE_M = 1.0
_LIKELY = 0.5  # what is less likely is not told
_LONGER = 1.5  # than the usual spacing: two rows need not end and begin so near each other


def drove_through(
    cones: ZoneCones, rows: Sequence[Rows], paths: Sequence[DrivenPath]
) -> DroveThrough | None:
    """Return where drives led through a zone, if that is more likely than not.

    Parameters
    ----------
    cones
        Of the zone.
    rows
        Its rows on each side.
    paths
        All runs on this road.
    """
    beside_m = least_beside_m(paths, cones.scene_station_m, cones.scene_offset_m)
    over = beside_m < _HALF_VEHICLE_M  # (S, M)
    between = _changes_side(cones.scene_station_m, cones.scene_offset_m)
    for each in rows:
        between |= _crossed(each, paths)
    # That of the likeliest place: places of many cones that are little known add up to nothing.
    share = (over | between).mean(axis=0)
    probability = float(share.max())
    if probability <= _LIKELY:
        return None
    named = np.flatnonzero(share > _LIKELY)
    station_m = cones.station_m[named]
    ids = tuple(cones.ids[k] for k in named)
    return DroveThrough(probability, float(station_m.min()), float(station_m.max()), ids)


def _changes_side(
    station_m: Float64[Array, "S M"], offset_m: Float64[Array, "S M"]
) -> Bool[Array, "S M"]:
    """Return between which two cones the path goes from one side of a row to the other."""
    found = np.zeros(station_m.shape, dtype=np.bool_)
    if station_m.shape[1] < 4:
        return found
    order = np.argsort(station_m, axis=1, kind="stable")
    at_m, left_m = (np.take_along_axis(each, order, axis=1) for each in (station_m, offset_m))
    is_left = left_m > 0
    changes = is_left[:, 1:] != is_left[:, :-1]
    spacing_m = np.hypot(np.diff(at_m, axis=1), np.diff(left_m, axis=1))
    usual_m = np.median(spacing_m, axis=1)
    once = changes.sum(axis=1) == 1
    at = np.argmax(changes, axis=1)
    each = np.arange(len(at))
    inside = (at >= 1) & (at <= station_m.shape[1] - 3)
    through = np.flatnonzero(once & inside & (spacing_m[each, at] <= _LONGER * usual_m))
    for after in (0, 1):
        found[through, order[through, at[through] + after]] = True
    return found


def _crossed(rows: Rows, paths: Sequence[DrivenPath]) -> Bool[Array, "S M"]:
    """Return the cones of an edge between which another drive than the line's crosses it."""
    edge, cones = rows.near, rows.near.cones
    found = np.zeros(cones.scene_offset_m.shape, dtype=np.bool_)
    at_m = cones.station_m[edge.rows]
    lines_m = edge.scene_lines_m(at_m)
    for path in paths:
        beyond = lines_m - path.offset_at(at_m)  # NaN where it did not run
        crosses = beyond[:, 1:] * beyond[:, :-1] < 0
        for after in (0, 1):
            part = np.zeros((len(crosses), len(at_m)), dtype=np.bool_)
            part[:, after : after + crosses.shape[1]] = crosses
            found[:, edge.rows] |= part
    return found
