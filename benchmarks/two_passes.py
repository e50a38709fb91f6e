"""What a second lane gives: sides, errors and coverage of one pass and of two, fused.

    python benchmarks/two_passes.py [--zones 100] [--presets straight lane-closure]

Coverage and error are those of the better of the two places, so that a wrong side counts as a wrong
side only. The sides are those that the ranges alone prefer, before the anchors decide jointly.
"""

from __future__ import annotations

import argparse

import numpy as np

from gaia_uwb.config import PipelineConfig
from gaia_uwb.denoisers import make_denoiser
from gaia_uwb.fusion import fuse
from gaia_uwb.joint_fit import LocatedPass
from gaia_uwb.locate import Hypotheses, locate
from gaia_uwb.pipeline import prepare
from gaia_uwb.scene import Scene
from gaia_uwb.simulate import PRESETS, simulate_zone

CHI_SQUARE_90 = -2.0 * np.log(0.1)
CONFIG = PipelineConfig(denoiser="raw")  # measured ranges are what passes are fused from by default


def located(scene: Scene) -> LocatedPass:
    """Prepare and locate one pass."""
    episode = prepare(scene.without_truth(), CONFIG)
    (ranges,) = make_denoiser(CONFIG.denoiser)([episode])
    (hypotheses,) = locate([episode], [ranges], CONFIG.solver)
    return LocatedPass(episode, ranges, hypotheses)


class Tally:
    """Counts of one way to locate anchors."""

    def __init__(self) -> None:
        self.right, self.error_m, self.covered = [], [], []  # type: ignore[var-annotated]

    def add(self, found: Hypotheses, true_m: np.ndarray) -> None:
        """Count one zone's anchors."""
        off_m = found.position_m - true_m[:, None]
        distance_m = np.hypot(off_m[..., 0], off_m[..., 1])
        heard = np.isfinite(distance_m).all(axis=1)
        for n in np.flatnonzero(heard):
            nearer = int(distance_m[n].argmin())
            self.right.append(distance_m[n, 0] <= distance_m[n, nearer] + 1e-9)
            self.error_m.append(distance_m[n, nearer])
            off, covariance = off_m[n, nearer], (found.covariance_m2[:, nearer] * found.factor())[n]
            self.covered.append(off @ np.linalg.solve(covariance, off) < CHI_SQUARE_90)

    def row(self) -> str:
        """Return the counts in words."""
        return (
            f"{len(self.right):5d} anchors  right side {np.mean(self.right):.3f}  "
            f"median error {np.median(self.error_m):.3f} m  90 % ellipses cover "
            f"{np.mean(self.covered):.3f}"
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
            passes = [located(scene) for scene in scenes]
            fused = fuse(passes, CONFIG)
            truth = scenes[0].truth
            if truth is not None:
                one.add(passes[0].hypotheses, truth.anchor_m)
                two.add(fused.hypotheses, truth.anchor_m)
            moved += len(fused.disagreements)
        print(f"{preset}: one pass  {one.row()}")
        print(f"{preset}: two lanes {two.row()}; {moved} falsely called moved")


if __name__ == "__main__":
    main()
