"""The pictures show what they say, and the same picture gives the same file."""

from __future__ import annotations

import numpy as np

from gaia_uwb.error_plots import figure_svg, plot_autocorrelation, plot_quantiles


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


def test_svg_is_reproducible() -> None:
    track = np.linspace(-1.0, 1.0, 50)
    first, second = (figure_svg(plot_quantiles([track], {"naive": [track]})) for _ in range(2))
    assert first == second
    assert first.startswith(b"<?xml")
