"""From what a denoiser says of a zone to one fix per anchor, and the sides that may be instead.

The counterpart of ``sides.py`` for denoisers that locate anchors themselves
(:class:`~gaia_uwb.zone_posterior.ZonePosterior`): the likeliest combination of sides is chosen, and
an anchor's mirror image keeps the probability of all combinations that put the anchor there.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Sequence

import numpy as np

from gaia_uwb._typing import Array, Bool, Float64, Int64
from gaia_uwb.config import SidesConfig, SolverConfig
from gaia_uwb.estimate import AnchorFix, AnchorStatus
from gaia_uwb.locate import Hypotheses
from gaia_uwb.sides import Decision, kept_combinations
from gaia_uwb.zone_posterior import ZonePosterior

_LOOKED_AT = 128  # likeliest combinations under each hypothesis


def decide_zone(
    anchor_ids: Sequence[str],
    zone: ZonePosterior,
    n_ranges: Int64[Array, "N"],
    config: SidesConfig = SidesConfig(),
    solver: SolverConfig = SolverConfig(),
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
    """
    located = np.flatnonzero(zone.located & (n_ranges >= solver.min_ranges))
    right = 1.0 - zone.left_probability[:, located]  # (2, M)
    side = _candidates(right)
    weight = _weight(zone.scene_probability, right, side)
    combinations = kept_combinations(side, weight, located, joint=False)
    chosen = np.zeros(len(anchor_ids), dtype=np.int64)
    chosen[located] = combinations.side[0]
    marginal = zone.scene_probability @ right
    mirror = np.where(combinations.side[0] == 1, 1.0 - marginal, marginal)
    probability = np.zeros(len(anchor_ids))
    probability[located] = np.clip(mirror, 0.0, 1.0)
    there = np.zeros(len(anchor_ids), dtype=np.bool_)
    there[located] = True
    anchors = []
    for n, anchor_id in enumerate(anchor_ids):
        own, other = int(chosen[n]), 1 - int(chosen[n])
        covariance_m2 = zone.covariance_m2[n, own]
        status = AnchorStatus.OK
        if not there[n]:
            status = AnchorStatus.TOO_FEW_RANGES
        elif np.linalg.eigvalsh(covariance_m2)[1] > solver.ill_conditioned_above_m**2:
            status = AnchorStatus.ILL_CONDITIONED
        elif probability[n] > config.ambiguous_above:
            status = AnchorStatus.AMBIGUOUS
        nowhere = np.full(2, np.nan)
        anchors.append(
            AnchorFix(
                anchor_id=anchor_id,
                position_m=zone.place_m[n, own] if there[n] else nowhere,
                covariance_m2=covariance_m2,
                mirror_position_m=zone.place_m[n, other] if there[n] else nowhere,
                mirror_probability=float(probability[n]),
                status=status,
                n_ranges=int(n_ranges[n]),
                mirror_covariance_m2=zone.covariance_m2[n, other],
            )
        )
    return Decision(tuple(anchors), combinations, _as_hypotheses(zone, there, n_ranges))


def _as_hypotheses(
    zone: ZonePosterior, there: Bool[Array, "N"], n_ranges: Int64[Array, "N"]
) -> Hypotheses:
    """Return both places as those who draw possible scenes expect them: left first, then right."""
    n = len(n_ranges)
    return Hypotheses(
        position_m=np.where(there[:, None, None], zone.place_m, np.nan),
        covariance_m2=zone.covariance_m2,
        log_odds=np.zeros(n),
        own_bias_m=np.zeros(n),
        n_ranges=n_ranges,
        converged=np.ones(n, dtype=np.bool_),
    )


def _candidates(right: Float64[Array, "2 M"]) -> Int64[Array, "K M"]:
    """Return the likeliest combinations under each hypothesis."""
    return np.unique(np.concatenate([_likeliest(own, _LOOKED_AT) for own in right]), axis=0)


def _likeliest(right: Float64[Array, "M"], count: int) -> Int64[Array, "K M"]:
    """Return the likeliest combinations of independent sides, the best first.

    Next to the best are those with other sides for the anchors where that costs least: with the
    costs in order, every set of anchors has exactly one parent in which its last anchor is left
    out or is the one before, and no parent costs more. So a heap finds them in their order.
    """
    with np.errstate(divide="ignore"):
        cost = np.abs(np.log(right) - np.log1p(-right))
    order = np.argsort(cost, kind="stable")
    costs = cost[order].tolist()
    best = (right > 0.5).astype(np.int64)
    found = [best]
    heap: list[tuple[float, tuple[int, ...]]] = [(costs[0], (0,))] if costs else []
    while heap and len(found) < count and math.isfinite(heap[0][0]):
        total, flipped = heapq.heappop(heap)
        side = best.copy()
        side[order[list(flipped)]] ^= 1
        found.append(side)
        last = flipped[-1]
        if last + 1 < len(costs):
            heapq.heappush(heap, (total + costs[last + 1], (*flipped, last + 1)))
            moved = total - costs[last] + costs[last + 1]
            heapq.heappush(heap, (moved, (*flipped[:-1], last + 1)))
    return np.stack(found)


def _weight(
    scene: Float64[Array, "2"], right: Float64[Array, "2 M"], side: Int64[Array, "K M"]
) -> Float64[Array, "K"]:
    """Return each combination's probability, scaled so that the largest is 1."""
    with np.errstate(divide="ignore"):
        log_right, log_left, log_scene = np.log(right), np.log1p(-right), np.log(scene)
    # -inf times 0 must be 0: choose, do not multiply.
    given = np.where(side[:, None] == 1, log_right, log_left).sum(axis=2)  # (K, 2)
    total = np.logaddexp(given[:, 0] + log_scene[0], given[:, 1] + log_scene[1])
    return np.asarray(np.exp(total - total.max()))
