"""Evaluation: what is scored, what is left out, and what the methods may see."""

from __future__ import annotations

import csv
import io
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gaia_uwb._shared.errors import ConfigError, InputError
from gaia_uwb.api import load_scenes
from gaia_uwb.config import PipelineConfig, SolverConfig
from gaia_uwb.evaluate.scores import (
    episodes_csv,
    make_test,
    reconstruct_and_score,
    results_json,
    score_method,
)
from gaia_uwb.scene import Scene
from gaia_uwb.simulate import PRESETS, simulate_pass

CONFIG = PipelineConfig()


@pytest.fixture(scope="module")
def scenes() -> list[Scene]:
    return [
        replace(simulate_pass(PRESETS["lane-closure"], seed=s), name=f"run-{s}") for s in (1, 2)
    ]


def test_windows_are_cut_and_grouped_by_run(scenes: list[Scene]) -> None:
    test = make_test(scenes, 64, CONFIG)
    assert {e.n_steps for e in test.episodes} == {64}
    assert set(test.groups) == {"run-1", "run-2"}
    whole = make_test(scenes, None, CONFIG)
    assert len(whole.episodes) == 2
    possible = sum(e.n_steps // 64 for e in whole.episodes)
    assert len(test.episodes) + test.windows_without_ranges == possible


def test_truth_does_not_reach_the_methods(scenes: list[Scene]) -> None:
    scene = scenes[0]
    assert scene.truth is not None
    moved = replace(scene, truth=replace(scene.truth, anchor_m=scene.truth.anchor_m + 5.0))
    honest, metrics = reconstruct_and_score(scene, CONFIG)
    fooled, _ = reconstruct_and_score(moved, CONFIG)
    assert metrics is not None
    for a, b in zip(honest.anchors, fooled.anchors, strict=True):
        np.testing.assert_array_equal(a.position_m, b.position_m)
    blind, nothing = reconstruct_and_score(scene.without_truth(), CONFIG)
    assert nothing is None
    np.testing.assert_array_equal(blind.anchors[0].position_m, honest.anchors[0].position_m)


def test_results_name_what_was_done_and_are_json(scenes: list[Scene]) -> None:
    test = make_test(scenes, 64, CONFIG)
    scores = [score_method(test, name, CONFIG) for name in ("raw", "median")]
    results = results_json(scores, test, {"data": "sim"}, seed=3)
    assert [row["method"] for row in results["rows"]] == ["raw", "median"]
    assert results["protocol"]["episodes"] == len(test.episodes)
    assert results["protocol"]["seed"] == 3
    iou = results["rows"][0]["metrics"]["polygon_iou"]
    assert iou["ci95"][0] <= iou["value"] <= iou["ci95"][1]
    assert json.loads(json.dumps(results, allow_nan=False))["schema"] == 1
    rows = list(csv.DictReader(io.StringIO(episodes_csv(scores, test))))
    mean = np.mean(
        [float(r["value"]) for r in rows if r["method"] == "raw" and r["metric"] == "polygon_iou"]
    )
    assert mean == pytest.approx(iou["value"])


def test_true_labels_change_the_labelled_solver_only(scenes: list[Scene]) -> None:
    config = CONFIG.model_copy(update={"solver": SolverConfig(kind="wls")})
    test = make_test(scenes[:1], None, config)
    plain = score_method(test, "raw", config).per_episode[0]["anchor_mae"].value
    labelled = score_method(test, "raw", config, true_nlos_labels=True)
    assert labelled.per_episode[0]["anchor_mae"].value != plain
    with pytest.raises(ConfigError, match="wls"):
        score_method(test, "raw", CONFIG, true_nlos_labels=True)


def test_scenes_that_cannot_be_scored(scenes: list[Scene]) -> None:
    with pytest.raises(InputError, match="no surveyed anchors"):
        make_test([scenes[0].without_truth()], None, CONFIG)
    with pytest.raises(InputError, match="100000 steps"):
        make_test(scenes, 100_000, CONFIG)


@pytest.mark.real_data
def test_whole_runs_of_the_real_data(outdoor_dir: Path) -> None:
    """No truth, no label: the figures of the README, with a margin for other machines."""
    test = make_test(load_scenes("outdoor-uwb", data_dir=outdoor_dir), None, CONFIG)
    assert len(test.episodes) == 8
    results = results_json([score_method(test, "raw", CONFIG)], test, {}, seed=0)
    metrics = results["rows"][0]["metrics"]
    assert metrics["anchor_mae"]["value"] <= 0.080
    assert metrics["polygon_iou"]["value"] >= 0.87
    assert metrics["polygon_hausdorff"]["value"] <= 0.105
    assert metrics["ellipse_coverage_90_aligned"]["value"] >= 0.80


@pytest.mark.real_data
def test_short_windows_of_the_real_data(outdoor_dir: Path) -> None:
    test = make_test(load_scenes("outdoor-uwb", data_dir=outdoor_dir), 64, CONFIG)
    assert len(test.episodes) + test.windows_without_ranges == 223
    results = results_json([score_method(test, "gaia-set", CONFIG)], test, {}, seed=0)
    metrics = results["rows"][0]["metrics"]
    assert metrics["distance_mse_overall"]["value"] <= 0.022
    assert metrics["polygon_iou"]["value"] >= 0.41
    assert metrics["polygon_hausdorff"]["value"] <= 3.4
