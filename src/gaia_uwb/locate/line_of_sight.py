r"""Which readings had a line of sight: a hidden Markov chain for each cone in each drive.

A truck that drives past between vehicle and cone hides the cone for a second or two, so readings
without line of sight come in stretches. Were each taken by itself, twelve of them in a row would
seem twelve times as unlikely as they are, and a cone that was hidden just when the vehicle passed
it would be put too far from the path, with certainty.

A reading is visible or hidden. Visible ones err by Student-t noise; hidden ones are too long by
something like a metre, rarely too short, or not of this cone at all. From one reading to the next,
``dt`` later, the state stays with probability ``exp(-dt / 1.5 s)``, and is else drawn anew.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import lgamma, log, pi

import numpy as np

from gaia_uwb._shared import Array, Float64, Int64
from gaia_uwb.locate._sight import smooth

DEGREES = 4.0
"""Degrees of freedom of the noise's Student-t distribution."""
_LOG_T = lgamma((DEGREES + 1) / 2) - lgamma(DEGREES / 2) - 0.5 * log(DEGREES * pi)
# Scales of what hidden readings are too long by, and how common they are; the second is for
# readings that are not of this cone at all.
_TOO_LONG_M, _COMMON = np.array([1.0, 50.0]), np.array([0.9, 0.1])
_TOO_SHORT = 0.1  # share of the hidden readings that are too short instead
_KEPT_S = 1.5  # how long a line of sight, or none, lasts
_LIKE_BEFORE = 0.7  # share of the hidden readings that err like the hidden one before
_APART_S = 0.1  # of readings whose noise is as correlated as stated
_MOST_ALIKE = 0.98  # no reading only repeats the one before
_NEIGHBOURS_S = 0.3  # readings closer than this tell how correlated the noise is
_DRIFT_M = 0.2  # what they differ by after a long time


@dataclass(frozen=True)
class Sight:
    """What is found of the lines of sight of R readings.

    Parameters
    ----------
    visible : (R,)
        Probability that the reading had a line of sight.
    loss : (R,)
        Negative log density of each reading, given those before it in its chain.
    information : (R,)
        What a reading adds, as a share of what one would add whose noise is independent.
    products, squares : (R,)
        Of visible readings and those before them, as far as they are neighbours: the product of
        both residuals, and the mean of their squares, over the noise's.
    """

    visible: Float64[Array, "R"]
    loss: Float64[Array, "R"]
    information: Float64[Array, "R"]
    products: Float64[Array, "R"]
    squares: Float64[Array, "R"]


class SightChains:
    """The chains of some readings.

    Parameters
    ----------
    chain : (R,)
        Which chain each reading belongs to.
    t_s : (R,)
        When it was taken.

    Examples
    --------
    Of two residuals of three times the noise, the one amid hidden readings is hidden as well:

    >>> chains = SightChains(np.zeros(7, dtype=np.int64), 0.1 * np.arange(7.0))
    >>> residual_m = np.array([0.0, 0.15, 0.0, 0.0, 0.9, 0.15, 0.7])
    >>> sight = chains.solve(residual_m, np.full(7, 0.05), np.full(7, 0.1), np.zeros(7))
    >>> [round(float(p), 1) for p in sight.visible[[1, 5]]]
    [1.0, 0.0]
    """

    def __init__(self, chain: Int64[Array, "R"], t_s: Float64[Array, "R"]) -> None:
        self._order = np.lexsort((t_s, chain))
        chain, t_s = chain[self._order], t_s[self._order]
        after_s = np.full(len(chain), np.inf)
        after_s[1:] = np.where(np.diff(chain) == 0, np.diff(t_s), np.inf)
        self._after = after_s / _APART_S
        self._neighbours = after_s < _NEIGHBOURS_S
        self._same = same = np.exp(-after_s / _KEPT_S)
        # What a hidden reading's error may have drifted by since the reading before.
        self._drift2_m2 = 2.0 * _DRIFT_M**2 * (1.0 - same)

    def solve(
        self,
        residual_m: Float64[Array, "R"],
        sigma_m: Float64[Array, "R"],
        share: Float64[Array, "R"],
        alike: Float64[Array, "R"],
    ) -> Sight:
        """Tell which readings had a line of sight.

        Parameters
        ----------
        residual_m, sigma_m : (R,)
            How much longer each reading is than expected, and its noise.
        share : (R,)
            Share of hidden readings where nothing is known of those before.
        alike : (R,)
            Correlation of the noise of readings that are 0.1 s apart.
        """
        order = self._order
        left_m, noise_m, share = residual_m[order], sigma_m[order], share[order]
        size_m = np.abs(left_m)[..., None] / _TOO_LONG_M
        density = (_COMMON * np.exp(-size_m) / _TOO_LONG_M).sum(axis=-1)
        density *= np.where(left_m > 0.0, 1.0 - _TOO_SHORT, _TOO_SHORT)
        fresh = np.log(np.maximum(density, 1e-300))
        before_m = np.concatenate([[0.0], left_m[:-1]])
        like = _log_student(left_m - before_m, np.sqrt(2.0 * noise_m**2 + self._drift2_m2))
        still_hidden = np.logaddexp(log(_LIKE_BEFORE) + like, log(1.0 - _LIKE_BEFORE) + fresh)
        known = share > 0.0
        fresh, still_hidden = (np.where(known, x, -np.inf) for x in (fresh, still_hidden))
        alike = np.minimum(alike[order] ** self._after, _MOST_ALIKE)
        visible = _log_student(left_m, noise_m)
        new_m = noise_m * np.sqrt(1.0 - alike**2)
        still_visible = _log_student(left_m - alike * before_m, new_m)
        hidden, evidence, *work = np.empty((4, len(order)))
        smooth(
            visible, still_visible, fresh, still_hidden, share, self._same, hidden, evidence, *work
        )
        seen = 1.0 - hidden
        both = self._neighbours * seen * np.concatenate([[0.0], seen[:-1]])
        pair = left_m / noise_m, before_m / noise_m
        far2 = (pair[0] ** 2 + pair[1] ** 2 - 2.0 * alike * pair[0] * pair[1]) / (1.0 - alike**2)
        both *= (DEGREES + 2.0) / (DEGREES + far2)  # of a Student-t distribution of pairs
        information = (1.0 - alike) / (1.0 + alike)
        products, squares = both * pair[0] * pair[1], 0.5 * both * (pair[0] ** 2 + pair[1] ** 2)
        back = np.empty_like(order)
        back[order] = np.arange(len(order))
        columns = (seen, -evidence, information, products, squares)
        return Sight(*(column[back] for column in columns))


def _log_student(left_m: Float64[Array, "R"], scale_m: Float64[Array, "R"]) -> Float64[Array, "R"]:
    bend = 0.5 * (DEGREES + 1.0) * np.log1p((left_m / scale_m) ** 2 / DEGREES)
    return np.asarray(_LOG_T - bend - np.log(scale_m))
