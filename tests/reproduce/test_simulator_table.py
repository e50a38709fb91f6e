"""Table 5 is written completely, and its files agree with one another."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest

from gaia_uwb._shared.errors import InputError
from gaia_uwb._shared.files import OutputFolder, visible
from gaia_uwb.reproduce.plan import Plan
from gaia_uwb.reproduce.simulator_table import (
    reproduce_table5,
    table5_json,
    table_latex,
    table_text,
)
from gaia_uwb.simulate.presets import load_preset
from gaia_uwb.simulate.reality.check import SimulatorCheck
from surveyed import make_runs

FILES = {
    "table5.csv", "table5.tex", "calibrated.yaml", "simulator-check.md",
    "simulator-check-quantiles.png", "simulator-check-quantiles.pdf",
    "simulator-check-autocorrelation.png", "simulator-check-autocorrelation.pdf",
}  # fmt: skip


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, SimulatorCheck]:
    folder = tmp_path_factory.mktemp("table5")
    plan = Plan(n_replays=1, n_passes=2)
    check = reproduce_table5(make_runs(), OutputFolder(folder), plan=plan, version="1.2.3")
    return folder, check


def test_all_files_are_there(written: tuple[Path, SimulatorCheck]) -> None:
    folder, _ = written
    assert {path.name for path in visible(folder)} == FILES


def test_results_hold_every_row_with_its_protocol(written: tuple[Path, SimulatorCheck]) -> None:
    _, check = written
    results = json.loads(json.dumps(table5_json(check), allow_nan=False))
    assert results["protocol"]["seed"] == 0
    assert len(results["rows"]) == len(check.rows)
    assert len(results["splits"]) == len(check.splits)
    first = results["rows"][0]
    assert (first["method"], first["view"], first["sight"]) == ("real", "corrected", "all")
    p95 = first["metrics"]["p95_m"]
    assert p95["ci95"][0] <= p95["value"] <= p95["ci95"][1]
    assert p95["unit"] == "m"


def test_tables_agree(written: tuple[Path, SimulatorCheck]) -> None:
    folder, check = written
    with (folder / "table5.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    for row, own in zip(rows, check.rows, strict=True):
        assert (row["view"], row["method"]) == (own.view.name, own.method)
        assert float(row["p99_m"]) == own.summary.p99_m
        assert float(row["mean_m_low"]) <= own.summary.mean_m <= float(row["mean_m_high"])
    page = (folder / "simulator-check.md").read_text(encoding="utf-8")
    assert f"{check.rows[0].summary.p95_m:.4f} [" in page
    for name in FILES:
        if name.endswith(".png"):
            assert f"({name})" in page


def test_latex_and_text_hold_all_readings(written: tuple[Path, SimulatorCheck]) -> None:
    _, check = written
    shown = [row for row in check.rows if row.sight == "all"]
    latex, text = table_latex(check.rows), table_text(check.rows)
    assert latex.count(r"\\") == 1 + 3 + len(shown)
    assert len(text.splitlines()) == 1 + 3 + len(shown)
    assert "0.5127 & 1.1279 & 0.0120 & 5.69 & 29.0" in latex


def test_the_fitted_preset_can_be_simulated(written: tuple[Path, SimulatorCheck]) -> None:
    folder, check = written
    assert load_preset(folder / "calibrated.yaml").ranging == check.fitted


def test_three_cases_are_too_few(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="at least 4 cases"):
        reproduce_table5(make_runs(("A/1", "A/2", "B/3")), OutputFolder(tmp_path), version="0")
