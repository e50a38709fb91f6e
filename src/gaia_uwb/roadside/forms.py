"""How the cones of a zone stand, as seen from the road.

What decides is where each cone stands beside the driven path: its station, and its distance to the
left or the right.

- Cones on both sides: **lane-between**.
- All on one side, less than three times as long as wide: an **area**.
- All on one side, and in the order of the road they step away and back again, more often than one
  row with its tapers and a few misplaced cones: there are two rows. Where both are long, the
  **works are between**; else they stand around an **area**.
- All on one side in one row that leads away from traffic at both ends, as a closed lane with its
  tapers does: the row and the line through its ends enclose an **area**.
- All others: **one row**.

>>> import numpy as np
>>> station_m = 10.0 * np.arange(8)
>>> [form.value for form in forms(station_m[None], np.full((1, 8), -3.0), ZoneForm.AREA)]
['one-row']
"""

from __future__ import annotations

import numpy as np

from gaia_uwb._shared import Array, Bool, Float64, Int64
from gaia_uwb.roadside.road_boundary import ZoneForm

_STEP_M = 1.2  # across the road: less is no other row, but cones that were put down carelessly
_STEEP = 0.2  # across over along the road: less is the driver's own weaving
_CLOSED_M = 2.0  # by which a row leads away at both ends to close ground, as less than a lane
_COMPACT = 3.0  # length over width of what is no row
_OUT_AND_BACK = 3  # steps to another row that no row with two tapers makes
_STEPS_PER_CONE = 1 / 6  # and no row with some cones out of line: each makes two
_OF_A_ROW, _LONG = 3, 0.6  # cones of a row, and its share of the zone's length
_ZONE_GAP, _ZONE_GAP_M = 10.0, 200.0  # between two zones: usual spacings, and metres
_TANGENT = 0.25  # quantile of the distances from the path that a row without its tapers has


def split_zones(station_m: Float64[Array, "M"]) -> list[Int64[Array, "_"]]:
    """Return the rows of the cones of every zone, in the order of the road.

    Two zones are further apart than 10 usual spacings of cones, and than 200 m.

    Parameters
    ----------
    station_m : (M,)
        Of the cones, in metres.
    """
    order = np.argsort(station_m, kind="stable")
    spacing_m = np.diff(station_m[order])
    usual_m = float(np.median(spacing_m)) if len(spacing_m) else 0.0
    cuts = np.flatnonzero(spacing_m > max(_ZONE_GAP * usual_m, _ZONE_GAP_M)) + 1
    return np.split(order, cuts)


def forms(
    station_m: Float64[Array, "S M"], left_m: Float64[Array, "S M"], if_two_rows: ZoneForm
) -> list[ZoneForm]:
    """Return the form of a zone in each of S scenes.

    Parameters
    ----------
    station_m, left_m : (S, M)
        Of the cones: along the road, and from the driven path, positive to its left; in metres.
    if_two_rows
        What to call a zone with two rows on one side: see :func:`two_rows_form`.
    """
    distance_m = np.abs(left_m)
    order = np.argsort(station_m, axis=1, kind="stable")
    in_order_m = np.take_along_axis(distance_m, order, axis=1)
    length_m, width_m = np.ptp(station_m, axis=1), np.ptp(distance_m, axis=1)
    many = station_m.shape[1] > 2
    is_between = (left_m > 0).any(axis=1) & (left_m <= 0).any(axis=1)
    is_compact = many & (width_m > _STEP_M) & (length_m < _COMPACT * width_m)
    at_m = np.take_along_axis(station_m, order, axis=1)
    least = _least_steps(station_m.shape[1])
    are_two_rows = (_steps(in_order_m) >= least) & (_steep(at_m, in_order_m) >= 0.5 * least)
    tangent_m = np.quantile(in_order_m, _TANGENT, axis=1)
    ends_m = np.minimum(in_order_m[:, 0], in_order_m[:, -1])
    is_closed = many & (ends_m - tangent_m > _CLOSED_M)
    names = np.select(
        [is_between, is_compact, are_two_rows, is_closed],
        [ZoneForm.LANE_BETWEEN.value, ZoneForm.AREA.value, if_two_rows.value, ZoneForm.AREA.value],
        ZoneForm.ONE_ROW.value,
    )
    return [ZoneForm(name) for name in names.tolist()]


def two_rows_form(
    station_m: Float64[Array, "M"], left_m: Float64[Array, "M"], is_facing: Bool[Array, "M"]
) -> ZoneForm:
    """Return what two rows on one side of the path are: two long rows, or an area.

    Parameters
    ----------
    station_m, left_m : (M,)
        As in :func:`forms`.
    is_facing : (M,)
        From :func:`facing`.
    """
    rows = [station_m[is_facing], station_m[~is_facing]]
    least_m = _LONG * np.ptp(station_m)
    are_long = all(len(row) >= _OF_A_ROW and np.ptp(row) >= least_m for row in rows)
    is_narrow = np.ptp(station_m) < _COMPACT * np.ptp(left_m)
    return ZoneForm.WORKS_BETWEEN if are_long and not is_narrow else ZoneForm.AREA


def has_two_rows(station_m: Float64[Array, "M"], left_m: Float64[Array, "M"]) -> bool:
    """Return whether the cones on one side of the path are more than one row.

    Parameters
    ----------
    station_m, left_m : (M,)
        As in :func:`forms`, of cones on one side.
    """
    if len(station_m) < 3:
        return False
    order = np.argsort(station_m, kind="stable")
    width_m, length_m = np.ptp(left_m), np.ptp(station_m)
    is_compact = width_m > _STEP_M and length_m < _COMPACT * width_m
    at_m, distance_m = station_m[order][None], np.abs(left_m[order])[None]
    steps = min(_steps(distance_m)[0], 2 * _steep(at_m, distance_m)[0])
    return bool(is_compact or steps >= _least_steps(len(order)))


def facing(station_m: Float64[Array, "M"], distance_m: Float64[Array, "M"]) -> Bool[Array, "M"]:
    """Return which cones face traffic: those nearer to the zone's near side than to its far one.

    Both sides are those of the hull of all cones on the straightened road. The first and the last
    cone are on both: they face traffic, unless, in a long zone, they stand across the road behind
    the next cone that does, as the first of a row behind may.

    Parameters
    ----------
    station_m : (M,)
        Along the road, in metres.
    distance_m : (M,)
        From the driven path, in metres, all on one side.
    """
    order = np.argsort(station_m, kind="stable")
    near, far = (_chain(station_m[order], sign * distance_m[order]) for sign in (1.0, -1.0))
    at_m, from_path_m = station_m[order], distance_m[order]
    near_m = np.interp(at_m, at_m[near], from_path_m[near])
    far_m = np.interp(at_m, at_m[far], from_path_m[far])
    in_order = from_path_m - near_m <= far_m - from_path_m
    is_long = np.ptp(station_m) >= _COMPACT * np.ptp(distance_m)
    for end, onwards in ((0, 1), (len(order) - 1, -1)) if is_long else ():
        others = np.flatnonzero(in_order)[::onwards]
        others = others[others != end]
        if len(others):
            aside_m = from_path_m[end] - from_path_m[others[0]]
            in_order[end] = aside_m <= abs(at_m[end] - at_m[others[0]])
    found = np.empty(len(order), dtype=np.bool_)
    found[order] = in_order
    return found


def _chain(at_m: Float64[Array, "M"], value_m: Float64[Array, "M"]) -> list[int]:
    """Return the rows of the lower side of a hull from end to end; stations do not decrease."""
    kept: list[int] = []
    for k in range(len(at_m)):
        while len(kept) > 1:
            a, b = kept[-2:]
            turn = (at_m[b] - at_m[a]) * (value_m[k] - value_m[a])
            if turn > (value_m[b] - value_m[a]) * (at_m[k] - at_m[a]):
                break
            kept.pop()
        kept.append(k)
    return kept


def _least_steps(n_cones: int) -> float:
    """Return how many steps so many cones make if they are two rows."""
    return max(float(_OUT_AND_BACK), _STEPS_PER_CONE * n_cones)


def _steps(distance_m: Float64[Array, "S M"]) -> Float64[Array, "S"]:
    """Count how often rows step aside by more than cones of one row do, in the order of the road.

    Small steps in one direction add up to one, as in a taper.
    """
    low = high = distance_m[:, 0]
    direction = np.zeros(len(distance_m))
    count = np.zeros(len(distance_m))
    for now in distance_m.T[1:]:
        low, high = np.minimum(low, now), np.maximum(high, now)
        rises = (direction <= 0) & (now - low > _STEP_M)
        falls = (direction >= 0) & (high - now > _STEP_M) & ~rises
        count += rises | falls
        direction = np.where(rises, 1.0, np.where(falls, -1.0, direction))
        low, high = np.where(falls, now, low), np.where(rises, now, high)
    return count


def _steep(
    station_m: Float64[Array, "S M"], distance_m: Float64[Array, "S M"]
) -> Int64[Array, "S"]:
    """Count the steps from one cone to the next that no weaving vehicle makes of one row."""
    across_m, along_m = np.abs(np.diff(distance_m, axis=1)), np.diff(station_m, axis=1)
    return np.asarray(((across_m > _STEP_M) & (across_m > _STEEP * along_m)).sum(axis=1))
