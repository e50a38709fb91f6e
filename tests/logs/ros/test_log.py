from __future__ import annotations

import json
import shutil
import sqlite3
import struct
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode

from bags import FLAT, FORMATS, RECORDED_LATER_NS, START_S, VENDOR, Log, write_drive
from gaia_uwb._shared.errors import ConfigError, InputError
from gaia_uwb._shared.strict_yaml import read_yaml
from gaia_uwb.logs.bags.fields import FieldMap
from gaia_uwb.logs.described import read_described
from gaia_uwb.logs.ros import RosLog

TWO_RANGES = {"A": 12.5, "B": 30.25}
TAKEN = "ranges: /uwb: anchor: anchor_id, range: range"
POSE = "trajectory: /pose (PointStamped)"


def write_ranges(folder: Path, kind: str, text: str, each: Any) -> Path:
    """Write a log whose messages of a vendor's type are made by a function."""
    definitions = {"acme_uwb/msg/Node": "uint8 id\nfloat32 dis\nfloat32 fp_rssi\n"}
    log = Log(folder, kind, {**definitions, VENDOR: text})
    for k in range(5):
        log.point("/pose", START_S + k, float(k), 0.0)
        log.add("/uwb", VENDOR, START_S + k, **each(log, k))
    return log.close()


@pytest.fixture(scope="module")
def drives(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """One drive in each format."""
    return {kind: write_drive(tmp_path_factory.mktemp(kind), kind) for kind in FORMATS}


@pytest.mark.parametrize("kind", FORMATS)
def test_each_format_gives_the_scene_that_was_written(drives: dict[str, Path], kind: str) -> None:
    scene = read_described(drives[kind])
    notes = scene.notes
    assert scene.anchor_ids == ("A1", "A2", "A10")
    assert notes == ("trajectory: /fix (NavSatFix)", TAKEN)
    np.testing.assert_allclose(scene.trajectory.t_s, START_S + np.arange(200) / 10, atol=1e-6)
    first = scene.ranges.anchor == 0
    np.testing.assert_allclose(scene.ranges.range_m[first], 20 + np.arange(0, 200, 5) / 100, 1e-6)
    assert scene.ranges.rssi_dbm is not None
    assert set(scene.ranges.rssi_dbm[first]) == {-80.0}
    assert scene.frame is not None
    assert (scene.frame.lat_deg, scene.frame.lon_deg, scene.frame.alt_m) == (37.0, 127.0, 50.0)


def test_all_formats_give_one_scene(drives: dict[str, Path]) -> None:
    scenes = [read_described(path) for path in drives.values()]
    for scene in scenes[1:]:
        for a, b in ((scene.trajectory, scenes[0].trajectory), (scene.ranges, scenes[0].ranges)):
            for name, values in vars(a).items():
                np.testing.assert_array_equal(values, getattr(b, name))


PACKED = [
    ("bag", (Writer1.CompressionFormat.BZ2,)),
    ("bag", (Writer1.CompressionFormat.LZ4,)),
    ("mcap", (CompressionMode.STORAGE, CompressionFormat.ZSTD)),
    ("folder-mcap", (CompressionMode.MESSAGE, CompressionFormat.ZSTD)),
    ("folder-sqlite3", (CompressionMode.MESSAGE, CompressionFormat.ZSTD)),
]


@pytest.mark.parametrize(("kind", "packed"), PACKED)
def test_packed_logs_hold_the_same(
    drives: dict[str, Path], tmp_path: Path, kind: str, packed: tuple[Any, ...]
) -> None:
    log, plain = RosLog(write_drive(tmp_path, kind, packed)), RosLog(drives[kind])
    for read in (RosLog.ranges, RosLog.trajectory):
        a, b = read(log), read(plain)
        for name, values in a.columns.items():
            np.testing.assert_array_equal(values, b[name])


def test_a_folder_packed_as_files_is_refused(tmp_path: Path) -> None:
    how = (CompressionMode.FILE, CompressionFormat.ZSTD)
    with pytest.raises(InputError, match="its files are compressed: decompress them"):
        RosLog(write_drive(tmp_path, "folder-mcap", how))


def test_a_bag_without_an_index(drives: dict[str, Path], tmp_path: Path) -> None:
    data = drives["bag"].read_bytes()
    place = data.index(b"index_pos=") + 10
    (index,) = struct.unpack_from("<Q", data, place)
    path = tmp_path / "active.bag"
    path.write_bytes(data[:place] + bytes(8) + data[place + 8 : index])
    log = RosLog(path)
    assert len(log.ranges()) == 120
    assert log.notes == [TAKEN]


@pytest.mark.parametrize("kind", FORMATS)
def test_header_and_receive_clock(drives: dict[str, Path], kind: str) -> None:
    log = RosLog(drives[kind])
    header, receive = log.ranges(clock="header"), log.ranges(clock="receive")
    np.testing.assert_allclose(receive["t_s"] - header["t_s"], RECORDED_LATER_NS * 1e-9, atol=1e-6)


@pytest.mark.parametrize("kind", FORMATS)
def test_an_array_of_messages_is_exploded(tmp_path: Path, kind: str) -> None:
    def each(log: Log, k: int) -> dict[str, Any]:
        node = log.types.types["acme_uwb/msg/Node"]
        nodes = [node(id=n, dis=10.0 + n + k, fp_rssi=-90.0) for n in (3, 7)]
        return {"header": log.header(START_S + k), "nodes": nodes}

    path = write_ranges(tmp_path, kind, "std_msgs/Header header\nNode[] nodes\n", each)
    guessed = read_described(path)
    assert guessed.anchor_ids == ("3", "7")
    assert guessed.ranges.range_m.tolist()[:4] == [13, 17, 14, 18]
    assert guessed.ranges.rssi_fp_dbm is not None
    table = RosLog(path).ranges("/uwb", FieldMap(each="nodes", anchor="id", range="dis", scale=0.1))
    assert table["range_m"].tolist()[:2] == pytest.approx([1.3, 1.7])


def test_arrays_beside_each_other(tmp_path: Path) -> None:
    def each(log: Log, k: int) -> dict[str, Any]:
        return {"ids": list(TWO_RANGES), "ranges": np.array([*TWO_RANGES.values()], np.float32)}

    path = write_ranges(tmp_path, "mcap", "string[] ids\nfloat32[] ranges\n", each)
    scene = read_described(path)
    notes = scene.notes
    assert scene.anchor_ids == ("A", "B")
    assert scene.ranges.range_m.tolist()[:2] == [12.5, 30.25]
    assert notes == (
        POSE,
        "ranges: /uwb: anchor: ids, range: ranges",
        "/uwb: no header, so the time of recording is used",
    )
    with pytest.raises(
        InputError, match=r"no field 'header.stamp'.*clock: receive does without it"
    ):
        RosLog(path).ranges(clock="header")


def test_arrays_of_different_length_are_an_error(tmp_path: Path) -> None:
    def each(log: Log, k: int) -> dict[str, Any]:
        return {"ids": ["A"] * (k + 1), "ranges": np.ones(2, np.float32)}

    path = write_ranges(tmp_path, "bag", "string[] ids\nfloat32[] ranges\n", each)
    with pytest.raises(InputError, match=r"topic /uwb, message 1: .* differ in length: 1, 2"):
        RosLog(path).ranges()


def test_a_map_for_any_vendor(tmp_path: Path) -> None:
    def each(log: Log, k: int) -> dict[str, Any]:
        return {"when": START_S + k + 0.5, "mac": np.array([1, 0xAB], np.uint8), "mm": 1500 + k}

    path = write_ranges(tmp_path, "mcap", "float64 when\nuint8[2] mac\nuint32 mm\n", each)
    with pytest.raises(InputError, match=r"no topic looks like the ranges; available: /pose"):
        RosLog(path).ranges()
    fields = FieldMap(anchor="mac", range="mm", scale=0.001, stamp="when")
    table = RosLog(path).ranges(fields=fields)
    assert table.labels["anchor_id"] == ("01ab",)
    assert table["range_m"].tolist() == pytest.approx([1.5, 1.501, 1.502, 1.503, 1.504])
    assert table["t_s"][0] == START_S + 0.5
    for wrong, message in (
        ({"anchor": "mac", "range": "millis"}, "no field 'millis'; available: when, mac, mm"),
        ({"anchor": "mac", "range": "mac", "each": "mm"}, "mm is not an array of messages"),
        ({"anchor": "when.x", "range": "mm"}, "no field 'when.x'"),
    ):
        with pytest.raises(InputError, match=message):
            RosLog(path).ranges("/uwb", FieldMap(**wrong))  # type: ignore[arg-type]


def test_a_topic_per_anchor(tmp_path: Path) -> None:
    log = Log(tmp_path, "mcap", {VENDOR: "float32 d\n"})
    for k in range(3):
        log.point("/pose", START_S + k, float(k), 0.0)
        for name in ("/cone1", "/cone2"):
            log.add(name, VENDOR, START_S + k, d=5.0)
    table = RosLog(log.close()).ranges(fields=FieldMap(anchor="(topic)", range="d"))
    assert table.labels["anchor_id"] == ("/cone1", "/cone2")
    assert len(table) == 6


def test_readings_without_a_range_are_left_out_and_counted(tmp_path: Path) -> None:
    def each(log: Log, k: int) -> dict[str, Any]:
        range_m = np.nan if k == 2 else 9.0
        return {"header": log.header(START_S + k), "anchor_id": "A", "range": range_m, "rssi": 0.0}

    scene = read_described(write_ranges(tmp_path, "bag", FLAT, each))
    notes = scene.notes
    assert len(scene.ranges) == 4
    assert notes == (POSE, TAKEN, "/uwb: skipped 1 reading without a range")


def test_a_header_that_was_never_set(tmp_path: Path) -> None:
    def each(log: Log, k: int) -> dict[str, Any]:
        return {"header": log.header(0.0), "anchor_id": "A", "range": 1.0, "rssi": 0.0}

    path = write_ranges(tmp_path, "bag", FLAT, each)
    with pytest.raises(InputError, match=r"topic /uwb, message 1: .*use clock: receive"):
        RosLog(path).ranges()
    assert len(RosLog(path).ranges(clock="receive")) == 5


def test_topics_that_cannot_be_told_apart_are_listed(tmp_path: Path) -> None:
    log = Log(tmp_path, "mcap")
    for k in range(3):
        for topic in ("/gps/a", "/gps/b"):
            log.fix(topic, START_S + k, 37.0 + k / 1e4, 127.0)
        log.add(
            "/uwb", VENDOR, START_S + k, header=log.header(1), anchor_id="A", range=1.0, rssi=0.0
        )
    path = log.close()
    with pytest.raises(InputError, match=r"2 topics could be the trajectory: /gps/a \(sensor") as e:
        read_described(path)
    assert "\n" not in str(e.value)
    assert len(RosLog(path).trajectory("/gps/b")) == 3
    with pytest.raises(InputError, match="has no topic /no; available: /gps/a"):
        RosLog(path).trajectory("/no")
    with pytest.raises(InputError, match="a trajectory is one of NavSatFix"):
        RosLog(path).trajectory("/uwb")


def test_positions_of_other_types(tmp_path: Path) -> None:
    log = Log(tmp_path, "bag")
    kinds = log.types.types
    point = kinds["geometry_msgs/msg/Point"](x=1.0, y=2.0, z=3.0)
    turn = kinds["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0)
    pose = kinds["geometry_msgs/msg/Pose"](position=point, orientation=turn)
    shift = kinds["geometry_msgs/msg/Vector3"](x=1.0, y=2.0, z=3.0)
    with_covariance = kinds["geometry_msgs/msg/PoseWithCovariance"](
        pose=pose, covariance=np.zeros(36)
    )
    twist = kinds["geometry_msgs/msg/Twist"](linear=shift, angular=shift)
    header = log.header(START_S)
    log.add("/p", "geometry_msgs/msg/PoseStamped", START_S, header=header, pose=pose)
    log.add(
        "/c",
        "geometry_msgs/msg/PoseWithCovarianceStamped",
        START_S,
        header=header,
        pose=with_covariance,
    )
    log.add(
        "/t",
        "geometry_msgs/msg/TransformStamped",
        START_S,
        header=header,
        child_frame_id="tag",
        transform=kinds["geometry_msgs/msg/Transform"](translation=shift, rotation=turn),
    )
    log.add(
        "/o",
        "nav_msgs/msg/Odometry",
        START_S,
        header=header,
        child_frame_id="tag",
        pose=with_covariance,
        twist=kinds["geometry_msgs/msg/TwistWithCovariance"](twist=twist, covariance=np.zeros(36)),
    )
    path = log.close()
    for topic in ("/p", "/c", "/t", "/o"):
        table = RosLog(path).trajectory(topic)
        assert [table[name][0] for name in ("east_m", "north_m", "up_m")] == [1.0, 2.0, 3.0]


def without_definitions(folder: Path) -> Path:
    """Return a database like those of ROS 2 Humble, which has no definitions."""
    path = write_drive(folder, "folder-sqlite3")
    database = sqlite3.connect(next(path.glob("*.db3")))
    database.execute("DELETE FROM message_definitions")
    database.commit()
    database.close()
    return path


def test_definitions_that_the_bag_lacks(tmp_path: Path) -> None:
    path = without_definitions(tmp_path)
    with pytest.raises(InputError, match=r"give a msg_dir with acme_uwb/msg/Range\.msg"):
        read_described(path)
    assert len(RosLog(path).trajectory()) == 200  # of ROS's own types the stock's serve
    definition = tmp_path / "src" / "acme_uwb" / "msg" / "Range.msg"
    definition.parent.mkdir(parents=True)
    definition.write_text(FLAT, encoding="utf-8")
    assert len(RosLog(path, tmp_path / "src").ranges()) == 120
    definition.write_text("nonsense", encoding="utf-8")
    with pytest.raises(InputError, match=r"Range\.msg: is not a message definition"):
        RosLog(path, tmp_path / "src")
    with pytest.raises(InputError, match="no such folder"):
        RosLog(path, tmp_path / "none")


@pytest.mark.parametrize("kind", ["bag", "mcap"])
def test_a_recording_that_was_cut_off_is_read_up_to_there(
    drives: dict[str, Path], tmp_path: Path, kind: str
) -> None:
    data = drives[kind].read_bytes()
    whole = len(RosLog(drives[kind]).ranges())
    path = tmp_path / f"cut{drives[kind].suffix}"
    log = Log(tmp_path, kind)  # many chunks: the first is whole
    blob = {"header": log.header(1.0), "anchor_id": "A" * 150, "range": 1.0, "rssi": 0.0}
    for _ in range(12_000):
        log.add("/uwb", VENDOR, START_S, **blob)
    data = log.close().read_bytes()
    path.write_bytes(data[: len(data) * 2 // 3])
    ros = RosLog(path)
    table = ros.ranges(clock="receive")
    assert 0 < len(table) < 12_000
    assert "cut off within a record at byte" in ros.notes[0]
    assert whole == 120


def test_a_ros2_folder_of_several_files_and_bad_descriptions(
    drives: dict[str, Path], tmp_path: Path
) -> None:
    folder = tmp_path / "log"
    shutil.copytree(drives["folder-mcap"], folder)
    metadata = folder / "metadata.yaml"
    text = metadata.read_text(encoding="utf-8")
    twice = read_yaml(metadata, most_bytes=100_000)
    twice["rosbag2_bagfile_information"]["relative_file_paths"] *= 2
    for wrong, message in (
        (json.dumps(twice), "lists 'log.mcap' more than once"),
        ("", "is empty"),
        ("a: [", "cannot be read"),
        ("a: 1", "is not a description of a ROS 2 recording"),
        (text.replace("log.mcap", "gone.mcap"), "no such file"),
        (text.replace("log.mcap", "metadata.yaml"), "expected a .bag, .mcap or .db3 file"),
    ):
        metadata.write_text(wrong, encoding="utf-8")
        with pytest.raises(InputError, match=message):
            read_described(folder)


def test_a_topic_with_a_line_break_gives_one_line(tmp_path: Path) -> None:
    log = Log(tmp_path, "mcap")
    log.fix("/a\nb", START_S, 37.0, 127.0)
    log.fix("/a\x1b[2Jb", START_S, 37.0, 127.0)
    with pytest.raises(InputError) as caught:
        RosLog(log.close()).trajectory()
    assert "/a?b" in str(caught.value)
    assert str(caught.value).isprintable()


def test_without_the_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "rosbags", None)
    monkeypatch.setitem(sys.modules, "rosbags.typesys", None)
    with pytest.raises(ConfigError, match=r"pip install 'gaia-uwb\[ros\]'"):
        RosLog(tmp_path / "log.bag")
