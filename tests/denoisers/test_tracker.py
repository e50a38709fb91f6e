from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are, solve_discrete_lyapunov

from gaia_uwb.denoisers._robust import LocalLine
from gaia_uwb.denoisers._tracker import Motion, track

HALF = 5


def flat_line(shape: tuple[int, ...], level_m: float, spread_m: float) -> LocalLine:
    return LocalLine(np.full(shape, level_m), np.zeros(shape), np.full(shape, spread_m), HALF)


def transition(dt_s: float, density: float) -> tuple[np.ndarray, np.ndarray]:
    noise = density * np.array([[dt_s**3 / 3, dt_s**2 / 2], [dt_s**2 / 2, dt_s]])
    return np.array([[1.0, dt_s], [0.0, 1.0]]), noise


@pytest.mark.parametrize("seed", range(3))
def test_smoothing_equals_the_dense_least_squares_solution(seed: int) -> None:
    """All states at once, from the start, the transitions and the readings; irregular steps."""
    rng = np.random.default_rng(seed)
    steps, density, sigma_m, spread_m = 25, 0.7, 0.2, 0.3
    t_s = np.cumsum(rng.uniform(0.05, 0.4, steps))
    value_m = 8.0 + np.sin(t_s) + sigma_m * rng.standard_normal(steps)
    value_m[rng.choice(np.arange(1, steps - 1), 8, replace=False)] = np.nan
    motion = Motion(density, np.array([sigma_m]), 1e3, 1e3)
    line = flat_line((steps, 1), 8.0, spread_m)
    result = track(t_s[:, None], value_m[:, None], line, motion, smooth=True)

    information, right = np.zeros((2 * steps, 2 * steps)), np.zeros(2 * steps)
    reach_s = 0.5 * (t_s[HALF] - t_s[0])
    start = np.diag([(3 * spread_m) ** -2, (3 * spread_m / reach_s) ** -2])
    information[:2, :2] += start
    right[:2] += start @ [8.0, 0.0]
    for k in range(steps):
        if np.isfinite(value_m[k]):
            information[2 * k, 2 * k] += sigma_m**-2
            right[2 * k] += value_m[k] / sigma_m**2
        if k + 1 < steps:
            move, noise = transition(t_s[k + 1] - t_s[k], density)
            both = np.hstack([-move, np.eye(2)])
            cut = slice(2 * k, 2 * k + 4)
            information[cut, cut] += both.T @ np.linalg.inv(noise) @ both
    covariance = np.linalg.inv(information)
    np.testing.assert_allclose(result.range_m[:, 0], (covariance @ right)[::2], rtol=1e-7)
    np.testing.assert_allclose(result.sigma_m[:, 0], np.sqrt(np.diag(covariance)[::2]), rtol=1e-7)


def test_variances_reach_the_riccati_steady_state() -> None:
    dt_s, density, sigma_m, steps = 0.125, 1.0, 0.1, 400
    t_s = (np.arange(steps) * dt_s)[:, None]
    move, noise = transition(dt_s, density)
    seen = np.array([[1.0], [0.0]])
    predicted = solve_discrete_are(move.T, seen, noise, np.array([[sigma_m**2]]))
    gain = predicted @ seen / (seen.T @ predicted @ seen + sigma_m**2)
    filtered = predicted - gain @ seen.T @ predicted
    back = filtered @ move.T @ np.linalg.inv(predicted)
    smoothed = solve_discrete_lyapunov(back, filtered - back @ predicted @ back.T)

    motion = Motion(density, np.array([sigma_m]), 4.0, 0.6)
    line = flat_line((steps, 1), 5.0, sigma_m)
    value_m = np.full((steps, 1), 5.0)
    forward = track(t_s, value_m, line, motion, smooth=False)
    both = track(t_s, value_m, line, motion, smooth=True)
    np.testing.assert_allclose(forward.sigma_m[200:, 0] ** 2, filtered[0, 0], rtol=1e-9)
    np.testing.assert_allclose(both.sigma_m[150:250, 0] ** 2, smoothed[0, 0], rtol=1e-9)
    assert both.sigma_m[-1, 0] == forward.sigma_m[-1, 0]


def test_short_gaps_are_bridged_and_long_ones_are_not_valid() -> None:
    t_s = (np.arange(60) * 0.1)[:, None]
    value_m = 20.0 + t_s
    value_m[10:14] = np.nan  # 0.5 s between readings
    value_m[30:36] = np.nan  # 0.7 s
    value_m[:3] = np.nan
    value_m[-2:] = np.nan
    line = LocalLine(20.0 + t_s, np.ones_like(t_s), np.full(t_s.shape, 0.1), HALF)
    result = track(t_s, value_m, line, Motion(1.0, np.array([0.05]), 4.0, 0.6), smooth=True)
    invalid = np.flatnonzero(np.isnan(result.range_m[:, 0]))
    assert invalid.tolist() == [0, 1, 2, *range(30, 36), 58, 59]
    np.testing.assert_allclose(result.range_m[3:30], 20.0 + t_s[3:30], atol=1e-9)
    assert result.sigma_m[12] > 1.5 * result.sigma_m[20]


def test_nothing_crosses_a_fresh_start() -> None:
    """Readings after a long gap do not change what was found before it, however far off."""
    t_s = (np.arange(40) * 0.1)[:, None]
    value_m = np.full((40, 1), 20.0)
    value_m[15:25] = np.nan
    jumped = np.where(t_s > 2.0, 90.0, value_m)
    jumped[15:25] = np.nan
    motion = Motion(1.0, np.array([0.05]), 4.0, 0.6)

    def tracked(value: np.ndarray) -> np.ndarray:
        line = LocalLine(value, np.zeros_like(value), np.full(value.shape, 0.05), HALF)
        return track(t_s, value, line, motion, smooth=True).range_m

    np.testing.assert_array_equal(tracked(jumped)[:15], tracked(value_m)[:15])
    np.testing.assert_allclose(tracked(jumped)[25:], 90.0)


@pytest.mark.parametrize(("offset_m", "rejected"), [(0.3, False), (1.2, True), (-1.2, True)])
def test_the_gate_follows_the_innovation_s_own_size(offset_m: float, rejected: bool) -> None:
    t_s = (np.arange(30) * 0.1)[:, None]
    value_m = np.full((30, 1), 10.0)
    value_m[20] += offset_m
    line = flat_line((30, 1), 10.0, 0.1)
    result = track(t_s, value_m, line, Motion(0.1, np.array([0.1]), 4.0, 0.6), smooth=False)
    assert (abs(result.range_m[20, 0] - 10.0) < 1e-9) == rejected
    assert (result.sigma_m[20] > result.sigma_m[19]) == rejected


def test_a_lost_filter_starts_afresh_and_owns_up_to_what_it_lost() -> None:
    """A step of 5 m that stays: nothing is accepted for 0.6 s, then the line is taken over."""
    t_s = (np.arange(60) * 0.1)[:, None]
    value_m = np.where(t_s < 3.0, 10.0, 15.0)
    line = LocalLine(value_m, np.zeros_like(t_s), np.full(t_s.shape, 0.05), HALF)
    result = track(t_s, value_m, line, Motion(0.1, np.array([0.05]), 4.0, 0.6), smooth=True)
    lost = np.isnan(result.range_m)
    assert 4 <= lost.sum() <= 6
    assert (t_s[lost] >= 3.0).all()
    np.testing.assert_allclose(result.range_m[~lost], value_m[~lost], atol=1e-6)
