"""Compare the ``stress`` preset with the paper's stress-test simulation (its table 2).

216 episodes of 64 steps, our denoisers, the paper's solver (``wls``) with the paper's true NLOS
labels. Run ``python benchmarks/quality/stress_regime.py``; a table is printed and kept
in ``benchmarks/out/``.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np

from _tally import means, simulated
from gaia_uwb._shared import OutputFolder
from gaia_uwb.config import PipelineConfig, SolverConfig
from gaia_uwb.evaluate import score_method

OUT = Path(__file__).parents[1] / "out"
METRICS = (
    "distance_mse_overall", "distance_mse_los", "distance_mse_nlos",
    "anchor_mae", "polygon_iou", "polygon_hausdorff",
)  # fmt: skip
PAPER_KALMAN = (3.9913, 1.4998, 4.6750, 32.3894, 0.2404, 62.5128)


def main() -> None:
    """Run the measurement."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--episodes", type=int, default=216)
    n = parser.parse_args().episodes
    test = simulated("stress-test", n)
    nlos = [episode.truth.nlos.ravel() for episode in test.episodes if episode.truth is not None]
    result: dict[str, dict[str, float]] = {}
    settings = PipelineConfig(solver=SolverConfig(kind="wls"))
    for method in ("raw", "kalman", "pose-kalman"):
        scores = score_method(test, method, settings, true_nlos_labels=True)
        result[method] = means(scores.per_episode, test.groups, METRICS)
    result["kalman in the paper"] = dict(zip(METRICS, PAPER_KALMAN, strict=True))
    los = 1 - float(np.concatenate(nlos).mean())
    print(f"with line of sight: {100 * los:.1f} % of the ranges (paper: 21.5 %)")
    print("".ljust(22) + "".join(name.rjust(22) for name in METRICS))
    for method, values in result.items():
        print(method.ljust(22) + "".join(f"{values[name]:22.3f}" for name in METRICS))
    content = {"episodes": n, "los_share": los, "methods": result}
    OutputFolder(OUT).write("stress_regime.json", json.dumps(content, indent=2) + "\n")


if __name__ == "__main__":
    main()
