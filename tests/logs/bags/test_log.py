from __future__ import annotations

import shutil
import sqlite3
from pathlib import Path

import pytest
from rosbags.rosbag2 import CompressionFormat, CompressionMode

from bags import START_S, Log, write_drive
from gaia_uwb._shared.errors import InputError
from gaia_uwb.logs.described import is_described, read_described
from gaia_uwb.logs.ros import RosLog


def killed_recording(folder: Path, n_in_main: int = 40) -> Path:
    """Return a database most of whose messages are still in the file beside it."""
    whole = next(write_drive(folder / "whole", "folder-sqlite3").glob("*.db3"))
    live, path = folder / "live.db3", folder / "killed.db3"
    shutil.copy(whole, live)
    database = sqlite3.connect(live)
    rows = database.execute("SELECT * FROM messages ORDER BY id").fetchall()
    database.execute("DELETE FROM messages")
    database.commit()
    database.execute("PRAGMA journal_mode=WAL")
    database.execute("PRAGMA wal_autocheckpoint=0")
    marks = ",".join("?" * len(rows[0]))
    for k, row in enumerate(rows):
        database.execute(f"INSERT INTO messages VALUES ({marks})", row)
        if k == n_in_main:
            database.commit()
            database.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    database.commit()
    shutil.copy(live, path)
    shutil.copy(f"{live}-wal", f"{path}-wal")
    database.close()
    return path


def test_messages_beside_the_database_are_read_and_nothing_is_touched(tmp_path: Path) -> None:
    path = killed_recording(tmp_path)
    before = {each.name: each.read_bytes() for each in tmp_path.glob("killed*")}
    assert is_described(path)
    scene = read_described(path)
    notes = scene.notes
    assert (len(scene.trajectory), len(scene.ranges)) == (200, 120)
    note = "killed.db3: its recording was not closed; read with killed.db3-wal"
    assert notes[0] == note
    assert {each.name: each.read_bytes() for each in tmp_path.glob("killed*")} == before
    Path(f"{path}-wal").write_bytes(b"")
    assert len(RosLog(path).trajectory()) < 40


def test_what_beside_a_database_cannot_be_copied_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    path = killed_recording(tmp_path)
    monkeypatch.setattr(shutil, "copyfile", full)
    with pytest.raises(InputError, match=r"to read killed\.db3-wal with it: No space left"):
        RosLog(path)


def write_part(folder: Path, name: str, start: int, n: int = 20) -> None:
    """Write a part of a recording as one file."""
    log = Log(folder / "made", "mcap")
    for k in range(n):
        t_s = START_S + start + k
        log.point("/pose", t_s, float(start + k), 0.0)
        header = log.header(t_s)
        log.add(
            "/uwb", "acme_uwb/msg/Range", t_s, header=header, anchor_id="A", range=9.0 + k, rssi=0.0
        )
    shutil.move(log.close(), folder / name)
    shutil.rmtree(folder / "made")


def test_a_folder_without_a_description_is_told_by_its_names(tmp_path: Path) -> None:
    folder = tmp_path / "drive"
    for k in (0, 2, 10):
        write_part(folder, f"drive_{k}.mcap", 2 * k)
    assert is_described(folder)
    scene = read_described(folder)
    notes = scene.notes
    assert scene.trajectory.t_s[-1] == START_S + 39
    assert notes[0] == "drive: no metadata.yaml; read drive_0.mcap, drive_2.mcap, drive_10.mcap"


def test_parts_of_ros_1_have_a_date_each(tmp_path: Path) -> None:
    for k in (0, 1):
        bag = write_drive(tmp_path / "made", "bag")
        shutil.move(bag, tmp_path / f"a_2026-03-03-09-0{k}-00_{k}.bag")
    (tmp_path / "._a.bag").write_bytes(b"of a Mac")
    assert is_described(tmp_path)
    assert len(RosLog(tmp_path).ranges()) == 240


SEPARATE = [
    ("a_1.mcap", "a_2.mcap"),
    ("a_0.mcap", "b_1.mcap"),
    ("a_0.mcap", "a_1.db3"),
    ("a_0.mcap", "a_00.mcap"),
    ("2026-03-03-09-00-00.mcap", "2026-03-03-10-00-00.mcap"),
]


@pytest.mark.parametrize("names", SEPARATE)
def test_recordings_of_several_drives_stay_apart(tmp_path: Path, names: tuple[str, ...]) -> None:
    for k, name in enumerate(names):
        write_part(tmp_path, name, 100 * k)
    assert not is_described(tmp_path)
    with pytest.raises(
        InputError, match=f"its ROS logs are not the parts of one: {sorted(names)[0][:3]}"
    ):
        RosLog(tmp_path)


def test_bags_beside_a_log_in_tables_are_not_that_log(tmp_path: Path) -> None:
    for k in (0, 1):
        write_part(tmp_path, f"raw_{k}.mcap", k)
    assert is_described(tmp_path)
    (tmp_path / "trajectory.csv").write_text("t_s,lat,lon\n", encoding="utf-8")
    assert not is_described(tmp_path)


def test_parts_that_lie_far_apart_are_noted(tmp_path: Path) -> None:
    for k in (0, 1):
        write_part(tmp_path, f"drive_{k}.mcap", 320 * k)
    log = RosLog(tmp_path)
    log.trajectory()
    assert any(
        note.startswith("drive_1.mcap: starts 301 s after the file bef") for note in log.notes
    )


def test_the_only_file_of_a_folder_is_its_log(tmp_path: Path) -> None:
    write_part(tmp_path, "any name.mcap", 0)
    assert len(RosLog(tmp_path).ranges()) == 20
    empty = tmp_path / "empty"
    empty.mkdir()
    with pytest.raises(InputError, match=r"has no metadata\.yaml, and .*: none"):
        RosLog(empty)


def test_messages_that_are_packed_are_read_without_a_description(tmp_path: Path) -> None:
    packed = (CompressionMode.MESSAGE, CompressionFormat.ZSTD)
    for kind, ending in (("folder-sqlite3", "db3"), ("folder-mcap", "mcap")):
        folder = write_drive(tmp_path / kind, kind, packed)
        assert len(RosLog(next(folder.glob(f"*.{ending}"))).ranges()) == 120


def test_a_bag_that_is_still_active_is_read(tmp_path: Path) -> None:
    path = write_drive(tmp_path, "bag")
    active = path.rename(tmp_path / "drive.bag.active")
    assert is_described(active)
    assert read_described(active).name == "drive"


def test_a_file_that_is_compressed_as_a_whole_is_named_so(tmp_path: Path) -> None:
    (tmp_path / "log.mcap.zst").write_bytes(b"1")
    with pytest.raises(InputError, match="compressed as a whole: decompress it first"):
        RosLog(tmp_path / "log.mcap.zst")
