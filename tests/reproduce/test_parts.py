"""One command makes everything; what it made is found again, and never mixed with other code's."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import pytest

from gaia_uwb.reproduce import parts
from gaia_uwb.reproduce.page import results_page
from gaia_uwb.reproduce.parts import PARTS, read_results, run_all, run_part
from tiny import TINY, make_workshop

pytest.importorskip("torch", reason="PyTorch is not installed: no model can be trained here")

FIGURES = {
    "cdf-outdoor", "cdf-stress", "box-outdoor", "box-stress", "robustness", "layouts", "losses",
    "error-distance", "gate",
}  # fmt: skip


def plain(content: dict[str, Any]) -> dict[str, Any]:
    """Return content as it comes back from a file."""
    back: dict[str, Any] = json.loads(json.dumps(content))
    return back


def load(folder: Path) -> dict[str, Any]:
    content: dict[str, Any] = json.loads((folder / "results.json").read_text(encoding="utf-8"))
    return content


def check_all_parts_and_files_are_there(made: Path) -> None:
    results = load(made)
    assert set(results["parts"]) == set(PARTS)
    assert {path.stem for path in (made / "figures").glob("*.pdf")} == FIGURES
    assert {path.stem for path in (made / "figures").glob("*.png")} == FIGURES
    for table in ("table1", "table2", "ablation", "table4", "table5", "alignment"):
        for kind in ("csv", "tex"):
            text = (made / f"{table}.{kind}").read_text(encoding="utf-8")
            assert "QUICK RUN" in text.splitlines()[0], f"{table}.{kind}"
    assert results["parts"]["table2"]["cost"]["training_s"] > 0


def check_every_cell_is_filled(made: Path) -> None:
    tables = load(made)["parts"]["table1"]["tables"]
    assert set(tables) == {"aligned/64/wls", "aligned/64/robust", "aligned/whole/wls",
                           "aligned/whole/robust"}  # fmt: skip
    for table in tables.values():
        rows = {(row["method"], row["split"]) for row in table["rows"]}
        assert {("raw", ""), ("gaia", "layout"), ("gaia", "sim"), ("mlp", "sim")} <= rows
        counts = {row["metrics"]["polygon_iou"]["n"] / row["models"] for row in table["rows"]}
        assert counts == {table["protocol"]["episodes"]}
        pairs = {(d["method"], d["minus"], d["split"]) for d in table["differences"]}
        assert ("gaia", "pose-mlp", "layout") in pairs


def check_a_second_call_gives_the_same_digits_and_trains_nothing(made: Path) -> None:
    before = load(made)["parts"]["table2"]
    weights = (made / "models/gaia-seed0/weights.safetensors").stat().st_mtime_ns
    again = run_part(make_workshop(made), "table2")
    assert plain(again["tables"]) == before["tables"]
    assert (made / "models/gaia-seed0/weights.safetensors").stat().st_mtime_ns == weights


def check_another_folder_gives_the_same_digits(made: Path, other: Path) -> None:
    again = run_part(make_workshop(other), "table2")
    assert plain(again["tables"]) == load(made)["parts"]["table2"]["tables"]


def check_page_shows_all_of_it(made: Path) -> None:
    page = results_page(load(made), "By hand.", "images")
    assert "QUICK RUN" in page
    assert "By hand." in page
    assert "Not made" not in page
    for name in FIGURES:
        assert f"(images/{name}.png)" in page
    row = load(made)["parts"]["table2"]["tables"]["table2"]["rows"][0]
    assert f"| raw | {row['metrics']['distance_mse_overall']['value']:.3f} [" in page
    assert "*paper: GAIA*" in page


def check_csv_holds_what_the_results_hold(made: Path) -> None:
    with (made / "table2.csv").open(encoding="utf-8", newline="") as file:
        assert file.readline().startswith("# QUICK RUN")
        rows = list(csv.DictReader(file))
    found = {(r["method"], r["minus"], r["metric"]): float(r["value"]) for r in rows}
    table = load(made)["parts"]["table2"]["tables"]["table2"]
    for row in table["rows"]:
        iou = row["metrics"]["polygon_iou"]["value"]
        assert found[row["method"], "", "polygon_iou"] == iou
    assert TINY.n_test == table["protocol"]["episodes"]


@pytest.mark.slow
def test_one_command_makes_everything(tmp_path: Path) -> None:
    made = tmp_path / "all"
    run_all(make_workshop(made))
    check_all_parts_and_files_are_there(made)
    check_every_cell_is_filled(made)
    check_page_shows_all_of_it(made)
    check_csv_holds_what_the_results_hold(made)
    check_a_second_call_gives_the_same_digits_and_trains_nothing(made)
    check_another_folder_gives_the_same_digits(made, tmp_path / "other")


def test_parts_of_another_plan_are_left_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(PARTS, "table5", lambda workshop: {"found": 1})
    workshop = make_workshop(tmp_path)
    run_part(workshop, "table5")
    assert set(read_results(workshop)["parts"]) == {"table5"}
    monkeypatch.setattr(parts, "_part_key", lambda workshop: "other code")
    assert read_results(workshop)["parts"] == {}


def test_a_missing_part_is_named_on_the_page(tmp_path: Path) -> None:
    page = results_page(read_results(make_workshop(tmp_path)), "", "images")
    assert "`gaia reproduce table1`" in page
