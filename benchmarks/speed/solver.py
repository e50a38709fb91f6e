"""The solver in one thread: beside SciPy's on the same problems, and as anchors and steps grow.

Beside SciPy, whose costs are compared, too: it gets plain squares, MINPACK's Levenberg-Marquardt
and one start that knows the true side, beside the middle of the path, as far as the shortest range.
Ours starts from nothing, refines both mirror hypotheses and sums up their covariances.

As it grows: time and memory. Both are linear in anchors; of one anchor's readings in one drive
``find_places`` takes a fixed number at most. Each case runs in a process of its own: an episode
made directly, then ``calibrate`` and ``find_places``.

    python benchmarks/speed/solver.py [--part scipy] [--part growth]
"""

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"  # before numpy is loaded

import argparse
import multiprocessing
import resource
import time
from functools import partial
from typing import Any

import numpy as np

from _measure import make_parser, per_second, run_parts
from gaia_uwb.alignment import calibrate
from gaia_uwb.episode import Episode
from gaia_uwb.locate import find_places
from gaia_uwb.solver import SolverOptions, solve

STEPS = 64
ANCHORS = 20
SIGMA_M = 0.1


def make_problems(
    episodes: int, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return paths (B, T, 2), ranges (B, N, T) and true places (B, N, 2) of passes with a bend.

    Each pass takes 6.4 s at 5 to 25 m/s with a change of lane, past cones 2 to 10 m beside it.
    """
    s = np.linspace(0.0, 1.0, STEPS)
    length_m = 6.4 * rng.uniform(5.0, 25.0, episodes)
    lane_m = rng.uniform(-3.5, 3.5, episodes)
    north = lane_m[:, None] / (1.0 + np.exp(-12.0 * (s - 0.5)))
    path = np.stack([length_m[:, None] * s, north], axis=-1)
    shape = (episodes, ANCHORS)
    along = rng.uniform(0.0, 1.0, shape) * length_m[:, None]
    across = rng.choice([-1.0, 1.0], shape) * rng.uniform(2.0, 10.0, shape)
    anchors = np.stack([along, across], axis=-1)
    true_m = np.linalg.norm(anchors[:, :, None] - path[:, None], axis=-1)
    return path, true_m + SIGMA_M * rng.standard_normal(true_m.shape), anchors


def solve_with_scipy(
    path: np.ndarray, ranges: np.ndarray, starts: np.ndarray, *, analytic: bool
) -> np.ndarray:
    """Return SciPy's cost of every problem."""
    from scipy.optimize import least_squares  # not in the processes whose memory is measured

    costs = np.empty(starts.shape[:2])
    for b, n in np.ndindex(costs.shape):
        points, measured = path[b], ranges[b, n]

        def residuals(
            x: np.ndarray, p: np.ndarray = points, d: np.ndarray = measured
        ) -> np.ndarray:
            off = x - p
            return np.asarray(np.sqrt((off * off).sum(axis=1)) - d)

        def jacobian(x: np.ndarray, p: np.ndarray = points, d: np.ndarray = measured) -> np.ndarray:
            off = x - p
            return np.asarray(off / np.sqrt((off * off).sum(axis=1))[:, None])

        found = least_squares(
            residuals, starts[b, n], method="lm", jac=jacobian if analytic else "2-point"
        )
        costs[b, n] = 2.0 * found.cost
    return costs


def cost_excess(path: np.ndarray, ranges: np.ndarray, costs: np.ndarray) -> float:
    """Return the largest relative excess of our better hypothesis's cost over SciPy's cost."""
    found = solve(path, ranges, SIGMA_M, options=SolverOptions(dof=0.0))
    off = found.position_m[:, :, :, None] - path[:, None, None]
    ours = ((np.linalg.norm(off, axis=-1) - ranges[:, :, None]) ** 2).sum(axis=-1).min(axis=-1)
    return float((ours / costs - 1.0).max())


def beside_scipy(_: argparse.Namespace) -> dict[str, Any]:
    """Print and return problems per second of processor time, and how the costs compare."""
    rng = np.random.default_rng(0)
    path, ranges, anchors = make_problems(500, rng)
    few = slice(0, 40)
    starts = path[few, STEPS // 2, None] + np.zeros_like(anchors[few])
    starts[..., 1] += np.sign(anchors[few, :, 1]) * ranges[few].min(axis=-1)
    count = starts.shape[0] * starts.shape[1]
    costs = solve_with_scipy(path[few], ranges[few], starts, analytic=True)
    gaussian, robust = SolverOptions(dof=0.0), SolverOptions()
    rate = partial(per_second, clock=time.process_time)
    rates = {
        "scipy lm, analytic Jacobian": rate(
            lambda: solve_with_scipy(path[few], ranges[few], starts, analytic=True), count, 5
        ),
        "scipy lm, 2-point Jacobian": rate(
            lambda: solve_with_scipy(path[few], ranges[few], starts, analytic=False), count, 3
        ),
        "gaia gaussian, both sides": rate(
            lambda: solve(path, ranges, SIGMA_M, options=gaussian), anchors[..., 0].size, 30
        ),
        "gaia robust, both sides": rate(
            lambda: solve(path, ranges, SIGMA_M, options=robust), anchors[..., 0].size, 30
        ),
    }
    scipy_rate = max(value for name, value in rates.items() if name.startswith("scipy"))
    excess = cost_excess(path[few], ranges[few], costs)
    print(f"{STEPS} ranges a problem, one thread\n{'solver':<30}{'problems/s':>12}{'ratio':>8}")
    for name, value in rates.items():
        print(f"{name:<30}{value:>12,.0f}{value / scipy_rate:>8.1f}")
    print(f"largest excess of our cost over SciPy's: {excess:.1e} of it")
    return {"problems_per_s": rates, "largest_cost_excess": excess, "steps": STEPS}


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
    find_places([[episode]])
    located = time.perf_counter()
    peak_kib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return {
        "anchors": anchors,
        "steps": steps,
        "calibrate_s": calibrated - start,
        "locate_s": located - calibrated,
        "peak_gib": peak_kib / 2**20,
    }


def growth(given: argparse.Namespace) -> list[dict[str, float]]:
    """Print and return times and memory of all cases."""
    steps, rows = given.steps, []
    cases = [(n, steps) for n in (250, 500, 1000)] + [(1000, steps // k) for k in (4, 2)]
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
    return rows


if __name__ == "__main__":
    parser = make_parser(__doc__, __file__)
    parser.add_argument("--steps", type=int, default=36_000, help="at 10 Hz, the most")
    run_parts(parser, {"scipy": beside_scipy, "growth": growth})
