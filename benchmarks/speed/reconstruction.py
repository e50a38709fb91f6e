"""Time and memory of whole reconstructions: two passes, a long road, and the command by parts.

Two passes: 40 cones that are heard all the time, two drives of 10 minutes at 10 Hz. Beside it
SciPy's ``least_squares`` from 8 starts with the same readings, which is what a user would write.

Road: an hour at 10 Hz along 40 km with 1,000 cones, each heard within 80 m.

Command: ``gaia reconstruct LOG --out FOLDER`` of a run of some minutes, whole and by its parts. The
log is a run of the outdoor UWB data set, or a simulated one where there is no ``--data-dir``.

Each case runs in a process of its own. Times are of processors, all threads together, so that
others at work count less. Those of reconstructions begin when a small one has loaded everything.

    python benchmarks/speed/reconstruction.py [--part passes] [--part road] [--part command]
"""

from __future__ import annotations

import os

for _name in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")  # before numpy is loaded: threads that wait take time, too

import argparse
import json
import multiprocessing
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from importlib import import_module
from pathlib import Path
from statistics import median

import numpy as np

from _measure import ROOT, make_parser, run_parts
from gaia_uwb import RangeLog, Scene, Trajectory, Truth, reconstruct

RATE_HZ = 10.0
NOISE_M, BIAS_M = 0.05, 0.1
HEARD_M = 80.0
REAL, SIMULATED = "outdoor-uwb:NLOS/B/4", "sim"
PARTS = Path(__file__).with_name("_parts.py")


def make_scene(
    name: str,
    start_s: float,
    path_m: np.ndarray,
    cones_m: np.ndarray,
    reach_m: float,
    rng: np.random.Generator,
) -> Scene:
    """Return a drive along a path (T, 2) past cones (N, 2), each heard within a distance."""
    t_s = start_s + np.arange(len(path_m)) / RATE_HZ
    heard = []
    for n, cone_m in enumerate(cones_m):
        distance_m = np.hypot(*(path_m - cone_m).T)
        step = np.flatnonzero(distance_m < reach_m)
        heard.append((step, np.full(len(step), n), distance_m[step]))
    step, anchor, range_m = (np.concatenate(column) for column in zip(*heard, strict=True))
    order = np.argsort(step, kind="stable")
    range_m = range_m + BIAS_M + NOISE_M * rng.standard_normal(len(range_m))
    return Scene(
        name=name,
        trajectory=Trajectory(t_s, path_m),
        ranges=RangeLog(t_s[step[order]], anchor[order], range_m[order]),
        anchor_ids=tuple(f"cone-{n}" for n in range(len(cones_m))),
        truth=Truth(anchor_m=cones_m),
    )


def two_passes(duration_s: float = 600.0) -> list[Scene]:
    """Return two drives, in two lanes, up and down a road past 40 cones."""
    t_s = np.arange(0.0, duration_s, 1.0 / RATE_HZ)
    east_m = np.abs((t_s * 8.0) % 1600.0 - 800.0) - 400.0
    cones_m = np.stack([np.linspace(-300.0, 300.0, 40), np.full(40, 6.0)], axis=1)
    rng, scenes = np.random.default_rng(0), []
    for name, start_s, lane_m in (("first", 0.0, 0.0), ("second", 3600.0, -3.5)):
        path_m = np.stack([east_m, lane_m + 0.3 * np.sin(t_s / 7.0)], axis=1)
        scenes.append(make_scene(name, start_s, path_m, cones_m, np.inf, rng))
    return scenes


def road(n_cones: int = 1000, n_steps: int = 36_000) -> list[Scene]:
    """Return a drive along a winding road, with cones 3 to 8 m to its right."""
    t_s = np.arange(n_steps) / RATE_HZ
    heading_rad = 0.5 * np.sin(t_s / 60.0)
    speed_mps = 11.0 + 3.0 * np.sin(t_s / 37.0)
    forward = np.stack([np.cos(heading_rad), np.sin(heading_rad)], axis=1)
    path_m = np.cumsum(speed_mps[:, None] * forward / RATE_HZ, axis=0)
    rng = np.random.default_rng(0)
    beside = np.linspace(100, n_steps - 100, n_cones).astype(np.int64)
    right = np.stack([forward[:, 1], -forward[:, 0]], axis=1)
    cones_m = path_m[beside] + rng.uniform(3.0, 8.0, (n_cones, 1)) * right[beside]
    return [make_scene("road", 0.0, path_m, cones_m, HEARD_M, rng)]


def our_case(make: Callable[[], list[Scene]]) -> dict[str, float]:
    """Return processor time, peak memory and the median error of a reconstruction."""
    blind = [scene.without_truth() for scene in two_passes(20.0)]
    reconstruct(blind)  # loads all libraries and the network
    scenes = make()
    assert scenes[0].truth is not None
    true_m = scenes[0].truth.anchor_m
    blind = [scene.without_truth() for scene in scenes]
    start_s = time.process_time()
    result = reconstruct(blind if len(blind) > 1 else blind[0])
    spent_s = time.process_time() - start_s
    found_m = np.array([anchor.position_m for anchor in result.anchors])
    return _row(scenes, spent_s, np.hypot(*(found_m - true_m).T))


def scipy_case(make: Callable[[], list[Scene]]) -> dict[str, float]:
    """Return the same of SciPy's solver, as in the comparison of quality."""
    sys.path.insert(0, str(ROOT / "benchmarks" / "quality"))
    locate = import_module("_peers").methods(["scipy"], [])["SciPy"]
    scenes = make()
    start_s = time.process_time()
    places, _ = locate(scenes)
    spent_s = time.process_time() - start_s
    off_m = [np.hypot(*np.subtract(place.position_m, place.true_m)) for place in places]
    return _row(scenes, spent_s, np.array(off_m))


def _row(scenes: list[Scene], spent_s: float, off_m: np.ndarray) -> dict[str, float]:
    return {
        "cones": scenes[0].n_anchors,
        "readings": sum(len(scene.ranges) for scene in scenes),
        "processor_s": spent_s,
        "peak_gib": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20,
        "median_error_m": float(np.nanmedian(off_m)),
    }


def _alone(
    case: Callable[..., dict[str, float]], make: Callable[[], list[Scene]]
) -> dict[str, float]:
    """Run a case in a new process, which has a peak of memory of its own."""
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        return pool.apply(case, (make,))


def _print(name: str, row: dict[str, float]) -> None:
    print(
        f"{name:<30}{row['cones']:>6} cones {row['readings']:>8} readings "
        f"{row['processor_s']:>7.2f} s of processor time, peak {row['peak_gib']:.2f} GiB, "
        f"median error {row['median_error_m']:.3f} m",
        flush=True,
    )


def passes_part(_: argparse.Namespace) -> dict[str, dict[str, float]]:
    """Print and return two passes, ours and SciPy's."""
    rows = {}
    for name, case in (("gaia", our_case), ("scipy", scipy_case)):
        rows[name] = _alone(case, two_passes)
        _print(f"two passes, {name}", rows[name])
    return rows


def road_part(_: argparse.Namespace) -> dict[str, float]:
    """Print and return the long road."""
    row = _alone(our_case, road)
    _print("road", row)
    return row


def command_part(given: argparse.Namespace) -> dict[str, object]:
    """Print and return the processor time of a command, whole and by parts: medians of rounds."""
    data_dir = given.data_dir
    there = bool(data_dir) and (Path(data_dir) / "outdoor-uwb").is_dir()
    log = REAL if there else SIMULATED
    # An installed package has its bytecode; so has this one after a first, cold run.
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    if there:
        environment["GAIA_DATA_DIR"] = str(data_dir)
    rounds, whole_s = [], []
    with tempfile.TemporaryDirectory() as folder:
        arguments = ["reconstruct", log, "--out", str(Path(folder) / "out")]
        parts = Path(folder) / "parts.json"
        run = partial(subprocess.run, env=environment, capture_output=True, check=False)
        for _ in range(given.rounds + 1):
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            run([sys.executable, "-m", "gaia_uwb", *arguments])
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            spent = [after.ru_utime - before.ru_utime, after.ru_stime - before.ru_stime]
            whole_s.append(sum(spent))
            run([sys.executable, str(PARTS), str(parts), *arguments])
            rounds.append(json.loads(parts.read_text(encoding="utf-8")))
    by_part = {name: median(each[name] for each in rounds[1:]) for name in rounds[0]}
    row = {"log": log, "processor_s": median(whole_s[1:]), "parts_s": by_part}
    print(f"gaia reconstruct {log}: {row['processor_s']:.2f} s of processor time, of which")
    for name, spent_s in sorted(by_part.items(), key=lambda each: -each[1]):
        print(f"  {name:<28}{spent_s:>7.3f}")
    return row


if __name__ == "__main__":
    parser = make_parser(__doc__, __file__)
    parser.add_argument("--rounds", type=int, default=7, help="runs of the command")
    parser.add_argument("--data-dir", type=Path, default=os.environ.get("GAIA_DATA_DIR"))
    run_parts(parser, {"passes": passes_part, "road": road_part, "command": command_part})
