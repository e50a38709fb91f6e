"""Estimate the offset between the radio's clock and the trajectory's, without any truth.

A range stamped ``t`` belongs to the pose at ``t - offset``. For each offset the anchors are located
anew; the offset under which ranges and path agree best is the estimate. Its standard error is a
sandwich: inside, residuals summed over stretches of several seconds and over anchors, since those
err alike; outside, what is left of the range rate once the anchors have been allowed to move with
the offset and the noise of the path is taken away. On a straight path at constant speed an offset
is the same as moving all anchors along the path, and a parked vehicle's path is noise: then the
standard error is infinite, and the offset is not applied.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gaia_uwb._shared import Array, Bool, Float64
from gaia_uwb.alignment.readings import (
    ROUNDING_S,
    Fit,
    Readings,
    fit_anchors,
    gather_readings,
    pose_at,
)
from gaia_uwb.config import AlignmentConfig
from gaia_uwb.episode import ClockOffset
from gaia_uwb.scene import Scene, Trajectory

_MAX_READINGS = 40_000  # a scan uses no more; every k-th reading is enough for one number
_MIN_READINGS = 8  # of one anchor: fewer determine nothing besides its position
_SCAN_STEP_S = 0.1
_MAX_STEPS = 8
_VELOCITY_OVER_S = 0.5
# An offset this many standard errors from 0 is significant: the two-sided 0.27 % quantile of
# Student's t (3 sigma of a Gaussian), since a standard error from K stretches of time has K - 1
# degrees of freedom.
_DEGREES = np.array([1, 2, 3, 4, 5, 6, 8, 10, 15, 20, 30, 60, np.inf])
_STANDARD_ERRORS = np.array(
    [235.8, 19.21, 9.219, 6.62, 5.507, 4.904, 4.277, 3.957, 3.586, 3.422, 3.270, 3.130, 3.0]
)


def estimate_clock_offset(scene: Scene, config: AlignmentConfig) -> ClockOffset:
    """Estimate a scene's clock offset and decide whether it differs significantly from zero.

    Parameters
    ----------
    scene
        The log; its truth is not used.
    config
        ``clock_offset``, ``max_clock_offset_s``, ``clock_offset_sigma_s``, ``error_correlation_s``
        and ``max_pose_gap_s`` are used.

    Returns
    -------
    ClockOffset
        ``applied`` where the estimate is further from 0 than chance brings it in 0.27 % of cases.
    """
    if config.clock_offset == "off":
        return ClockOffset(0.0, 0.0, False, "both clocks are trusted, as set")
    bound, gap = config.max_clock_offset_s, config.max_pose_gap_s
    every = max(1, len(scene.ranges) // _MAX_READINGS)
    blocks = list(gather_readings(scene, every=every))
    reach = bound + 0.5 * _baseline_s(scene.trajectory)
    inside = [_always_posed(scene.trajectory, block.t_s, reach, gap) for block in blocks]
    if max(int(use.sum(axis=1).max()) for use in inside) < _MIN_READINGS:
        prior = config.clock_offset_sigma_s
        return ClockOffset(0.0, prior, False, "too few ranges along the path to determine it")

    def fits(offset_s: float) -> list[Fit]:
        return [
            fit_anchors(scene, block, offset_s, gap, use)
            for block, use in zip(blocks, inside, strict=True)
        ]

    count = int(np.ceil(bound / _SCAN_STEP_S))
    grid = np.linspace(-bound, bound, 2 * count + 1)
    cost = [sum(fit.negative_log_likelihood for fit in fits(float(d))) for d in grid]
    offset, sigma = float(grid[int(np.argmin(cost))]), np.inf
    stretches = 0
    for _ in range(_MAX_STEPS):
        step, sigma, stretches = _newton_step(scene, offset, blocks, fits(offset), config)
        if abs(step) > 2 * _SCAN_STEP_S:  # the scan's best is not a minimum to refine
            sigma = float(np.hypot(sigma, step))
            break
        offset += step
        if abs(step) < 1e-4:  # also where nothing determines the offset
            break
    return _decide(float(np.clip(offset, -bound, bound)), sigma, stretches, config)


def _always_posed(
    trajectory: Trajectory, t_s: Float64[Array, "n R"], reach_s: float, max_gap_s: float
) -> Bool[Array, "n R"]:
    """Return which readings have a known pose all around, so that every offset is judged alike."""
    gaps = np.flatnonzero(np.diff(trajectory.t_s) > max_gap_s + ROUNDING_S)
    first, last = t_s - reach_s, t_s + reach_s
    # No gap ends after the first pose and begins before the last one.
    ended = np.searchsorted(trajectory.t_s[gaps + 1], first, side="right")
    begun = np.searchsorted(trajectory.t_s[gaps], last, side="left")
    ends_known = [pose_at(trajectory, at, max_gap_s).known for at in (first, last)]
    return np.asarray(ends_known[0] & ends_known[1] & (ended == begun))


def _newton_step(
    scene: Scene,
    offset_s: float,
    blocks: Sequence[Readings],
    fits: Sequence[Fit],
    config: AlignmentConfig,
) -> tuple[float, float, int]:
    """Return the offset's Gauss-Newton step, its standard error and the stretches behind that.

    The anchors are profiled out. The standard error is infinite where the path's own noise is most
    of what varies the ranges.
    """
    information = curvature = total = 0.0
    times, scores, anchors = [], [], []
    for readings, fit in zip(blocks, fits, strict=True):
        left = _rate_left(fit, _velocity_mps(scene.trajectory, readings.t_s - offset_s))
        use = fit.weight > 0.0
        information += float((fit.weight * left**2).sum())
        curvature += float((fit.curvature * left**2).sum())
        total += float(fit.weight.sum())
        score = fit.weight * left * np.where(use, fit.residual_m, 0.0)
        times.append(readings.t_s[use])
        scores.append(score[use])
        anchors.append(score.sum(axis=1)[use.any(axis=1)])
    real = information - total * _velocity_noise_mps(scene.trajectory) ** 2
    if real <= 0.25 * information or real <= 1e-9 * total:
        return 0.0, np.inf, 0
    t_s, score = np.concatenate(times), np.concatenate(scores)
    block = ((t_s - t_s.min()) // config.error_correlation_s).astype(np.int64)
    sums = np.bincount(block, weights=score)[np.bincount(block) > 0]
    # Errors may be alike in one stretch of time, or in one anchor; the worst of these counts.
    variance = max(_variance(score), _variance(sums), _variance(np.concatenate(anchors)))
    bend = max(curvature, 0.25 * information) * real / information
    return float(score.sum()) / information, float(np.sqrt(variance)) / bend, len(sums)


def _variance(scores: Float64[Array, "K"]) -> float:
    """Return the variance of a sum of K independent scores with mean 0; 0 of a single one."""
    k = len(scores)
    return float((scores**2).sum()) * k / (k - 1) if k > 1 else 0.0


def _rate_left(fit: Fit, velocity_mps: Float64[Array, "n R 2"]) -> Float64[Array, "n R"]:
    """Return how predicted ranges grow with the offset, less what a move of the anchor imitates."""
    toward = fit.anchor_m[:, None] - fit.pose.position_m
    unit = np.nan_to_num(toward / np.maximum(fit.predicted_m, 1e-6)[..., None])
    rate = (unit * velocity_mps).sum(axis=-1)
    weighted = np.swapaxes(fit.weight[..., None] * unit, -1, -2)
    normal = weighted @ unit
    ridge = 1e-9 * np.trace(normal, axis1=1, axis2=2) + 1e-12  # an anchor seen from one direction
    moved = np.linalg.solve(normal + ridge[:, None, None] * np.eye(2), weighted @ rate[..., None])
    return np.asarray(rate - (unit @ moved)[..., 0])


def _velocity_mps(trajectory: Trajectory, t_s: Float64[Array, "n R"]) -> Float64[Array, "n R 2"]:
    """Return the velocity over a while around each time, which the path's noise hardly touches."""
    half_s = 0.5 * _baseline_s(trajectory)
    before, after = (pose_at(trajectory, t_s + d, np.inf).position_m for d in (-half_s, half_s))
    return np.asarray((after - before) / (2.0 * half_s))


def _velocity_noise_mps(trajectory: Trajectory) -> float:
    """Return how much of a velocity, along each axis, may be noise of the path's samples."""
    return float(np.sqrt(2.0) * trajectory.position_noise_m / _baseline_s(trajectory))


def _baseline_s(trajectory: Trajectory) -> float:
    return max(_VELOCITY_OVER_S, float(np.median(np.diff(trajectory.t_s))))


def _decide(
    offset_s: float, sigma_s: float, stretches: int, config: AlignmentConfig
) -> ClockOffset:
    """Apply a significant offset; say how large one may be that is not applied.

    What is not applied stays a possible error, so the sigma that goes with it covers it. It never
    exceeds what is known beforehand about two clocks of one log, unless the log contradicts that.
    """
    prior, bound = config.clock_offset_sigma_s, config.max_clock_offset_s
    left_s = float(np.hypot(sigma_s, offset_s))
    if abs(offset_s) >= bound - _SCAN_STEP_S and sigma_s < bound:
        reason = (
            f"the best offset lies at the limit of the search range of {bound:g} s; "
            "check the clocks"
        )
        return ClockOffset(offset_s, left_s, False, reason)
    if sigma_s >= prior:
        reason = "the drive is too straight and too steady to determine it"
        return ClockOffset(0.0, prior, False, reason)
    if stretches < 2:
        reason = (
            f"a drive of less than {config.error_correlation_s:g} s is too short to determine it"
        )
        return ClockOffset(0.0, prior, False, reason)
    needed = np.interp(-1.0 / (stretches - 1), -1.0 / _DEGREES, _STANDARD_ERRORS)
    if abs(offset_s) > needed * sigma_s:
        reason = f"significant, {abs(offset_s) / max(sigma_s, 1e-9):.0f} standard errors from zero"
        return ClockOffset(offset_s, sigma_s, True, reason)
    return ClockOffset(offset_s, min(left_s, prior), False, "not significantly different from zero")
