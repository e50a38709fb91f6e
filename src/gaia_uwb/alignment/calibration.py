"""What a whole log tells of its radios' errors, without any truth: bias, noise, correlation.

UWB ranges come out too long, the more so the longer they are; in the radios of the outdoor data set
by 0.25 m for every factor of ten, with and without line of sight. The bias
``b(d) = b0 + b1 log10(d / 10 m)`` is common to all anchors and far smaller than what an anchor's
place explains, so it is estimated from all of them together, each anchor's place and own small bias
profiled out. Its Gaussian prior decides where a drive is too short to tell. Like the clock offset,
the bias belongs to the log and not to a window of it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gaia_uwb._shared import Array, Float64
from gaia_uwb.config import CalibrationConfig, SolverConfig
from gaia_uwb.episode import Episode, RangeCalibration
from gaia_uwb.solver import (
    SolverOptions,
    at_side,
    better_side,
    chunks,
    correlation_lag,
    normal_sums,
    with_prior,
)

_ROUNDS = 4  # full Newton steps; the last one only polishes
_SIGMA_M = 0.1  # only a unit: the scale of the errors is estimated


def calibrate(
    episode: Episode,
    config: CalibrationConfig = CalibrationConfig(),
    solver: SolverConfig = SolverConfig(),
) -> Episode:
    """Estimate the range bias and the noise of a whole log and subtract the bias.

    Parameters
    ----------
    episode
        A whole aligned log; its truth is not used.
    config
        Settings of the calibration.
    solver
        ``student_t_dof``, ``anchor_bias_sigma_m``, ``error_correlation_s`` and ``min_ranges``.

    Returns
    -------
    Episode
        The same log with ``range_m`` freed of the bias and ``calibration`` set.

    Examples
    --------
    >>> import numpy as np
    >>> from gaia_uwb.episode import Episode
    >>> t = np.arange(400) * 0.1
    >>> path = np.stack([2.0 * t - 40.0, 6.0 * np.sin(t / 4.0)], axis=1)
    >>> cones = np.array([[-20.0, 9.0], [0.0, -8.0], [20.0, 10.0]])
    >>> true_m = np.linalg.norm(path[:, None] - cones, axis=2)
    >>> log = Episode("pass", ("a", "b", "c"), t, path, true_m + 0.08, true_m > 0)
    >>> calibrate(log).calibration.bias.round(2)
    array([0.08, 0.  ])
    """
    bias = np.zeros(2)
    covariance = np.diag([config.bias_sigma_m**2, config.bias_slope_sigma_m**2])
    correlation = 1.0
    for _ in range(_ROUNDS):
        step = _newton_step(episode, bias, correlation, config, solver)
        bias, covariance, correlation = bias - step.change, step.covariance, step.correlation
    found = RangeCalibration(bias, covariance, step.sigma_m, correlation)
    range_m = found.bias_m(episode.range_m)
    np.subtract(episode.range_m, range_m, out=range_m)
    range_m.flags.writeable = False  # so that the episode takes it without a copy
    return replace(episode, range_m=range_m, calibration=found)


@dataclass(frozen=True)
class _Step:
    change: Float64[Array, "2"]
    covariance: Float64[Array, "2 2"]
    correlation: float
    sigma_m: float


def _newton_step(
    episode: Episode,
    bias: Float64[Array, "2"],
    correlation: float,
    config: CalibrationConfig,
    solver: SolverConfig,
) -> _Step:
    """Return the shared bias's next Newton step, with all anchors' places profiled out."""
    options = SolverOptions(
        dof=solver.student_t_dof,
        min_ranges=solver.min_ranges,
        max_lag=correlation_lag(episode, solver.error_correlation_s),
    )
    own_sigma = np.array([solver.anchor_bias_sigma_m / np.sqrt(correlation)])
    precision = 1.0 / own_sigma**2 if own_sigma[0] > 0 else np.zeros(1)
    information, gradient = np.zeros((2, 2)), np.zeros(2)
    correlations, scales = [], []
    sigma = np.broadcast_to(_SIGMA_M, episode.range_m.shape)
    for chunk in chunks([episode], [episode.range_m], [sigma]):
        solutions = chunk.solve(options, own_sigma, bias[None])
        side = better_side(solutions)
        sums = normal_sums(chunk, solutions, side, solver.student_t_dof, bias[None])
        pull = sums.jr.copy()
        pull[..., 2] += precision[:, None] * np.nan_to_num(at_side(solutions.bias_m, side))
        jx = sums.jx[..., :2]
        both = np.concatenate([jx, pull[..., None]], axis=-1)
        moved = np.linalg.solve(with_prior(sums.jj, precision), both)
        back = np.swapaxes(jx, -1, -2) @ moved
        alike = at_side(solutions.correlation, side)
        located = np.isfinite(alike)
        share = np.where(located, 1.0 / np.where(located, alike, 1.0), 0.0)[..., None]
        information += ((sums.xx[..., :2, :2] - back[..., :2]) * share[..., None]).sum(axis=(0, 1))
        gradient += ((sums.xr[..., :2] - back[..., 2]) * share).sum(axis=(0, 1))
        correlations.append(alike[located])
        scales.append(at_side(solutions.scale, side)[located])
    sigma_prior = np.array([config.bias_sigma_m, config.bias_slope_sigma_m])
    # A prior of 0 holds a parameter at 0.
    precision_prior = 1.0 / np.maximum(sigma_prior, 1e-9) ** 2
    covariance = np.linalg.inv(information + np.diag(precision_prior))
    return _Step(
        change=covariance @ (gradient + bias * precision_prior),
        covariance=covariance,
        correlation=_median(np.concatenate(correlations), 1.0),
        sigma_m=_SIGMA_M * _median(np.concatenate(scales), 1.0),
    )


def _median(values: Float64[Array, "K"], otherwise: float) -> float:
    return float(np.median(values)) if len(values) else otherwise
