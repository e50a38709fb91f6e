"""Logs of every kind are read whatever bytes their names are made of."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from bags import write_drive
from gaia_uwb._shared.errors import InputError
from gaia_uwb.api import read
from good_logs import write_serial

ODD = os.fsdecode(b"log \xff%20?#[a]*")


@pytest.mark.parametrize("kind", ["bag", "mcap", "sqlite3"])
def test_ros_logs(tmp_path: Path, kind: str) -> None:
    (tmp_path / "made").mkdir()
    made = write_drive(tmp_path / "made", kind)
    renamed = made.rename(tmp_path / f"{ODD}{made.suffix}")
    scene = read(renamed)
    assert scene.n_anchors
    assert scene.name == r"log \xff%20?#[a]*"


def test_described_logs(tmp_path: Path) -> None:
    folder = tmp_path / ODD
    folder.mkdir()
    write_serial(folder)
    assert read(folder).name == r"log \xff%20?#[a]*"


def test_a_whole_disk_is_not_looked_through_for_definitions(tmp_path: Path) -> None:
    write_drive(tmp_path / "made", "sqlite3")
    ros = "file: made, format: ros, msg_dir: /"
    text = f"trajectory: {{{ros}}}\nranges: [{{{ros}}}]\n"
    (tmp_path / "gaia.yaml").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=r"contains more than 20,000 files: name the folder"):
        read(tmp_path)
