"""How far the ranges of a window are corrected, and how far is plausible.

A network that has memorised some layouts may mistake one for another. Then it moves all ranges of
an anchor together, and farther than the errors that it was trained on ever did; a few wrong ranges
that it corrects move no median. So the largest median correction of a window reveals a mistaken
layout.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gaia_uwb._shared import Array, Bool, Float64
from gaia_uwb.episode import Episode

_LEAST_RANGES = 6  # an anchor with fewer in a window has no median to speak of
_PLAUSIBLE_SHARE, _PLAUSIBLE_TIMES = 0.98, 1.25  # chosen by benchmarks/quality/mistaken_layouts.py


def largest_median_correction_m(
    correction_m: Float64[Array, "T N"], valid: Bool[Array, "T N"]
) -> float:
    """Return the largest of the anchors' median absolute corrections in a window.

    Parameters
    ----------
    correction_m
        Corrected minus measured ranges.
    valid
        Where there is a range.

    Returns
    -------
    float
        In metres; 0 if no anchor has enough ranges.

    Examples
    --------
    >>> correction_m = np.array([[0.0, 1.0]] * 9 + [[50.0, 1.0]])
    >>> largest_median_correction_m(correction_m, np.ones((10, 2), dtype=bool))
    1.0
    """
    medians = [
        np.median(np.abs(own[there]))
        for own, there in zip(correction_m.T, valid.T, strict=True)
        if np.count_nonzero(there) >= _LEAST_RANGES
    ]
    return float(max(medians, default=0.0))


def plausible_correction_m(episodes: Sequence[Episode]) -> float:
    """Return 1.25 times what 98 % of the windows need at most, so that their ranges become true.

    The few that need more are ordinary where errors have a tail, and far beyond all others where a
    radio held a wrong range for seconds; the margin lets nearly all of the former pass and does not
    follow the latter.

    Parameters
    ----------
    episodes
        Windows with their truth, at least one.
    """
    return _PLAUSIBLE_TIMES * float(np.quantile(needed_corrections_m(episodes), _PLAUSIBLE_SHARE))


def needed_corrections_m(episodes: Sequence[Episode]) -> Float64[Array, "K"]:
    """Return each window's largest median correction that makes its ranges true.

    Parameters
    ----------
    episodes
        Windows; those without their truth are skipped.
    """
    return np.array(
        [
            largest_median_correction_m(episode.truth.range_m - episode.range_m, episode.valid)
            for episode in episodes
            if episode.truth is not None
        ]
    )
