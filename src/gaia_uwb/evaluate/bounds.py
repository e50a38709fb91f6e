"""What no method can beat: a bound on the error of places, and on that of sides.

Both need the truth, and are for scores only. Both are optimistic on purpose: errors of ranges are
taken as white, their mean as known, and who uses them as knowing which ranges have a line of sight.

References
----------
The Cramer-Rao bound of a place from ranges along a known path; ranges without line of sight count
by the spread of their excess (T. Wang, "Novel sensor location scheme using time-of-arrival
estimates", and arXiv 1104.4056: a bias with a prior adds information according to its spread).
"""

from __future__ import annotations

from statistics import NormalDist

import numpy as np

from gaia_uwb._shared import Array, Bool, Float64, InputError
from gaia_uwb.episode import Episode, EpisodeTruth
from gaia_uwb.solver import SolverOptions, solve

_LEAST_SIGMA_M = 0.01  # no radio is better, and no trajectory
_GAUSSIAN = SolverOptions(dof=0.0, fixed_scale=1.0)


def cramer_rao_m(episode: Episode) -> Float64[Array, "N"]:
    """Return the least root mean square error of each anchor's place, given the right side.

    Parameters
    ----------
    episode
        With the truth of a simulator.

    Returns
    -------
    (N,)
        In metres; infinite where ranges do not fix the place.

    Raises
    ------
    InputError
        If the truth of the ranges' errors is not known.
    """
    truth, variance_m2 = _errors(episode)
    off_m = truth.anchor_m - episode.position_m[:, None]  # (T, N, 2)
    unit = off_m / np.maximum(truth.range_m, 0.1)[..., None]
    weight = np.where(episode.valid, 1.0 / variance_m2, 0.0)
    information = np.einsum("tn,tni,tnj->nij", weight, unit, unit)
    determinant = np.linalg.det(information)
    fixed = determinant > 1e-9
    trace = np.trace(information, axis1=1, axis2=2)
    nowhere = np.full(len(trace), np.inf)
    variance_m2 = np.divide(trace, determinant, out=nowhere, where=fixed)
    return np.asarray(np.sqrt(variance_m2))


def wrong_sides_probability(episode: Episode) -> float:
    """Return how often the sides of a scene as a whole must be told wrong, from its ranges alone.

    The anchors' best places on the other side explain their true ranges less well; how much, in
    standard errors, is what decides. A prior on how work zones look can do better.

    Parameters
    ----------
    episode
        With the truth of a simulator.

    Raises
    ------
    InputError
        If the truth of the ranges' errors is not known.

    Examples
    --------
    >>> from gaia_uwb.simulate import PRESETS, simulate_episode
    >>> straight = simulate_episode(PRESETS["straight"], seed=0).window(0, 64)
    >>> wrong_sides_probability(straight) > 0.2
    True
    """
    truth, variance_m2 = _errors(episode)
    seen = episode.valid & ~truth.nlos
    range_m = np.where(seen, truth.range_m, np.nan)
    heights = None
    if episode.tag_up_m is not None and episode.anchor_up_m is not None:
        heights = (episode.tag_up_m[None], episode.anchor_up_m[None])
    found = solve(
        episode.position_m[None],
        np.ascontiguousarray(range_m.T)[None],
        np.ascontiguousarray(np.sqrt(variance_m2).T)[None],
        height_m=heights,
        options=_GAUSSIAN,
    )
    fit = found.negative_log_likelihood[0]
    evidence = float(np.nan_to_num(np.abs(fit[:, 0] - fit[:, 1]), nan=0.0).sum())
    # The log odds of the sides are normal with this mean and twice this variance.
    return NormalDist().cdf(-float(np.sqrt(evidence / 2.0)))


def _errors(episode: Episode) -> tuple[EpisodeTruth, Float64[Array, "T N"]]:
    """Return the truth, and the variance of every range's error, anchor by anchor."""
    truth = episode.truth
    if truth is None or truth.bias_m is None or truth.outlier is None:
        raise InputError("expected the truth of the ranges' errors", source=episode.name)
    noise_m = episode.range_m - truth.range_m - truth.bias_m
    plain = episode.valid & ~truth.outlier
    noise_m2 = _variance(noise_m, plain)
    excess_m2 = _variance(truth.bias_m, plain & truth.nlos) + _LEAST_SIGMA_M**2
    return truth, np.where(truth.nlos, noise_m2 + excess_m2, noise_m2) + _LEAST_SIGMA_M**2


def _variance(values: Float64[Array, "T N"], which: Bool[Array, "T N"]) -> Float64[Array, "N"]:
    count = np.maximum(which.sum(axis=0), 1)
    kept = np.where(which, np.nan_to_num(values, nan=0.0), 0.0)
    mean = kept.sum(axis=0) / count
    return np.asarray(np.where(which, (kept - mean) ** 2, 0.0).sum(axis=0) / count)
