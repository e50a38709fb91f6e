"""Fold drives into the sums of a zone, one after another in the order of time.

The first :data:`FULL` drives are kept whole: their zone is fitted as any zone is. With the next
one, their blocks are formed at that fit, and from then on each drive costs one fit of its own,
however many came before. See ``gaia_uwb.locate.folding`` for what a block is, and what of it is
exact.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from gaia_uwb._shared import Array, Bool, Float64, Int64
from gaia_uwb.config import ChangesConfig, PipelineConfig
from gaia_uwb.episode import DriveErrors, Episode, ErrorSizes
from gaia_uwb.kept.changes import Suspicion, Watched, far_apart, is_lying, silence, suspects
from gaia_uwb.kept.estimates import CommonPrior, ZoneEstimates, estimate
from gaia_uwb.kept.scatter import OwnPlaces, ScatterSums
from gaia_uwb.kept.sums import ZoneSums, own_part
from gaia_uwb.locate import (
    ALIKE,
    DRIVE,
    OWN,
    RADIOS,
    DriveBlock,
    DriveReadings,
    KnownBefore,
    Point,
    ZonePlaces,
    drive_prior,
    error_scale2,
    find_places,
    lasting_prior,
    own_prior,
    vehicle_of,
)

FULL = 4
"""Drives that are kept whole, so that the result is that of fitting them together."""
_ROUNDS = 8  # of taking blocks anew when a zone's sums begin
_REWEIGHED = 0.02  # change of a side's probability by which sums are formed anew
_MOVED_SIGMA, _MOVED_M = 0.3, 0.05  # from where its block was taken: it is taken anew
_MOST_ROUNDS = 3  # in which this is done
_SETTLED = 50.0  # of the losses of both sides: beyond it no drive will make the other likely


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
        return dict(zip(self.sums.anchor_ids, _best(self.estimates), strict=True))


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
    common = _common(episodes, config)
    readings = [_readings(drive, drives[0][0], config) for drive in drives]
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
        _least(passes),
        (),
        ScatterSums.nothing(),
    )
    blocks = _with_losses(blocks, zone, np.stack([0.0 * odds, odds], axis=1))
    zone = replace(zone, sums=ZoneSums.of(blocks, {}, {}))
    for _ in range(_ROUNDS):
        blocks = [
            each.block(point_now(zone, block), _without(zone, block), block.loss)
            for each, block in zip(readings, blocks, strict=True)
        ]
        zone = replace(zone, sums=_summed(blocks, zone), start=zone.estimates.sizes)
    zone = replace(zone, points_m=tuple(map(_points, blocks)))
    owns, all_errors = [], []
    for each, block in zip(readings, blocks, strict=True):
        errors_now = _errors(zone, block)
        owns.append(_own_places(zone, each, errors_now, block.point.weight))
        all_errors.append(errors_now)
        zone = replace(zone, scatter=zone.scatter.plus(owns[-1]))
    for number, (drive, at_s) in enumerate(
        zip(drives, ended_s or [0.0] * len(drives), strict=True)
    ):
        zone = _watch(zone, drive, at_s, is_late=number > 0)
    return zone, blocks, owns, all_errors


def _watch(
    zone: Folded, episodes: Sequence[Episode], at_s: float, *, is_late: bool = True
) -> Folded:
    """Note which cones a drive heard in their places, and which it should have heard."""
    places_m = dict(zip(zone.sums.anchor_ids, _best(zone.estimates), strict=True))
    known = {name: place_m for name, place_m in places_m.items() if name in zone.watched}
    watched = dict(zone.watched)
    count: dict[str, int] = {}
    for episode in episodes:
        for name, n in zip(episode.anchor_ids, episode.valid.sum(axis=0).tolist(), strict=True):
            count[name] = count.get(name, 0) + n
    for name, n in count.items():
        if not n:
            continue
        if name not in watched:
            watched[name] = Watched(at_s, at_s, is_late=is_late)
        else:
            watched[name] = watched[name].heard(at_s)
    for name, ratio in silence(episodes, known).items():
        watched[name] = watched[name].unheard(at_s, ratio)
    return replace(zone, watched=watched, ended_s=at_s)


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


def fold(
    zone: Folded,
    episodes: Sequence[Episode],
    vehicles: Sequence[Episode],
    past: Past,
    config: PipelineConfig,
    ended_s: float | None = None,
    changes: ChangesConfig = ChangesConfig(),
) -> OneFold | None:
    """Fold one more drive in.

    Parameters
    ----------
    zone
        Before it.
    episodes
        Prepared, of each of its tags, in the zone's frame.
    vehicles
        One episode for each tag of each vehicle that was there before, in the order of the zone.
    past
        The drives before it: they are read where the past must be worked on again.
    config
        All settings.
    ended_s
        When it ended; by default with the drive before it.
    changes
        What counts as a change.

    Returns
    -------
    OneFold or None
        None if the drive contradicts the zone, so that it is left out.
    """
    ended_s = zone.ended_s if ended_s is None else ended_s
    days = max(ended_s - zone.ended_s, 0.0) / 86_400.0
    drift_m2 = changes.drift_m_per_day**2 * days
    least_m = max(zone.least_noise_m, _least(episodes))
    new = [each for each in episodes if vehicle_of(each) not in zone.sums.vehicles]
    if new:
        sums = zone.sums.extended((), [vehicle_of(each) for each in new])
        zone = replace(zone, sums=sums, common=_common([*vehicles, *new], config))
    readings = _readings(episodes, vehicles[0], config)
    known = known_before(replace(zone, sums=zone.sums.aged(drift_m2)), readings)
    point, loss = readings.fit(known)
    own = _own_places(zone, readings, _errors_at(point, len(episodes)), point.weight)
    apart = _suspects(zone, readings, known, point, own, changes)
    off = point.shared - known.shared_mean
    n_known = int(known.is_known.sum())
    if is_lying(len(apart), n_known, off, known.shared_covariance, changes):
        return None
    zone, moved = _judged(zone, readings, own, apart, ended_s, past, changes)
    if moved:  # these are new where they stand now
        known = known_before(replace(zone, sums=zone.sums.aged(drift_m2)), readings)
        point, loss = readings.fit(known)
    aside = [name for name in apart if name not in moved]
    point = _set_aside(point, readings, aside)
    point = replace(point, own=np.where(_unlikely(zone, readings), known.mean, point.own))
    block = replace(readings.block(point, known.given_shared, loss), drift_m2=drift_m2)
    zone = _reweighed(
        replace(zone, start=point.sizes, least_noise_m=least_m), readings, point, past
    )
    for _ in range(2):
        then = replace(zone, sums=zone.sums.plus(block))
        there = point_now(then, block)
        block = replace(readings.block(there, known.given_shared, loss), drift_m2=drift_m2)
    points_m = (*zone.points_m, _points(block))
    after = replace(zone, sums=zone.sums.plus(block), points_m=points_m)
    after, refolded = _worked_on_again(after, block, past, vehicles[0], config)
    block = refolded.pop(past.n_drives, block)
    own = _own_places_of(own, aside)
    after = _watch(replace(after, scatter=after.scatter.plus(own)), episodes, ended_s)
    after = _still_suspected(after, zone, aside)
    return OneFold(after, block, own, _errors(after, block), refolded)


def _errors_at(point: Point, n_tags: int) -> tuple[DriveErrors, ...]:
    """Return what a fit found of each tag of a drive, as if it were certain."""
    first = [np.arange(RADIOS, dtype=np.int64)]
    own = [RADIOS + DRIVE * k + np.arange(DRIVE) for k in range(n_tags)]
    size = RADIOS + DRIVE
    return tuple(
        DriveErrors(point.shared[np.concatenate([*first, tag])], np.eye(size), point.sizes)
        for tag in own
    )


def _suspects(
    zone: Folded,
    readings: DriveReadings,
    known: KnownBefore,
    point: Point,
    own: OwnPlaces,
    changes: ChangesConfig,
) -> list[str]:
    """Return the cones that a drive puts elsewhere than the drives before it."""
    best = zone.estimates.loss.argmin(axis=1)
    side = point.weight.argmax(axis=1)
    rows = np.arange(len(side))
    place_m = np.where(known.is_known[:, None], known.mean[rows, side, :2], np.nan)
    spread_m2 = np.linalg.inv(known.given_shared)[rows, side, :2, :2]
    scattered = [each for each in zone.scatter.of(zone.sums.anchor_ids, best) if each is not None]
    larger = error_scale2(scattered)
    wide = replace(own, covariance_m2=larger * own.covariance_m2)
    found = suspects(wide, side.tolist(), place_m, larger * spread_m2, changes)
    return [readings.anchor_ids[n] for n in found]


def _judged(
    zone: Folded,
    readings: DriveReadings,
    own: OwnPlaces,
    apart: Sequence[str],
    ended_s: float,
    past: Past,
    changes: ChangesConfig,
) -> tuple[Folded, list[str]]:
    """Say of suspected cones whether they have moved; those that have are forgotten in the sums."""
    index = {name: n for n, name in enumerate(readings.anchor_ids)}
    best = dict(zip(zone.sums.anchor_ids, _best(zone.estimates), strict=True))
    side = dict(zip(zone.sums.anchor_ids, zone.estimates.loss.argmin(axis=1), strict=True))
    watched, since, moved = dict(zone.watched), dict(zone.since), []
    for name in apart:
        n, s = index[name], int(side[name])
        place_m, spread_m2 = own.place_m[n, s], own.covariance_m2[n, s]
        distance_m = float(np.hypot(*(place_m - best[name])))
        found = Suspicion(readings.episodes[0].name, ended_s, place_m, spread_m2, distance_m)
        first = watched[name].suspicion
        agree = first is not None and not far_apart(
            place_m, first.place_m, spread_m2 + first.covariance_m2, changes
        )
        if first is not None and agree:
            watched[name] = watched[name].moved(best[name], first, ended_s)
            since[name] = past.n_drives
            moved.append(name)
        else:
            watched[name] = watched[name].suspected(found)
    zone = replace(zone, watched=watched, since=since)
    return (_forgotten(zone, moved, past), moved) if moved else (zone, moved)


def _forgotten(zone: Folded, moved: Sequence[str], past: Past) -> Folded:
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


def _set_aside(point: Point, readings: DriveReadings, cones: Sequence[str]) -> Point:
    """Return estimates without those of some cones, whose readings then do not count."""
    aside = np.array([name in cones for name in readings.anchor_ids])
    return replace(point, own=np.where(aside[:, None, None], np.nan, point.own))


def _own_places_of(own: OwnPlaces, aside: Sequence[str]) -> OwnPlaces:
    away = np.array([name in aside for name in own.anchor_ids])
    return replace(own, place_m=np.where(away[:, None, None], np.nan, own.place_m))


def _still_suspected(zone: Folded, before: Folded, aside: Sequence[str]) -> Folded:
    """Return a zone in which cones that a drive put elsewhere were not heard in their places."""
    watched = dict(zone.watched)
    watched |= {name: before.watched[name] for name in aside}
    return replace(zone, watched=watched)


def _reweighed(zone: Folded, readings: DriveReadings, point: Point, past: Past) -> Folded:
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


def _worked_on_again(
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
            readings = _readings(past.episodes(number), first, config)
            there = point_now(zone, block)
            changed[number] = replace(
                readings.block(there, _without(zone, block), block.loss),
                drift_m2=block.drift_m2,
            )
            counts = replace(counts, refolded=counts.refolded + 1)
        blocks = [block_of(number) for number in range(past.n_drives + 1)]
        counts = replace(counts, resummed=counts.resummed + 1)
        zone = replace(
            zone,
            sums=_summed(blocks, zone),
            start=zone.estimates.sizes,
            points_m=tuple(_points_since(zone, n, block) for n, block in enumerate(blocks)),
            counts=counts,
        )
    return zone, changed


def _moved(zone: Folded) -> list[int]:
    """Return the drives whose blocks were taken too far from where the cones stand now."""
    place = dict(zip(zone.sums.anchor_ids, _best(zone.estimates), strict=True))
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


def _best(estimates: ZoneEstimates) -> Float64[Array, "N 2"]:
    side = estimates.loss.argmin(axis=1)
    return np.asarray(estimates.own[np.arange(len(side)), side, :2])


def _points(block: DriveBlock) -> dict[str, Float64[Array, "2"]]:
    """Return where a block put the cones, on the side that was the likelier then."""
    side = block.point.weight.argmax(axis=1)
    there = block.point.own[np.arange(len(side)), side, :2]
    return {
        name: place_m
        for name, place_m in zip(block.anchor_ids, there, strict=True)
        if np.isfinite(place_m).all()
    }


def _points_since(zone: Folded, number: int, block: DriveBlock) -> dict[str, Float64[Array, "2"]]:
    found = _points(block)
    return {name: each for name, each in found.items() if number >= zone.since.get(name, 0)}


def _summed(blocks: Sequence[DriveBlock], zone: Folded) -> ZoneSums:
    """Add up blocks with the weights that the sides have by now."""
    ids = zone.sums.anchor_ids
    weight = dict(zip(ids, zone.estimates.weight, strict=True))
    reference_m = dict(zip(ids, zone.sums.reference_m, strict=True))
    return ZoneSums.of(blocks, weight, reference_m, zone.since)


def _least(episodes: Sequence[Episode]) -> float:
    return max(each.least_noise_m for each in episodes)


def _common(episodes: Sequence[Episode], config: PipelineConfig) -> CommonPrior:
    """Return what is known beforehand of the radios and of the tags of all vehicles."""
    of_tags = {vehicle_of(each): each for each in reversed(episodes)}
    names = dict.fromkeys(vehicle_of(each) for each in episodes)
    return CommonPrior(*lasting_prior([of_tags[name] for name in names], config))


def _readings(episodes: Sequence[Episode], first: Episode, config: PipelineConfig) -> DriveReadings:
    prior = drive_prior(episodes, first, config)
    return DriveReadings(episodes, prior, [vehicle_of(each) for each in episodes], config)


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


def _unlikely(zone: Folded, readings: DriveReadings) -> Bool[Array, "n 2 1"]:
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


def _without(zone: Folded, block: DriveBlock) -> Float64[Array, "n 2 5 5"]:
    """Return what is known of a drive's cones without that drive, whose block is in the zone."""
    return zone.estimates.precision[zone.sums.rows(block.anchor_ids)] - block.matrix


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


def _errors(zone: Folded, block: DriveBlock) -> tuple[DriveErrors, ...]:
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


def _own_places(
    zone: Folded,
    readings: DriveReadings,
    errors: Sequence[DriveErrors],
    weight: Float64[Array, "n 2"],
) -> OwnPlaces:
    """Return where a drive alone puts its cones, given the probabilities of their sides."""
    sums, estimates = zone.sums, zone.estimates
    index = {name: n for n, name in enumerate(sums.anchor_ids)}
    cone = np.array([index.get(name, -1) for name in readings.anchor_ids], dtype=np.int64)
    order = np.argsort(-weight, axis=1, kind="stable")
    near_m = estimates.own[cone[:, None], order, :2]
    known = (cone >= 0) & (sums.n_ranges[cone] > 0)
    near_m[~known] = np.nan
    place_m, covariance_m2 = readings.own_places(errors, near_m[:, 0])
    place_m, covariance_m2 = np.stack([place_m] * 2, 1), np.stack([covariance_m2] * 2, 1)
    # A side that is open may be the right one yet.
    if (np.ptp(estimates.loss[cone], axis=1) < _SETTLED)[known].any():
        place_m[:, 1], covariance_m2[:, 1] = readings.own_places(errors, near_m[:, 1])
    back = np.argsort(order, axis=1)
    rows = np.arange(len(cone))[:, None]
    return OwnPlaces(readings.anchor_ids, place_m[rows, back], covariance_m2[rows, back])
