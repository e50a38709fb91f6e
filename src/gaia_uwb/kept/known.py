"""What a zone knows of the cones and the errors of a drive before that drive."""

from __future__ import annotations

import numpy as np

from gaia_uwb._shared import Array, Bool, Float64, Int64
from gaia_uwb.kept.state import Folded
from gaia_uwb.locate import DRIVE, OWN, RADIOS, DriveBlock, DriveReadings, KnownBefore, own_prior


def known_before(zone: Folded, readings: DriveReadings) -> KnownBefore:
    """Return what a zone knows of the cones and the errors of a drive before it.

    Parameters
    ----------
    zone
        Without the drive.
    readings
        Of the drive.
    """
    sums, estimates = zone.sums, zone.estimates
    before = {name: n for n, name in enumerate(sums.anchor_ids)}
    rows = [before.get(name, -1) for name in readings.anchor_ids]
    cone = np.array(rows, dtype=np.int64)
    is_known = (cone >= 0) & (sums.n_ranges[cone] > 0)
    n = len(cone)
    mean, loss = np.zeros((n, 2, OWN)), np.zeros((n, 2))
    precision = np.tile(own_prior(estimates.sizes), (n, 2, 1, 1))
    given = precision.copy()
    own = cone[is_known]
    mean[is_known], given[is_known] = estimates.own[own], estimates.precision[own]
    precision[is_known] = np.linalg.inv(_marginal(zone)[own])
    loss[is_known] = estimates.loss[own] - estimates.loss[own].min(axis=1, keepdims=True)
    mean_shared, covariance = _shared(zone, readings)
    return KnownBefore(
        is_known=is_known,
        mean=mean,
        precision=precision,
        loss=loss,
        given_shared=given,
        shared_mean=mean_shared,
        shared_covariance=covariance,
        sizes=estimates.sizes,
        size_sums=sums.sizes,
    )


def unlikely_sides(zone: Folded, readings: DriveReadings) -> Bool[Array, "n 2 1"]:
    """Return which sides of a drive's cones are unlikely by the drives before it."""
    known = dict(zip(zone.sums.anchor_ids, zone.sums.unlikely, strict=True))
    nothing = np.zeros(2, dtype=np.bool_)
    return np.array([known.get(name, nothing) for name in readings.anchor_ids])[..., None]


def _marginal(zone: Folded) -> Float64[Array, "N 2 5 5"]:
    """Return the covariance of each cone on each side as if it stood there."""
    sums, estimates = zone.sums, zone.estimates
    first = RADIOS + DRIVE * len(sums.vehicles)
    n = len(sums.anchor_ids)
    place = first + OWN * np.arange(2 * n)[:, None] + np.arange(OWN)
    weighed = estimates.covariance[place[:, :, None], place[:, None]].reshape(n, 2, OWN, OWN)
    alone = np.linalg.inv(estimates.precision)
    weights = np.maximum(sums.weight, 1e-6)[..., None, None]
    return np.asarray(weighed - alone / weights + alone)


def _of_tags(vehicles: tuple[str, ...], readings: DriveReadings) -> Int64[Array, "S"]:
    """Return which unknowns are the radios' and those of a drive's tags."""
    tags = np.array([vehicles.index(name) for name in readings.vehicles], dtype=np.int64)
    own = (RADIOS + DRIVE * tags[:, None] + np.arange(DRIVE)).ravel()
    return np.concatenate([np.arange(RADIOS), own])


def _shared(
    zone: Folded, readings: DriveReadings
) -> tuple[Float64[Array, "S"], Float64[Array, "S S"]]:
    """Return what is known of the radios and of a drive's tags before the drive."""
    sums, estimates, prior = zone.sums, zone.estimates, readings.prior
    size = RADIOS + DRIVE * len(sums.vehicles)
    mean, covariance = estimates.shared, estimates.covariance[:size, :size]
    index = _of_tags(sums.vehicles, readings)
    mean, covariance = mean[index], covariance[np.ix_(index, index)].copy()
    mean[RADIOS:] += prior.mean
    covariance[RADIOS:, RADIOS:] += prior.own
    return mean, covariance


def without_drive(zone: Folded, block: DriveBlock) -> Float64[Array, "n 2 5 5"]:
    """Return what is known of a drive's cones without that drive, whose block is in the zone."""
    return zone.estimates.precision[zone.sums.rows(block.anchor_ids)] - block.matrix
