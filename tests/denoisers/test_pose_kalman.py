from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from alike import assert_same
from drives import METHODS, NOISE_M, denoise, drive_past, errors_m
from gaia_uwb.alignment.timeline import align
from gaia_uwb.config import AlignmentConfig
from gaia_uwb.denoisers.registry import make_denoiser
from gaia_uwb.episode import Episode
from gaia_uwb.logs.outdoor_uwb import load


def mean_square(name: str, episodes: list[Episode]) -> float:
    results = make_denoiser(name)(episodes)
    return float(np.mean(np.concatenate(
        [errors_m(r, e) for r, e in zip(results, episodes, strict=True)]
    ) ** 2))  # fmt: skip


@pytest.mark.parametrize("speed_mps", [1.0, 10.0, 20.0, 30.0])
@pytest.mark.parametrize("n_steps", [64, 160])
def test_bursts_and_dropouts_on_a_fast_pass(speed_mps: float, n_steps: int) -> None:
    """White noise of 0.1 m falls to a third; the closest approach is kept."""
    episodes = [
        drive_past(seed, speed_mps=speed_mps, n_steps=n_steps, bursts=1, dropout=0.1)
        for seed in range(8)
    ]
    assert mean_square("raw", episodes) > 1.0
    assert mean_square("pose-kalman", episodes) < (NOISE_M / 2.5) ** 2
    for episode in episodes:
        assert denoise("pose-kalman", episode).valid[3:-3].mean() > 0.98


def test_sigma_covers_white_noise() -> None:
    episodes = [drive_past(seed, dropout=0.1) for seed in range(10)]
    results = make_denoiser("pose-kalman")(episodes)
    ratio = np.concatenate(
        [errors_m(r, e) / r.sigma_m[r.valid] for r, e in zip(results, episodes, strict=True)]
    )
    assert 0.87 < np.mean(np.abs(ratio) < 1.645) < 0.96


def test_a_held_reading_at_vehicle_speed_is_a_spike() -> None:
    episode = drive_past(0, speed_mps=25.0, n_anchors=1)
    range_m = episode.range_m.copy()
    range_m[40:130:15] = range_m[39:129:15]
    held = replace(episode, range_m=range_m)
    assert np.abs(errors_m(denoise("raw", held), held)).max() > 1.5
    assert np.abs(errors_m(denoise("pose-kalman", held), held)).max() < 0.2


def test_heights_enter_the_prediction() -> None:
    """5 m above the anchor, 1 m beside it: without the height the bend would be far sharper."""
    flat = drive_past(0, lateral_m=1.0)
    assert flat.truth is not None
    true_m = np.hypot(flat.truth.range_m, 5.0)
    range_m = true_m + flat.range_m - flat.truth.range_m
    known = replace(
        flat, range_m=range_m, truth=replace(flat.truth, range_m=true_m),
        tag_up_m=np.full(flat.n_steps, 5.5), anchor_up_m=np.full(4, 0.5),
    )  # fmt: skip
    assert np.mean(errors_m(denoise("pose-kalman", known), known) ** 2) < (NOISE_M / 2.5) ** 2


def test_an_anchor_that_cannot_be_located_is_left_to_kalman() -> None:
    episode = drive_past(0, n_steps=64, n_anchors=3)
    range_m = episode.range_m.copy()
    range_m[3:, 1] = np.nan
    episode = replace(episode, range_m=range_m, valid=np.isfinite(range_m))
    result, other = denoise("pose-kalman", episode), denoise("kalman", episode)
    assert result.valid[:3, 1].all()
    np.testing.assert_array_equal(result.range_m[:, 1], other.range_m[:, 1])
    np.testing.assert_array_equal(result.sigma_m[:, 1], other.sigma_m[:, 1])
    assert not np.array_equal(result.range_m[:, 0], other.range_m[:, 0])


def test_a_parked_vehicle_is_left_to_kalman() -> None:
    rng = np.random.default_rng(0)
    moving = drive_past(0)
    parked = replace(
        moving, position_m=np.zeros((moving.n_steps, 2)), truth=None,
        range_m=8.0 + NOISE_M * rng.standard_normal(moving.range_m.shape),
    )  # fmt: skip
    assert_same(denoise("pose-kalman", parked), denoise("kalman", parked))


def test_a_pose_that_explains_nothing_does_no_harm() -> None:
    """The path of another drive: the ranges are still tracked."""
    episode = drive_past(0, speed_mps=1.0)
    lost = replace(episode, position_m=np.random.default_rng(1).uniform(-50, 50, (160, 2)))
    assert np.mean(errors_m(denoise("pose-kalman", lost), lost) ** 2) < NOISE_M**2


@pytest.mark.real_data
def test_real_windows_are_no_worse_than_raw_and_far_better_ungated(outdoor_dir: Path) -> None:
    scenes = load(outdoor_dir / "outdoor-uwb", "LOS/B")
    for gate, factor in ((True, 1.0), (False, 0.25)):
        config = AlignmentConfig(gate=gate)
        windows = [w for scene in scenes for w in align(scene, config).windows(64)]
        raw = mean_square("raw", windows)
        for name in METHODS[1:]:
            assert mean_square(name, windows) <= factor * raw
