"""Scenes that the ranges leave possible: places of all anchors together, drawn from what is known.

A scene is drawn in three steps. A *combination of sides* comes first, with its share of the
evidence: sides are decided jointly, so mirror images are taken together or not at all
(``sides.py``). Then a *shape and size* of the zone under that combination (``layout_prior.py``).
Then the *places*, normally distributed about their best values, with errors of three kinds:

- what the joint decision leaves each anchor, and the zone's centre, which none knows;
- of the half of the covariance that is common: what the calibrated range bias and the clock offset
  may still be off, which moves every anchor in its own direction but by one and the same draw
  (``Hypotheses.shared_m``);
- the rest of that half, the trajectory's errors, one draw of which moves all anchors together.

Each anchor's draws have the covariance that its ``AnchorFix`` tells. The numbers come from a fixed
seed, half of them mirrored (antithetic), so one log gives one result.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gaia_uwb._shared import Array, Float64, Int64
from gaia_uwb.locate import Curves, Hypotheses, square_root
from gaia_uwb.zone.decision import Combinations
from gaia_uwb.zone.layout_prior import SHARED_ERRORS, joint_places

_SAMPLES = 512
_FEWEST_SAMPLES = 256
_MOST_PLACES = 200_000  # samples times anchors
_NEGLIGIBLE = 1e-3  # a shape and size with less weight is left out


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
    parts = _components(hypotheses, combinations)
    count = _shares(np.array([part.weight for part in parts]), n_samples)
    rng = np.random.default_rng(seed)
    drawn = [part.draw(int(n), rng) for part, n in zip(parts, count, strict=True)]
    combination = np.array([part.combination for part in parts], dtype=np.int64)
    return Scenes(np.concatenate(drawn), np.repeat(combination, count))


class _Component:
    """One combination of sides under one shape and size: a normal distribution of scenes."""

    def __init__(
        self,
        combination: int,
        weight: float,
        place_m: Float64[Array, "M 2"],
        own_m2: Float64[Array, "M 2 2"],
        pull_per_m2: Float64[Array, "2 2"],
        errors: _Errors,
    ) -> None:
        self.combination, self.weight = combination, weight
        self._place_m = place_m
        self._own_m = square_root(own_m2)
        self._centre_m = own_m2 @ square_root(pull_per_m2)
        self._errors = errors

    def draw(self, n: int, rng: np.random.Generator) -> Float64[Array, "n M 2"]:
        m = len(self._place_m)
        alike = np.concatenate(
            [self._centre_m, self._errors.shared_m, self._errors.frame_m], axis=-1
        )
        common = alike.shape[-1]
        half = rng.standard_normal(((n + 1) // 2, 2 * m + common))
        normal = np.concatenate([half, -half])[:n]
        own = np.einsum("mij,smj->smi", self._own_m, normal[:, common:].reshape(n, m, 2))
        offset_m = own + np.einsum("mij,sj->smi", alike, normal[:, :common])
        curves = self._errors.curves
        if curves is None:
            return np.asarray(self._place_m + offset_m)
        return replace(curves, position_m=self._place_m).lay(offset_m)


@dataclass(frozen=True)
class _Errors:
    """What is known of the errors of one combination's places besides the joint decision."""

    shared_m: Float64[Array, "M 2 S"]
    frame_m: Float64[Array, "M 2 2"]
    curves: Curves | None

    @classmethod
    def of(
        cls, hypotheses: Hypotheses, rows: Int64[Array, "M"], side: Int64[Array, "M"]
    ) -> _Errors:
        covariance_m2 = hypotheses.covariance_m2[rows, side]
        shared_m = np.zeros((len(rows), 2, 0))
        if hypotheses.shared_m is not None:
            shared_m = hypotheses.shared_m[rows, side]
        frame_m = square_root(covariance_m2 - shared_m @ np.swapaxes(shared_m, -1, -2))
        curves = None
        if hypotheses.centre_m is not None:
            place_m, mirror_m = (hypotheses.position_m[rows, each] for each in (side, 1 - side))
            curves = Curves.of(place_m, mirror_m, covariance_m2, hypotheses.centre_m[rows])
        return cls(
            shared_m=np.sqrt(SHARED_ERRORS) * shared_m,
            frame_m=np.sqrt(SHARED_ERRORS) * frame_m,
            curves=curves,
        )


def _components(hypotheses: Hypotheses, combinations: Combinations) -> list[_Component]:
    rows = combinations.located
    place_m = hypotheses.position_m[rows, combinations.side]  # (K, M, 2)
    own_m2 = (1.0 - SHARED_ERRORS) * hypotheses.covariance_m2[rows, combinations.side]
    errors = [_Errors.of(hypotheses, rows, side) for side in combinations.side]
    if not combinations.joint:
        return [
            _Component(k, float(weight), place_m[k], own_m2[k], np.zeros((2, 2)), errors[k])
            for k, weight in enumerate(combinations.weight)
        ]
    joint = joint_places(place_m, own_m2)
    weight = np.exp(joint.log_evidence - joint.log_evidence.max(axis=1, keepdims=True))
    weight *= (combinations.weight / weight.sum(axis=1))[:, None]
    return [
        _Component(
            int(k),
            float(weight[k, size]),
            joint.place_m[k, size],
            joint.own_m2[k, size],
            joint.pull_per_m2[k, size],
            errors[k],
        )
        for k, size in np.argwhere(weight > _NEGLIGIBLE)
    ]


def _shares(weight: Float64[Array, "C"], n: int) -> Int64[Array, "C"]:
    """Return how many of n samples each component gets: its share, by systematic sampling."""
    edges = np.cumsum(weight) / weight.sum()
    drawn = np.searchsorted(edges, (np.arange(n) + 0.5) / n)
    return np.bincount(np.minimum(drawn, len(weight) - 1), minlength=len(weight))
