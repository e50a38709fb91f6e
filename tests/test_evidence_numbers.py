"""The benchmark of evidence: its drives, what it states of a vehicle, and how it counts."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import _peers
import evidence
from _peers import Place, Result
from evidence import ROWS, Row, cells, possible
from gaia_uwb import PipelineConfig
from road_tags import vehicle_with_tags

CELL = {name: k for k, name in enumerate(evidence.COLUMNS)}


def result(*cones: tuple[tuple[float, float], tuple[float, float], str, bool]) -> Result:
    """Return a drive's result: of each cone, how far off both places are, status, open side."""
    places = []
    for k, (off_m, other_m, status, is_open) in enumerate(cones):
        true_m = np.array([10.0 * k, 0.0])
        place = Place.of(
            f"c{k}", true_m, true_m + off_m, 0.01 * np.eye(2), true_m + other_m,
            mirror_probability=0.04, status=status,
        )  # fmt: skip
        places.append(Place(**{**vars(place), "side_is_open": is_open}))
    status = "ok" if all(cone[2] == "ok" for cone in cones) else "unreliable"
    return Result("drive", tuple(places), status, 2.0)


def test_every_row_drives_the_same_roads_with_what_its_name_says() -> None:
    scenes = {row.name: row.drive(3) for row in ROWS}
    first = scenes["one tag"]
    for row in ROWS:
        scene = scenes[row.name]
        assert scene.truth is not None
        assert first.truth is not None
        np.testing.assert_array_equal(scene.truth.anchor_m, first.truth.anchor_m)
        assert len(scene.tags) == len(row.levers)
        assert (scene.ranges.azimuth_rad is not None) == ("angles" in row.name or "all" in row.name)
        named = "between cones" in row.name or "all" in row.name
        assert (scene.cone_ranges is not None) == named


def test_what_is_known_of_a_vehicle_is_true_but_for_its_uncertainty(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(evidence, "make_config", lambda content: content)
    row = Row("calibrated", evidence.ACROSS, calibrated=True)
    pulls = []
    for seed in range(200):
        known = row.config(seed)["vehicles"][""]  # type: ignore[index]
        true = vehicle_with_tags(seed, evidence.ACROSS)
        stated = [known["clock_offset_s"], known["range_bias_m"]]
        stated += [known["tags"][f"t{k}"]["delay_m"] for k in (0, 1)]
        truths = [0.12, 0.15, *true.delays_m]
        pulls.append([(s["value"] - t) / s["sigma"] for s, t in zip(stated, truths, strict=True)])
    np.testing.assert_allclose(np.std(pulls, axis=0), 1.0, atol=0.15)
    assert Row("other", evidence.ONE).config(0) == PipelineConfig()


def test_a_row_that_cannot_be_computed_is_left_out_with_a_word(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(PipelineConfig, "model_fields", {}, raising=False)
    assert [row.name for row in ROWS if not row.calibrated] == [row.name for row in possible(ROWS)]
    assert capsys.readouterr().err.count("left out: ") == sum(row.calibrated for row in ROWS)
    page = evidence.page(7, [])
    assert "Not computed here: one tag, two tags" in page
    assert "--n 7 --table" in page


def test_the_cells_count_cones_sides_and_errors() -> None:
    good = ((0.1, 0.0), (0.0, 4.0), "ok", False)
    wrong = ((0.0, 4.0), (0.1, 0.0), "ok", False)
    open_ = ((0.3, 0.0), (0.0, 4.0), "ambiguous", True)
    row = cells(ROWS[0], [result(good, good, good), result(good, wrong, open_)])
    assert row[CELL["drives ok"]] == "1 of 2"
    assert row[CELL["cones ok"]] == "83.3 %"
    assert row[CELL["wrong sides (expected)"]] == "1 (0.2)"
    assert row[CELL["sides open"]] == "1 of 6"
    assert row[CELL["median error (m)"]] == "0.1"
    assert row[CELL["90 % ellipse"]].startswith("80.0 % of 5")
    assert row[CELL["nearer place (m)"]] == "0.1"
    assert float(row[CELL["but for a shift (m)"]]) < 1e-9
    assert row[CELL["processor (s)"]] == "2.0"
    none = cells(ROWS[0], [result(open_, open_)])
    assert none[CELL["median error (m)"]] == none[CELL["90 % ellipse"]] == "none"


def test_a_larger_number_of_drives_computes_the_further_ones(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    done: list[str] = []

    def ours(config: PipelineConfig) -> _peers.Method:
        def locate(passes: object) -> tuple[list[Place], str]:
            (scene,) = passes  # type: ignore[misc]
            done.append(scene.name)
            return list(result(((0.1, 0.0), (0.0, 4.0), "ok", False)).places), "ok"

        return locate

    monkeypatch.setattr(evidence, "ours", ours)
    for n in ("1", "3"):
        page = tmp_path / "page.md"
        options = ["--n", n, "--rows", "one tag", "--out", str(tmp_path), "--table", str(page)]
        evidence.main(options)
        assert f"| one tag | {n} of {n} |" in page.read_text(encoding="utf-8")
    assert done == ["road-tags-0", "road-tags-1", "road-tags-2"]
