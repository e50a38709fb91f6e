"""``gaia reproduce``: options reach the plan, and what is made is shown and marked."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from gaia_uwb.cli import app
from gaia_uwb.reproduce import parts
from gaia_uwb.reproduce.workshop import Workshop


def run(*arguments: object) -> None:
    app([str(word) for word in arguments], standalone_mode=False)


@pytest.fixture
def plans(monkeypatch: pytest.MonkeyPatch) -> list[Workshop]:
    """Replace every part by one that only notes what it was asked for."""
    asked: list[Workshop] = []

    def note(workshop: Workshop) -> dict[str, object]:
        asked.append(workshop)
        return {}

    for name in parts.PARTS:
        monkeypatch.setitem(parts.PARTS, name, note)
    return asked


def test_options_of_table1_reach_the_plan(tmp_path: Path, plans: list[Workshop]) -> None:
    run(
        "reproduce", "table1", "--split", "layout", "--split", "sim", "--preparation", "aligned",
        "--seeds", 2, "--workers", 3, "--out", tmp_path,
    )  # fmt: skip
    (workshop,) = plans
    assert workshop.plan.splits == ("layout", "sim")
    assert workshop.plan.preparations == ("aligned",)
    assert workshop.plan.outdoor_seeds == (0, 1)
    assert workshop.workers == 3
    assert workshop.plan.quick is False


@pytest.mark.parametrize("part", ["table2", "ablation", "table4"])
def test_a_quick_run_says_so(
    part: str, tmp_path: Path, plans: list[Workshop], capsys: pytest.CaptureFixture[str]
) -> None:
    run("reproduce", part, "--quick", "--out", tmp_path)
    assert plans[0].plan.quick is True
    assert json.loads((tmp_path / "results.json").read_text())["quick"] is True
    assert "QUICK RUN" in capsys.readouterr().out


def test_the_page_includes_the_text_beside_it(tmp_path: Path) -> None:
    page = tmp_path / "docs" / "results.md"
    page.parent.mkdir()
    (page.parent / "results-prose.md").write_text("What it means.\n")
    run("reproduce", "page", "--out", tmp_path / "out", "--page", page)
    assert "What it means." in page.read_text()
