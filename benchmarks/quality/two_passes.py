"""What a second lane adds: sides, errors and coverage of one pass and of two fused passes.

    python benchmarks/quality/two_passes.py [--zones 100] [--presets straight lane-closure]

Coverage and error refer to the better of the two positions, so that a wrong side counts only as a
wrong side. The sides are those that the ranges alone prefer, before the joint decision.
"""

from __future__ import annotations

import argparse

import numpy as np

from _tally import Tally
from gaia_uwb.config import PipelineConfig
from gaia_uwb.locate import Hypotheses, find_places, fuse
from gaia_uwb.pipeline import prepare
from gaia_uwb.simulate import PRESETS, simulate_zone

CONFIG = PipelineConfig()


def add(tally: Tally, found: Hypotheses, true_m: np.ndarray) -> None:
    """Count one zone's anchors that both have places."""
    for n in np.flatnonzero(np.isfinite(found.position_m).all(axis=(1, 2))):
        tally.add(found.position_m[n], found.covariance_m2[n], true_m[n])


def row(tally: Tally) -> str:
    """Return the counts in words."""
    return (
        f"{len(tally):5d} anchors  right side {np.mean(tally.right):.3f}  "
        f"median error {np.median(tally.nearer_m):.3f} m  90 % ellipses cover "
        f"{np.mean(tally.covered):.3f}"
    )


def main() -> None:
    """Print a line per preset and way."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--zones", type=int, default=100)
    parser.add_argument("--presets", nargs="+", default=["straight", "lane-closure"])
    arguments = parser.parse_args()
    for preset in arguments.presets:
        one, two, moved = Tally(), Tally(), 0
        for seed in range(arguments.zones):
            scenes = simulate_zone(PRESETS[preset], seed)
            passes = [prepare(scene.without_truth(), CONFIG) for scene in scenes]
            alone, fused = find_places([passes[:1]], CONFIG)[0], fuse(passes, CONFIG)
            truth = scenes[0].truth
            if truth is not None:
                add(one, alone.hypotheses, truth.anchor_m)
                add(two, fused.hypotheses, truth.anchor_m)
            moved += len(fused.disagreements)
        print(f"{preset}: one pass  {row(one)}")
        print(f"{preset}: two lanes {row(two)}; {moved} wrongly called moved")


if __name__ == "__main__":
    main()
