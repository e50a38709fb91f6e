"""``kalman``: a constant-velocity filter per anchor, gated, and smoothed afterwards."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from pydantic import Field

from gaia_uwb._shared import Array, Float64
from gaia_uwb.denoisers._base import ColumnDenoiser, ColumnRanges, Columns, Options
from gaia_uwb.denoisers._robust import GateOptions, local_line, noise_m, without_spikes
from gaia_uwb.denoisers._tracker import Motion, track


class TrackOptions(GateOptions):
    """Options of every Kalman denoiser."""

    measurement_sigma_m: float | None = Field(default=None, gt=0, le=100)
    """Standard deviation of a reading; by default each anchor's, estimated from its readings."""
    gate_sigma: float = Field(default=4.0, gt=0, le=100)
    """A reading whose innovation exceeds this many of its standard deviations is rejected (a
    chi-square gate with one degree of freedom at the square of this)."""
    max_coast_s: float = Field(default=0.6, ge=0, le=60)
    """Gaps between accepted readings up to this long are bridged; after a longer one the filter
    starts afresh, and the steps inside it are not valid."""
    smooth: bool = True
    """Let later readings correct earlier steps (Rauch, Tung and Striebel 1965)."""


class KalmanOptions(TrackOptions):
    """Options of ``kalman``."""

    acceleration_density_m2ps3: float = Field(default=1.0, gt=0, le=1e6)
    """Power density of the range's white acceleration, in (m/s²)²/Hz. It covers the curve of
    the range while passing: about 1 at 1 m/s and a distance of 1 m."""


class Kalman(ColumnDenoiser):
    """Filter each anchor's range and range rate, with white acceleration.

    Spikes are gated twice: against a robust local line, which later readings support as well as
    earlier ones, and by the filter's innovations. The filter starts on that line, so a spike as the
    first reading does no harm, and it starts afresh when it has accepted no reading for
    ``max_coast_s``; the steps it lost are marked not valid. That happens to a fast vehicle where it
    passes an anchor: 20 m/s at 5 m means 80 m/s². ``pose-kalman`` models that curve.

    Examples
    --------
    >>> from gaia_uwb.denoisers import make_denoiser
    >>> make_denoiser("kalman", {"smooth": False}).options.acceleration_density_m2ps3
    1.0
    """

    Options: ClassVar[type[Options]] = KalmanOptions
    options: KalmanOptions

    def denoise(self, columns: Columns) -> ColumnRanges:
        """Return tracked ranges; see the base class."""
        density = self.options.acceleration_density_m2ps3
        return track_columns(columns.t_s, columns.range_m, density, self.options, sloped=True)


def track_columns(
    t_s: Float64[Array, "T C"],
    value_m: Float64[Array, "T C"],
    acceleration_density_m2ps3: float,
    options: TrackOptions,
    *,
    sloped: bool,
) -> ColumnRanges:
    """Gate and track columns of readings.

    Parameters
    ----------
    t_s, value_m : (T, C)
        Times and readings; NaN is ignored.
    acceleration_density_m2ps3
        Power density of the white acceleration.
    options
        Gates, noise, coasting and smoothing.
    sloped
        Whether the readings may follow a slope; otherwise the local lines are level.

    Returns
    -------
    ColumnRanges
        Tracked values and their standard deviations.
    """
    line = local_line(t_s, value_m, options.spike_neighbours, sloped=sloped)
    noise = noise_m(line)
    if options.measurement_sigma_m is not None:
        noise = np.full(noise.shape, options.measurement_sigma_m)
    motion = Motion(acceleration_density_m2ps3, noise, options.gate_sigma, options.max_coast_s)
    kept = without_spikes(value_m, line, options)
    return track(t_s, kept, line, motion, smooth=options.smooth)
