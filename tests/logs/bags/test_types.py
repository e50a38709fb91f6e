from __future__ import annotations

import sqlite3
from pathlib import Path
from typing import Any

import pytest
from rosbags.typesys import Stores

from bags import START_S, Log
from gaia_uwb._shared.errors import InputError
from gaia_uwb.logs.ros import RosLog

RANGE = "sensor_msgs/msg/Range"


def write_ranges(folder: Path, release: Stores) -> Path:
    """Write a database without definitions, as ROS 2 did before Iron."""
    log = Log(folder, "folder-sqlite3", release=release)
    extra: dict[str, Any] = {} if release is Stores.ROS2_HUMBLE else {"variance": 0.0}
    for k in range(12):
        values = {"radiation_type": 0, "field_of_view": 0.1, "min_range": 0.0, "max_range": 99.0}
        header = log.header(START_S + k, f"cone-{k % 3}")
        log.add("/uwb", RANGE, START_S + k, header=header, **values, range=5.0 + k, **extra)
    path = log.close()
    database = sqlite3.connect(next(path.glob("*.db3")))
    database.execute("DELETE FROM message_definitions")
    database.commit()
    database.close()
    return path


@pytest.mark.parametrize("release", [Stores.ROS2_HUMBLE, Stores.ROS2_JAZZY])
def test_a_type_that_has_changed_is_read_as_it_was(tmp_path: Path, release: Stores) -> None:
    log = RosLog(write_ranges(tmp_path, release))
    table = log.ranges()
    assert table["range_m"].tolist() == [5.0 + k for k in range(12)]
    assert table.labels["anchor_id"] == ("cone-0", "cone-1", "cone-2")
    old = release is Stores.ROS2_HUMBLE
    note = f"/uwb: {RANGE} read with the layout of ROS 2 Humble"
    assert log.notes == [
        *([note] if old else []),
        "ranges: /uwb: anchor: header.frame_id, range: range",
    ]


def test_a_message_that_fits_no_layout_is_named(tmp_path: Path) -> None:
    path = write_ranges(tmp_path, Stores.ROS2_HUMBLE)
    database = sqlite3.connect(next(path.glob("*.db3")))
    database.execute("UPDATE messages SET data = substr(data, 1, 30)")
    database.commit()
    database.close()
    with pytest.raises(InputError, match="topic /uwb, message 1: cannot be read"):
        RosLog(path).ranges()
