"""Many convex hulls at once, and the same hulls cut by parallel lines.

On a line each hull is an interval, so how many hulls hold a point is a step function whose steps
are the intervals' ends: exact along the lines, without a grid.

>>> import numpy as np
>>> square = np.array([[0.0, 0.0], [2.0, 0.0], [1.0, 0.5], [2.0, 2.0], [0.0, 2.0]])
>>> low, high = chords(scene_hulls(square[None]), np.array([0.5]))
>>> low.tolist(), high.tolist()
([[0.0]], [[2.0]])
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gaia_uwb._shared import Array, Bool, Float64, Int64

_LINES = 16  # cutting lines at each end, at the corners between, and evenly spaced
_NEAR_ENDS = np.array([0.3, 0.6, 1.0, 1.5, 2.0, 3.0, 5.0])


def scene_hulls(scenes: Float64[Array, "S N 2"]) -> Float64[Array, "S K 2"]:
    """Return all scenes' convex hulls, counter-clockwise; shorter ones repeat their first corner.

    Jarvis's march from the westernmost point, for all scenes at once: the next corner is the one
    that needs the smallest turn.

    Parameters
    ----------
    scenes : (S, N, 2)
        N finite points in each of S scenes.
    """
    each = np.arange(len(scenes))
    first = np.argmin(scenes[..., 0], axis=1)
    corner, heading = first, np.full(len(scenes), -0.5 * np.pi)
    corners = [scenes[each, first]]
    done = np.zeros(len(scenes), dtype=np.bool_)
    for _ in range(scenes.shape[1] - 1):
        step = scenes - corners[-1][:, None]
        direction = np.arctan2(step[..., 1], step[..., 0])
        turn = (direction - heading[:, None]) % (2.0 * np.pi)
        turn[(step == 0.0).all(axis=2)] = np.inf
        corner = np.where(done, first, np.argmin(turn, axis=1))
        done |= corner == first
        if done.all():
            break
        corner = np.where(done, first, corner)
        heading = direction[each, corner]
        corners.append(scenes[each, corner])
    return np.stack(corners, axis=1)


def chords(
    hulls: Float64[Array, "S K 2"], line: Float64[Array, "R"]
) -> tuple[Float64[Array, "R S"], Float64[Array, "R S"]]:
    """Return where lines of one first coordinate enter and leave each hull; infinite if never.

    Parameters
    ----------
    hulls : (S, K, 2)
        From :func:`scene_hulls`.
    line : (R,)
        First coordinates of the lines.
    """
    low = np.full((len(line), len(hulls)), np.inf)
    high = -low
    first, second = np.moveaxis(hulls, 2, 0)
    for k in range(hulls.shape[1]):
        span = first[:, k] - first[:, k - 1]
        with np.errstate(divide="ignore", invalid="ignore"):
            fraction = (line[:, None] - first[:, k - 1]) / span
            value = second[:, k - 1] + fraction * (second[:, k] - second[:, k - 1])
            crosses = (fraction >= 0.0) & (fraction <= 1.0)
        low = np.where(crosses, np.fmin(low, value), low)
        high = np.where(crosses, np.fmax(high, value), high)
    return low, high


@dataclass(frozen=True)
class CutHulls:
    """Hulls cut by lines: on each line, how many hulls hold each stretch between their ends."""

    line: Float64[Array, "R"]
    end: Float64[Array, "R E"]
    """All hulls' ends in order; infinite for a hull that does not reach the line."""
    count: Int64[Array, "R E"]
    """Hulls that hold the stretch from an end to the next one."""
    enter: Int64[Array, "R S"]
    leave: Int64[Array, "R S"]
    """Where each hull's ends are in the order."""

    @classmethod
    def across(cls, hulls: Float64[Array, "S K 2"]) -> CutHulls:
        """Cut hulls across, densely where they end and have corners."""
        line = _spread(hulls[..., 0])
        low, high = chords(hulls, line)
        n = low.shape[1]
        end = np.concatenate([low, np.where(np.isfinite(high), high, np.inf)], axis=1)
        order = np.argsort(end, axis=1, kind="stable")
        rank = np.empty_like(order)
        np.put_along_axis(rank, order, np.arange(2 * n)[None], axis=1)
        end = np.take_along_axis(end, order, axis=1)
        step = np.where(order < n, 1, -1) * np.isfinite(end)
        return cls(line, end, np.cumsum(step, axis=1), rank[:, :n], rank[:, n:])

    def inner_level(self, share: float) -> int:
        """Return the lowest count above which a share of the hulls holds all that is held."""
        n = self.enter.shape[1]
        reached = np.isfinite(np.take_along_axis(self.end, self.enter, axis=1))
        before = np.maximum.accumulate(np.pad(self.count, ((0, 0), (1, 0))), axis=1)
        after = np.maximum.accumulate(self.count[:, ::-1], axis=1)[:, ::-1]
        outside = np.maximum(
            np.take_along_axis(before, self.enter, axis=1),
            np.take_along_axis(after, self.leave, axis=1),
        )
        outside = np.where(reached, outside, after[:, :1]).max(axis=0)
        return int(np.sort(outside)[int(np.ceil(share * n)) - 1])

    def intervals(self, inside: Bool[Array, "R E"]) -> list[Float64[Array, "_ 2"]]:
        """Return the stretches of each line that a region covers."""
        edge = np.diff(np.pad(inside, ((0, 0), (1, 1))).astype(np.int8), axis=1)
        found = []
        for row, change in zip(self.end, edge, strict=True):
            start, stop = np.flatnonzero(change > 0), np.flatnonzero(change < 0)
            found.append(np.stack([row[start], row[np.minimum(stop, len(row) - 1)]], axis=1))
        return found


def _spread(first: Float64[Array, "S K"]) -> Float64[Array, "R"]:
    """Place lines across the hulls: dense where they end and where they have corners."""
    share = np.linspace(0.0, 1.0, _LINES)
    lowest, highest = first.min(axis=1), first.max(axis=1)
    even = np.linspace(lowest.min(), highest.max(), _LINES)
    dense = [np.quantile(values, share) for values in (lowest, highest, first)]
    # Near an end that is known well, a region's corner is as small as the end's spread.
    spread = [np.ptp(line) * _NEAR_ENDS for line in dense[:2]]
    near = [dense[0][-1] + spread[0], dense[1][0] - spread[1]]
    return np.unique(np.concatenate([even, *dense, *near]))
