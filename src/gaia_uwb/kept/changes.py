"""What changes in a kept zone: cones that are new, moved, silent or gone.

**Moved.** Each drive is asked where it alone puts a cone. Too far from where the others put it, the
cone is suspected at once, and the drive's readings of it are set aside. The next drive decides: if
it agrees with the first, the cone has moved: the stay at the old place ends, and the new one counts
from this drive on. If it agrees with the others, the suspicion is dropped. A drive that suspects
most cones, or agrees on them only with a clock, biases and patterns that its radios cannot have, is
itself suspected: it is left out.

**Silent.** How often radios are heard at which distance is told by the cones that the same drive
heard: readings per second in rings of 5 m. A cone that was in reach and never heard has an expected
number of readings; stretches of a second count as one, and a single drive for no more than it can
know (a lorry may stand in the way all along). A flat battery looks exactly like a cone that was
taken away: only somebody who looks can tell.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from gaia_uwb._shared import Array, Float64
from gaia_uwb.config import ChangesConfig
from gaia_uwb.episode import Episode
from gaia_uwb.kept.scatter import OwnPlaces

_RING_M, _REACH_M = 5.0, 120.0
_ALIKE = 10.0  # readings that are lost together
_MOST = 5.0  # log likelihood ratio that one drive can give
_FEWEST = 10.0  # expected readings, below which a drive says nothing
_MOST_SUSPECTS = 0.5  # share of a drive's cones; beyond it the drive is suspected
_FEW = 3  # cones, below which a drive cannot be suspected


class ConeState(StrEnum):
    """What is known of a cone in a kept zone; the value is what people see."""

    PRESENT = "present"
    NEW = "new"
    MAYBE_MOVED = "maybe-moved"
    SILENT = "silent"
    GONE = "gone"


@dataclass(frozen=True)
class Stay:
    """A time that a cone stood in one place.

    Parameters
    ----------
    place_m : (2,)
        East and north; of a stay that has ended, as it was known then.
    from_s, to_s
        When it was first and last heard there, in seconds since 1970 where logs have dates.
    """

    place_m: Float64[Array, "2"]
    from_s: float
    to_s: float


@dataclass(frozen=True)
class Suspicion:
    """A drive that puts a cone elsewhere.

    Parameters
    ----------
    name
        Of the drive.
    at_s
        When it ended.
    place_m, covariance_m2 : (2,), (2, 2)
        Where it puts the cone.
    distance_m
        From the cone's place.
    """

    name: str
    at_s: float
    place_m: Float64[Array, "2"]
    covariance_m2: Float64[Array, "2 2"]
    distance_m: float


@dataclass(frozen=True)
class Watched:
    """What is known of one cone's changes.

    Parameters
    ----------
    from_s, heard_s
        When the cone was first and last heard where it stands now.
    n_drives
        How many drives heard it there.
    is_late
        Whether the zone was known before the cone.
    before
        Its earlier stays.
    suspicion
        A drive that puts it elsewhere, as long as no other has decided.
    silence
        Log likelihood ratio of the drives that should have heard it since it was heard.
    silent_from_s
        When the first of them ended.
    """

    from_s: float
    heard_s: float
    n_drives: int = 1
    is_late: bool = False
    before: tuple[Stay, ...] = ()
    suspicion: Suspicion | None = None
    silence: float = 0.0
    silent_from_s: float = np.inf

    def state(self, now_s: float, config: ChangesConfig) -> ConeState:
        """Return what is known of the cone.

        Parameters
        ----------
        now_s
            When the last drive ended.
        config
            All settings.
        """
        if self.silence >= np.log(config.silent_odds):
            gone = now_s - self.silent_from_s > config.gone_after_s
            return ConeState.GONE if gone else ConeState.SILENT
        if self.suspicion is not None:
            return ConeState.MAYBE_MOVED
        return ConeState.NEW if self.is_late and self.n_drives == 1 else ConeState.PRESENT

    def heard(self, at_s: float) -> Watched:
        """Return it after a drive that heard the cone in its place."""
        return replace(
            self,
            heard_s=at_s,
            n_drives=self.n_drives + 1,
            suspicion=None,
            silence=0.0,
            silent_from_s=np.inf,
        )

    def unheard(self, at_s: float, ratio: float) -> Watched:
        """Return it after a drive that should have heard the cone."""
        if ratio <= 0.0:
            return self
        since_s = min(self.silent_from_s, at_s)
        return replace(self, silence=self.silence + ratio, silent_from_s=since_s)

    def suspected(self, suspicion: Suspicion) -> Watched:
        """Return it after a drive that puts the cone elsewhere."""
        return replace(self, suspicion=suspicion, silence=0.0, silent_from_s=np.inf)

    def moved(self, old_m: Float64[Array, "2"], first: Suspicion, at_s: float) -> Watched:
        """Return it after a second drive that puts the cone where the first did."""
        ended = Stay(old_m, self.from_s, self.heard_s)
        return Watched(first.at_s, at_s, n_drives=2, before=(*self.before, ended))


def far_apart(
    one_m: Float64[Array, "2"],
    other_m: Float64[Array, "2"],
    covariance_m2: Float64[Array, "2 2"],
    config: ChangesConfig,
) -> bool:
    """Tell whether two places cannot be one.

    Parameters
    ----------
    one_m, other_m : (2,)
        The places.
    covariance_m2 : (2, 2)
        Of their difference.
    config
        ``moved_m`` and ``moved_sigma``.
    """
    off_m = one_m - other_m
    if not np.isfinite(off_m).all() or np.hypot(*off_m) <= config.moved_m:
        return False
    return _beyond_chance(off_m, covariance_m2, config)


def _beyond_chance(
    off: Float64[Array, "u"], covariance: Float64[Array, "u u"], config: ChangesConfig
) -> bool:
    """Tell whether numbers are farther from 0 than their errors explain."""
    part = 2.0 / (9.0 * len(off))  # Wilson and Hilferty: chi-squared's quantile
    limit = len(off) * (1.0 - part + config.moved_sigma * part**0.5) ** 3
    return bool(off @ np.linalg.solve(covariance, off) > limit)


def suspects(
    own: OwnPlaces,
    side: Sequence[int],
    place_m: Float64[Array, "n 2"],
    covariance_m2: Float64[Array, "n 2 2"],
    config: ChangesConfig,
) -> list[int]:
    """Return which cones a drive puts elsewhere than all drives before it.

    Parameters
    ----------
    own
        Where it alone puts them.
    side
        On which side each stands.
    place_m, covariance_m2 : (n, 2), (n, 2, 2)
        Where they stand by the drives before; NaN for cones that these do not know.
    config
        All settings.
    """
    found = []
    for n, s in enumerate(side):
        spread_m2 = own.covariance_m2[n, s] + covariance_m2[n]
        known = np.isfinite(spread_m2).all()
        if known and far_apart(own.place_m[n, s], place_m[n], spread_m2, config):
            found.append(n)
    return found


def is_lying(
    n_suspects: int,
    n_known: int,
    off: Float64[Array, "S"],
    covariance: Float64[Array, "S S"],
    config: ChangesConfig,
) -> bool:
    """Tell whether a drive contradicts the zone, and not some cones.

    It does if it puts most cones elsewhere, or agrees on them only with errors of its radios that
    nobody expects of them.

    Parameters
    ----------
    n_suspects, n_known
        How many cones it puts elsewhere, and how many it knows in common with the zone.
    off : (S,)
        How far what its cones share is from what was expected.
    covariance : (S, S)
        What was expected of that.
    config
        All settings.
    """
    most = n_known >= _FEW and n_suspects > _MOST_SUSPECTS * n_known
    return most or _beyond_chance(off, covariance, config)


def silence(
    episodes: Sequence[Episode], places_m: dict[str, Float64[Array, "2"]]
) -> dict[str, float]:
    """Return how much more likely it is of each cone that was not heard that it is silent.

    Parameters
    ----------
    episodes
        Of one drive.
    places_m
        Where the cones of the zone stand.

    Returns
    -------
    dict of str to float
        Log likelihood ratios, above 0, of the cones that the drive did not hear.
    """
    rings = np.arange(0.0, _REACH_M + _RING_M, _RING_M)
    hits, time_s = np.zeros(len(rings) - 1), np.zeros(len(rings) - 1)
    alone_s: dict[str, Float64[Array, "rings"]] = {}
    heard = {name for each in episodes for name in _heard(each)}
    for episode in episodes:
        step_s = float(np.median(np.diff(episode.t_s)))
        for name, place_m in places_m.items():
            far_m = np.hypot(*(episode.position_m - place_m).T)
            there_s = step_s * np.histogram(far_m, rings)[0]
            if name in heard:
                time_s += there_s
                hits += _hits(episode, name, far_m, rings)
            else:
                alone_s[name] = alone_s.get(name, 0.0) + there_s
    rate = hits / np.maximum(time_s, 1e-9)
    rate[time_s <= 0.0] = 0.0
    expected = {name: float(rate @ there_s) for name, there_s in alone_s.items()}
    return {
        name: min(number / _ALIKE, _MOST) for name, number in expected.items() if number > _FEWEST
    }


def _heard(episode: Episode) -> list[str]:
    count = np.count_nonzero(episode.valid, axis=0)
    return [name for name, n in zip(episode.anchor_ids, count, strict=True) if n]


def _hits(
    episode: Episode,
    name: str,
    far_m: Float64[Array, "T"],
    rings: Float64[Array, "r"],
) -> Float64[Array, "q"]:
    """Return how many readings of a cone a tag had at which distance."""
    if name not in episode.anchor_ids:
        return np.zeros(len(rings) - 1)
    n = episode.anchor_ids.index(name)
    there = episode.valid[:, n]
    share = episode.n_readings[n] / max(int(there.sum()), 1)
    return np.asarray(share * np.histogram(far_m[there], rings)[0], dtype=np.float64)
