from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from bags import START_S, VENDOR, Log
from gaia_uwb._shared.errors import InputError
from gaia_uwb.logs.bags.transforms import Link
from gaia_uwb.logs.described import read_described
from gaia_uwb.logs.ros import RosLog

TREE = "tf2_msgs/msg/TFMessage"
TREE_OF_ROS1 = {TREE: "geometry_msgs/TransformStamped[] transforms\n"}


def transform(log: Log, t_s: float, parent: str, child: str, x: float, y: float = 0.0) -> Any:
    kinds = log.types.types
    turn = kinds["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0)
    shift = kinds["geometry_msgs/msg/Vector3"](x=x, y=y, z=0.5)
    return kinds["geometry_msgs/msg/TransformStamped"](
        header=log.header(t_s, parent),
        child_frame_id=child,
        transform=kinds["geometry_msgs/msg/Transform"](translation=shift, rotation=turn),
    )


def write_tree(folder: Path, kind: str = "mcap", extra: str = "wheel") -> Path:
    """Write a drive whose pose is in /tf only, with a fixed link to the tag and one that idles."""
    log = Log(folder, kind, TREE_OF_ROS1 if kind == "bag" else None)
    fixed = [transform(log, 0.0, "base_link", "tag", -1.0, 2.0)]
    log.add("/tf_static", TREE, START_S, transforms=fixed)
    for k in range(40):
        t_s = START_S + k / 10
        links = [transform(log, t_s, "map", "base_link", float(k))]
        links.append(transform(log, t_s, "base_link", extra, 0.01 * (k % 3)))
        log.add("/tf", TREE, t_s, transforms=links)
        header = log.header(t_s)
        if kind != "bag":
            log.add("/uwb", VENDOR, t_s, header=header, anchor_id="A", range=9.0 + k, rssi=-80.0)
    return log.close()


@pytest.mark.parametrize("kind", ["bag", "mcap", "folder-sqlite3"])
def test_the_frame_that_moves_is_the_trajectory(tmp_path: Path, kind: str) -> None:
    log = RosLog(write_tree(tmp_path, kind))
    table = log.trajectory()
    np.testing.assert_allclose(table["east_m"], np.arange(40))
    np.testing.assert_allclose(table["t_s"], START_S + np.arange(40) / 10, atol=1e-6)
    assert set(table["up_m"]) == {0.5}
    assert log.notes == ["trajectory: /tf, frame base_link in map"]
    assert "topic /tf, message 8" in str(table.error("is odd", index=7))


def test_frames_are_chosen_in_a_description(tmp_path: Path) -> None:
    write_tree(tmp_path, "folder-mcap")
    frames = {"parent": "map", "child": "/tag"}
    trajectory = {"file": "log", "format": "ros", "frames": frames}
    text = yaml.safe_dump({"trajectory": trajectory, "ranges": [{"file": "log", "format": "ros"}]})
    (tmp_path / "gaia.yaml").write_text(text, encoding="utf-8")
    scene = read_described(tmp_path)
    notes = scene.notes
    np.testing.assert_allclose(scene.trajectory.position_m[:2], [[-1, 2], [0, 2]], atol=1e-9)
    assert notes[0] == "trajectory: /tf, frame /tag in map"


def test_frames_that_are_not_there_or_not_clear_are_listed(tmp_path: Path) -> None:
    path = write_tree(tmp_path)
    with pytest.raises(InputError, match=r"no chain of .* from map to gps: .*map -> base"):
        RosLog(path).trajectory(frames=Link("map", "gps"))
    log = Log(tmp_path / "b", "mcap")
    for k in range(9):
        both = [transform(log, START_S + k, "map", name, float(k)) for name in ("a", "b")]
        log.add("/tf", TREE, START_S + k, transforms=both)
    path = log.close()
    with pytest.raises(InputError, match=r"not clear which frame .*: set frames: .* map -> a, map"):
        RosLog(path).trajectory()
    assert len(RosLog(path).trajectory("/tf", frames=Link("map", "b"))) == 9


def test_another_trajectory_comes_before_the_tree(tmp_path: Path) -> None:
    log = Log(tmp_path, "mcap")
    for k in range(9):
        log.fix("/fix", START_S + k, 37.0, 127.0 + k * 1e-4)
        log.add(
            "/tf", TREE, START_S + k, transforms=[transform(log, START_S + k, "a", "b", 1.0 * k)]
        )
    path = log.close()
    assert "lat" in RosLog(path).trajectory()
    assert "east_m" in RosLog(path).trajectory(frames=Link("a", "b"))
    with pytest.raises(InputError, match="topic /fix: has no frames to choose from"):
        RosLog(path).trajectory("/fix", frames=Link("a", "b"))


def test_a_topic_without_messages_is_no_trajectory(tmp_path: Path) -> None:
    log = Log(tmp_path, "folder-sqlite3")
    log.fix("/fix", START_S, 37.0, 127.0)
    for k in range(9):
        link = transform(log, START_S + k, "a", "b", 1.0 * k)
        log.add("/tf", TREE, START_S + k, transforms=[link])
    path = log.close()
    with closing(sqlite3.connect(next(path.glob("*.db3")))) as database:
        key = database.execute("SELECT id FROM topics WHERE name = '/fix'").fetchone()[0]
        database.execute("DELETE FROM messages WHERE topic_id = ?", (key,))
        database.commit()
    assert len(RosLog(path).trajectory()) == 9


def test_a_log_without_a_trajectory_says_what_one_is(tmp_path: Path) -> None:
    log = Log(tmp_path, "mcap")
    log.add("/uwb", VENDOR, START_S, header=log.header(1.0), anchor_id="A", range=1.0, rssi=0.0)
    with pytest.raises(
        InputError, match=r"available: /uwb \(acme_uwb.*; a trajectory is one of Nav"
    ):
        RosLog(log.close()).trajectory()


def write_stamps(folder: Path, stamps: list[float]) -> Path:
    log = Log(folder, "mcap")
    for k, t_s in enumerate(stamps):
        header = log.header(t_s)
        log.add("/uwb", VENDOR, START_S + k, header=header, anchor_id="A", range=5.0 + k, rssi=0.0)
    return log.close()


UNSET = "from before the header's clock was set (clock: receive would use them)"


@pytest.mark.parametrize("early", [[0.0, 0.0], [0.0, 12.5]])
def test_stamps_of_a_clock_that_was_not_set_are_left_out(
    tmp_path: Path, early: list[float]
) -> None:
    path = write_stamps(tmp_path, [*early, START_S + 2, START_S + 3])
    log = RosLog(path)
    assert log.ranges()["t_s"].tolist() == [START_S + 2, START_S + 3]
    assert log.notes[1:] == [f"/uwb: skipped 2 messages {UNSET}"]
    assert len(RosLog(path).ranges(clock="receive")) == 4


def test_a_clock_that_counts_from_its_start_is_one(tmp_path: Path) -> None:
    log = RosLog(write_stamps(tmp_path, [1.0, 2.0, 3.0]))
    assert log.ranges()["t_s"].tolist() == [1, 2, 3]
    assert len(log.notes) == 1


@pytest.mark.parametrize(("shift_s", "size"), [(-7.0, "-7.0"), (60.0, "+60.0")])
def test_a_header_that_jumps_is_noted(tmp_path: Path, shift_s: float, size: str) -> None:
    log = RosLog(write_stamps(tmp_path, [START_S + k + shift_s * (k >= 3) for k in range(6)]))
    log.ranges()
    jump = f"jumps by {size} s at message 4 (clock: receive takes the recording's)"
    assert log.notes[1:] == [f"/uwb: the header's clock {jump}"]
