"""A zone whose drives are added up, and what is read off it for one drive."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from gaia_uwb._shared import Array, Float64
from gaia_uwb.config import PipelineConfig
from gaia_uwb.episode import DriveErrors, Episode, ErrorSizes
from gaia_uwb.kept.changes import Watched
from gaia_uwb.kept.estimates import CommonPrior, ZoneEstimates, estimate
from gaia_uwb.kept.scatter import OwnPlaces, ScatterSums
from gaia_uwb.kept.sums import ZoneSums, own_part
from gaia_uwb.locate import (
    DRIVE,
    RADIOS,
    DriveBlock,
    DriveReadings,
    Point,
    drive_prior,
    lasting_prior,
    vehicle_of,
)

FULL = 4
"""Drives that are kept whole, so that the result is that of fitting them together."""


@dataclass(frozen=True)
class Counts:
    """How often a zone's past had to be worked on again.

    Parameters
    ----------
    resummed
        Times that sums were formed anew, as sides had become likelier or less likely.
    refolded
        Blocks of drives that were taken anew, as places had moved.
    """

    resummed: int = 0
    refolded: int = 0


@dataclass(frozen=True)
class Folded:
    """A zone whose drives are added up.

    Parameters
    ----------
    sums
        Of its drives.
    common
        What was known before them.
    start, least_noise_m
        Sizes of errors from which the estimates start, and the least white noise.
    points_m
        Of each drive, where its block put each cone, by its id.
    scatter
        How the drives' own places scatter.
    counts
        How often the past was worked on again.
    since
        Of cones that were moved, the number of the first drive that heard them where they stand.
    watched
        What is known of changes, by cone.
    ended_s
        When the last drive ended.
    """

    sums: ZoneSums
    common: CommonPrior
    start: ErrorSizes
    least_noise_m: float
    points_m: tuple[dict[str, Float64[Array, "2"]], ...]
    scatter: ScatterSums
    counts: Counts = Counts()
    since: dict[str, int] = field(default_factory=dict)
    watched: dict[str, Watched] = field(default_factory=dict)
    ended_s: float = 0.0

    @cached_property
    def estimates(self) -> ZoneEstimates:
        """What the sums say."""
        return estimate(self.sums, self.common, self.start, self.least_noise_m)

    @property
    def places_m(self) -> dict[str, Float64[Array, "2"]]:
        """Where each cone stands, on its likelier side."""
        return dict(zip(self.sums.anchor_ids, best_places(self.estimates), strict=True))


@dataclass(frozen=True)
class OneFold:
    """What came of folding one drive in.

    Parameters
    ----------
    zone
        With this drive.
    block
        What it says.
    own
        Where it alone puts the cones.
    errors
        What was found of each of its tags.
    refolded
        Blocks of earlier drives that were taken anew, by their number.
    """

    zone: Folded
    block: DriveBlock
    own: OwnPlaces
    errors: tuple[DriveErrors, ...]
    refolded: dict[int, DriveBlock]


@dataclass(frozen=True)
class Past:
    """The earlier drives of a zone, read when they are needed.

    Parameters
    ----------
    n_drives
        How many.
    episodes, block
        Of a drive, by its number.
    """

    n_drives: int
    episodes: Callable[[int], Sequence[Episode]]
    block: Callable[[int], DriveBlock]


def best_places(estimates: ZoneEstimates) -> Float64[Array, "N 2"]:
    """Return where each cone stands, on its likelier side."""
    side = estimates.loss.argmin(axis=1)
    return np.asarray(estimates.own[np.arange(len(side)), side, :2])


def point_now(zone: Folded, block: DriveBlock) -> Point:
    """Return where a drive's block is to be taken by what the zone says now.

    Parameters
    ----------
    zone
        With this drive.
    block
        What the drive said so far.
    """
    sums, estimates = zone.sums, zone.estimates
    cone = sums.rows(block.anchor_ids)
    own = np.where(np.isfinite(block.point.own), estimates.own[cone], np.nan)
    tags = sums.tags(block.vehicles)
    at = np.nan_to_num(block.point.own)
    moved = np.concatenate(
        [
            estimates.shared[:RADIOS] - block.point.shared[:RADIOS],
            estimates.shared[tags],
            (np.nan_to_num(own) - at).ravel(),
        ]
    )
    phi = own_part(block, sums.weight[cone], moved)
    shared = np.concatenate([estimates.shared[:RADIOS], phi])
    return Point(own, shared, estimates.weight[cone], estimates.sizes)


def points_of(block: DriveBlock) -> dict[str, Float64[Array, "2"]]:
    """Return where a block put the cones, on the side that was the likelier then."""
    side = block.point.weight.argmax(axis=1)
    there = block.point.own[np.arange(len(side)), side, :2]
    return {
        name: place_m
        for name, place_m in zip(block.anchor_ids, there, strict=True)
        if np.isfinite(place_m).all()
    }


def errors_of(zone: Folded, block: DriveBlock) -> tuple[DriveErrors, ...]:
    """Return what was found of each tag of a drive."""
    shared = point_now(zone, block).shared
    tags = zone.sums.tags(block.vehicles)
    index = np.concatenate([np.arange(RADIOS), tags])
    covariance = zone.estimates.covariance[np.ix_(index, index)].copy()
    covariance[RADIOS:, RADIOS:] += np.linalg.inv(
        np.linalg.inv(block.prior.own)
        + np.einsum("ns,nsij->ij", block.point.weight, block.square)[RADIOS:, RADIOS:]
    )
    errors = []
    for k in range(len(block.vehicles)):
        of_tag = RADIOS + DRIVE * k + np.arange(DRIVE)
        own = np.concatenate([np.arange(RADIOS), of_tag])
        errors.append(DriveErrors(shared[own], covariance[np.ix_(own, own)], zone.estimates.sizes))
    return tuple(errors)


def least_noise_m(episodes: Sequence[Episode]) -> float:
    """Return the least white noise of the ranges of a drive."""
    return max(each.least_noise_m for each in episodes)


def readings_of_drive(
    episodes: Sequence[Episode], first: Episode, config: PipelineConfig
) -> DriveReadings:
    """Return the readings of a drive, ready for the estimator; biases count from the first's."""
    prior = drive_prior(episodes, first, config)
    return DriveReadings(episodes, prior, [vehicle_of(each) for each in episodes], config)


def common_of(episodes: Sequence[Episode], config: PipelineConfig) -> CommonPrior:
    """Return what is known beforehand of the radios and of the tags of all vehicles."""
    of_tags = {vehicle_of(each): each for each in reversed(episodes)}
    names = dict.fromkeys(vehicle_of(each) for each in episodes)
    return CommonPrior(*lasting_prior([of_tags[name] for name in names], config))
