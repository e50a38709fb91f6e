"""Readings beside the path: gathered, posed, predicted, fitted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gaia_uwb.alignment.readings import (
    anchor_heights,
    fit_anchors,
    gather_readings,
    pose_at,
    slant_m,
    usual_interval_s,
)
from gaia_uwb.scene import RangeLog, Scene, Trajectory
from gaia_uwb.simulate import PRESETS, simulate_pass

SCENE = simulate_pass(PRESETS["lane-closure"], seed=5)
STEADY = Trajectory(
    np.array([0.0, 1.0, 2.0, 12.0, 13.0]),
    np.array([[0.0, 0.0], [20.0, 0.0], [40.0, 2.0], [240.0, 2.0], [260.0, 2.0]]),
    np.array([1.0, 2.0, 2.0, 2.0, 2.0]),
)


def test_gathering_sorts_every_reading_to_its_anchor() -> None:
    log = SCENE.ranges
    seen = 0
    for readings in gather_readings(SCENE):
        for row, n in enumerate(readings.anchors):
            own = np.flatnonzero(log.anchor == n)
            there = readings.index[row] >= 0
            assert np.array_equal(readings.index[row, there], own)
            assert np.array_equal(readings.t_s[row, there], log.t_s[own])
            assert np.array_equal(readings.range_m[row, there], log.range_m[own])
            assert np.isnan(readings.t_s[row, ~there]).all()
            assert np.isnan(readings.range_m[row, ~there]).all()
            seen += len(own)
    assert seen == len(log)


def test_gathering_in_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    (whole,) = gather_readings(SCENE)
    monkeypatch.setattr("gaia_uwb.alignment.readings._BLOCK", 2 * whole.t_s.shape[1])
    parts = list(gather_readings(SCENE))
    assert [n for part in parts for n in part.anchors] == list(range(SCENE.n_anchors))
    assert all(part.t_s.size <= 2 * whole.t_s.shape[1] for part in parts)
    monkeypatch.setattr("gaia_uwb.alignment.readings._BLOCK", 1)  # less than one anchor needs
    parts = list(gather_readings(SCENE))
    assert [len(part.anchors) for part in parts] == [1] * SCENE.n_anchors
    for n, part in enumerate(parts):
        own = part.t_s.shape[1]
        assert np.array_equal(part.t_s[0], whole.t_s[n, :own], equal_nan=True)


def test_gathering_every_third() -> None:
    (whole,) = gather_readings(SCENE)
    (thin,) = gather_readings(SCENE, every=3)
    for n in range(SCENE.n_anchors):
        index = whole.index[n][whole.index[n] >= 0][::3]
        assert np.array_equal(thin.index[n][thin.index[n] >= 0], index)


@pytest.mark.parametrize("silent", [0, 1, 2])
def test_an_anchor_without_readings_has_a_row_of_padding(silent: int) -> None:
    heard = [n for n in range(3) if n != silent]
    log = RangeLog(np.arange(4.0), np.array(heard * 2), np.ones(4))
    scene = Scene("pass", STEADY, log, ("a", "b", "c"))
    (readings,) = gather_readings(scene)
    assert (readings.index[silent] == -1).all()
    assert (readings.index[heard] >= 0).all()


def test_pose_is_exact_on_a_steady_stretch() -> None:
    pose = pose_at(STEADY, np.array([0.25, 1.5, 13.0]), 1.0)
    np.testing.assert_allclose(pose.position_m, [[5.0, 0.0], [30.0, 1.0], [260.0, 2.0]])
    np.testing.assert_allclose(pose.up_m, [1.25, 2.0, 2.0])
    assert pose.known.all()
    assert (pose_at(replace(STEADY, up_m=None), np.array([0.25]), 1.0).up_m == 0.0).all()


def test_pose_is_unknown_outside_and_in_gaps_but_known_at_the_samples() -> None:
    t_s = np.array([-1e-9, 0.0, 2.0, 2.1, 11.9, 12.0, 13.0, 13.0 + 1e-9, np.nan])
    known = pose_at(STEADY, t_s, 1.0).known
    assert known.tolist() == [False, True, True, False, False, True, True, False, False]
    assert pose_at(STEADY, t_s[3:5], 10.0).known.all()
    assert not pose_at(STEADY, t_s[3:5], 9.999).known.any()


def test_a_gap_at_the_limit_survives_the_rounding_of_stamps_since_1970() -> None:
    t_s = 1.73e9 + np.arange(50) * 0.1
    drive = Trajectory(t_s, np.zeros((50, 2)))
    assert (np.diff(t_s) > 0.1).any()
    assert pose_at(drive, t_s[:-1] + 0.05, 0.1).known.all()


def test_pose_keeps_the_shape_of_the_times() -> None:
    pose = pose_at(STEADY, np.full((2, 3), 0.5), 1.0)
    assert pose.position_m.shape == (2, 3, 2)
    assert pose.known.shape == (2, 3)


def test_heights_are_known_where_both_are() -> None:
    log = RangeLog(np.arange(2.0), np.array([0, 1]), np.ones(2))
    scene = Scene("pass", STEADY, log, ("a", "b"), anchor_up_m=np.array([0.5, np.nan]))
    np.testing.assert_array_equal(anchor_heights(scene), [0.5, np.nan])
    for other in (
        replace(scene, anchor_up_m=None),
        replace(scene, trajectory=replace(STEADY, up_m=None)),
    ):
        assert np.isnan(anchor_heights(other)).all()


def test_slant_distances() -> None:
    tag_m, tag_up_m = np.zeros((4, 1, 2)), np.full((4, 1), 7.0)
    anchor_m, anchor_up_m = np.array([[3.0, 4.0], [2.0, 3.0]]), np.array([np.nan, 1.0])
    np.testing.assert_allclose(
        slant_m(tag_m, tag_up_m, anchor_m, anchor_up_m), np.tile([5.0, 7.0], (4, 1))
    )


def test_a_fit_locates_the_anchors_and_leaves_out_what_it_must() -> None:
    (readings,) = gather_readings(SCENE)
    inside = np.ones(readings.t_s.shape, dtype=np.bool_)
    inside[:, ::2] = False
    fit = fit_anchors(SCENE, readings, 0.2, 1.0, inside)
    error_m = np.hypot(*(fit.anchor_m - SCENE.truth.anchor_m).T)
    assert np.median(error_m) < 0.3
    used = fit.pose.known & inside
    assert np.array_equal(np.isfinite(fit.residual_m), used)
    assert np.array_equal(fit.weight > 0, used)
    assert (fit.curvature <= fit.weight).all()
    expected = (readings.range_m - fit.predicted_m)[used]
    np.testing.assert_array_equal(fit.residual_m[used], expected)


def test_a_better_offset_fits_better() -> None:
    (readings,) = gather_readings(SCENE)
    cost = [
        fit_anchors(SCENE, readings, offset_s, 1.0).negative_log_likelihood
        for offset_s in (-0.2, 0.0, 0.2, 0.4)
    ]
    assert np.argmin(cost) == 2


def test_a_fit_of_an_anchor_with_too_few_readings() -> None:
    log = RangeLog(np.linspace(0.1, 1.9, 9), np.array([0, 1] * 4 + [0]), np.ones(9))
    (readings,) = gather_readings(Scene("pass", STEADY, log, ("a", "b", "c")))
    few = readings.anchors.index(2)
    fit = fit_anchors(Scene("pass", STEADY, log, ("a", "b", "c")), readings, 0.0, 1.0)
    assert np.isnan(fit.anchor_m[few]).all()
    assert np.isfinite(fit.anchor_m[0]).all()
    assert not fit.weight[few].any()
    assert not fit.curvature[few].any()
    assert np.isfinite(fit.negative_log_likelihood)


def test_curvature_is_the_derivative_of_the_weighted_residual() -> None:
    (readings,) = gather_readings(SCENE)
    fit = fit_anchors(SCENE, readings, 0.2, 1.0)
    use = fit.weight > 0
    residual_m, weight = fit.residual_m[use], fit.weight[use]
    spread2 = 5.0 / weight - residual_m**2  # weight = (dof + 1) / (dof scale^2 + residual^2)
    h = 1e-6

    def pull(r: np.ndarray) -> np.ndarray:
        return 5.0 * r / (spread2 + r**2)

    slope = (pull(residual_m + h) - pull(residual_m - h)) / (2 * h)
    np.testing.assert_allclose(fit.curvature[use], slope, rtol=1e-5, atol=1e-4 * weight.max())


def test_the_usual_interval_counts_a_burst_as_one_and_no_gap() -> None:
    steady_s = np.arange(0.0, 20.0, 0.1)
    assert usual_interval_s(steady_s) == pytest.approx(0.1)
    bursts_s = (np.arange(0.0, 20.0, 2.0)[:, None] + 0.004 * np.arange(4)).ravel()
    assert usual_interval_s(bursts_s) == pytest.approx(1.988)
    # Heard for a second in every five, and not for ten minutes in between.
    stretches_s = (np.array([0.0, 5.0, 10.0, 600.0])[:, None] + 0.1 * np.arange(10)).ravel()
    assert usual_interval_s(stretches_s) == pytest.approx(0.1)
    assert np.isnan(usual_interval_s(np.array([3.0])))
    assert np.isnan(usual_interval_s(np.array([0.0, 9.0, 18.0])))
