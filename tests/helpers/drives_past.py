"""Drives and passes of one zone with known errors, made without the simulator."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gaia_uwb.config import PipelineConfig, SolverConfig
from gaia_uwb.episode import ClockOffset, Episode, RangeCalibration
from gaia_uwb.scene import RangeLog, Scene, Trajectory

CONES_M = np.array([[-12.0, 6.0], [-5.0, -5.0], [3.0, 7.0], [9.0, 8.5], [15.0, -4.0]])
IDS = ("a", "b", "c", "d", "e")
PURE = PipelineConfig(denoiser="raw", solver=SolverConfig(position_floor_m=0.0))
"""Settings under which places are as sure as the ranges make them."""


def make_pass(
    lane_m=0.0,
    cones_m=CONES_M,
    ids=IDS,
    *,
    seed=0,
    sigma_m=0.05,
    speed_mps=2.0,
    late_s=0.0,
    clock_sigma_s=None,
    bias_sigma_m=None,
    name=None,
):
    """Return a straight pass along north = ``lane_m``; its ranges are stamped ``late_s`` late."""
    rng = np.random.default_rng(seed)
    t_s = np.arange(200) * 0.1
    path_m = np.stack([speed_mps * (t_s - 10.0), np.full(200, lane_m)], axis=1)
    then_m = path_m - [speed_mps * late_s, 0.0]
    range_m = np.linalg.norm(then_m[:, None] - cones_m, axis=2)
    range_m += sigma_m * rng.standard_normal(range_m.shape)
    clock, calibration = None, None
    if clock_sigma_s is not None:
        clock = ClockOffset(0.0, clock_sigma_s, clock_sigma_s < 0.5, "made so")
    if bias_sigma_m is not None:
        covariance = np.diag([bias_sigma_m**2, 1e-8])
        calibration = RangeCalibration(np.zeros(2), covariance, sigma_m, 1.0)
    return Episode(
        name or f"lane {lane_m:g} seed {seed}", ids, t_s, path_m, range_m,
        np.ones(range_m.shape, dtype=bool), clock=clock, calibration=calibration,
    )  # fmt: skip


def with_moved_anchor(scene, n, by_m):
    """Return a simulated log as it had been if anchor ``n`` had stood elsewhere; without truth."""
    log, path, truth = scene.ranges, scene.trajectory, scene.truth
    t_s = log.t_s - truth.clock_offset_s
    tag_m = np.stack([np.interp(t_s, path.t_s, path.position_m[:, k]) for k in (0, 1)], axis=1)
    from_m = tag_m - truth.anchor_m[n]
    longer_m = np.hypot(*(from_m - by_m).T) - np.hypot(*from_m.T)
    range_m = log.range_m + np.where(log.anchor == n, longer_m, 0.0)
    return replace(scene, truth=None, ranges=replace(log, range_m=range_m))


def place_error_m(found, cones_m=CONES_M):
    """Return how far the better-fitting places are from the truth."""
    return np.linalg.norm(found.position_m[:, 0] - cones_m, axis=1)


def as_scene(episode):
    """Return the log that a pass was made from: every anchor is heard at every step."""
    read_s = np.repeat(episode.t_s[:, None], episode.n_anchors, axis=1)
    return Scene(
        episode.name,
        Trajectory(episode.t_s, episode.position_m),
        read_log(read_s, episode.range_m),
        episode.anchor_ids,
    )


def log_past(path_s, path_m, cones_m, read_s, *, late_s=0.0, noise_m=0.0, seed=0):
    """Return the log of a drive along a path with white noise.

    Cone n is read at the times ``read_s[:, n]``, stamped ``late_s`` late.
    """
    tag_m = np.stack([np.interp(read_s, path_s, axis) for axis in path_m.T], axis=-1)
    range_m = np.linalg.norm(tag_m - cones_m, axis=-1)
    range_m += noise_m * np.random.default_rng(seed).standard_normal(range_m.shape)
    ids = tuple(f"cone-{k}" for k in range(len(cones_m)))
    return Scene("drive", Trajectory(path_s, path_m), read_log(read_s + late_s, range_m), ids)


def read_log(t_s, range_m):
    """Return the readings of all cones, one column each, in rows; NaN is none."""
    step, anchor = np.nonzero(np.isfinite(range_m))
    return RangeLog(t_s[step, anchor], anchor, range_m[step, anchor])
