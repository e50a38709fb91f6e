"""What all denoisers promise: batches, NaN, lengths, times, and the error that does not go away."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from alike import assert_same
from drives import FILTERS, METHODS, NOISE_M, denoise, drive_past, make_episode
from gaia_uwb.denoisers import _base, _robust
from gaia_uwb.denoisers.registry import make_denoiser
from gaia_uwb.episode import Episode, RangeCalibration


def mixed_episodes() -> list[Episode]:
    """Return episodes of two lengths, one with an anchor that was never heard."""
    episodes = [
        drive_past(k, n_steps=(64, 90)[k % 2], n_anchors=1 + k, bursts=1, dropout=0.2)
        for k in range(5)
    ]
    deaf = episodes[2].range_m.copy()
    deaf[:, 1] = np.nan
    episodes[2] = replace(episodes[2], range_m=deaf, valid=np.isfinite(deaf))
    return episodes


@pytest.mark.parametrize("name", METHODS)
def test_a_batch_gives_to_the_last_bit_what_each_alone_gives(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    episodes = mixed_episodes()
    alone = [denoise(name, episode) for episode in episodes]
    for one, other in zip(make_denoiser(name)(episodes), alone, strict=True):
        assert_same(one, other)
    # Neither does it matter where the chunks and blocks that bound the memory are cut.
    monkeypatch.setattr(_base, "_CHUNK", 3 * 64)
    monkeypatch.setattr(_robust, "_BLOCK", 64)
    for one, other in zip(make_denoiser(name)(episodes), alone, strict=True):
        assert_same(one, other)


@pytest.mark.parametrize("name", METHODS)
def test_an_anchor_gives_the_same_among_others_and_a_silent_one_nothing(name: str) -> None:
    episode = mixed_episodes()[4]
    silent = episode.range_m.copy()
    silent[:, 3] = np.nan
    result = denoise(name, episode)
    beside = denoise(name, replace(episode, range_m=silent, valid=np.isfinite(silent)))
    assert not beside.valid[:, 3].any()
    kept = [0, 1, 2, 4]
    np.testing.assert_array_equal(beside.range_m[:, kept], result.range_m[:, kept])
    only = replace(
        episode, anchor_ids=("x",), range_m=episode.range_m[:, [2]], valid=episode.valid[:, [2]],
        truth=None,
    )  # fmt: skip
    np.testing.assert_array_equal(denoise(name, only).sigma_m, result.sigma_m[:, [2]])


@pytest.mark.parametrize("name", METHODS)
def test_results_keep_order_shapes_and_nan(name: str) -> None:
    episodes = mixed_episodes()
    results = make_denoiser(name)(episodes)
    assert [r.range_m.shape for r in results] == [e.range_m.shape for e in episodes]
    for result in results:
        np.testing.assert_array_equal(np.isfinite(result.range_m), result.valid)
        np.testing.assert_array_equal(np.isfinite(result.sigma_m), result.valid)
    assert make_denoiser(name)([]) == []


@pytest.mark.parametrize("name", METHODS)
@pytest.mark.parametrize("n_steps", [1, 2, 3, 12])
def test_short_episodes_give_their_ranges(name: str, n_steps: int) -> None:
    result = denoise(name, make_episode(np.full(n_steps, 7.0)))
    np.testing.assert_allclose(result.range_m[:, 0], 7.0)


@pytest.mark.parametrize("name", METHODS)
def test_the_clock_s_zero_does_not_matter(name: str) -> None:
    episode = drive_past(3, bursts=2, dropout=0.1)
    later = denoise(name, replace(episode, t_s=episode.t_s + 1.6e9))
    result = denoise(name, episode)
    np.testing.assert_array_equal(later.valid, result.valid)
    np.testing.assert_allclose(later.range_m, result.range_m, atol=1e-4)


@pytest.mark.parametrize("name", METHODS)
@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    rate_mps=st.floats(-40.0, 40.0),
    n_steps=st.integers(4, 60),
    dropout=st.floats(0.0, 0.5),
)
def test_a_ramp_without_noise_comes_out_as_it_is(
    name: str, seed: int, rate_mps: float, n_steps: int, dropout: float
) -> None:
    """No lag, no bias at the ends, at irregular steps and with missing readings."""
    rng = np.random.default_rng(seed)
    t_s = np.cumsum(rng.uniform(0.05, 0.2, n_steps))
    true_m = 300.0 + rate_mps * t_s
    range_m = np.where(rng.random(n_steps) < dropout, np.nan, true_m)
    episode = make_episode(range_m, t_s=t_s, true_m=true_m)
    result = denoise(name, episode, **({} if name == "raw" else {"spike_neighbours": 3}))
    # Where the readings are too few for a slope, a line is level over at most the window.
    slack = 1e-6 if dropout == 0.0 and n_steps > 12 else 3.0 * abs(rate_mps) + 1e-6
    np.testing.assert_allclose(result.range_m[result.valid], true_m[result.valid[:, 0]], atol=slack)


@pytest.mark.parametrize("name", FILTERS)
@pytest.mark.parametrize("offset_m", [-19.0, -6.0, -1.0, 1.0, 46.0])
@pytest.mark.parametrize("start", [0, 1, 40, 77])
def test_a_burst_leaves_no_trace(name: str, offset_m: float, start: int) -> None:
    episode = drive_past(5, speed_mps=1.0, n_steps=80, n_anchors=1)
    range_m = episode.range_m.copy()
    range_m[start : start + 3] += offset_m
    hit = replace(episode, range_m=range_m)
    assert episode.truth is not None
    error = np.abs(denoise(name, hit).range_m - episode.truth.range_m)
    assert np.nanmax(error) < 4.0 * NOISE_M


def test_the_error_that_neighbours_share_stays() -> None:
    """Of a calibrated noise of scale s, whose correlation counts k steps, 1 - 1/k is slow."""
    episode = drive_past(1, n_steps=64)

    def sigma_m(correlation: float) -> np.ndarray:
        known = RangeCalibration(np.zeros(2), np.eye(2), 0.1, correlation)
        return denoise("kalman", replace(episode, calibration=known)).sigma_m

    white = denoise("kalman", episode).sigma_m
    np.testing.assert_array_equal(sigma_m(1.0), white)
    np.testing.assert_allclose(sigma_m(4.0) ** 2 - white**2, np.where(white > 0, 0.015, np.nan))
