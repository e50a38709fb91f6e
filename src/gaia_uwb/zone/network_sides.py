"""From what a denoiser says of a zone to one fix per anchor, and the sides that may be instead.

The counterpart of ``sides.py`` for denoisers that locate anchors themselves
(:class:`~gaia_uwb.denoised.ZonePosterior`).
"""

from __future__ import annotations

import heapq
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gaia_uwb._shared import Array, Bool, Float64, Int64
from gaia_uwb.config import SidesConfig, SolverConfig
from gaia_uwb.denoised import ZonePosterior
from gaia_uwb.episode import Episode
from gaia_uwb.locate import Hypotheses
from gaia_uwb.zone.decision import ChosenPlace, Decision, is_well_placed, make_fix
from gaia_uwb.zone.known_facts import KnownFacts
from gaia_uwb.zone.network_prior import ByRanges
from gaia_uwb.zone.side_choice import SideChoice, choose, choose_with_facts

_LOOKED_AT = 128  # likeliest combinations under each hypothesis
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
    by_ranges: ByRanges | None = None,
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
        What the ranges alone say, and their fit: whether it converged, and each anchor's own range
        bias. None where it is not to be relied upon.
    """
    located = np.flatnonzero(zone.located & (n_ranges >= solver.min_ranges))
    unknown = np.full(len(anchor_ids), np.nan)
    right = unknown if by_ranges is None else by_ranges.right_probability
    fit = None if by_ranges is None else by_ranges.hypotheses
    same = _meet(zone)
    zone = _one_place_where_both_meet(zone, same)
    hypotheses = _as_hypotheses(zone, located, n_ranges, fit)
    # Where both places are one, the ranges have as little to say of a side as anything else.
    right = np.where(same, 1.0 - zone.left_probability[0], right)[located]
    known = _SceneMixture(zone.scene_probability, 1.0 - zone.left_probability[:, located])

    if facts is None or not len(located):
        choice = choose(known, located, hypotheses)
    else:
        known = replace(known, may_be_said=True)
        placed = np.ones(len(same), dtype=np.bool_) if fit is None else is_well_placed(fit, solver)
        # Where both places are one, what the ranges say of it is the same for both.
        alone = np.where(same[located] & np.isfinite(right), 0.5, right)
        told = (facts, np.where(placed[located], alone, np.nan), placed[located])
        choice = choose_with_facts(known, located, hypotheses, *told)
    choice = _honest(choice, located)
    row = {n: k for k, n in enumerate(located.tolist())}
    anchors = tuple(
        make_fix(
            anchor_id,
            _place(choice, right, row[n], n, fit) if n in row else None,
            int(n_ranges[n]),
            config,
            solver,
        )
        for n, anchor_id in enumerate(anchor_ids)
    )
    combinations = replace(choice.combinations, learned=True)
    return Decision(anchors, combinations, choice.hypotheses, choice.reasons)


@dataclass(frozen=True)
class _SceneMixture:
    """Sides that are independent given either of two scenes."""

    scene: Float64[Array, "2"]
    network_right: Float64[Array, "2 M"]
    """Probability of each anchor's right place in each scene."""
    may_be_said: bool = False
    """Whether a user knows something: then no side is all but impossible."""

    @property
    def right(self) -> Float64[Array, "2 M"]:
        least = _LEAST if self.may_be_said else 0.0
        return np.clip(self.network_right, least, 1.0 - least)

    def unsaid(self) -> _SceneMixture:
        return replace(self, may_be_said=False)

    def second(self) -> Float64[Array, "M"]:
        return np.asarray(self.scene @ self.right)

    def candidates(self) -> Int64[Array, "K M"]:
        likely = _candidates(self.right)
        return np.concatenate([likely, self._not_likely()]) if self.may_be_said else likely

    def drawn(self, count: int) -> Int64[Array, "K M"]:
        rng = np.random.default_rng(0)
        given = (rng.random(count) >= self.scene[0]).astype(np.int64)
        drawn = rng.random((count, self.right.shape[1])) < self.right[given]
        return np.asarray(drawn, dtype=np.int64)

    def log_weight(self, side: Int64[Array, "K M"]) -> Float64[Array, "K"]:
        with np.errstate(divide="ignore"):
            log_right, log_left = np.log(self.right), np.log1p(-self.right)
            log_scene = np.log(self.scene)
        # -inf times 0 must be 0: choose, do not multiply.
        given = np.where(side[:, None] == 1, log_right, log_left).sum(axis=2)  # (K, 2)
        return np.asarray(np.logaddexp(given[:, 0] + log_scene[0], given[:, 1] + log_scene[1]))

    def _not_likely(self) -> Int64[Array, "K M"]:
        """Return combinations that the denoiser holds for unlikely, but a user may know better.

        These are all anchors on one side, and the likeliest sides but for one anchor.
        """
        m = self.right.shape[1]
        flipped = (self.right > 0.5).astype(np.int64)[:, None] ^ np.eye(m, dtype=np.int64)
        uniform = np.repeat(np.array([[0], [1]]), m, axis=1)
        return np.concatenate([flipped.reshape(-1, m), uniform])


def _honest(choice: SideChoice, located: Int64[Array, "M"]) -> SideChoice:
    """Return a choice with covariances along the curves on which places err."""
    side = np.zeros(len(choice.hypotheses.log_odds), dtype=np.int64)
    side[located] = choice.side
    linear_m2 = choice.hypotheses.covariance_m2[np.arange(len(side)), side]
    linear_m2[located] = choice.covariance_m2
    honest_m2 = choice.hypotheses.honest_covariance(linear_m2, side)
    return replace(choice, covariance_m2=honest_m2[located])


def _place(
    choice: SideChoice,
    right: Float64[Array, "M"],
    row: int,
    n: int,
    fit: Hypotheses | None,
) -> ChosenPlace:
    """Return where the located anchor of a row stands; ``right`` is what its ranges alone say."""
    other = 1 - int(choice.side[row])
    return ChosenPlace(
        position_m=choice.place_m[row],
        covariance_m2=choice.covariance_m2[row],
        mirror_position_m=choice.hypotheses.position_m[n, other],
        mirror_covariance_m2=choice.hypotheses.covariance_m2[n, other],
        mirror_probability=float(choice.mirror_probability[row]),
        by_ranges=float(right[row] if other == 1 else 1.0 - right[row]),
        unstated=float(choice.unstated[row]),
        range_bias_m=np.nan if fit is None else float(fit.own_bias_m[n]),
        converged=fit is None or bool(fit.converged[n]),
        fits=fit is None or bool(fit.fits[n]),
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


def _meet(zone: ZonePosterior) -> Bool[Array, "N"]:
    """Return where both places are one, as on a winding path: no side is open."""
    apart_m = zone.place_m[:, 0] - zone.place_m[:, 1]
    return np.asarray(np.hypot(apart_m[:, 0], apart_m[:, 1]) < _ONE_PLACE_M)


def _one_place_where_both_meet(zone: ZonePosterior, same: Bool[Array, "N"]) -> ZonePosterior:
    """Merge both places of some anchors; the one place has the mean and the covariance of both."""
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
    fit: Hypotheses | None,
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
        centre_m=None if fit is None else fit.centre_m,
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
