"""Time the solver beside SciPy's on the same problems, in one thread, and compare the costs found.

SciPy gets plain squares, MINPACK's Levenberg-Marquardt and one start that knows the true side:
beside the middle of the path, as far as the shortest range. Ours starts from nothing, refines both
mirror hypotheses and sums up their covariances.

Run ``python benchmarks/solver_speed.py``; a table is printed and kept in ``benchmarks/out/``.
"""

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"  # before numpy is loaded

import json
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

from gaia_uwb.multilateration import SolverOptions, solve

STEPS = 64
ANCHORS = 20
SIGMA_M = 0.1
OUT = Path(__file__).parent / "out"


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


def best_rate(work: Callable[[], object], problems: int, repeats: int) -> float:
    """Return problems per second of processor time in the best of some repeats."""
    times = []
    for _ in range(repeats):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return problems / min(times)


def cost_excess(path: np.ndarray, ranges: np.ndarray, costs: np.ndarray) -> float:
    """Return the largest relative excess of our better hypothesis's cost over SciPy's cost."""
    found = solve(path, ranges, SIGMA_M, options=SolverOptions(dof=0.0))
    off = found.position_m[:, :, :, None] - path[:, None, None]
    ours = ((np.linalg.norm(off, axis=-1) - ranges[:, :, None]) ** 2).sum(axis=-1).min(axis=-1)
    return float((ours / costs - 1.0).max())


def main() -> None:
    """Run the comparison."""
    rng = np.random.default_rng(0)
    path, ranges, anchors = make_problems(500, rng)
    few = slice(0, 40)
    starts = path[few, STEPS // 2, None] + np.zeros_like(anchors[few])
    starts[..., 1] += np.sign(anchors[few, :, 1]) * ranges[few].min(axis=-1)
    count = starts.shape[0] * starts.shape[1]
    costs = solve_with_scipy(path[few], ranges[few], starts, analytic=True)
    gaussian, robust = SolverOptions(dof=0.0), SolverOptions()
    rates = {
        "scipy lm, analytic Jacobian": best_rate(
            lambda: solve_with_scipy(path[few], ranges[few], starts, analytic=True), count, 5
        ),
        "scipy lm, 2-point Jacobian": best_rate(
            lambda: solve_with_scipy(path[few], ranges[few], starts, analytic=False), count, 3
        ),
        "gaia gaussian, both sides": best_rate(
            lambda: solve(path, ranges, SIGMA_M, options=gaussian), anchors[..., 0].size, 30
        ),
        "gaia robust, both sides": best_rate(
            lambda: solve(path, ranges, SIGMA_M, options=robust), anchors[..., 0].size, 30
        ),
    }
    scipy_rate = max(rate for name, rate in rates.items() if name.startswith("scipy"))
    excess = cost_excess(path[few], ranges[few], costs)
    print(f"{STEPS} ranges a problem, one thread\n{'solver':<30}{'problems/s':>12}{'ratio':>8}")
    for name, rate in rates.items():
        print(f"{name:<30}{rate:>12,.0f}{rate / scipy_rate:>8.1f}")
    print(f"largest excess of our cost over SciPy's: {excess:.1e} of it")
    OUT.mkdir(exist_ok=True)
    result = {"problems_per_s": rates, "largest_cost_excess": excess, "steps": STEPS}
    (OUT / "solver_speed.json").write_text(json.dumps(result, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
