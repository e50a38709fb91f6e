"""Kalman filter and smoother of a value and its rate, for many columns at once.

The state of a column is (x, v) with covariance (xx, xv, vv). Between two steps v changes by white
noise of density q, so over dt the covariance grows by q (dt^3/3, dt^2/2, dt). The five numbers are
the rows of one array per step, in that order. Products are written out: a power of an array may
round differently in batches of different widths.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gaia_uwb._shared import Array, Bool, Float64
from gaia_uwb.denoisers._base import ColumnRanges
from gaia_uwb.denoisers._robust import LocalLine

_START_WIDTH = 3.0  # the filter uses the local line's readings again, so it starts this much wider
_SHORTEST_S = 1e-3  # stands for the reach of a line through a single step


class Motion(NamedTuple):
    """The model: process noise, measurement noise, and what to do with outliers and gaps."""

    acceleration_density_m2ps3: float
    noise_m: Float64[Array, "C"]
    gate_sigma: float
    max_coast_s: float


class _Filtered(NamedTuple):
    state: Float64[Array, "T 5 C"]
    accepted: Bool[Array, "T C"]
    started: Bool[Array, "T C"]


def track(
    t_s: Float64[Array, "T C"],
    value_m: Float64[Array, "T C"],
    line: LocalLine,
    motion: Motion,
    *,
    smooth: bool,
) -> ColumnRanges:
    """Track columns of readings.

    Parameters
    ----------
    t_s, value_m : (T, C)
        Times and readings; NaN is ignored.
    line
        Where the filter starts, and starts again after ``max_coast_s`` without a good reading.
    motion
        The model.
    smooth
        Let later readings correct earlier steps.

    Returns
    -------
    ColumnRanges
        Values and their standard deviations; NaN in gaps longer than ``max_coast_s``.
    """
    filtered = _filter(t_s, value_m, line, motion)
    if smooth:
        _smooth_in_place(t_s, filtered, motion.acceleration_density_m2ps3)
    valid = _bridged(t_s, filtered.accepted, motion.max_coast_s)
    value, variance = filtered.state[:, 0], filtered.state[:, 2]
    sigma = np.sqrt(np.where(valid, variance, np.nan))
    return ColumnRanges(np.where(valid, value, np.nan), sigma)


def _filter(
    t_s: Float64[Array, "T C"], value_m: Float64[Array, "T C"], line: LocalLine, motion: Motion
) -> _Filtered:
    """Run forward in time: predict, start where nothing was accepted for long, gate, correct."""
    steps, columns = value_m.shape
    out = _Filtered(
        np.empty((steps, 5, columns)),
        np.empty(value_m.shape, dtype=np.bool_),
        np.empty(value_m.shape, dtype=np.bool_),
    )
    state = np.full((5, columns), np.nan)
    last_s = np.full(columns, -np.inf)  # time of the last accepted reading
    variance, gate = motion.noise_m * motion.noise_m, motion.gate_sigma**2
    for k in range(steps):
        if k:
            state = _predict(state, t_s[k] - t_s[k - 1], motion.acceleration_density_m2ps3)
        seen = np.isfinite(value_m[k])
        start = seen & (t_s[k] - last_s > motion.max_coast_s)
        if start.any():
            state = np.where(start, _start(t_s, line, motion, k), state)
        x, v, xx, xv, vv = state
        innovation, total = value_m[k] - x, xx + variance
        good = seen & (innovation * innovation <= gate * total)
        surprise = np.where(good, innovation / total, 0.0)
        share = np.where(good, 1.0 / total, 0.0)
        left = np.where(good, variance / total, 1.0)
        state = np.array(
            (x + xx * surprise, v + xv * surprise, left * xx, left * xv, vv - share * xv * xv)
        )
        last_s = np.where(good, t_s[k], last_s)
        out.state[k], out.accepted[k], out.started[k] = state, good, start
    return out


def _start(
    t_s: Float64[Array, "T C"], line: LocalLine, motion: Motion, k: int
) -> Float64[Array, "5 C"]:
    """Return the local line at step k as a state with a wide covariance."""
    first, last = max(k - line.half, 0), min(k + line.half, len(t_s) - 1)
    reach_s = np.maximum(0.5 * (t_s[last] - t_s[first]), _SHORTEST_S)
    sigma = _START_WIDTH * np.fmax(line.spread_m[k], motion.noise_m)
    rate_sigma = sigma / reach_s
    return np.array(
        (
            line.level_m[k],
            line.rate_mps[k],
            sigma * sigma,
            np.zeros_like(sigma),
            rate_sigma * rate_sigma,
        )
    )


def _predict(
    state: Float64[Array, "5 C"], dt_s: Float64[Array, "C"], density: float
) -> Float64[Array, "5 C"]:
    x, v, xx, xv, vv = state
    grown = density * dt_s
    return np.array(
        (
            x + dt_s * v,
            v,
            xx + dt_s * (2.0 * xv + dt_s * (vv + grown / 3.0)),
            xv + dt_s * (vv + grown / 2.0),
            vv + grown,
        )
    )


def _smooth_in_place(t_s: Float64[Array, "T C"], filtered: _Filtered, density: float) -> None:
    """Run backward in time (Rauch, Tung and Striebel 1965); nothing crosses a fresh start.

    With C = P F' and the prediction's covariance S: x += G (x_next - x_predicted) and
    P += G (P_next - S) G', where G = C / S.
    """
    states = filtered.state
    for k in range(len(t_s) - 2, -1, -1):
        dt_s = t_s[k + 1] - t_s[k]
        x, v, xx, xv, vv = states[k]
        predicted = _predict(states[k], dt_s, density)
        dx, dv, dxx, dxv, dvv = states[k + 1] - predicted
        _, _, sxx, sxv, svv = predicted
        cxx, cvx = xx + dt_s * xv, xv + dt_s * vv  # with the next x; with the next v: xv, vv
        scale = np.where(filtered.started[k + 1], 0.0, 1.0 / (sxx * svv - sxv * sxv))
        gxx, gxv = (cxx * svv - xv * sxv) * scale, (xv * sxx - cxx * sxv) * scale
        gvx, gvv = (cvx * svv - vv * sxv) * scale, (vv * sxx - cvx * sxv) * scale
        ax, av = gxx * dxx + gxv * dxv, gxx * dxv + gxv * dvv  # first row of G (P_next - S)
        bx, bv = gvx * dxx + gvv * dxv, gvx * dxv + gvv * dvv
        states[k] = (
            x + gxx * dx + gxv * dv,
            v + gvx * dx + gvv * dv,
            xx + ax * gxx + av * gxv,
            xv + ax * gvx + av * gvv,
            vv + bx * gvx + bv * gvv,
        )


def _bridged(
    t_s: Float64[Array, "T C"], accepted: Bool[Array, "T C"], max_coast_s: float
) -> Bool[Array, "T C"]:
    """Return which steps were accepted or lie in a short gap between two that were."""
    before_s = np.maximum.accumulate(np.where(accepted, t_s, -np.inf), axis=0)
    after_s = np.minimum.accumulate(np.where(accepted, t_s, np.inf)[::-1], axis=0)[::-1]
    return np.asarray(after_s - before_s <= max_coast_s)
