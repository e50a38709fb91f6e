"""Begin to add up the drives of a zone: the first few, at the fit of all of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gaia_uwb._shared import Array, Float64
from gaia_uwb.config import PipelineConfig
from gaia_uwb.episode import DriveErrors, Episode
from gaia_uwb.kept.again import summed
from gaia_uwb.kept.judging import own_places, watch
from gaia_uwb.kept.known import without_drive
from gaia_uwb.kept.scatter import OwnPlaces, ScatterSums
from gaia_uwb.kept.state import (
    Folded,
    common_of,
    errors_of,
    least_noise_m,
    point_now,
    points_of,
    readings_of_drive,
)
from gaia_uwb.kept.sums import ZoneSums
from gaia_uwb.locate import ALIKE, RADIOS, DriveBlock, Point, ZonePlaces, find_places, own_prior

_ROUNDS = 8  # of taking blocks anew when a zone's sums begin


def begin(
    drives: Sequence[Sequence[Episode]], config: PipelineConfig, ended_s: Sequence[float] = ()
) -> tuple[Folded, list[DriveBlock], list[OwnPlaces], list[tuple[DriveErrors, ...]]]:
    """Fit drives together and add up their blocks at that fit.

    Parameters
    ----------
    drives
        Prepared episodes of each drive's tags, in the zone's frame and order.
    config
        All settings.
    ended_s
        When each of them ended; by default at once.
    """
    passes = sorted((each for drive in drives for each in drive), key=lambda each: each.name)
    places = find_places([passes], config)[0]
    errors = {id(each): found for each, found in zip(passes, places.errors, strict=True)}
    index = {name: n for n, name in enumerate(places.anchor_ids)}
    found = places.hypotheses
    located = np.asarray(np.isfinite(found.position_m).all(axis=(1, 2)))
    own = np.where(located[:, None, None], _own(places), np.nan)
    odds = ALIKE * found.log_odds
    other = 1.0 / (1.0 + np.exp(np.minimum(odds, 700.0)))
    weight = np.stack([1.0 - other, other], axis=1)
    episodes = [each for drive in drives for each in drive]
    common = common_of(episodes, config)
    readings = [readings_of_drive(drive, drives[0][0], config) for drive in drives]
    blocks = []
    for drive, each in zip(drives, readings, strict=True):
        cone = [index[name] for name in each.anchor_ids]
        mine = [errors[id(episode)] for episode in drive]
        shared = np.concatenate([mine[0].mean[:RADIOS], *(x.mean[RADIOS:] for x in mine)])
        point = Point(own[cone], shared, weight[cone], mine[0].sizes)
        prior = np.tile(own_prior(point.sizes), (len(cone), 2, 1, 1))
        blocks.append(each.block(point, prior, np.zeros((len(cone), 2))))
    zone = Folded(
        ZoneSums.of(blocks, {}, {}),
        common,
        places.errors[0].sizes,
        least_noise_m(passes),
        (),
        ScatterSums.nothing(),
    )
    blocks = _with_losses(blocks, zone, np.stack([0.0 * odds, odds], axis=1))
    zone = replace(zone, sums=ZoneSums.of(blocks, {}, {}))
    for _ in range(_ROUNDS):
        blocks = [
            each.block(point_now(zone, block), without_drive(zone, block), block.loss)
            for each, block in zip(readings, blocks, strict=True)
        ]
        zone = replace(zone, sums=summed(blocks, zone), start=zone.estimates.sizes)
    zone = replace(zone, points_m=tuple(map(points_of, blocks)))
    owns, all_errors = [], []
    for each, block in zip(readings, blocks, strict=True):
        errors_now = errors_of(zone, block)
        owns.append(own_places(zone, each, errors_now, block.point.weight))
        all_errors.append(errors_now)
        zone = replace(zone, scatter=zone.scatter.plus(owns[-1]))
    for number, (drive, at_s) in enumerate(
        zip(drives, ended_s or [0.0] * len(drives), strict=True)
    ):
        zone = watch(zone, drive, at_s, is_late=number > 0)
    return zone, blocks, owns, all_errors


def _with_losses(
    blocks: Sequence[DriveBlock], zone: Folded, loss: Float64[Array, "N 2"]
) -> list[DriveBlock]:
    """Share out among drives what all of them together say against each side."""
    said = loss - 0.5 * np.linalg.slogdet(zone.estimates.precision)[1]
    said -= said.min(axis=1, keepdims=True)
    heard = np.zeros(len(said))
    for block in blocks:
        heard[zone.sums.rows(block.anchor_ids)] += 1.0
    said /= heard[:, None]
    return [replace(block, loss=said[zone.sums.rows(block.anchor_ids)]) for block in blocks]


def _own(places: ZonePlaces) -> Float64[Array, "N 2 5"]:
    if places.own is None:
        raise ValueError("places without the cones' own unknowns")
    return places.own
