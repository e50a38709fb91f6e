"""From the GNSS antenna's path to the tag's: the lever arm, turned with the vehicle's heading.

The heading is that of the path: the vehicle is assumed to drive forward, on level ground. It is
measured between points a metre apart, so that a receiver's noise at a standstill does not turn
the vehicle.
"""

from __future__ import annotations

import numpy as np
from pydantic import Field

from gaia_uwb._shared import Array, Float64, InputError
from gaia_uwb.config import Settings

STEP_M = 1.0
"""Least distance between two points that determine the heading."""


class LeverArm(Settings):
    """Where the tag's antenna is, seen from the GNSS antenna, in metres."""

    forward_m: float = Field(default=0.0, ge=-50, le=50)
    left_m: float = Field(default=0.0, ge=-50, le=50)
    up_m: float = Field(default=0.0, ge=-50, le=50)


def move_to_tag(
    t_s: Float64[Array, "T"],
    position_m: Float64[Array, "T 2"],
    up_m: Float64[Array, "T"] | None,
    arm: LeverArm,
) -> tuple[Float64[Array, "T 2"], Float64[Array, "T"] | None]:
    """Move a path from the GNSS antenna to the tag's.

    Parameters
    ----------
    t_s : (T,)
        Time in seconds, strictly increasing.
    position_m : (T, 2)
        East and north of the GNSS antenna, in metres.
    up_m : (T,), optional
        Its height, in metres.
    arm
        The lever arm.

    Returns
    -------
    position_m : (T, 2)
        East and north of the tag's antenna, in metres.
    up_m : (T,), optional
        Its height, in metres.

    Raises
    ------
    InputError
        If the path is too short to determine a heading.

    Examples
    --------
    >>> east_m = np.array([0.0, 5.0, 10.0])
    >>> path_m = np.column_stack([east_m, np.zeros(3)])
    >>> move_to_tag(east_m, path_m, None, LeverArm(forward_m=2.0, left_m=0.5))[0].tolist()
    [[2.0, 0.5], [7.0, 0.5], [12.0, 0.5]]
    """
    heights = None if up_m is None else up_m + arm.up_m
    if not (arm.forward_m or arm.left_m):
        return position_m, heights
    heading_rad = _heading(t_s, position_m)
    cosine, sine = np.cos(heading_rad), np.sin(heading_rad)
    east_m = arm.forward_m * cosine - arm.left_m * sine
    north_m = arm.forward_m * sine + arm.left_m * cosine
    return position_m + np.column_stack([east_m, north_m]), heights


def _heading(t_s: Float64[Array, "T"], position_m: Float64[Array, "T 2"]) -> Float64[Array, "T"]:
    """Return the direction of travel in radians, counter-clockwise from east."""
    kept = [0]
    last = position_m[0]
    for index, place in enumerate(position_m):
        if np.hypot(*(place - last)) >= STEP_M:
            kept.append(index)
            last = place
    if len(kept) < 2:
        raise InputError(
            f"a lever arm needs a heading, but the path never gets {STEP_M:g} m from its start",
            column="lever_arm",
        )
    chord_m = np.diff(position_m[kept], axis=0)
    angle_rad = np.unwrap(np.arctan2(chord_m[:, 1], chord_m[:, 0]))
    middle_s = (t_s[kept][1:] + t_s[kept][:-1]) / 2
    return np.asarray(np.interp(t_s, middle_s, angle_rad))
