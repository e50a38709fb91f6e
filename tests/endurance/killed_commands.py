"""Kill commands that write files, at random moments: every file must be whole.

Usage: nice python tests/endurance/killed_commands.py [--n 100]

The commands are those of ``tests/helpers/output_commands.py`` and, where GAIA_DATA_DIR names a
folder with the outdoor data set to fetch from, ``gaia data fetch``. Each run
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


def fetching(folder: Path) -> dict[str, Any]:
    """Return the command that completes a data set of which some files are there."""
    mirror = Path(os.environ.get("GAIA_DATA_DIR", "")) / "outdoor-uwb"
    if not mirror.is_dir():
        return {}
    there = Path("Dynamic_measurements") / "LOS"
    shutil.copytree(mirror / there, folder / "part" / there)
    fetch = ["data", "fetch", "outdoor-uwb", "--base-url"]
    command = import_module("output_commands").OutputCommand(
        lambda out: [*fetch, mirror, "--data-dir", out],
        lambda out: [*fetch, folder / "part", "--data-dir", out],
    )
    return {"data fetch": command}


def main() -> None:
    """Kill each command and print how often at which stage."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--n", type=int, default=100)
    n = parser.parse_args().n
    sys.path.insert(0, str(Path(__file__).parents[1] / "helpers"))
    helper = import_module("killed_runs")
    import numpy as np

    rng = np.random.default_rng(20261122)
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        helper.gaia(["reconstruct", "sim:lane-closure/3", "--out", folder / "results"]).wait()
        outputs = import_module("output_commands")
        commands = outputs.output_commands(folder, folder / "results") | fetching(folder)
        print("| command | killed | before a file changed | while writing | too late | ", end="")
        print("left a temporary file | later runs, whole and tidy |")
        print("|---|---|---|---|---|---|---|")
        for name, command in commands.items():
            place, old = folder / name, folder / f"old {name}"
            place.mkdir()
            helper.gaia(command.before(old)).wait()
            runs = helper.KilledRuns(command.now, old, place)
            n_later = 0
            for k in range(n):
                runs.kill_once(rng)  # a half-written file stops the script
                if k % 10 == 9:
                    runs.check_the_next_run()
                    n_later += 1
            writing = n - runs.n_before_writing - runs.n_done
            print(
                f"| `{name}` | {n} | {runs.n_before_writing} | {writing} | {runs.n_done} "
                f"| {runs.n_litter} | {n_later} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
