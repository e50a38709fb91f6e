from dataclasses import replace

import numpy as np
import pytest

from gaia_uwb.alignment.calibration import calibrate
from gaia_uwb.config import CalibrationConfig, SolverConfig
from gaia_uwb.episode import Episode, bias_basis
from gaia_uwb.solver import batch

EXACT = SolverConfig(anchor_bias_sigma_m=0.0)


def make_log(bias=(0.0, 0.0), n_steps=1500, n_anchors=5, seed=0, straight=False):
    rng = np.random.default_rng(seed)
    t_s = 0.1 * np.arange(n_steps)
    north = np.zeros(n_steps) if straight else 12.0 * np.sin(0.15 * t_s)
    path = np.stack([30.0 * np.sin(0.05 * t_s) + 0.3 * t_s, north], axis=1)
    anchors = np.stack(
        [
            rng.uniform(-20, 50, n_anchors),
            rng.choice([-1, 1], n_anchors) * rng.uniform(3, 30, n_anchors),
        ],
        axis=1,
    )
    true_m = np.linalg.norm(path[:, None] - anchors, axis=2)
    range_m = true_m + bias_basis(true_m) @ np.array(bias)
    range_m += 0.08 * rng.standard_normal(range_m.shape)
    ids = tuple(f"cone-{n}" for n in range(n_anchors))
    return Episode("drive", ids, t_s, path, range_m, np.ones(range_m.shape, dtype=bool))


@pytest.mark.parametrize("bias", [(0.0, 0.0), (0.2, 0.25), (-0.15, 0.1)])
def test_a_bias_law_is_recovered_within_its_covariance(bias):
    distance2 = []
    for seed in range(8):
        found = calibrate(make_log(bias, seed=seed), solver=EXACT).calibration
        off = found.bias - bias
        distance2.append(off @ np.linalg.solve(found.covariance, off))
        assert np.abs(off).max() < 0.05
    assert np.mean(distance2) < 6.0  # 2 expected


def test_the_bias_is_subtracted_and_the_rest_stays():
    log = make_log((0.2, 0.25))
    out = calibrate(log)
    assert np.array_equal(out.range_m, log.range_m - out.calibration.bias_m(log.range_m))
    assert out.position_m is log.position_m
    assert log.calibration is None


def test_noise_and_correlation_are_those_of_the_errors():
    found = calibrate(make_log(), solver=EXACT).calibration
    assert 0.06 < found.sigma_m < 0.09  # the Student-t's scale of Gaussian noise is 0.83 of it
    assert 1.0 <= found.correlation < 2.0
    log = make_log()
    slow = 0.3 * np.sin(0.4 * log.t_s)[:, None] * np.cos(np.arange(5))
    slow_log = replace(log, range_m=log.range_m + slow)
    assert calibrate(slow_log, solver=EXACT).calibration.correlation > 4.0


def test_what_a_drive_cannot_tell_stays_near_its_prior():
    log = make_log((0.2, 0.25), n_steps=40, n_anchors=2)
    found = calibrate(log).calibration
    assert np.abs(found.bias).max() < 0.1
    prior = CalibrationConfig()
    sigma = np.sqrt(np.diag(found.covariance))
    assert sigma[0] > 0.5 * prior.bias_sigma_m
    assert sigma[1] > 0.5 * prior.bias_slope_sigma_m


def test_a_prior_of_0_holds_its_parameter():
    found = calibrate(make_log((0.1, 0.3)), CalibrationConfig(bias_slope_sigma_m=0.0)).calibration
    assert abs(found.bias[1]) < 1e-6


def test_a_log_without_a_located_anchor_keeps_the_prior():
    log = make_log(n_steps=50, n_anchors=2)
    range_m = log.range_m.copy()
    range_m[2:] = np.nan
    found = calibrate(replace(log, range_m=range_m, valid=np.isfinite(range_m))).calibration
    assert np.all(found.bias == 0.0)
    assert (found.correlation, found.sigma_m) == (1.0, 0.1)


def test_a_hopeless_anchor_does_not_disturb_the_others():
    log = make_log((0.2, 0.25))
    range_m = np.column_stack([log.range_m, np.full(log.n_steps, np.nan)])
    ids = (*log.anchor_ids, "silent")
    wider = replace(log, anchor_ids=ids, range_m=range_m, valid=np.isfinite(range_m))
    a, b = calibrate(log).calibration, calibrate(wider).calibration
    assert np.allclose(a.bias, b.bias, rtol=1e-9)
    assert np.allclose(a.covariance, b.covariance, rtol=1e-9)


def test_chunks_do_not_change_the_result(monkeypatch):
    log = make_log((0.2, 0.25))
    whole = calibrate(log).calibration
    monkeypatch.setattr(batch, "_CHUNK", 2 * log.n_steps)
    parts = calibrate(log).calibration
    assert np.allclose(whole.bias, parts.bias, rtol=1e-9)
    assert parts.correlation == whole.correlation
