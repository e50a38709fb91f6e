"""The result of a kept zone, as one fit of all of its drives would give it."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from gaia_uwb._shared import Array, Float64, Int64, some_of
from gaia_uwb.config import ChangesConfig, PipelineConfig
from gaia_uwb.episode import DriveErrors, Episode
from gaia_uwb.kept.changes import ConeState
from gaia_uwb.kept.state import Folded
from gaia_uwb.locate import (
    ALIKE,
    Disagreement,
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
    changes: ChangesConfig,
) -> Reconstruction:
    """Return the result of a zone whose drives are added up.

    Parameters
    ----------
    zone
        With all of its drives.
    shown
        The passes that are shown with it, and what was found of their errors.
    config, changes
        All settings.
    """
    ordered = sorted(shown, key=lambda each: each[0].name)
    fused = fused_of(zone, [errors for _, errors in ordered], config)
    states = {name: each.state(zone.ended_s, changes) for name, each in zone.watched.items()}
    left = {ConeState.GONE, *([ConeState.SILENT] if changes.silent_cones == "drop" else [])}
    away = {name for name, state in states.items() if state in left}
    fused = _suspected(_without(fused, away), zone, states)
    episodes = [episode for episode, _ in ordered]
    notes = tuple(_notes(states, away))
    episodes[0] = replace(episodes[0], notes=(*episodes[0].notes, *notes))
    result = conclude(episodes, fused, config)
    count = dict(zip(zone.sums.anchor_ids, zone.sums.n_readings.tolist(), strict=True))
    anchors = tuple(replace(fix, n_ranges=count[fix.anchor_id]) for fix in result.anchors)
    return replace(result, anchors=anchors)


def _without(fused: Fused, cones: Collection[str]) -> Fused:
    """Return what is known of other cones."""
    ids = fused.places.anchor_ids
    kept = np.array([name not in cones for name in ids])
    if kept.all():
        return fused

    def of(found: Hypotheses) -> Hypotheses:
        parts = {name: None if each is None else each[kept] for name, each in vars(found).items()}
        return Hypotheses(**parts)  # type: ignore[arg-type]  # each has the type of its own field

    places = replace(
        fused.places,
        anchor_ids=tuple(name for name in ids if name not in cones),
        hypotheses=of(fused.places.hypotheses),
        outliers=fused.places.outliers[kept],
        noise=fused.places.noise[kept],
        own=None,
    )
    return replace(fused, places=places, hypotheses=of(fused.hypotheses))


def _suspected(fused: Fused, zone: Folded, states: Mapping[str, ConeState]) -> Fused:
    """Return the same with the cones that the newest drive to hear them puts elsewhere."""
    apart = []
    for name, state in states.items():
        suspicion = zone.watched[name].suspicion
        if state is ConeState.MAYBE_MOVED and suspicion is not None:
            apart.append(Disagreement(name, suspicion.name, suspicion.distance_m))
    return replace(fused, disagreements=tuple(apart))


def _notes(states: Mapping[str, ConeState], away: Collection[str]) -> Iterator[str]:
    """Say which cones were not heard any more."""
    for state in (ConeState.SILENT, ConeState.GONE):
        names = [name for name, each in states.items() if each is state]
        if names:
            still = "not in the boundary" if set(names) <= set(away) else "still in the boundary"
            yield (
                f"{some_of(names)}: {state.value}: drives that passed did not hear what they "
                f"should have ({still}; an empty battery looks the same as a cone that is gone)"
            )


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
