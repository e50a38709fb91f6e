"""How work zones look: a prior on the places of all anchors together, given their sides.

Anchors of one zone stand near each other, often along a line, at a scale nobody knows beforehand.
As a model: ``a_i ~ N(mu, Sigma)`` with any centre ``mu`` and ``Sigma`` inverse-Wishart with ``dof``
degrees of freedom and scale ``dof * size^2 * I``. Few degrees of freedom allow any elongated
shape (a taper of cones), many mean a round cluster. ``mu`` and ``Sigma`` integrate out in closed
form, which leaves a price on the scatter S of the anchors::

    ln p(a) = ln Z(dof, size) - (dof + N - 1) / 2 * ln det(dof size^2 I + S)

Shapes and sizes from 0.7 m to 128 m are all tried and weighted by how well they explain the ranges
(empirical Bayes), so nothing is assumed about the scale of a zone. Given the sides, each
anchor's likelihood is taken as Gaussian; the best places then follow from a few closed-form steps,
each of which replaces the price by a quadratic that touches it from above. With it the anchors are
``a_i ~ N(c, T)``, ``T = (dof size^2 I + S) / (dof + N - 1)``, measured with covariances ``C_i``,
about a centre that nobody knows: with ``M_i = (T + C_i)^-1`` the centre is the mean of what was
measured with the weights ``M_i``, and a place is ``c + T M_i (measured_i - c)``.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import lgamma, log, pi

import numpy as np

from gaia_uwb._shared import Array, Float64, Symmetric

_STEPS, _STILL_M = 40, 1e-4  # at most so many, until no place moves farther
_SHAPES = (2.0, 40.0)  # degrees of freedom: a line of cones, a round cluster
_SIZES_M = (128.0, 32.0, 8.0, 2.0, 0.7)
SHARED_ERRORS = 0.5
"""Part of the anchors' variances that is common to all of them (the trajectory's, the clock's).

In the outdoor data set about half of the residuals' variance is. Only the other half bears on where
an anchor stands among the others: what is common moves the zone as a whole.
"""


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


def place_jointly(
    place_m: Float64[Array, "N 2"], covariance_m2: Float64[Array, "N 2 2"]
) -> tuple[Float64[Array, "N 2"], Float64[Array, "N 2 2"]]:
    """Return places and covariances, averaged over shapes and sizes.

    Parameters
    ----------
    place_m, covariance_m2 : (N, 2), (N, 2, 2)
        Each anchor's own place and covariance. What is common to all anchors says nothing of where
        one stands among the others.
    """
    common_m2 = SHARED_ERRORS * covariance_m2
    joint = joint_places(place_m[None], (covariance_m2 - common_m2)[None])
    weight = np.exp(joint.log_evidence[0] - joint.log_evidence[0].max())
    weight /= weight.sum()
    mean_m = np.einsum("l,lni->ni", weight, joint.place_m[0])
    off_m = joint.place_m[0] - mean_m
    between_m2 = np.einsum("l,lni,lnj->nij", weight, off_m, off_m)
    within_m2 = np.einsum("l,lnij->nij", weight, joint.covariance_m2[0])
    return mean_m, within_m2 + between_m2 + common_m2


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
    base_m2 = np.array([dof * size * size for dof, size in prior])
    strength = np.array([dof + n - 1.0 for dof, _ in prior])
    covariance = Symmetric.of(covariance_m2)[:, None]  # (K, 1, N)
    measured = np.moveaxis(place_m, -1, 0)[:, :, None]  # (2, K, 1, N)
    place = np.repeat(measured, len(prior), axis=2)  # (2, K, L, N)
    moving = np.arange(len(place_m))
    for _ in range(_STEPS):
        before = place[:, moving]
        spread = _spread(before, base_m2, strength)
        after = _shrunk(measured[:, moving], covariance[moving], spread)
        place[:, moving] = after
        moving = moving[np.abs(after - before).max(axis=(0, 2, 3)) >= _STILL_M]
        if not len(moving):
            break
    normal = np.array([_log_normal(d, s, n) for d, s in prior])
    spread = _spread(place, base_m2, strength)
    price = 0.5 * strength * (np.log(spread.determinant()) + 2.0 * np.log(strength))
    weight = (spread[..., None] + covariance).inverse()
    pull, log_det = _coupling(spread, covariance, weight)
    off = weight.times(*(measured - _centre(weight, measured)))
    misfit = 0.5 * covariance.square(*off).sum(axis=-1)
    own = (spread.inverse()[..., None] + covariance.inverse()).inverse()
    return JointPlaces(
        place_m=np.moveaxis(place, 0, -1),
        covariance_m2=(own + own.around(pull[..., None])).matrix(),
        own_m2=own.matrix(),
        pull_per_m2=pull.matrix(),
        log_evidence=normal - price - misfit - 0.5 * log_det,
    )


def _spread(
    place: Float64[Array, "2 K L N"], base_m2: Float64[Array, "L"], strength: Float64[Array, "L"]
) -> Symmetric:
    """Return T (K, L): how far anchors stand from their centre, given where these stand."""
    x, y = place - place.mean(axis=-1, keepdims=True)
    scatter = Symmetric((x * x).sum(axis=-1), (x * y).sum(axis=-1), (y * y).sum(axis=-1))
    round_m2 = Symmetric(base_m2, np.zeros_like(base_m2), base_m2)
    return (scatter + round_m2).scaled(1.0 / strength)


def _centre(weight: Symmetric, measured: Float64[Array, "2 K 1 N"]) -> Float64[Array, "2 K L 1"]:
    """Return the weighted mean of what was measured."""
    x, y = weight.times(*measured)
    return np.stack(weight.sum(axis=-1).inverse().times(x.sum(axis=-1), y.sum(axis=-1)))[..., None]


def _shrunk(
    measured: Float64[Array, "2 K 1 N"], covariance: Symmetric, spread: Symmetric
) -> Float64[Array, "2 K L N"]:
    """Return the places that are drawn towards their centre as far as T says."""
    weight = (spread[..., None] + covariance).inverse()
    centre = _centre(weight, measured)
    off = weight.times(*(measured - centre))
    return np.asarray(centre + np.stack(spread[..., None].times(*off)))


def _coupling(
    spread: Symmetric, covariance: Symmetric, weight: Symmetric
) -> tuple[Symmetric, Float64[Array, "K L"]]:
    """Return what couples the anchors through their centre, and the whole log determinant.

    The Hessian is block diagonal less a matrix of rank 2, so both follow without ever forming it.
    """
    n = covariance.xx.shape[-1]
    total = weight.sum(axis=-1)
    own = np.log(covariance.determinant()) + np.log(weight.determinant())
    log_det = np.log(total.determinant()) - 2.0 * log(n) - own.sum(axis=-1)
    return (
        spread.inverse().around(total.inverse()),
        log_det - (n - 1.0) * np.log(spread.determinant()),
    )


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
