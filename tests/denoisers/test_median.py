from __future__ import annotations

import numpy as np
import pytest

from drives import NOISE_M, denoise, drive_past, errors_m, make_episode


def test_noise_goes_down_and_sigma_says_how_much() -> None:
    episode = drive_past(0, speed_mps=1.0, n_steps=1000, n_anchors=8)
    result = denoise("median", episode)
    error = errors_m(result, episode)
    # The variance of a median of 5 Gaussian numbers is 0.287 of one's.
    assert np.mean(error**2) == pytest.approx(0.287 * NOISE_M**2, rel=0.15)
    assert 0.88 < np.mean(np.abs(error) < 1.645 * result.sigma_m[result.valid]) < 0.97


def test_a_reading_keeps_its_validity_and_a_spike_gets_its_neighbours_range() -> None:
    range_m = np.full(60, 9.0)
    range_m[[20, 21]] = 3.0
    range_m[40:50] = np.nan
    result = denoise("median", make_episode(range_m))
    np.testing.assert_array_equal(result.valid[:, 0], np.isfinite(range_m))
    np.testing.assert_allclose(result.range_m[result.valid], 9.0)


def test_a_spike_whose_window_holds_only_spikes_is_not_valid() -> None:
    range_m = np.full(60, 9.0)
    range_m[[20, 21, 22]] = 3.0
    result = denoise("median", make_episode(range_m), window_steps=1)
    assert np.flatnonzero(~result.valid[:, 0]).tolist() == [20, 21, 22]


def test_sigma_grows_where_the_window_bends() -> None:
    episode = drive_past(2, speed_mps=20.0, n_anchors=1)
    result = denoise("median", episode)
    assert episode.truth is not None
    closest = int(np.argmin(episode.truth.range_m[:, 0]))
    error = np.abs(result.range_m - episode.truth.range_m)[:, 0]
    assert result.sigma_m[closest, 0] > 5.0 * np.median(result.sigma_m)
    assert (error < 4.0 * result.sigma_m[:, 0]).all()
