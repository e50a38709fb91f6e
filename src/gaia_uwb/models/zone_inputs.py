"""What ``gaia-set`` sees of episodes: ranges and both places of every anchor, in the path's frame.

The exact, robust solver (``multilateration.py``) gives each anchor two places before any network
runs, one on either side of the path. Nothing here depends on where a scene is, how it is turned,
or in which order its anchors come.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from gaia_uwb._shared import Array, Bool, Float32, Float64
from gaia_uwb.episode import Episode
from gaia_uwb.models.path_frame import PathFrame, road_parabola
from gaia_uwb.solver import SolverOptions, solve

__all__ = ["ZoneInputs", "ZoneReadings", "make_zone_inputs", "zone_readings"]

_SIGMA_M = 0.1  # of all ranges alike: the solver finds their scale
_BIAS_SIGMA_M = 0.1
_FARTHEST_START_M = 500.0  # ahead of, behind or beside the path's middle; farther is drawn in
_PROFILE_STEPS = (0.0, 0.25, 0.5, 0.75, 1.0)  # of the path, where its sway is looked at
_OPTIONS = SolverOptions(max_lag=16)


class ZoneReadings(NamedTuple):
    """Ranges of B episodes of T steps and N anchors, in the local frame; all in metres."""

    t_s: Float64[Array, "B T"]
    position_m: Float64[Array, "B T 2"]
    range_m: Float64[Array, "B N T"]
    """NaN where there is none."""
    tag_up_m: Float64[Array, "B T"]
    anchor_up_m: Float64[Array, "B N"]
    """NaN where unknown: ranges then count as horizontal."""
    calibrated: Float64[Array, "B"]
    """1 where the ranges were freed of the radios' common bias (``calibration.py``), else 0."""


class ZoneInputs(NamedTuple):
    """Inputs of the network, arrays or tensors in single precision, in metres and seconds.

    (along, left) is the path's frame.
    """

    position: Any
    """(B, T, 2)."""
    velocity: Any
    """(B, T, 2)."""
    range: Any
    """(B, N, T): measured slant ranges, 0 where there is none."""
    mask: Any
    """(B, N, T): 1 where there is a range, else 0."""
    height_gap: Any
    """(B, N, T): tag's height minus the anchor's; 0 where unknown."""
    start: Any
    """(B, N, 2, 2): anchor, side (left, right), (along, left), where the solver puts it on either
    side."""
    fit: Any
    """(B, N, 2, 4), of each place: negative log likelihood less the other's, logarithm of the
    errors' scale, range bias, logarithm of the errors' correlation."""
    road: Any
    """(B, 3): the path as a parabola."""
    path_even: Any
    """(B, 6), what of a scene does not change in the mirror: logarithms of the path's length and
    width and of the number of anchors, mean speed, its standard deviation, and ``calibrated``."""
    path_odd: Any
    """(B, 5): how far left the path is at its start, quarters and end."""
    step: Any
    """(B,): logarithm of the time between two steps."""


def zone_readings(episodes: Sequence[Episode]) -> ZoneReadings:
    """Lay out episodes of one number of steps and of anchors.

    Parameters
    ----------
    episodes
        At least one; their truth is not used.
    """
    unknown = [e.tag_up_m is None or e.anchor_up_m is None for e in episodes]
    return ZoneReadings(
        t_s=np.stack([e.t_s for e in episodes]),
        position_m=np.stack([e.position_m for e in episodes]),
        range_m=np.stack([np.ascontiguousarray(e.range_m.T) for e in episodes]),
        tag_up_m=np.stack(
            [np.zeros(e.n_steps) if e.tag_up_m is None else e.tag_up_m for e in episodes]
        ),
        anchor_up_m=np.stack(
            [
                np.full(e.n_anchors, np.nan) if no or e.anchor_up_m is None else e.anchor_up_m
                for e, no in zip(episodes, unknown, strict=True)
            ]
        ),
        calibrated=np.array([float(e.calibration is not None) for e in episodes]),
    )


def make_zone_inputs(readings: ZoneReadings) -> tuple[ZoneInputs, PathFrame]:
    """Return the network's inputs and the frames that its places are in.

    Parameters
    ----------
    readings
        Of episodes with at least two steps.
    """
    frame = PathFrame.of(readings.position_m)
    path_m = frame.enter(readings.position_m)
    velocity_mps = _velocity_mps(readings.t_s, path_m)
    valid = np.isfinite(readings.range_m)
    start, fit = _both_sides(path_m, readings)
    gap_m = readings.tag_up_m[:, None] - readings.anchor_up_m[:, :, None]
    even, odd = _path_features(path_m, velocity_mps, valid)
    even = np.concatenate([even, readings.calibrated[:, None]], axis=1)
    inputs = ZoneInputs(
        position=_single(path_m),
        velocity=_single(velocity_mps),
        range=_single(np.nan_to_num(readings.range_m, nan=0.0)),
        mask=_single(valid),
        height_gap=_single(np.nan_to_num(gap_m, nan=0.0)),
        start=_single(start),
        fit=_single(fit),
        road=_single(road_parabola(path_m)),
        path_even=_single(even),
        path_odd=_single(odd),
        step=_single(np.log(np.median(np.diff(readings.t_s, axis=1), axis=1))),
    )
    return inputs, frame


def _both_sides(
    path_m: Float64[Array, "B T 2"], readings: ZoneReadings
) -> tuple[Float64[Array, "B N 2 2"], Float64[Array, "B N 2 4"]]:
    """Locate each anchor on both sides: the left place first."""
    found = solve(
        path_m,
        readings.range_m,
        _SIGMA_M,
        height_m=(readings.tag_up_m, readings.anchor_up_m),
        bias_sigma_m=_BIAS_SIGMA_M,
        options=_OPTIONS,
    )
    place_m = found.position_m
    # Too few ranges for a place: as far from the middle of the path as they say, on either side.
    valid = np.isfinite(readings.range_m)
    mean_m = np.nan_to_num(readings.range_m).sum(axis=2) / np.maximum(valid.sum(axis=2), 1)
    aside_m = np.stack([mean_m, -mean_m], axis=-1)
    somewhere_m = np.stack([np.zeros_like(aside_m), aside_m], axis=-1)
    place_m = np.where(np.isfinite(place_m), place_m, somewhere_m)
    place_m = np.clip(place_m, -_FARTHEST_START_M, _FARTHEST_START_M)
    swap = place_m[:, :, 0, 1] < place_m[:, :, 1, 1]
    order = np.where(swap[..., None], [1, 0], [0, 1])  # (B, N, 2)
    fit = np.nan_to_num(found.negative_log_likelihood)
    features = np.stack(
        [
            fit - fit[..., ::-1],
            np.log(np.clip(np.nan_to_num(found.scale, nan=1.0), 1e-3, 1e3)),
            np.nan_to_num(found.bias_m),
            np.log(np.maximum(np.nan_to_num(found.correlation, nan=1.0), 1.0)),
        ],
        axis=-1,
    )
    return (
        np.take_along_axis(place_m, order[..., None], axis=2),
        np.take_along_axis(features, order[..., None], axis=2),
    )


def _velocity_mps(
    t_s: Float64[Array, "B T"], path_m: Float64[Array, "B T 2"]
) -> Float64[Array, "B T 2"]:
    step_s = np.diff(t_s, axis=1)[..., None]
    between = np.diff(path_m, axis=1) / step_s
    ends = np.concatenate([between[:, :1], between, between[:, -1:]], axis=1)
    return np.asarray(0.5 * (ends[:, 1:] + ends[:, :-1]))


def _path_features(
    path_m: Float64[Array, "B T 2"],
    velocity_mps: Float64[Array, "B T 2"],
    valid: Bool[Array, "B N T"],
) -> tuple[Float64[Array, "B 5"], Float64[Array, "B 5"]]:
    spread_m = np.maximum(path_m.std(axis=1), 0.01)
    speed_mps = np.linalg.norm(velocity_mps, axis=-1)
    observed = valid.any(axis=2).sum(axis=1)
    even = np.stack(
        [
            np.log(spread_m[:, 0]),
            np.log(spread_m[:, 1]),
            np.log(np.maximum(observed, 1)),
            speed_mps.mean(axis=1),
            speed_mps.std(axis=1),
        ],
        axis=1,
    )
    last = path_m.shape[1] - 1
    steps = [round(share * last) for share in _PROFILE_STEPS]
    return even, path_m[:, steps, 1]


def _single(values: Array) -> Float32[Array, "..."]:
    return np.ascontiguousarray(values, dtype=np.float32)
