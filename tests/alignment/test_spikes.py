"""The gate: bursts of either sign go, honest readings stay."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, strategies as st

from gaia_uwb.alignment.spikes import gate_spikes

T_S = np.arange(120) * 0.1
NOISE_M = 0.05 * np.random.default_rng(3).standard_normal(len(T_S))


@given(
    start=st.integers(0, 117),
    length=st.integers(1, 3),
    size_m=st.floats(0.6, 50.0),
    sign=st.sampled_from([-1.0, 1.0]),
)
def test_a_burst_goes_and_nothing_else(start: int, length: int, size_m: float, sign: float) -> None:
    residual_m = NOISE_M.copy()
    residual_m[start : start + length] += sign * size_m
    gated = np.flatnonzero(~gate_spikes(T_S, residual_m))
    assert gated.tolist() == list(range(start, start + length))


@pytest.mark.parametrize("first", [0, 58, 117])
def test_bursts_of_both_signs_near_each_other(first: int) -> None:
    residual_m = NOISE_M.copy()
    residual_m[first : first + 3] -= 6.0
    residual_m[(first + 6) % 120 : (first + 6) % 120 + 2] += 46.0
    gated = ~gate_spikes(T_S, residual_m)
    assert np.array_equal(gated, np.abs(residual_m) > 1.0)


@pytest.mark.parametrize("size_m", [-0.6, 0.8, -1.0])
def test_a_small_burst_does_not_hide_behind_a_long_large_one(size_m: float) -> None:
    residual_m = NOISE_M.copy()
    residual_m[50:59] += 30.0  # so many that they widen what their neighbours look like
    residual_m[60:62] += size_m
    gated = np.flatnonzero(~gate_spikes(T_S, residual_m))
    assert gated.tolist() == [*range(50, 59), 60, 61]


def test_noise_is_kept() -> None:
    t_s = np.arange(20_000) * 0.1
    residual_m = 0.08 * np.random.default_rng(1).standard_normal(len(t_s))
    assert gate_spikes(t_s, residual_m).mean() > 0.9995


def test_a_slow_error_is_no_spike() -> None:
    lost_sight = np.where((T_S > 4.0) & (T_S < 8.0), 0.8, 0.0)
    assert gate_spikes(T_S, NOISE_M + lost_sight).all()
    assert gate_spikes(T_S, NOISE_M + 2.0 * np.sin(T_S / 3.0)).all()


@pytest.mark.parametrize("height_m", [0.0, 0.7])
def test_a_pass_at_speed_with_a_clock_error_is_kept(height_m: float) -> None:
    along_m = 20.0 * (T_S - 6.03)
    true_m = np.hypot(np.hypot(along_m, 3.0), height_m)
    seen_m = np.hypot(np.hypot(along_m - 20.0 * 0.2, 3.0), height_m)
    assert gate_spikes(T_S, seen_m - true_m + NOISE_M).all()


def test_held_repeats_pass_at_walking_pace_only() -> None:
    held = np.array([20, 50, 51, 80])
    for speed_mps, kept in ((1.0, True), (20.0, False)):
        range_m = speed_mps * T_S
        for k in held:
            range_m[k] = range_m[k - 1]
        keep = gate_spikes(T_S, range_m - speed_mps * T_S + 0.2 * NOISE_M)
        assert (keep[held] == kept).all()
        assert np.delete(keep, held).all()


def test_neighbours_beyond_a_gap_have_no_say() -> None:
    t_s = np.concatenate([T_S, T_S + 20.0])
    residual_m = np.concatenate([NOISE_M, NOISE_M + 3.0])
    assert gate_spikes(t_s, residual_m).all()


@pytest.mark.parametrize("n", [0, 1, 2])
def test_so_few_that_nothing_can_be_said(n: int) -> None:
    assert gate_spikes(np.arange(n) * 0.1, np.array([0.0, 9.0])[:n]).all()


def test_a_lone_spike_among_three() -> None:
    assert gate_spikes(np.arange(3) * 0.1, np.array([0.0, 9.0, 0.0])).tolist() == [
        True,
        False,
        True,
    ]


def test_thresholds() -> None:
    residual_m = np.zeros(30)
    residual_m[[10, 20]] = [0.25, 0.26]
    assert np.flatnonzero(~gate_spikes(T_S[:30], residual_m)).tolist() == [20]
    assert gate_spikes(T_S[:30], residual_m, threshold_m=0.3).all()
    noisy = NOISE_M + 0.4 * (np.arange(len(T_S)) == 60)
    assert gate_spikes(T_S, noisy, threshold_sigma=20.0).all()


@given(shift_m=st.integers(-1000, 1000), shift_s=st.integers(-(2**30), 2**30))
def test_only_differences_matter(shift_m: int, shift_s: int) -> None:
    t_s, residual_m = np.arange(60) * 0.125, np.round(NOISE_M[:60] * 2**20) / 2**20
    residual_m[[7, 8, 30]] += [4.0, 4.0, -9.0]
    expected = gate_spikes(t_s, residual_m)
    assert np.array_equal(gate_spikes(t_s + shift_s, residual_m + shift_m), expected)
    assert np.array_equal(gate_spikes(t_s, -residual_m), expected)
    assert np.array_equal(gate_spikes(-t_s[::-1], residual_m[::-1]), expected[::-1])


def test_blocks_make_no_difference(monkeypatch: pytest.MonkeyPatch) -> None:
    residual_m = NOISE_M.copy()
    residual_m[[5, 6, 63, 64, 119]] += 5.0
    expected = gate_spikes(T_S, residual_m)
    monkeypatch.setattr("gaia_uwb.alignment.spikes._BLOCK", 7)
    assert np.array_equal(gate_spikes(T_S, residual_m), expected)
