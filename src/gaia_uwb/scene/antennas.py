"""From the path of the vehicle's reference point to that of an antenna, and one scene per tag.

A lever arm turns with the vehicle. The heading is the log's where the log has one, also between
headings that are near each other in time, as compasses and receivers may run at different rates.
Elsewhere it is the course of the path: the vehicle is assumed to drive forward. The course is
measured between points a metre apart and follows the distance driven: a vehicle that stands is
turned neither by a receiver's noise nor by time. Roll and pitch are taken as 0 where they are
unknown.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gaia_uwb._shared import Array, Bool, Float64, InputError
from gaia_uwb.scene.readings import RangeLog
from gaia_uwb.scene.scenes import Scene, Truth
from gaia_uwb.scene.vehicle import Trajectory

STEP_M = 1.0
"""Least distance between two points that determine the course."""

LONGEST_GAP_S = 2.0
"""Between headings further apart than this, the vehicle may have turned anyhow."""


def tag_scenes(scene: Scene) -> tuple[Scene, ...]:
    """Return one scene per tag, each with the path of that tag's antenna and its own readings.

    Parameters
    ----------
    scene
        With any number of tags.

    Returns
    -------
    tuple of Scene
        In the order of ``tags``, for the tags that have readings. Each has one tag, and the path of
        that tag's antenna; ``trajectory.lever_m`` says where that is from the reference point, and
        ``drive`` which drive it was. Anchors, frame, notes and ranges among the cones are those of
        the scene. A scene without tags, or of one whose path it has already, comes back as it is.

    Raises
    ------
    InputError
        If a lever arm needs a heading that the log does not have, and the vehicle stands.

    Examples
    --------
    >>> import numpy as np
    >>> from gaia_uwb.scene import RangeLog, Scene, Tag, Trajectory, tag_scenes
    >>> drive = Trajectory(t_s=np.array([0.0, 1.0]), position_m=np.array([[0.0, 0.0], [9.0, 0.0]]))
    >>> log = RangeLog(t_s=np.array([0.2, 0.4]), anchor=np.array([0, 0]),
    ...                range_m=np.array([12.0, 10.5]), tag=np.array([0, 1]))
    >>> tags = (Tag("front", forward_m=2.0), Tag("left", left_m=0.5))
    >>> for one in tag_scenes(Scene("pass", drive, log, ("cone-1",), tags=tags)):
    ...     print(one.name, one.trajectory.position_m.tolist(), one.ranges.range_m.tolist())
    pass (tag front) [[2.0, 0.0], [11.0, 0.0]] [12.0]
    pass (tag left) [[0.0, 0.5], [9.0, 0.5]] [10.5]
    """
    if not scene.tags or scene.trajectory.lever_m is not None:
        return (scene,)
    of_tag = scene.ranges.tag
    scenes = []
    for index, tag in enumerate(scene.tags):
        own = np.ones(len(scene.ranges), np.bool_) if of_tag is None else of_tag == index
        if not own.any():
            continue
        try:
            path = antenna_path(scene.trajectory, tag.forward_m, tag.left_m, tag.up_m)
        except InputError as error:
            raise InputError(error.problem, source=scene.name, column="tags") from error
        one = replace(
            scene,
            name=f"{scene.name} (tag {tag.tag_id})",
            trajectory=path,
            ranges=_own_readings(scene.ranges, own),
            truth=None if scene.truth is None else _own_truth(scene.truth, own),
            tags=(tag,),
            drive=scene.drive or scene.name,
        )
        scenes.append(one)
    return tuple(scenes)


def antenna_path(
    trajectory: Trajectory, forward_m: float, left_m: float, up_m: float
) -> Trajectory:
    """Return the path of an antenna, from that of the vehicle's reference point.

    Parameters
    ----------
    trajectory
        Of the reference point.
    forward_m, left_m, up_m
        Where the antenna is from there, in the vehicle's frame, in metres.

    Returns
    -------
    Trajectory
        With ``lever_m``; heights, if the trajectory has any, are those of the antenna.

    Raises
    ------
    InputError
        If the heading is unknown somewhere, and the path is too short to tell its course.

    Examples
    --------
    >>> import numpy as np
    >>> from gaia_uwb.scene import Trajectory, antenna_path
    >>> east_m = np.array([0.0, 5.0, 10.0])
    >>> path = Trajectory(t_s=east_m, position_m=np.column_stack([east_m, np.zeros(3)]))
    >>> antenna_path(path, 2.0, 0.5, 0.0).position_m.tolist()
    [[2.0, 0.5], [7.0, 0.5], [12.0, 0.5]]
    """
    ahead_m, leftward_m, upward_m = _levelled(trajectory, forward_m, left_m, up_m)
    lever_m = np.zeros_like(trajectory.position_m)
    if ahead_m.any() or leftward_m.any():
        heading_rad = heading(trajectory)
        cosine, sine = np.cos(heading_rad), np.sin(heading_rad)
        east_m = ahead_m * cosine - leftward_m * sine
        north_m = ahead_m * sine + leftward_m * cosine
        lever_m = np.column_stack([east_m, north_m])
    heights_m = None if trajectory.up_m is None else trajectory.up_m + upward_m
    position_m = trajectory.position_m + lever_m
    return replace(trajectory, position_m=position_m, up_m=heights_m, lever_m=lever_m)


def _levelled(
    trajectory: Trajectory, forward_m: float, left_m: float, up_m: float
) -> tuple[Float64[Array, "T"], Float64[Array, "T"], Float64[Array, "T"]]:
    """Return a lever arm as it lies when the vehicle was rolled and then pitched."""
    roll_rad, pitch_rad = (
        np.zeros(len(trajectory)) if angle_rad is None else np.nan_to_num(angle_rad, nan=0.0)
        for angle_rad in (trajectory.roll_rad, trajectory.pitch_rad)
    )
    leftward_m = left_m * np.cos(roll_rad) - up_m * np.sin(roll_rad)
    rolled_m = left_m * np.sin(roll_rad) + up_m * np.cos(roll_rad)
    ahead_m = forward_m * np.cos(pitch_rad) + rolled_m * np.sin(pitch_rad)
    upward_m = rolled_m * np.cos(pitch_rad) - forward_m * np.sin(pitch_rad)
    return ahead_m, leftward_m, upward_m


def heading(trajectory: Trajectory) -> Float64[Array, "T"]:
    """Return the log's heading, and the course of the path where it has none.

    Parameters
    ----------
    trajectory
        Of any point of the vehicle.

    Returns
    -------
    (T,)
        In radians, counter-clockwise from east.

    Raises
    ------
    InputError
        If the heading is unknown somewhere, and the path is too short to tell its course.
    """
    given = trajectory.heading_rad
    if given is None or not np.isfinite(given).any():
        return course(trajectory.position_m)
    heading_rad = _without_gaps(trajectory.t_s, given)
    known = np.isfinite(heading_rad)
    if known.all():
        return heading_rad
    return np.where(known, heading_rad, course(trajectory.position_m))


def _without_gaps(
    t_s: Float64[Array, "T"], heading_rad: Float64[Array, "T"]
) -> Float64[Array, "T"]:
    """Return headings, interpolated where those before and after are near each other in time."""
    known = np.isfinite(heading_rad)
    before_s = np.maximum.accumulate(np.where(known, t_s, -np.inf))
    after_s = np.minimum.accumulate(np.where(known, t_s, np.inf)[::-1])[::-1]
    between_rad = np.interp(t_s, t_s[known], np.unwrap(heading_rad[known]))
    near = after_s - before_s <= LONGEST_GAP_S
    return np.where(known, heading_rad, np.where(near, between_rad, np.nan))


def course(position_m: Float64[Array, "T 2"]) -> Float64[Array, "T"]:
    """Return the direction of travel in radians, counter-clockwise from east.

    Parameters
    ----------
    position_m : (T, 2)
        East and north of a path, in metres.

    Raises
    ------
    InputError
        If the path is too short to tell.
    """
    kept = [0]
    last = position_m[0]
    for index, place in enumerate(position_m):
        if np.hypot(*(place - last)) >= STEP_M:
            kept.append(index)
            last = place
    if len(kept) < 2:
        problem = "a lever arm needs a heading, but the path never gets 1 m from its start"
        raise InputError(problem)
    chord_m = np.diff(position_m[kept], axis=0)
    angle_rad = np.unwrap(np.arctan2(chord_m[:, 1], chord_m[:, 0]))
    driven_m = np.concatenate([[0.0], np.cumsum(np.hypot(*chord_m.T))])  # at the kept points
    since = np.searchsorted(kept, np.arange(len(position_m)), side="right") - 1
    from_kept_m = np.hypot(*(position_m - position_m[kept][since]).T)
    progress_m = np.maximum.accumulate(driven_m[since] + from_kept_m)
    return np.asarray(np.interp(progress_m, (driven_m[1:] + driven_m[:-1]) / 2, angle_rad))


def _own_readings(ranges: RangeLog, own: Bool[Array, "R"]) -> RangeLog:
    """Return a tag's readings, which need not say whose they are."""
    return RangeLog(
        t_s=ranges.t_s[own],
        anchor=ranges.anchor[own],
        range_m=ranges.range_m[own],
        rssi_dbm=_rows(ranges.rssi_dbm, own),
        rssi_fp_dbm=_rows(ranges.rssi_fp_dbm, own),
        azimuth_rad=_rows(ranges.azimuth_rad, own),
        azimuth_sigma_rad=_rows(ranges.azimuth_sigma_rad, own),
    )


def _own_truth(truth: Truth, own: Bool[Array, "R"]) -> Truth:
    return replace(
        truth,
        nlos=_rows(truth.nlos, own),
        range_m=_rows(truth.range_m, own),
        outlier=_rows(truth.outlier, own),
        bias_m=_rows(truth.bias_m, own),
    )


def _rows(values: Array | None, own: Bool[Array, "R"]) -> Array | None:
    return None if values is None else values[own]
