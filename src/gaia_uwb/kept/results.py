"""The result of a kept zone, as one fit of all of its drives would give it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gaia_uwb._shared import Array, Float64, Int64
from gaia_uwb.config import PipelineConfig
from gaia_uwb.episode import DriveErrors, Episode
from gaia_uwb.kept.folds import Folded
from gaia_uwb.locate import (
    ALIKE,
    Fused,
    Hypotheses,
    ZonePlaces,
    error_scale2,
    fits,
    with_scatter,
)
from gaia_uwb.pipeline import conclude
from gaia_uwb.reconstruction import Reconstruction


def folded_result(
    zone: Folded,
    shown: Sequence[tuple[Episode, DriveErrors]],
    config: PipelineConfig,
) -> Reconstruction:
    """Return the result of a zone whose drives are added up.

    Parameters
    ----------
    zone
        With all of its drives.
    shown
        The passes that are shown with it, and what was found of their errors.
    config
        All settings.
    """
    ordered = sorted(shown, key=lambda each: each[0].name)
    fused = fused_of(zone, [errors for _, errors in ordered], config)
    result = conclude([episode for episode, _ in ordered], fused, config)
    count = dict(zip(zone.sums.anchor_ids, zone.sums.n_readings.tolist(), strict=True))
    anchors = tuple(replace(fix, n_ranges=count[fix.anchor_id]) for fix in result.anchors)
    return replace(result, anchors=anchors)


def fused_of(zone: Folded, errors: Sequence[DriveErrors], config: PipelineConfig) -> Fused:
    """Return what all drives say of the cones, in the form of a fit of several passes.

    Parameters
    ----------
    zone
        With all of its drives.
    errors
        Of the passes that are shown.
    config
        ``solver.position_floor_m`` is used.
    """
    sums, estimates = zone.sums, zone.estimates
    hypotheses, order = _hypotheses(zone, config)
    rows = np.arange(len(order))[:, None]
    outliers, noise = (values[rows, order][:, 0] for values in _quality(zone))
    places = ZonePlaces(
        sums.anchor_ids, hypotheses, tuple(errors), outliers, noise, own=estimates.own[rows, order]
    )
    scatter = zone.scatter.of(sums.anchor_ids, order[:, 0])
    scale2 = error_scale2([each for each in scatter if each is not None])
    return Fused(places, with_scatter(hypotheses, scatter, scale2), (), scale2**0.5)


def _quality(zone: Folded) -> tuple[Float64[Array, "N 2"], Float64[Array, "N 2"]]:
    """Return the shares of outliers, and the others' mean squares, of each cone on each side."""
    count = np.maximum(zone.sums.count, 1.0)[:, None]
    inliers = np.maximum(count - zone.sums.outliers, 1.0)
    return zone.sums.outliers / count, zone.sums.squares / inliers


def _hypotheses(zone: Folded, config: PipelineConfig) -> tuple[Hypotheses, Int64[Array, "N 2"]]:
    """Return both places of each cone, and in which order: the better-fitting first."""
    sums, estimates = zone.sums, zone.estimates
    located = sums.n_ranges >= config.solver.min_ranges
    # To a millionth: of two sides that fit alike, the order must not hang on rounding.
    order = np.argsort(estimates.loss.round(6), axis=1, kind="stable")
    rows = np.arange(len(order))[:, None]
    floor_m2 = config.solver.position_floor_m**2 * np.eye(2)
    covariance_m2 = estimates.places_m2[rows, order] + floor_m2
    covariance_m2[~located] = np.nan
    own = estimates.own[rows, order]
    outliers, noise = (values[rows, order][:, 0] for values in _quality(zone))
    does_fit = fits(estimates.sizes, outliers, noise, own[:, 0, 2])
    found = Hypotheses(
        position_m=np.where(located[:, None, None], own[..., :2], np.nan),
        covariance_m2=covariance_m2,
        log_odds=np.where(located, np.ptp(estimates.loss, axis=1) / ALIKE, 0.0),
        own_bias_m=np.where(located, own[:, 0, 2], 0.0),
        n_ranges=sums.n_ranges,
        converged=np.ones(len(located), dtype=np.bool_),
        fits=~located | does_fit,
        shared_m=estimates.shared_m[rows, order],
        centre_m=sums.centre_m,
    )
    return found, order
