"""Find the readings of an anchor that contradict most of its others, wherever the anchor stands.

A few such readings are spikes. Where they are the most, the readings are not those of one anchor
and one tag: two radios answer with one id, two tags share a log, or the clocks or units are wrong.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from gaia_uwb._shared import Array, Bool, Float64, Int64, metres, percent
from gaia_uwb.alignment.readings import fit_anchors, gather_readings
from gaia_uwb.estimate import Reason, ReasonKind
from gaia_uwb.scene import Scene, Trajectory

SPIKE_M = 1.0
"""A reading further than this from what most of the readings around it predict is a spike."""

_PAIRS, _FEWEST_PAIRS = 7, 3  # of readings before, about and after a reading
_NEAR_M, _STANDS_M = 0.5, 0.1
_BLOCK = 1 << 14  # readings that are looked at together stay in the processor's cache
_MOST_LOOKED_AT, _MOST_FITTED = 2_000, 40_000  # more would not change a share
_FEWEST_READINGS = 8
_HALF_BEYOND_M = 2.5  # however hard the surroundings, half of a radio's ranges err by less
_NAMED = 5


def contradicted_anchors(
    scene: Scene, offset_s: float = 0.0, *, max_gap_s: float = 1.0
) -> Iterator[Reason]:
    """Yield one reason if the readings of an anchor do not come from one place.

    Parameters
    ----------
    scene
        The log; its truth is not used.
    offset_s
        A reading stamped t belongs to the trajectory at ``t - offset_s``.
    max_gap_s
        Longest gap of the trajectory that is interpolated, in seconds.
    """
    found: dict[str, tuple[float, float]] = {}
    own = rows_of_anchors(scene)
    every = len(scene.ranges) // _MOST_FITTED + 1
    for block in gather_readings(scene, every=every):
        positive_m = np.where(block.range_m > 0.0, block.range_m, np.nan)
        readings = replace(block, range_m=positive_m)
        residual_m = np.abs(fit_anchors(scene, readings, offset_s, max_gap_s).residual_m)
        for row, n in enumerate(readings.anchors):
            off_m = residual_m[row, np.isfinite(residual_m[row])]
            if len(off_m) >= _FEWEST_READINGS:
                half_m = float(np.median(off_m))
                share = _contradicted_share(scene, own[n], offset_s)
                found[scene.anchor_ids[n]] = share, half_m
    bad = {who: each for who, each in found.items() if each[0] > 0.5 or each[1] > _HALF_BEYOND_M}
    if bad:
        share, half_m = (max(column) for column in zip(*bad.values(), strict=True))
        more = f" and {len(bad) - _NAMED} more" if len(bad) > _NAMED else ""
        up_to = "up to " if len(bad) > 1 else ""
        signs = []
        if share > 0.5:
            signs.append(f"{up_to}{percent(share)} of them contradict those around them")
        if half_m > _HALF_BEYOND_M:
            signs.append(f"half are off by {up_to}{metres(half_m)} or more")
        text = (
            f"{', '.join(list(bad)[:_NAMED])}{more}: the readings do not come from one place: "
            f"{' and '.join(signs)}; so it looks where two radios have one id, two tags share a "
            "log, or a unit or a clock is wrong"
        )
        numbers = {"share": share, "half_beyond_m": half_m}
        yield Reason(ReasonKind.LOG, text, cones=tuple(bad), numbers=numbers)


def rows_of_anchors(scene: Scene) -> list[Int64[Array, "K"]]:
    """Return which rows of a scene's ranges are each anchor's."""
    order = np.argsort(scene.ranges.anchor, kind="stable")
    ends = np.cumsum(np.bincount(scene.ranges.anchor, minlength=scene.n_anchors))
    return np.split(order, ends[:-1])


def _contradicted_share(scene: Scene, own: Int64[Array, "K"], offset_s: float) -> float:
    """Return the share of an anchor's readings, given by row, that contradict those around them."""
    drive, t_s = scene.trajectory, scene.ranges.t_s[own] - offset_s
    inside = np.flatnonzero((t_s >= drive.t_s[0]) & (t_s <= drive.t_s[-1]))
    every = len(own) // _MOST_LOOKED_AT + 1
    looked_at = inside[:: every | 1]  # odd, so that of two sources in turn both are seen
    found = contradicting(t_s, scene.ranges.range_m[own], drive, looked_at)
    return float(found.mean()) if found.size else 0.0


def contradicting(
    t_s: Float64[Array, "R"],
    range_m: Float64[Array, "R"],
    drive: Trajectory,
    looked_at: Int64[Array, "K"] | None = None,
) -> Bool[Array, "K"]:
    """Return which readings of one anchor contradict most pairs of its other readings near them.

    Along a chord of the path the square of the distance to any place is that at its ends, between
    them in proportion, less w (1 - w) times the chord's square: so two readings predict a third
    without knowing where the anchor stands. What predicts badly (readings near an anchor that is
    passed fast, beyond a pair, or away from its chord) is asked less.

    Parameters
    ----------
    t_s, range_m : (R,)
        Time and range of the anchor's readings, in the order of time.
    drive
        The path of the tag's antenna.
    looked_at : (K,), optional
        Which readings to judge, in increasing order; all by default.

    Examples
    --------
    >>> t_s = np.arange(0.0, 4.0, 0.1)
    >>> drive = Trajectory(t_s, np.column_stack([2.0 * t_s, 0.0 * t_s]))
    >>> range_m = np.hypot(2.0 * t_s - 4.0, 5.0)
    >>> range_m[20] += 3.0
    >>> np.flatnonzero(contradicting(t_s, range_m, drive))
    array([20])
    """
    path_m = [np.interp(t_s, drive.t_s, axis) for axis in drive.position_m.T]
    log = _Readings(t_s, np.where(range_m < 0.0, np.nan, range_m), *path_m)
    chosen = np.arange(len(range_m)) if looked_at is None else looked_at
    found = [_judge(chosen[k : k + _BLOCK], log) for k in range(0, len(chosen), _BLOCK)]
    return np.concatenate(found) if found else np.zeros(0, dtype=np.bool_)


class _Readings(NamedTuple):
    """Readings of one anchor, and where the vehicle was; one array each, so that all is quick."""

    t_s: Float64[Array, "R"]
    range_m: Float64[Array, "R"]
    east_m: Float64[Array, "R"]
    north_m: Float64[Array, "R"]

    def at(self, index: Int64[Array, "K"]) -> _Readings:
        return _Readings(*(column[index] for column in self))


def _judge(chosen: Int64[Array, "K"], log: _Readings) -> Bool[Array, "K"]:
    n = len(log.t_s)
    votes, pairs = np.zeros((2, len(chosen)), dtype=np.int64)
    for reach in range(1, _PAIRS + 1):
        # Before and after the reading, both before it, both after it.
        for first, second in ((-reach, reach), (-2 * reach, -reach), (reach, 2 * reach)):
            has = (chosen >= max(0, -first)) & (chosen < n - max(0, second))
            own = chosen[has]
            off_m, error = _misfit(log.at(own), log.at(own + first), log.at(own + second))
            votes[has] += off_m > SPIKE_M * np.maximum(error, 1.0)
            pairs[has] += np.isfinite(off_m)
    return np.asarray((votes > 0.5 * pairs) & (pairs >= _FEWEST_PAIRS))


def _misfit(
    own: _Readings, first: _Readings, second: _Readings
) -> tuple[Float64[Array, "K"], Float64[Array, "K"]]:
    """Return how far readings are from what two others predict, and how much worse that errs."""
    chord_east_m, chord_north_m = second.east_m - first.east_m, second.north_m - first.north_m
    along_east_m, along_north_m = own.east_m - first.east_m, own.north_m - first.north_m
    chord2_m2 = chord_east_m**2 + chord_north_m**2
    least2_m2 = _STANDS_M**2
    by_time = (own.t_s - first.t_s) / np.maximum(second.t_s - first.t_s, 1e-9)
    by_path = along_east_m * chord_east_m + along_north_m * chord_north_m
    by_path /= np.maximum(chord2_m2, least2_m2)
    w = np.where(chord2_m2 > least2_m2, by_path, np.clip(by_time, -1.0, 2.0))
    aside_m = np.hypot(along_east_m - w * chord_east_m, along_north_m - w * chord_north_m)
    ends_m2 = (1.0 - w) * first.range_m**2 + w * second.range_m**2
    predicted_m = np.sqrt(np.maximum(ends_m2 - w * (1.0 - w) * chord2_m2, 0.0))
    error = np.hypot((1.0 - w) * first.range_m, w * second.range_m)
    error /= np.maximum(np.fmin(predicted_m, own.range_m), _NEAR_M)
    return np.abs(own.range_m - predicted_m) - aside_m, error
