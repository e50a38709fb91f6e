"""Bring a scene's ranges and path onto one timeline: a Scene becomes an Episode.

1. The clock offset is estimated from the log itself (``clock.py``).
2. Spikes are gated on the readings at their own times (``spikes.py``).
3. Between two readings that are close enough in time, the range is interpolated pose-aware: the
   residual against the range predicted from the pose is interpolated linearly and the prediction
   added back, since at vehicle speed a range is far from linear between two readings.

The timeline is the trajectory's, thinned where the path is sampled at least twice as often as the
ranges and subdivided where it is sampled at most half as often. Both go by time, not by number, so
that neither bursts of poses nor a change of their rate matter.

What becomes of every reading is counted (``ReadingCounts``), for every step gets a range that may
be interpolated between two of them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gaia_uwb._shared import Array, Bool, Float64, InputError, Int64
from gaia_uwb.alignment.clock import estimate_clock_offset
from gaia_uwb.alignment.implausible import log_notes, spike_problems
from gaia_uwb.alignment.readings import (
    LONGEST_INTERVAL_S,
    ROUNDING_S,
    Fit,
    Readings,
    anchor_heights,
    fit_anchors,
    gather_readings,
    pose_at,
    slant_m,
    usual_interval_s,
)
from gaia_uwb.alignment.spikes import gate_spikes
from gaia_uwb.config import AlignmentConfig
from gaia_uwb.episode import ClockOffset, Episode, EpisodeTruth, RangeReadings, ReadingCounts
from gaia_uwb.scene import Scene

_LEAST_SPAN_M = 1.0  # a path that spans less tells how far anchors are, but not where
_SHORTEST_S = 1e-3  # no timeline is finer than this, whatever the stamps of the readings
_NEAR = 0.01  # rates come from rounded times: of two steps, this share is no difference
_NEIGHBOURS = 2  # steps before and after a step that tell the rate of the path there
_GAP_INTERVALS, _LEAST_GAP_S = 3.0, 1.0  # of "auto"


def align(
    scene: Scene,
    config: AlignmentConfig = AlignmentConfig(),
    *,
    clock: ClockOffset | None = None,
) -> Episode:
    """Bring a scene onto one timeline.

    Parameters
    ----------
    scene
        The log. Its truth is carried over to the timeline, but nothing is decided by it.
    config
        Settings of the alignment.
    clock
        The clock offset, where it is known; it is estimated by default.

    Returns
    -------
    Episode
        Ranges of all anchors on one timeline, with the clock offset that was found. Steps without
        a known pose are not on it.

    Raises
    ------
    InputError
        If the clocks of ranges and trajectory do not overlap, the vehicle is parked, or no range
        is usable.

    Examples
    --------
    >>> from gaia_uwb.alignment import align
    >>> from gaia_uwb.simulate import PRESETS, simulate_pass
    >>> episode = align(simulate_pass(PRESETS["lane-closure"], seed=0))
    >>> episode.range_m.shape, episode.clock.applied
    ((481, 8), True)
    """
    _check_overlap(scene, config)
    _check_moves(scene)
    clock = estimate_clock_offset(scene, config) if clock is None else clock
    steps = _known_steps(scene, config)
    range_m = np.full((len(steps.t_s), scene.n_anchors), np.nan)
    counts: dict[str, ReadingCounts] = {}
    for readings in gather_readings(scene):
        fit = fit_anchors(scene, readings, clock.applied_s, config.max_pose_gap_s)
        for row, n in enumerate(readings.anchors):
            range_m[:, n], counts[scene.anchor_ids[n]] = _anchor_ranges(
                steps, readings, fit, row, clock.applied_s, config
            )
    range_m.flags.writeable = False  # so that the episode takes it without a copy
    valid = np.isfinite(range_m)
    if not valid.any():
        raise InputError(
            "no usable ranges: no two readings are close enough in time on a known stretch of "
            "the path",
            source=scene.name,
        )
    return Episode(
        name=scene.name,
        anchor_ids=scene.anchor_ids,
        t_s=steps.t_s,
        position_m=steps.position_m,
        range_m=range_m,
        valid=valid,
        tag_up_m=None if scene.trajectory.up_m is None else steps.up_m,
        anchor_up_m=scene.anchor_up_m,
        frame=scene.frame,
        clock=clock,
        truth=_truth(scene, steps, clock),
        notes=tuple(log_notes(scene, counts)),
        problems=tuple(spike_problems(counts)),
        readings=counts,
        own_times=_own_times(scene, clock.applied_s, config),
        tag=scene.tags[0] if len(scene.tags) == 1 else None,
        cone_ranges=scene.cone_ranges,
        drive=scene.drive,
        vehicle=scene.vehicle,
    )


def _own_times(scene: Scene, offset_s: float, config: AlignmentConfig) -> RangeReadings:
    """Return the readings whose pose is known, at their own times."""
    log = scene.ranges
    t_s = log.t_s - offset_s
    known = pose_at(scene.trajectory, t_s, config.max_pose_gap_s).known
    readings = RangeReadings(
        t_s=t_s,
        anchor=log.anchor,
        range_m=log.range_m,
        trajectory=scene.trajectory,
        azimuth_rad=log.azimuth_rad,
        azimuth_sigma_rad=log.azimuth_sigma_rad,
    )
    return readings.rows(known)


def _check_overlap(scene: Scene, config: AlignmentConfig) -> None:
    """Refuse a log whose two clocks do not even overlap."""
    path, log = scene.trajectory.t_s, scene.ranges.t_s
    slack = 0.0 if config.clock_offset == "off" else config.max_clock_offset_s
    if log[0] > path[-1] + slack or log[-1] < path[0] - slack:
        raise InputError(
            f"the clocks do not overlap: the trajectory spans {path[0]:.3f} to {path[-1]:.3f} s, "
            f"the ranges span {log[0]:.3f} to {log[-1]:.3f} s",
            source=scene.name,
            column="t_s",
        )


def _check_moves(scene: Scene) -> None:
    """Refuse a log of a parked vehicle, from which nothing can be located."""
    span_m = float(np.hypot(*np.ptp(scene.trajectory.position_m, axis=0)))
    if span_m < _LEAST_SPAN_M:
        raise InputError(
            f"the vehicle hardly moves: its path spans {span_m:.2f} m, and locating a cone takes "
            f"at least {_LEAST_SPAN_M:g} m",
            source=scene.name,
        )


@dataclass(frozen=True)
class _Steps:
    """The timeline's steps, each with a known pose."""

    t_s: Float64[Array, "T"]
    position_m: Float64[Array, "T 2"]
    up_m: Float64[Array, "T"]
    anchor_up_m: Float64[Array, "N"]

    def predicted_m(self, anchor_m: Float64[Array, "2"], n: int) -> Float64[Array, "T"]:
        """Return the slant ranges to anchor ``n`` if it stood at ``anchor_m``."""
        up_m = self.anchor_up_m[n : n + 1]
        return slant_m(self.position_m, self.up_m, anchor_m[None], up_m)


def _known_steps(scene: Scene, config: AlignmentConfig) -> _Steps:
    """Return the steps of the timeline whose pose is known."""
    t_s = _timeline(scene, config.max_pose_gap_s)
    pose = pose_at(scene.trajectory, t_s, config.max_pose_gap_s)
    known = pose.known
    return _Steps(t_s[known], pose.position_m[known], pose.up_m[known], anchor_heights(scene))


def _timeline(scene: Scene, max_pose_gap_s: float) -> Float64[Array, "T"]:
    """Return the trajectory's times, thinned or subdivided to about the rate of the ranges.

    The anchor read most often gives the rate. Where the pose is unknown there are no steps.
    """
    t_s, log = scene.trajectory.t_s, scene.ranges
    own_s = log.t_s[log.anchor == np.argmax(np.bincount(log.anchor))]
    between_s = usual_interval_s(own_s)
    if np.isnan(between_s):
        return t_s
    between_s = max(between_s, _SHORTEST_S)
    return _subdivided(_thinned(t_s, between_s), between_s, max_pose_gap_s)


def _thinned(t_s: Float64[Array, "T"], between_s: float) -> Float64[Array, "K"]:
    """Leave out times so that those that stay are about ``between_s`` apart, or further.

    After each comes the last one at most that much later. One that comes less than half of that
    later, since nothing follows it for a while, is left out as well.
    """
    last = np.searchsorted(t_s, t_s + between_s * (1.0 + 1e-6), side="right") - 1
    after = np.maximum(last, np.arange(len(t_s)) + 1)
    after += t_s[np.minimum(after, len(t_s) - 1)] - t_s < 0.5 * between_s
    following, kept = after.tolist(), [0]
    while following[kept[-1]] < len(t_s):
        kept.append(following[kept[-1]])
    return t_s[kept]


def _subdivided(
    t_s: Float64[Array, "K"], between_s: float, longest_s: float
) -> Float64[Array, "T"]:
    """Subdivide steps of at least twice ``between_s``, where those around them are as long.

    A single long step is a gap, which no step of the timeline needs to be in; so is one of more
    than ``longest_s``.
    """
    step_s = np.diff(t_s)
    if not step_s.size:
        return t_s
    window = np.arange(-_NEIGHBOURS, _NEIGHBOURS + 1)
    near = np.clip(np.arange(len(step_s))[:, None] + window, 0, len(step_s) - 1)
    slow = np.median(step_s[near], axis=1) >= (2.0 - _NEAR) * between_s
    slow &= step_s <= longest_s + ROUNDING_S
    parts = np.where(slow, np.maximum(np.floor(step_s / between_s + _NEAR), 1.0), 1.0)
    index = np.repeat(np.arange(len(step_s)), parts.astype(np.int64))
    part = np.arange(len(index)) - np.searchsorted(index, index)
    return np.append(t_s[index] + part / parts[index] * step_s[index], t_s[-1])


def _anchor_ranges(
    steps: _Steps,
    readings: Readings,
    fit: Fit,
    row: int,
    offset_s: float,
    config: AlignmentConfig,
) -> tuple[Float64[Array, "T"], ReadingCounts]:
    """Return one anchor's ranges at the steps, NaN where no reading is near enough.

    With them comes what became of its readings.
    """
    n_log = int((readings.index[row] >= 0).sum())
    own = np.flatnonzero(fit.pose.known[row])
    outside = n_log - len(own)
    if not len(own):
        nowhere = np.full(len(steps.t_s), np.nan)
        return nowhere, ReadingCounts(n_log, 0, 0, 0, outside, n_steps=0)
    max_gap_s = _max_gap_s(readings.t_s[row, own], config)
    own_s, range_m = readings.t_s[row, own] - offset_s, readings.range_m[row, own]
    anchor_m, residual_m = fit.anchor_m[row], fit.residual_m[row, own]
    located = bool(np.isfinite(anchor_m).all())
    if config.gate and located:
        keep = gate_spikes(own_s, residual_m)
        own_s, range_m, residual_m = own_s[keep], range_m[keep], residual_m[keep]
    if config.resample == "nearest":
        found_m = _nearest(steps.t_s, own_s, range_m, max_gap_s)
        near = _near_a_step(steps.t_s, own_s, max_gap_s)
    else:
        found_m = _linear(steps.t_s, own_s, residual_m if located else range_m, max_gap_s)
        near = _near_another(steps.t_s, own_s, max_gap_s)
        if located:
            found_m = found_m + steps.predicted_m(anchor_m, readings.anchors[row])
    n_steps = int(np.isfinite(found_m).sum())
    kept = int(near.sum()) if n_steps else 0
    spikes, in_gaps = len(own) - len(own_s), len(own_s) - kept
    return found_m, ReadingCounts(n_log, kept, spikes, in_gaps, outside, n_steps=n_steps)


def _max_gap_s(own_s: Float64[Array, "K"], config: AlignmentConfig) -> float:
    """Return the longest gap between an anchor's readings that is interpolated."""
    if config.max_gap_s != "auto":
        return config.max_gap_s
    usual_s = np.nan_to_num(usual_interval_s(own_s), nan=0.0)
    return float(np.clip(_GAP_INTERVALS * usual_s, _LEAST_GAP_S, LONGEST_INTERVAL_S))


def _near_another(
    t_s: Float64[Array, "T"], own_s: Float64[Array, "K"], max_gap_s: float
) -> Bool[Array, "K"]:
    """Return which readings are at most ``max_gap_s`` from another, or exactly at a step."""
    close = np.diff(own_s) <= max_gap_s + ROUNDING_S
    near = np.append(close, False) | np.append(False, close) | np.isin(own_s, t_s)
    return np.asarray(near)


def _near_a_step(
    t_s: Float64[Array, "T"], own_s: Float64[Array, "K"], max_gap_s: float
) -> Bool[Array, "K"]:
    """Return which readings are at most half of ``max_gap_s`` from a step."""
    nearest_s = t_s[_nearest_index(own_s, t_s)]
    return np.asarray(np.abs(nearest_s - own_s) <= 0.5 * max_gap_s + ROUNDING_S)


def _linear(
    t_s: Float64[Array, "T"],
    own_s: Float64[Array, "K"],
    value: Float64[Array, "K"],
    max_gap_s: float,
) -> Float64[Array, "T"]:
    """Interpolate between readings at most ``max_gap_s`` apart; NaN elsewhere."""
    after = np.searchsorted(own_s, t_s)  # first reading at or after each step
    right = np.minimum(after, len(own_s) - 1)
    left = np.maximum(after - 1, 0)
    exact = own_s[right] == t_s
    close = own_s[right] - own_s[left] <= max_gap_s + ROUNDING_S
    between = (after > 0) & (after < len(own_s)) & close
    return np.where(exact | between, np.interp(t_s, own_s, value), np.nan)


def _nearest(
    t_s: Float64[Array, "T"],
    own_s: Float64[Array, "K"],
    value: Float64[Array, "K"],
    max_gap_s: float,
) -> Float64[Array, "T"]:
    """Take the nearest reading, at most half of ``max_gap_s`` away; NaN elsewhere."""
    near = _nearest_index(t_s, own_s)
    close = np.abs(own_s[near] - t_s) <= 0.5 * max_gap_s + ROUNDING_S
    return np.where(close, value[near], np.nan)


def _nearest_index(t_s: Float64[Array, "T"], own_s: Float64[Array, "K"]) -> Int64[Array, "T"]:
    """Return which of the readings is nearest to each step in time."""
    right = np.minimum(np.searchsorted(own_s, t_s), len(own_s) - 1)
    left = np.maximum(right - 1, 0)
    return np.where(np.abs(own_s[left] - t_s) <= np.abs(own_s[right] - t_s), left, right)


def _truth(scene: Scene, steps: _Steps, clock: ClockOffset) -> EpisodeTruth | None:
    """Carry a scene's truth over to the timeline: slant distances, and the nearest NLOS label."""
    if scene.truth is None:
        return None
    anchor_m = scene.truth.anchor_m
    range_m = np.empty((len(steps.t_s), scene.n_anchors))
    for n in range(scene.n_anchors):
        range_m[:, n] = steps.predicted_m(anchor_m[n], n)
    range_m.flags.writeable = False
    nlos = _nlos(scene.truth.nlos, scene, steps.t_s, clock.applied_s)
    return EpisodeTruth(anchor_m=anchor_m, range_m=range_m, nlos=nlos)


def _nlos(
    label: Bool[Array, "R"] | None, scene: Scene, t_s: Float64[Array, "T"], offset_s: float
) -> Bool[Array, "T N"]:
    """Return the NLOS label of the reading nearest to each step; False where there is none."""
    nlos = np.zeros((len(t_s), scene.n_anchors), dtype=np.bool_)
    if label is not None:
        for readings in gather_readings(scene):
            for row, n in enumerate(readings.anchors):
                own = readings.index[row][readings.index[row] >= 0]
                if len(own):
                    near = _nearest_index(t_s, scene.ranges.t_s[own] - offset_s)
                    nlos[:, n] = label[own[near]]
    return nlos
