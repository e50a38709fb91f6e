"""Show that locating grows linearly in anchors and steps, and how much memory it takes.

Each case runs in a process of its own: an episode made directly, ranges with sigmas as the ``raw``
denoiser gives them, then ``calibrate`` and ``locate``.

Run ``python benchmarks/solver_scaling.py``; a table is printed and kept in ``benchmarks/out/``.
"""

from __future__ import annotations

import json
import multiprocessing
import resource
import time
from pathlib import Path

import numpy as np

from gaia_uwb.calibration import calibrate
from gaia_uwb.denoised import DenoisedRanges
from gaia_uwb.episode import Episode
from gaia_uwb.locate import locate

OUT = Path(__file__).parent / "out"
SIGMA_M = 0.1


def make_episode(anchors: int, steps: int) -> Episode:
    """Return an hour's drive at 10 Hz, back and forth past a long work zone."""
    rng = np.random.default_rng(0)
    t_s = 0.1 * np.arange(steps)
    path = np.stack([1500.0 * np.sin(0.005 * t_s), 3.0 * np.sin(0.05 * t_s)], axis=1)
    range_m = np.empty((steps, anchors))
    for n in range(anchors):
        place = np.array([rng.uniform(-1500.0, 1500.0), rng.uniform(4.0, 12.0)])
        range_m[:, n] = np.linalg.norm(path - place, axis=1)
        range_m[:, n] += SIGMA_M * rng.standard_normal(steps)
    ids = tuple(f"cone-{n}" for n in range(anchors))
    return Episode("zone", ids, t_s, path, range_m, np.ones(range_m.shape, dtype=bool))


def run_case(anchors: int, steps: int) -> dict[str, float]:
    """Return wall times in seconds and the peak of resident memory in GiB."""
    episode = make_episode(anchors, steps)
    start = time.perf_counter()
    episode = calibrate(episode)
    calibrated = time.perf_counter()
    sigma_m = np.full(episode.range_m.shape, SIGMA_M)
    locate([episode], [DenoisedRanges(episode.range_m, sigma_m, episode.valid)])
    located = time.perf_counter()
    peak_kib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return {
        "anchors": anchors,
        "steps": steps,
        "calibrate_s": calibrated - start,
        "locate_s": located - calibrated,
        "peak_gib": peak_kib / 2**20,
    }


def main() -> None:
    """Run all cases."""
    cases = [(n, 36_000) for n in (250, 500, 1000)] + [(1000, t) for t in (9_000, 18_000)]
    rows = []
    print(f"{'anchors':>8}{'steps':>8}{'calibrate s':>13}{'locate s':>10}{'peak GiB':>10}")
    context = multiprocessing.get_context("spawn")  # so that each has its own peak
    for case in cases:
        with context.Pool(1) as pool:
            row = pool.apply(run_case, case)
        rows.append(row)
        print(
            f"{row['anchors']:>8}{row['steps']:>8}{row['calibrate_s']:>13.2f}"
            f"{row['locate_s']:>10.2f}{row['peak_gib']:>10.2f}",
            flush=True,
        )
    OUT.mkdir(exist_ok=True)
    (OUT / "solver_scaling.json").write_text(json.dumps(rows, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
