"""Heading, roll and pitch of the orientations in a ROS log, which are quaternions."""

from __future__ import annotations

import numpy as np

from gaia_uwb._shared import Array, Float64

_LEAST_LENGTH, _MOST_LENGTH = 0.9, 1.1  # of a quaternion; what is outside is none
_IDENTITY = 1e-9


def attitude(quaternion: Float64[Array, "R 4"]) -> dict[str, Float64[Array, "R"]]:
    """Return what orientations say of a vehicle whose axes are as in REP 103.

    Parameters
    ----------
    quaternion : (R, 4)
        x, y, z, w of the vehicle's orientation in the frame of the positions.

    Returns
    -------
    dict
        ``heading_deg`` (clockwise from north, where the frame's x counts as east), ``roll_deg`` and
        ``pitch_deg``, NaN where an orientation is no rotation; empty if none is known: programs
        that know no orientation write the same rotation by nothing, or zeros.

    Examples
    --------
    >>> west, never_set = [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 0.0]
    >>> attitude(np.array([west, never_set]))["heading_deg"].tolist()
    [270.0, nan]
    >>> attitude(np.array([[0.0, 0.0, 0.0, 1.0]]))
    {}
    """
    length = np.linalg.norm(quaternion, axis=1)
    known = (length >= _LEAST_LENGTH) & (length <= _MOST_LENGTH)
    turned = known & (np.abs(quaternion[:, :3]).max(axis=1) > _IDENTITY)
    if not turned.any():
        return {}
    x, y, z, w = np.where(known, quaternion.T / np.where(known, length, 1.0), np.nan)
    yaw_rad = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    roll_rad = np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    pitch_rad = np.arcsin(np.clip(2 * (w * y - z * x), -1.0, 1.0))
    return {
        "heading_deg": (90.0 - np.degrees(yaw_rad)) % 360.0,
        "roll_deg": np.degrees(roll_rad),
        "pitch_deg": np.degrees(pitch_rad),
    }
