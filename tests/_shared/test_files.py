"""Result files are whole or absent, whatever happens while they are written."""

from __future__ import annotations

import os
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


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_makes_missing_folders_and_leaves_nothing_in_them(tmp_path: Path) -> None:
    OutputFolder(tmp_path / "a" / "b")
    assert names(tmp_path / "a" / "b") == []


def test_writes_and_overwrites_text_bytes_and_by_callback(tmp_path: Path) -> None:
    folder = OutputFolder(tmp_path)
    folder.write_text("text.txt", "Straße\r\n")
    folder.write_text("text.txt", "Weg\n")
    folder.write_bytes("bytes.bin", b"\x00\xff")
    path = folder.write("table.csv", lambda temporary: temporary.write_text("a,b\n"))
    assert path == tmp_path / "table.csv"
    assert (tmp_path / "text.txt").read_bytes() == b"Weg\n"
    assert (tmp_path / "bytes.bin").read_bytes() == b"\x00\xff"
    assert path.read_text() == "a,b\n"
    assert names(tmp_path) == ["bytes.bin", "table.csv", "text.txt"]


def test_a_name_that_is_no_utf_8_is_written_in_ascii(tmp_path: Path) -> None:
    path = OutputFolder(tmp_path).write_text("a.json", '{"log": "Stra\udcdfe"}')
    assert path.read_bytes() == b'{"log": "Stra\\udcdfe"}'


def test_temporary_name_keeps_the_suffix(tmp_path: Path) -> None:
    seen: list[Path] = []

    def write(temporary: Path) -> None:
        seen.append(temporary)
        temporary.write_bytes(b"")

    OutputFolder(tmp_path).write("plot.png", write)
    assert seen[0].suffix == ".png"
    assert seen[0].parent == tmp_path
    assert seen[0].name.startswith(".")


def test_files_follow_the_umask(tmp_path: Path) -> None:
    before = os.umask(0o022)
    try:
        path = OutputFolder(tmp_path).write_text("report.json", "{}")
    finally:
        os.umask(before)
    assert path.stat().st_mode & 0o777 == 0o644


@pytest.mark.parametrize("error", [RuntimeError("broken"), KeyboardInterrupt()])
def test_failing_writer_leaves_the_old_file_and_no_litter(
    tmp_path: Path, error: BaseException
) -> None:
    folder = OutputFolder(tmp_path)
    folder.write_text("report.json", "old")

    def write_half(temporary: Path) -> None:
        temporary.write_text("ne")
        raise error

    with pytest.raises(type(error)):
        folder.write("report.json", write_half)
    assert (tmp_path / "report.json").read_text() == "old"
    assert names(tmp_path) == ["report.json"]


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
    (tmp_path / "out" / "plot.png").mkdir()
    with pytest.raises(ConfigError, match=r"plot\.png: cannot write this file: Is a directory"):
        folder.write_bytes("plot.png", b"")
    assert names(tmp_path / "out") == ["plot.png"]
    (tmp_path / "out" / "plot.png").rmdir()
    (tmp_path / "out").rmdir()
    with pytest.raises(ConfigError, match=r"report\.json: cannot write this file: No such file"):
        folder.write_text("report.json", "{}")


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
    OutputFolder(tmp_path).write_text("report.json", "old")
    code = """
def write_half(temporary):
    with temporary.open("w") as file:
        file.write("ne")
        file.flush()
        print("half", flush=True)
        time.sleep(60)
folder.write("report.json", write_half)
"""
    process = start(code, tmp_path)
    assert process.stdout is not None
    assert process.stdout.readline() == b"half\n"
    kill(process)
    assert (tmp_path / "report.json").read_text() == "old"
    assert [name for name in names(tmp_path) if not name.startswith(".")] == ["report.json"]


def test_what_a_killed_run_left_is_removed_by_the_next(tmp_path: Path) -> None:
    code = """
def write_half(temporary):
    temporary.touch()
    print("half", flush=True)
    time.sleep(60)
folder.write("a.bin", write_half)
"""
    process = start(code, tmp_path)
    assert process.stdout is not None
    process.stdout.readline()
    ((left),) = names(tmp_path)
    OutputFolder(tmp_path)
    assert names(tmp_path) == [left]  # its owner lives
    kill(process)
    OutputFolder(tmp_path)
    assert names(tmp_path) == []


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
        folder.write_bytes("big.bin", letter * 1_000_000)
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
    output.write_text("report.json", "{}")
    output.remove("report.json")
    output.remove("report.json")
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "folder").mkdir()
    with pytest.raises(ConfigError, match="cannot remove this file"):
        output.remove("folder")
