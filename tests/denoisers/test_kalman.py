from __future__ import annotations

import numpy as np
import pytest

from drives import NOISE_M, denoise, drive_past, errors_m, make_episode
from gaia_uwb.episode import Episode


def wandering(seed: int, density: float, *, n_steps: int = 800, n_anchors: int = 12) -> Episode:
    """Return ranges whose acceleration is white noise of that density, at irregular steps."""
    rng = np.random.default_rng(seed)
    t_s = np.cumsum(rng.uniform(0.08, 0.17, n_steps))
    dt_s = np.diff(t_s, prepend=0.0)[:, None]
    x, v = np.full(n_anchors, 500.0), np.zeros(n_anchors)
    true_m = np.empty((n_steps, n_anchors))
    for k in range(n_steps):
        white = rng.standard_normal((2, n_anchors)) * np.sqrt(density * dt_s[k])
        x = x + dt_s[k] * (v + 0.5 * white[0]) + dt_s[k] * white[1] / np.sqrt(12.0)
        v = v + white[0]
        true_m[k] = x
    range_m = true_m + NOISE_M * rng.standard_normal(true_m.shape)
    return make_episode(range_m, t_s=t_s, true_m=true_m)


@pytest.mark.parametrize("smooth", [True, False])
@pytest.mark.parametrize("known", [True, False])
def test_sigma_covers_the_error_of_its_own_model(smooth: bool, known: bool) -> None:
    """A noise that has to be found comes out larger where the range itself is restless."""
    episode = wandering(0, 1.0)
    options = {"measurement_sigma_m": NOISE_M} if known else {}
    result = denoise("kalman", episode, smooth=smooth, **options)
    assert result.valid.mean() > 0.999
    error = errors_m(result, episode) / result.sigma_m[result.valid]
    low, high = (0.885, 0.915) if known else (0.9, 0.995)
    assert low < np.mean(np.abs(error) < 1.645) < high


def test_smoothing_beats_filtering_beats_nothing() -> None:
    episode = wandering(1, 1.0)
    rms = [
        np.sqrt(np.mean(errors_m(result, episode) ** 2))
        for result in (
            denoise("raw", episode),
            denoise("kalman", episode, smooth=False),
            denoise("kalman", episode),
        )
    ]
    assert rms[2] < 0.75 * rms[1] < 0.75 * rms[0]


def test_without_smoothing_the_later_readings_of_a_quiet_log_change_nothing() -> None:
    """Beyond the reach of the local line, that is."""
    episode = drive_past(0, speed_mps=1.0, n_anchors=1)
    options = {"smooth": False, "measurement_sigma_m": NOISE_M}
    whole = denoise("kalman", episode, **options)
    half = denoise("kalman", episode.window(0, 80), **options)
    np.testing.assert_array_equal(whole.range_m[:80], half.range_m)


@pytest.mark.parametrize("speed_mps", [10.0, 20.0, 30.0])
def test_at_vehicle_speed_what_it_keeps_is_better_than_raw(speed_mps: float) -> None:
    """It loses the bend at the closest approach, and says so."""
    episode = drive_past(0, speed_mps=speed_mps, n_anchors=12, dropout=0.1)
    result = denoise("kalman", episode)
    assert np.mean(errors_m(result, episode) ** 2) < 0.5 * NOISE_M**2
    assert result.valid[episode.valid].mean() > 0.93
    assert episode.truth is not None
    lost = episode.valid & ~result.valid
    assert (episode.truth.range_m[lost] < 30.0).all()


def test_dropouts_are_bridged_up_to_the_bound() -> None:
    episode = drive_past(0, speed_mps=1.0, dropout=0.3)
    assert denoise("kalman", episode).valid[5:-5].mean() > 0.98
    never = denoise("kalman", episode, max_coast_s=0.0)
    assert not never.valid[~episode.valid].any()
