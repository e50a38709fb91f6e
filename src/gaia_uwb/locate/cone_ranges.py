"""Ranges between cones: they tie the zone together, and place a cone that was hardly heard.

The places that the vehicle's ranges gave are the prior: each cone's own errors, and what all cones
have in common. Ranges between cones are robust (Student-t), with the delays of both radios and a
bias that all such ranges share. Given sides, all places are solved together.

Which sides: of two cones that stand on one side the distance is another than of two that face each
other over the path. The strongest ties form a tree, on which sides are summed over exactly (belief
propagation); ties that would close a circle are left to the places.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gaia_uwb._shared import Array, Bool, Float64, Int64
from gaia_uwb.episode import Episode
from gaia_uwb.locate.hypotheses import Hypotheses

_NOISE_M = 0.1  # of one range, where there are too few to tell
_LASTING_M = 0.05  # of the mean of a pair: pattern of both antennas, reflections
_BIAS_M, _DELAY_M = 0.2, 0.05
_DEGREES = 4.0
_STEPS = 12
_FAR_M = 1e3  # prior standard deviation of a cone that was hardly heard
_ROUND = 48  # directions in which a cone is sought around another
_CONTRADICTS = 5.0  # standard deviations
_OWN_NOISE_M = 0.15  # of the vehicle's ranges to a cone that it hardly heard


@dataclass(frozen=True)
class Ties:
    """Ranges between cones, one for each pair.

    Parameters
    ----------
    a, b : (P,)
        Indices of both cones.
    range_m, sigma_m : (P,)
        Horizontal distance, and its standard deviation.
    """

    a: Int64[Array, "P"]
    b: Int64[Array, "P"]
    range_m: Float64[Array, "P"]
    sigma_m: Float64[Array, "P"]

    @classmethod
    def of(cls, episodes: Sequence[Episode], anchor_ids: Sequence[str]) -> Ties | None:
        """Gather the ranges between the cones of a zone; None where there are none.

        Parameters
        ----------
        episodes
            The drives past it. Tags of one drive have the same ranges between cones.
        anchor_ids
            Its cones.
        """
        index = {name: n for n, name in enumerate(anchor_ids)}
        pairs, ranges, drives = [], [], set()
        up_m = np.full(len(anchor_ids), np.nan)
        for episode in episodes:
            known = episode.cone_ranges
            if known is None or (episode.drive and episode.drive in drives):
                continue
            drives.add(episode.drive)
            own = np.array([index[name] for name in episode.anchor_ids], dtype=np.int64)
            if episode.anchor_up_m is not None:
                up_m[own] = episode.anchor_up_m
            pairs.append(np.sort(np.stack([own[known.anchor_a], own[known.anchor_b]]), axis=0))
            ranges.append(known.range_m)
        if not pairs:
            return None
        pair, row = np.unique(np.concatenate(pairs, axis=1), axis=1, return_inverse=True)
        range_m = np.concatenate(ranges)
        parts = [range_m[row == k] for k in range(pair.shape[1])]
        middle_m = np.array([np.median(part) for part in parts])
        spread_m = [1.4826 * np.median(np.abs(part - np.median(part))) for part in parts]
        count = np.array([len(part) for part in parts])
        noise_m = np.where(count >= 5, np.maximum(spread_m, 0.01), _NOISE_M)
        higher_m = np.nan_to_num(up_m[pair[0]] - up_m[pair[1]], nan=0.0)
        return cls(
            pair[0],
            pair[1],
            np.sqrt(np.maximum(middle_m**2 - higher_m**2, 0.01)),
            np.hypot(1.25 * noise_m / np.sqrt(count), _LASTING_M),
        )


@dataclass(frozen=True)
class HardlyHeard:
    """What the vehicle measured of cones that its ranges alone do not locate.

    Parameters
    ----------
    cone : (R,)
        Index of the cone.
    from_m : (R, 2)
        Where the tag was.
    range_m : (R,)
        Horizontal distance, free of the common bias.
    """

    cone: Int64[Array, "R"]
    from_m: Float64[Array, "R 2"]
    range_m: Float64[Array, "R"]


def with_cone_ranges(
    hypotheses: Hypotheses, ties: Ties, heard: HardlyHeard, alike: float
) -> tuple[Hypotheses, list[tuple[int, int, float, float]]]:
    """Return both places of every cone by all ranges, and the ties that contradict the others.

    Parameters
    ----------
    hypotheses
        By the ranges of vehicles.
    ties, heard
        The ranges between cones, and those of vehicles to cones that these do not locate.
    alike
        Log odds of sides are divided by this, as those of ranges are.

    Returns
    -------
    hypotheses
        Also of cones that were hardly heard, where two others have ranges to them.
    contradictions
        Pairs of cones, the measured and the expected distance in metres.
    """
    hypotheses = _seek(hypotheses, ties, heard)
    located = np.asarray(np.isfinite(hypotheses.position_m).all(axis=(1, 2)))
    kept = located[ties.a] & located[ties.b]
    ties = Ties(ties.a[kept], ties.b[kept], ties.range_m[kept], ties.sigma_m[kept])
    if not len(ties.a):
        return hypotheses, []
    odds = _odds(hypotheses, ties, alike)
    hypotheses = replace(hypotheses, log_odds=odds).better_first()
    solved = _Solved.of(hypotheses, ties, heard, located)
    return solved.result(hypotheses), solved.contradictions()


def _pair_loss(scaled: Array) -> Array:
    return np.asarray(0.5 * (_DEGREES + 1.0) * np.log1p(scaled**2 / _DEGREES))


def _odds(hypotheses: Hypotheses, ties: Ties, alike: float) -> Float64[Array, "N"]:
    """Return log odds of the first place by the ranges and the strongest ties."""
    n = len(hypotheses.log_odds)
    place_m = hypotheses.position_m
    off_m = place_m[ties.a][:, :, None] - place_m[ties.b][:, None]  # (P, 2, 2, 2)
    distance_m = np.maximum(np.hypot(off_m[..., 0], off_m[..., 1]), 0.1)
    towards = off_m / distance_m[..., None]
    variance_m2 = ties.sigma_m[:, None, None] ** 2 + 2.0 * _DELAY_M**2 + _BIAS_M**2
    covariance_m2 = hypotheses.covariance_m2
    shared_m = hypotheses.shared_m
    own_m2 = covariance_m2
    if shared_m is not None:
        own_m2 = covariance_m2 - shared_m @ np.swapaxes(shared_m, -1, -2)
        differ_m = shared_m[ties.a][:, :, None] - shared_m[ties.b][:, None]  # (P, 2, 2, 2, S)
        variance_m2 = variance_m2 + (np.einsum("pstd,pstdk->pstk", towards, differ_m) ** 2).sum(-1)
    for own, axis in ((own_m2[ties.a][:, :, None], 1), (own_m2[ties.b][:, None], 2)):
        whole = np.broadcast_to(own, (*off_m.shape, 2)) if axis else own
        variance_m2 = variance_m2 + np.einsum("pstd,pstde,pste->pst", towards, whole, towards)
    sigma_m = np.sqrt(variance_m2)
    table = -_pair_loss((ties.range_m[:, None, None] - distance_m) / sigma_m) - np.log(sigma_m)
    table /= alike
    strength = np.abs(table[:, 0, 0] + table[:, 1, 1] - table[:, 0, 1] - table[:, 1, 0])
    tree = _strongest_tree(n, ties, strength)
    return _sums_over(tree, table, ties, hypotheses.log_odds)


def _strongest_tree(n: int, ties: Ties, strength: Float64[Array, "P"]) -> list[list[int]]:
    """Return the ties of each cone in the forest of the strongest ties."""
    group = list(range(n))

    def root(k: int) -> int:
        while group[k] != k:
            group[k] = group[group[k]]
            k = group[k]
        return k

    tree: list[list[int]] = [[] for _ in range(n)]
    for p in np.argsort(-strength, kind="stable").tolist():
        one, other = root(int(ties.a[p])), root(int(ties.b[p]))
        if one != other:
            group[one] = other
            tree[int(ties.a[p])].append(p)
            tree[int(ties.b[p])].append(p)
    return tree


def _sums_over(
    tree: list[list[int]], table: Array, ties: Ties, odds: Float64[Array, "N"]
) -> Float64[Array, "N"]:
    """Return each cone's log odds, summed over all sides of the others in its tree."""
    n = len(odds)
    alone = np.stack([0.5 * odds, -0.5 * odds], axis=1)
    parent, through, order = np.full(n, -1), np.full(n, -1), []
    seen = np.zeros(n, dtype=np.bool_)
    for first in range(n):
        stack = [] if seen[first] else [first]
        while stack:
            k = stack.pop()
            seen[k] = True
            order.append(k)
            for p in tree[k]:
                other = int(ties.b[p]) if int(ties.a[p]) == k else int(ties.a[p])
                if not seen[other]:
                    parent[other], through[other] = k, p
                    stack.append(other)

    def message(p: int, of: int, belief: Array) -> Array:
        log = table[p] if int(ties.a[p]) == of else table[p].T  # rows are of the sender
        return np.asarray(np.logaddexp.reduce(belief[:, None] + log, axis=0))

    up, inside = np.zeros((n, 2)), alone.copy()
    for k in reversed(order):
        if parent[k] >= 0:
            up[k] = message(int(through[k]), k, inside[k])
            inside[parent[k]] += up[k]
    whole = inside.copy()
    for k in order:
        if parent[k] >= 0:
            rest = whole[parent[k]] - up[k]
            whole[k] = inside[k] + message(int(through[k]), int(parent[k]), rest)
    return np.asarray(whole[:, 0] - whole[:, 1])


def _seek(hypotheses: Hypotheses, ties: Ties, heard: HardlyHeard) -> Hypotheses:
    """Look for cones that the vehicle's ranges do not locate, around those that ranged to them."""
    located = np.asarray(np.isfinite(hypotheses.position_m).all(axis=(1, 2)))
    position_m = hypotheses.position_m.copy()
    covariance_m2, odds = hypotheses.covariance_m2.copy(), hypotheses.log_odds.copy()
    n_ranges = hypotheses.n_ranges.copy()
    for n in np.flatnonzero(~located):
        mine = np.flatnonzero((ties.a == n) | (ties.b == n))
        other = np.where(ties.a[mine] == n, ties.b[mine], ties.a[mine])
        mine, other = mine[located[other]], other[located[other]]
        own = heard.cone == n
        if len(mine) < 2 and not (len(mine) and own.sum() >= 2):
            continue
        at_m = hypotheses.position_m[other, 0]
        turn = np.linspace(0, 2 * np.pi, _ROUND, endpoint=False)
        ring = np.stack([np.cos(turn), np.sin(turn)], axis=1)
        tried_m = (at_m[:, None] + ties.range_m[mine, None, None] * ring).reshape(-1, 2)
        from_m = np.concatenate([at_m, heard.from_m[own]])
        range_m = np.concatenate([ties.range_m[mine], heard.range_m[own]])
        sigma_m = np.concatenate(
            [np.hypot(ties.sigma_m[mine], 0.1), np.full(int(own.sum()), _OWN_NOISE_M)]
        )
        for _ in range(15):
            tried_m, cost = _polish(tried_m, from_m, range_m, sigma_m)
        order = np.argsort(cost)
        best = order[0]
        apart = np.hypot(*(tried_m[order] - tried_m[best]).T) > 0.5
        second = order[int(np.argmax(apart))] if apart.any() else best
        position_m[n] = tried_m[[best, second]]
        covariance_m2[n] = _FAR_M**2 * np.eye(2)
        odds[n] = min(cost[second] - cost[best], 50.0)
        n_ranges[n] = own.sum()
    shared_m = hypotheses.shared_m
    if shared_m is not None:
        shared_m = np.where(located[:, None, None, None], shared_m, 0.0)
    return replace(
        hypotheses,
        position_m=position_m,
        covariance_m2=covariance_m2,
        log_odds=odds,
        shared_m=shared_m,
        n_ranges=n_ranges,
    )


def _polish(
    place_m: Float64[Array, "K 2"], from_m: Array, range_m: Array, sigma_m: Array
) -> tuple[Float64[Array, "K 2"], Float64[Array, "K"]]:
    """Take a step from each of K places towards ranges from known points; return their costs."""
    off_m = place_m[:, None] - from_m
    distance_m = np.maximum(np.hypot(off_m[..., 0], off_m[..., 1]), 0.05)
    scaled = (range_m - distance_m) / sigma_m
    weight = (_DEGREES + 1.0) / (_DEGREES + scaled**2) / sigma_m**2
    towards = off_m / distance_m[..., None]
    matrix = np.einsum("kr,kri,krj->kij", weight, towards, towards) + 1e-3 * np.eye(2)
    pull = np.einsum("kr,kri->ki", weight * scaled * sigma_m, towards)
    step_m = np.linalg.solve(matrix, pull[..., None])[..., 0]
    length_m = np.maximum(np.hypot(*step_m.T), 1e-9)
    moved_m = place_m + step_m * np.minimum(1.0, 2.0 / length_m)[:, None]
    return moved_m, np.asarray(_pair_loss(scaled).sum(axis=1))


@dataclass(frozen=True)
class _Solved:
    """All first places together."""

    ties: Ties
    place_m: Float64[Array, "N 2"]
    covariance_m2: Float64[Array, "N 2 2"]
    common_m: Float64[Array, "N 2 S"]
    left: Float64[Array, "P"]
    expected_m: Float64[Array, "P"]
    located: Bool[Array, "N"]

    @classmethod
    def of(
        cls, hypotheses: Hypotheses, ties: Ties, heard: HardlyHeard, located: Bool[Array, "N"]
    ) -> _Solved:
        """Solve for the places of all cones, given their sides."""
        n = len(located)
        shared_m = np.zeros((n, 2, 0))
        if hypotheses.shared_m is not None:
            shared_m = np.where(located[:, None, None], hypotheses.shared_m[:, 0], 0.0)
        s = shared_m.shape[-1]
        start_m = np.nan_to_num(hypotheses.position_m[:, 0])
        whole_m2 = np.where(located[:, None, None], hypotheses.covariance_m2[:, 0], np.eye(2))
        own_m2 = whole_m2 - shared_m @ np.swapaxes(shared_m, 1, 2) + 1e-6 * np.eye(2)
        size = 2 * n + s + n + 1  # own errors, what is shared, delays, bias
        prior = np.zeros((size, size))
        precision = np.linalg.inv(own_m2)
        for k in range(n):
            prior[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = precision[k]
        rest = np.concatenate([np.ones(s), np.full(n, _DELAY_M**-2.0), [_BIAS_M**-2.0]])
        prior[np.arange(2 * n, size), np.arange(2 * n, size)] = rest
        unknown = np.zeros(size)
        few = np.flatnonzero(np.isin(heard.cone, np.flatnonzero(located)))
        pair, own = np.arange(len(ties.a)), np.arange(len(few))
        for _ in range(_STEPS):
            place_m = (
                start_m + unknown[: 2 * n].reshape(n, 2) + shared_m @ unknown[2 * n : 2 * n + s]
            )
            by = np.zeros((len(pair) + len(few), size))
            off_m = place_m[ties.a] - place_m[ties.b]
            distance_m = np.maximum(np.hypot(*off_m.T), 0.1)
            towards = off_m / distance_m[:, None]
            for cone, sign in ((ties.a, 1.0), (ties.b, -1.0)):
                for axis in (0, 1):
                    np.add.at(by, (pair, 2 * cone + axis), sign * towards[:, axis])
                by[: len(pair), 2 * n : 2 * n + s] += sign * np.einsum(
                    "pi,pis->ps", towards, shared_m[cone]
                )
                np.add.at(by, (pair, 2 * n + s + cone), 1.0)
            by[: len(pair), -1] = 1.0
            delay_m = unknown[2 * n + s : -1]
            expected_m = distance_m + delay_m[ties.a] + delay_m[ties.b] + unknown[-1]
            from_m = place_m[heard.cone[few]] - heard.from_m[few]
            away_m = np.maximum(np.hypot(*from_m.T), 0.1)
            for axis in (0, 1):
                by[len(pair) + own, 2 * heard.cone[few] + axis] = from_m[:, axis] / away_m
            left_m = np.concatenate([ties.range_m - expected_m, heard.range_m[few] - away_m])
            sigma_m = np.concatenate([ties.sigma_m, np.full(len(few), _OWN_NOISE_M)])
            scaled = left_m / sigma_m
            weight = (_DEGREES + 1.0) / (_DEGREES + scaled**2) / sigma_m**2
            matrix = prior + (by * weight[:, None]).T @ by
            unknown = unknown + np.linalg.solve(
                matrix, (by * weight[:, None]).T @ left_m - prior @ unknown
            )
        covariance = np.linalg.inv(matrix)
        moves = np.zeros((n, 2, size))
        for axis in (0, 1):
            moves[np.arange(n), axis, 2 * np.arange(n) + axis] = 1.0
        moves[:, :, 2 * n : 2 * n + s] = shared_m
        covariance_m2 = moves @ covariance @ np.swapaxes(moves, 1, 2)
        shared = slice(2 * n, 2 * n + s)
        root = np.linalg.cholesky(covariance[shared, shared])
        common_m = moves @ np.linalg.solve(root, covariance[shared]).T if s else shared_m
        place_m = start_m + unknown[: 2 * n].reshape(n, 2) + shared_m @ unknown[shared]
        return cls(ties, place_m, covariance_m2, common_m, scaled[: len(pair)], expected_m, located)

    def result(self, hypotheses: Hypotheses) -> Hypotheses:
        """Return the hypotheses with these first places."""
        tied = self.located.copy()
        position_m, covariance_m2 = hypotheses.position_m.copy(), hypotheses.covariance_m2.copy()
        position_m[tied, 0], covariance_m2[tied, 0] = self.place_m[tied], self.covariance_m2[tied]
        shared_m = hypotheses.shared_m
        if shared_m is not None:
            shared_m = shared_m.copy()
            shared_m[tied, 0] = self.common_m[tied]
        return replace(
            hypotheses,
            position_m=position_m,
            covariance_m2=covariance_m2,
            shared_m=shared_m,
            converged=hypotheses.converged | ~np.isfinite(hypotheses.own_bias_m),
        )

    def contradictions(self) -> list[tuple[int, int, float, float]]:
        """Return the ties that are too far off."""
        wrong = np.flatnonzero(np.abs(self.left) > _CONTRADICTS)
        ties = self.ties
        return [
            (int(ties.a[p]), int(ties.b[p]), float(ties.range_m[p]), float(self.expected_m[p]))
            for p in wrong
        ]
