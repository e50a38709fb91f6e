"""Numbers come out as they went in, beside the paper's, and a quick run is marked."""

from __future__ import annotations

import csv
import io
from typing import Any

import pytest

from gaia_uwb.reproduce.formats import (
    cell,
    differences_markdown,
    latex_table,
    marked,
    results_csv,
    results_markdown,
)
from gaia_uwb.reproduce.paper import METRICS, TABLE_1
from gaia_uwb.reproduce.plan import QUICK, Plan


def make_metric(value: float) -> dict[str, Any]:
    return {"value": value, "ci95": (value - 0.1, value + 0.1), "n": 9}


TABLE: dict[str, Any] = {
    "rows": [
        {"method": "raw", "split": "", "metrics": {"polygon_iou": make_metric(0.2)}},
        {"method": "gaia", "split": "window", "metrics": {"polygon_iou": make_metric(0.5)}},
        {"method": "gaia", "split": "sim", "metrics": {"polygon_iou": make_metric(0.1)}},
    ],
    "differences": [
        {
            "method": "gaia",
            "minus": "raw",
            "split": "window",
            "metrics": {"polygon_iou": make_metric(0.3)},
        }
    ],
}


def test_the_papers_row_stands_below_the_last_of_its_method() -> None:
    lines = results_markdown(TABLE, TABLE_1).splitlines()
    assert lines[3].startswith("| gaia | window | nothing to count ")
    assert "0.5000 [0.400, 0.600]" in lines[3]
    assert lines[5] == (
        "| *paper: GAIA* |  | *0.1414* | *0.1098* | *0.1529* | *2.249* | *0.239* | *3.724* |"
    )
    assert len(lines) == 6


def test_differences_carry_their_sign() -> None:
    line = differences_markdown(TABLE, ["polygon_iou"]).splitlines()[2]
    assert line == "| gaia − raw | window | +0.3000 [0.200, 0.400] |"
    assert cell({"value": -0.5, "ci95": None}, signed=True) == "-0.5000"


def test_csv_reads_back() -> None:
    rows = list(csv.DictReader(io.StringIO(results_csv({"t": TABLE}))))
    assert [(r["method"], r["minus"], r["split"]) for r in rows] == [
        ("raw", "", ""),
        ("gaia", "", "window"),
        ("gaia", "", "sim"),
        ("gaia", "raw", "window"),
    ]
    assert float(rows[1]["value"]) == 0.5


def test_latex_has_a_cell_for_every_column() -> None:
    text = latex_table(TABLE, TABLE_1)
    lines = [line for line in text.splitlines() if line.endswith(r"\\")]
    assert len(lines) == 1 + 2 * len(TABLE["rows"]) + len(TABLE_1)
    assert {line.count("&") for line in lines} == {1 + len(METRICS)}


@pytest.mark.parametrize(("name", "comment"), [("a.csv", "# "), ("a.tex", "% "), ("a.md", "**")])
def test_a_quick_run_says_so_first(name: str, comment: str) -> None:
    assert marked(name, "text", QUICK).startswith(f"{comment}QUICK RUN")
    assert marked(name, "text", Plan()) == "text"
