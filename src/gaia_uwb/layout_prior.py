"""How work zones look: a prior on the places of all anchors together.

Anchors of one zone stand near each other, often along a line, at a scale nobody knows beforehand.
As a model: ``a_i ~ N(mu, Sigma)`` with any centre ``mu`` and ``Sigma`` inverse-Wishart with ``dof``
degrees of freedom and scale ``dof * size^2 * I``. Few degrees of freedom allow any elongated
shape (a taper of cones), many mean a round cluster. ``mu`` and ``Sigma`` integrate out in closed
form, which leaves a price on the scatter S of the anchors::

    ln p(a) = ln Z(dof, size) - (dof + N - 1) / 2 * ln det(dof size^2 I + S)

Shapes and sizes from 0.7 m to 128 m are all tried and weighted by how well they explain the ranges
(empirical Bayes), so nothing is assumed about the scale of a zone. Given the sides, each
anchor's likelihood is taken as Gaussian; the best places then follow from a few closed-form steps,
each of which replaces the price by a quadratic that touches it from above.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import lgamma, log, pi

import numpy as np

from gaia_uwb._typing import Array, Float64

_STEPS = 40
_SHAPES = (2.0, 40.0)  # degrees of freedom: a line of cones, a round cluster
_SIZES_M = (128.0, 32.0, 8.0, 2.0, 0.7)


@dataclass(frozen=True)
class JointPlaces:
    """Places of N anchors under K combinations of sides and L shapes and sizes of the prior.

    Parameters
    ----------
    place_m : (K, L, N, 2)
        Most probable places.
    covariance_m2 : (K, L, N, 2, 2)
        Their posterior covariance.
    own_m2 : (K, L, N, 2, 2)
        The part of it that is each anchor's own, ``G_i``.
    pull_per_m2 : (K, L, 2, 2)
        The rest, through the centre that nobody knows: anchors i and j have the covariance
        ``G_i pull G_j``.
    log_evidence : (K, L)
        How well combination and prior explain the ranges.
    """

    place_m: Float64[Array, "K L N 2"]
    covariance_m2: Float64[Array, "K L N 2 2"]
    own_m2: Float64[Array, "K L N 2 2"]
    pull_per_m2: Float64[Array, "K L 2 2"]
    log_evidence: Float64[Array, "K L"]


def joint_places(
    place_m: Float64[Array, "K N 2"], covariance_m2: Float64[Array, "K N 2 2"]
) -> JointPlaces:
    """Locate N anchors jointly, for K choices of what each anchor's own ranges say.

    Parameters
    ----------
    place_m, covariance_m2 : (K, N, 2), (K, N, 2, 2)
        Each anchor's own place and covariance in each combination.

    Returns
    -------
    JointPlaces
        The evidence leaves out the likelihoods' own heights, which the caller adds.
    """
    n = place_m.shape[1]
    prior = [(dof, size) for dof in _SHAPES for size in _SIZES_M]
    dof = np.array([d for d, _ in prior])
    base = np.array([d * s * s for d, s in prior])[:, None, None] * np.eye(2)  # (L, 2, 2)
    strength = (dof + n - 1.0)[:, None, None]
    precision = np.linalg.inv(covariance_m2)[:, None]  # (K, 1, N, 2, 2)
    pull = (precision @ place_m[:, None, :, :, None])[..., 0]  # (K, 1, N, 2)
    place = np.repeat(place_m[:, None], len(prior), axis=1)
    for _ in range(_STEPS):
        scatter = _scatter(place)
        stiffness = strength * np.linalg.inv(base + scatter)  # (K, L, 2, 2)
        gain = np.linalg.inv(precision + stiffness[:, :, None])  # (K, L, N, 2, 2)
        own = gain @ precision
        centre = np.linalg.solve(own.sum(axis=2), (gain @ pull[..., None]).sum(axis=2))
        target = pull[..., None] + (stiffness @ centre)[:, :, None]
        new = (gain @ target)[..., 0]
        moved = float(np.abs(new - place).max())
        place = new
        if moved < 1e-4:
            break
    covariance, pull_per_m2, log_det = _posterior(gain, stiffness, n)
    off = place - place_m[:, None]
    misfit = 0.5 * np.einsum(
        "klni,klnij,klnj->kl", off, np.broadcast_to(precision, gain.shape), off
    )
    price = 0.5 * strength[:, 0, 0] * np.linalg.slogdet(base + _scatter(place))[1]
    normal = np.array([_log_normal(d, s, n) for d, s in prior])
    evidence = normal - price - misfit - 0.5 * log_det
    return JointPlaces(place, covariance, gain, pull_per_m2, evidence)


def _scatter(place: Float64[Array, "K L N 2"]) -> Float64[Array, "K L 2 2"]:
    centred = place - place.mean(axis=2, keepdims=True)
    return np.asarray(np.swapaxes(centred, -1, -2) @ centred)


def _posterior(
    gain: Float64[Array, "K L N 2 2"], stiffness: Float64[Array, "K L 2 2"], n: int
) -> tuple[Float64[Array, "K L N 2 2"], Float64[Array, "K L 2 2"], Float64[Array, "K L"]]:
    """Return covariances, their coupling and the log determinant of the whole Hessian.

    The Hessian is block diagonal (``inv(gain)``) less the coupling through the common centre, a
    matrix of rank 2, so both follow without ever forming it.
    """
    coupling = np.eye(2) - (gain.sum(axis=2) / n) @ stiffness  # (K, L, 2, 2)
    middle = stiffness @ np.linalg.inv(coupling) / n
    covariance = gain + gain @ middle[:, :, None] @ np.swapaxes(gain, -1, -2)
    log_det = np.linalg.slogdet(coupling)[1] - np.linalg.slogdet(gain)[1].sum(axis=2)
    return 0.5 * (covariance + np.swapaxes(covariance, -1, -2)), middle, log_det


def _log_normal(dof: float, size_m: float, n: int) -> float:
    """Return ln Z of the integrated prior, so that shapes and sizes can be compared."""
    return (
        dof * log(dof * size_m * size_m)
        + _log_gamma2((dof + n - 1.0) / 2.0)
        - _log_gamma2(dof / 2.0)
        - (n - 1.0) * log(pi)
    )


def _log_gamma2(x: float) -> float:
    """Return the log of the bivariate gamma function; x above 1/2."""
    return 0.5 * log(pi) + lgamma(x) + lgamma(x - 0.5)
