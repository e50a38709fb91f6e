"""Repeat real drives with simulated errors, so that only the errors differ from the real ones.

Path, anchors, times of the readings and line of sight are those of a surveyed log; the ranges are
the true ones plus what the simulator's error model adds.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gaia_uwb._shared import Array, Bool, Float64, InputError
from gaia_uwb.scene import RangeLog, Scene
from gaia_uwb.simulate.ranging import simulate_reports
from gaia_uwb.simulate.reality.real_errors import clock_offset_s, true_range_m
from gaia_uwb.simulate.settings import RangingConfig


def replay(scene: Scene, settings: RangingConfig, seed: int) -> Scene:
    """Return the same drive with simulated errors.

    Parameters
    ----------
    scene
        A surveyed log.
    settings
        The error model. Its sampling, dropouts and clock offset are not used, and nor is its chain
        of lost sight: the log's own readings, offset and labels are.
    seed
        The same seed and scene's name give the same ranges.

    Returns
    -------
    Scene
        A log with the same readings, their ranges simulated, without received power; its truth
        holds the clock offset, so that none is estimated anew.

    Raises
    ------
    InputError
        If the scene has no surveyed anchors.

    Examples
    --------
    >>> from gaia_uwb.simulate import PRESETS, simulate_pass
    >>> drive = simulate_pass(PRESETS["lane-closure"], seed=0)
    >>> again = replay(drive, RangingConfig(sigma_m=0.0, sigma_per_m=0.0, nlos_bias_m=0.0,
    ...                                     burst_per_s=0.0, held_share=0.0), seed=1)
    >>> bool(np.abs(again.ranges.range_m - drive.truth.range_m).max() < 0.05)
    True
    """
    if scene.truth is None:
        raise InputError("expected surveyed anchors to simulate ranges to", source=scene.name)
    offset_s = clock_offset_s(scene)
    log, nlos = scene.ranges, scene.truth.nlos
    if nlos is None:
        nlos = np.zeros(len(log), dtype=np.bool_)
    polls_s = _poll_times_s(log)
    # Every poll is answered; the log's own gaps come with its readings.
    errors_only = settings.model_copy(
        update={
            "los_s": None,
            "dropout_share": 0.0,
            "outage_per_s": 0.0,
            "soft_range_m": 0.0,
            "max_range_m": np.inf,
        }
    )
    polled_m = np.stack(
        [true_range_m(scene, n, polls_s - offset_s)[0] for n in range(scene.n_anchors)]
    )
    reports = simulate_reports(
        polled_m,
        _labels_at(scene, nlos, polls_s),
        float(polls_s[1] - polls_s[0]),
        errors_only,
        lambda name: np.random.default_rng([seed, *f"{scene.name} {name}".encode()]),
    )
    error_m = reports.range_m - polled_m
    range_m = np.empty(len(log))
    for n in range(scene.n_anchors):
        own = np.flatnonzero(log.anchor == n)
        poll = np.clip(np.round((log.t_s[own] - polls_s[0]) / (polls_s[1] - polls_s[0])), 0, None)
        true_m, _ = true_range_m(scene, n, log.t_s[own] - offset_s)
        range_m[own] = true_m + error_m[n, poll.astype(np.int64)]
    return replace(
        scene,
        ranges=RangeLog(t_s=log.t_s, anchor=log.anchor, range_m=range_m),
        truth=replace(scene.truth, clock_offset_s=offset_s),
    )


def _poll_times_s(log: RangeLog) -> Float64[Array, "P"]:
    """Return even times from the first to after the last reading, as far apart as readings are."""
    between_s = [np.diff(log.t_s[log.anchor == n]) for n in np.unique(log.anchor)]
    poll_s = float(np.median(np.concatenate([*between_s, [1e3]])))
    return np.asarray(log.t_s[0] + poll_s * np.arange(int(np.ptp(log.t_s) / poll_s) + 2))


def _labels_at(
    scene: Scene, nlos: Bool[Array, "R"], polls_s: Float64[Array, "P"]
) -> Bool[Array, "N P"]:
    """Return each anchor's line of sight at the polls: that of the last reading before."""
    labels = np.zeros((scene.n_anchors, len(polls_s)), dtype=np.bool_)
    for n in range(scene.n_anchors):
        own = np.flatnonzero(scene.ranges.anchor == n)
        if len(own):
            last = np.searchsorted(scene.ranges.t_s[own], polls_s, side="right") - 1
            labels[n] = nlos[own[np.maximum(last, 0)]]
    return labels
