"""The processes have their stationary law from the first step, and their durations."""

from __future__ import annotations

import numpy as np
import pytest

from gaia_uwb.simulate.chains import at_steps, correlated, two_state


def test_two_state_has_its_share_from_the_first_step_and_its_durations() -> None:
    draw = np.random.default_rng(0).random((4000, 400))
    on = two_state(draw, off_s=3.0, on_s=1.0, step_s=0.1)
    for step in (0, 1, 399):
        assert on[:, step].mean() == pytest.approx(0.25, abs=4 * (0.25 * 0.75 / 4000) ** 0.5)
    # Sampled durations: what is on is still on after a step with the probability of the process.
    forgotten = 1 - np.exp(-0.1 / 1.0 - 0.1 / 3.0)
    assert on[:, 1:][on[:, :-1]].mean() == pytest.approx(1 - 0.75 * forgotten, abs=0.002)
    assert on[:, 1:][~on[:, :-1]].mean() == pytest.approx(0.25 * forgotten, abs=0.001)


@pytest.mark.parametrize("step_s", [1e-3, 100.0])
def test_two_state_holds_at_any_step(step_s: float) -> None:
    draw = np.random.default_rng(1).random((2000, 3))
    on = two_state(draw, off_s=1.0, on_s=1.0, step_s=step_s)
    assert on.mean() == pytest.approx(0.5, abs=0.06)
    changes = (on[:, 1:] != on[:, :-1]).mean()
    assert changes == pytest.approx(0.001 if step_s < 1 else 0.5, abs=0.03)


@pytest.mark.parametrize(("correlation_s", "steps"), [(1.5, 64), (30.0, 1000), (0.01, 64)])
def test_correlated_is_the_autoregressive_recursion(correlation_s: float, steps: int) -> None:
    white = np.random.default_rng(2).standard_normal((3, steps))
    before = white.copy()
    keep = np.exp(-0.1 / correlation_s)
    expected = white.copy()
    for k in range(1, steps):
        expected[:, k] = keep * expected[:, k - 1] + np.sqrt(1 - keep**2) * white[:, k]
    np.testing.assert_allclose(correlated(white, correlation_s, 0.1), expected, atol=1e-11)
    np.testing.assert_array_equal(white, before)  # the argument is left alone


def test_at_steps_takes_each_rows_own() -> None:
    value = np.arange(6.0).reshape(2, 3)
    np.testing.assert_array_equal(
        at_steps(value, np.array([[0, 0, 2], [1, 1, 1]])), [[0, 0, 2], [4, 4, 4]]
    )
