r"""Where the cones of a work zone stand, as traffic engineers lay it out (MUTCD part 6).

Road coordinates: ``along_m`` is counted along the lane line from the first cone, and ``open_m``
across it, positive towards the open lane. A lane closure, seen with the right lane closed::

    open lane    ------------------------------------------------->  open_m > 0
    lane line                  .___________________.                 open_m = 0
    closed lane  ____________./                     \._________      open_m < 0
                 along_m = 0 ^ taper   buffer   work ^ downstream taper

With the lane's width W and the taper's length L (:func:`taper_m`) for the width that is closed:

================  ==================================================================================
lane-closure      the closed lane's cones: merging taper L, buffer, work, downstream taper
shoulder-closure  the shoulder's: shoulder taper L / 3, buffer, work, downstream taper
lane-shift        beside lanes that move over: shifting tapers L / 2 at both ends
median-crossover  beside traffic sent over the median: shifting tapers L / 2 at both ends
mobile-operation  a convoy during a stop: a taper of 50 ft, roll-ahead space, work, a taper
================  ==================================================================================

References
----------
Manual on Uniform Traffic Control Devices (MUTCD), part 6: formulas and kinds of tapers; a
downstream taper is 50 to 100 ft long.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from gaia_uwb._shared import Array, Bool, Float64, Int64
from gaia_uwb.simulate.chains import Column
from gaia_uwb.simulate.rows import PassSettings, SectionRows
from gaia_uwb.simulate.settings import RoadConfig

_METRES_PER_FOOT = 0.3048
_SHORT_TAPER_M = 50 * _METRES_PER_FOOT
_STRAIGHT_PER_M = 1e-12  # a road that bends less is straight
_OTHER_SIDE_GAP_M = 0.4  # from the lane's edge to the cones across it


def taper_m(width_m: Any, speed_limit_mph: Any) -> Any:
    """Return the MUTCD's length L of a merging taper, in metres.

    L = W S^2 / 60 up to 40 mph and L = W S from 45 mph, with L and the width W in feet and the
    posted speed S in miles per hour.

    Parameters
    ----------
    width_m
        Width that is closed, in metres: a number or an array.
    speed_limit_mph
        Posted speed, in miles per hour: a number or an array.

    Examples
    --------
    >>> width_m = 12 * 0.3048
    >>> [round(taper_m(width_m, speed) / 0.3048) for speed in (25, 40, 45, 65)]  # feet
    [125, 320, 540, 780]
    """
    width_ft = width_m / _METRES_PER_FOOT
    per_width = np.where(speed_limit_mph <= 40, speed_limit_mph**2 / 60, speed_limit_mph)
    return width_ft * per_width * _METRES_PER_FOOT


@dataclass(frozen=True)
class ZonePlan:
    """A work zone in road coordinates, or one for each row of settings.

    What all rows have in common has no axes before those that are named; anything else has (R, 1).

    Parameters
    ----------
    corner_along_m, corner_open_m : (..., 4)
        The line of cones: start and end of the first taper, start and end of the last; in metres.
    lane_open_m : (...)
        Middle of the lane that a vehicle far before the zone drives in.
    lane_moves : (..., 2, 3)
        How that lane goes on: where a move starts, its length, and how far it goes to the open
        side, in metres; a lane that stays moves by 0.
    work_along_m : (..., 2)
        Start and end of the work space.
    sign_along_m : (..., 3)
        The signs of the advance warning.
    follows_lane : (...)
        Between its corners the line of cones keeps its distance from the lane, which moves over
        smoothly; otherwise it is straight there.
    """

    corner_along_m: Float64[Array, "... 4"]
    corner_open_m: Float64[Array, "... 4"]
    lane_open_m: Float64[Array, "..."]
    lane_moves: Float64[Array, "... 2 3"]
    work_along_m: Float64[Array, "... 2"]
    sign_along_m: Float64[Array, "... 3"]
    follows_lane: Bool[Array, "..."]

    @property
    def end_m(self) -> Float64[Array, "..."]:
        """Where the last cone stands along the road, in metres."""
        return np.asarray(self.corner_along_m[..., -1])

    def edge_m(self, along_m: Float64[Array, "*shape"]) -> Float64[Array, "*shape"]:
        """Return the line of cones across the road, in metres."""
        edge_m = self._straight_m(along_m)
        if self.follows_lane.any():
            beside_m = self.corner_open_m[..., 0] - self.lane_open_m
            edge_m = np.where(self.follows_lane, self.lane_m(along_m) + beside_m, edge_m)
        return edge_m

    def lane_m(self, along_m: Float64[Array, "*shape"]) -> Float64[Array, "*shape"]:
        """Return the middle of the lane that is driven, across the road, in metres."""
        lane_m = np.full(np.shape(along_m), self.lane_open_m)
        for k in range(self.lane_moves.shape[-2]):
            start_m, length_m, move_m = np.moveaxis(self.lane_moves[..., k, :], -1, 0)
            if move_m.any():
                lane_m += move_m * _smooth_step((along_m - start_m) / length_m)
        return lane_m

    def _straight_m(self, along_m: Float64[Array, "*shape"]) -> Float64[Array, "*shape"]:
        """Return straight lines between the corners."""
        along = np.moveaxis(self.corner_along_m, -1, 0)
        outside_m, inside_m = self.corner_open_m[..., 0], self.corner_open_m[..., 1]
        in_per_m = (inside_m - outside_m) / (along[1] - along[0])
        out_per_m = (outside_m - inside_m) / (along[3] - along[2])
        return np.select(
            [along_m < corner_m for corner_m in along],
            [
                np.broadcast_to(outside_m, np.shape(along_m)),
                in_per_m * (along_m - along[0]) + outside_m,
                inside_m,
                out_per_m * (along_m - along[2]) + inside_m,
            ],
            outside_m,
        )


def plan_zone(config: PassSettings) -> ZonePlan:
    """Lay out a work zone along its road, or one for each row of settings.

    Parameters
    ----------
    config
        Settings of the pass; ``road``, ``closure`` and the lane change of ``drive`` are used.
    """
    closure, drive, width_m = config.closure, config.drive, config.road.lane_width_m
    speed_mph = config.road.speed_limit_mph
    moved_m = _of_kind(closure.kind, {
        "lane-shift": closure.shift_m, "median-crossover": width_m + closure.median_m
    })  # fmt: skip
    shifting_m, downstream_m = taper_m(moved_m, speed_mph) / 2, closure.downstream_taper_m
    first_m = _of_kind(closure.kind, {
        "lane-closure": taper_m(width_m, speed_mph),
        "shoulder-closure": taper_m(closure.shoulder_m, speed_mph) / 3,
        "lane-shift": shifting_m,
        "median-crossover": shifting_m,
        "mobile-operation": _SHORT_TAPER_M,
    })  # fmt: skip
    moves = moved_m > 0
    last_m = np.where(moves, shifting_m, downstream_m)
    outside_m = _of_kind(closure.kind, {
        "lane-closure": -width_m,
        "shoulder-closure": -width_m - closure.shoulder_m,
        "lane-shift": -width_m,
        "mobile-operation": -width_m,
    })  # fmt: skip
    inside_m = _of_kind(closure.kind, {
        "shoulder-closure": -width_m, "lane-shift": moved_m - width_m, "median-crossover": moved_m
    })  # fmt: skip
    down_m = first_m + (closure.buffer_m + closure.work_m)  # where the last taper begins
    end_m = down_m + last_m
    # The lane moves over in the tapers, or traffic changes lanes before and behind the zone.
    closed = ~moves & np.not_equal(closure.kind, "shoulder-closure")
    changes = closed & drive.lane_change
    change_m, gap_m = drive.lane_change_m, drive.lane_change_gap_m
    over_m = np.where(moves, moved_m, np.where(changes, width_m, 0.0))
    over_from_m = np.where(moves, 0.0, -gap_m - change_m)
    back_from_m = np.where(moves, down_m, end_m + gap_m)
    over_length_m, back_length_m = (np.where(moves, it, change_m) for it in (first_m, last_m))
    lane_m = np.where(closed & ~changes, 0.5 * width_m, -0.5 * width_m)
    lane_moves = _stack(over_from_m, over_length_m, over_m, back_from_m, back_length_m, -over_m)
    work_m = first_m + closure.buffer_m
    return ZonePlan(
        corner_along_m=_stack(0.0, first_m, down_m, end_m),
        corner_open_m=_stack(outside_m, inside_m, inside_m, outside_m),
        lane_open_m=np.where(moves, outside_m + 0.5 * width_m, lane_m),
        lane_moves=lane_moves.reshape(*lane_moves.shape[:-1], 2, 3),
        work_along_m=_stack(work_m, work_m + closure.work_m),
        sign_along_m=_stack(*(-closure.sign_spacing_m * times for times in (3.0, 2.0, 1.0))),
        follows_lane=np.asarray(moves),
    )


def _of_kind(kind: Any, values: Mapping[str, Any]) -> Array:
    """Return what belongs to the kind of zone, or to that of each row; 0 if none is named."""
    return np.select([np.equal(kind, name) for name in values], list(values.values()), 0.0)


def _stack(*values: Any) -> Float64[Array, "..."]:
    """Put numbers, or columns, side by side along a new last axis."""
    return np.stack(np.broadcast_arrays(*values), axis=-1).astype(np.float64)


def road_to_local(
    road: RoadConfig | SectionRows,
    along_m: Float64[Array, "*shape"],
    open_m: Float64[Array, "*shape"],
) -> Float64[Array, "*shape 2"]:
    """Carry road coordinates into the local frame.

    Parameters
    ----------
    road
        The road, or one for each row of the positions; its lane line is a straight line, an arc or
        an S of two arcs through the origin.
    along_m, open_m
        Position along the lane line and across it (positive towards the open lane), in metres.

    Returns
    -------
    (..., 2)
        East and north, in metres.

    Examples
    --------
    >>> import numpy as np
    >>> north = RoadConfig(direction_rad=np.pi / 2, curvature_per_m=0.0)
    >>> road_to_local(north, np.array([100.0]), np.array([2.0])).round(6)  # open lane: the left
    array([[ -2., 100.]])
    """
    left_m = np.where(np.equal(road.closed_lane, "right"), open_m, -open_m)
    first_m = along_m
    if np.any(road.s_curve):
        bend_m = road.inflection_m
        before = np.greater_equal(bend_m, 0)
        first_m = np.where(before, np.minimum(along_m, bend_m), np.maximum(along_m, bend_m))
        first_m = np.where(road.s_curve, first_m, along_m)
    curvature_per_m = road.curvature_per_m
    east_m, north_m, ahead_rad = _arc(first_m, curvature_per_m, road.direction_rad)
    if np.any(road.s_curve):
        more_east_m, more_north_m, ahead_rad = _arc(along_m - first_m, -curvature_per_m, ahead_rad)
        east_m, north_m = east_m + more_east_m, north_m + more_north_m
    return np.stack(
        [east_m - left_m * np.sin(ahead_rad), north_m + left_m * np.cos(ahead_rad)], axis=-1
    )


def _arc(
    length_m: Float64[Array, "*shape"], curvature_per_m: Column, start_rad: Any
) -> tuple[Float64[Array, "*shape"], Float64[Array, "*shape"], Float64[Array, "*shape"]]:
    """Return how far an arc leads east and north, and its direction at the end."""
    turn_rad = curvature_per_m * length_m
    bends = np.abs(curvature_per_m) > _STRAIGHT_PER_M
    per_m = np.where(bends, curvature_per_m, 1.0)
    chord_m = np.where(bends, (2 / per_m) * np.sin(turn_rad / 2), length_m)
    chord_rad = start_rad + turn_rad / 2
    return chord_m * np.cos(chord_rad), chord_m * np.sin(chord_rad), start_rad + turn_rad


def place_anchors(
    config: PassSettings, number: Int64[Array, "N"], scatter: Float64[Array, "N 3"]
) -> tuple[Float64[Array, "N 2"], Float64[Array, "N"]]:
    """Place the anchors on the cones of a work zone.

    The first four take the corners, which fix the boundary; the others fill the gaps between
    them evenly. So one more anchor leaves the others where they are. With ``both_sides`` every
    other one goes across the lane that is driven, in the same order.

    Parameters
    ----------
    config
        Settings of the pass, or of each anchor's.
    number : (N,)
        Number of each anchor in its pass.
    scatter : (N, 3)
        The crew's inaccuracy along, across and up: independent standard normal numbers.

    Returns
    -------
    position_m : (N, 2)
        East and north, in metres.
    up_m : (N,)
        Heights of the antennas above the road, in metres.
    """
    closure, plan, row = config.closure, plan_zone(config), number[:, None]
    index = np.where(closure.both_sides, row // 2, row)
    corners = plan.corner_along_m.shape[-1]
    fill = np.array((*_fill(max(0, int(index.max()) + 1 - corners)), 0.0))
    mark_m = np.select(
        [index == corner for corner in range(corners)],
        list(np.moveaxis(plan.corner_along_m, -1, 0)),
        plan.end_m * fill[np.maximum(index - corners, -1)],
    )
    other_m = plan.lane_m(mark_m) + 0.5 * config.road.lane_width_m + _OTHER_SIDE_GAP_M
    across = np.logical_and(closure.both_sides, row % 2 == 1)
    edge_m = np.where(across, other_m, plan.edge_m(mark_m))
    along_m = mark_m + closure.placement_sigma_m * scatter[:, :1]
    open_m = edge_m + closure.placement_sigma_m * scatter[:, 1:2]
    up_m = closure.antenna_up_m + closure.antenna_up_sigma_m * scatter[:, 2:]
    return road_to_local(config.road, along_m, open_m)[:, 0], up_m[:, 0]


@lru_cache(maxsize=1024)
def _fill(n: int) -> tuple[float, ...]:
    """Return the first n of 1/2, 1/4, 3/4, 1/8, 5/8 ...: every start spreads evenly in 0..1."""
    return tuple(
        sum(2.0 ** -(place + 1) for place in range(k.bit_length()) if k >> place & 1)
        for k in range(1, n + 1)
    )


def _smooth_step(x: Float64[Array, "*shape"]) -> Float64[Array, "*shape"]:
    """Return the minimum-jerk step from 0 (x <= 0) to 1 (x >= 1)."""
    x = np.minimum(np.maximum(x, 0.0), 1.0)
    step: Array = x * x * x * (10 + x * (6 * x - 15))
    return step
