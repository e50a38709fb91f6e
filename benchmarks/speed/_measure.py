"""How the benchmarks measure time, and what they share: rounds, commands, options, a JSON file."""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from pathlib import Path
from types import ModuleType

from gaia_uwb.episode import Episode
from gaia_uwb.simulate import find_preset, simulate_episodes

ROOT = Path(__file__).parents[2]


def make_parser(description: str | None, script: str) -> argparse.ArgumentParser:
    """Return a parser of what every script knows: where its JSON file goes."""
    out = ROOT / "benchmarks" / "out" / f"{Path(script).stem}.json"
    parser = argparse.ArgumentParser(
        description=description, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--out", type=Path, default=out, metavar="FILE", help=f"{out.relative_to(ROOT)} by default"
    )
    return parser


def write_json(rows: object, out: Path) -> None:
    """Write what was measured."""
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(json.dumps(rows, indent=2) + "\n", encoding="utf-8")


def run_parts(
    parser: argparse.ArgumentParser, parts: Mapping[str, Callable[[argparse.Namespace], object]]
) -> None:
    """Run the parts of a script that are asked for, and write what each has measured."""
    parser.add_argument("--part", action="append", choices=tuple(parts), help="all by default")
    given = parser.parse_args()
    write_json({name: parts[name](given) for name in given.part or parts}, given.out)


def tests_module(name: str) -> ModuleType:
    """Return a module of ``tests/helpers``, such as ``bags``."""
    sys.path.insert(0, str(ROOT / "tests" / "helpers"))
    return import_module(name)


def stress_windows(n: int) -> list[Episode]:
    """Return windows of 64 steps and 12 anchors."""
    config = find_preset("stress").model_copy(update={"vary": {"closure.n_anchors": [12, 12]}})
    return list(simulate_episodes(config, n, seed=0))


def per_second(
    job: Callable[[], object],
    n: int,
    rounds: int,
    clock: Callable[[], float] = time.perf_counter,
) -> float:
    """Return how many of n things a job does in a second, the best of some rounds."""
    best = float("inf")
    for _ in range(rounds):
        start = clock()
        job()
        best = min(best, clock() - start)
    return n / best


def command_seconds(arguments: Sequence[str], rounds: int) -> list[float]:
    """Return how long ``gaia`` takes from the shell, round by round; a first, cold one is left out.

    Exit code 1 is a result to be checked, and as good here as 0.
    """
    gaia = str(Path(sys.executable).with_name("gaia"))
    seconds = []
    for _ in range(rounds + 1):
        start = time.perf_counter()
        done = subprocess.run([gaia, *arguments], capture_output=True, text=True, check=False)
        seconds.append(time.perf_counter() - start)
        if done.returncode not in (0, 1):
            raise SystemExit(f"gaia {' '.join(arguments)}: {done.stderr.strip()}")
    return seconds[1:]
