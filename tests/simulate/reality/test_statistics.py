"""Statistics of errors against hand counts, scipy and processes of known memory."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy import stats

from gaia_uwb._shared.errors import InputError
from gaia_uwb.simulate.reality.statistics import (
    ErrorSummary,
    autocorrelation,
    burst_lengths,
    summarise,
    summary_intervals,
    wasserstein_m,
)


def test_summary_counts_by_hand() -> None:
    first = np.array([2.0, -2.0, 0.0, np.nan, 3.0, np.nan])
    second = np.array([5.0, 0.0, 0.0, 0.0])
    found = summarise([first, second], outlier_m=1.0)
    assert found.mean_m == pytest.approx(1.0)
    assert found.outlier_rate == pytest.approx(4 / 8)
    assert found.burst_mean == pytest.approx(4 / 3)  # 2, 1 and 1: neither a NaN nor an end bridges
    assert found.p95_m == pytest.approx(np.quantile([2, 2, 0, 3, 5, 0, 0, 0], 0.95))


def test_mean_is_signed_and_quantiles_are_not() -> None:
    track = np.linspace(-1.0, 0.0, 101)
    found = summarise([track], outlier_m=2.0)
    flipped = summarise([-track], outlier_m=2.0)
    assert found.mean_m == pytest.approx(-flipped.mean_m)
    assert (found.p95_m, found.p99_m) == pytest.approx((flipped.p95_m, flipped.p99_m))
    assert (found.burst_mean, found.burst_p95, found.outlier_rate) == (0.0, 0.0, 0.0)


@given(st.lists(st.booleans(), min_size=1, max_size=60))
def test_bursts_cover_all_outliers(flags: list[bool]) -> None:
    outlier = np.array(flags)
    lengths = burst_lengths(outlier)
    assert lengths.sum() == outlier.sum()
    assert len(lengths) == np.sum(outlier & ~np.concatenate([[False], outlier[:-1]]))


def test_intervals_hold_the_value_and_follow_the_seed() -> None:
    rng = np.random.default_rng(3)
    runs = [[rng.normal(0.1 * k, 1.0, 500)] for k in range(6)]
    value = summarise([track for run in runs for track in run], outlier_m=1.5)
    intervals = summary_intervals(runs, outlier_m=1.5, seed=1)
    assert intervals == summary_intervals(runs, outlier_m=1.5, seed=1)
    for name in ErrorSummary.columns():
        assert intervals[name] is not None
        low, high = intervals[name]
        assert low <= getattr(value, name) <= high
    assert intervals["mean_m"][1] - intervals["mean_m"][0] > 0.1  # runs differ by more than noise


def test_one_run_has_no_interval() -> None:
    assert set(summary_intervals([[np.zeros(3)]], outlier_m=1.0).values()) == {None}


def test_wasserstein_is_scipys() -> None:
    rng = np.random.default_rng(5)
    first, second = rng.normal(0.0, 1.0, 400), rng.standard_t(3, 300) + 0.2
    found = wasserstein_m([first[:100], first[100:], np.array([np.nan])], [second])
    assert found == pytest.approx(stats.wasserstein_distance(first, second))
    assert wasserstein_m([first], [first + 0.3]) == pytest.approx(0.3)


def test_autocorrelation_of_a_known_process() -> None:
    rng = np.random.default_rng(7)
    tracks = []
    for _ in range(20):
        x = rng.standard_normal(3000)
        for k in range(1, len(x)):
            x[k] = 0.9 * x[k - 1] + np.sqrt(1 - 0.81) * x[k]
        x[rng.random(len(x)) < 0.1] = np.nan
        tracks.append(x)
    found = autocorrelation(tracks, 20, clip_m=10.0)
    np.testing.assert_allclose(found, 0.9 ** np.arange(21), atol=0.04)


def test_autocorrelation_beyond_the_tracks_is_unknown() -> None:
    found = autocorrelation([np.array([0.0, 1.0])], 3, clip_m=5.0)
    assert np.isnan(found[2:]).all()
    assert found[0] == 1.0


@pytest.mark.parametrize("outlier_m", [0.0, -1.0, float("nan")])
def test_threshold_must_be_above_0(outlier_m: float) -> None:
    with pytest.raises(InputError, match="threshold above 0"):
        summarise([np.zeros(3)], outlier_m=outlier_m)


def test_errors_must_be_there_and_differ() -> None:
    nothing = [np.array([np.nan])]
    for function in (
        lambda: summarise(nothing, outlier_m=1.0),
        lambda: wasserstein_m(nothing, [np.zeros(1)]),
        lambda: autocorrelation(nothing, 2, clip_m=1.0),
    ):
        with pytest.raises(InputError, match="at least one finite error"):
            function()
    with pytest.raises(InputError, match="different errors"):
        autocorrelation([np.ones(5)], 2, clip_m=5.0)
