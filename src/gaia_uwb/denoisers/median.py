"""``median``: spikes gated (Hampel), then a running median about the local slope."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from pydantic import Field, field_validator

from gaia_uwb.denoisers._base import ColumnDenoiser, ColumnRanges, Columns, Options
from gaia_uwb.denoisers._robust import (
    GateOptions,
    local_line,
    noise_m,
    running_median,
    without_spikes,
)

_MEDIAN_EFFICIENCY = 1.2533  # sigma of a median over sigma of a mean, for Gaussian errors


class MedianOptions(GateOptions):
    """Options of ``median``."""

    window_steps: int = Field(default=5, ge=1, le=1001)
    """Steps in the running median's window, an odd number; at the ends it stays inside the log."""

    @field_validator("window_steps")
    @classmethod
    def _odd(cls, value: int) -> int:
        if value % 2 == 0:
            raise ValueError("expected an odd number of steps")
        return value


class Median(ColumnDenoiser):
    """Replace each reading by the median of its neighbours, without spikes.

    Readings are moved along the local slope first, so a ramp leaves no lag and no bias at the ends.
    Sigma follows the local spread of the readings: it grows where the range bends within a window,
    as it does where a fast vehicle passes an anchor.

    Examples
    --------
    >>> from gaia_uwb.denoisers import make_denoiser
    >>> make_denoiser("median").options.window_steps
    5
    """

    Options: ClassVar[type[Options]] = MedianOptions
    options: MedianOptions

    def denoise(self, columns: Columns) -> ColumnRanges:
        """Return running medians where a reading was taken; see the base class."""
        line = local_line(columns.t_s, columns.range_m, self.options.spike_neighbours)
        kept = without_spikes(columns.range_m, line, self.options)
        half = self.options.window_steps // 2
        median, count = running_median(columns.t_s, kept, line.rate_mps, half)
        usable = np.isfinite(columns.range_m) & (count > 0)
        spread = np.fmax(line.spread_m, noise_m(line))
        sigma = _MEDIAN_EFFICIENCY * spread / np.sqrt(np.maximum(count, 1))
        return ColumnRanges(np.where(usable, median, np.nan), np.where(usable, sigma, np.nan))
