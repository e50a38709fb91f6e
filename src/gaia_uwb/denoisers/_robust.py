"""Robust local lines through columns of readings: where a reading should be, and how far they vary.

Around each step, the rate is the median slope of pairs of readings ``half`` steps apart, and the
level is the median of the neighbours moved along that slope (a local, vectorised Theil-Sen line). A
spike burst of two or three readings is a minority in both, and a steady ramp leaves no lag.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from pydantic import Field

from gaia_uwb._shared import Array, Float64, Int64
from gaia_uwb.denoisers._base import Options

_BLOCK = 1 << 15  # windows sorted at a time: they stay in the cache
_MAD_TO_SIGMA = 1.4826
_NOISE_FLOOR_M = 0.05  # time stamps, interpolation and the antenna leave no radio below this


class GateOptions(Options):
    """When a reading counts as a spike (Hampel 1974, about a local line)."""

    spike_neighbours: int = Field(default=10, ge=2, le=1000)
    """Number of readings before and after each one that it is compared with."""
    spike_threshold_sigma: float = Field(default=5.0, gt=0, le=100)
    """A spike is off the line by more than this many robust standard deviations of the others."""
    spike_threshold_m: float = Field(default=0.25, ge=0, le=100)
    """A spike is also off the line by more than this."""


class LocalLine(NamedTuple):
    """The line at each step: its value, its slope, and the readings' robust standard deviation.

    It was fitted to ``half`` steps before and after.
    """

    level_m: Float64[Array, "T C"]
    rate_mps: Float64[Array, "T C"]
    spread_m: Float64[Array, "T C"]
    half: int


def local_line(
    t_s: Float64[Array, "T C"], value_m: Float64[Array, "T C"], half: int, *, sloped: bool = True
) -> LocalLine:
    """Fit a robust line around every step of every column.

    Parameters
    ----------
    t_s, value_m : (T, C)
        Times and readings; NaN is ignored.
    half
        Number of readings used before and after the step; at the ends the window stays inside,
        so that a burst there is also a minority.
    sloped
        Estimate the slope; otherwise it is 0.

    Returns
    -------
    LocalLine
        NaN where no reading is near, except that an unknown rate is 0.
    """
    level, rate, spread = np.empty(value_m.shape), np.zeros(value_m.shape), np.empty(value_m.shape)
    for cut in _blocks(value_m.shape):
        if sloped:
            rate[cut] = _local_rate(t_s[cut], value_m[cut], half)
        moved = _moved_windows(t_s[cut], value_m[cut], rate[cut], half)
        level[cut], _ = _median(moved)
        deviation, _ = _median(np.abs(moved - level[cut][..., None]))
        spread[cut] = _MAD_TO_SIGMA * deviation
    return LocalLine(level, rate, spread, half)


def without_spikes(
    value_m: Float64[Array, "T C"], line: LocalLine, options: GateOptions
) -> Float64[Array, "T C"]:
    """Return the readings with NaN in place of spikes."""
    bound = np.maximum(options.spike_threshold_m, options.spike_threshold_sigma * line.spread_m)
    return np.where(np.abs(value_m - line.level_m) <= bound, value_m, np.nan)


def noise_m(line: LocalLine) -> Float64[Array, "C"]:
    """Return each column's robust standard deviation of one reading, in metres."""
    return np.fmax(column_median(line.spread_m), _NOISE_FLOOR_M)


def column_median(values: Float64[Array, "T C"]) -> Float64[Array, "C"]:
    """Return the median of each column's finite values; NaN where there are none."""
    median, _ = _median(np.ascontiguousarray(values.T))
    return median


def running_median(
    t_s: Float64[Array, "T C"],
    value_m: Float64[Array, "T C"],
    rate_mps: Float64[Array, "T C"],
    half: int,
) -> tuple[Float64[Array, "T C"], Int64[Array, "T C"]]:
    """Return the median of each step's window, its readings moved along the rate, and their number.

    Windows are as in :func:`local_line`.
    """
    median = np.empty(value_m.shape)
    count = np.empty(value_m.shape, dtype=np.int64)
    for cut in _blocks(value_m.shape):
        moved = _moved_windows(t_s[cut], value_m[cut], rate_mps[cut], half)
        median[cut], count[cut] = _median(moved)
    return median, count


def _blocks(shape: tuple[int, ...]) -> Iterator[tuple[slice, slice]]:
    """Yield groups of columns whose windows fit into the memory's bound."""
    width = max(1, _BLOCK // shape[0])
    for start in range(0, shape[1], width):
        yield np.s_[:, start : start + width]


def _local_rate(
    t_s: Float64[Array, "T C"], value_m: Float64[Array, "T C"], half: int
) -> Float64[Array, "T C"]:
    """Return the median slope of the pairs ``half`` steps apart around each step; 0 if unknown."""
    if len(t_s) <= half:
        return np.zeros(value_m.shape)
    slope = (value_m[half:] - value_m[:-half]) / (t_s[half:] - t_s[:-half])
    windows = _sliding(slope, min(half + 1, len(slope)))
    median, _ = _median(windows)
    # Row i holds the pairs that begin at steps i to i + half: their middle is step i + half.
    nearest = np.clip(np.arange(len(t_s)) - half, 0, len(median) - 1)
    return np.nan_to_num(median[nearest], nan=0.0)


def _moved_windows(
    t_s: Float64[Array, "T C"],
    value_m: Float64[Array, "T C"],
    rate_mps: Float64[Array, "T C"],
    half: int,
) -> Float64[Array, "T C W"]:
    """Return each step's window of readings, moved to that step along its rate."""
    width = min(2 * half + 1, len(t_s))
    first = np.clip(np.arange(len(t_s)) - half, 0, len(t_s) - width)
    value, time = _sliding(value_m, width)[first], _sliding(t_s, width)[first]
    return np.asarray(value - rate_mps[..., None] * (time - t_s[..., None]))


def _sliding(values: Float64[Array, "K C"], width: int) -> Float64[Array, "M C W"]:
    return np.lib.stride_tricks.sliding_window_view(values, width, axis=0)


def _median(
    values: Float64[Array, "*shape W"],
) -> tuple[Float64[Array, "*shape"], Int64[Array, "*shape"]]:
    """Return the median and the number of the finite values along the last axis."""
    ordered = np.sort(values, axis=-1)  # NaN last
    count = np.isfinite(ordered).sum(axis=-1)
    low = np.take_along_axis(ordered, (np.maximum(count, 1) - 1)[..., None] // 2, axis=-1)
    high = np.take_along_axis(
        ordered, np.minimum(count // 2, ordered.shape[-1] - 1)[..., None], axis=-1
    )
    return 0.5 * (low + high)[..., 0], count
