"""A curve and a band for every method in every panel; milder settings come first."""

from __future__ import annotations

from typing import Any

from gaia_uwb.reproduce.plots.robustness import plot_robustness


def make_results() -> dict[str, Any]:
    rows = []
    for stressor, settings in (("noise", (0.0, 1.0, 2.0)), ("anchors", (12.0, 8.0, 4.0))):
        for method in ("kalman", "gaia"):
            for setting in settings:
                metric = {"value": 0.5, "ci95": (0.4, 0.6)}
                rows.append(
                    {
                        "stressor": stressor,
                        "setting": setting,
                        "method": method,
                        "metrics": {"polygon_iou": metric},
                    }
                )
    return {"titles": {"noise": "noise (m)", "anchors": "anchors kept"}, "rows": rows}


def test_every_panel_has_every_method() -> None:
    noise, anchors = (axes for axes in plot_robustness(make_results()).axes if axes.lines)
    for axes in (noise, anchors):
        assert [line.get_label() for line in axes.lines] == ["Kalman", "GAIA"]
        assert len(axes.collections) == 2
    assert noise.get_xlabel() == "noise (m)"
    assert not noise.xaxis_inverted()
    assert anchors.xaxis_inverted()
