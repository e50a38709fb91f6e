"""Wall time of the commands from the shell, as a user waits for them: best and median of five runs.

    python benchmarks/speed/command_time.py [--data-dir FOLDER]   (or GAIA_DATA_DIR)

``--rounds`` sets how many runs.
"""

from __future__ import annotations

import os
import statistics
import tempfile
from pathlib import Path

from _measure import command_seconds, make_parser, write_json

REAL = "outdoor-uwb:NLOS/B/4"


def main() -> None:
    """Time the commands."""
    parser = make_parser(__doc__, __file__)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--data-dir", type=Path, default=os.environ.get("GAIA_DATA_DIR"))
    given = parser.parse_args()
    data_dir = given.data_dir
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
            seconds = command_seconds(arguments, given.rounds)
            rows[name] = {
                "best_s": min(seconds),
                "median_s": statistics.median(seconds),
                "budget_s": budget_s,
            }
            print(
                f"{name:45} best {min(seconds):.2f} s, median {statistics.median(seconds):.2f} s"
                f" (budget {budget_s} s)"
            )
    write_json(rows, given.out)


if __name__ == "__main__":
    main()
