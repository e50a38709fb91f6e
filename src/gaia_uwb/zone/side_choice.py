"""From probabilities of combinations of sides to the one that is chosen, and those that may be.

Two things give such probabilities: ranges and neighbours (``neighbour_sides.py``), and what a
denoiser says of a zone (``network_sides.py``). Either way the likeliest combination is chosen, an
anchor's mirror image keeps the probability of all combinations that put the anchor there, and what
a user knows is weighed with them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol, runtime_checkable

import numpy as np

from gaia_uwb._shared import Array, Bool, Float64, Int64
from gaia_uwb.estimate import Reason
from gaia_uwb.locate import Hypotheses
from gaia_uwb.zone.decision import KEPT, Combinations, common_errors_m, kept_combinations
from gaia_uwb.zone.known_facts import KnownFacts

_ENOUGH = 0.9  # probability of the combinations that are kept, else they are drawn
_DRAWN = 2048  # combinations, where something is known that makes some of them likelier
_WORTH = 200.0  # drawn combinations that these must be worth


@runtime_checkable
class SideProbabilities(Protocol):
    """What is known of the sides of M anchors before a user says anything."""

    def second(self) -> Float64[Array, "M"]:
        """Return each anchor's probability of standing at its second place."""
        ...

    def candidates(self) -> Int64[Array, "K M"]:
        """Return combinations among which the likeliest is, and those that may be said."""
        ...

    def log_weight(self, side: Int64[Array, "K M"]) -> Float64[Array, "K"]:
        """Return the log probability of combinations."""
        ...

    def drawn(self, count: int) -> Int64[Array, "K M"]:
        """Draw combinations."""
        ...

    def unsaid(self) -> SideProbabilities:
        """Return what is known where nothing that was said is used."""
        ...


@dataclass(frozen=True)
class SideChoice:
    """Sides of the M located anchors, with what goes with them.

    Parameters
    ----------
    hypotheses
        Both places of all anchors, with what was surveyed of them.
    combinations
        What else the sides may be.
    side : (M,)
        Which place each anchor takes.
    place_m, covariance_m2 : (M, 2), (M, 2, 2)
        Where it stands, in metres, given that side.
    mirror_probability, unstated : (M,)
        Of its other place, by all that is known, and without what a user said.
    reasons
        What speaks against what a user said.
    """

    hypotheses: Hypotheses
    combinations: Combinations
    side: Int64[Array, "M"]
    place_m: Float64[Array, "M 2"]
    covariance_m2: Float64[Array, "M 2 2"]
    mirror_probability: Float64[Array, "M"]
    unstated: Float64[Array, "M"]
    reasons: tuple[Reason, ...] = ()


def choose(
    known: SideProbabilities, located: Int64[Array, "M"], hypotheses: Hypotheses
) -> SideChoice:
    """Choose sides where a user has said nothing.

    Parameters
    ----------
    known
        The probabilities of combinations.
    located : (M,)
        Indices of the anchors that were located.
    hypotheses
        Both places of all anchors.
    """
    side = np.unique(known.candidates(), axis=0)
    log_weight = known.log_weight(side)
    best = side[int(np.argmax(log_weight))]
    if _hold_enough(log_weight):
        combinations = kept_combinations(side, _weight(log_weight), located)
    else:
        combinations = _counted(known.drawn(KEPT), located)
    mirror = _of_the_other(known.second(), best)
    place_m, covariance_m2 = _at(hypotheses, located, best)
    return SideChoice(hypotheses, combinations, best, place_m, covariance_m2, mirror, mirror)


def choose_with_facts(
    known: SideProbabilities,
    located: Int64[Array, "M"],
    hypotheses: Hypotheses,
    facts: KnownFacts,
    by_ranges: Float64[Array, "M"],
    is_placed: Bool[Array, "M"],
) -> SideChoice:
    """Choose sides with what a user said, as far as the ranges do not contradict it.

    Parameters
    ----------
    known, located, hypotheses
        As in :func:`choose`.
    facts
        What was said.
    by_ranges : (M,)
        Probability of each anchor's second place by its ranges alone; NaN where they do not
        determine a place.
    is_placed : (M,)
        Whether each anchor has a place by which a user can be told that it is an exception.
    """
    side = np.unique(known.candidates(), axis=0)
    before = known.log_weight(side)
    holds, reasons = facts.borne_out(hypotheses, located, side, _weight(before), by_ranges)
    if holds is None:
        chosen = choose(known.unsaid(), located, hypotheses)
        return replace(chosen, reasons=reasons)
    used = holds  # mypy forgets in closures that it is not None
    surveyed = used.with_surveys(hypotheses)

    def said(side: Int64[Array, "K M"]) -> Float64[Array, "K"]:
        """Return how much likelier combinations are with all that holds."""
        statements = used.statements(hypotheses, located, side)
        return np.asarray(sum((s.log_ratio for s in statements), np.zeros(len(side))))

    after = before + said(side)
    best = side[int(np.argmax(after))]
    combinations = kept_combinations(side, _weight(after), located)
    if not _hold_enough(before):
        drawn = known.drawn(_DRAWN)
        weight = _weight(said(drawn))
        if weight.sum() ** 2 > _WORTH * (weight**2).sum():
            combinations = _counted(_resampled(drawn, weight), located)
            side, before, after = drawn, np.zeros(len(drawn)), np.log(weight)
    unstated = _of_the_other(known.second(), best)
    log_odds = _log_odds(np.clip(unstated, 1e-12, 1.0 - 1e-12))
    log_odds += _other_side(side, _weight(after), best)
    log_odds -= _other_side(side, _weight(before), best)
    mirror = 1.0 / (1.0 + np.exp(-np.clip(log_odds, -50.0, 50.0)))
    error = facts.prior.statement_error  # where what was said is wrong, it is wrong of all cones
    mirror = (1.0 - error) * mirror + error * unstated
    place_m, covariance_m2 = _at(surveyed, located, best)
    # A spacing says nothing of what moves neighbours alike.
    common_m = common_errors_m(surveyed, located, best)
    common_m2 = common_m @ np.swapaxes(common_m, -1, -2)
    place_m, own_m2 = used.with_spacing(place_m, covariance_m2 - common_m2)
    covariance_m2 = own_m2 + common_m2
    told = (place_m[is_placed], covariance_m2[is_placed], located[is_placed])
    reasons += facts.exceptions(*told, reasons)
    return SideChoice(
        surveyed, combinations, best, place_m, covariance_m2, mirror, unstated, reasons
    )


def _at(
    hypotheses: Hypotheses, located: Int64[Array, "M"], side: Int64[Array, "M"]
) -> tuple[Float64[Array, "M 2"], Float64[Array, "M 2 2"]]:
    return hypotheses.position_m[located, side], hypotheses.covariance_m2[located, side]


def _of_the_other(second: Float64[Array, "M"], side: Int64[Array, "M"]) -> Float64[Array, "M"]:
    """Return the probability of the place that is not taken."""
    return np.clip(np.where(side == 1, 1.0 - second, second), 0.0, 1.0)


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


def _hold_enough(log_weight: Float64[Array, "K"]) -> bool:
    """Tell whether as many combinations as are kept can stand for all."""
    return bool(np.exp(np.sort(log_weight)[-KEPT:]).sum() > _ENOUGH)


def _resampled(side: Int64[Array, "K M"], weight: Float64[Array, "K"]) -> Int64[Array, "_ M"]:
    """Return as many combinations as are kept, at even steps through the weights."""
    edges = np.cumsum(weight) / weight.sum()
    return side[np.searchsorted(edges, (np.arange(KEPT) + 0.5) / KEPT)]


def _counted(drawn: Int64[Array, "K M"], located: Int64[Array, "M"]) -> Combinations:
    side, count = np.unique(drawn, axis=0, return_counts=True)
    return kept_combinations(side, count.astype(np.float64), located)


def _weight(log_weight: Float64[Array, "K"]) -> Float64[Array, "K"]:
    """Return probabilities, scaled so that the largest is 1."""
    return np.asarray(np.exp(log_weight - log_weight.max()))
