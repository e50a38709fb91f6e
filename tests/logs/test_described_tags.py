"""Logs of several tags with a gaia.yaml: tables with any names, serial logs, ranges of cones."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from gaia_uwb._shared.errors import ConfigError, InputError
from gaia_uwb.logs.described import named_elsewhere, read_described
from gaia_uwb.logs.input_description import InputDescription
from gaia_uwb.logs.vehicle import Vehicle, VehicleTag
from gaia_uwb.scene import Scene, Tag, tag_scenes
from good_logs import clock, gga, zda

DRIVE = "t,x,y,yaw,p\n" + "".join(f"{t},{3 * t},0,{80 + t},{-t}\n" for t in range(20))
RANGES = "t,who,id,mm,aoa\n" + "".join(
    f"{k / 4},{('L', 'R')[k % 2]},c{k % 3},{5000 + k},{k}\n" for k in range(70)
)
TAGS = {"L": {"left_m": 0.5}, "R": {"left_m": -0.5, "forward_m": 1.0}}
PATH = {"file": "drive.csv", "columns": {"t_s": "t", "east_m": "x", "north_m": "y"}}
COLUMNS = {
    "t_s": "t",
    "anchor_id": "id",
    "range_m": {"column": "mm", "scale": 0.001},
    "tag_id": "who",
}


class WithoutAliases(yaml.SafeDumper):
    """Writes out what stands twice."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


def read(
    folder: Path, files: dict[str, str], vehicle: Vehicle | None = None, **description: Any
) -> Scene:
    """Write files and their description, and read them."""
    folder.mkdir(exist_ok=True)
    for name, text in {"drive.csv": DRIVE, "uwb.csv": RANGES, **files}.items():
        (folder / name).write_text(text, encoding="utf-8")
    uwb = {"file": "uwb.csv", "columns": COLUMNS}
    content = {"trajectory": PATH, "ranges": [uwb], "tags": TAGS, **description}
    content = {key: value for key, value in content.items() if value is not None}
    text = yaml.dump(content, Dumper=WithoutAliases)
    (folder / "gaia.yaml").write_text(text, encoding="utf-8")
    return read_described(folder, vehicle=vehicle)


VAN = Vehicle(name="van 7", tags={"L": VehicleTag(left_m=0.7), "R": VehicleTag(left_m=-0.7)})


def test_the_tags_of_a_vehicle_stand_in_for_those_that_are_not_described(tmp_path: Path) -> None:
    scene = read(tmp_path, {}, tags=None, vehicle=VAN)
    assert scene.tags == (Tag("L", left_m=0.7), Tag("R", left_m=-0.7))
    assert scene.vehicle == "van 7"
    assert [tag.left_m for tag in read(tmp_path, {}, vehicle=VAN).tags] == [0.5, -0.5]


def test_a_lever_arm_that_is_described_stays(tmp_path: Path) -> None:
    columns = {name: column for name, column in COLUMNS.items() if name != "tag_id"}
    one = [{"file": "uwb.csv", "columns": columns, "where": {"who": "L"}}]
    scene = read(tmp_path, {}, tags=None, ranges=one, lever_arm={"forward_m": 1.0}, vehicle=VAN)
    assert scene.tags == ()
    assert scene.trajectory.lever_m is not None


def test_mapped_tags_attitude_and_angles(tmp_path: Path) -> None:
    columns = {**PATH["columns"], "heading_deg": "yaw", "pitch_deg": {"column": "p", "scale": -1}}
    angles = {"azimuth_deg": {"column": "aoa", "scale": 0.5, "clockwise": True}}
    scene = read(
        tmp_path,
        {},
        trajectory={**PATH, "columns": columns},
        ranges=[{"file": "uwb.csv", "columns": COLUMNS | angles}],
    )
    assert scene.tags == (Tag("L", left_m=0.5), Tag("R", forward_m=1.0, left_m=-0.5))
    assert scene.ranges.tag.tolist() == [0, 1] * 35
    np.testing.assert_allclose(np.degrees(scene.ranges.azimuth_rad), -np.arange(70) / 2)
    np.testing.assert_allclose(np.degrees(scene.trajectory.heading_rad), 10.0 - np.arange(20))
    np.testing.assert_allclose(np.degrees(scene.trajectory.pitch_rad), np.arange(20))
    assert scene.trajectory.lever_m is None
    left, right = tag_scenes(scene)
    assert len(left.ranges) == len(right.ranges) == 35
    np.testing.assert_allclose(right.trajectory.lever_m[10], [np.cos(np.radians(10)), -0.5])


def test_a_column_that_names_the_tag_need_not_be_mapped(tmp_path: Path) -> None:
    columns = {name: column for name, column in COLUMNS.items() if name != "tag_id"}
    text = RANGES.replace("who", "Tag ID")
    scene = read(tmp_path, {"uwb.csv": text}, ranges=[{"file": "uwb.csv", "columns": columns}])
    assert scene.ranges.tag.tolist() == [0, 1] * 35


def test_one_column_per_anchor(tmp_path: Path) -> None:
    text = "t,who,d1,d2\n" + "".join(f"{k / 4},{k % 2},{5 + k / 2},99\n" for k in range(70))
    columns = {"t_s": "t", "anchors": {"c1": "d1", "c2": "d2"}, "tag_id": "who"}
    ranges = [{"file": "uwb.csv", "columns": columns, "missing": [99]}]
    scene = read(tmp_path, {"uwb.csv": text}, ranges=ranges, tags={0: {}, 1: {"left_m": 1}})
    assert scene.ranges.tag.tolist() == [0, 1] * 35
    assert scene.anchor_ids == ("c1",)


def test_each_tag_may_have_a_log_of_its_own(tmp_path: Path) -> None:
    line = "{t:.2f} DIST,1,AN0,022E,7.94,8.03,0.00,{d:.2f}\n"
    logs = {
        f"{side}.log": "".join(line.format(t=k / 2 + 1, d=5 + k + n) for k in range(20))
        for n, side in enumerate("LR")
    }
    each = [{"file": f"{side}.log", "format": "dwm1001", "tag_id": side} for side in "LR"]
    scene = read(tmp_path, logs, ranges=each)
    assert scene.ranges.tag.tolist() == [0, 1] * 20
    assert (scene.ranges.range_m[1::2] - scene.ranges.range_m[::2] == 1).all()
    assert not [note for note in scene.notes if "time of another" in note]


def trek(t: int, tag: int, mm: int) -> str:
    return f"{clock(t)} mc 01 {mm:08x} 00000000 00000000 00000000 {t:04x} {t:02x} 00a0 a{tag}:0\n"


def mauwb(t: int, tag: int, mm: int) -> str:
    return f"{clock(t)} AT+RANGE=tid:{tag},mask:01,seq:{t},range:({mm // 10},0,0,0)\n"


@pytest.mark.parametrize("line", [trek, mauwb])
def test_serial_logs_name_the_tag(tmp_path: Path, line: Any) -> None:
    log = "".join(line(t, t % 2 + 3, 5000 + 100 * t) for t in range(60))
    files = {"drive.nmea": zda() + "".join(map(gga, range(40))), "tag.log": log}
    given = {"trajectory": {"file": "drive.nmea"}, "ranges": [{"file": "tag.log"}]}
    scene = read(tmp_path, files, **given, tags={3: {"forward_m": 1}, 4: {}, 5: {}})
    assert [tag.tag_id for tag in scene.tags] == ["3", "4"]
    assert scene.ranges.tag.tolist() == [0, 1] * 30
    assert "tags: no ranges of '5'" in scene.notes
    word = "tid" if line is mauwb else "tag_id"
    given["ranges"] = [{"file": "tag.log", "where": {word: 4}}]
    scene = read(tmp_path, files, **given, tags={3: {"forward_m": 1}, 4: {"up_m": 1}})
    assert scene.tags == (Tag("4", up_m=1.0),)
    with pytest.raises(InputError) as caught:
        read(tmp_path, files, **given | {"ranges": [{"file": "tag.log"}]}, tags=None)
    assert str(caught.value) == (
        f"{tmp_path}/tag.log: has the ranges of several tags, {word} 3 (30 readings), "
        "4 (30 readings): say where each is on the vehicle, tags: {3: {forward_m: ..., left_m: "
        f"...}}, ...}} in gaia.yaml or in a vehicle's file (--vehicle), or take one by where: "
        f"{{{word}: 3}} in this file's entry in gaia.yaml"
    )
    with pytest.raises(InputError) as caught:
        read(tmp_path, files, **given | {"ranges": [{"file": "tag.log"}]}, tags={3: {}})
    assert str(caught.value) == (
        f"{tmp_path}/tag.log, column tag_id: holds ranges of '4', which tags in gaia.yaml "
        "(or in the vehicle's file) lacks: "
        "add 4: {forward_m: ..., left_m: ...} there, or leave it out by where in this file's entry "
        "in gaia.yaml"
    )


def test_ranges_between_cones(tmp_path: Path) -> None:
    text = "when,a,b,cm,x\n0.5,c0,c1,600,1\n0.7,c1,new,610,1\n0.8,c1,c0,0,1\n"
    columns = {"t_s": "when", "anchor_a": "a", "anchor_b": "b"}
    columns |= {"range_m": {"column": "cm", "scale": 0.01}}
    cones = {"file": "cones.csv", "columns": columns}
    scene = read(tmp_path, {"cones.csv": text}, cone_ranges=cones)
    assert scene.anchor_ids == ("c0", "c1", "c2", "new")
    assert scene.cone_ranges.anchor_b.tolist() == [1, 3]
    np.testing.assert_allclose(scene.cone_ranges.range_m, [6.0, 6.1])
    assert scene.cone_ranges.t_s.tolist() == [0.5, 0.7]
    skipped = "cones.csv: skipped 1 row without a range (empty, or 0 m and less)"
    assert {skipped, "cones.csv: ignored columns: x"} <= set(scene.notes)
    own = "anchor_a,anchor_b,range_m\nc0,c1,6\n"
    scene = read(tmp_path, {"cones.csv": own}, cone_ranges={"file": "cones.csv"})
    assert scene.cone_ranges.range_m.tolist() == [6.0]


def test_a_file_of_cones_elsewhere_is_named(tmp_path: Path) -> None:
    read(tmp_path / "log", {}, cone_ranges=None)
    content = yaml.safe_load((tmp_path / "log" / "gaia.yaml").read_text(encoding="utf-8"))
    content["cone_ranges"] = {"file": "../cones.csv"}
    (tmp_path / "log" / "gaia.yaml").write_text(yaml.safe_dump(content), encoding="utf-8")
    assert named_elsewhere(tmp_path / "log") == [tmp_path / "log" / "../cones.csv"]


@pytest.mark.parametrize(
    ("files", "description", "message"),
    [
        (
            {},
            {"tags": None},
            "uwb.csv, column who: holds ranges of 2 tags ('L', 'R'): say where each is on the "
            "vehicle, tags: {L: {forward_m: ..., left_m: ...}, ...} in gaia.yaml or in a vehicle's "
            "file (--vehicle), or take one by where: {who: L} in this file's entry in gaia.yaml",
        ),
        (
            {},
            {"tags": {"L": {}}},
            "uwb.csv, column who: holds ranges of 'R', which tags in gaia.yaml (or in the "
            "vehicle's file) lacks: add "
            "R: {forward_m: ..., left_m: ...} there, or leave it out by where in this file's entry "
            "in gaia.yaml",
        ),
        (
            {"l.csv": RANGES.replace(",R,", ",L,"), "r.csv": RANGES.replace(",L,", ",R,")},
            {
                "ranges": [{"file": f"{n}.csv", "columns": COLUMNS} for n in "lr"],
                "tags": None,
            },
            "l.csv, column who: holds ranges of 2 tags ('L', 'R'): say where each is on the "
            "vehicle, tags: {L: {forward_m: ..., left_m: ...}, ...} in gaia.yaml or in a vehicle's "
            "file (--vehicle), or name the "
            "files of one, or, if they are one, set the same tag_id for each file",
        ),
        (
            {},
            {"ranges": [{"file": "uwb.csv", "columns": {**COLUMNS, "tag_id": None}}]},
            "uwb.csv, column tag_id: names no tag, but gaia.yaml gives 2 tags: map tag_id (ROS: "
            "fields: {tag: ...}), or set tag_id where each has its own log",
        ),
        (
            {"more.csv": RANGES.replace("who", "x")},
            {
                "ranges": [
                    {"file": "uwb.csv", "columns": COLUMNS},
                    {"file": "more.csv", "columns": {**COLUMNS, "tag_id": None, "t_s": "aoa"}},
                ]
            },
            "more.csv, row 2, column who: expected the tag that took the range, got nothing",
        ),
        (
            {"uwb.csv": RANGES.replace("3.5,L,", "3.5,,")},
            {},
            "uwb.csv, row 16, column who: expected the tag that took the range, got nothing",
        ),
        (
            {"uwb.csv": RANGES.replace("5014,14", "5014,1400")},
            {
                "ranges": [
                    {"file": "uwb.csv", "columns": {**COLUMNS, "azimuth_deg": "aoa"}},
                ]
            },
            "uwb.csv, row 16, column aoa: expected degrees between -360 and 360, got 1400",
        ),
    ],
)
def test_refusals(
    tmp_path: Path, files: dict[str, str], description: dict[str, Any], message: str
) -> None:
    with pytest.raises(InputError) as caught:
        read(tmp_path, files, **description)
    assert str(caught.value).removeprefix(f"{tmp_path}/") == message


@pytest.mark.parametrize(
    ("description", "message"),
    [
        (
            {"lever_arm": {"forward_m": 1}},
            "give lever_arm (of one tag) or tags (of several), not both",
        ),
        ({"tags": {"L": {"forward_m": "far"}}}, "tags.L.forward_m: input should be a valid number"),
        (
            {"ranges": [{"file": "uwb.csv", "columns": {**COLUMNS, "azimuth_sigma_deg": "aoa"}}]},
            "ranges.0.csv.columns: azimuth_sigma_deg needs azimuth_deg beside it",
        ),
        (
            {
                "ranges": [
                    {
                        "file": "uwb.csv",
                        "columns": COLUMNS | {"rssi_dbm": {"column": "aoa", "clockwise": True}},
                    }
                ]
            },
            "ranges.0.csv.columns: rssi_dbm: clockwise is for azimuth_deg only",
        ),
        (
            {"cone_ranges": {"file": "c.csv", "columns": {"anchor_a": "a", "anchor_b": "b"}}},
            "cone_ranges.columns.range_m: required",
        ),
    ],
)
def test_descriptions_that_cannot_be(
    tmp_path: Path, description: dict[str, Any], message: str
) -> None:
    with pytest.raises(ConfigError) as caught:
        read(tmp_path, {}, **description)
    assert str(caught.value).removeprefix(f"{tmp_path}/gaia.yaml: ").startswith(message)


def test_a_lever_arm_of_nothing_goes_with_tags() -> None:
    content = {"trajectory": PATH, "ranges": [{"file": "a.log"}], "tags": {1: {}}}
    InputDescription.model_validate({**content, "lever_arm": {}})
