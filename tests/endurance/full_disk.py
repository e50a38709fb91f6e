"""Let the disk be full at every write: nothing half-written, nothing lost, one line, exit code 2.

Usage: sudo nice python tests/endurance/full_disk.py [--step-kb 16]

Each command runs on a file system of its own in memory that has room for so many kilobytes and
then is full: at first for none, then for one step more each time, until the command completes. It
runs into an empty folder and over the results of another run. Each file must then be whole: the
old one or the new one. Only root may mount; without that right nothing is tried, and it says so.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path


@contextmanager
def small_disk(place: Path) -> Iterator[Callable[[int], None]]:
    """Mount a file system and yield what leaves it so many free kilobytes."""
    place.mkdir(exist_ok=True)
    subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64m", "tmpfs", place], check=True)

    def leave(free_kb: int) -> None:
        used_kb = shutil.disk_usage(place).used // 1024
        size = f"remount,size={used_kb + free_kb}k"
        subprocess.run(["mount", "-o", size, place], check=True)

    try:
        yield leave
    finally:
        subprocess.run(["umount", place], check=True)


def try_command(name: str, now, before, folder: Path, step_kb: int) -> str:  # type: ignore[no-untyped-def]
    """Try one command at every size and return its row."""
    helper = import_module("killed_runs")
    whole, old = folder / f"whole {name}", folder / f"old {name}"
    assert helper.gaia(now(whole)).wait() in (0, 1)
    assert helper.gaia(before(old)).wait() in (0, 1)
    new_files, old_files = helper.files_of(whole), helper.files_of(old)
    assert new_files.keys() == old_files.keys()
    n = n_stopped = n_half = n_lost = 0
    for over_old in (False, True):
        free_kb = 0
        while True:
            with small_disk(folder / "disk") as leave:
                out = folder / "disk" / "out"
                if over_old:
                    shutil.copytree(old, out)
                leave(free_kb)
                process = helper.gaia(now(out), stderr=subprocess.PIPE)
                _, error = process.communicate()
                left = helper.files_of(out)
                what = f"{name}, {free_kb} kB free, over old results: {over_old}"
                for path, content in left.items():
                    if path in {"zones.csv", "failures.csv"}:  # they say which zones failed
                        n_half += not content.endswith(b"\n")
                    else:
                        n_half += content not in (old_files[path], new_files[path])
                if over_old:
                    n_lost += sum(not _last(path) for path in old_files.keys() - left.keys())
                assert not helper.hidden_in(out), f"{what}: litter"
            n += 1
            if process.returncode in (0, 1) and left == new_files:
                break
            lines = error.decode().splitlines()
            told = [*lines, (left.get("failures.csv") or b"").decode()]
            assert process.returncode in (1, 2), f"{what}: code {process.returncode}: {lines}"
            assert not any("Traceback" in line for line in lines), f"{what}: {lines}"
            assert any("No space left" in line for line in told), f"{what}: {lines}"
            n_stopped += 1
            free_kb += step_kb
    return f"| `{name}` | {n} | {n_stopped} | {n_half} | {n_lost} |"


def _last(path: str) -> bool:
    """Tell whether a file is removed before the others are replaced, and written after them."""
    return Path(path).name in {"report.json", "fleet.json", "plot.svg", "boundary.gpkg"} or (
        Path(path).stem in {"trajectory", "ranges", "anchors", "scene"}  # a simulated log
    )


def main() -> None:
    """Try every command and print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--step-kb", type=int, default=16)
    step_kb = parser.parse_args().step_kb
    sys.path.insert(0, str(Path(__file__).parents[1] / "helpers"))
    helper, outputs = import_module("killed_runs"), import_module("output_commands")
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        try:
            with small_disk(folder / "disk"):
                pass
        except (OSError, subprocess.CalledProcessError) as error:
            sys.exit(f"nothing was tried: a file system cannot be mounted here ({error})")
        results = folder / "results"
        helper.gaia(["reconstruct", "sim:lane-closure/3", "--out", results]).wait()
        print("| command | runs | stopped by a full disk | half files | lost files |")
        print("|---|---|---|---|---|")
        for name, command in outputs.output_commands(folder, results).items():
            print(try_command(name, command.now, command.before, folder, step_kb), flush=True)


if __name__ == "__main__":
    main()
