"""Kill commands that write files, at random moments: every file must be whole.

Usage: nice python tests/endurance/killed_commands.py [--n 100]

The commands are ``gaia reconstruct``, ``gaia wzdx write``, ``gaia simulate`` and, where
GAIA_DATA_DIR names a folder with the outdoor data set to fetch from, ``gaia data fetch``. Each run
goes into a folder with the results of another run, and is killed (SIGKILL) at a random moment of
its whole time or, mostly, of its writing. Whatever lies under a final name must then be the old
file or the new one, byte for byte. Every tenth time the command runs again over what was left: all
files must be the new ones, and no temporary file may stay.
"""

from __future__ import annotations

import argparse
import os
import shutil
import sys
import tempfile
from importlib import import_module
from pathlib import Path
from typing import Any


def commands(folder: Path) -> dict[str, tuple[Any, list[object]]]:
    """Return command -> (its arguments for an output folder, those of the run before it)."""
    config = folder / "feed.yaml"
    config.write_text(import_module("wzdx_cases").FEED_YAML, encoding="utf-8")
    date = ["--update-date", "2026-11-22T10:00:00Z"]
    feed = ["wzdx", "write", folder / "results", "--config", config]
    log = ["reconstruct", "sim:lane-closure/3"]
    passes = ["simulate", "--preset", "straight", "--episodes", "10", "--format", "csv"]
    return {
        "reconstruct": (
            lambda out: [*log, "--out", out],
            [*log, "--denoiser", "raw", "--out", folder / "old-reconstruct"],
        ),
        "wzdx write": (
            lambda out: [*feed, *date, "--out", out],
            [*feed, "--update-date", "2026-11-22T09:30:00Z", "--out", folder / "old-wzdx write"],
        ),
        "simulate": (
            lambda out: [*passes, "--seed", "1", "--out", out],
            [*passes, "--out", folder / "old-simulate"],
        ),
        **_fetch(folder),
    }


def _fetch(folder: Path) -> dict[str, tuple[Any, list[object]]]:
    """Return the command that completes a data set of which some files are there."""
    mirror = Path(os.environ.get("GAIA_DATA_DIR", "")) / "outdoor-uwb"
    if not mirror.is_dir():
        return {}
    there = Path("Dynamic_measurements") / "LOS"
    shutil.copytree(mirror / there, folder / "part" / there)
    fetch = ["data", "fetch", "outdoor-uwb", "--base-url"]
    return {
        "data fetch": (
            lambda out: [*fetch, mirror, "--data-dir", out],
            [*fetch, folder / "part", "--data-dir", folder / "old-data fetch"],
        )
    }


def main() -> None:
    """Kill each command and print how often at which stage."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--n", type=int, default=100)
    n = parser.parse_args().n
    sys.path.insert(0, str(Path(__file__).parents[1] / "helpers"))
    helper = import_module("killed_runs")
    import numpy as np

    rng = np.random.default_rng(20261122)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        helper.gaia(["reconstruct", "sim:lane-closure/3", "--out", folder / "results"]).wait()
        for command, (arguments_for, before) in commands(folder).items():
            helper.gaia(before).wait()
            place = folder / command
            place.mkdir()
            runs = helper.KilledRuns(arguments_for, folder / f"old-{command}", place)
            for k in range(n):
                runs.kill_once(rng)
                if k % 10 == 9:
                    runs.check_the_next_run()
            print(
                f"{command:12} killed {n} times: {runs.n_before_writing} before a file changed, "
                f"{n - runs.n_before_writing - runs.n_done} while writing, {runs.n_done} killed "
                f"too late; {runs.n_litter} left a temporary file; no half-written file, "
                f"{n // 10} later runs whole and tidy"
            )


if __name__ == "__main__":
    main()
