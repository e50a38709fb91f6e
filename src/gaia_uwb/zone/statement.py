"""One statement of a user about a zone, and whether the ranges contradict it.

A statement is weighed against the ranges first, with nothing assumed of layouts: it is contradicted
where the ranges of single cones rule it out, or where those of all cones together are 20 times
likelier without it. Then it is weighed against all that is known, where layouts count, too.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gaia_uwb._shared import Array, Float64, some_of
from gaia_uwb.config import PriorConfig
from gaia_uwb.estimate import Reason, ReasonKind

_CONTRADICTED = 1.0 / 20.0  # Bayes factor below which a statement is reported as wrong
_ENOUGH = 1000.0  # times likelier: more is not told, since no model is that right


@dataclass(frozen=True)
class Statement:
    """One thing that was said.

    Parameters
    ----------
    words
        As a reader knows it.
    setting
        Which setting said it, like the keys of :func:`said_words`.
    log_ratio : (K,)
        For each combination of sides, how much likelier it is with the statement than without.
    by_ranges
        If the statement holds at all: the evidence of the ranges alone with it over that without
        it; 1 where they say nothing.
    ruled_out
        Cones whose own ranges alone are enough against it.
    """

    words: str
    setting: str
    log_ratio: Float64[Array, "K"]
    by_ranges: float = 1.0
    ruled_out: tuple[str, ...] = ()

    def contradiction(self, weight: Float64[Array, "K"]) -> Reason | None:
        """Return a reason if it is contradicted, None if it is not.

        Parameters
        ----------
        weight : (K,)
            The combinations' probabilities from ranges and layout alone.
        """
        factor = self.bayes_factor(weight)
        if self.ruled_out or self.by_ranges < _CONTRADICTED:
            who, factor = "the ranges", self.by_ranges
        elif factor < _CONTRADICTED:
            who = "the ranges and the usual layout of work zones"
        else:
            return None
        text = f'{who} contradict "{self.words}", so it is not used: '
        if factor < _CONTRADICTED:
            times = min(1.0 / max(factor, 1e-9), _ENOUGH)
            text += f"they are at least {times:,.0f} times more likely without it"
            numbers = {"likelihood_ratio": times}
        else:
            text += f"those of {some_of(self.ruled_out)} rule it out"
            numbers = {}
        settings = (self.setting,)
        return Reason(ReasonKind.STATEMENT, text, self.ruled_out, (), settings, numbers)

    def bayes_factor(self, weight: Float64[Array, "K"]) -> float:
        """Return the evidence with the statement over that without it.

        Parameters
        ----------
        weight : (K,)
            Probabilities of the combinations without it.
        """
        return float((weight * np.exp(self.log_ratio)).sum() / weight.sum())


def said_words(prior: PriorConfig) -> dict[str, str]:
    """Return what was stated about a zone in words, by setting; each surveyed anchor has its own.

    Parameters
    ----------
    prior
        What was said.

    Examples
    --------
    >>> said_words(PriorConfig(side="left", spacing_m=9.0))
    {'side': 'all cones are on the left', 'spacing_m': 'neighbouring cones are 9 m apart'}
    """
    words = {}
    if prior.side is not None:
        words["side"] = f"all cones are on the {prior.side}"
    if prior.closure is not None and prior.closure != "median-crossover":
        words["closure"] = f"{prior.closure}: all cones are on one side"
    if prior.spacing_m is not None:
        words["spacing_m"] = f"neighbouring cones are {prior.spacing_m:g} m apart"
    for known in prior.known_anchors:
        surveyed = f"{known.anchor_id} is at its surveyed position"
        words[f"known_anchors.{known.anchor_id}"] = surveyed
    return words
