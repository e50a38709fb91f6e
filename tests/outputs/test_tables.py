from __future__ import annotations

import csv
import io
from dataclasses import replace

import pytest

from gaia_uwb.config import PipelineConfig
from gaia_uwb.outputs.tables import cones_csv
from gaia_uwb.pipeline import reconstruct
from gaia_uwb.reconstruction import Reconstruction
from gaia_uwb.simulate import PRESETS, simulate_pass


@pytest.fixture(scope="module")
def result() -> Reconstruction:
    scene = simulate_pass(PRESETS["lane-closure"], seed=0).without_truth()
    ids = ("=cmd|'/c calc'!A0", "@SUM(A1:A9)", "\x1b[2J", "a\0b", "-12", *scene.anchor_ids[5:])
    return reconstruct(replace(scene, anchor_ids=ids), PipelineConfig(denoiser="raw"))


def test_no_cell_of_the_cones_runs_or_steers(result: Reconstruction) -> None:
    text = cones_csv(result)
    assert text.replace("\n", "").isprintable()
    rows = list(csv.DictReader(io.StringIO(text, newline="")))
    assert [row["anchor_id"] for row in rows[:5]] == [
        "'=cmd|'/c calc'!A0",
        "'@SUM(A1:A9)",
        r"\x1b[2J",
        r"a\x00b",
        "-12",
    ]


def test_numbers_of_the_cones_read_back_equal(result: Reconstruction) -> None:
    rows = list(csv.DictReader(io.StringIO(cones_csv(result), newline="")))
    for row, anchor in zip(rows, result.anchors, strict=True):
        assert (float(row["east_m"]), float(row["north_m"])) == tuple(anchor.position_m)
        assert row["side_is_open"] == str(anchor.side_is_open).lower()
        assert int(row["n_ranges"]) == anchor.n_ranges
