"""How the benchmarks measure time: the best of some rounds, and commands that must succeed."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from gaia_uwb.episode import Episode
from gaia_uwb.simulate import find_preset, simulate_episodes


def stress_windows(n: int) -> list[Episode]:
    """Return windows of 64 steps and 12 anchors."""
    config = find_preset("stress").model_copy(update={"vary": {"closure.n_anchors": [12, 12]}})
    return list(simulate_episodes(config, n, seed=0))


def per_second(job: Callable[[], object], n: int, rounds: int) -> float:
    """Return how many of n things a job does in a second, the best of some rounds."""
    best = float("inf")
    for _ in range(rounds):
        start = time.perf_counter()
        job()
        best = min(best, time.perf_counter() - start)
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
