"""The robustness table: every cell is there, margins are those of its numbers, curves drawn."""

from __future__ import annotations

import csv
import io
from pathlib import Path
from typing import Any

import pytest

from gaia_uwb import method_tables
from gaia_uwb.files import OutputFolder
from gaia_uwb.method_tables import Method, TableJob
from gaia_uwb.robustness import (
    BASELINES,
    plot_robustness,
    robustness_csv,
    robustness_summary,
    robustness_table,
)
from gaia_uwb.stressors import STRESSORS


def made_up() -> dict[str, Any]:
    """Return results in which GAIA leads by 0.1 at the first setting and trails at the last."""
    rows = []
    for stressor in STRESSORS[:2]:
        for k, setting in enumerate(stressor.settings):
            for m, method in enumerate((*BASELINES, "gaia")):
                value = 0.5 - 0.01 * m if method != "gaia" else 0.6 - 0.05 * k
                metric = {"value": value, "ci95": (value - 0.02, value + 0.02), "n": 9}
                rows.append(
                    {
                        "stressor": stressor.name,
                        "setting": setting,
                        "method": method,
                        "metrics": {"polygon_iou": metric},
                    }
                )
    return {"rows": rows}


def test_summary_gives_the_margin_over_the_best_baseline() -> None:
    lines = robustness_summary(made_up()).splitlines()
    assert len(lines) == 4
    assert lines[2].endswith("| 0.600 | 0.400 | 0.500 (kalman) | -0.100 |")


def test_csv_has_every_cell() -> None:
    rows = list(csv.DictReader(io.StringIO(robustness_csv(made_up()))))
    assert len(rows) == 2 * 5 * 5
    assert {row["metric"] for row in rows} == {"polygon_iou"}
    assert float(rows[0]["low"]) < float(rows[0]["value"]) < float(rows[0]["high"])


def test_the_picture_has_a_curve_for_every_method_in_every_panel() -> None:
    figure = plot_robustness(made_up())
    panels = [axes for axes in figure.axes if axes.lines]
    assert len(panels) == 2
    assert all(len(axes.lines) == len(BASELINES) + 1 for axes in panels)


def test_classical_methods_get_worse_under_noise(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(method_tables, "N_TEST", 4)
    job = TableJob(
        OutputFolder(tmp_path),
        (0,),
        "1.2.3",
        lambda recipe: recipe.model_copy(
            update={"sets": recipe.sets.model_copy(update={"n_training": 1, "n_validation": 1})}
        ),
    )
    results = robustness_table([Method("raw"), Method("kalman")], job, stressors=STRESSORS[:1])
    assert len(results["rows"]) == 5 * 2
    raw = [row for row in results["rows"] if row["method"] == "raw"]
    errors = [row["metrics"]["distance_mse_overall"]["value"] for row in raw]
    assert errors == sorted(errors)
    assert errors[-1] > errors[0] + 10.0
