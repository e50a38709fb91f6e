"""Short walks named like the outdoor data set's runs: four cases, with and without sight."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gaia_uwb.scene import Scene
from gaia_uwb.simulate import simulate_pass
from gaia_uwb.simulate.settings import ClosureConfig, DriveConfig, PassConfig, RangingConfig

CASES = ("A/1", "A/2", "B/3", "B/4")
WALK = PassConfig(
    closure=ClosureConfig(n_anchors=3, work_m=5.0, buffer_m=0.0),
    drive=DriveConfig(duration_s=40.0, speed_mps=1.0, lane_change=False),
    ranging=RangingConfig(
        bias_m=0.1, own_drift_sigma_m=0.08, los_s=None, burst_per_s=0.05, burst_negative_share=1.0
    ),
)


def make_runs(cases: tuple[str, ...] = CASES) -> list[Scene]:
    runs = []
    for k, case in enumerate(cases):
        for sight in ("LOS", "NLOS"):
            run = simulate_pass(WALK, seed=20, episode=2 * k + (sight == "NLOS"))
            nlos = np.full(len(run.ranges), sight == "NLOS")
            truth = replace(run.truth, nlos=nlos)
            runs.append(replace(run, name=f"walks:{sight}/{case}", truth=truth))
    return runs
