from __future__ import annotations

import numpy as np
from hypothesis import given, settings, strategies as st
from hypothesis.extra import numpy as hnp

from gaia_uwb.denoisers._robust import (
    GateOptions,
    column_median,
    local_line,
    noise_m,
    running_median,
    without_spikes,
)


def times(n_steps: int, columns: int = 1) -> np.ndarray:
    return np.repeat((np.arange(n_steps) * 0.125)[:, None], columns, axis=1)


@settings(max_examples=50, deadline=None)
@given(
    values=hnp.arrays(
        np.float64, hnp.array_shapes(min_dims=2, max_dims=2, max_side=9),
        elements=st.one_of(st.just(np.nan), st.floats(-100.0, 100.0)),
    ),
    half=st.integers(0, 4),
)  # fmt: skip
def test_medians_are_those_of_the_finite_values(values: np.ndarray, half: int) -> None:
    for column, found in zip(values.T, column_median(values), strict=True):
        finite = column[np.isfinite(column)]
        np.testing.assert_array_equal(found, np.median(finite) if len(finite) else np.nan)
    t_s = times(*values.shape)
    median, count = running_median(t_s, values, np.zeros(values.shape), half)
    for (k, c), found in np.ndenumerate(median):
        first = max(min(k - half, len(values) - 2 * half - 1), 0)
        window = values[first : first + 2 * half + 1, c]
        finite = window[np.isfinite(window)]
        assert count[k, c] == len(finite)
        np.testing.assert_array_equal(found, np.median(finite) if len(finite) else np.nan)


def test_a_line_follows_a_ramp_through_bursts() -> None:
    t_s = times(60)
    true_m = 50.0 - 12.0 * t_s
    value_m = true_m.copy()
    value_m[[0, 1, 2]] -= 9.0
    value_m[[30, 31]] += 46.0
    line = local_line(t_s, value_m, 10)
    np.testing.assert_allclose(line.level_m, true_m, atol=1e-9)
    np.testing.assert_allclose(line.rate_mps, -12.0, atol=1e-9)
    np.testing.assert_allclose(line.spread_m, 0.0, atol=1e-9)
    kept = without_spikes(value_m, line, GateOptions())
    assert np.flatnonzero(np.isnan(kept)).tolist() == [0, 1, 2, 30, 31]


def test_a_level_line_does_not_follow() -> None:
    t_s = times(61)
    line = local_line(t_s, 2.0 * t_s, 10, sloped=False)
    assert not line.rate_mps.any()
    np.testing.assert_allclose(line.level_m[10:-10], 2.0 * t_s[10:-10])
    np.testing.assert_allclose(line.level_m[:10], 2.0 * t_s[10, 0])


def test_readings_are_no_spikes_where_the_range_bends_hard() -> None:
    """A pass at 20 m/s, 5 m away, bends the range by more than 1 m from step to step."""
    t_s = times(161)
    true_m = np.hypot(20.0 * (t_s - 10.0), 5.0)
    kept = without_spikes(true_m, local_line(t_s, true_m, 10), GateOptions())
    assert np.isfinite(kept).all()


def test_the_noise_is_found_beside_slope_and_bursts_and_has_a_floor() -> None:
    rng = np.random.default_rng(0)
    t_s = times(2000, 3)
    value_m = 5.0 * t_s + rng.standard_normal(t_s.shape) * [0.1, 0.4, 0.0]
    value_m[::40] -= 7.0
    value_m[1::40] -= 7.0
    found = noise_m(local_line(t_s, value_m, 10))
    np.testing.assert_allclose(found, [0.1, 0.4, 0.05], rtol=0.15)


def test_no_readings_give_no_line() -> None:
    t_s = times(30)
    line = local_line(t_s, np.full(t_s.shape, np.nan), 10)
    assert np.isnan(line.level_m).all()
    assert np.isnan(line.spread_m).all()
    assert not line.rate_mps.any()
    np.testing.assert_array_equal(noise_m(line), [0.05])
