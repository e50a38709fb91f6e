"""From what a denoiser says of a zone to one fix per anchor, and the sides that may be instead.

The counterpart of ``sides.py`` for denoisers that locate anchors themselves
(:class:`~gaia_uwb.denoised.ZonePosterior`): the likeliest combination of sides is chosen, and
an anchor's mirror image keeps the probability of all combinations that put the anchor there.
"""

from __future__ import annotations

import heapq
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gaia_uwb._shared import Array, Float64, Int64
from gaia_uwb.config import SidesConfig, SolverConfig
from gaia_uwb.denoised import ZonePosterior
from gaia_uwb.episode import Episode
from gaia_uwb.estimate import Reason
from gaia_uwb.locate import Hypotheses
from gaia_uwb.zone.decision import (
    KEPT,
    ChosenPlace,
    Combinations,
    Decision,
    kept_combinations,
    make_fix,
)
from gaia_uwb.zone.known_facts import KnownFacts
from gaia_uwb.zone.side_search import SHARED_ERRORS

_LOOKED_AT = 128  # likeliest combinations under each hypothesis
_ENOUGH = 0.9  # probability of the combinations that are kept, else they are drawn
_DRAWN = 2048  # combinations, where something is known that makes some of them likelier
_WORTH = 200.0  # drawn combinations that these must be worth
_HOPELESS = 20.0  # log odds against a combination, beyond which it is not considered
_ONE_PLACE_M = 0.5  # two places nearer to each other than a cone is wide are one
_LEAST = 1e-4  # probability of a side, where something else is known: no network is surer than that


def decide_zone(
    anchor_ids: Sequence[str],
    zone: ZonePosterior,
    n_ranges: Int64[Array, "N"],
    config: SidesConfig = SidesConfig(),
    solver: SolverConfig = SolverConfig(),
    facts: KnownFacts | None = None,
    by_ranges: Hypotheses | None = None,
) -> Decision:
    """Choose a side for every anchor, and keep the combinations of sides that may be instead.

    Parameters
    ----------
    anchor_ids
        The anchors' names.
    zone
        What the denoiser says of them.
    n_ranges : (N,)
        Usable ranges of each anchor.
    config
        ``ambiguous_above``.
    solver
        ``min_ranges`` and ``ill_conditioned_above_m``.
    facts
        What is known of the zone beforehand; used as far as the denoiser does not contradict it.
    by_ranges
        The fit of the ranges: whether it converged, and each anchor's own range bias.
    """
    located = np.flatnonzero(zone.located & (n_ranges >= solver.min_ranges))
    ids = [anchor_ids[n] for n in located.tolist()]
    zone = _one_place_where_both_meet(zone)
    hypotheses = _as_hypotheses(zone, located, n_ranges, by_ranges)
    if facts is None or not len(located):
        choice = _Choice.of(zone, located, hypotheses)
    else:
        choice = _Choice.with_facts(zone, located, hypotheses, facts, ids)
    choice = choice.honest(located)
    row = {n: k for k, n in enumerate(located.tolist())}
    anchors = tuple(
        make_fix(
            anchor_id,
            _place(choice, row[n], n, by_ranges) if n in row else None,
            int(n_ranges[n]),
            config,
            solver,
        )
        for n, anchor_id in enumerate(anchor_ids)
    )
    return Decision(anchors, choice.combinations, choice.hypotheses, choice.reasons)


@dataclass(frozen=True)
class _Choice:
    """Sides of the M located anchors, with what goes with them."""

    hypotheses: Hypotheses
    combinations: Combinations
    side: Int64[Array, "M"]
    place_m: Float64[Array, "M 2"]
    covariance_m2: Float64[Array, "M 2 2"]
    mirror_probability: Float64[Array, "M"]
    reasons: tuple[Reason, ...] = ()

    def honest(self, located: Int64[Array, "M"]) -> _Choice:
        """Return the choice with covariances along the curves on which places err."""
        side = np.zeros(len(self.hypotheses.log_odds), dtype=np.int64)
        side[located] = self.side
        linear_m2 = self.hypotheses.covariance_m2[np.arange(len(side)), side]
        linear_m2[located] = self.covariance_m2
        honest_m2 = self.hypotheses.honest_covariance(linear_m2, side)
        return replace(self, covariance_m2=honest_m2[located])

    @classmethod
    def of(cls, zone: ZonePosterior, located: Int64[Array, "M"], hypotheses: Hypotheses) -> _Choice:
        """Choose by what the denoiser says alone."""
        right = 1.0 - zone.left_probability[:, located]  # (2, M)
        side = _candidates(right)
        log_weight = _log_weight(zone.scene_probability, right, side)
        best = side[int(np.argmax(log_weight))]
        if _hold_enough(log_weight):
            combinations = _kept(side, _weight(log_weight), located)
        else:
            combinations = _counted(_drawn(zone.scene_probability, right, KEPT), located)
        marginal = zone.scene_probability @ right
        mirror = np.where(best == 1, 1.0 - marginal, marginal)
        return cls(
            hypotheses,
            combinations,
            best,
            hypotheses.position_m[located, best],
            hypotheses.covariance_m2[located, best],
            np.clip(mirror, 0.0, 1.0),
        )

    @classmethod
    def with_facts(
        cls,
        zone: ZonePosterior,
        located: Int64[Array, "M"],
        hypotheses: Hypotheses,
        facts: KnownFacts,
        ids: Sequence[str],
    ) -> _Choice:
        """Choose by what the denoiser says and what is known, as far as the two agree."""
        right = np.clip(1.0 - zone.left_probability[:, located], _LEAST, 1.0 - _LEAST)
        side = np.concatenate([_candidates(right), _what_may_be_said(right)])
        side = np.unique(side, axis=0)
        before = _log_weight(zone.scene_probability, right, side)
        holds, reasons = facts.borne_out(hypotheses, located, side, _weight(before))
        surveyed = hypotheses if holds is None else holds.with_surveys(hypotheses)

        def said(side: Int64[Array, "K M"]) -> Float64[Array, "K"]:
            """Return how much likelier combinations are with all that holds."""
            log_ratio = np.zeros(len(side))
            for statement in () if holds is None else holds.statements(hypotheses, located, side):
                log_ratio += statement.log_ratio
            return log_ratio

        after = before + said(side)
        best = side[int(np.argmax(after))]
        combinations = _kept(side, _weight(after), located)
        if not _hold_enough(before):
            drawn = _drawn(zone.scene_probability, right, _DRAWN)
            weight = _weight(said(drawn))
            if weight.sum() ** 2 > _WORTH * (weight**2).sum():
                combinations = _counted(_resampled(drawn, weight), located)
                side, before, after = drawn, np.zeros(len(drawn)), np.log(weight)
        marginal = zone.scene_probability @ right
        alone = np.where(best == 1, 1.0 - marginal, marginal)
        log_odds = _log_odds(alone) + _other_side(side, _weight(after), best)
        log_odds -= _other_side(side, _weight(before), best)
        mirror = 1.0 / (1.0 + np.exp(-np.clip(log_odds, -50.0, 50.0)))
        if holds is not None:  # where what was said is wrong, it is wrong of all cones at once
            error = facts.prior.statement_error
            mirror = (1.0 - error) * mirror + error * alone
        place_m = surveyed.position_m[located, best]
        covariance_m2 = surveyed.covariance_m2[located, best]
        if holds is not None:  # a spacing says nothing of what moves neighbours alike
            common_m2 = SHARED_ERRORS * covariance_m2
            place_m, own_m2 = holds.with_spacing(place_m, covariance_m2 - common_m2)
            covariance_m2 = own_m2 + common_m2
        reasons += facts.exceptions(place_m, covariance_m2, ids, reasons)
        return cls(
            surveyed,
            combinations,
            best,
            place_m,
            covariance_m2,
            mirror,
            reasons,
        )


def _place(choice: _Choice, row: int, n: int, by_ranges: Hypotheses | None) -> ChosenPlace:
    """Return where the located anchor of a row stands."""
    other = 1 - int(choice.side[row])
    return ChosenPlace(
        position_m=choice.place_m[row],
        covariance_m2=choice.covariance_m2[row],
        mirror_position_m=choice.hypotheses.position_m[n, other],
        mirror_covariance_m2=choice.hypotheses.covariance_m2[n, other],
        mirror_probability=float(choice.mirror_probability[row]),
        range_bias_m=np.nan if by_ranges is None else float(by_ranges.own_bias_m[n]),
        converged=by_ranges is None or bool(by_ranges.converged[n]),
        fits=by_ranges is None or bool(by_ranges.fits[n]),
    )


def widened(zone: ZonePosterior, episode: Episode, solver: SolverConfig) -> ZonePosterior:
    """Add to the places' covariances what no denoiser sees in one log.

    That is what its clock offset may be off, which moves anchors along the path, and the floor that
    no number of ranges improves.

    Parameters
    ----------
    zone
        What the denoiser says.
    episode
        Of which; at least two steps.
    solver
        ``position_floor_m``.
    """
    sigma_s = 0.0 if episode.clock is None else episode.clock.sigma_s
    velocity_mps = np.gradient(episode.position_m, episode.t_s, axis=0)
    n_ranges = np.maximum(episode.valid.sum(axis=0), 1)
    shift_m = sigma_s * (episode.valid.T @ velocity_mps) / n_ranges[:, None]
    more_m2 = shift_m[:, :, None] * shift_m[:, None, :] + solver.position_floor_m**2 * np.eye(2)
    return replace(zone, covariance_m2=zone.covariance_m2 + more_m2[:, None])


def _one_place_where_both_meet(zone: ZonePosterior) -> ZonePosterior:
    """Merge both places of the anchors where they are one, as on a winding path: no side is open.

    The one place has the mean and the covariance of the two.
    """
    apart_m = zone.place_m[:, 0] - zone.place_m[:, 1]
    same = np.hypot(apart_m[:, 0], apart_m[:, 1]) < _ONE_PLACE_M
    left = zone.scene_probability @ zone.left_probability
    weight = np.stack([left, 1.0 - left], axis=-1)[same]
    mean_m = np.einsum("ns,nsi->ni", weight, zone.place_m[same])
    off_m = zone.place_m[same] - mean_m[:, None]
    spread_m2 = zone.covariance_m2[same] + off_m[..., :, None] * off_m[..., None, :]
    place_m, covariance_m2 = zone.place_m.copy(), zone.covariance_m2.copy()
    left_probability = zone.left_probability.copy()
    place_m[same] = mean_m[:, None]
    covariance_m2[same] = np.einsum("ns,nsij->nij", weight, spread_m2)[:, None]
    left_probability[:, same] = left[same] > 0.5
    return replace(
        zone, place_m=place_m, covariance_m2=covariance_m2, left_probability=left_probability
    )


def _as_hypotheses(
    zone: ZonePosterior,
    located: Int64[Array, "M"],
    n_ranges: Int64[Array, "N"],
    by_ranges: Hypotheses | None,
) -> Hypotheses:
    """Return both places as those who draw possible scenes expect them: left first, then right."""
    n = len(n_ranges)
    there = np.isin(np.arange(n), located)
    return Hypotheses(
        position_m=np.where(there[:, None, None], zone.place_m, np.nan),
        covariance_m2=zone.covariance_m2,
        log_odds=np.zeros(n),
        own_bias_m=np.zeros(n),
        n_ranges=n_ranges,
        converged=np.ones(n, dtype=np.bool_),
        fits=np.ones(n, dtype=np.bool_),
        centre_m=None if by_ranges is None else by_ranges.centre_m,
    )


def _candidates(right: Float64[Array, "2 M"]) -> Int64[Array, "K M"]:
    """Return the likeliest combinations under each hypothesis."""
    m = right.shape[1]
    found = sorted({combination for own in right for combination in _likeliest(own, _LOOKED_AT)})
    n_bytes = m // 8 + 1
    packed = b"".join(combination.to_bytes(n_bytes, "little") for combination in found)
    rows = np.frombuffer(packed, dtype=np.uint8).reshape(len(found), n_bytes)
    return np.unpackbits(rows, axis=1, count=m, bitorder="little").astype(np.int64)


def _likeliest(right: Float64[Array, "M"], count: int) -> list[int]:
    """Return the likeliest combinations of independent sides, the best first, as bits per anchor.

    Next to the best are those with other sides for the anchors where that costs least: with the
    costs in order, every set of anchors has exactly one parent in which its last anchor is left
    out or is the one before, and no parent costs more. So a heap finds them in their order.
    """
    with np.errstate(divide="ignore"):
        cost = np.abs(np.log(right) - np.log1p(-right))
    order = np.argsort(cost, kind="stable")
    costs = cost[order].tolist()
    bits = [1 << n for n in order.tolist()]
    best = sum(1 << n for n in np.flatnonzero(right > 0.5).tolist())
    found = [best]
    # Cost, combination, and the position of its last change in the order of costs.
    heap = [(costs[0], best ^ bits[0], 0)] if costs else []
    while heap and len(found) < count and heap[0][0] < _HOPELESS:
        total, combination, last = heapq.heappop(heap)
        found.append(combination)
        if last + 1 < len(costs):
            following = combination ^ bits[last + 1]
            heapq.heappush(heap, (total + costs[last + 1], following, last + 1))
            moved = total - costs[last] + costs[last + 1]
            heapq.heappush(heap, (moved, following ^ bits[last], last + 1))
    return found


def _log_odds(probability: Float64[Array, "M"]) -> Float64[Array, "M"]:
    return np.asarray(np.log(probability) - np.log1p(-probability))


def _other_side(
    side: Int64[Array, "K M"], weight: Float64[Array, "K"], best: Int64[Array, "M"]
) -> Float64[Array, "M"]:
    """Return each anchor's log odds of not standing where the best combination puts it.

    The combinations are some of all, so these are too small where many sides are open; but by how
    much a statement changes them is what it changes.
    """
    share = (weight[:, None] * (side != best)).sum(axis=0) / weight.sum()
    return _log_odds(np.clip(share, 1e-12, 1.0 - 1e-12))


def _kept(
    side: Int64[Array, "K M"], weight: Float64[Array, "K"], located: Int64[Array, "M"]
) -> Combinations:
    return replace(kept_combinations(side, weight, located, joint=False), learned=True)


def _hold_enough(log_weight: Float64[Array, "K"]) -> bool:
    """Tell whether as many combinations as are kept can stand for all."""
    return bool(np.exp(np.sort(log_weight)[-KEPT:]).sum() > _ENOUGH)


def _drawn(
    scene: Float64[Array, "2"], right: Float64[Array, "2 M"], count: int
) -> Int64[Array, "K M"]:
    """Draw combinations: where many sides are open, no list holds them."""
    rng = np.random.default_rng(0)
    given = (rng.random(count) >= scene[0]).astype(np.int64)
    return np.asarray(rng.random((count, right.shape[1])) < right[given], dtype=np.int64)


def _resampled(side: Int64[Array, "K M"], weight: Float64[Array, "K"]) -> Int64[Array, "_ M"]:
    """Return as many combinations as are kept, at even steps through the weights."""
    edges = np.cumsum(weight) / weight.sum()
    return side[np.searchsorted(edges, (np.arange(KEPT) + 0.5) / KEPT)]


def _counted(drawn: Int64[Array, "K M"], located: Int64[Array, "M"]) -> Combinations:
    side, count = np.unique(drawn, axis=0, return_counts=True)
    return _kept(side, count.astype(np.float64), located)


def _what_may_be_said(right: Float64[Array, "2 M"]) -> Int64[Array, "K M"]:
    """Return combinations that the denoiser holds for unlikely, but a user may know better.

    These are all anchors on one side, and the likeliest sides but for one anchor.
    """
    m = right.shape[1]
    flipped = (right > 0.5).astype(np.int64)[:, None] ^ np.eye(m, dtype=np.int64)
    uniform = np.repeat(np.array([[0], [1]]), m, axis=1)
    return np.concatenate([flipped.reshape(-1, m), uniform])


def _log_weight(
    scene: Float64[Array, "2"], right: Float64[Array, "2 M"], side: Int64[Array, "K M"]
) -> Float64[Array, "K"]:
    """Return the logarithm of each combination's probability."""
    with np.errstate(divide="ignore"):
        log_right, log_left, log_scene = np.log(right), np.log1p(-right), np.log(scene)
    # -inf times 0 must be 0: choose, do not multiply.
    given = np.where(side[:, None] == 1, log_right, log_left).sum(axis=2)  # (K, 2)
    return np.asarray(np.logaddexp(given[:, 0] + log_scene[0], given[:, 1] + log_scene[1]))


def _weight(log_weight: Float64[Array, "K"]) -> Float64[Array, "K"]:
    """Return probabilities, scaled so that the largest is 1."""
    return np.asarray(np.exp(log_weight - log_weight.max()))
