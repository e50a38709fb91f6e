"""The pictures show what they say."""

from __future__ import annotations

import numpy as np

from gaia_uwb.reproduce.plots.errors import (
    plot_autocorrelation,
    plot_error_over_distance,
    plot_quantiles,
)


def test_equal_errors_lie_on_the_diagonal() -> None:
    track = np.random.default_rng(0).normal(0.0, 0.2, 5000)
    figure = plot_quantiles([track], {"calibrated": [track[:2000], track[2000:]]})
    for axes in figure.axes:
        points, diagonal = axes.lines
        np.testing.assert_allclose(points.get_xdata(), points.get_ydata())
        np.testing.assert_allclose(diagonal.get_xdata(), diagonal.get_ydata())


def test_memory_is_drawn_over_seconds() -> None:
    rng = np.random.default_rng(1)
    white = [rng.standard_normal(2000) for _ in range(3)]
    constant = [np.full(2000, offset_m) for offset_m in (-1.0, 1.0)]
    figure = plot_autocorrelation({"real": white, "other": constant}, rate_hz=5.0, clip_m=2.0)
    lines = {line.get_label(): line for line in figure.axes[0].lines}
    assert lines["real"].get_xdata()[-1] == 30.0
    assert np.abs(lines["real"].get_ydata()[1:]).max() < 0.1
    np.testing.assert_allclose(lines["other"].get_ydata(), 1.0)


def test_growth_with_distance_is_drawn_from_bins_that_hold_enough() -> None:
    distance_m = np.repeat([5.0, 10.0, 20.0, 40.0], [100, 100, 100, 3])
    figure = plot_error_over_distance({"data": {"gaia": (distance_m, -0.1 * distance_m)}})
    median, exceeded = figure.axes[0].lines
    np.testing.assert_allclose(median.get_ydata(), 0.1 * np.asarray(median.get_xdata()))
    np.testing.assert_allclose(exceeded.get_ydata()[0], 0.5)
    assert max(median.get_xdata()) < 40.0
