"""Margins are told as they are, also where they are not positive."""

from __future__ import annotations

import csv
import io
from typing import Any

from gaia_uwb.reproduce.robustness_formats import (
    robustness_csv,
    robustness_latex,
    summary_markdown,
)


def made_up(margin: float, low: float) -> dict[str, Any]:
    def metric(value: float) -> dict[str, Any]:
        return {"value": value, "ci95": (value - 0.02, value + 0.02), "n": 9}

    rows = [
        {
            "stressor": "outliers",
            "setting": setting,
            "method": method,
            "metrics": {"polygon_iou": metric(value)},
        }
        for setting, value in ((0.0, 0.6), (0.2, 0.4))
        for method in ("kalman", "gaia")
    ]
    margins = [
        {
            "stressor": "outliers",
            "setting": setting,
            "best": "kalman",
            "margin": {"value": margin, "ci95": (low, margin + 0.1), "n": 9},
        }
        for setting in (0.0, 0.2)
    ]
    return {"titles": {"outliers": "added outlier rate"}, "rows": rows, "margins": margins}


def test_summary_has_both_ends_and_the_papers_numbers() -> None:
    lines = summary_markdown(made_up(0.05, 0.01)).splitlines()
    assert lines[2] == (
        "| added outlier rate: 0 to 0.2 | 0.6000 [0.580, 0.620] | 0.4000 [0.380, 0.420] | kalman | "
        "+0.0500 [0.010, 0.150] | 0.429, 0.364, +0.044 |"
    )
    assert lines[-1].endswith("is positive at the most severe setting of every stressor.")


def test_a_margin_that_is_not_positive_is_named() -> None:
    last = summary_markdown(made_up(-0.05, -0.1)).splitlines()[-1]
    assert last.endswith("not positive at the most severe setting of: added outlier rate, -0.050.")
    unsure = summary_markdown(made_up(0.05, -0.1)).splitlines()[-1]
    assert unsure.endswith("Its interval contains 0 for: added outlier rate.")


def test_csv_and_latex_have_every_row() -> None:
    results = made_up(0.05, 0.01)
    assert len(list(csv.DictReader(io.StringIO(robustness_csv(results))))) == 4
    assert r"$+0.050$ [+0.010, +0.150]" in robustness_latex(results)
