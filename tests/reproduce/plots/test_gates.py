"""The gate stands below the errors that it answers to."""

from __future__ import annotations

import numpy as np

from gaia_uwb.reproduce.plots.gates import GateRecord, plot_gate


def test_a_column_for_each_record() -> None:
    t_s, gate = np.arange(5.0), np.array([0.1, 0.2, np.nan, 0.4, 0.5])
    record = GateRecord("run", t_s, t_s, 0.5 * t_s, 0.1 * t_s, gate, t_s > 2.0)
    figure = plot_gate([record, record])
    errors, other, below, _ = figure.axes
    assert [line.get_label() for line in errors.lines] == [
        "measured",
        "layout's distance",
        "denoised",
    ]
    np.testing.assert_allclose(errors.lines[2].get_ydata(), 0.5 * t_s)
    np.testing.assert_array_equal(below.lines[0].get_ydata(), gate)
    np.testing.assert_allclose(below.lines[1].get_ydata(), 0.3)
    assert below.get_ylim() == (0.0, 1.0)
    assert other.get_title(loc="left") == "run"
