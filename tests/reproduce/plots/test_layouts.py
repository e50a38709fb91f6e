"""A zone shows its true hull, each method's hull and anchors, turned level."""

from __future__ import annotations

import numpy as np

from gaia_uwb.reproduce.plots.layouts import DrawnZone, plot_layouts

SQUARE_M = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0], [2.0, 2.0]])
PATH_M = np.stack([np.linspace(-100.0, 100.0, 9), np.full(9, -2.0)], axis=1)


LONG_M = np.array([[0.0, 0.0], [30.0, 30.0], [31.0, 29.0], [1.0, -1.0]])


def test_hulls_are_those_of_the_places() -> None:
    found = {"gaia": SQUARE_M + 0.5, "kalman": SQUARE_M[:1], "mlp": SQUARE_M[:0]}
    (axes, other) = plot_layouts(
        [[DrawnZone("one", PATH_M, SQUARE_M, found)]] * 2, ["a", "b"]
    ).axes[:2]
    lines = {line.get_label(): line.get_xydata() for line in axes.lines}
    assert len(lines["GAIA"]) == 5  # four corners, and the first again
    np.testing.assert_allclose(np.ptp(lines["GAIA"], axis=0), 4.0, atol=2.0)
    (true,) = axes.patches
    moved = lines["GAIA"][:-1].mean(axis=0) - true.get_xy()[:4].mean(axis=0)
    np.testing.assert_allclose(np.hypot(*moved), np.hypot(0.5, 0.5))
    assert axes.get_aspect() == 1.0
    assert np.ptp(axes.get_xlim()) < 20.0  # the zone fills the panel, not the drive
    assert other.get_ylabel().startswith("b")


def test_a_long_zone_lies_level_with_a_scale_for_each_direction() -> None:
    axes = plot_layouts([[DrawnZone("one", PATH_M, LONG_M, {})]]).axes[0]
    (true,) = axes.patches
    length_m, width_m = np.ptp(true.get_xy(), axis=0)
    np.testing.assert_allclose([length_m, width_m], [np.hypot(30, 30), np.hypot(1, 1)])
    assert axes.get_aspect() == "auto"
