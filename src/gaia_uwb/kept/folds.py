"""Fold drives into the sums of a zone, one after another in the order of time.

The first :data:`FULL` drives are kept whole: their zone is fitted as any zone is. With the next
one, their blocks are formed at that fit, and from then on each drive costs one fit of its own,
however many came before. See ``gaia_uwb.locate.folding`` for what a block is, and what of it is
exact.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gaia_uwb.config import ChangesConfig, PipelineConfig
from gaia_uwb.episode import Episode
from gaia_uwb.kept.again import reweighed, worked_on_again
from gaia_uwb.kept.changes import is_lying
from gaia_uwb.kept.judging import (
    errors_at,
    judged,
    own_places,
    set_aside,
    still_suspected,
    suspected_cones,
    watch,
    without_cones,
)
from gaia_uwb.kept.known import known_before, unlikely_sides
from gaia_uwb.kept.state import (
    Folded,
    OneFold,
    Past,
    common_of,
    errors_of,
    least_noise_m,
    point_now,
    points_of,
    readings_of_drive,
)
from gaia_uwb.locate import vehicle_of


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
    least_m = max(zone.least_noise_m, least_noise_m(episodes))
    new = [each for each in episodes if vehicle_of(each) not in zone.sums.vehicles]
    if new:
        sums = zone.sums.extended((), [vehicle_of(each) for each in new])
        zone = replace(zone, sums=sums, common=common_of([*vehicles, *new], config))
    readings = readings_of_drive(episodes, vehicles[0], config)
    known = known_before(replace(zone, sums=zone.sums.aged(drift_m2)), readings)
    point, loss = readings.fit(known)
    own = own_places(zone, readings, errors_at(point, len(episodes)), point.weight)
    apart = suspected_cones(zone, readings, known, point, own, changes)
    off = point.shared - known.shared_mean
    n_known = int(known.is_known.sum())
    if is_lying(len(apart), n_known, off, known.shared_covariance, changes):
        return None
    zone, moved = judged(zone, readings, own, apart, ended_s, past, changes)
    if moved:  # these are new where they stand now
        known = known_before(replace(zone, sums=zone.sums.aged(drift_m2)), readings)
        point, loss = readings.fit(known)
    aside = [name for name in apart if name not in moved]
    point = set_aside(point, readings, aside)
    point = replace(point, own=np.where(unlikely_sides(zone, readings), known.mean, point.own))
    block = replace(readings.block(point, known.given_shared, loss), drift_m2=drift_m2)
    zone = reweighed(replace(zone, start=point.sizes, least_noise_m=least_m), readings, point, past)
    for _ in range(2):
        then = replace(zone, sums=zone.sums.plus(block))
        there = point_now(then, block)
        block = replace(readings.block(there, known.given_shared, loss), drift_m2=drift_m2)
    points_m = (*zone.points_m, points_of(block))
    after = replace(zone, sums=zone.sums.plus(block), points_m=points_m)
    after, refolded = worked_on_again(after, block, past, vehicles[0], config)
    block = refolded.pop(past.n_drives, block)
    own = without_cones(own, aside)
    after = watch(replace(after, scatter=after.scatter.plus(own)), episodes, ended_s)
    after = still_suspected(after, zone, aside)
    return OneFold(after, block, own, errors_of(after, block), refolded)
