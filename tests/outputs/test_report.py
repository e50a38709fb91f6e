"""The report says what was found, in strict JSON, and every file arrives whole."""

from __future__ import annotations

import json
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from factories import SITE, SQUARE_M, make_fix, make_reconstruction, make_unlocated
from gaia_uwb._shared.errors import ConfigError
from gaia_uwb._shared.files import visible
from gaia_uwb.config import AlignmentConfig, PipelineConfig, load_config
from gaia_uwb.episode import ClockOffset, ReadingCounts
from gaia_uwb.estimate import Reason, ReasonKind
from gaia_uwb.evaluate.metrics import Metric
from gaia_uwb.outputs.geojson import boundary_geojson
from gaia_uwb.outputs.report import UNCERTAINTY_NOTE, make_report, write_all
from gaia_uwb.reconstruction import ReconstructionStatus

FILES = sorted([
    "boundary.geojson", "clean-ranges.parquet", "cones.csv", "config.yaml", "map.html", "plot.png",
    "report.json", "report.md",
])  # fmt: skip


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with the files of a reconstruction, one of whose cones was not located."""
    folder = tmp_path_factory.mktemp("out")
    changed = {3: make_unlocated("cone-3")}
    write_all(make_reconstruction(changed=changed), folder, {"anchor_mae": METRIC})
    return folder


METRIC = Metric(name="anchor_mae", value=0.08, unit="m", n=4)


def names_in(folder: Path) -> list[str]:
    return [path.name for path in visible(folder)]


def test_report_has_every_promised_key() -> None:
    report = make_report(make_reconstruction(), {"anchor_mae": METRIC})
    assert report["schema"] == 2
    assert report["version"] == version("gaia-uwb")
    assert report["scene"] == "a drive"
    assert (report["status"], report["reasons"]) == ("ok", [])
    assert report["notes"] == []
    assert report["clock_offset_s"] == 0.18
    assert report["clock_offset"] == {
        "offset_s": 0.18, "sigma_s": 0.01, "applied": True, "reason": "told from 0",
    }  # fmt: skip
    assert report["range_calibration"] == {
        "bias_at_10_m_m": 0.1, "bias_per_decade_m": 0.25, "sigma_m": 0.06,
        "correlation_steps": 4.0,
    }  # fmt: skip
    assert report["boundary"] == {
        "status": "ok", "area_m2": 12.0, "hull_m": SQUARE_M.tolist(),
        "outline_ids": ["cone-0", "cone-1", "cone-2", "cone-3"],
        "side_unknown_ids": [], "uncertainty": None,
    }  # fmt: skip
    assert report["frame"] == {"lat_deg": 48.1, "lon_deg": 11.5, "alt_m": 520.0}
    assert report["uncertainty_note"] == UNCERTAINTY_NOTE
    assert report["config"] == PipelineConfig().model_dump(mode="json")
    assert report["metrics"] == {"anchor_mae": {"value": 0.08, "unit": "m", "n": 4}}


def test_what_is_unknown_of_an_anchor_is_null() -> None:
    there = np.array([1.0, 2.0])
    fix = make_fix("A", there, mirror_position_m=there, range_bias_m=np.nan)
    anchors = make_report(make_reconstruction(changed={0: fix}))["anchors"]
    assert isinstance(anchors, list)
    for name in ("mirror_east_m", "mirror_north_m", "mirror_covariance_m2", "range_bias_m"):
        assert anchors[0][name] is None


def test_report_of_an_anchor() -> None:
    fix = make_fix("A", np.array([1.0, 2.0]), mirror_position_m=np.array([1.0, -10.0]))
    anchors = make_report(make_reconstruction(changed={0: fix}))["anchors"]
    assert isinstance(anchors, list)
    lon, lat = anchors[0].pop("lon"), anchors[0].pop("lat")
    assert anchors[0] == {
        "id": "A", "east_m": 1.0, "north_m": 2.0, "covariance_m2": [[0.04, 0.01], [0.01, 0.02]],
        "mirror_probability": 0.002, "mirror_probability_by_ranges": 0.3,
        "side_source": "layout", "side_is_open": False,
        "mirror_east_m": 1.0, "mirror_north_m": -10.0,
        "mirror_covariance_m2": None, "status": "ok", "n_ranges": 180, "readings": None,
        "range_bias_m": 0.05,
    }  # fmt: skip
    metres_per_degree = 111_190.0  # of latitude at 48 degrees, to 0.1 %
    assert lat - SITE.lat_deg == pytest.approx(2.0 / metres_per_degree, rel=1e-2)
    expected = 1.0 / metres_per_degree / np.cos(np.radians(SITE.lat_deg))
    assert lon - SITE.lon_deg == pytest.approx(expected, rel=1e-2)


def test_what_became_of_the_readings_is_in_the_report() -> None:
    made = make_reconstruction()
    one = ReadingCounts(200, 150, 30, 8, 12, n_steps=180)
    told = replace(made.episode, readings=dict.fromkeys(made.episode.anchor_ids, one))
    report = make_report(
        replace(made, episode=told, more_passes=((replace(told, name="b"), made.denoised),))
    )
    words = {"in_log": 200, "kept": 150, "spikes": 30, "in_gaps": 8, "outside": 12}
    twice, fourfold = ({name: k * n for name, n in words.items()} for k in (2, 4))
    assert [anchor["readings"] for anchor in report["anchors"]] == [twice] * 4
    assert [each["readings"] for each in report["passes"]] == [fourfold] * 2


def test_what_is_unknown_is_null() -> None:
    reconstruction = make_reconstruction(changed={0: make_unlocated("cone-0")}, frame=None)
    report = json.loads(json.dumps(make_report(reconstruction), allow_nan=False))
    first = report["anchors"][0]
    assert (first["status"], first["n_ranges"]) == ("too-few-ranges", 2)
    for name in ("east_m", "north_m", "lon", "lat", "covariance_m2", "mirror_east_m"):
        assert first[name] is None
    assert report["anchors"][1]["east_m"] == 4.0
    assert report["anchors"][1]["lon"] is None
    assert report["frame"] is None
    assert report["metrics"] is None


def test_clock_and_calibration_that_were_not_applied_or_not_looked_for() -> None:
    reconstruction = make_reconstruction()
    clock = ClockOffset(offset_s=0.4, sigma_s=0.5, applied=False, reason="the vehicle stood")
    untold = replace(reconstruction, episode=replace(reconstruction.episode, clock=clock))
    report = make_report(untold)
    assert report["clock_offset_s"] == 0.0
    assert report["clock_offset"] == {
        "offset_s": 0.4, "sigma_s": 0.5, "applied": False, "reason": "the vehicle stood",
    }  # fmt: skip
    episode = replace(reconstruction.episode, clock=None, calibration=None)
    report = make_report(replace(reconstruction, episode=episode))
    for name in ("clock_offset_s", "clock_offset", "range_calibration"):
        assert report[name] is None


def test_reasons_of_an_unreliable_result() -> None:
    reason = Reason(
        ReasonKind.PASSES_APART, "A is apart", ("A",), ("two",), numbers={"distance_m": 1.5}
    )
    unreliable = replace(
        make_reconstruction(), status=ReconstructionStatus.UNRELIABLE, reasons=(reason,)
    )
    report = json.loads(json.dumps(make_report(unreliable)))
    assert report["status"] == "unreliable"
    assert report["reasons"] == [
        {
            "kind": "passes-apart",
            "text": "A is apart",
            "cones": ["A"],
            "passes": ["two"],
            "statements": [],
            "numbers": {"distance_m": 1.5},
        }
    ]


def test_note_names_the_error_of_the_frame_and_its_size() -> None:
    for words in ("own frame", "not included", "0.2 to 1.0 degrees", "0.2 m"):
        assert words in UNCERTAINTY_NOTE


def test_writes_all_files_and_nothing_else(written: Path) -> None:
    assert names_in(written) == FILES


def test_returns_the_paths_with_the_report_last(tmp_path: Path) -> None:
    paths = write_all(make_reconstruction(), tmp_path / "new" / "folder")
    assert sorted(path.name for path in paths) == FILES
    assert all(path.parent == tmp_path / "new" / "folder" for path in paths)
    assert paths[-1].name == "report.json"


def test_files_of_one_run_are_the_same_again(tmp_path: Path) -> None:
    first, second = (
        [path.read_bytes() for path in write_all(make_reconstruction(), tmp_path / name)]
        for name in ("a", "b")
    )
    assert first == second


def test_report_on_disk_is_strict_json(written: Path) -> None:
    def refuse(constant: str) -> None:
        raise AssertionError(constant)

    text = (written / "report.json").read_text(encoding="utf-8")
    report = json.loads(text, parse_constant=refuse)
    changed = {3: make_unlocated("cone-3")}
    assert report == make_report(make_reconstruction(changed=changed), {"anchor_mae": METRIC})


def test_geojson_on_disk(written: Path) -> None:
    changed = {3: make_unlocated("cone-3")}
    found = json.loads((written / "boundary.geojson").read_text(encoding="utf-8"))
    assert found == boundary_geojson(make_reconstruction(changed=changed))


def test_anchor_table(written: Path) -> None:
    table = pl.read_csv(written / "cones.csv")
    assert table.columns == [
        "anchor_id", "status", "east_m", "north_m", "lon", "lat", "covariance_ee_m2",
        "covariance_en_m2", "covariance_nn_m2", "mirror_probability",
        "mirror_probability_by_ranges", "side_source", "side_is_open",
        "mirror_east_m", "mirror_north_m", "mirror_covariance_ee_m2", "mirror_covariance_en_m2",
        "mirror_covariance_nn_m2", "n_ranges", "range_bias_m",
    ]  # fmt: skip
    assert table["anchor_id"].to_list() == ["cone-0", "cone-1", "cone-2", "cone-3"]
    assert table["east_m"].to_list() == [0.0, 4.0, 4.0, None]
    assert table["covariance_en_m2"].to_list() == [0.01, 0.01, 0.01, None]
    assert table["lon"][0] == pytest.approx(SITE.lon_deg)
    assert table["status"][3] == "too-few-ranges"
    assert table["mirror_probability_by_ranges"].to_list() == [0.3, 0.3, 0.3, None]
    assert table["side_source"].to_list() == ["layout", "layout", "layout", None]


def test_ids_in_the_table_of_cones_only_show_in_a_spreadsheet(tmp_path: Path) -> None:
    ids = ('a,"b"', "line\nbreak", "Kegel-ä", "=1+1")
    write_all(make_reconstruction(anchor_ids=ids), tmp_path)
    table = pl.read_csv(tmp_path / "cones.csv")
    assert tuple(table["anchor_id"]) == ('a,"b"', "line\\nbreak", "Kegel-ä", "'=1+1")


def test_range_table_holds_every_range_once(written: Path) -> None:
    reconstruction = make_reconstruction()
    episode, denoised = reconstruction.episode, reconstruction.denoised
    table = pl.read_parquet(written / "clean-ranges.parquet")
    assert table.schema == {
        "pass": pl.String, "t_s": pl.Float64, "anchor_id": pl.String, "range_m": pl.Float64,
        "denoised_range_m": pl.Float64, "sigma_m": pl.Float64, "valid": pl.Boolean,
    }  # fmt: skip
    assert len(table) == episode.valid.sum()
    one = table.filter(pl.col("anchor_id") == "cone-3")
    use = episode.valid[:, 3]
    assert one["t_s"].to_list() == episode.t_s[use].tolist()
    assert one["range_m"].to_list() == episode.range_m[use, 3].tolist()
    assert one["denoised_range_m"].to_list() == denoised.range_m[use, 3].tolist()
    assert one["valid"].all()


def test_range_that_only_one_side_knows_is_null_on_the_other(tmp_path: Path) -> None:
    reconstruction = make_reconstruction()
    denoised = reconstruction.denoised
    valid = denoised.valid.copy()
    valid[100, 1] = False
    keep = np.where(valid, 1.0, np.nan)
    fewer = replace(
        denoised, range_m=denoised.range_m * keep, sigma_m=denoised.sigma_m * keep, valid=valid
    )
    write_all(replace(reconstruction, denoised=fewer), tmp_path)
    table = pl.read_parquet(tmp_path / "clean-ranges.parquet").filter(~pl.col("valid"))
    assert table["anchor_id"].to_list() == ["cone-1"]
    assert table["range_m"].null_count() == 0
    assert table["denoised_range_m"].to_list() == table["sigma_m"].to_list() == [None]


def test_settings_are_read_back_and_name_the_version(tmp_path: Path) -> None:
    config = PipelineConfig(alignment=AlignmentConfig(max_gap_s=0.25))
    write_all(replace(make_reconstruction(), config=config), tmp_path)
    assert load_config(tmp_path / "config.yaml") == config
    first_line = (tmp_path / "config.yaml").read_text(encoding="utf-8").splitlines()[0]
    assert first_line == f"# gaia-uwb {version('gaia-uwb')}"


def test_folder_that_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("")
    with pytest.raises(ConfigError, match="cannot write to this folder"):
        write_all(make_reconstruction(), tmp_path / "out")


def test_file_that_cannot_be_written(tmp_path: Path) -> None:
    write_all(make_reconstruction(), tmp_path)
    (tmp_path / "plot.png").unlink()
    (tmp_path / "plot.png").mkdir()
    with pytest.raises(ConfigError, match=r"plot\.png: cannot write this file"):
        write_all(make_reconstruction(), tmp_path)
    assert not (tmp_path / "report.json").exists()


@pytest.mark.parametrize("theirs", ["cones.csv", "plot.svg", "report.json"])
def test_nothing_is_written_where_somebody_elses_file_is_in_the_way(
    tmp_path: Path, theirs: str
) -> None:
    (tmp_path / theirs).write_text("theirs")
    with pytest.raises(ConfigError, match=f"{theirs}: was not written by gaia"):
        write_all(make_reconstruction(), tmp_path, svg=True)
    assert names_in(tmp_path) == [theirs]
    assert (tmp_path / theirs).read_text() == "theirs"


def test_no_results_go_into_the_folder_of_a_log(tmp_path: Path) -> None:
    (tmp_path / "ranges.parquet").write_text("measured")
    with pytest.raises(ConfigError, match=r"holds a log \(ranges\.parquet\)"):
        write_all(make_reconstruction(), tmp_path)
    assert names_in(tmp_path) == ["ranges.parquet"]


def test_svg_is_written_where_it_is_asked_for_and_none_is_left_of_before(tmp_path: Path) -> None:
    paths = write_all(make_reconstruction(), tmp_path, svg=True)
    assert sorted(path.name for path in paths) == sorted([*FILES, "plot.svg"])
    assert (tmp_path / "plot.svg").read_text(encoding="utf-8").startswith("<?xml")
    write_all(make_reconstruction(), tmp_path)
    assert names_in(tmp_path) == FILES


def test_files_for_a_gis_are_written_where_they_are_asked_for(tmp_path: Path) -> None:
    paths = write_all(make_reconstruction(), tmp_path, gis=True)
    assert {path.name for path in paths} - set(FILES) == {"boundary.gpkg", "boundary.kml"}
    # Without a place on Earth there is nothing to show on a globe, and none is left of before.
    write_all(make_reconstruction(frame=None), tmp_path, gis=True)
    assert set(names_in(tmp_path)) - set(FILES) == {"boundary.gpkg"}


def test_every_pass_is_in_the_report_and_the_files(tmp_path: Path) -> None:
    near = make_reconstruction()
    clock = ClockOffset(offset_s=-0.3, sigma_s=0.02, applied=True, reason="told from 0")
    other = replace(near.episode, name="another drive", clock=clock)
    both = replace(near, more_passes=((other, near.denoised),))
    report = json.loads(json.dumps(make_report(both), allow_nan=False))
    assert report["scene"] == "a drive and 1 more"
    for name in ("clock_offset_s", "clock_offset", "range_calibration"):
        assert report[name] is None
    assert [each["name"] for each in report["passes"]] == ["a drive", "another drive"]
    assert [each["clock_offset_s"] for each in report["passes"]] == [0.18, -0.3]
    n = int(near.denoised.valid.sum())
    assert [each["n_ranges"] for each in report["passes"]] == [n, n]
    assert report["passes"][0]["range_calibration"]["bias_at_10_m_m"] == 0.1
    write_all(both, tmp_path)
    table = pl.read_parquet(tmp_path / "clean-ranges.parquet")
    assert table["pass"].value_counts().sort("pass").rows() == [
        ("a drive", n),
        ("another drive", n),
    ]
    features = json.loads((tmp_path / "boundary.geojson").read_text(encoding="utf-8"))["features"]
    paths = [f["properties"] for f in features if f["properties"]["role"] == "path"]
    assert [path["pass"] for path in paths] == ["a drive", "another drive"]
