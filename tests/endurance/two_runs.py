"""Let two runs write into one folder at once: in each folder all files are of one of them.

Usage: nice python tests/endurance/two_runs.py [--n 20]

The two run the same command on different inputs, and begin within a second of each other.
"""

from __future__ import annotations

import argparse
import shutil
import sys
import tempfile
import time
from importlib import import_module
from pathlib import Path


def _in(place: str, files: dict[str, bytes]) -> dict[str, bytes]:
    return {path: content for path, content in files.items() if str(Path(path).parent) == place}


def main() -> None:
    """Try every command so many times and print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--n", type=int, default=20)
    n = parser.parse_args().n
    sys.path.insert(0, str(Path(__file__).parents[1] / "helpers"))
    helper, outputs = import_module("killed_runs"), import_module("output_commands")
    import numpy as np

    rng = np.random.default_rng(20261130)
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        results = folder / "results"
        helper.gaia(["reconstruct", "sim:lane-closure/3", "--out", results]).wait()
        print("| command | pairs of runs | with files of both in one folder | half files |")
        print("|---|---|---|---|")
        for name, command in outputs.output_commands(folder, results).items():
            wholes = []
            for k, call in enumerate((command.now, command.before)):
                whole = folder / f"{name} {k}"
                assert helper.gaia(call(whole)).wait() in (0, 1)
                wholes.append(helper.files_of(whole))
            n_mixed = n_half = 0
            for _ in range(n):
                out = folder / "out"
                shutil.rmtree(out, ignore_errors=True)
                first = helper.gaia(command.now(out))
                time.sleep(rng.uniform(0, 0.5))
                second = helper.gaia(command.before(out))
                assert first.wait() in (0, 1)
                assert second.wait() in (0, 1)
                left = helper.files_of(out)
                n_mixed += any(
                    not any(_in(place, left) == _in(place, whole) for whole in wholes)
                    for place in {str(Path(path).parent) for path in left}
                )
                n_half += any(
                    content not in [whole.get(path) for whole in wholes]
                    for path, content in left.items()
                )
                assert not helper.hidden_in(out)
            print(f"| `{name}` | {n} | {n_mixed} | {n_half} |", flush=True)


if __name__ == "__main__":
    main()
