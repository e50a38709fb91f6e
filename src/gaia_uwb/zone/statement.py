"""One statement of a user about a zone, and whether the ranges contradict it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gaia_uwb._shared import Array, Float64
from gaia_uwb.config import PriorConfig
from gaia_uwb.estimate import Reason, ReasonKind

_CONTRADICTED = 1.0 / 20.0  # Bayes factor below which a statement is reported as wrong


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
    """

    words: str
    setting: str
    log_ratio: Float64[Array, "K"]

    def contradiction(self, weight: Float64[Array, "K"]) -> Reason | None:
        """Return a reason if the ranges contradict it, None if they do not.

        Parameters
        ----------
        weight : (K,)
            The combinations' probabilities from ranges and layout alone.
        """
        factor = self.bayes_factor(weight)
        if factor >= _CONTRADICTED:
            return None
        text = (
            f'the ranges contradict "{self.words}", so it is not used: they are at least '
            f"{1.0 / factor:.0f} times more likely without it"
        )
        return Reason(
            ReasonKind.STATEMENT,
            text,
            statements=(self.setting,),
            numbers={"likelihood_ratio": 1.0 / factor},
        )

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
