"""Measure where the ``stress`` preset lies beside the paper's stress-test simulation (its table 2).

216 episodes of 64 steps, our denoisers, the paper's solver (``wls``) with the paper's true NLOS
labels. Run ``python benchmarks/stress_regime.py``; a table is printed and kept in
``benchmarks/out/``.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from gaia_uwb.config import PipelineConfig, SolverConfig
from gaia_uwb.evaluate import Test, score_method
from gaia_uwb.metrics import aggregate
from gaia_uwb.simulate import find_preset, simulate_episodes

OUT = Path(__file__).parent / "out"
EPISODES, SEED = 216, 0
METRICS = (
    "distance_mse_overall", "distance_mse_los", "distance_mse_nlos",
    "anchor_mae", "polygon_iou", "polygon_hausdorff",
)  # fmt: skip
PAPER_KALMAN = (3.9913, 1.4998, 4.6750, 32.3894, 0.2404, 62.5128)


def main() -> None:
    """Run the measurement."""
    episodes = tuple(simulate_episodes(find_preset("stress-test"), EPISODES, SEED))
    test = Test(episodes, tuple(episode.name for episode in episodes), 0)
    nlos = [episode.truth.nlos.ravel() for episode in episodes if episode.truth is not None]
    result: dict[str, dict[str, float]] = {}
    settings = PipelineConfig(solver=SolverConfig(kind="wls"))
    for method in ("raw", "kalman", "pose-kalman"):
        scores = score_method(test, method, settings, true_nlos_labels=True)
        means = aggregate(scores.per_episode, test.groups, seed=SEED)
        result[method] = {name: means[name].value for name in METRICS}
    result["kalman in the paper"] = dict(zip(METRICS, PAPER_KALMAN, strict=True))
    los = 1 - float(np.concatenate(nlos).mean())
    print(f"with line of sight: {100 * los:.1f} % of the ranges (the paper: 21.5 %)")
    print("".ljust(22) + "".join(name.rjust(22) for name in METRICS))
    for method, values in result.items():
        print(method.ljust(22) + "".join(f"{values[name]:22.3f}" for name in METRICS))
    OUT.mkdir(exist_ok=True)
    content = {"episodes": EPISODES, "los_share": los, "methods": result}
    (OUT / "stress_regime.json").write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
