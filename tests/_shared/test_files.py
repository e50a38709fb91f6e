"""Result files are whole or absent, whatever happens while they are written."""

from __future__ import annotations

import errno
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from gaia_uwb._shared.errors import ConfigError
from gaia_uwb._shared.files import OutputFolder, remove_abandoned, temporary_path
from killed_runs import KilledRuns, gaia
from wzdx_cases import FEED_YAML

RECORD = ".gaia-files"


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_makes_missing_folders_and_leaves_nothing_in_them(tmp_path: Path) -> None:
    OutputFolder(tmp_path / "a" / "b")
    assert names(tmp_path / "a" / "b") == []


def test_writes_and_overwrites_text_and_bytes(tmp_path: Path) -> None:
    folder = OutputFolder(tmp_path)
    folder.write("text.txt", "Straße\r\n")
    path = folder.write("text.txt", "Weg\n")
    folder.write("bytes.bin", b"\x00\xff")
    assert path == tmp_path / "text.txt"
    assert path.read_bytes() == b"Weg\n"
    assert (tmp_path / "bytes.bin").read_bytes() == b"\x00\xff"
    assert names(tmp_path) == [RECORD, "bytes.bin", "text.txt"]


def test_another_run_replaces_what_one_of_ours_wrote(tmp_path: Path) -> None:
    OutputFolder(tmp_path).write("report.json", "old")
    OutputFolder(tmp_path).write("report.json", "new")
    assert (tmp_path / "report.json").read_text() == "new"


def test_a_file_of_somebody_elses_is_neither_replaced_nor_removed(tmp_path: Path) -> None:
    theirs = tmp_path / "cones.csv"
    theirs.write_text("theirs")
    folder = OutputFolder(tmp_path)
    with pytest.raises(ConfigError, match=r"cones\.csv: was not written by gaia"):
        folder.claim(["report.json", "cones.csv"])
    with pytest.raises(ConfigError, match=r"cones\.csv: was not written by gaia"):
        folder.write("cones.csv", "ours")
    folder.remove("cones.csv")
    assert theirs.read_text() == "theirs"
    folder.write("report.json", "{}")  # neither name was recorded by the claim that failed
    assert folder.names() == {"report.json"}


def test_a_dangling_link_of_somebody_elses_is_a_file_too(tmp_path: Path) -> None:
    (tmp_path / "map.html").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(ConfigError, match=r"map\.html: was not written by gaia"):
        OutputFolder(tmp_path).claim(["map.html"])


def test_a_name_is_on_the_record_before_the_file_is_there(tmp_path: Path) -> None:
    # Killed in between, the next run finds its own half of the work and may replace it.
    OutputFolder(tmp_path).claim(["a.json"])
    (tmp_path / "a.json").write_text("of the killed run")
    OutputFolder(tmp_path).write("a.json", "new")


def test_a_record_that_was_cut_off_claims_nothing_more(tmp_path: Path) -> None:
    folder = OutputFolder(tmp_path)
    folder.claim(["cones.csv"])
    record = tmp_path / RECORD
    record.write_text(record.read_text()[:-5])
    folder.claim(["report.md"])
    assert {"report.md"} <= folder.names()
    (tmp_path / "cones.csv").write_text("theirs")
    with pytest.raises(ConfigError, match="was not written by gaia"):
        folder.write("cones.csv", "ours")


def test_a_name_that_is_no_utf_8_is_written_in_ascii(tmp_path: Path) -> None:
    path = OutputFolder(tmp_path).write("a.json", '{"log": "Stra\udcdfe"}')
    assert path.read_bytes() == b'{"log": "Stra\\udcdfe"}'


def test_files_follow_the_umask(tmp_path: Path) -> None:
    before = os.umask(0o022)
    try:
        path = OutputFolder(tmp_path).write("report.json", "{}")
    finally:
        os.umask(before)
    assert path.stat().st_mode & 0o777 == 0o644


@pytest.mark.parametrize("error", [OSError(errno.ENOSPC, "full"), KeyboardInterrupt()])
def test_a_write_that_fails_leaves_the_old_file_and_no_litter(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: BaseException
) -> None:
    folder = OutputFolder(tmp_path)
    folder.write("report.json", "old")

    def fail(number: int) -> None:
        raise error

    monkeypatch.setattr(os, "fsync", fail)
    with pytest.raises(ConfigError if isinstance(error, OSError) else KeyboardInterrupt):
        folder.write("report.json", "new")
    assert (tmp_path / "report.json").read_text() == "old"
    assert names(tmp_path) == [RECORD, "report.json"]


def test_folder_that_is_a_file(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("")
    with pytest.raises(ConfigError, match=r"out: cannot write to this folder: File exists"):
        OutputFolder(tmp_path / "out")
    with pytest.raises(ConfigError, match=r"out/run: cannot write to this folder: Not a directory"):
        OutputFolder(tmp_path / "out" / "run")


@pytest.mark.skipif(not Path("/proc/self").is_dir(), reason="left out: no /proc on this system")
def test_folder_that_refuses_files() -> None:
    # Permissions do not stop root, /proc does.
    with pytest.raises(ConfigError, match="/proc/self: cannot write to this folder"):
        OutputFolder(Path("/proc/self"))


def test_folder_that_vanishes_and_name_that_is_taken(tmp_path: Path) -> None:
    folder = OutputFolder(tmp_path / "out")
    folder.claim(["plot.png"])
    (tmp_path / "out" / "plot.png").mkdir()
    with pytest.raises(ConfigError, match=r"plot\.png: cannot write this file: Is a directory"):
        folder.write("plot.png", b"")
    assert names(tmp_path / "out") == [RECORD, "plot.png"]
    shutil.rmtree(tmp_path / "out")
    with pytest.raises(ConfigError, match=r"cannot write this file: No such file"):
        folder.write("report.json", "{}")


HALF = """
import os
flush = os.fsync
def stand_still(number):
    if ".gaia-files" not in os.readlink(f"/proc/self/fd/{number}"):
        print("half", flush=True)
        time.sleep(60)
    flush(number)
os.fsync = stand_still
"""
"""Stands still after a file is written and before it gets its name."""


def start(code: str, folder: Path) -> subprocess.Popen[bytes]:
    preamble = "import sys, time\nfrom pathlib import Path\n"
    preamble += "from gaia_uwb._shared.files import OutputFolder\n"
    preamble += "folder = OutputFolder(Path(sys.argv[1]))\n"
    return subprocess.Popen(
        [sys.executable, "-c", preamble + code, str(folder)], stdout=subprocess.PIPE
    )


def kill(process: subprocess.Popen[bytes]) -> None:
    process.send_signal(signal.SIGKILL)
    assert process.wait() == -signal.SIGKILL
    assert process.stdout is not None
    process.stdout.close()


def test_kill_in_the_middle_of_a_write_leaves_the_old_file(tmp_path: Path) -> None:
    OutputFolder(tmp_path).write("report.json", "old")
    code = HALF + 'folder.write("report.json", "new")\n'
    process = start(code, tmp_path)
    assert process.stdout is not None
    assert process.stdout.readline() == b"half\n"
    kill(process)
    assert (tmp_path / "report.json").read_text() == "old"
    assert [name for name in names(tmp_path) if not name.startswith(".")] == ["report.json"]


def test_what_a_killed_run_left_is_removed_by_the_next(tmp_path: Path) -> None:
    code = HALF + 'folder.write("a.bin", b"")\n'
    process = start(code, tmp_path)
    assert process.stdout is not None
    process.stdout.readline()
    (left,) = set(names(tmp_path)) - {RECORD}
    OutputFolder(tmp_path)
    assert names(tmp_path) == sorted([left, RECORD])  # its owner lives
    kill(process)
    OutputFolder(tmp_path)
    assert names(tmp_path) == [RECORD]


def test_what_may_have_an_owner_stays_for_a_day(tmp_path: Path) -> None:
    mine = temporary_path(tmp_path, "report.json")
    head, machine, process, run, rest = mine.name.split("-", 4)
    elsewhere = "-".join([head, f"{int(machine, 16) ^ 1:08x}", "1", "00000000", rest])
    earlier = "-".join([head, machine, process, "00000000", rest])  # our number, another run
    folder = "-".join([head, machine, process, "00000001", "scene"])
    others = [".gaia", ".gaia-x-1-y-z", ".report.json", f".{run}-report.json", "report.json"]
    for name in (mine.name, elsewhere, earlier, *others):
        (tmp_path / name).touch()
    (tmp_path / folder / "inner").mkdir(parents=True)
    remove_abandoned(tmp_path)
    assert names(tmp_path) == sorted([mine.name, elsewhere, *others])
    day_ago_s = time.time() - 100_000
    os.utime(tmp_path / elsewhere, (day_ago_s, day_ago_s))
    os.utime(mine, (day_ago_s, day_ago_s))
    remove_abandoned(tmp_path)
    assert names(tmp_path) == sorted([mine.name, *others])


@pytest.mark.parametrize("command", ["reconstruct", "simulate", "wzdx write"])
def test_a_killed_command_leaves_whole_files_and_the_next_tidies_up(
    tmp_path: Path, command: str
) -> None:
    # tests/endurance/killed_commands.py does this a hundred times.
    config = tmp_path / "feed.yaml"
    config.write_text(FEED_YAML, encoding="utf-8")
    results, old = tmp_path / "results", tmp_path / "old"
    log = ["reconstruct", "sim:lane-closure/3"]
    feed = ["wzdx", "write", results, "--config", config, "--update-date"]
    if command == "reconstruct":
        first, then = [*log, "--denoiser", "raw"], log
    elif command == "simulate":
        passes = ["simulate", "--preset", "straight", "--episodes", "3", "--format", "csv"]
        first, then = passes, [*passes, "--seed", "1"]
    else:
        first, then = [*feed, "2026-11-22T09:30:00Z"], [*feed, "2026-11-22T10:00:00Z"]
        assert gaia([*log, "--out", results]).wait() in (0, 1)
    assert gaia([*first, "--out", old]).wait() in (0, 1)
    runs = KilledRuns(lambda out: [*then, "--out", out], old, tmp_path)
    rng = np.random.default_rng(20261122)
    for _ in range(3):
        runs.kill_once(rng)
    runs.check_the_next_run()


def test_kill_at_any_moment_never_shows_half_a_file(tmp_path: Path) -> None:
    code = """
while True:
    for letter in (b"a", b"b"):
        folder.write("big.bin", letter * 1_000_000)
        print("once", flush=True)
"""
    for wait_s in (0.0, 0.011, 0.023):
        process = start(code, tmp_path)
        assert process.stdout is not None
        process.stdout.readline()
        time.sleep(wait_s)
        kill(process)
        content = (tmp_path / "big.bin").read_bytes()
        assert content in (b"a" * 1_000_000, b"b" * 1_000_000)


def test_remove_a_file_of_an_earlier_run(tmp_path: Path) -> None:
    output = OutputFolder(tmp_path)
    output.write("report.json", "{}")
    output.remove("report.json")
    output.remove("report.json")
    assert names(tmp_path) == [RECORD]
    output.claim(["folder"])
    (tmp_path / "folder").mkdir()
    with pytest.raises(ConfigError, match="cannot remove this file"):
        output.remove("folder")
