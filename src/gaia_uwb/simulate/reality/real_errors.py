"""The errors of a surveyed log's ranges: each reading minus the true distance, two definitions.

``corrected`` is what a radio does wrong: each reading at its own time, the clock offset and the
heights of both antennas accounted for. ``paper`` imitates how the paper must have measured its
statistics, which it does not say: ranges are held until the next one comes, on a regular timeline,
and compared with distances without the clock offset and with the tag's antenna at the level of the
path, not above it. Most of what this gives are errors of the comparison, not of the radio.

>>> from gaia_uwb.simulate.reality.real_errors import ErrorDefinition, range_errors
>>> from gaia_uwb.simulate import PRESETS, simulate_pass
>>> tracks = range_errors(simulate_pass(PRESETS["lane-closure"], seed=0), ErrorDefinition.CORRECTED)
>>> len(tracks)
8
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from gaia_uwb._shared import Array, Bool, Float64, InputError, Int64
from gaia_uwb.alignment import anchor_heights, estimate_clock_offset, pose_at, slant_m
from gaia_uwb.config import AlignmentConfig
from gaia_uwb.scene import Scene

HELD_RATE_HZ = 10.0
"""Samples per second of the ``paper`` definition's timeline: about the radios' rate."""
ANTENNA_UP_M = 1.0
"""How high the outdoor data set's tag is carried above the path that the ``paper`` definition
takes for the antenna's."""


class ErrorDefinition(StrEnum):
    """How a range is compared with the truth; the value is what people see."""

    CORRECTED = "corrected"
    PAPER = "paper"


@dataclass(frozen=True)
class ErrorTrack:
    """One anchor's errors in the order of time.

    Parameters
    ----------
    t_s : (R,)
        Time in the radio's clock, in seconds.
    error_m : (R,)
        Measured minus true distance, in metres; NaN where the pose is not known.
    true_m : (R,)
        The true distance, in metres.
    reading : (R,)
        Row of the scene's log that the error is of.
    """

    t_s: Float64[Array, "R"]
    error_m: Float64[Array, "R"]
    true_m: Float64[Array, "R"]
    reading: Int64[Array, "R"]


def range_errors(scene: Scene, definition: ErrorDefinition) -> list[ErrorTrack]:
    """Return the errors of a surveyed scene's ranges, one track per anchor that has readings.

    Parameters
    ----------
    scene
        A log with surveyed anchors.
    definition
        How ranges are compared with the truth.

    Raises
    ------
    InputError
        If the scene has no surveyed anchors.

    Notes
    -----
    Positions come from the recorded path, so its own noise and a turn of its frame against the
    survey's count as errors of the ranges.
    """
    if scene.truth is None:
        raise InputError("expected surveyed anchors to compare ranges with", source=scene.name)
    corrected = definition is ErrorDefinition.CORRECTED
    offset_s = clock_offset_s(scene) if corrected else 0.0
    lowered_m = 0.0 if corrected else ANTENNA_UP_M
    tracks = []
    for n in range(scene.n_anchors):
        own = np.flatnonzero(scene.ranges.anchor == n)
        if not len(own):
            continue
        own_s = scene.ranges.t_s[own]
        t_s = own_s if corrected else _held_times_s(scene, float(own_s[0]))
        reading = own if corrected else own[np.searchsorted(own_s, t_s, side="right") - 1]
        true_m, known = true_range_m(scene, n, t_s - offset_s, lowered_m=lowered_m)
        error_m = np.where(known, scene.ranges.range_m[reading] - true_m, np.nan)
        tracks.append(ErrorTrack(t_s, error_m, true_m, reading))
    return tracks


def true_range_m(
    scene: Scene, anchor: int, t_s: Float64[Array, "R"], *, lowered_m: float = 0.0
) -> tuple[Float64[Array, "R"], Bool[Array, "R"]]:
    """Return the slant distance between the path and a surveyed anchor, and whether it is known.

    Parameters
    ----------
    scene
        A log with surveyed anchors.
    anchor
        Index of the anchor.
    t_s : (R,)
        Times in the trajectory's clock, in seconds.
    lowered_m
        How much lower than recorded the tag's antenna is taken to be, in metres.

    Returns
    -------
    (R,), (R,)
        In metres, interpolated also in the path's gaps; False where the pose is not known well.

    Raises
    ------
    InputError
        If the scene has no surveyed anchors.
    """
    if scene.truth is None:
        raise InputError("expected surveyed anchors to compare ranges with", source=scene.name)
    pose = pose_at(scene.trajectory, t_s, AlignmentConfig().max_pose_gap_s)
    anchor_m, up_m = scene.truth.anchor_m[anchor], anchor_heights(scene)[anchor : anchor + 1]
    distance_m = slant_m(pose.position_m, pose.up_m - lowered_m, anchor_m[None], up_m)
    return distance_m, pose.known


def clock_offset_s(scene: Scene) -> float:
    """Return a scene's clock offset: the true one where it is known, else what the log tells.

    Parameters
    ----------
    scene
        The log.
    """
    if scene.truth is not None and scene.truth.clock_offset_s is not None:
        return scene.truth.clock_offset_s
    return estimate_clock_offset(scene, AlignmentConfig()).applied_s


def _held_times_s(scene: Scene, first_s: float) -> Float64[Array, "R"]:
    """Return regular times from an anchor's first reading to the end of the log or the path."""
    path_s = scene.trajectory.t_s
    start_s, end_s = max(first_s, path_s[0]), min(scene.ranges.t_s[-1], path_s[-1])
    return np.asarray(start_s + np.arange(0.0, end_s - start_s, 1.0 / HELD_RATE_HZ))
