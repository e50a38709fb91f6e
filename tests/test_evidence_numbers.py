"""The benchmark of evidence: its drives, what it states of a vehicle, and how it counts."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import _peers
import evidence
from _peers import Place, Result
from evidence import ROWS, Row, cells
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


def test_a_calibrated_vehicle_is_one_that_other_drives_calibrated() -> None:
    row = Row("calibrated", evidence.ACROSS, calibrated=True)
    pulls = []
    for seed in range(3):
        vehicle = row.vehicle(seed)
        assert vehicle is not None
        delays_m = vehicle_with_tags(seed, evidence.ACROSS).delays_m
        apart = [vehicle.tags[f"t{k}"].delay_m for k in (0, 1)]
        known = [vehicle.clock_offset_s, vehicle.range_bias_m, *apart]
        middle_m = delays_m.mean()
        truths = [0.12, 0.15 + middle_m, *(delays_m - middle_m)]
        for found, true in zip(known, truths, strict=True):
            assert found is not None
            pulls.append((found.value - true) / found.sigma)
    assert np.abs(pulls).max() < 4.0
    assert Row("other", evidence.ONE).vehicle(0) is None


def test_the_page_names_its_command_and_what_was_recorded() -> None:
    page = evidence.page(7, [], "a table")
    assert "--n 7 --table" in page
    assert "## Recorded" in page
    assert page.index("## Recorded") < page.index("a table")
    assert "## Recorded" not in evidence.page(7, [], None)


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
    monkeypatch.setattr(evidence.recorded_vehicle, "table", lambda: None)
    for n in ("1", "3"):
        page = tmp_path / "page.md"
        options = ["--n", n, "--rows", "one tag", "--out", str(tmp_path), "--table", str(page)]
        evidence.main(options)
        assert f"| one tag | {n} of {n} |" in page.read_text(encoding="utf-8")
    assert done == ["road-tags-0", "road-tags-1", "road-tags-2"]
