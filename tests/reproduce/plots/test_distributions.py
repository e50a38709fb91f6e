"""Distribution functions rise from 0 to 1 over the scores, boxes show their quartiles."""

from __future__ import annotations

import numpy as np

from gaia_uwb.reproduce.plots.distributions import plot_boxes, plot_cdfs

SCORES = {"IoU": {"raw": np.array([0.1, np.nan, 0.3]), "gaia": np.array([0.2, 0.4, 0.6])}}


def test_cdf_counts_episodes() -> None:
    raw, gaia = plot_cdfs(SCORES).axes[0].lines
    np.testing.assert_allclose(raw.get_xdata(), [0.1, 0.1, 0.3])
    np.testing.assert_allclose(raw.get_ydata(), [0.0, 0.5, 1.0])
    np.testing.assert_allclose(gaia.get_ydata(), [0.0, 1 / 3, 2 / 3, 1.0])


def test_boxes_have_the_median_of_what_is_there() -> None:
    axes = plot_boxes(SCORES).axes[0]
    assert [label.get_text() for label in axes.get_xticklabels()] == ["raw", "GAIA"]
    flat = [line.get_ydata()[0] for line in axes.lines if np.ptp(line.get_ydata()) == 0]
    assert {0.2, 0.4} <= set(np.round(flat, 9))
