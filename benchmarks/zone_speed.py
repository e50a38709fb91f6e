"""How fast gaia-set reconstructs: windows of 64 steps x 12 anchors, and a whole run from the shell.

Side by side in one run with pose-kalman, denoising alone and with places, sides and boundary. Run
it on a quiet machine.
"""

from __future__ import annotations

import argparse
import tempfile
from functools import partial
from pathlib import Path
from statistics import median

from gaia_uwb.config import PipelineConfig
from gaia_uwb.denoisers import make_denoiser
from gaia_uwb.pipeline import reconstruct_episodes
from timing import command_seconds, per_second, stress_windows


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--windows", type=int, default=512)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--source", default="outdoor-uwb:NLOS/B/4", help="a run of some minutes")
    given = parser.parse_args()
    episodes = stress_windows(given.windows)
    for name in ("pose-kalman", "gaia-set"):
        denoiser, settings = make_denoiser(name), PipelineConfig(denoiser=name)
        alone = per_second(partial(denoiser, episodes), given.windows, given.rounds)
        job = partial(reconstruct_episodes, episodes, settings)
        whole = per_second(job, given.windows, given.rounds)
        print(f"{name}: {alone:,.0f} windows/s denoised, {whole:,.0f} with places and sides")
        with tempfile.TemporaryDirectory() as place:
            command = ["reconstruct", given.source, "--denoiser", name]
            command += ["--out", str(Path(place) / "out")]
            seconds = median(command_seconds(command, given.rounds))
        print(f"  gaia reconstruct {given.source}: {seconds:.2f} s (median)")


if __name__ == "__main__":
    main()
