"""The rotation and shift that bring estimated places closest to surveyed ones."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gaia_uwb._shared import Array, Float64, InputError, check_finite, check_shape
from gaia_uwb.zone import cross


@dataclass(frozen=True)
class RigidAlignment:
    """Points that were turned about the frame's origin and then shifted.

    Parameters
    ----------
    points_m : (N, 2)
        The moved points, in metres.
    rotation_rad
        Counter-clockwise, in [-pi, pi].
    translation_m : (2,)
        East and north, in metres.
    """

    points_m: Float64[Array, "N 2"]
    rotation_rad: float
    translation_m: Float64[Array, "2"]


def rigid_align(
    estimated_m: Float64[Array, "N 2"], true_m: Float64[Array, "M 2"]
) -> RigidAlignment:
    """Move points rigidly onto their true places, with the least sum of squared distances.

    There is no scale and no reflection: a mirrored layout stays mirrored.

    Parameters
    ----------
    estimated_m, true_m : (N, 2)
        The same N points in both, in metres.

    Returns
    -------
    RigidAlignment
        With rotation 0 where the points cannot tell it (one point, or all in one place).

    Raises
    ------
    InputError
        If there is no point, the shapes differ, or a number is not finite.

    Examples
    --------
    >>> true_m = np.array([[0.0, 0.0], [4.0, 0.0], [0.0, 3.0]])
    >>> alignment = rigid_align(true_m[:, ::-1] * [-1.0, 1.0] + [7.0, 0.0], true_m)
    >>> bool(np.allclose(alignment.points_m, true_m)), round(np.degrees(alignment.rotation_rad))
    (True, -90)
    """
    if not len(estimated_m):
        raise InputError("expected at least one point to align, got none", column="estimated_m")
    check_shape("true_m", true_m, estimated_m.shape)
    check_finite("estimated_m", estimated_m)
    check_finite("true_m", true_m)
    centre_m, true_centre_m = estimated_m.mean(axis=0), true_m.mean(axis=0)
    local, target = estimated_m - centre_m, true_m - true_centre_m
    # In the plane, Kabsch's rotation has a closed form.
    angle_rad = float(np.arctan2(cross(local, target).sum(), (local * target).sum()))
    turn = rotation_matrix(angle_rad)
    return RigidAlignment(
        points_m=local @ turn.T + true_centre_m,
        rotation_rad=angle_rad,
        translation_m=true_centre_m - turn @ centre_m,
    )


def rotation_matrix(angle_rad: float) -> Float64[Array, "2 2"]:
    """Return the matrix that turns a column vector counter-clockwise by an angle in radians."""
    cos, sin = np.cos(angle_rad), np.sin(angle_rad)
    return np.array([[cos, -sin], [sin, cos]])
