from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml

from bags import FORMATS, write_drive
from gaia_uwb._shared.errors import ConfigError, InputError
from gaia_uwb.api import load_scenes
from gaia_uwb.evaluate.source_check import check_source
from gaia_uwb.logs.described import is_described, read_described
from gaia_uwb.logs.input_description import (
    CsvRanges,
    InputDescription,
    RosRanges,
    SerialRanges,
)

CSV = {
    "trajectory": {
        "file": "drive.csv",
        "format": "csv",
        "columns": {"t_s": "t", "east_m": "x", "north_m": "y"},
    },
    "ranges": [
        {"file": "a.csv", "format": "csv", "columns": {"t_s": "t", "anchors": {"A": "d"}}},
        {"file": "b.csv", "format": "csv", "columns": {"t_s": "t", "anchors": {"B": "d"}}},
    ],
}


def write(folder: Path, description: object = CSV) -> Path:
    """Write a log of three files with its description."""
    folder.mkdir(exist_ok=True)
    (folder / "drive.csv").write_text("t,x,y\n0,0,0\n1,5,0\n2,10,0\n", encoding="utf-8")
    (folder / "a.csv").write_text("t,d\n0.5,7\n1.5,8\n", encoding="utf-8")
    (folder / "b.csv").write_text("t,d\n1.0,9\n0.0,3\n1.0,9\n", encoding="utf-8")
    (folder / "gaia.yaml").write_text(yaml.safe_dump(description), encoding="utf-8")
    return folder


def test_several_logs_of_one_drive(tmp_path: Path) -> None:
    scene = read_described(write(tmp_path / "pass"))
    notes = scene.notes
    assert scene.name == "pass"
    assert scene.anchor_ids == ("A", "B")
    assert scene.ranges.t_s.tolist() == [0.0, 0.5, 1.0, 1.5]
    assert scene.ranges.anchor.tolist() == [1, 0, 1, 0]
    assert notes == (
        "b.csv: sorted by time, as 1 row came late",
        "b.csv: skipped 1 row with the anchor and time of another",
    )


def test_columns_of_which_nothing_was_taken_are_noted(tmp_path: Path) -> None:
    """One file may hold path and ranges: what one of them uses is not ignored."""
    columns = {"t_s": "t", "anchor_id": "id", "range_m": "d"}
    ranges = {"file": "drive.csv", "format": "csv", "columns": columns}
    folder = write(tmp_path / "pass", {**CSV, "ranges": [ranges]})
    rows = "t,x,y,id,d,hdop,temp\n0,0,0,A,7,1,20\n1,5,0,A,8,1,20\n2,10,0,B,9,1,21\n"
    (folder / "drive.csv").write_text(rows, encoding="utf-8")
    assert read_described(folder).notes == ("drive.csv: ignored columns: hdop, temp",)


def test_lever_arm_anchors_and_name(tmp_path: Path) -> None:
    more = {"name": "x", "anchors": "anchors.csv", "lever_arm": {"forward_m": 2.0, "left_m": -1.0}}
    folder = write(tmp_path / "pass", {**CSV, **more})
    (folder / "anchors.csv").write_text("anchor_id,up_m\nA,1.5\n", encoding="utf-8")
    scene = read_described(folder)
    assert scene.name == "x"
    np.testing.assert_allclose(scene.trajectory.position_m, [[2, -1], [7, -1], [12, -1]])
    assert scene.anchor_up_m is not None
    assert scene.anchor_up_m[0] == 1.5


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"rangs": []}, "gaia.yaml: rangs: unknown key"),
        ({"ranges": []}, "gaia.yaml: ranges: list should have at least 1 item"),
        ({"ranges": [{"file": "a.csv", "format": "xml"}]}, "gaia.yaml: ranges.0: format should be"),
        ({"trajectory": {"file": "a", "format": "xml"}}, "trajectory: format should be one of csv"),
        ({"trajectory": {"file": "a", "format": "kitti"}}, "trajectory.kitti.times: required"),
        ({"lever_arm": {"forward_m": "far"}}, "gaia.yaml: lever_arm.forward_m: "),
    ],
)
def test_a_wrong_description_names_the_key(
    tmp_path: Path, change: dict[str, object], message: str
) -> None:
    folder = write(tmp_path / "pass", {**CSV, **change})
    with pytest.raises(ConfigError) as caught:
        read_described(folder)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_wrong_files(tmp_path: Path) -> None:
    folder = write(tmp_path / "pass")
    (folder / "gaia.yaml").write_text("a: [", encoding="utf-8")
    with pytest.raises(InputError, match=r"gaia\.yaml: cannot be read"):
        read_described(folder)
    (folder / "gaia.yaml").write_text("name: a\nname: b", encoding="utf-8")
    with pytest.raises(InputError, match=r"gaia\.yaml: .*line 2: duplicate key 'name'"):
        read_described(folder)
    write(folder, {**CSV, "anchors": "none.csv"})
    with pytest.raises(InputError, match=r"none\.csv: no such file"):
        read_described(folder)
    write(folder)
    (folder / "a.csv").write_text("t,d\n100,7\n", encoding="utf-8")
    (folder / "b.csv").unlink()
    with pytest.raises(InputError, match=r"b\.csv: cannot be read: No such file"):
        read_described(folder)


def test_sources_take_them_all(tmp_path: Path) -> None:
    for kind in FORMATS[:2]:
        (tmp_path / kind).mkdir()
    bag, mcap = (write_drive(tmp_path / kind, kind) for kind in FORMATS[:2])
    bag.rename(tmp_path / "1.bag")
    mcap.rename(tmp_path / "2.mcap")
    write(tmp_path / "3")
    assert [s.name for s in load_scenes(str(tmp_path))] == ["1", "2", "3"]
    assert load_scenes(str(tmp_path / "2.mcap"))[0].n_anchors == 3
    (tmp_path / "4.bag").write_bytes(b"#ROSBAG V2.0\n")
    reports = check_source(str(tmp_path))
    assert [report.readable for report in reports] == [True, True, True, False]
    assert reports[3].problems == (f"{tmp_path / '4.bag'}: contains no topics",)
    assert not is_described(tmp_path)


@pytest.mark.parametrize("header", ["t,d0", "root:x:0:0:root:/root:/bin/sh"])
@pytest.mark.parametrize("link", [False, True])
def test_nothing_of_a_file_elsewhere_is_quoted(tmp_path: Path, header: str, link: bool) -> None:
    secret = tmp_path / "secret"
    secret.write_text(f"{header}\n1,pass'word\n", encoding="utf-8")
    folder = tmp_path / "log"
    folder.mkdir()
    (folder / "link").symlink_to(secret)
    file = "link" if link else "../secret"
    (folder / "gaia.yaml").write_text(
        f"trajectory: {{file: {file}, format: csv, columns: {{t_s: t, east_m: d0, north_m: d0}}}}\n"
        "ranges: [{file: r.log, format: dwm1001}]\n",
        encoding="utf-8",
    )
    with pytest.raises(InputError) as caught:
        read_described(folder)
    told = str(caught.value)
    assert file in told
    assert "root" not in told.replace(str(tmp_path), "")
    assert "pass" not in told
    if link or "root" in header:
        return
    secret.rename(folder / "own.csv")
    description = (folder / "gaia.yaml").read_text(encoding="utf-8").replace(file, "own.csv")
    (folder / "gaia.yaml").write_text(description, encoding="utf-8")
    with pytest.raises(InputError, match="pass'word"):
        read_described(folder)


def test_tables_with_our_names_need_no_map(tmp_path: Path) -> None:
    folder = tmp_path / "pass"
    folder.mkdir()
    (folder / "gnss.csv").write_text("t_s,lat,lon,alt_m\n0,48,11,5\n1,48,11.0001,6\n")
    (folder / "uwb.csv").write_text("t_s,tag,anchor_id,range_m\n0,1,a,5\n0,2,a,7\n1,2,a,8\n")
    trajectory = {"file": "gnss.csv", "format": "csv"}
    ranges = {"file": "uwb.csv", "format": "csv", "where": {"tag": 2}}
    for given in (trajectory, {"file": "gnss.csv"}):
        description = {"trajectory": given, "ranges": [ranges]}
        (folder / "gaia.yaml").write_text(yaml.safe_dump(description), encoding="utf-8")
        scene = read_described(folder)
        assert scene.ranges.range_m.tolist() == [7, 8]
        assert scene.trajectory.up_m is not None
    (folder / "gnss.csv").write_text("t_s,breite,lon\n0,48,11\n", encoding="utf-8")
    (folder / "gaia.yaml").write_text(
        yaml.safe_dump({"trajectory": trajectory, "ranges": [ranges]}), encoding="utf-8"
    )
    with pytest.raises(InputError, match=r"gnss\.csv: has not the columns of GAIA's own format"):
        read_described(folder)


def test_columns_say_that_it_is_a_table(tmp_path: Path) -> None:
    trajectory = {k: v for k, v in CSV["trajectory"].items() if k != "format"}
    ranges = [{k: v for k, v in given.items() if k != "format"} for given in CSV["ranges"]]
    whole = read_described(write(tmp_path / "whole"))
    short = write(tmp_path / "short", {**CSV, "trajectory": trajectory, "ranges": ranges})
    scene = read_described(short)
    assert scene.ranges.range_m.tolist() == whole.ranges.range_m.tolist()


def test_all_files_that_are_named_are_known() -> None:
    kitti = {"file": "poses.txt", "format": "kitti", "times": "times.txt"}
    description = InputDescription.model_validate({**CSV, "trajectory": kitti})
    assert {"poses.txt", "times.txt"} <= set(description.names())


@pytest.mark.parametrize(
    ("given", "kind"),
    [
        ({"file": "a.mcap"}, RosRanges),
        ({"file": "recording", "topic": "/uwb"}, RosRanges),
        ({"file": "a.csv"}, CsvRanges),
        ({"file": "a.txt", "columns": {"anchor_id": "id", "range_m": "d"}}, CsvRanges),
        ({"file": "tag.log"}, SerialRanges),
        ({"file": "tag.log", "format": "mauwb", "where": {"tid": 1}}, SerialRanges),
    ],
)
def test_ranges_without_a_format(given: dict[str, object], kind: type) -> None:
    whole = {"trajectory": {"file": "a.nmea", "format": "nmea"}, "ranges": [given]}
    assert isinstance(InputDescription.model_validate(whole).ranges[0], kind)
