"""Drives with known truth, for the tests of the denoisers."""

from __future__ import annotations

import numpy as np

from gaia_uwb.denoised import DenoisedRanges
from gaia_uwb.denoisers.registry import make_denoiser
from gaia_uwb.episode import Episode, EpisodeTruth

METHODS = ("raw", "median", "kalman", "pose-kalman")
FILTERS = METHODS[1:]
NOISE_M = 0.1


def drive_past(
    seed: int,
    *,
    speed_mps: float = 20.0,
    lateral_m: float = 5.0,
    n_steps: int = 160,
    n_anchors: int = 4,
    noise_m: float = NOISE_M,
    bursts: int = 0,
    dropout: float = 0.0,
) -> Episode:
    """Return a gently weaving drive past a row of anchors, sampled at 8 Hz."""
    rng = np.random.default_rng(seed)
    t_s = np.arange(n_steps) / 8.0
    along_m = speed_mps * (t_s - t_s[n_steps // 2])
    position_m = np.stack([along_m, 0.3 * np.sin(1.5 * t_s)], axis=1)
    anchor_m = np.stack(
        [np.linspace(-10.0, 10.0, n_anchors), np.full(n_anchors, lateral_m)], axis=1
    )
    true_m = np.linalg.norm(position_m[:, None] - anchor_m, axis=2)
    range_m = true_m + noise_m * rng.standard_normal(true_m.shape)
    for n in range(n_anchors):
        for start in rng.choice(n_steps // 40, bursts, replace=False) * 40:
            range_m[start : start + rng.integers(2, 4), n] += rng.choice([-19.0, -5.0, -1.5, 46.0])
    range_m[rng.random(range_m.shape) < dropout] = np.nan
    return make_episode(range_m, t_s=t_s, position_m=position_m, true_m=true_m)


def make_episode(
    range_m: np.ndarray,
    *,
    t_s: np.ndarray | None = None,
    position_m: np.ndarray | None = None,
    true_m: np.ndarray | None = None,
) -> Episode:
    """Return an episode of these ranges, (T,) or (T, N); a parked vehicle unless told otherwise."""
    range_m = np.asarray(range_m, dtype=float).reshape(len(range_m), -1)
    n_steps, n_anchors = range_m.shape
    truth = None
    if true_m is not None:
        true_m = true_m.reshape(range_m.shape)
        nlos = np.zeros(range_m.shape, dtype=bool)
        truth = EpisodeTruth(np.zeros((n_anchors, 2)), true_m, nlos)
    return Episode(
        name="drive",
        anchor_ids=tuple(f"cone-{n}" for n in range(n_anchors)),
        t_s=np.arange(n_steps) / 8.0 if t_s is None else t_s,
        position_m=np.zeros((n_steps, 2)) if position_m is None else position_m,
        range_m=range_m,
        valid=np.isfinite(range_m),
        truth=truth,
    )


def denoise(name: str, episode: Episode, **options: object) -> DenoisedRanges:
    return make_denoiser(name, options)([episode])[0]


def errors_m(result: DenoisedRanges, episode: Episode) -> np.ndarray:
    """Return the errors of the valid ranges."""
    assert episode.truth is not None
    return (result.range_m - episode.truth.range_m)[result.valid]
