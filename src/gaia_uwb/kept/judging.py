"""Whether a drive agrees with the zone, and what it says of changes (see ``changes.py``)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gaia_uwb._shared import Array, Float64
from gaia_uwb.config import ChangesConfig
from gaia_uwb.episode import DriveErrors, Episode
from gaia_uwb.kept.again import forgotten
from gaia_uwb.kept.changes import Suspicion, Watched, far_apart, silence, suspects
from gaia_uwb.kept.scatter import OwnPlaces
from gaia_uwb.kept.state import Folded, Past, best_places
from gaia_uwb.locate import DRIVE, RADIOS, DriveReadings, KnownBefore, Point, error_scale2

_SETTLED = 50.0  # of the losses of both sides: beyond it no drive will make the other likely


def errors_at(point: Point, n_tags: int) -> tuple[DriveErrors, ...]:
    """Return what a fit found of each tag of a drive, as if it were certain."""
    first = [np.arange(RADIOS, dtype=np.int64)]
    own = [RADIOS + DRIVE * k + np.arange(DRIVE) for k in range(n_tags)]
    size = RADIOS + DRIVE
    return tuple(
        DriveErrors(point.shared[np.concatenate([*first, tag])], np.eye(size), point.sizes)
        for tag in own
    )


def own_places(
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


def suspected_cones(
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


def judged(
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
    best = dict(zip(zone.sums.anchor_ids, best_places(zone.estimates), strict=True))
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
    return (forgotten(zone, moved, past), moved) if moved else (zone, moved)


def set_aside(point: Point, readings: DriveReadings, cones: Sequence[str]) -> Point:
    """Return estimates without those of some cones, whose readings then do not count."""
    aside = np.array([name in cones for name in readings.anchor_ids])
    return replace(point, own=np.where(aside[:, None, None], np.nan, point.own))


def without_cones(own: OwnPlaces, aside: Sequence[str]) -> OwnPlaces:
    """Return where a drive puts other cones."""
    away = np.array([name in aside for name in own.anchor_ids])
    return replace(own, place_m=np.where(away[:, None, None], np.nan, own.place_m))


def still_suspected(zone: Folded, before: Folded, aside: Sequence[str]) -> Folded:
    """Return a zone in which cones that a drive put elsewhere were not heard in their places."""
    watched = dict(zone.watched)
    watched |= {name: before.watched[name] for name in aside}
    return replace(zone, watched=watched)


def watch(
    zone: Folded, episodes: Sequence[Episode], at_s: float, *, is_late: bool = True
) -> Folded:
    """Note which cones a drive heard in their places, and which it should have heard."""
    places_m = dict(zip(zone.sums.anchor_ids, best_places(zone.estimates), strict=True))
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
