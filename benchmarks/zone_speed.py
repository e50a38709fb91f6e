"""How fast gaia-set reconstructs: windows of 64 steps x 12 anchors, and a whole run from the shell.

Side by side in one run with the classical default, denoising alone and with the solver and the
decision on sides. Run it on a quiet machine.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

from gaia_uwb.config import PipelineConfig
from gaia_uwb.denoisers import make_denoiser
from gaia_uwb.pipeline import reconstruct_episodes
from gaia_uwb.simulate import find_preset, simulate_episodes


def per_second(job: Callable[[], object], n: int, rounds: int) -> float:
    """Return windows per second, the best of some rounds."""
    best = float("inf")
    for _ in range(rounds):
        start = time.perf_counter()
        job()
        best = min(best, time.perf_counter() - start)
    return n / best


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--windows", type=int, default=512)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--source", default="outdoor-uwb:NLOS/B/4", help="a run of some minutes")
    given = parser.parse_args()
    config = find_preset("stress").model_copy(update={"vary": {"closure.n_anchors": [12, 12]}})
    episodes = list(simulate_episodes(config, given.windows, seed=0))
    for name in ("pose-kalman", "gaia-set"):
        denoiser, settings = make_denoiser(name), PipelineConfig(denoiser=name)
        alone = per_second(partial(denoiser, episodes), given.windows, given.rounds)
        job = partial(reconstruct_episodes, episodes, settings)
        whole = per_second(job, given.windows, given.rounds)
        print(f"{name}: {alone:,.0f} windows/s denoised, {whole:,.0f} with places and sides")
        times = []
        for _ in range(given.rounds):
            with tempfile.TemporaryDirectory() as place:
                command = ["reconstruct", given.source, "--denoiser", name]
                command += ["--out", str(Path(place) / "out")]
                start = time.perf_counter()
                subprocess.run(
                    [sys.executable, "-m", "gaia_uwb", *command], capture_output=True, check=False
                )
                times.append(time.perf_counter() - start)
        print(f"  gaia reconstruct {given.source}: {sorted(times)[len(times) // 2]:.2f} s (median)")


if __name__ == "__main__":
    main()
