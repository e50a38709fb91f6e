"""What a denoiser knows of work zones, as a prior for what the ranges say.

A network that locates anchors has used their ranges already. So its posterior is divided by what
the ranges say, and only what is left of it, its knowledge of zones, is a prior: in directions in
which the network is surer than the ranges are. How well it thinks it knows ranges does not count:
cones are put down by hand, and where one stands follows from the others to a foot at best. The
places, and what is reported of them, come from the ranges and that prior; a prior that contradicts
the ranges beyond chance is dropped. Then something is wrong with either: the places of such zones
err by more than they say (``benchmarks/quality/contradicted_zones.py``), so it is a reason to doubt
the result.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gaia_uwb._shared import Array, Bool, Float64, some_of
from gaia_uwb.denoised import ZonePosterior
from gaia_uwb.estimate import Reason, ReasonKind
from gaia_uwb.locate import Hypotheses

_BEYOND_CHANCE = 13.8  # squared distance in standard deviations: 99.9 % of two coordinates
_BY_HAND_M = 0.3  # to which a cone's place follows from those of the others, at best
_LARGEST_ODDS = 30.0
_RANGES_DECIDE = 6.9  # odds of a side by the ranges, 1000 to 1, beyond which no prior is asked
_HARDLY = 0.001  # probability that a network gave to what is so: less is beyond chance, 99.9 %


@dataclass(frozen=True)
class ByRanges:
    """What the ranges alone say of anchors that a network locates, too.

    Parameters
    ----------
    hypotheses
        Both places of each, the better-fitting first.
    right_probability : (N,)
        Of the place right of the path; NaN where either has located no anchor.
    """

    hypotheses: Hypotheses
    right_probability: Float64[Array, "N"]


@dataclass(frozen=True)
class Disposed:
    """The zone as the ranges and a network's knowledge have it.

    Parameters
    ----------
    zone
        Places and sides.
    contradicted : (N,)
        Where the network's place of an anchor was dropped.
    side_contradicted : (N,)
        Where the ranges decide for a side that the network held for all but impossible.
    by_ranges
        What the ranges alone say.
    """

    zone: ZonePosterior
    contradicted: Bool[Array, "N"]
    side_contradicted: Bool[Array, "N"]
    by_ranges: ByRanges

    def reasons(self, anchor_ids: Sequence[str]) -> tuple[Reason, ...]:
        """Say where ranges and network contradict each other beyond chance.

        Parameters
        ----------
        anchor_ids
            The anchors' names.
        """
        reasons = []
        for what, where in (("position", self.contradicted), ("side", self.side_contradicted)):
            names = tuple(anchor_ids[n] for n in np.flatnonzero(where).tolist())
            if names:
                text = (
                    f"{some_of(names)}: the ranges contradict the {what} that the network expects "
                    "beyond chance (99.9 %), so it was not used"
                )
                reasons.append(Reason(ReasonKind.UNLIKE_ZONES, text, cones=names))
        return tuple(reasons)


def dispose(zone: ZonePosterior, hypotheses: Hypotheses) -> Disposed:
    """Combine what a network proposes with what the ranges say.

    Parameters
    ----------
    zone
        What the network says of N anchors.
    hypotheses
        Both places of each by its ranges.
    """
    located = zone.located & np.isfinite(hypotheses.position_m).all(axis=(1, 2))
    place_m = np.where(located[:, None, None], hypotheses.position_m, zone.place_m)
    covariance_m2 = np.where(
        located[:, None, None, None], hypotheses.covariance_m2, zone.covariance_m2
    )
    odds = np.stack([np.zeros(len(located)), -hypotheses.log_odds], axis=1)
    swap = _is_crossed(place_m, zone.place_m)
    rows = np.arange(len(located))[:, None]
    order = np.where(swap[:, None], [1, 0], [0, 1])
    place_m, covariance_m2, odds = (
        place_m[rows, order],
        covariance_m2[rows, order],
        odds[rows, order],
    )
    network_m2 = zone.covariance_m2 + _BY_HAND_M**2 * np.eye(2)
    if hypotheses.shared_m is not None:
        # No knowledge of zones says where all cones are together: clock and range bias stay as
        # uncertain as they are.
        shared_m = np.where(located[:, None, None, None], hypotheses.shared_m, 0.0)[rows, order]
        network_m2 = network_m2 + shared_m @ np.swapaxes(shared_m, -1, -2)
    apart = zone.place_m - place_m
    both = network_m2 + covariance_m2
    far = (apart * np.linalg.solve(both, apart[..., None])[..., 0]).sum(axis=-1) > _BEYOND_CHANCE
    contradicted = located & far.all(axis=1)
    fused_m, fused_m2 = _with_prior(place_m, covariance_m2, zone.place_m, network_m2)
    use = (located[:, None] & ~far)[..., None]
    ratio = np.clip(odds[:, 0] - odds[:, 1], -_LARGEST_ODDS, _LARGEST_ODDS)
    decided = located & ((np.abs(ratio) > _RANGES_DECIDE) | contradicted)
    left_by_ranges = 1.0 / (1.0 + np.exp(-ratio))
    left = np.where(decided, left_by_ranges, zone.left_probability)
    network_left = zone.scene_probability @ zone.left_probability
    its_side = np.where(ratio > 0.0, network_left, 1.0 - network_left)
    return Disposed(
        replace(
            zone,
            place_m=np.where(use, fused_m, place_m),
            covariance_m2=np.where(use[..., None], fused_m2, covariance_m2),
            left_probability=left,
        ),
        contradicted,
        decided & (np.abs(ratio) > _RANGES_DECIDE) & (its_side < _HARDLY),
        ByRanges(hypotheses, np.where(located, 1.0 - left_by_ranges, np.nan)),
    )


def _is_crossed(
    one_m: Float64[Array, "N 2 2"], other_m: Float64[Array, "N 2 2"]
) -> Bool[Array, "N"]:
    """Return where the first's second place is the other's first."""

    def apart(a: Array, b: Array) -> Array:
        return np.asarray(((a - b) ** 2).sum(axis=-1))

    straight = apart(one_m, other_m).sum(axis=1)
    return np.asarray(apart(one_m[:, ::-1], other_m).sum(axis=1) < straight)


def _with_prior(
    place_m: Float64[Array, "N 2 2"],
    covariance_m2: Float64[Array, "N 2 2 2"],
    network_m: Float64[Array, "N 2 2"],
    network_m2: Float64[Array, "N 2 2 2"],
) -> tuple[Float64[Array, "N 2 2"], Float64[Array, "N 2 2 2"]]:
    """Fuse places with what a network knows beyond the ranges.

    In the basis in which the ranges' covariance is 1 and the network's is diagonal, v, the network
    is surer where v < 1; what it knows beyond the ranges has the precision 1/v - 1 there.
    """
    root = np.linalg.cholesky(covariance_m2)
    inverse = np.linalg.inv(root)
    value, vector = np.linalg.eigh(inverse @ network_m2 @ np.swapaxes(inverse, -1, -2))
    off = (np.swapaxes(vector, -1, -2) @ inverse @ (network_m - place_m)[..., None])[..., 0]
    value = np.maximum(value, 1e-9)
    sure = value < 1.0
    # Precisions 1 and 1/v - 1 add up to 1/v; the network's mean is v times ranges + (1 - v) prior,
    # so the fused place is where the network has it.
    share = np.where(sure, off, 0.0)
    back = root @ vector
    fused_m = place_m + (back @ share[..., None])[..., 0]
    kept = np.where(sure, value, 1.0)
    return fused_m, back @ (kept[..., None] * np.swapaxes(back, -1, -2))
