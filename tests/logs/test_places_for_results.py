"""No command can put results into a folder that it reads, or that holds somebody's log."""

from __future__ import annotations

from pathlib import Path

import pytest

from gaia_uwb._shared.errors import ConfigError
from gaia_uwb.logs.native import write_native
from gaia_uwb.logs.places_for_results import log_files, results_folder
from gaia_uwb.simulate import load


@pytest.fixture
def log(tmp_path: Path) -> Path:
    """Return a log of the user's own."""
    folder = tmp_path / "drives" / "log"
    folder.mkdir(parents=True)
    (folder / "trajectory.csv").write_text("t_s,east_m,north_m\n0,0,0\n1,1,0\n")
    (folder / "ranges.csv").write_text("t_s,anchor_id,range_m\n0.5,a,3\n")
    return folder


@pytest.mark.parametrize("out", ["log", "log/../log", "drives", "link", "data"])
def test_a_folder_that_is_read_takes_no_results(log: Path, out: str) -> None:
    drives = log.parent
    (drives / "link").symlink_to(log)
    (log.parent.parent / "data").mkdir()
    (log / "gaia.yaml").write_text(
        "trajectory: {file: ../../data/drive.nmea, format: nmea}\n"
        "ranges: [{file: tag.log, format: dwm1001}]\n"
    )
    places = {"drives": drives, "data": drives.parent / "data"}
    with pytest.raises(ConfigError, match="is read by this command: results need another folder"):
        results_folder(places.get(out, drives / out), [str(drives)])


def test_the_folder_of_a_bag_takes_no_results(tmp_path: Path) -> None:
    (tmp_path / "pass.bag").write_bytes(b"#ROSBAG V2.0\n")
    with pytest.raises(ConfigError, match="is read by this command"):
        results_folder(tmp_path, [tmp_path / "pass.bag"])
    with pytest.raises(ConfigError, match=r"holds a log \(pass\.bag\)"):
        results_folder(tmp_path)


def test_a_data_set_takes_no_results(tmp_path: Path) -> None:
    (tmp_path / "outdoor-uwb").mkdir()
    with pytest.raises(ConfigError, match="is read by this command"):
        results_folder(tmp_path / "outdoor-uwb", ["outdoor-uwb:LOS/A/1"], data_dir=tmp_path)


def test_results_may_lie_below_or_above_what_is_read(log: Path) -> None:
    for _ in range(2):  # a folder of results within a log's is not a log
        assert results_folder(log / "out", [log]).path == log / "out"
    assert results_folder(log.parent.parent, [log]).path == log.parent.parent
    assert results_folder(log.parent.parent, ["sim:straight"]).path == log.parent.parent


@pytest.mark.parametrize(
    "name",
    ["trajectory.parquet", "ranges.csv", "anchors.csv", "scene.yaml", "gaia.yaml", "a.db3",
     "a.mcap", "a.bag.active"],
)  # fmt: skip
def test_any_part_of_a_log_is_enough(tmp_path: Path, name: str) -> None:
    (tmp_path / name).touch()
    (tmp_path / "notes.txt").touch()
    assert log_files(tmp_path) == [name]
    for ours in (False, True):
        with pytest.raises(ConfigError, match=r"holds a log \("):
            results_folder(tmp_path, for_log=ours)


def test_a_simulated_log_is_replaced_by_a_simulated_log_only(tmp_path: Path) -> None:
    scene = load("straight/1")[0]
    write_native(scene, tmp_path, "csv")
    write_native(scene, results_folder(tmp_path, for_log=True).path, "parquet")
    assert log_files(tmp_path) == [
        "anchors.parquet", "ranges.parquet", "scene.yaml", "trajectory.parquet"
    ]  # fmt: skip
    with pytest.raises(ConfigError, match="holds a log"):
        results_folder(tmp_path)


def test_somebody_elses_log_is_not_replaced_by_a_simulated_one(log: Path) -> None:
    before = {path.name: path.read_bytes() for path in log.iterdir()}
    with pytest.raises(ConfigError, match=r"trajectory\.csv: was not written by gaia"):
        write_native(load("straight/1")[0], log)
    assert {path.name: path.read_bytes() for path in log.iterdir()} == before
