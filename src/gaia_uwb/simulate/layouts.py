r"""Where the anchors of a lane closure stand, as traffic engineers lay it out.

Road coordinates: ``along_m`` is counted along the lane line from the first cone of the merging
taper, and ``open_m`` across it, positive towards the open lane. Seen with the right lane closed::

    open lane    ------------------------------------------------->  open_m > 0
    lane line                  .___________________.                 open_m = 0
    closed lane  ____________./                     \._________      open_m < 0
                 along_m = 0 ^ taper   buffer   work ^ downstream taper

References
----------
Manual on Uniform Traffic Control Devices (MUTCD), part 6: formulas for the length of a merging
taper; a downstream taper is 50 to 100 ft long.
"""

from __future__ import annotations

import numpy as np

from gaia_uwb._typing import Array, Float64
from gaia_uwb.simulate.presets import PassConfig, RoadConfig

_METRES_PER_FOOT = 0.3048


def merging_taper_m(lane_width_m: float, speed_limit_mph: int) -> float:
    """Return the MUTCD's length of a merging taper, in metres.

    L = W S^2 / 60 up to 40 mph and L = W S from 45 mph, with L and the lane's width W in feet and
    the posted speed S in miles per hour.

    Parameters
    ----------
    lane_width_m
        Width of the closed lane, in metres.
    speed_limit_mph
        Posted speed, in miles per hour.

    Examples
    --------
    >>> width_m = 12 * 0.3048
    >>> [round(merging_taper_m(width_m, speed) / 0.3048) for speed in (25, 40, 45, 65)]  # feet
    [125, 320, 540, 780]
    """
    width_ft = lane_width_m / _METRES_PER_FOOT
    low_speed = speed_limit_mph <= 40
    length_ft = width_ft * (speed_limit_mph**2 / 60 if low_speed else speed_limit_mph)
    return length_ft * _METRES_PER_FOOT


def corners_along_m(config: PassConfig) -> Float64[Array, "4"]:
    """Return where the merging taper starts and ends and the downstream taper starts and ends.

    Parameters
    ----------
    config
        Settings of the pass.

    Returns
    -------
    (4,)
        Positions along the road, in metres, increasing from 0.
    """
    taper_m = merging_taper_m(config.road.lane_width_m, config.road.speed_limit_mph)
    closure = config.closure
    edge_m = closure.buffer_m + closure.work_m
    return np.cumsum([0.0, taper_m, edge_m, closure.downstream_taper_m])


def road_to_local(
    road: RoadConfig, along_m: Float64[Array, "K"], open_m: Float64[Array, "K"]
) -> Float64[Array, "K 2"]:
    """Carry road coordinates into the local frame.

    Parameters
    ----------
    road
        The road; its lane line is a straight line or an arc through the origin.
    along_m, open_m : (K,)
        Position along the lane line and across it (positive towards the open lane), in metres.

    Returns
    -------
    (K, 2)
        East and north, in metres.

    Examples
    --------
    >>> import numpy as np
    >>> north = RoadConfig(direction_rad=np.pi / 2, curvature_per_m=0.0)
    >>> road_to_local(north, np.array([100.0]), np.array([2.0])).round(6)  # open lane: the left
    array([[ -2., 100.]])
    """
    left_m = open_m if road.closed_lane == "right" else -open_m
    turn_rad = road.curvature_per_m * along_m
    # An arc's chord has the length s sinc(turn / 2) and half the turn: no division by curvature.
    chord_m = along_m * np.sinc(turn_rad / (2 * np.pi))
    chord_rad = road.direction_rad + turn_rad / 2
    ahead_rad = road.direction_rad + turn_rad
    return np.column_stack(
        [
            chord_m * np.cos(chord_rad) - left_m * np.sin(ahead_rad),
            chord_m * np.sin(chord_rad) + left_m * np.cos(ahead_rad),
        ]
    )


def place_anchors(
    config: PassConfig, rng: np.random.Generator
) -> tuple[Float64[Array, "N 2"], Float64[Array, "N"]]:
    """Place the anchors on the cones of a lane closure.

    The first four take the corners, which fix the boundary; the others fill the gaps between
    them evenly. So one more anchor leaves the others where they are.

    Parameters
    ----------
    config
        Settings of the pass.
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
    corners_m = corners_along_m(config)
    fill = [_van_der_corput(k) for k in range(1, closure.n_anchors - 3)]
    mark_m = np.concatenate([corners_m, corners_m[-1] * np.array(fill)])[: closure.n_anchors]
    width_m = config.road.lane_width_m
    edge_m = np.interp(mark_m, corners_m, [-width_m, 0.0, 0.0, -width_m])
    scatter = rng.standard_normal((closure.n_anchors, 3))  # row by row: anchor k's own numbers
    along_m = mark_m + closure.placement_sigma_m * scatter[:, 0]
    open_m = edge_m + closure.placement_sigma_m * scatter[:, 1]
    up_m = closure.antenna_up_m + closure.antenna_up_sigma_m * scatter[:, 2]
    return road_to_local(config.road, along_m, open_m), up_m


def _van_der_corput(k: int) -> float:
    """Return the k-th of 1/2, 1/4, 3/4, 1/8, 5/8 ...: every start of it spreads evenly in 0..1."""
    return sum(2.0 ** -(place + 1) for place in range(k.bit_length()) if k >> place & 1)
