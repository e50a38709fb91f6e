"""Decide on which side of the path each anchor stands: jointly, with probabilities.

Ranges along a straight path fit an anchor's mirror image as well as the anchor. One anchor's ranges
may leave the side open; all anchors of a zone together, of which neighbours stand alike
(``neighbour_sides.py``), often settle it. The likeliest combination of sides is chosen, and an
anchor's mirror image keeps the probability of all combinations that put the anchor there. An anchor
that stays undecided is called ambiguous.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

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
    is_well_placed,
    kept_combinations,
    make_fix,
)
from gaia_uwb.zone.known_facts import KnownFacts
from gaia_uwb.zone.neighbour_sides import NeighbourSides
from gaia_uwb.zone.path_sides import PathSides
from gaia_uwb.zone.side_choice import SideChoice, choose, choose_with_facts

_LISTED = 8  # undecided anchors of which all combinations are listed
_DECIDED = 12.0  # log odds beyond which the ranges alone decide
_DRAWN = 2048  # combinations, where more are undecided


def resolve_sides(
    anchor_ids: Sequence[str],
    hypotheses: Hypotheses,
    path_m: Float64[Array, "T 2"],
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
    path_m : (T, 2)
        The path of the drive, or of one of several, in the direction of travel, in metres.
    config
        ``joint`` and ``ambiguous_above``.
    solver
        ``ill_conditioned_above_m``.

    Returns
    -------
    tuple of AnchorFix
        One per anchor, in the order of ``anchor_ids``.
    """
    return decide_sides(anchor_ids, hypotheses, path_m, config, solver).anchors


def decide_sides(
    anchor_ids: Sequence[str],
    hypotheses: Hypotheses,
    path_m: Float64[Array, "T 2"],
    config: SidesConfig = SidesConfig(),
    solver: SolverConfig = SolverConfig(),
    facts: KnownFacts | None = None,
) -> Decision:
    """Choose a side for every anchor, and keep the combinations of sides that may be instead.

    Parameters
    ----------
    anchor_ids, hypotheses, path_m, config, solver
        As in :func:`resolve_sides`.
    facts
        What is known of the zone beforehand; only with ``joint``.
    """
    located = np.flatnonzero(np.isfinite(hypotheses.position_m).all(axis=(1, 2)))
    chosen = _apart(hypotheses)
    reasons: tuple[Reason, ...] = ()
    if config.joint and len(located):
        found = _jointly(hypotheses, located, path_m, solver, facts)
        chosen = chosen.of(found, located, _one_place(hypotheses))
        combinations, hypotheses, reasons = found.combinations, found.hypotheses, found.reasons
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
    by_ranges: Float64[Array, "N"]
    """Probability of the other place by the anchor's own ranges alone."""
    unstated: Float64[Array, "N"]
    """The same by ranges and neighbours, without what a user said."""
    mirror_covariance_m2: Float64[Array, "N 2 2"]

    def of(
        self, found: SideChoice, located: Int64[Array, "M"], one_place: Bool[Array, "N"]
    ) -> _Choice:
        """Return what was found of the located anchors; ``self`` takes the first places."""
        side, place_m, covariance_m2 = self.side.copy(), self.place_m.copy(), self.covariance_m2
        side[located], place_m[located] = found.side, found.place_m
        covariance_m2 = covariance_m2.copy()
        covariance_m2[located] = found.covariance_m2
        mirror, unstated = self.mirror_probability.copy(), self.unstated.copy()
        mirror[located], unstated[located] = found.mirror_probability, found.unstated
        return replace(
            self,
            side=side,
            place_m=place_m,
            covariance_m2=covariance_m2,
            mirror_probability=np.where(one_place, 0.0, mirror),
            by_ranges=np.where((side == 1) & ~one_place, 1.0 - self.by_ranges, self.by_ranges),
            unstated=np.where(one_place, 0.0, unstated),
        )


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
        by_ranges=mirror,
        unstated=mirror,
        mirror_covariance_m2=hypotheses.covariance_m2[:, 1],
    )


def _independent(mirror: Float64[Array, "M"], located: Int64[Array, "M"]) -> Combinations:
    """Return combinations of sides that know nothing of each other; many are drawn, not listed."""
    open_sides = np.flatnonzero(mirror > np.exp(-_DECIDED))
    if len(open_sides) <= _LISTED:
        side = _all_combinations(len(located), open_sides)
        weight = np.where(side > 0, mirror, 1.0 - mirror).prod(axis=1)
        return kept_combinations(side, weight, located)
    drawn = np.random.default_rng(0).random((KEPT, len(located))) < mirror  # all of them are kept
    side, count = np.unique(drawn.astype(np.int64), axis=0, return_counts=True)
    return kept_combinations(side, count.astype(np.float64), located)


def _all_combinations(n: int, open_sides: Int64[Array, "M"]) -> Int64[Array, "K N"]:
    """Return all combinations of sides of n anchors in which only some sides are open."""
    bits = (np.arange(1 << len(open_sides))[:, None] >> np.arange(len(open_sides))) & 1
    combinations = np.zeros((len(bits), n), dtype=np.int64)
    combinations[:, open_sides] = bits
    return combinations


@dataclass(frozen=True)
class _Known:
    """What ranges and neighbours say of the sides of M anchors."""

    neighbours: NeighbourSides
    is_open: Bool[Array, "M"]
    """Whether both places are to be considered."""
    left: Bool[Array, "M 2"]
    """Whether each place is left of the path."""

    def second(self) -> Float64[Array, "M"]:
        return self.neighbours.second()

    def log_weight(self, side: Int64[Array, "K M"]) -> Float64[Array, "K"]:
        return self.neighbours.log_weight(side)

    def drawn(self, count: int) -> Int64[Array, "K M"]:
        return self.neighbours.drawn(count)

    def unsaid(self) -> _Known:
        return self

    def candidates(self) -> Int64[Array, "K M"]:
        """Return all combinations of a few open anchors, or those that are likely or may be said.

        A user may say that all are on one side, or know better of a single anchor.
        """
        n, open_sides = len(self.is_open), np.flatnonzero(self.is_open)
        if len(open_sides) <= _LISTED:
            return _all_combinations(n, open_sides)
        likeliest = self.neighbours.likeliest()
        best = likeliest[int(np.argmax(self.log_weight(likeliest)))]
        flips = np.eye(n, dtype=np.int64)[open_sides]
        all_left = np.where(self.is_open & ~self.left[:, 0] & self.left[:, 1], 1, 0)
        all_right = np.where(self.is_open & self.left[:, 0] & ~self.left[:, 1], 1, 0)
        return np.concatenate([likeliest, best ^ flips, [all_left, all_right], self.drawn(_DRAWN)])


def _jointly(
    hypotheses: Hypotheses,
    located: Int64[Array, "M"],
    path_m: Float64[Array, "T 2"],
    solver: SolverConfig,
    facts: KnownFacts | None,
) -> SideChoice:
    """Choose the sides of all located anchors together."""
    neighbours = NeighbourSides.of(hypotheses, located, path_m)
    left = PathSides(path_m).are_left(hypotheses.position_m[located].reshape(-1, 2))
    odds = hypotheses.log_odds[located]
    known = _Known(neighbours, odds < _DECIDED, left.reshape(-1, 2))

    if facts is None:
        return choose(known, located, hypotheses)
    by_ranges = 1.0 / (1.0 + np.exp(np.minimum(odds, 700.0)))
    is_placed = is_well_placed(hypotheses, solver)[located]
    by_ranges[~is_placed] = np.nan
    return choose_with_facts(known, located, hypotheses, facts, by_ranges, is_placed)


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
        by_ranges=float(chosen.by_ranges[n]),
        unstated=float(chosen.unstated[n]),
        range_bias_m=float(hypotheses.own_bias_m[n]),
        converged=bool(hypotheses.converged[n]),
        fits=bool(hypotheses.fits[n]),
    )
