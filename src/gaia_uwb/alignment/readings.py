"""The readings of a scene and its path: poses at their times, predicted ranges, residuals.

Anchors are laid out a few at a time, as rows padded to the longest of them, so that the memory does
not grow with the log.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from gaia_uwb._shared import Array, Bool, Float64, Int64
from gaia_uwb.scene import Scene, Trajectory
from gaia_uwb.solver import SolverOptions, solve

ROUNDING_S = 1e-6
"""What double precision may make of a difference between two times since 1970, and more."""

_BURST = 0.1  # of the mean interval
_BLOCK = 1 << 18  # readings laid out together, with their padding
_SIGMA_M = 0.1  # only a unit: the scale of the errors is estimated
_OPTIONS = SolverOptions(tolerance=1e-3)


LONGEST_INTERVAL_S = 8.0
"""Readings of an anchor further apart than this have a gap between them, whatever its rate."""


def usual_interval_s(t_s: Float64[Array, "R"]) -> float:
    """Return the median interval between readings, or poses, with what comes in a burst as one.

    A burst is a few nearly equal stamps and then a pause: its intervals are far shorter than the
    mean. Gaps are longer than :data:`LONGEST_INTERVAL_S`. Both are left out.

    Parameters
    ----------
    t_s : (R,)
        Their times in increasing order, in seconds.

    Returns
    -------
    float
        In seconds; NaN if no interval is left.

    Examples
    --------
    >>> import numpy as np
    >>> bursts_s = np.array([0.0, 0.01, 0.02, 1.0, 1.01, 1.02, 2.0, 60.0])
    >>> round(usual_interval_s(bursts_s), 2)
    0.98
    """
    interval_s = np.diff(t_s)
    interval_s = interval_s[(interval_s > 0.0) & (interval_s <= LONGEST_INTERVAL_S)]
    if not interval_s.size:
        return np.nan
    return float(np.median(interval_s[interval_s >= _BURST * interval_s.mean()]))


@dataclass(frozen=True)
class Readings:
    """The readings of n anchors of a scene, one row per anchor in the order of time.

    Parameters
    ----------
    anchors
        Which anchors.
    index : (n, R)
        Row of each reading in the scene's log; -1 for padding.
    t_s, range_m : (n, R)
        Time in the radio's clock and measured range; NaN for padding.
    """

    anchors: range
    index: Int64[Array, "n R"]
    t_s: Float64[Array, "n R"]
    range_m: Float64[Array, "n R"]


def gather_readings(scene: Scene, *, every: int = 1) -> Iterator[Readings]:
    """Yield a scene's readings anchor by anchor, as many anchors at a time as memory allows.

    Parameters
    ----------
    scene
        The scene.
    every
        Take every so many-th reading of each anchor.

    Yields
    ------
    Readings
        All anchors, in their order; one without readings has a row of padding.
    """
    log = scene.ranges
    # Small integers are sorted in linear time.
    small = log.anchor.astype(np.min_scalar_type(scene.n_anchors))
    order = np.argsort(small, kind="stable")
    end = np.cumsum(np.bincount(small, minlength=scene.n_anchors))
    start = np.concatenate([[0], end[:-1]])
    count = -(-(end - start) // every)
    for anchors in _blocks(count):
        own = slice(anchors.start, anchors.stop)
        at = start[own, None] + every * np.arange(max(int(count[own].max()), 1))
        there = at < end[own, None]
        index = np.where(there, order[np.minimum(at, len(order) - 1)], -1)
        yield Readings(
            anchors=anchors,
            index=index,
            t_s=np.where(there, log.t_s[index], np.nan),
            range_m=np.where(there, log.range_m[index], np.nan),
        )


def _blocks(count: Int64[Array, "N"]) -> Iterator[range]:
    """Yield neighbouring anchors whose padded rows together fit into a block; at least one."""
    first, longest = 0, 0
    for n, own in enumerate(count.tolist()):
        if n > first and max(longest, own) * (n + 1 - first) > _BLOCK:
            yield range(first, n)
            first, longest = n, 0
        longest = max(longest, own)
    yield range(first, len(count))


@dataclass(frozen=True)
class Pose:
    """The tag antenna's pose at given times.

    Parameters
    ----------
    position_m : (..., 2)
        East and north of the antenna.
    up_m : (...)
        Its height, 0 where heights are unknown.
    known : (...)
        False outside the trajectory and inside its gaps.
    """

    position_m: Float64[Array, "*shape 2"]
    up_m: Float64[Array, "*shape"]
    known: Bool[Array, "*shape"]


def pose_at(trajectory: Trajectory, t_s: Float64[Array, "*shape"], max_gap_s: float) -> Pose:
    """Interpolate the pose linearly; not across a gap of more than ``max_gap_s`` seconds.

    Parameters
    ----------
    trajectory
        The known path.
    t_s
        Times in the trajectory's clock, in seconds; NaN gives an unknown pose.
    max_gap_s
        Longest time between two samples of the trajectory that is interpolated.

    Returns
    -------
    Pose
        Always known at the samples themselves.

    Examples
    --------
    >>> import numpy as np
    >>> drive = Trajectory(np.array([0.0, 1.0, 9.0]), np.array([[0.0, 0], [8, 0], [80, 0]]))
    >>> pose = pose_at(drive, np.array([0.25, 1.0, 4.0]), max_gap_s=1.0)
    >>> pose.position_m[0], pose.known
    (array([2., 0.]), array([ True,  True, False]))
    """
    time = trajectory.t_s
    at = np.nan_to_num(t_s, nan=time[0] - 1.0)
    k = np.clip(np.searchsorted(time, at, side="right") - 1, 0, len(time) - 2)
    step = time[k + 1] - time[k]
    share = np.clip((at - time[k]) / step, 0.0, 1.0)
    delta = trajectory.position_m[k + 1] - trajectory.position_m[k]
    up = np.zeros_like(at)
    if trajectory.up_m is not None:
        up = trajectory.up_m[k] + share * (trajectory.up_m[k + 1] - trajectory.up_m[k])
    bridged = (step <= max_gap_s + ROUNDING_S) | (at == time[k]) | (at == time[k + 1])
    return Pose(
        position_m=trajectory.position_m[k] + share[..., None] * delta,
        up_m=up,
        known=(at >= time[0]) & (at <= time[-1]) & bridged,
    )


def anchor_heights(scene: Scene) -> Float64[Array, "N"]:
    """Return the anchors' heights, NaN where a height gap cannot be known."""
    if scene.anchor_up_m is None or scene.trajectory.up_m is None:
        return np.full(scene.n_anchors, np.nan)
    return scene.anchor_up_m


def slant_m(
    position_m: Float64[Array, "*#shape 2"],
    up_m: Float64[Array, "*#shape"],
    anchor_m: Float64[Array, "*#shape 2"],
    anchor_up_m: Float64[Array, "*#shape"],
) -> Float64[Array, "*shape"]:
    """Return slant distances in metres, broadcast; a NaN anchor height counts as no height gap.

    Parameters
    ----------
    position_m, up_m
        East and north of the tag's antenna, and its height, in metres.
    anchor_m, anchor_up_m
        The same of the anchors.

    Examples
    --------
    >>> import numpy as np
    >>> slant_m(np.zeros((1, 2)), np.array([2.0]), np.array([[3.0, 6.0]]), np.array([0.0]))
    array([7.])
    """
    gap = np.nan_to_num(up_m - anchor_up_m, nan=0.0)
    delta = position_m - anchor_m
    return np.asarray(np.sqrt(delta[..., 0] ** 2 + delta[..., 1] ** 2 + gap**2))


@dataclass(frozen=True)
class Fit:
    """Anchors located from all their readings under one clock offset.

    Parameters
    ----------
    anchor_m : (n, 2)
        The better hypothesis of each anchor; NaN where it has too few readings.
    predicted_m, residual_m : (n, R)
        Predicted range, and measured minus predicted; the residual is NaN where a reading took no
        part.
    weight : (n, R)
        Inverse variance of each reading times its robust weight, 0 where it took no part.
    curvature : (n, R)
        Second derivative of each reading's negative log likelihood by the predicted range; below
        the weight, negative for an outlier, 0 where a reading took no part.
    negative_log_likelihood
        Summed over the anchors.
    pose
        Poses under that offset, shape (n, R).
    """

    anchor_m: Float64[Array, "n 2"]
    predicted_m: Float64[Array, "n R"]
    residual_m: Float64[Array, "n R"]
    weight: Float64[Array, "n R"]
    curvature: Float64[Array, "n R"]
    negative_log_likelihood: float
    pose: Pose


def fit_anchors(
    scene: Scene,
    readings: Readings,
    offset_s: float,
    max_gap_s: float,
    inside: Bool[Array, "n R"] | None = None,
) -> Fit:
    """Locate anchors from all their readings, given a clock offset; robust, no gate needed.

    Parameters
    ----------
    scene, readings
        The scene and gathered readings of it.
    offset_s
        A reading stamped t belongs to the pose at ``t - offset_s``.
    max_gap_s
        Longest gap of the trajectory that is interpolated.
    inside : (n, R), optional
        Which readings take part, of those with a known pose; all by default.

    Returns
    -------
    Fit
        Anchors and residuals.
    """
    pose = pose_at(scene.trajectory, readings.t_s - offset_s, max_gap_s)
    use = pose.known if inside is None else pose.known & inside
    up = anchor_heights(scene)[readings.anchors.start : readings.anchors.stop, None]
    found = solve(
        pose.position_m,
        np.where(use, readings.range_m, np.nan)[:, None],
        _SIGMA_M,
        height_m=(pose.up_m, up),
        options=_OPTIONS,
    )
    cost = np.nan_to_num(found.negative_log_likelihood[:, 0], nan=np.inf)
    rows, best = np.arange(len(cost)), np.argmin(cost, axis=1)
    anchor = found.position_m[rows, 0, best]
    predicted = slant_m(pose.position_m, pose.up_m, anchor[:, None], up)
    residual = np.where(use, readings.range_m - predicted, np.nan)
    dof = _OPTIONS.dof  # of Student-t errors
    spread2 = dof * (_SIGMA_M * found.scale[rows, 0, best, None]) ** 2
    weight = (dof + 1.0) / (spread2 + residual**2)
    curvature = weight * (spread2 - residual**2) / (spread2 + residual**2)
    return Fit(
        anchor_m=anchor,
        predicted_m=predicted,
        residual_m=residual,
        weight=np.nan_to_num(weight, nan=0.0),
        curvature=np.nan_to_num(curvature, nan=0.0),
        negative_log_likelihood=float(cost[rows, best][np.isfinite(anchor[:, 0])].sum()),
        pose=pose,
    )
