"""Long drives and many anchors: pieces that the network processes one by one, put together again.

A drive is cut into sections that overlap by half; an anchor's place comes from the section in which
it has most ranges. More anchors than the network takes at once are split by when they are ranged.

Whether anchors stand left or right of the path is one question for a whole work zone
(:class:`~gaia_uwb.denoised.ZonePosterior`), and so for all sections of a drive, unless two of
them are sure of opposite answers: then they are different zones, and each keeps its own answer.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gaia_uwb._shared import Array, Bool, Float64, Int64
from gaia_uwb.denoised import DenoisedRanges, ZonePosterior
from gaia_uwb.episode import Episode
from gaia_uwb.models import ZONE_FARTHEST_M, ZONE_LONGEST_STEPS, ZONE_MOST_ANCHORS

_SURE = 2.0  # log odds of a side from which on a section may contradict another


@dataclass(frozen=True)
class Piece:
    """What the network processes at a time.

    Parameters
    ----------
    steps
        Of the episode.
    heard : (K,)
        The anchors that have a range there.
    own : (K,)
        Which of these it locates.
    """

    steps: slice
    heard: Int64[Array, "K"]
    own: Bool[Array, "K"]

    def later(self, steps: int) -> Piece:
        """Return the same piece of an episode that has so many more steps before it.

        Parameters
        ----------
        steps
            How many.
        """
        return replace(self, steps=slice(self.steps.start + steps, self.steps.stop + steps))

    def of(self, episode: Episode) -> Episode:
        """Return its part of an episode, without truth.

        Parameters
        ----------
        episode
            The whole one.
        """
        part = episode.window(self.steps.start, self.steps.stop)
        up_m = part.anchor_up_m
        return replace(
            part,
            anchor_ids=tuple(part.anchor_ids[n] for n in self.heard.tolist()),
            range_m=part.range_m[:, self.heard],
            valid=part.valid[:, self.heard],
            anchor_up_m=None if up_m is None else up_m[self.heard],
            truth=None,
        )


def sections(episode: Episode) -> list[slice]:
    """Return steps that overlap by half, within the network's reach in steps and in metres.

    Parameters
    ----------
    episode
        A long drive.
    """
    step_m = np.hypot(*np.diff(episode.position_m, axis=0).T)
    driven_m = np.concatenate([[0.0], np.cumsum(step_m)])

    def end(start: int) -> tuple[int, bool]:
        """Return where a section must stop, and whether the limit in metres decides that."""
        by_steps = min(start + ZONE_LONGEST_STEPS, episode.n_steps)
        for length_m in (2.0 * ZONE_FARTHEST_M, ZONE_FARTHEST_M):
            far = int(np.searchsorted(driven_m, driven_m[start] + length_m, side="right"))
            stop = min(max(far, start + 2), by_steps)
            off_m = episode.position_m[start:stop] - episode.position_m[start:stop].mean(axis=0)
            if np.hypot(off_m[:, 0], off_m[:, 1]).max() <= ZONE_FARTHEST_M:
                break  # else it was driven unevenly, and its middle is near one end
        return stop, far < by_steps

    start = 0
    stop, by_metres = end(start)
    found = [slice(start, stop)]
    while stop < episode.n_steps:
        halfway = start + (stop - start) // 2
        if by_metres:
            halfway_m = 0.5 * (driven_m[start] + driven_m[stop - 1])
            halfway = int(np.searchsorted(driven_m, halfway_m))
        start = min(max(halfway, start + 1), stop - 1)
        if end(start)[0] <= stop:  # a gap in the path: nothing overlaps across it
            start = stop - 1
        stop, by_metres = end(start)
        found.append(slice(start, stop))
    return found


def pieces_of(episode: Episode) -> list[Piece]:
    """Return the pieces of an episode, in the order of its steps.

    Parameters
    ----------
    episode
        One that is too long, or has too many anchors, to be processed as a whole.
    """
    parts = sections(episode)
    n_ranges = np.array([episode.valid[part].sum(axis=0) for part in parts])  # (S, N)
    step = np.arange(episode.n_steps)
    when = step @ episode.valid / np.maximum(episode.valid.sum(axis=0), 1)
    off = np.array([np.abs(when - 0.5 * (part.start + part.stop)) for part in parts])
    main = (n_ranges - off / (2.0 * episode.n_steps + 1.0)).argmax(axis=0)
    found = []
    for s, part in enumerate(parts):
        heard = np.flatnonzero(n_ranges[s])
        heard = heard[np.argsort(when[heard], kind="stable")]
        count = math.ceil(len(heard) / ZONE_MOST_ANCHORS)
        for group in np.array_split(heard, count) if count else ():
            columns = np.sort(group)
            found.append(Piece(part, columns, np.asarray(main[columns] == s)))
    return found


def put_together(
    episode: Episode, pieces: Sequence[Piece], found: Sequence[DenoisedRanges]
) -> DenoisedRanges:
    """Return what the network said of all pieces as one result, each fading into the next.

    Parameters
    ----------
    episode
        The whole one.
    pieces
        Of it.
    found
        What the network said of each.
    """
    range_m, sigma_m, weight = (np.zeros(episode.valid.shape) for _ in range(3))
    for piece, part in zip(pieces, found, strict=True):
        rows = np.ix_(np.arange(piece.steps.start, piece.steps.stop), piece.heard)
        length = piece.steps.stop - piece.steps.start
        fade = np.minimum(np.arange(1, length + 1), np.arange(length, 0, -1))[:, None]
        share = np.where(part.valid, fade, 0.0)
        range_m[rows] += share * np.nan_to_num(part.range_m)
        sigma_m[rows] += share * np.nan_to_num(part.sigma_m)
        weight[rows] += share
    with np.errstate(invalid="ignore"):  # 0 / 0 is NaN, which stands for no range
        for values in (range_m, sigma_m):
            np.divide(values, weight, out=values)
            values.flags.writeable = False  # so that it is taken without a copy
    return DenoisedRanges(
        range_m=range_m,
        sigma_m=sigma_m,
        valid=episode.valid,
        zone=_one_zone(episode, pieces, found),
    )


def _turned(zone: ZonePosterior, seen_m: Float64[Array, "K 2 2"]) -> ZonePosterior:
    """Return what was said of a section with left and right as in the sections before.

    A vehicle that turns back has on its left what was on its right: the anchors that it hears again
    tell, by their two places.
    """
    again = zone.located & np.isfinite(seen_m).all(axis=(1, 2))
    if not again.any():
        return zone
    as_is = np.linalg.norm(zone.place_m[again] - seen_m[again], axis=2).sum()
    swapped = np.linalg.norm(zone.place_m[again, ::-1] - seen_m[again], axis=2).sum()
    if as_is <= swapped:
        return zone
    return replace(
        zone,
        place_m=zone.place_m[:, ::-1],
        covariance_m2=zone.covariance_m2[:, ::-1],
        scene_probability=zone.scene_probability[::-1],
        left_probability=1.0 - zone.left_probability[::-1],
    )


def _one_zone(
    episode: Episode, pieces: Sequence[Piece], found: Sequence[DenoisedRanges]
) -> ZonePosterior:
    n = episode.n_anchors
    place_m, covariance_m2 = np.zeros((n, 2, 2)), np.tile(np.eye(2), (n, 2, 1, 1))
    left, located = np.full((2, n), 0.5), np.zeros(n, dtype=np.bool_)
    own_left, log_odds, evidence = np.full(n, 0.5), [], 0.0
    seen_m = np.full((n, 2, 2), np.nan)
    for piece, part in zip(pieces, found, strict=True):
        if part.zone is None:
            continue
        zone = _turned(part.zone, seen_m[piece.heard])
        seen_m[piece.heard[zone.located]] = zone.place_m[zone.located]
        columns = piece.heard[piece.own]
        if not len(columns):
            continue
        place_m[columns] = zone.place_m[piece.own]
        covariance_m2[columns] = zone.covariance_m2[piece.own]
        located[columns] = zone.located[piece.own]
        left[:, columns] = zone.left_probability[:, piece.own]
        own_left[columns] = zone.scene_probability @ left[:, columns]
        # A range is in two sections; as evidence it counts in that of its anchor.
        share = part.valid[:, piece.own].sum() / part.valid.sum()
        probability = np.clip(zone.scene_probability, 1e-12, 1.0)
        log_odds.append(float(np.log(probability[0] / probability[1])))
        evidence += share * log_odds[-1]
    one_zone = not log_odds or min(log_odds) > -_SURE or max(log_odds) < _SURE
    scene = 1.0 / (1.0 + np.exp(-np.clip(evidence, -50.0, 50.0))) if one_zone else 0.5
    return ZonePosterior(
        place_m=place_m,
        covariance_m2=covariance_m2,
        scene_probability=np.array([scene, 1.0 - scene]),
        left_probability=left if one_zone else np.stack([own_left, own_left]),
        located=located,
    )
