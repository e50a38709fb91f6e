"""Work zones of a kilometre, passed once: how many cones with status ok are on the wrong side.

Run ``python benchmarks/quality/long_zones.py``; it takes a minute. The roads are nearly straight,
with all cones on one side and no lane change, so only the relative positions of the cones determine
the side. ``expected`` is the sum of the reported mirror probabilities.
"""

from __future__ import annotations

import argparse

import numpy as np

from _tally import Tally, table_head, table_row
from gaia_uwb import PipelineConfig, reconstruct
from gaia_uwb.estimate import AnchorStatus
from gaia_uwb.simulate import PRESETS, PassConfig, simulate_pass

SPEED_MPS = 15.0
COLUMNS = (
    "work space (m)", "denoiser", "cones", "ok", "of these wrong", "expected", "error (m)",
)  # fmt: skip


def long_zone(work_m: float, n_anchors: int) -> PassConfig:
    """Return the pass of a lane closure with a long work space."""
    preset = PRESETS["lane-closure"]
    closure = {"work_m": work_m, "n_anchors": n_anchors}
    drive = {"lane_change": False, "speed_mps": SPEED_MPS, "duration_s": 40.0 + work_m / SPEED_MPS}
    return preset.model_copy(
        update={
            "closure": preset.closure.model_copy(update=closure),
            "road": preset.road.model_copy(update={"curvature_per_m": -0.0002}),
            "drive": preset.drive.model_copy(update=drive),
        }
    )


def main() -> None:
    """Reconstruct and count."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--passes", type=int, default=20)
    given = parser.parse_args()
    print(table_head(COLUMNS))
    for work_m in (300.0, 900.0):
        for denoiser in ("gaia-set", "pose-kalman"):
            n, expected, ok = 0, 0.0, Tally()
            for seed in range(given.passes):
                scene = simulate_pass(long_zone(work_m, 24), seed)
                assert scene.truth is not None
                found = reconstruct(scene, PipelineConfig(denoiser=denoiser)).anchors
                n += len(found)
                for fix, true_m in zip(found, scene.truth.anchor_m, strict=True):
                    if fix.status is AnchorStatus.OK:
                        expected += fix.mirror_probability
                        ok.add(
                            np.stack([fix.position_m, fix.mirror_position_m]),
                            np.stack([fix.covariance_m2, fix.mirror_covariance_m2]),
                            true_m,
                        )
            counts = n, len(ok), int((~ok.right).sum()), f"{expected:.1f}"
            error_m = np.median(ok.error_m[:, 0])
            row = table_row([f"{work_m:.0f}", f"`{denoiser}`", *counts, f"{error_m:.2f}"])
            print(row, flush=True)


if __name__ == "__main__":
    main()
