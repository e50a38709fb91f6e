"""Where the cones of a kept zone stand, by the sums of its drives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gaia_uwb._shared import Array, Float64
from gaia_uwb.episode import ErrorSizes
from gaia_uwb.kept.sums import ZoneSums
from gaia_uwb.locate import (
    DRIVE,
    OWN,
    RADIOS,
    own_prior,
    sizes_of_cones,
    sizes_of_errors,
)

_ROUNDS = 3  # in which the sizes of delays and patterns are estimated
_FIELD_ROUNDS = 20  # in which those of slow errors are
_LEAST_WEIGHT = 1e-6  # of a side, as in the sums
_LEAST_SHARE = 1e-9  # of the largest common error that another one must have to count


@dataclass(frozen=True)
class CommonPrior:
    """What is known before any drive of what stays from drive to drive.

    Parameters
    ----------
    radios : (2,)
        Mean of bias and growth.
    precision : (V, V)
        Of these, and of what each tag keeps; V = 2 + 6 G.
    """

    radios: Float64[Array, "2"]
    precision: Float64[Array, "V V"]


@dataclass(frozen=True)
class ZoneEstimates:
    """What the sums of a zone say.

    Parameters
    ----------
    own : (N, 2, 5)
        Of each cone, on each side: east, north, delay and pattern.
    shared : (V,)
        Bias, growth, and what each tag keeps.
    covariance : (W, W)
        Of all unknowns as the estimator steps by it; W = V + 10 N, sides weighed.
    precision : (N, 2, 5, 5)
        Of each cone, given what is shared.
    places_m2 : (N, 2, 2, 2)
        Covariance of the places, as it is reported.
    shared_m : (N, 2, 2, C)
        How places err together, as in :class:`gaia_uwb.locate.Hypotheses`.
    loss : (N, 2)
        Negative log evidence of each side.
    sizes
        Of the errors.
    """

    own: Float64[Array, "N 2 5"]
    shared: Float64[Array, "V"]
    covariance: Float64[Array, "W W"]
    precision: Float64[Array, "N 2 5 5"]
    places_m2: Float64[Array, "N 2 2 2"]
    shared_m: Float64[Array, "N 2 2 C"]
    loss: Float64[Array, "N 2"]
    sizes: ErrorSizes

    @property
    def weight(self) -> Float64[Array, "N 2"]:
        """The probability of each side by the ranges alone."""
        weight = np.exp(self.loss.min(axis=1, keepdims=True) - self.loss)
        return np.asarray(weight / weight.sum(axis=1, keepdims=True))


def estimate(
    sums: ZoneSums, common: CommonPrior, sizes: ErrorSizes, least_noise_m: float
) -> ZoneEstimates:
    """Solve the linear system of a zone.

    Parameters
    ----------
    sums
        Of its drives.
    common
        What is known before them.
    sizes
        Where the estimates of delays and patterns start.
    least_noise_m
        Least white noise, in metres.
    """
    n = len(sums.anchor_ids)
    first = RADIOS + DRIVE * len(sums.vehicles)
    weights = np.maximum(sums.weight, _LEAST_WEIGHT)[..., None, None]
    field_m = sizes.field_m
    for _ in range(_FIELD_ROUNDS):
        of_errors = sizes_of_errors(sums.sizes.now(field_m), np.array(least_noise_m))
        field_m = of_errors["field_m"]
    kept = {name: float(of_errors[name]) for name in ("noise_m", "alike", "outlier_share")}
    pull = sums.pull.copy()
    pull[:first] += common.precision[:, :RADIOS] @ common.radios
    delay_m, pattern_m = sizes.delay_m, sizes.pattern_m
    for _ in range(_ROUNDS):
        now = ErrorSizes(**kept, field_m=field_m, delay_m=delay_m, pattern_m=pattern_m)
        prior = own_prior(now)
        inverse = np.linalg.inv(sums.own_matrix + prior)
        covariance = np.linalg.inv(_with_priors(sums.information, common, weights * prior, 1.0))
        found = covariance @ pull
        own = found[first:].reshape(n, 2, OWN)
        spread = own**2 + np.diagonal(inverse, axis1=-2, axis2=-1)
        spread = np.einsum("ns,nsi->i", sums.weight, spread)
        squares_m2 = (np.array(spread[2]), np.array(spread[3:].sum()))
        of_cones = sizes_of_cones(*squares_m2, np.array(n))
        delay_m, pattern_m = float(of_cones["delay_m"]), float(of_cones["pattern_m"])
    places_m2, shared_m = _honest(sums, common, weights, prior, inverse)
    own = _held(own, sums, prior)
    loss = sums.loss - 0.5 * np.linalg.slogdet(inverse)[1]
    own[..., :2] += sums.reference_m
    return ZoneEstimates(
        own=own,
        shared=found[:first],
        covariance=covariance,
        precision=sums.own_matrix + prior,
        places_m2=places_m2,
        shared_m=shared_m,
        loss=loss,
        sizes=now,
    )


def _held(
    own: Float64[Array, "N 2 5"], sums: ZoneSums, prior: Float64[Array, "5 5"]
) -> Float64[Array, "N 2 5"]:
    """Return estimates, with places on unlikely sides where their blocks were taken.

    Seen from several lanes, the place on the other side of the path is no minimum: a linear system
    would lead it over the path to where the cone stands, and then both sides would fit alike.
    """
    rest = slice(2, None)
    inverse = np.linalg.inv((sums.own_matrix + prior)[..., rest, rest])
    out = np.zeros_like(own)
    out[..., rest] = (inverse @ sums.own_pull[..., rest, None])[..., 0]
    return np.where(sums.unlikely[..., None], out, own)


def _with_priors(
    matrix: Float64[Array, "W W"],
    common: CommonPrior,
    prior: Float64[Array, "N 2 5 5"],
    sure: float,
) -> Float64[Array, "W W"]:
    """Add the priors; that of what is shared ``sure`` times as precise as it is."""
    out = matrix.copy()
    first = len(common.precision)
    out[:first, :first] += sure * common.precision
    blocks = prior.reshape(-1, OWN, OWN)
    place = first + OWN * np.arange(len(blocks))[:, None] + np.arange(OWN)
    out[place[:, :, None], place[:, None]] += blocks
    return out


def _honest(
    sums: ZoneSums,
    common: CommonPrior,
    weights: Float64[Array, "N 2 1 1"],
    prior: Float64[Array, "5 5"],
    inverse: Float64[Array, "N 2 5 5"],
) -> tuple[Float64[Array, "N 2 2 2"], Float64[Array, "N 2 2 C"]]:
    """Return the covariances of places, and how these err together (see ``sums.py``)."""
    n = len(inverse)
    covariance = np.linalg.inv(_with_priors(sums.honest, common, weights * prior, 2.0))
    first = len(common.precision)
    places = first + (OWN * np.arange(2 * n)[:, None] + np.arange(2)).ravel()
    together = 2.0 * covariance[np.ix_(places, places)]
    alone = np.linalg.inv(weights * (sums.own_matrix + prior))[..., :2, :2].reshape(-1, 2, 2)
    at = 2 * np.arange(2 * n)[:, None] + np.arange(2)
    together[at[:, :, None], at[:, None]] -= 2.0 * alone
    value, vector = np.linalg.eigh(0.5 * (together + together.T))
    counts = value > _LEAST_SHARE * max(float(value[-1]), 0.0)
    root = vector[:, counts] * np.sqrt(value[counts])
    shared_m = root.reshape(n, 2, 2, -1)
    return inverse[..., :2, :2] + shared_m @ np.swapaxes(shared_m, -1, -2), shared_m
