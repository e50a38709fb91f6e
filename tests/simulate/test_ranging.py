"""Each error has the statistics that its settings declare, and nothing else is disturbed."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from gaia_uwb._shared.arrays import Array, Bool, Float64
from gaia_uwb.simulate.ranging import Reports, received_power, simulate_reports
from gaia_uwb.simulate.settings import RangingConfig

N, P, STEP_S = 200, 400, 0.1
CLEAN: dict[str, Any] = {
    "sigma_m": 0.0,
    "sigma_per_m": 0.0,
    "los_s": None,
    "burst_per_s": 0.0,
    "dropout_share": 0.0,
    "outage_per_s": 0.0,
    "held_share": 0.0,
    "max_range_m": 1000.0,
}
# Distances that change along each row, from 5 m to 120 m.
TRUE_M = 5 + 115 * np.abs(np.sin(np.linspace(0, 3, N)[:, None] + np.linspace(0, 2, P)))
CLEAR = np.zeros((N, P), dtype=np.bool_)


def reports_of(
    seed: int = 0,
    true_m: Float64[Array, "N P"] = TRUE_M,
    cut: Bool[Array, "N P"] = CLEAR,
    **settings: Any,
) -> Reports:
    """Return the reports with only the errors that are named."""
    return simulate_reports(
        true_m,
        cut,
        STEP_S,
        RangingConfig(**(CLEAN | settings)),
        lambda name: np.random.default_rng([seed, *name.encode()]),
    )


def assert_mean(per_row: Array, expected: float) -> None:
    """Assert that the 99.9 % bootstrap interval of the mean over rows holds a number."""
    rng = np.random.default_rng(99)
    means = rng.choice(per_row, size=(4000, len(per_row))).mean(axis=1)
    low, high = np.quantile(means, [0.0005, 0.9995])
    assert low <= expected <= high
    assert high - low < 0.6 * abs(expected)  # the interval says something


def runs(flags: Array) -> list[tuple[int, int]]:
    """Return start and length of every stretch of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(int), [0]])))
    return [(int(a), int(b - a)) for a, b in edges.reshape(-1, 2)]


def autocorrelation(rows: Float64[Array, "N P"], lag: int) -> float:
    return float(np.mean(rows[:, lag:] * rows[:, :-lag]) / np.mean(rows**2))


def test_without_errors_ranges_are_the_true_ranges() -> None:
    reports = reports_of()
    np.testing.assert_array_equal(reports.range_m, TRUE_M)
    assert reports.answered.all()
    assert not reports.nlos.any()
    assert not reports.outlier.any()
    assert not reports.bias_m.any()


def test_noise_grows_with_distance() -> None:
    unit = (reports_of(sigma_m=0.05, sigma_per_m=0.001).range_m - TRUE_M) / (0.05 + 0.001 * TRUE_M)
    for part in (unit[TRUE_M < 40], unit[TRUE_M > 80]):
        assert abs(part.mean()) < 4 / np.sqrt(len(part))
        assert part.std() == pytest.approx(1, abs=4 / np.sqrt(2 * len(part)))
        assert np.mean(np.abs(part) < 1) == pytest.approx(0.6827, abs=2 / np.sqrt(len(part)))


def test_tails_are_those_of_students_t_with_the_same_deviation() -> None:
    from scipy.stats import kstest, t

    noise = (reports_of(sigma_m=0.1, tail_dof=4.0).range_m - TRUE_M).ravel()
    assert kstest(noise / (0.1 / np.sqrt(2)), t(4).cdf).pvalue > 1e-3


def test_averaging_correlates_the_noise_and_keeps_its_deviation() -> None:
    noise = reports_of(sigma_m=0.1, averaged=3).range_m - TRUE_M
    assert noise.std() == pytest.approx(0.1, rel=0.02)
    for lag, expected in ((1, 2 / 3), (2, 1 / 3), (3, 0), (5, 0)):
        assert autocorrelation(noise, lag) == pytest.approx(expected, abs=0.02)


def test_bias_follows_the_logarithm_of_distance() -> None:
    reports = reports_of(bias_m=0.1, bias_per_decade_m=0.2)
    np.testing.assert_allclose(reports.bias_m, 0.1 + 0.2 * np.log10(TRUE_M / 10), atol=1e-12)
    np.testing.assert_allclose(reports.range_m, TRUE_M + reports.bias_m, atol=1e-12)


def test_common_drift_is_shared_and_own_drift_is_not() -> None:
    common = np.concatenate([
        reports_of(k, drift_sigma_m=0.2, drift_correlation_s=2.0).bias_m[:2] for k in range(300)
    ])  # fmt: skip
    np.testing.assert_array_equal(common[::2], common[1::2])
    own = reports_of(own_drift_sigma_m=0.2, own_drift_correlation_s=2.0).bias_m
    assert abs(np.corrcoef(own[::2].ravel(), own[1::2].ravel())[0, 1]) < 0.1
    for drift in (common[::2], own):
        assert drift.std() == pytest.approx(0.2, rel=0.07)
        assert autocorrelation(drift, 10) == pytest.approx(np.exp(-0.5), abs=0.06)


def test_nlos_comes_in_stretches_of_the_declared_share_and_duration() -> None:
    nlos = reports_of(los_s=3.0, nlos_s=1.0).nlos
    assert_mean(nlos.mean(axis=1), 0.25)
    # Stretches that a row's start or end cuts are left out. A sampled stretch is longer than the
    # true one by what is lost between two samples: 1 / (1 - stay) steps.
    stay = 1 - 0.75 * (1 - np.exp(-STEP_S / 3 - STEP_S))
    whole = [
        np.mean([n for start, n in runs(row) if start > 0 and start + n < P] or [np.nan])
        for row in nlos
    ]
    assert_mean(np.array([mean for mean in whole if np.isfinite(mean)]), 1 / (1 - stay))


def test_obstacles_take_the_line_of_sight_away_also_without_a_chain() -> None:
    cut = np.random.default_rng(1).random((N, P)) < 0.1
    np.testing.assert_array_equal(reports_of(cut=cut).nlos, cut)
    chained = reports_of(cut=cut, los_s=3.0, nlos_s=1.0)
    np.testing.assert_array_equal(chained.nlos, cut | reports_of(los_s=3.0, nlos_s=1.0).nlos)


def test_nlos_excess_is_positive_correlated_and_of_the_declared_moments() -> None:
    cut = np.ones((N, P), dtype=np.bool_)
    cut[:, ::7] = False
    excess = reports_of(
        cut=cut, nlos_bias_m=0.5, nlos_bias_sigma_m=0.4, nlos_bias_correlation_s=1.5
    ).bias_m
    assert not excess[~cut].any()
    assert excess[cut].min() > 0
    rows = np.array([row[on] for row, on in zip(excess, cut, strict=True)])
    assert_mean(rows.mean(axis=1), 0.5)
    assert rows.std() == pytest.approx(0.4, rel=0.15)
    log = np.log(np.where(cut, excess, 1.0))
    both = cut[:, 1:] & cut[:, :-1]
    correlation = np.corrcoef(log[:, :-1][both], log[:, 1:][both])[0, 1]
    assert correlation == pytest.approx(np.exp(-STEP_S / 1.5), abs=0.02)


def test_nlos_noise_comes_on_top() -> None:
    cut = np.zeros((N, P), dtype=np.bool_)
    cut[:, 100:] = True
    reports = reports_of(cut=cut, sigma_m=0.3, nlos_sigma_m=0.4, nlos_bias_m=0.0)
    error_m = reports.range_m - TRUE_M
    assert error_m[~cut].std() == pytest.approx(0.3, rel=0.02)
    assert error_m[cut].std() == pytest.approx(0.5, rel=0.02)
    assert not reports.bias_m.any()


def test_bursts_have_their_rate_lengths_sizes_and_signs() -> None:
    reports = reports_of(
        burst_per_s=0.1, burst_lengths=(0.2, 0.0, 0.8), burst_negative_share=0.75,
        burst_median_m=3.0, burst_log_sigma=0.5, burst_max_m=9.0,
    )  # fmt: skip
    error_m = reports.range_m - TRUE_M
    np.testing.assert_array_equal(reports.outlier, error_m != 0)
    offsets, lengths = [], []
    for row in error_m:
        change = np.concatenate([[True], np.abs(np.diff(row)) > 1e-9])
        for start, stop in zip(
            np.flatnonzero(change), np.append(np.flatnonzero(change)[1:], P), strict=True
        ):
            if row[start] and start > 3 and stop < P:
                offsets.append(row[start])
                lengths.append(stop - start)
    size = np.abs(offsets)
    n = len(size)
    assert n / (N * P * STEP_S) == pytest.approx(0.1, rel=5 / n**0.5)
    assert size.max() == pytest.approx(9.0)
    assert np.median(size) == pytest.approx(3.0, rel=0.07)
    assert np.mean(np.array(offsets) < 0) == pytest.approx(0.75, abs=4 * 0.43 / n**0.5)
    assert set(lengths) <= {1, 2, 3}
    assert lengths.count(2) < 0.05 * n  # only where another one overlaps
    assert lengths.count(3) / n == pytest.approx(0.8, abs=0.06)
    # Length and sign are independent.
    lengths_negative = np.array(lengths)[np.array(offsets) < 0]
    assert np.mean(lengths_negative == 3) == pytest.approx(lengths.count(3) / n, abs=0.05)


@pytest.mark.parametrize("share", [0.0, 1.0])
def test_bursts_may_all_have_one_sign(share: float) -> None:
    reports = reports_of(burst_per_s=0.5, burst_negative_share=share)
    offsets = (reports.range_m - TRUE_M)[reports.outlier]
    assert ((offsets < 0) == bool(share)).all()
    assert offsets.size > 1000


def test_lost_polls_and_outages_take_their_shares() -> None:
    lost = ~reports_of(dropout_share=0.2).answered
    assert_mean(lost.mean(axis=1), 0.2)
    assert autocorrelation(lost - lost.mean(), 1) == pytest.approx(0, abs=0.02)
    out = ~reports_of(outage_per_s=0.25, outage_s=1.0).answered
    assert_mean(out.mean(axis=1), 0.2)
    assert autocorrelation(out - out.mean(), 10) == pytest.approx(np.exp(-1.25), abs=0.06)


def test_range_limit_is_hard_or_soft() -> None:
    np.testing.assert_array_equal(reports_of(max_range_m=50.0).answered, TRUE_M <= 50)
    soft = reports_of(max_range_m=100.0, soft_range_m=50.0).answered
    assert soft[TRUE_M <= 50].all()
    assert not soft[TRUE_M > 100].any()
    for middle_m in (60, 75, 90):
        near = np.abs(TRUE_M - middle_m) < 2
        assert soft[near].mean() == pytest.approx((100 - middle_m) / 50, abs=0.05)


def test_held_readings_repeat_the_reading_before_and_its_outlier() -> None:
    settings = {"dropout_share": 0.3, "sigma_m": 0.1, "burst_per_s": 0.3}
    fresh, some = reports_of(**settings), reports_of(held_share=0.2, **settings)
    np.testing.assert_array_equal(fresh.answered, some.answered)
    held_shares = []
    for n in range(N):
        on = fresh.answered[n]
        own, reported = fresh.range_m[n, on], some.range_m[n, on]
        held = own != reported
        held_shares.append(held.mean())
        np.testing.assert_array_equal(reported[1:][held[1:]], reported[:-1][held[1:]])
        flags = some.outlier[n, on]
        np.testing.assert_array_equal(flags[1:][held[1:]], flags[:-1][held[1:]])
    assert_mean(np.array(held_shares), 0.2)


def test_power_falls_with_distance_and_the_first_path_fades_without_line_of_sight() -> None:
    nlos = np.random.default_rng(3).random((N, P)) < 0.4
    exact = RangingConfig(
        rssi_at_1m_dbm=-70.0, rssi_per_decade_db=20.0, rssi_sigma_db=0.0,
        nlos_first_path_loss_db=7.0,
    )  # fmt: skip
    rssi_dbm, first_dbm = received_power(TRUE_M, nlos, exact, np.random.default_rng(0))
    np.testing.assert_allclose(rssi_dbm, -70 - 20 * np.log10(TRUE_M))
    np.testing.assert_allclose(rssi_dbm - first_dbm, np.where(nlos, 7.0, 0.0), atol=1e-9)
    noisy = exact.model_copy(update={"rssi_sigma_db": 2.0})
    rssi_dbm, first_dbm = received_power(TRUE_M, nlos, noisy, np.random.default_rng(0))
    assert np.std(rssi_dbm + 70 + 20 * np.log10(TRUE_M)) == pytest.approx(2, rel=0.02)
    assert (first_dbm <= rssi_dbm).all()
