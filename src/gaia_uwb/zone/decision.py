"""What was decided about the sides on which the anchors stand, however it was decided.

Two ways lead here: ``sides.py`` decides by ranges and neighbours, ``network_sides.py`` by what a
denoiser says of the whole zone. Both give a :class:`Decision`, made by :func:`make_fix`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gaia_uwb._shared import Array, Bool, Float64, Int64
from gaia_uwb.config import SidesConfig, SolverConfig
from gaia_uwb.estimate import AnchorFix, AnchorStatus, Reason, SideSource
from gaia_uwb.locate import Hypotheses, square_root

KEPT = 32
"""Combinations that a decision keeps."""
_KEPT_EVIDENCE = 0.999  # or as few as hold this share of the evidence


@dataclass(frozen=True)
class Combinations:
    """Which sides the anchors may stand on, together; the better-founded combinations first.

    Parameters
    ----------
    located : (M,)
        Indices of the anchors that were located.
    side : (K, M)
        Which hypothesis each of them takes in each combination.
    weight : (K,)
        Probabilities; they sum to 1. At most 32 combinations, or as few as hold 99.9 % of the
        evidence.
    learned
        Whether they come from a denoiser that locates anchors itself (``network_sides.py``).
    """

    located: Int64[Array, "M"]
    side: Int64[Array, "K M"]
    weight: Float64[Array, "K"]
    learned: bool = False


def common_errors_m(
    hypotheses: Hypotheses, rows: Int64[Array, "M"], side: Int64[Array, "M"]
) -> Float64[Array, "M 2 S"]:
    """Return how anchors err together: what S independent standard normal numbers move them by.

    Where it is not known, half of the covariance is taken as common: in the outdoor data set about
    half of the residuals' variance is.

    Parameters
    ----------
    hypotheses
        Both places of all anchors.
    rows, side : (M,)
        Which anchors, and which of their places.
    """
    if hypotheses.shared_m is not None:
        return np.asarray(hypotheses.shared_m[rows, side])
    return np.asarray(np.sqrt(0.5) * square_root(hypotheses.covariance_m2[rows, side]))


@dataclass(frozen=True)
class Decision:
    """What was decided about the anchors' sides.

    Parameters
    ----------
    anchors
        One fix per anchor, in the order of ``anchor_ids``.
    combinations
        What else the anchors' sides may be.
    hypotheses
        Both places of each anchor, with what was surveyed of them.
    reasons
        What the ranges say against what was known beforehand, or stated.
    """

    anchors: tuple[AnchorFix, ...]
    combinations: Combinations
    hypotheses: Hypotheses
    reasons: tuple[Reason, ...] = ()


def kept_combinations(
    side: Int64[Array, "K M"], weight: Float64[Array, "K"], located: Int64[Array, "M"]
) -> Combinations:
    """Keep the combinations that matter, the likeliest first.

    Parameters
    ----------
    side : (K, M)
        Combinations of sides.
    weight : (K,)
        Above 0, on any scale.
    located : (M,)
        Indices of the anchors.
    """
    order = np.argsort(-weight, kind="stable")
    share = np.cumsum(weight[order]) / weight.sum()
    order = order[: min(KEPT, int(np.searchsorted(share, _KEPT_EVIDENCE)) + 1)]
    return Combinations(located, side[order], weight[order] / weight[order].sum())


def is_well_placed(hypotheses: Hypotheses, solver: SolverConfig) -> Bool[Array, "N"]:
    """Return which anchors' ranges determine a place, so that they can contradict what was said.

    Parameters
    ----------
    hypotheses
        Both places of each anchor, by its ranges.
    solver
        ``ill_conditioned_above_m``.
    """
    covariance_m2 = np.nan_to_num(hypotheses.covariance_m2[:, 0], nan=np.inf, posinf=np.inf)
    known = np.isfinite(covariance_m2).all(axis=(1, 2))
    widest_m2 = np.full(len(known), np.inf)
    widest_m2[known] = np.linalg.eigvalsh(covariance_m2[known])[:, 1]
    is_narrow = widest_m2 <= solver.ill_conditioned_above_m**2
    return np.asarray(is_narrow & hypotheses.converged & hypotheses.fits)


@dataclass(frozen=True)
class ChosenPlace:
    """The place that was chosen for an anchor, and its mirror image.

    Parameters
    ----------
    position_m : (2,)
        East and north, in metres.
    covariance_m2 : (2, 2)
        Of that place, given that the side is right, in square metres.
    mirror_position_m : (2,)
        The other place.
    mirror_covariance_m2 : (2, 2)
        Of the other place, given that the anchor stands there.
    mirror_probability
        Of the anchor's standing at the other place.
    by_ranges
        The same by its ranges alone; NaN where it is unknown.
    unstated
        The same by all that is known but what a user said.
    range_bias_m
        Own bias of the anchor's ranges, in metres; NaN where none was estimated.
    converged
        Whether the search for the place did.
    fits
        Whether the ranges bear the place out.
    """

    position_m: Float64[Array, "2"]
    covariance_m2: Float64[Array, "2 2"]
    mirror_position_m: Float64[Array, "2"]
    mirror_covariance_m2: Float64[Array, "2 2"]
    mirror_probability: float
    by_ranges: float
    unstated: float
    range_bias_m: float = np.nan
    converged: bool = True
    fits: bool = True


def make_fix(
    anchor_id: str,
    place: ChosenPlace | None,
    n_ranges: int,
    config: SidesConfig,
    solver: SolverConfig,
) -> AnchorFix:
    """Put one anchor's result together and say how far it can be trusted.

    Parameters
    ----------
    anchor_id
        Name of the anchor.
    place
        Where it was found to stand; None if its ranges are too few.
    n_ranges
        Number of usable ranges.
    config
        ``ambiguous_above``.
    solver
        ``ill_conditioned_above_m``.
    """
    if place is None:
        return AnchorFix(
            anchor_id=anchor_id,
            position_m=np.full(2, np.nan),
            covariance_m2=np.full((2, 2), np.nan),
            mirror_position_m=np.full(2, np.nan),
            mirror_probability=0.0,
            status=AnchorStatus.TOO_FEW_RANGES,
            n_ranges=n_ranges,
        )
    return AnchorFix(
        anchor_id=anchor_id,
        position_m=place.position_m,
        covariance_m2=place.covariance_m2,
        mirror_position_m=place.mirror_position_m,
        mirror_probability=place.mirror_probability,
        status=_status_of(place, config, solver),
        n_ranges=n_ranges,
        range_bias_m=place.range_bias_m,
        mirror_covariance_m2=place.mirror_covariance_m2,
        mirror_probability_by_ranges=place.by_ranges,
        side_source=_source_of(place, config.ambiguous_above),
        side_is_open=place.mirror_probability > config.ambiguous_above,
    )


def _source_of(place: ChosenPlace, ambiguous_above: float) -> SideSource:
    """Return what decides the side: the first thing that is enough."""
    if place.mirror_probability > ambiguous_above:
        return SideSource.OPEN
    if place.by_ranges <= ambiguous_above:
        return SideSource.RANGES
    return SideSource.LAYOUT if place.unstated <= ambiguous_above else SideSource.STATEMENT


def _status_of(place: ChosenPlace, config: SidesConfig, solver: SolverConfig) -> AnchorStatus:
    """Return the worst that can be said of a place."""
    if np.linalg.eigvalsh(place.covariance_m2)[1] > solver.ill_conditioned_above_m**2:
        return AnchorStatus.ILL_CONDITIONED
    if not place.converged:
        return AnchorStatus.NOT_CONVERGED
    if not place.fits:
        return AnchorStatus.DOES_NOT_FIT
    if place.mirror_probability > config.ambiguous_above:
        return AnchorStatus.AMBIGUOUS
    return AnchorStatus.OK
