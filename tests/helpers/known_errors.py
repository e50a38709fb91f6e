"""Drives past cones, with readings at their own times and errors of known kinds and sizes.

The errors are those that the estimator assumes (``locate/zone_fit.py``), drawn by code of its own.

>>> drive = make_drive(u_turn(), CONES_M, seed=1)
>>> drive.n_anchors, len(drive.own_times.t_s)
(6, 1410)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gaia_uwb.episode import ClockOffset, Episode, RangeReadings
from gaia_uwb.scene import Trajectory

Numbers = NDArray[np.float64]

CONES_M = np.array([[-18.0, 6.5], [-8.0, 5.0], [2.0, 6.0], [11.0, 5.5], [19.0, 7.0], [26.0, 4.0]])
"""Cones inside and outside of the path that :func:`u_turn` gives."""
SCALES_M = (1.0, 4.0, 16.0, 64.0)
STEP_S = 0.1


@dataclass(frozen=True)
class Errors:
    """The errors of a drive's ranges; none by default.

    Parameters
    ----------
    noise_m
        Standard deviation of white noise.
    field_m
        Standard deviation of the slow errors of each of ``SCALES_M``.
    delay_m
        Standard deviation of the cones' own delays.
    pattern_m
        Standard deviation of both harmonics of each cone's pattern.
    outlier_share, outlier_m
        Share of readings without line of sight, and the mean of what these are too long by.
    bias_m, growth_m
        Range bias at 10 m, and its growth per factor of ten.
    offset_s
        Radio clock minus trajectory clock.
    """

    noise_m: float = 0.0
    field_m: float = 0.0
    delay_m: float = 0.0
    pattern_m: float = 0.0
    outlier_share: float = 0.0
    outlier_m: float = 1.0
    bias_m: float = 0.0
    growth_m: float = 0.0
    offset_s: float = 0.0


WORKING = Errors(
    noise_m=0.06,
    field_m=0.015,
    delay_m=0.03,
    pattern_m=0.02,
    outlier_share=0.05,
    bias_m=0.15,
    offset_s=0.1,
)
"""What working radios do."""


def straight(
    north_m: float = 0.0, *, half_m: float = 30.0, speed_mps: float = 5.0, back: bool = False
) -> Trajectory:
    """Return a drive along north = ``north_m`` from west to east, or ``back``."""
    east_m = np.arange(-half_m, half_m, speed_mps * STEP_S)
    east_m = -east_m if back else east_m
    return _driven(np.stack([east_m, np.full(len(east_m), north_m)], axis=1))


def u_turn(*, half_m: float = 25.0, radius_m: float = 6.0, speed_mps: float = 5.0) -> Trajectory:
    """Return a drive east, through a half circle to the left, and back west."""
    step_m = speed_mps * STEP_S
    east_m = np.arange(-half_m, half_m, step_m)
    angle = np.arange(0.0, np.pi, step_m / radius_m)
    out = np.stack([east_m, np.zeros(len(east_m))], axis=1)
    turn = np.stack([half_m + radius_m * np.sin(angle), radius_m * (1 - np.cos(angle))], axis=1)
    back = np.stack([-east_m, np.full(len(east_m), 2 * radius_m)], axis=1)
    return _driven(np.concatenate([out, turn, back]))


def laps(n: int) -> Trajectory:
    """Return a path that goes ``n`` times around the same loop."""
    once = u_turn().position_m
    return _driven(np.tile(once, (n, 1)))


def _driven(position_m: Numbers) -> Trajectory:
    return Trajectory(STEP_S * np.arange(len(position_m)), position_m)


def make_drive(
    path: Trajectory,
    cones_m: Numbers,
    errors: Errors = Errors(),
    *,
    seed: int = 0,
    number: int = 0,
    ids: Sequence[str] | None = None,
    cones_up_m: Numbers | None = None,
) -> Episode:
    """Return a drive past cones, each read about once per step of the path.

    Parameters
    ----------
    path
        Of the tag, with or without heights.
    cones_m : (N, 2)
        Where the cones stand.
    errors
        Of the ranges.
    seed
        Of all that is drawn; drives with the same seed have the same delays and patterns.
    number
        Of the drive, for what differs from drive to drive.
    ids
        Names of the cones.
    cones_up_m : (N,)
        Their heights.
    """
    n = len(cones_m)
    cones = np.random.default_rng([7, seed])
    delay_m = errors.delay_m * cones.standard_normal(n)
    pattern_m = errors.pattern_m * cones.standard_normal((n, 2))
    rng = np.random.default_rng([8, seed, number])
    ids = tuple(f"cone-{k}" for k in range(n)) if ids is None else tuple(ids)
    parts = []
    for k, cone_m in enumerate(cones_m):
        t_s = path.t_s[1:-2] + rng.uniform(0.0, STEP_S, len(path.t_s) - 3)
        tag_m = np.stack([np.interp(t_s, path.t_s, x) for x in path.position_m.T], axis=1)
        off_m = cone_m - tag_m
        gap_m = 0.0
        if path.up_m is not None and cones_up_m is not None:
            gap_m = np.interp(t_s, path.t_s, path.up_m) - cones_up_m[k]
        true_m = np.sqrt((off_m**2).sum(axis=1) + gap_m**2)
        bearing = np.arctan2(off_m[:, 1], off_m[:, 0])
        error_m = errors.bias_m + errors.growth_m * np.log10(np.maximum(true_m, 0.5) / 10.0)
        error_m += delay_m[k] + pattern_m[k] @ [np.cos(bearing), np.sin(bearing)]
        error_m += errors.noise_m * rng.standard_normal(len(t_s))
        error_m += _slow_errors_m(tag_m, errors.field_m, rng)
        hidden = rng.random(len(t_s)) < errors.outlier_share
        error_m += hidden * rng.exponential(errors.outlier_m, len(t_s))
        parts.append((t_s + errors.offset_s, np.full(len(t_s), k), true_m + error_m))
    t_s, anchor, range_m = (np.concatenate(column) for column in zip(*parts, strict=True))
    order = np.argsort(t_s, kind="stable")
    readings = RangeReadings(t_s[order], anchor[order].astype(np.int64), range_m[order], path)
    return _episode(f"drive {seed}-{number}", ids, path, readings, cones_up_m)


def _slow_errors_m(tag_m: Numbers, field_m: float, rng: np.random.Generator) -> Numbers:
    """Return a Gaussian random field at some places, as large at every scale."""
    if field_m == 0.0:
        return np.zeros(len(tag_m))
    apart_m = np.hypot(*np.moveaxis(tag_m[:, None] - tag_m[None], -1, 0))
    covariance = sum(np.exp(-apart_m / scale_m) for scale_m in SCALES_M)
    root = np.linalg.cholesky(covariance + 1e-9 * np.eye(len(tag_m)))
    return field_m * root @ rng.standard_normal(len(tag_m))


def _episode(
    name: str,
    ids: tuple[str, ...],
    path: Trajectory,
    readings: RangeReadings,
    cones_up_m: Numbers | None,
) -> Episode:
    """Put the readings on the path's timeline as well, each at the step nearest to it."""
    range_m = np.full((len(path.t_s), len(ids)), np.nan)
    step = np.clip(np.rint((readings.t_s - path.t_s[0]) / STEP_S), 0, len(path.t_s) - 1)
    range_m[step.astype(np.int64), readings.anchor] = readings.range_m
    return Episode(
        name=name,
        anchor_ids=ids,
        t_s=path.t_s,
        position_m=path.position_m,
        range_m=range_m,
        valid=np.isfinite(range_m),
        tag_up_m=path.up_m,
        anchor_up_m=cones_up_m,
        own_times=readings,
        clock=ClockOffset(0.0, 0.5, False, "nobody looked for it"),
    )


def with_readings(episode: Episode, keep: NDArray[np.bool_]) -> Episode:
    """Return a drive with some of its readings (R,) only."""
    known = episode.own_times
    assert known is not None
    readings = replace(
        known,
        t_s=known.t_s[keep],
        anchor=known.anchor[keep],
        range_m=known.range_m[keep],
    )
    up_m = episode.anchor_up_m
    return _episode(episode.name, episode.anchor_ids, known.trajectory, readings, up_m)
