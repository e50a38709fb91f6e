from __future__ import annotations

import numpy as np

from drives import NOISE_M, denoise, drive_past, errors_m


def test_ranges_stay_as_they_are_with_one_sigma_per_anchor() -> None:
    episode = drive_past(0, bursts=2, dropout=0.1)
    result = denoise("raw", episode)
    np.testing.assert_array_equal(result.range_m, episode.range_m)
    np.testing.assert_array_equal(result.valid, episode.valid)
    for n in range(episode.n_anchors):
        assert len(np.unique(result.sigma_m[result.valid[:, n], n])) == 1


def test_sigma_is_the_noise() -> None:
    episode = drive_past(1, speed_mps=2.0, n_steps=2000, n_anchors=5)
    result = denoise("raw", episode)
    error = errors_m(result, episode) / result.sigma_m[result.valid]
    assert 0.88 < np.mean(np.abs(error) < 1.645) < 0.92
    np.testing.assert_allclose(result.sigma_m, NOISE_M, rtol=0.1)
