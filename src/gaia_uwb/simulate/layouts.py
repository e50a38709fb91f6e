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

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from gaia_uwb._typing import Array, Float64
from gaia_uwb.simulate.settings import PassConfig, RoadConfig

_METRES_PER_FOOT = 0.3048
_SHORT_TAPER_M = 50 * _METRES_PER_FOOT
_STRAIGHT_PER_M = 1e-12  # a road that bends less is straight
_OTHER_SIDE_GAP_M = 0.4  # from the lane's edge to the cones across it


def taper_m(width_m: float, speed_limit_mph: int) -> float:
    """Return the MUTCD's length L of a merging taper, in metres.

    L = W S^2 / 60 up to 40 mph and L = W S from 45 mph, with L and the width W in feet and the
    posted speed S in miles per hour.

    Parameters
    ----------
    width_m
        Width that is closed, in metres.
    speed_limit_mph
        Posted speed, in miles per hour.

    Examples
    --------
    >>> width_m = 12 * 0.3048
    >>> [round(taper_m(width_m, speed) / 0.3048) for speed in (25, 40, 45, 65)]  # feet
    [125, 320, 540, 780]
    """
    width_ft = width_m / _METRES_PER_FOOT
    low_speed = speed_limit_mph <= 40
    length_ft = width_ft * (speed_limit_mph**2 / 60 if low_speed else speed_limit_mph)
    return length_ft * _METRES_PER_FOOT


@dataclass(frozen=True)
class ZonePlan:
    """A work zone in road coordinates.

    Parameters
    ----------
    corner_along_m, corner_open_m : (4,)
        The line of cones: start and end of the first taper, start and end of the last; in metres.
    lane_open_m
        Middle of the lane that a vehicle far before the zone drives in.
    lane_moves : (M, 3)
        How that lane goes on: where a move starts, its length, and how far it goes to the open
        side, in metres.
    work_along_m : (2,)
        Start and end of the work space.
    sign_along_m : (3,)
        The signs of the advance warning.
    follows_lane
        Between its corners the line of cones keeps its distance from the lane, which moves over
        smoothly; otherwise it is straight there.
    """

    corner_along_m: Float64[Array, "4"]
    corner_open_m: Float64[Array, "4"]
    lane_open_m: float
    lane_moves: Float64[Array, "M 3"]
    work_along_m: Float64[Array, "2"]
    sign_along_m: Float64[Array, "3"]
    follows_lane: bool

    @property
    def end_m(self) -> float:
        """Where the last cone stands along the road, in metres."""
        return float(self.corner_along_m[-1])

    def edge_m(self, along_m: Float64[Array, "*shape"]) -> Float64[Array, "*shape"]:
        """Return the line of cones across the road, in metres."""
        if self.follows_lane:
            beside_m = float(self.corner_open_m[0]) - self.lane_open_m
            return self.lane_m(along_m) + beside_m
        return np.interp(along_m, self.corner_along_m, self.corner_open_m)

    def lane_m(self, along_m: Float64[Array, "*shape"]) -> Float64[Array, "*shape"]:
        """Return the middle of the lane that is driven, across the road, in metres."""
        lane_m = np.full(np.shape(along_m), self.lane_open_m)
        for start_m, length_m, move_m in self.lane_moves.tolist():
            lane_m = lane_m + move_m * _smooth_step((along_m - start_m) / length_m)
        return lane_m


def plan_zone(config: PassConfig) -> ZonePlan:
    """Lay out a work zone along its road.

    Parameters
    ----------
    config
        Settings of the pass; ``road``, ``closure`` and the lane change of ``drive`` are used.
    """
    closure, drive, width_m = config.closure, config.drive, config.road.lane_width_m
    speed_mph = config.road.speed_limit_mph
    shift_m = {"lane-shift": closure.shift_m, "median-crossover": width_m + closure.median_m}
    moved_m = shift_m.get(closure.kind, 0.0)
    # Length of the first taper and of the last, and the line of cones outside and inside.
    first_m, last_m, outside_m, inside_m = {
        "lane-closure": (taper_m(width_m, speed_mph), closure.downstream_taper_m, -width_m, 0.0),
        "shoulder-closure": (
            taper_m(closure.shoulder_m, speed_mph) / 3,
            closure.downstream_taper_m,
            -width_m - closure.shoulder_m,
            -width_m,
        ),
        "lane-shift": (*2 * (taper_m(moved_m, speed_mph) / 2,), -width_m, moved_m - width_m),
        "median-crossover": (*2 * (taper_m(moved_m, speed_mph) / 2,), 0.0, moved_m),
        "mobile-operation": (_SHORT_TAPER_M, closure.downstream_taper_m, -width_m, 0.0),
    }[closure.kind]
    corner_m = np.cumsum([0.0, first_m, closure.buffer_m + closure.work_m, last_m])
    lane_m, moves = -0.5 * width_m, np.empty((0, 3))
    if moved_m:
        lane_m = outside_m + 0.5 * width_m
        moves = np.array([[0.0, first_m, moved_m], [corner_m[2], last_m, -moved_m]])
    elif closure.kind != "shoulder-closure" and drive.lane_change:
        change_m, gap_m = drive.lane_change_m, drive.lane_change_gap_m
        moves = np.array([
            [-gap_m - change_m, change_m, width_m], [corner_m[3] + gap_m, change_m, -width_m],
        ])  # fmt: skip
    elif closure.kind != "shoulder-closure":
        lane_m = 0.5 * width_m
    work_m = first_m + closure.buffer_m + np.array([0.0, closure.work_m])
    sign_m = -closure.sign_spacing_m * np.array([3.0, 2.0, 1.0])
    open_m = np.array([outside_m, inside_m, inside_m, outside_m])
    return ZonePlan(corner_m, open_m, lane_m, moves, work_m, sign_m, bool(moved_m))


def road_to_local(
    road: RoadConfig, along_m: Float64[Array, "*shape"], open_m: Float64[Array, "*shape"]
) -> Float64[Array, "*shape 2"]:
    """Carry road coordinates into the local frame.

    Parameters
    ----------
    road
        The road; its lane line is a straight line, an arc or an S of two arcs through the origin.
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
    left_m = open_m if road.closed_lane == "right" else -open_m
    if road.s_curve:
        bend_m = road.inflection_m
        first_m = np.minimum(along_m, bend_m) if bend_m >= 0 else np.maximum(along_m, bend_m)
    else:
        first_m = along_m
    curvature_per_m = road.curvature_per_m
    east_m, north_m, ahead_rad = _arc(first_m, curvature_per_m, road.direction_rad)
    if road.s_curve:
        more_east_m, more_north_m, ahead_rad = _arc(along_m - first_m, -curvature_per_m, ahead_rad)
        east_m, north_m = east_m + more_east_m, north_m + more_north_m
    return np.stack(
        [east_m - left_m * np.sin(ahead_rad), north_m + left_m * np.cos(ahead_rad)], axis=-1
    )


def _arc(
    length_m: Float64[Array, "*shape"],
    curvature_per_m: float,
    start_rad: float | Float64[Array, "*shape"],
) -> tuple[Float64[Array, "*shape"], Float64[Array, "*shape"], Float64[Array, "*shape"]]:
    """Return how far an arc leads east and north, and its direction at the end."""
    turn_rad = curvature_per_m * length_m
    chord_m = length_m
    if abs(curvature_per_m) > _STRAIGHT_PER_M:
        chord_m = (2 / curvature_per_m) * np.sin(turn_rad / 2)
    chord_rad = start_rad + turn_rad / 2
    return chord_m * np.cos(chord_rad), chord_m * np.sin(chord_rad), start_rad + turn_rad


def place_anchors(
    config: PassConfig, plan: ZonePlan, rng: np.random.Generator
) -> tuple[Float64[Array, "N 2"], Float64[Array, "N"]]:
    """Place the anchors on the cones of a work zone.

    The first four take the corners, which fix the boundary; the others fill the gaps between
    them evenly. So one more anchor leaves the others where they are. With ``both_sides`` every
    other one goes across the lane that is driven, in the same order.

    Parameters
    ----------
    config
        Settings of the pass.
    plan
        The work zone.
    rng
        Source of the crew's inaccuracy.

    Returns
    -------
    position_m : (N, 2)
        East and north, in metres.
    up_m : (N,)
        Heights of the antennas above the road, in metres.
    """
    closure = config.closure
    row = np.arange(closure.n_anchors)
    index = row // 2 if closure.both_sides else row
    fill_m = plan.end_m * np.array(_fill(max(0, int(index[-1]) - 3)))
    mark_m = np.concatenate([plan.corner_along_m, fill_m])[index]
    edge_m = plan.edge_m(mark_m)
    if closure.both_sides:
        other_m = plan.lane_m(mark_m) + 0.5 * config.road.lane_width_m + _OTHER_SIDE_GAP_M
        edge_m = np.where(row % 2 == 1, other_m, edge_m)
    scatter = rng.standard_normal((closure.n_anchors, 3))  # row by row: anchor k's own numbers
    along_m = mark_m + closure.placement_sigma_m * scatter[:, 0]
    open_m = edge_m + closure.placement_sigma_m * scatter[:, 1]
    up_m = closure.antenna_up_m + closure.antenna_up_sigma_m * scatter[:, 2]
    return road_to_local(config.road, along_m, open_m), up_m


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
