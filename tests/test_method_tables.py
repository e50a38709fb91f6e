"""Tables of methods: every row is there, models are kept, and a second call trains nothing."""

from __future__ import annotations

from pathlib import Path

import pytest

from gaia_uwb import method_tables
from gaia_uwb.files import OutputFolder
from gaia_uwb.method_tables import (
    ALL_METHODS,
    CLASSICAL,
    LEARNED,
    Method,
    TableJob,
    outdoor_table,
    results_table,
    stress_table,
)
from gaia_uwb.recipes import Recipe
from surveyed import make_runs

pytest.importorskip("torch", reason="PyTorch is not installed: no model can be trained here")

SIZES = {"base_hidden": 8, "gru_hidden": 8, "layout_hidden": 8, "head_hidden": 8}


def tiny(recipe: Recipe) -> Recipe:
    """Return a recipe that takes a blink."""
    kind = recipe.network.kind
    sizes = SIZES if kind == "gaia" else {"hidden": 8}
    return recipe.model_copy(
        update={
            "network": recipe.network.model_copy(update=sizes),
            "training": recipe.training.model_copy(update={"epochs": 1}),
            "sets": recipe.sets.model_copy(
                update={
                    "n_training": 8,
                    "n_validation": 4,
                    "window_steps": 32,
                    "training_stride": 32,
                }
            ),
        }
    )


def make_job(folder: Path, seeds: int, said: list[str]) -> TableJob:
    return TableJob(OutputFolder(folder), range(seeds), "1.2.3", tiny, said.append)


@pytest.fixture
def few_episodes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(method_tables, "N_TEST", 3)


@pytest.mark.usefixtures("few_episodes")
def test_stress_table_has_every_method_and_seed(tmp_path: Path) -> None:
    said: list[str] = []
    results = stress_table((Method("raw"), *LEARNED), make_job(tmp_path, 2, said))
    rows = {row["method"]: row["metrics"] for row in results["rows"]}
    assert list(rows) == ["raw", "mlp", "pose-mlp", "gaia"]
    assert rows["raw"]["polygon_iou"]["n"] == 3
    assert rows["gaia"]["polygon_iou"]["n"] == 6  # 3 episodes, 2 seeds
    assert results["protocol"]["episodes"] == 3
    assert results["protocol"]["true_nlos_labels"] is True
    models = sorted(path.name for path in (tmp_path / "models").iterdir())
    assert models == [f"{kind}-seed{k}" for kind in ("gaia", "mlp", "pose-mlp") for k in (0, 1)]


@pytest.mark.usefixtures("few_episodes")
def test_a_second_call_gives_the_same_numbers_from_the_same_models(tmp_path: Path) -> None:
    first = stress_table(LEARNED[1:], make_job(tmp_path, 1, []))
    weights = (tmp_path / "models/gaia-seed0/weights.safetensors").read_bytes()
    second = stress_table(LEARNED[1:], make_job(tmp_path, 1, []))
    assert first == second
    assert (tmp_path / "models/gaia-seed0/weights.safetensors").read_bytes() == weights


def test_outdoor_table_scores_every_window_with_the_model_that_has_not_seen_it(
    tmp_path: Path,
) -> None:
    runs = make_runs(("A/1", "B/4"))
    paper, robust = outdoor_table(runs, "layout", "aligned", make_job(tmp_path, 1, []))
    assert [row["method"] for row in paper["rows"]] == [method.name for method in ALL_METHODS]
    assert paper["protocol"]["true_nlos_labels"] is True
    assert robust["protocol"]["true_nlos_labels"] is False
    for table in (paper, robust):
        counts = {row["metrics"]["distance_mse_overall"]["n"] for row in table["rows"]}
        assert counts == {table["protocol"]["episodes"]}
        assert table["protocol"]["runs"] == 4
    kept = sorted(path.name for path in (tmp_path / "models").iterdir())
    assert kept == ["aligned-layout-0", "aligned-layout-1"]


def test_table_as_markdown_shows_intervals_and_what_is_missing() -> None:
    metric = {"value": 0.25, "ci95": [0.2, 0.3], "n": 3, "unit": ""}
    lonely = {"value": 12.0, "ci95": None, "n": 1, "unit": "m"}
    table = {"rows": [{"method": "raw", "metrics": {"polygon_iou": metric, "anchor_mae": lonely}}]}
    line = results_table(table).splitlines()[2]
    assert line == "| raw | none | none | none | 12.000 | 0.2500 [0.200, 0.300] | none |"


def test_classical_methods_exist() -> None:
    from gaia_uwb.denoisers import DENOISERS

    assert set(CLASSICAL) | {method.name for method in LEARNED} == set(DENOISERS)
