"""Scenes that the ranges leave possible: places of all anchors together, drawn from what is known.

A scene is drawn in two steps. A *combination of sides* comes first, with its share of the evidence:
sides are decided jointly, so mirror images are taken together or not at all (``sides.py``). Then
the *places*, normally distributed, with errors of two kinds: what all anchors have in common (clock
offset, range bias, patterns of tags) moves every anchor in its own direction, but by one and the
same draw; the rest is each anchor's own.

An anchor's own errors bend along its circle (``honest_errors.py``); what all have in common moves
them straight: a clock offset shifts cones along the road and brings none nearer to it. Their
``AnchorFix`` tells a covariance that is bent as a whole, so it is no smaller. The numbers come from
a fixed seed, half of them mirrored (antithetic), so one log gives one result.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gaia_uwb._shared import Array, Float64, Int64
from gaia_uwb.locate import Curves, Hypotheses, square_root
from gaia_uwb.zone.decision import Combinations, common_errors_m

_SAMPLES = 512
_FEWEST_SAMPLES = 256
_MOST_PLACES = 200_000  # samples times anchors


@dataclass(frozen=True)
class Scenes:
    """Possible scenes.

    Parameters
    ----------
    place_m : (S, M, 2)
        Places of all located anchors, in metres, in the order of ``Combinations.located``.
    combination : (S,)
        Which combination of sides each was drawn from.
    """

    place_m: Float64[Array, "S M 2"]
    combination: Int64[Array, "S"]


def sample_scenes(
    hypotheses: Hypotheses,
    combinations: Combinations,
    *,
    n_samples: int | None = None,
    seed: int = 0,
) -> Scenes:
    """Draw scenes: possible places of all located anchors together.

    Parameters
    ----------
    hypotheses
        Both places of each anchor.
    combinations
        Which sides they may stand on, from :func:`gaia_uwb.zone.decide_sides`.
    n_samples
        Number of scenes; by default 512, less for more than 390 anchors.
    seed
        One seed gives the same scenes again.

    Returns
    -------
    Scenes
        Each is as likely as any other.
    """
    n_anchors = len(combinations.located)
    if n_samples is None:
        many = _MOST_PLACES // max(n_anchors, 1)
        n_samples = int(np.clip(many, _FEWEST_SAMPLES, _SAMPLES))
    rows = combinations.located
    parts = [_Combination.of(hypotheses, rows, side) for side in combinations.side]
    count = _shares(combinations.weight, n_samples)
    rng = np.random.default_rng(seed)
    drawn = [part.draw(int(n), rng) for part, n in zip(parts, count, strict=True)]
    return Scenes(np.concatenate(drawn), np.repeat(np.arange(len(parts)), count))


@dataclass(frozen=True)
class _Combination:
    """One combination of sides: a normal distribution of scenes."""

    place_m: Float64[Array, "M 2"]
    common_m: Float64[Array, "M 2 S"]
    own_m: Float64[Array, "M 2 2"]
    curves: Curves | None

    @classmethod
    def of(
        cls, hypotheses: Hypotheses, rows: Int64[Array, "M"], side: Int64[Array, "M"]
    ) -> _Combination:
        place_m, mirror_m = (hypotheses.position_m[rows, each] for each in (side, 1 - side))
        covariance_m2 = hypotheses.covariance_m2[rows, side]
        common_m = common_errors_m(hypotheses, rows, side)
        own_m2 = covariance_m2 - common_m @ np.swapaxes(common_m, -1, -2)
        curves = None
        if hypotheses.centre_m is not None:
            curves = Curves.of(place_m, mirror_m, own_m2, hypotheses.centre_m[rows])
        own_m = square_root(own_m2)
        return cls(place_m, common_m, own_m, curves)

    def draw(self, n: int, rng: np.random.Generator) -> Float64[Array, "n M 2"]:
        m, common = len(self.place_m), self.common_m.shape[-1]
        half = rng.standard_normal(((n + 1) // 2, 2 * m + common))
        normal = np.concatenate([half, -half])[:n]
        own_m = np.einsum("mij,smj->smi", self.own_m, normal[:, common:].reshape(n, m, 2))
        common_m = np.einsum("mij,sj->smi", self.common_m, normal[:, :common])
        place_m = self.place_m + own_m if self.curves is None else self.curves.lay(own_m)
        return np.asarray(place_m + common_m)


def _shares(weight: Float64[Array, "C"], n: int) -> Int64[Array, "C"]:
    """Return how many of n samples each component gets: its share, by systematic sampling."""
    edges = np.cumsum(weight) / weight.sum()
    drawn = np.searchsorted(edges, (np.arange(n) + 0.5) / n)
    return np.bincount(np.minimum(drawn, len(weight) - 1), minlength=len(weight))
