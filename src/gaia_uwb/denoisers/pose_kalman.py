"""``pose-kalman``: a Kalman filter of what the vehicle's pose leaves unexplained in the ranges."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from pydantic import Field

from gaia_uwb._shared import Array, Bool, Float64
from gaia_uwb.denoisers._base import ColumnDenoiser, ColumnRanges, Columns, Options, Part
from gaia_uwb.denoisers._robust import column_median
from gaia_uwb.denoisers.kalman import KalmanOptions, TrackOptions, track_columns
from gaia_uwb.solver import SolverOptions, solve

_UNIT_SIGMA_M = 0.1  # the solver finds each anchor's scale itself
_BIAS_SIGMA_M = 0.3  # of the range bias that the solver may find beside the place


class PoseKalmanOptions(TrackOptions):
    """Options of ``pose-kalman``."""

    offset_acceleration_density_m2ps3: float = Field(default=0.03, gt=0, le=1e6)
    """Power density of the white acceleration of the offset between the measured range and the one
    that the pose predicts, in (m/s²)²/Hz."""


class PoseKalman(ColumnDenoiser):
    """Let the vehicle's pose predict how each range changes; filter the rest.

    A robust fit to the episode's own ranges locates each anchor. The range predicted from there
    changes as the measured one does, even where a fast vehicle passes, and the anchor's mirror
    position predicts nearly the same, so its side does not matter. What is left, the offset between
    measured and predicted range, hardly moves: its gates are tight, and spikes stand out. An anchor
    that cannot be located, or whose place does not explain at least half of how its ranges vary
    (a parked vehicle's do not vary), is treated as ``kalman`` does by default.

    Examples
    --------
    >>> from gaia_uwb.denoisers import make_denoiser
    >>> make_denoiser("pose-kalman").uses_pose
    True
    """

    Options: ClassVar[type[Options]] = PoseKalmanOptions
    uses_pose: ClassVar[bool] = True
    options: PoseKalmanOptions

    def denoise(self, columns: Columns) -> ColumnRanges:
        """Return tracked ranges; see the base class."""
        predicted = np.concatenate([_predicted_m(part) for part in columns.parts], axis=1)
        explained = _explains(predicted, columns.range_m)
        predicted = np.where(explained, predicted, 0.0)
        found = ColumnRanges(np.empty(predicted.shape), np.empty(predicted.shape))
        offset = self.options.offset_acceleration_density_m2ps3
        unexplained = KalmanOptions().acceleration_density_m2ps3
        for chosen, density, sloped in (
            (explained, offset, False),
            (~explained, unexplained, True),
        ):
            if not chosen.any():
                continue
            t_s, rest_m = columns.t_s[:, chosen], (columns.range_m - predicted)[:, chosen]
            tracked = track_columns(t_s, rest_m, density, self.options, sloped=sloped)
            found.range_m[:, chosen] = predicted[:, chosen] + tracked.range_m
            found.sigma_m[:, chosen] = tracked.sigma_m
        return found


def _predicted_m(part: Part) -> Float64[Array, "T n"]:
    """Return the ranges predicted from the pose; NaN for anchors that cannot be located."""
    episode, anchors = part.episode, part.anchors
    heights = None
    if episode.tag_up_m is not None and episode.anchor_up_m is not None:
        heights = (episode.tag_up_m[None], episode.anchor_up_m[None, anchors])
    found = solve(
        episode.position_m[None],
        np.ascontiguousarray(episode.range_m[:, anchors].T)[None],
        _UNIT_SIGMA_M,
        height_m=heights,
        bias_sigma_m=_BIAS_SIGMA_M,
        options=SolverOptions(max_lag=1),
    )
    fit = np.nan_to_num(found.negative_log_likelihood[0], nan=np.inf)
    better = np.argmin(fit, axis=1)
    place = found.position_m[0, np.arange(len(better)), better]
    east, north = (episode.position_m[:, axis, None] - place[:, axis] for axis in (0, 1))
    gap = episode.height_gap_m(anchors)
    return np.asarray(np.sqrt(east * east + north * north + gap * gap))


def _explains(
    predicted_m: Float64[Array, "T C"], range_m: Float64[Array, "T C"]
) -> Bool[Array, "C"]:
    """Return for which columns the prediction halves the ranges' median deviation, or better."""
    return np.asarray(_deviation(range_m - predicted_m) <= 0.5 * _deviation(range_m))


def _deviation(value_m: Float64[Array, "T C"]) -> Float64[Array, "C"]:
    return column_median(np.abs(value_m - column_median(value_m)))
