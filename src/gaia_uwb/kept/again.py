"""Work on the past of a zone again: where sides, places or stays of cones have changed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gaia_uwb._shared import Array, Float64
from gaia_uwb.config import PipelineConfig
from gaia_uwb.episode import Episode
from gaia_uwb.kept.known import without_drive
from gaia_uwb.kept.state import Folded, Past, best_places, point_now, points_of, readings_of_drive
from gaia_uwb.kept.sums import ZoneSums
from gaia_uwb.locate import DriveBlock, DriveReadings, Point

_REWEIGHED = 0.02  # change of a side's probability by which sums are formed anew
_MOVED_SIGMA, _MOVED_M = 0.3, 0.05  # from where its block was taken: it is taken anew
_MOST_ROUNDS = 3  # in which this is done


def reweighed(zone: Folded, readings: DriveReadings, point: Point, past: Past) -> Folded:
    """Form sums anew where a new drive makes other sides likely."""
    ids = zone.sums.anchor_ids
    weight = dict(zip(ids, zone.sums.weight, strict=True))
    new = dict(zip(readings.anchor_ids, point.weight, strict=True))
    there = np.asarray(np.isfinite(point.own).all(axis=(1, 2)))
    here = {name for name, located in zip(readings.anchor_ids, there, strict=True) if located}
    weight |= {name: each for name, each in new.items() if name in weight and name in here}
    off = [
        np.abs(weight[name] - own).max() for name, own in zip(ids, zone.sums.weight, strict=True)
    ]
    if max(off) <= _REWEIGHED:
        return zone
    blocks = [past.block(number) for number in range(past.n_drives)]
    reference_m = dict(zip(ids, zone.sums.reference_m, strict=True))
    counts = replace(zone.counts, resummed=zone.counts.resummed + 1)
    sums = ZoneSums.of(blocks, weight, reference_m, zone.since)
    return replace(zone, sums=sums, counts=counts)


def worked_on_again(
    zone: Folded,
    newest: DriveBlock,
    past: Past,
    first: Episode,
    config: PipelineConfig,
) -> tuple[Folded, dict[int, DriveBlock]]:
    """Form sums anew where sides have changed, and blocks where places have moved from them."""
    changed: dict[int, DriveBlock] = {}

    def block_of(number: int) -> DriveBlock:
        if number in changed:
            return changed[number]
        return newest if number == past.n_drives else past.block(number)

    for _ in range(_MOST_ROUNDS):
        moved = _moved(zone)
        weights = zone.estimates.weight
        reweighed = np.abs(weights - zone.sums.weight).max() > _REWEIGHED
        if not moved and not reweighed:
            break
        counts = zone.counts
        for number in moved:
            if number == past.n_drives:
                continue
            block = block_of(number)
            readings = readings_of_drive(past.episodes(number), first, config)
            there = point_now(zone, block)
            changed[number] = replace(
                readings.block(there, without_drive(zone, block), block.loss),
                drift_m2=block.drift_m2,
            )
            counts = replace(counts, refolded=counts.refolded + 1)
        blocks = [block_of(number) for number in range(past.n_drives + 1)]
        counts = replace(counts, resummed=counts.resummed + 1)
        zone = replace(
            zone,
            sums=summed(blocks, zone),
            start=zone.estimates.sizes,
            points_m=tuple(_points_since(zone, n, block) for n, block in enumerate(blocks)),
            counts=counts,
        )
    return zone, changed


def _moved(zone: Folded) -> list[int]:
    """Return the drives whose blocks were taken too far from where the cones stand now."""
    place = dict(zip(zone.sums.anchor_ids, best_places(zone.estimates), strict=True))
    sigma_m = np.sqrt(np.linalg.eigvalsh(zone.estimates.places_m2)[..., 1])
    side = zone.estimates.loss.argmin(axis=1)
    sigma = dict(zip(zone.sums.anchor_ids, sigma_m[np.arange(len(side)), side], strict=True))
    moved = []
    for number, points_m in enumerate(zone.points_m):
        for name, there_m in points_m.items():
            off_m = float(np.hypot(*(place[name] - there_m)))
            if off_m > max(_MOVED_M, _MOVED_SIGMA * sigma[name]):
                moved.append(number)
                break
    return moved


def _points_since(zone: Folded, number: int, block: DriveBlock) -> dict[str, Float64[Array, "2"]]:
    found = points_of(block)
    return {name: each for name, each in found.items() if number >= zone.since.get(name, 0)}


def summed(blocks: Sequence[DriveBlock], zone: Folded) -> ZoneSums:
    """Add up blocks with the weights that the sides have by now."""
    ids = zone.sums.anchor_ids
    weight = dict(zip(ids, zone.estimates.weight, strict=True))
    reference_m = dict(zip(ids, zone.sums.reference_m, strict=True))
    return ZoneSums.of(blocks, weight, reference_m, zone.since)


def forgotten(zone: Folded, moved: Sequence[str], past: Past) -> Folded:
    """Return a zone whose earlier drives say nothing of some cones."""
    ids = zone.sums.anchor_ids
    keep = {name: n for n, name in enumerate(ids) if name not in moved}
    weight = {name: zone.sums.weight[n] for name, n in keep.items()}
    reference_m = {name: zone.sums.reference_m[n] for name, n in keep.items()}
    blocks = [past.block(number) for number in range(past.n_drives)]
    points_m = tuple(
        {name: place_m for name, place_m in each.items() if name in keep} for each in zone.points_m
    )
    return replace(
        zone,
        sums=ZoneSums.of(blocks, weight, reference_m, zone.since),
        points_m=points_m,
        scatter=zone.scatter.without(moved),
        counts=replace(zone.counts, resummed=zone.counts.resummed + 1),
    )
