"""Locate anchors from ranges along a known path: robust, batched, both mirror hypotheses.

For one anchor at ``a`` with ranges ``d_t`` taken at ``p_t``, standard deviations ``sigma_t`` and a
height gap ``h_t`` (tag antenna minus anchor)::

    d_t = sqrt(|p_t - a|^2 + h_t^2) + bias + scale * sigma_t * e_t

1. *Start.* The squared-range cost ``sum w (|a - p|^2 + h^2 - d^2)^2`` has its global minimum at the
   largest root of one scalar equation (Beck, Stoica and Li, "Exact and approximate solutions of
   source localization problems", 2008), so no guess is needed. It is solved twice, the second time
   with weights under which outliers have no say.
2. *Refinement.* e_t is Student-t (or Gaussian: weighted least squares); place, bias and scale are
   found by maximum likelihood. Ranges along a straight line fit the anchor's mirror position as
   well as the anchor, so the reflection of the solution in the path's principal axis is also
   refined: two hypotheses, each with its likelihood. ``sides.py`` chooses.
3. *Covariance.* Errors of neighbouring ranges are alike (a body in the way, multipath, the clock),
   so the information matrix alone is too optimistic. The sandwich estimate with the long-run
   variance of the score (Newey and West, 1987) accounts for what the ranges are really worth.

Problems do not affect each other: solving many together gives what each alone gives, to the last
bit, and a degenerate anchor or a NaN stays its own problem. The inner loop is compiled
(``_solver.c``).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gaia_uwb._shared import Array, Bool, Float64, Int64
from gaia_uwb.solver import _solver

# Columns of the compiled loop's result, in the order of the enumeration in _solver.c.
_PLACE, _BIAS, _SCALE, _NLL = slice(0, 2), 2, 3, 4
_INFORMATION, _LONG_RUN = slice(5, 11), slice(11, 17)
_CORRELATION, _ITERATIONS, _CONVERGED, _COUNT = 17, 18, 19, 20
# Where (ee, en, nn, eb, nb, bb) stand in a symmetric matrix over (east, north, bias).
_UNKNOWNS = 3  # place and bias
_SYMMETRIC = np.array([[0, 1, 3], [1, 2, 4], [3, 4, 5]])


@dataclass(frozen=True)
class SolverOptions:
    """Settings of the compiled loop; :class:`gaia_uwb.config.SolverConfig` fills it.

    Parameters
    ----------
    dof
        Degrees of freedom of the Student-t errors; 0 for Gaussian errors. The fit withstands a
        share of gross outliers of about ``1 / (dof + 1)``.
    scale_floor
        The estimated scale of the errors is never below this multiple of ``sigma_m``.
    fixed_scale
        Above 0: trust ``sigma_m`` times this instead of estimating a scale.
    tolerance
        Converged when a step is shorter than this many standard errors; it is still taken.
    max_iterations
        Give up (status ``not-converged``) after this many steps.
    max_lag
        Ranges up to this many steps apart may have correlated errors.
    min_ranges
        A problem with fewer usable ranges is not solved.
    """

    dof: float = 4.0
    scale_floor: float = 0.05
    fixed_scale: float = 0.0
    tolerance: float = 0.02
    max_iterations: int = 60
    max_lag: int = 8
    min_ranges: int = 4


@dataclass(frozen=True)
class Solutions:
    """Both hypotheses of every problem; the axis H = 2 is (start, its mirror image), not ranked.

    Parameters
    ----------
    position_m : (B, N, 2, 2)
        East and north of each hypothesis; NaN where a problem has too few ranges.
    bias_m, scale, negative_log_likelihood : (B, N, 2)
        Range bias (measured minus true), scale of the errors, and fit.
    information, long_run : (B, N, 2, 3, 3)
        Fisher information over (east, north, bias), with the bias's prior, and long-run variance
        of the score. With ``bias_sigma_m`` 0 the covariance of the place is made of their upper
        left 2 x 2 blocks, ``inv(information) @ long_run @ inv(information)``.
    correlation : (B, N, 2)
        Variance inflation of a mean of residuals by their correlation in time, at least 1.
    n_ranges : (B, N)
        Usable ranges.
    iterations : (B, N, 2)
        Steps taken.
    converged : (B, N, 2)
        Whether the refinement converged.
    """

    position_m: Float64[Array, "B N 2 2"]
    bias_m: Float64[Array, "B N 2"]
    scale: Float64[Array, "B N 2"]
    negative_log_likelihood: Float64[Array, "B N 2"]
    information: Float64[Array, "B N 2 3 3"]
    long_run: Float64[Array, "B N 2 3 3"]
    correlation: Float64[Array, "B N 2"]
    n_ranges: Int64[Array, "B N"]
    iterations: Float64[Array, "B N 2"]
    converged: Bool[Array, "B N 2"]


def solve(
    position_m: Float64[Array, "B T 2"],
    range_m: Float64[Array, "B N T"],
    sigma_m: Float64[Array, "B N T"] | float,
    *,
    height_m: tuple[Float64[Array, "B T"], Float64[Array, "B N"]] | None = None,
    bias_sigma_m: Float64[Array, "B N"] | float = 0.0,
    options: SolverOptions = SolverOptions(),
) -> Solutions:
    """Locate N anchors in each of B episodes; every problem on its own.

    Parameters
    ----------
    position_m : (B, T, 2)
        East and north of the tag's antenna, in metres.
    range_m : (B, N, T)
        Slant ranges, in metres.
    sigma_m : (B, N, T) or float
        Standard deviations, in metres; a range whose sigma is not above 0 is ignored, and so is
        one whose range, sigma, position or height is NaN or beyond a million kilometres.
    height_m : ((B, T), (B, N)), optional
        Heights of the tag's antenna and of the anchors, in metres; NaN where an anchor's height is
        unknown (then its ranges count as horizontal).
    bias_sigma_m : (B, N) or float
        Prior standard deviation of each anchor's range bias, in metres; 0 for no bias.
    options
        Settings of the solver.

    Returns
    -------
    Solutions
        Two hypotheses per anchor, each with its likelihood and information.

    Raises
    ------
    ValueError
        If shapes disagree or ``options.min_ranges`` is below 3.

    Examples
    --------
    >>> import numpy as np
    >>> path = np.array([[[0.0, 0.0], [5.0, 1.0], [10.0, 0.0], [15.0, 2.0], [20.0, 0.0]]])
    >>> ranges = np.hypot(path[..., 0] - 8.0, path[..., 1] - 6.0)[:, None]
    >>> found = solve(path, ranges, 0.1)
    >>> best = found.negative_log_likelihood[0, 0].argmin()
    >>> found.position_m[0, 0, best].round(3)
    array([8., 6.])
    """
    episodes, anchors, steps = range_m.shape
    tag_m, anchor_m = height_m or (np.zeros((episodes, steps)), np.zeros((episodes, anchors)))
    for name, array, shape in (
        ("position_m", position_m, (episodes, steps, 2)),
        ("the tag's height_m", tag_m, (episodes, steps)),
        ("the anchors' height_m", anchor_m, (episodes, anchors)),
    ):
        if array.shape != shape:
            raise ValueError(f"expected {name} of shape {shape}, got {array.shape}")
    if options.min_ranges < _UNKNOWNS:
        raise ValueError(f"expected min_ranges of at least 3, got {options.min_ranges}")
    out = np.empty((episodes, anchors, 2, _solver.WIDTH))
    _solver.solve(
        _flat(position_m), _flat(tag_m), _flat(range_m),
        _flat(np.broadcast_to(sigma_m, range_m.shape)), _flat(anchor_m),
        _flat(np.broadcast_to(bias_sigma_m, (episodes, anchors))),
        out, episodes, anchors, steps, options.dof, options.scale_floor, options.fixed_scale,
        options.tolerance, options.max_iterations, options.max_lag, options.min_ranges,
    )  # fmt: skip
    return Solutions(
        position_m=out[..., _PLACE],
        bias_m=out[..., _BIAS],
        scale=out[..., _SCALE],
        negative_log_likelihood=out[..., _NLL],
        information=out[..., _INFORMATION][..., _SYMMETRIC],
        long_run=out[..., _LONG_RUN][..., _SYMMETRIC],
        correlation=out[..., _CORRELATION],
        n_ranges=out[:, :, 0, _COUNT].astype(np.int64),
        iterations=out[..., _ITERATIONS],
        converged=out[..., _CONVERGED] == 1.0,
    )


def fisher_share(dof: float) -> float:
    """Return what a range's robust weight is worth as information: below 1 for Student-t errors.

    Parameters
    ----------
    dof
        Degrees of freedom; 0 for Gaussian errors.

    Examples
    --------
    >>> fisher_share(0.0), round(fisher_share(4.0), 3)
    (1.0, 0.714)
    """
    return (dof + 1.0) / (dof + 3.0) if dof > 0 else 1.0


def _flat(array: Array) -> Array:
    """Return the plain memory that the compiled loop reads."""
    return np.ascontiguousarray(array, dtype=np.float64)
