"""Decide on which side of the path each anchor stands: jointly, with probabilities.

Ranges along a straight path fit an anchor's mirror image as well as the anchor. One anchor's ranges
may leave the side open; all anchors of a zone together, which stand near each other
(``layout_prior.py``), often settle it. Every combination of sides has an evidence: the likelihoods
of the places it chooses, times how well they form a zone. Up to eight undecided anchors all
combinations are compared; with more, the best is climbed to by single flips from several starts.
The probability of an anchor's mirror image is the share of evidence of the combinations that put
the anchor there. An anchor that stays undecided is called ambiguous.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from gaia_uwb._shared import Array, Bool, Float64, Int64
from gaia_uwb.config import SidesConfig, SolverConfig
from gaia_uwb.estimate import AnchorFix, Reason
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
from gaia_uwb.zone.side_search import SHARED_ERRORS, Search, all_combinations

Known: TypeAlias = Callable[[Int64[Array, "_ _"]], Float64[Array, "_"]]

_ENUMERATE = 8  # undecided anchors of which all combinations are compared
_DECIDED = 12.0  # log odds beyond which the ranges alone decide


def resolve_sides(
    anchor_ids: Sequence[str],
    hypotheses: Hypotheses,
    config: SidesConfig = SidesConfig(),
    solver: SolverConfig = SolverConfig(),
) -> tuple[AnchorFix, ...]:
    """Choose a side for every anchor and say how sure that is; :func:`decide_sides` says more.

    Parameters
    ----------
    anchor_ids
        The anchors' names.
    hypotheses
        Both places of each anchor.
    config
        ``joint`` and ``ambiguous_above``.
    solver
        ``ill_conditioned_above_m``.

    Returns
    -------
    tuple of AnchorFix
        One per anchor, in the order of ``anchor_ids``.
    """
    return decide_sides(anchor_ids, hypotheses, config, solver).anchors


def decide_sides(
    anchor_ids: Sequence[str],
    hypotheses: Hypotheses,
    config: SidesConfig = SidesConfig(),
    solver: SolverConfig = SolverConfig(),
    facts: KnownFacts | None = None,
) -> Decision:
    """Choose a side for every anchor, and keep the combinations of sides that may be instead.

    Parameters
    ----------
    anchor_ids, hypotheses, config, solver
        As in :func:`resolve_sides`.
    facts
        What is known of the zone beforehand; only with ``joint``.
    """
    located = np.flatnonzero(np.isfinite(hypotheses.position_m).all(axis=(1, 2)))
    chosen = _apart(hypotheses)
    reasons: tuple[Reason, ...] = ()
    if config.joint and facts is not None and len(located):
        found, hypotheses, reasons = _with_facts(hypotheses, located, facts)
        chosen, combinations = found.decision(chosen, located)
        ids = [anchor_ids[n] for n in located.tolist()]
        reasons += facts.exceptions(found.place_m, found.covariance_m2, ids, reasons)
    elif config.joint and len(located) > 1:
        chosen, combinations = _jointly(hypotheses, located).decision(chosen, located)
    else:
        combinations = _independent(chosen.mirror_probability[located], located)
    chosen = _honest(hypotheses, chosen)
    anchors = tuple(
        make_fix(
            anchor_id,
            _place(hypotheses, chosen, n),
            int(hypotheses.n_ranges[n]),
            config,
            solver,
        )
        for n, anchor_id in enumerate(anchor_ids)
    )
    return Decision(anchors, combinations, hypotheses, reasons)


@dataclass(frozen=True)
class _Choice:
    """Which hypothesis each anchor takes, with its place, covariance and the other's odds."""

    side: Int64[Array, "N"]
    place_m: Float64[Array, "N 2"]
    covariance_m2: Float64[Array, "N 2 2"]
    mirror_probability: Float64[Array, "N"]
    mirror_covariance_m2: Float64[Array, "N 2 2"]


def _honest(hypotheses: Hypotheses, chosen: _Choice) -> _Choice:
    """Replace the linear covariances, with which sides are compared, by what is reported."""
    other = 1 - chosen.side
    rows = np.arange(len(other))
    return replace(
        chosen,
        covariance_m2=hypotheses.honest_covariance(chosen.covariance_m2, chosen.side),
        mirror_covariance_m2=hypotheses.honest_covariance(
            hypotheses.covariance_m2[rows, other], other
        ),
    )


def _one_place(hypotheses: Hypotheses) -> Bool[Array, "N"]:
    """Return where both hypotheses refined to the same place, so that no side is open."""
    apart = hypotheses.position_m[:, 0] - hypotheses.position_m[:, 1]
    spread = hypotheses.covariance_m2.sum(axis=1)
    distance2 = np.full(len(apart), np.inf)
    located = np.isfinite(apart).all(axis=1)
    solved = np.linalg.solve(spread[located], apart[located, :, None])[..., 0]
    distance2[located] = (apart[located] * solved).sum(axis=1)
    return distance2 < 1.0


def _apart(hypotheses: Hypotheses) -> _Choice:
    """Take each anchor's better-fitting hypothesis."""
    mirror = 1.0 / (1.0 + np.exp(np.minimum(hypotheses.log_odds, 700.0)))
    mirror[_one_place(hypotheses)] = 0.0
    return _Choice(
        side=np.zeros(len(mirror), dtype=np.int64),
        place_m=hypotheses.position_m[:, 0],
        covariance_m2=hypotheses.covariance_m2[:, 0],
        mirror_probability=mirror,
        mirror_covariance_m2=hypotheses.covariance_m2[:, 1],
    )


def _independent(mirror: Float64[Array, "M"], located: Int64[Array, "M"]) -> Combinations:
    """Return combinations of sides that know nothing of each other; many are drawn, not listed."""
    open_sides = np.flatnonzero(mirror > np.exp(-_DECIDED))
    if len(open_sides) <= _ENUMERATE:
        side = all_combinations(len(located), open_sides)
        weight = np.where(side > 0, mirror, 1.0 - mirror).prod(axis=1)
        return kept_combinations(side, weight, located, joint=False)
    drawn = np.random.default_rng(0).random((KEPT, len(located))) < mirror  # all of them are kept
    side, count = np.unique(drawn.astype(np.int64), axis=0, return_counts=True)
    return kept_combinations(side, count.astype(np.float64), located, joint=False)


@dataclass(frozen=True)
class _Comparison:
    """Combinations of sides over the located anchors, compared."""

    side: Int64[Array, "K M"]
    weight: Float64[Array, "K"]
    """Probabilities of all combinations that were considered."""
    best: int
    is_open: Bool[Array, "M"]
    place_m: Float64[Array, "M 2"]
    covariance_m2: Float64[Array, "M 2 2"]
    """Joint places under the best combination."""

    def decision(self, apart: _Choice, located: Int64[Array, "M"]) -> tuple[_Choice, Combinations]:
        """Return the best combination with the probabilities of the others."""
        best = self.side[self.best]
        probability = np.clip((self.weight[:, None] * (self.side != best)).sum(axis=0), 0.0, 1.0)
        # A mirror position that was not considered keeps what its own ranges leave it.
        probability = np.where(self.is_open, probability, apart.mirror_probability[located])
        side, place_m = apart.side.copy(), apart.place_m.copy()
        covariance_m2, mirror = apart.covariance_m2.copy(), apart.mirror_probability.copy()
        side[located], mirror[located] = best, probability
        place_m[located], covariance_m2[located] = self.place_m, self.covariance_m2
        choice = _Choice(side, place_m, covariance_m2, mirror, apart.mirror_covariance_m2)
        return choice, kept_combinations(self.side, self.weight, located, joint=True)


def _jointly(
    hypotheses: Hypotheses, located: Int64[Array, "M"], known: Known | None = None
) -> _Comparison:
    """Compare combinations of sides; ``known`` is the log likelihood of what else is known."""
    odds = hypotheses.log_odds[located]
    open_sides = np.flatnonzero((odds < _DECIDED) & ~_one_place(hypotheses)[located])
    search = Search(
        hypotheses.position_m[located],
        hypotheses.covariance_m2[located],
        odds,
        None if known is None else lambda side: known(side) / SHARED_ERRORS,
    )
    if len(open_sides) <= _ENUMERATE:
        search.look_at(all_combinations(len(located), open_sides))
    else:
        search.climb(open_sides)
    best, evidence, combinations = search.result()
    weight = np.exp(SHARED_ERRORS * (evidence - evidence.max()))
    weight /= weight.sum()
    is_open = np.zeros(len(located), dtype=np.bool_)
    is_open[open_sides] = True
    place_m, covariance_m2 = search.places(combinations[best])
    return _Comparison(combinations, weight, best, is_open, place_m, covariance_m2)


def _with_facts(
    hypotheses: Hypotheses, located: Int64[Array, "M"], facts: KnownFacts
) -> tuple[_Comparison, Hypotheses, tuple[Reason, ...]]:
    """Compare combinations with what is known, as far as the ranges do not contradict it."""
    alone = _jointly(hypotheses, located)
    holds, reasons = facts.borne_out(hypotheses, located, alone.side, alone.weight)
    if holds is None:
        return alone, hypotheses, reasons
    surveyed = holds.with_surveys(hypotheses)
    found = _jointly(
        surveyed,
        located,
        lambda side: np.asarray(
            sum(each.log_ratio for each in holds.statements(hypotheses, located, side))
        ),
    )
    common = SHARED_ERRORS * surveyed.covariance_m2[located, found.side[found.best]]
    place_m, own_m2 = holds.with_spacing(found.place_m, found.covariance_m2 - common)
    found = replace(found, place_m=place_m, covariance_m2=own_m2 + common)
    return found, surveyed, reasons


def _place(hypotheses: Hypotheses, chosen: _Choice, n: int) -> ChosenPlace | None:
    """Return where one anchor stands, or None if its ranges are too few."""
    if not np.isfinite(chosen.place_m[n]).all():
        return None
    return ChosenPlace(
        position_m=chosen.place_m[n],
        covariance_m2=chosen.covariance_m2[n],
        mirror_position_m=hypotheses.position_m[n, 1 - int(chosen.side[n])],
        mirror_covariance_m2=chosen.mirror_covariance_m2[n],
        mirror_probability=float(chosen.mirror_probability[n]),
        range_bias_m=float(hypotheses.own_bias_m[n]),
        converged=bool(hypotheses.converged[n]),
        fits=bool(hypotheses.fits[n]),
    )
