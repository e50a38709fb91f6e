"""ROS logs of several tags, and of vehicles whose orientation is known."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from bags import FORMATS, START_S, VENDOR, Log
from gaia_uwb._shared.errors import InputError
from gaia_uwb.logs._lever_arm import TagInput
from gaia_uwb.logs.bags.fields import FieldMap
from gaia_uwb.logs.described import read_described
from gaia_uwb.logs.ros import RosLog
from gaia_uwb.logs.ros.attitude import attitude
from gaia_uwb.scene import Tag

Fill = Callable[[Log, int], dict[str, Any]]
"""From a log and the number of a message to its fields."""

BOTH_ENDS = "std_msgs/Header header\nuint8 from_id\nuint8 to_id\nfloat32 range\n"
OWN_ID = "std_msgs/Header header\nuint8 id\nNode[] nodes\n"
NODE = {"acme_uwb/msg/Node": "uint8 id\nfloat32 dis\n"}
TAGS = {"10": TagInput(forward_m=1.0), "11": TagInput()}


def write(folder: Path, text: str, fill: Fill, *, kind: str = "mcap", **types: str) -> Path:
    """Write a log with 24 messages of a vendor's type."""
    log = Log(folder, kind, {**types, VENDOR: text})
    for k in range(24):
        log.point("/pose", START_S + k, float(k), 0.0)
        log.add("/uwb", VENDOR, START_S + k, **fill(log, k))
    return log.close()


def both_ends(log: Log, k: int) -> dict[str, Any]:
    ends = {"from_id": k // 2 % 3, "to_id": 10 + k % 2}
    return {"header": log.header(START_S + k), **ends, "range": 5.0 + k}


def own_id(log: Log, k: int) -> dict[str, Any]:
    node = log.types.types["acme_uwb/msg/Node"]
    nodes = [node(id=n, dis=5.0 + n + k) for n in (1, 2)]
    return {"header": log.header(START_S + k), "id": 10 + k % 2, "nodes": nodes}


def tags_of(table: Any) -> list[str]:
    return [table.labels["tag_id"][k] for k in table["tag_id"]]


@pytest.mark.parametrize("kind", FORMATS)
def test_the_end_that_is_a_given_tag_is_the_tag(tmp_path: Path, kind: str) -> None:
    log = RosLog(write(tmp_path, BOTH_ENDS, both_ends, kind=kind))
    table = log.ranges(tags=TAGS)
    assert tags_of(table)[:4] == ["10", "11", "10", "11"]
    assert table.labels["anchor_id"] == ("0", "1", "2")
    assert log.notes == ["ranges: /uwb: anchor: from_id, range: range, tag: to_id"]


def test_the_tag_may_be_the_field_that_was_taken_for_the_anchor(tmp_path: Path) -> None:
    def turned(log: Log, k: int) -> dict[str, Any]:
        fields = both_ends(log, k)
        return fields | {"from_id": fields["to_id"], "to_id": fields["from_id"]}

    table = RosLog(write(tmp_path, BOTH_ENDS, turned)).ranges(tags=TAGS)
    assert tags_of(table)[:4] == ["10", "11", "10", "11"]
    assert table.labels["anchor_id"] == ("0", "1", "2")


@pytest.mark.parametrize(
    "fields", [None, FieldMap(each="nodes", anchor="id", range="dis", tag=".id")]
)
def test_the_message_s_own_id_may_be_the_tag_s(tmp_path: Path, fields: FieldMap | None) -> None:
    log = RosLog(write(tmp_path, OWN_ID, own_id, **NODE))
    table = log.ranges(fields=fields, tags=TAGS)
    assert tags_of(table)[:4] == ["10", "10", "11", "11"]
    assert table.labels["anchor_id"] == ("1", "2")


def test_parallel_arrays_have_the_tag_beside_them(tmp_path: Path) -> None:
    def fill(log: Log, k: int) -> dict[str, Any]:
        tags, ranges = np.array([10, 11], np.uint8), np.array([3.0, 4.0], np.float32)
        return {"tag_ids": tags, "anchor_ids": np.array([1, 1], np.uint8), "ranges": ranges}

    path = write(tmp_path, "uint8[] tag_ids\nuint8[] anchor_ids\nfloat32[] ranges\n", fill)
    table = RosLog(path).ranges(tags=TAGS)
    assert tags_of(table) == ["10", "11"] * 24
    assert set(table["range_m"][1::2]) == {4.0}


def test_where_takes_one_tag_and_keeps_its_name(tmp_path: Path) -> None:
    path = write(tmp_path, BOTH_ENDS, both_ends)
    table = RosLog(path).ranges(where={"to_id": 11}, tags=TAGS)
    assert tags_of(table) == ["11"] * 12
    both = RosLog(path).ranges(where={"to_id": [10, 11]}, tags=TAGS)
    assert tags_of(both)[:2] == ["10", "11"]


def test_without_lever_arms_several_tags_are_refused(tmp_path: Path) -> None:
    path = write(tmp_path, BOTH_ENDS, both_ends)
    way_out = (
        "say where each is on the vehicle, tags: {10: {forward_m: ..., left_m: ...}, ...} in "
        "gaia.yaml or in a vehicle's file (--vehicle), or "
    )
    with pytest.raises(InputError) as caught:
        RosLog(path).ranges(fields=FieldMap(anchor="from_id", range="range"))
    assert str(caught.value).endswith(
        "to_id has several values ('10', '11'), as of several tags (the anchor is from_id): "
        f"{way_out}choose one, where: {{to_id: 10}} in gaia.yaml (docs/inputs.md)"
    )
    with pytest.raises(InputError) as caught:
        RosLog(path).ranges(fields=FieldMap(anchor="from_id", range="range", tag="to_id"))
    assert str(caught.value).endswith(
        f"holds ranges of 2 tags ('10', '11'): {way_out}take one by where: {{to_id: 10}} in this "
        "file's entry in gaia.yaml"
    )


def describe(folder: Path, **content: Any) -> Path:
    entry = {"file": "log", "format": "ros"}
    description = {"trajectory": entry, "ranges": [{**entry, "topic": "/uwb"}], **content}
    (folder / "gaia.yaml").write_text(yaml.safe_dump(description), encoding="utf-8")
    return folder


def test_a_scene_of_two_tags(tmp_path: Path) -> None:
    write(tmp_path, BOTH_ENDS, both_ends, kind="folder-mcap")
    scene = read_described(describe(tmp_path, tags={10: {"forward_m": 1.0}, 11: {}}))
    assert scene.tags == (Tag("10", forward_m=1.0), Tag("11"))
    assert scene.ranges.tag.tolist() == [0, 1] * 12
    with pytest.raises(InputError, match=r"holds ranges of '11', which tags in gaia\.yaml"):
        read_described(
            describe(
                tmp_path,
                tags={10: {}, 12: {}},
                ranges=[
                    {
                        "file": "log",
                        "format": "ros",
                        "fields": {"anchor": "from_id", "range": "range", "tag": "to_id"},
                    }
                ],
            )
        )


def quaternion(yaw_rad: float, pitch_rad: float = 0.0, roll_rad: float = 0.0) -> list[float]:
    """Return x, y, z, w of a vehicle that is rolled, then pitched, then turned."""
    turns = [np.cos([yaw_rad / 2, pitch_rad / 2, roll_rad / 2])]
    turns.append(np.sin([yaw_rad / 2, pitch_rad / 2, roll_rad / 2]))
    (cy, cp, cr), (sy, sp, sr) = turns
    return [
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    ]


def test_attitude_of_any_quaternion() -> None:
    rng = np.random.default_rng(3)
    yaw, pitch, roll = rng.uniform([-3.1, -1.5, -3.1], [3.1, 1.5, 3.1], (50, 3)).T
    found = attitude(np.array(list(map(quaternion, yaw, pitch, roll))) * 1.05)
    np.testing.assert_allclose(found["heading_deg"], (90 - np.degrees(yaw)) % 360, atol=1e-9)
    np.testing.assert_allclose(found["pitch_deg"], np.degrees(pitch), atol=1e-6)
    np.testing.assert_allclose(found["roll_deg"], np.degrees(roll), atol=1e-9)


def write_odometry(folder: Path, kind: str, turns: list[list[float]]) -> Path:
    log = Log(folder, kind)
    made = log.types.types
    for k, (x, y, z, w) in enumerate(turns):
        pose = made["geometry_msgs/msg/Pose"](
            position=made["geometry_msgs/msg/Point"](x=float(k), y=0.0, z=0.5),
            orientation=made["geometry_msgs/msg/Quaternion"](x=x, y=y, z=z, w=w),
        )
        fields = {"header": log.header(START_S + k), "pose": pose}
        log.add("/pose", "geometry_msgs/msg/PoseStamped", START_S + k, **fields)
    return log.close()


@pytest.mark.parametrize("kind", ["bag", "mcap"])
def test_poses_give_the_attitude(tmp_path: Path, kind: str) -> None:
    turns = [quaternion(0.1 * k, 0.02, -0.03) for k in range(9)]
    turns[4] = [0.0, 0.0, 0.0, 0.0]
    log = RosLog(write_odometry(tmp_path, kind, turns))
    table = log.trajectory()
    expected_deg = 90 - np.degrees(0.1 * np.arange(9))
    expected_deg[4] = np.nan
    np.testing.assert_allclose(table["heading_deg"], expected_deg)
    np.testing.assert_allclose(np.radians(table["pitch_deg"][0]), 0.02)
    np.testing.assert_allclose(np.radians(table["roll_deg"][0]), -0.03)
    assert log.notes[-1] == "/pose: heading, roll and pitch from the orientation"


@pytest.mark.parametrize("turn", [[0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
def test_an_orientation_that_was_never_set_is_none(tmp_path: Path, turn: list[float]) -> None:
    log = RosLog(write_odometry(tmp_path, "mcap", [turn] * 9))
    assert set(log.trajectory().columns) == {"t_s", "east_m", "north_m", "up_m"}
    assert log.notes == ["trajectory: /pose (PoseStamped)"]
