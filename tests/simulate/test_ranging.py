"""Each error has the statistics that its settings declare, and nothing else is disturbed."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from gaia_uwb._typing import Array, Float64
from gaia_uwb.simulate.presets import DriveConfig, PassConfig, RangingConfig
from gaia_uwb.simulate.ranging import Readings, simulate_readings
from gaia_uwb.simulate.trajectories import plan_drive

ANCHOR_M, ANCHOR_UP_M = np.array([40.0, 20.0]), 0.9
CLEAN: dict[str, Any] = {
    "sigma_m": 0.0,
    "sigma_per_m": 0.0,
    "nlos_share": 0.0,
    "burst_rate": 0.0,
    "dropout_share": 0.0,
    "held_share": 0.0,
    "max_range_m": 1000.0,
}


def readings_of(seed: int = 0, **settings: Any) -> Readings:
    """Return the readings of one anchor, with only the errors that are named."""
    ranging = RangingConfig(**(CLEAN | settings))
    config = PassConfig(drive=DriveConfig(duration_s=60.0), ranging=ranging)
    rng = np.random.default_rng(seed)
    return simulate_readings(plan_drive(config, rng), ANCHOR_M, ANCHOR_UP_M, ranging, rng)


def many(n: int = 40, **settings: Any) -> list[Readings]:
    return [readings_of(seed, **settings) for seed in range(n)]


def error_m(readings: Readings) -> Float64[Array, "R"]:
    return readings.range_m - readings.true_range_m


def assert_mean(per_pass: list[float], expected: float) -> None:
    """Assert that the 99.9 % bootstrap interval of the mean over passes holds a number."""
    rng = np.random.default_rng(99)
    means = rng.choice(per_pass, size=(4000, len(per_pass))).mean(axis=1)
    low, high = np.quantile(means, [0.0005, 0.9995])
    assert low <= expected <= high
    assert high - low < 0.6 * expected  # the interval says something


def runs(flags: Array) -> list[tuple[int, int]]:
    """Return start and length of every stretch of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(int), [0]])))
    return [(int(a), int(b - a)) for a, b in edges.reshape(-1, 2)]


def test_without_errors_ranges_are_the_true_slant_ranges() -> None:
    readings = readings_of()
    config = PassConfig(drive=DriveConfig(duration_s=60.0))
    drive = plan_drive(config, np.random.default_rng(0))
    gap_m = drive.position_m(readings.t_s) - ANCHOR_M
    slant_m = np.sqrt((gap_m**2).sum(axis=1) + (1.6 - 0.9) ** 2)
    np.testing.assert_allclose(readings.true_range_m, slant_m, rtol=1e-12)
    np.testing.assert_array_equal(readings.range_m, readings.true_range_m)
    assert not readings.nlos.any()


def test_polls_keep_their_rate_irregularly_within_the_drive() -> None:
    t_s = readings_of(rate_hz=10.0).t_s
    step_s = np.diff(t_s)
    assert len(t_s) == 600
    assert t_s[0] >= 0
    assert t_s[-1] <= 60
    assert step_s.min() >= 0.09 - 1e-9
    assert step_s.max() <= 0.11 + 1e-9
    assert len(np.unique(step_s.round(6))) > 300


def test_anchors_out_of_range_do_not_answer() -> None:
    near, everything = readings_of(max_range_m=50.0), readings_of()
    answered = everything.true_range_m <= 50
    np.testing.assert_array_equal(near.t_s, everything.t_s[answered])
    assert 0 < len(near.t_s) < len(everything.t_s)
    assert len(readings_of(max_range_m=1.0).t_s) == 0


def test_noise_is_gaussian_and_grows_with_distance() -> None:
    passes = many(sigma_m=0.05, sigma_per_m=0.001)
    true_m = np.concatenate([r.true_range_m for r in passes])
    unit = np.concatenate([error_m(r) for r in passes]) / (0.05 + 0.001 * true_m)
    near, far = unit[true_m < 60], unit[true_m > 120]
    for part in (near, far):
        assert abs(part.mean()) < 4 / np.sqrt(len(part))
        assert part.std() == pytest.approx(1, abs=4 / np.sqrt(2 * len(part)))
        assert np.mean(np.abs(part) < 1) == pytest.approx(0.6827, abs=2 / np.sqrt(len(part)))


def test_nlos_comes_in_stretches_of_the_declared_share_and_duration() -> None:
    passes = many(nlos_share=0.25, nlos_duration_s=1.0)
    assert_mean([float(r.nlos.mean()) for r in passes], 0.25)
    # Stretches that a pass's start or end cuts are left out of the mean length.
    whole = [
        [n for start, n in runs(r.nlos) if start > 0 and start + n < len(r.nlos)] for r in passes
    ]
    assert_mean([float(np.mean(n)) for n in whole if n], 10.0)
    # The chain starts in its stationary state.
    start = [float(r.nlos[0]) for r in many(400, nlos_share=0.25, rate_hz=0.1)]
    assert_mean(start, 0.25)


def test_nlos_excess_is_positive_correlated_and_of_the_declared_mean() -> None:
    passes = many(nlos_share=0.3, nlos_duration_s=1.5, nlos_bias_m=0.5)
    excess = [error_m(r)[r.nlos] for r in passes]
    assert min(e.min() for e in excess if e.size) > 0
    assert all(not error_m(r)[~r.nlos].any() for r in passes)
    assert_mean([float(e.mean()) for e in excess if e.size], 0.5)
    log = [np.log(error_m(r)[s : s + n]) for r in passes for s, n in runs(r.nlos) if n > 2]
    before, after = np.concatenate([x[:-1] for x in log]), np.concatenate([x[1:] for x in log])
    assert np.corrcoef(before, after)[0, 1] == pytest.approx(np.exp(-1 / 15), abs=0.03)


def test_bursts_are_two_or_three_readings_of_one_offset_of_either_sign() -> None:
    passes = many(burst_rate=0.02, burst_min_m=1.0, burst_max_m=5.0, burst_negative_share=0.75)
    offsets, lengths = [], []
    for r in passes:
        for start, n in runs(np.abs(error_m(r)) > 1e-9):
            part = error_m(r)[start : start + n]
            np.testing.assert_allclose(part, part[0], atol=1e-9)
            offsets.append(float(part[0]))
            if start + n < len(r.t_s):  # the drive's end may cut the last one
                lengths.append(n)
    assert set(lengths) == {2, 3}
    size = np.abs(offsets)
    assert size.min() >= 1 - 1e-9
    assert size.max() <= 5 + 1e-9
    assert np.mean(np.array(offsets) < 0) == pytest.approx(0.75, abs=4 * 0.43 / len(size) ** 0.5)
    # A start within 3 or 4 readings of the last one is dropped, so a few fewer come than start.
    assert len(size) / sum(len(r.t_s) for r in passes) == pytest.approx(0.02 / 1.05, rel=0.15)


def test_dropouts_take_their_share_in_stretches() -> None:
    passes = many(dropout_share=0.2, dropout_duration_s=0.3)
    assert_mean([1 - len(r.t_s) / 600 for r in passes], 0.2)
    missing = [np.diff(r.t_s) / 0.1 - 1 for r in passes]
    lengths = [m[m > 0.5] for m in missing]
    assert_mean([float(m.mean()) for m in lengths], 3.0)


def test_held_readings_repeat_the_one_before() -> None:
    passes = many(held_share=0.1)
    held = [np.flatnonzero(np.diff(r.range_m) == 0) + 1 for r in passes]
    assert_mean([len(h) / len(r.t_s) for h, r in zip(held, passes, strict=True)], 0.1)
    for h, r in zip(held, passes, strict=True):
        other = np.setdiff1d(np.arange(len(r.t_s)), h)
        np.testing.assert_array_equal(r.range_m[other], r.true_range_m[other])
        assert (np.diff(r.t_s) > 0).all()


def test_power_falls_with_distance_and_the_first_path_fades_without_line_of_sight() -> None:
    r = readings_of(
        nlos_share=0.4, rssi_at_1m_dbm=-70.0, rssi_per_decade_db=20.0, rssi_sigma_db=0.0,
        nlos_first_path_loss_db=7.0,
    )  # fmt: skip
    np.testing.assert_allclose(r.rssi_dbm, -70 - 20 * np.log10(r.true_range_m))
    np.testing.assert_allclose(r.rssi_dbm - r.rssi_fp_dbm, np.where(r.nlos, 7.0, 0.0), atol=1e-9)
    noisy = readings_of(nlos_share=0.4, rssi_sigma_db=2.0)
    assert (noisy.rssi_fp_dbm <= noisy.rssi_dbm).all()
