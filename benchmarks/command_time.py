"""Wall time of the commands from the shell, as a user waits for them: best and median of five runs.

Usage: python benchmarks/command_time.py [--data-dir FOLDER]   (or GAIA_DATA_DIR)
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import tempfile
from pathlib import Path

from timing import command_seconds

RUNS = 5
REAL = "outdoor-uwb:NLOS/B/4"


def main() -> None:
    """Time the commands and write the result to benchmarks/out/."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data-dir", type=Path, default=os.environ.get("GAIA_DATA_DIR"))
    data_dir = parser.parse_args().data_dir
    rows = {}
    with tempfile.TemporaryDirectory() as out:
        commands = {
            "gaia --help": (["--help"], 0.4),
            "gaia reconstruct sim": (["reconstruct", "sim", "--out", out], 2.0),
        }
        if data_dir and (Path(data_dir) / "outdoor-uwb").is_dir():
            real = ["reconstruct", REAL, "--data-dir", str(data_dir), "--out", out]
            commands[f"gaia reconstruct {REAL}"] = (real, 2.0)
        else:
            print(f"left out, no outdoor UWB data set (set GAIA_DATA_DIR): gaia reconstruct {REAL}")
        for name, (arguments, budget_s) in commands.items():
            seconds = command_seconds(arguments, RUNS)
            rows[name] = {
                "best_s": min(seconds),
                "median_s": statistics.median(seconds),
                "budget_s": budget_s,
            }
            print(
                f"{name:45} best {min(seconds):.2f} s, median {statistics.median(seconds):.2f} s"
                f" (budget {budget_s} s)"
            )
    folder = Path(__file__).with_name("out")
    folder.mkdir(exist_ok=True)
    (folder / "command_time.json").write_text(json.dumps(rows, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
