"""Tables: means over all models, differences of each episode's mean over models."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from gaia_uwb.evaluate.metrics import Metric
from gaia_uwb.reproduce.predictions import Predictions
from gaia_uwb.reproduce.scores import Row, Table, difference, table_json
from tiny_models import make_run

NOTHING = Predictions((), {}, 0.0, "")


def make_row(method: str, *models: Sequence[float | None], split: str = "") -> Row:
    scores = tuple(
        tuple({} if v is None else {"polygon_iou": Metric("polygon_iou", v, "", 1)} for v in model)
        for model in models
    )
    return Row(method, split, (NOTHING,) * len(models), scores)


GROUPS = ("run-1", "run-1", "run-2")


def test_a_difference_is_paired_by_episode_and_averages_models() -> None:
    ours = make_row("gaia", [0.5, 0.6, 0.9], [0.7, 0.6, 0.9])
    theirs = make_row("kalman", [0.4, 0.4, 0.7])
    found = difference(ours, theirs, GROUPS, "polygon_iou")
    assert found is not None
    assert found["value"] == pytest.approx(0.2)
    np.testing.assert_allclose(found["ci95"], 0.2)
    assert found["n"] == 3


def test_episodes_without_the_metric_are_left_out_of_the_pair() -> None:
    ours, theirs = make_row("gaia", [0.5, None, 0.9]), make_row("kalman", [0.4, 0.4, 0.7])
    found = difference(ours, theirs, GROUPS, "polygon_iou")
    assert found is not None
    assert found["n"] == 2
    assert found["value"] == pytest.approx(0.15)
    assert difference(ours, theirs, GROUPS, "anchor_mae") is None


def test_a_table_pairs_within_a_split_only() -> None:
    rows = (
        make_row("kalman", [0.1, 0.2, 0.3]),
        make_row("mlp", [0.2, 0.3, 0.4], split="window"),
        make_row("mlp", [0.3, 0.3, 0.3], split="sim"),
        make_row("gaia", [0.5, 0.6, 0.7], split="window"),
        make_row("gaia", [0.5, 0.5, 0.5], split="sim"),
    )
    table = Table({}, tuple(make_run(k) for k in range(3)), GROUPS, "wls", rows)
    content = table_json(table)
    pairs = {(d["minus"], d["split"]): d["metrics"]["polygon_iou"]["value"]
             for d in content["differences"]}  # fmt: skip
    assert set(pairs) == {(m, s) for m in ("kalman", "mlp") for s in ("window", "sim")}
    assert pairs["mlp", "window"] == pytest.approx(0.3)
    assert pairs["kalman", "sim"] == pytest.approx(0.3)
    assert content["rows"][0]["metrics"]["polygon_iou"]["value"] == pytest.approx(0.2)
    assert content["protocol"] == {"episodes": 3, "runs": 2}
