"""Measure how often the stated uncertainties hold: docs/boundary-uncertainty.md.

Counts how often the inner region lies wholly within the true zone, and the true zone wholly within
the outer region. It also counts how often the 90 % ellipse of a cone, or one of the two ellipses of
a cone whose side is open, contains the true position. With --calibrate it prints the coverage at
several levels, for simulated training layouts only, and the interpolated levels for `Levels`.

Usage: python benchmarks/quality/boundary_coverage.py [--data-dir FOLDER] [--episodes N]
       [--calibrate] [--denoiser NAME] (or GAIA_DATA_DIR)
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import shapely

from _tally import in_ellipse_90, table_head, table_row
from gaia_uwb._shared import Array, Float64
from gaia_uwb.api import load_scenes
from gaia_uwb.config import PipelineConfig, SidesConfig
from gaia_uwb.episode import Episode
from gaia_uwb.evaluate import RigidAlignment, rigid_align, rotation_matrix
from gaia_uwb.pipeline import prepare, reconstruct_episodes
from gaia_uwb.reconstruction import Reconstruction
from gaia_uwb.zone import PROBABILITY, Levels, Region, Scenes, boundary_uncertainty, sample_scenes

TESTS = ("sim:wild-test/1/{n}", "sim:lane-closure/500/100")
TRAINING = "sim:wild-training/7/{n}"
WINDOW = 64
SIDE_OPEN = SidesConfig().ambiguous_above  # then the second ellipse counts
TOLERANCE_M = 1e-3
INNER = (0.90, 0.95, 0.97, 0.98, 0.985, 0.99, 0.995)
OUTER = (0.65, 0.70, 0.75, 0.80, 0.85, 0.90, 0.95)


@dataclass(frozen=True)
class Case:
    """One result, the true places of its located anchors, and the frame error taken out."""

    result: Reconstruction
    true_m: Float64[Array, "M 2"]
    frame: RigidAlignment | None

    def moved(self, place_m: Float64[Array, "*rest 2"]) -> Float64[Array, "*rest 2"]:
        """Return places in the true places' frame."""
        if self.frame is None:
            return place_m
        turn = rotation_matrix(self.frame.rotation_rad)
        return np.asarray(place_m @ turn.T + self.frame.translation_m)


def reconstructed(
    episodes: Sequence[Episode], frames: Sequence[RigidAlignment | None], config: PipelineConfig
) -> Iterator[Case]:
    """Yield every episode's result that has a boundary."""
    results = reconstruct_episodes(episodes, config)
    for result, episode, frame in zip(results, episodes, frames, strict=True):
        if result.possible is not None and episode.truth is not None:
            located = result.possible[1].located
            if len(located) >= 3:
                yield Case(result, episode.truth.anchor_m[located], frame)


def real_cases(data_dir: Path, config: PipelineConfig) -> dict[str, list[Case]]:
    """Return whole runs and their windows; a run's frame error is taken out of both."""
    runs = [prepare(scene) for scene in load_scenes("outdoor-uwb", data_dir=data_dir)]
    whole = list(reconstructed(runs, [None] * len(runs), config))
    frames = [_frame(case) for case in whole]
    aligned = [Case(c.result, c.true_m, f) for c, f in zip(whole, frames, strict=True)]
    windows = [(w, f) for run, f in zip(runs, frames, strict=True) for w in run.windows(WINDOW)]
    usable = [(w, f) for w, f in windows if w.valid.any()]
    cut = list(reconstructed([w for w, _ in usable], [f for _, f in usable], config))
    bare = [Case(c.result, c.true_m, None) for c in cut]
    return {
        "outdoor-uwb, whole runs, aligned": aligned,
        "outdoor-uwb, whole runs": whole,
        "outdoor-uwb, windows of 64 steps, run aligned": cut,
        "outdoor-uwb, windows of 64 steps": bare,
    }


def _frame(case: Case) -> RigidAlignment:
    located = [fix for fix in case.result.anchors if fix.status.has_position]
    return rigid_align(np.stack([fix.position_m for fix in located]), case.true_m)


def region(found: Region, case: Case) -> shapely.Geometry:
    """Return a region as a geometry in the true places' frame."""
    pieces = [[case.moved(ring) for ring in rings] for rings in found.polygons]
    return shapely.union_all([shapely.Polygon(first, holes) for first, *holes in pieces])


@dataclass(frozen=True)
class Verdict:
    """What held of one case."""

    inner: bool
    outer: bool
    empty: bool
    inner_share: float
    outer_share: float


def drawn(case: Case) -> Scenes:
    """Return a case's possible scenes."""
    assert case.result.possible is not None
    return sample_scenes(*case.result.possible)


def judge(case: Case, levels: Levels | None = None, scenes: Scenes | None = None) -> Verdict:
    """Compare a case's regions with its true zone."""
    assert case.result.possible is not None
    levels = Levels.of(learned=case.result.possible[1].learned) if levels is None else levels
    scenes = drawn(case) if scenes is None else scenes
    found = boundary_uncertainty(scenes.place_m, scenes.combination, levels)
    zone = shapely.convex_hull(shapely.MultiPoint(case.true_m))
    inner, outer = region(found.inner, case), region(found.outer, case)
    return Verdict(
        inner=inner.is_empty or bool(zone.buffer(TOLERANCE_M).covers(inner)),
        outer=bool(outer.buffer(TOLERANCE_M).covers(zone)),
        empty=bool(inner.is_empty),
        inner_share=inner.area / max(zone.area, 1e-9),
        outer_share=outer.area / max(zone.area, 1e-9),
    )


def ellipses(case: Case) -> list[tuple[bool, bool]]:
    """Return for each located anchor whether its ellipse, and either of its ellipses, held."""
    fixes = [fix for fix in case.result.anchors if fix.status.has_position]
    turn = np.eye(2) if case.frame is None else rotation_matrix(case.frame.rotation_rad)
    held = []
    for fix, true_m in zip(fixes, case.true_m, strict=True):
        places_m = np.stack([fix.position_m, fix.mirror_position_m])
        covariance_m2 = turn @ np.stack([fix.covariance_m2, fix.mirror_covariance_m2]) @ turn.T
        own, mirror = in_ellipse_90(true_m - case.moved(places_m), covariance_m2).tolist()
        held.append((own, own or (mirror and fix.mirror_probability > SIDE_OPEN)))
    return held


def row(name: str, cases: Sequence[Case]) -> str:
    """Return one row of the table."""
    verdicts = [judge(case) for case in cases]
    held = np.array([pair for case in cases for pair in ellipses(case)])
    inner, outer = (np.mean([getattr(v, side) for v in verdicts]) for side in ("inner", "outer"))
    share = [np.median([getattr(v, f"{side}_share") for v in verdicts]) for side in _SIDES]
    empty = np.mean([v.empty for v in verdicts])
    ellipse, either = (f"{100 * share:.1f} %" for share in held.mean(axis=0))
    return table_row(
        [
            name,
            len(cases),
            f"{100 * inner:.1f} %",
            f"{100 * outer:.1f} %",
            f"{100 * empty:.0f} %",
            f"{share[0]:.2f}",
            f"{share[1]:.2f}",
            len(held),
            ellipse,
            either,
        ]
    )


_SIDES = ("inner", "outer")
COLUMNS = (
    "data", "zones", "inner within true zone", "true zone within outer", "inner empty",
    "inner area / true", "outer area / true", "anchors", "90 % ellipse", "one of two ellipses",
)  # fmt: skip


def calibrate(n: int, config: PipelineConfig) -> None:
    """Print the coverage at several levels on simulated training layouts."""
    episodes = [prepare(scene) for scene in load_scenes(TRAINING.format(n=n))]
    cases = list(reconstructed(episodes, [None] * len(episodes), config))
    held = []
    for case in cases:
        scenes = drawn(case)
        verdicts = [judge(case, Levels(*pair), scenes) for pair in zip(INNER, OUTER, strict=True)]
        held.append([(v.inner, v.outer) for v in verdicts])
    share = np.mean(held, axis=0)
    for inner, outer, (right_inner, right_outer) in zip(INNER, OUTER, share, strict=True):
        print(f"inner {inner:.3f}: {right_inner:.3f}   outer {outer:.2f}: {right_outer:.3f}")
    chosen = [np.interp(PROBABILITY, share[:, k], (INNER, OUTER)[k]) for k in (0, 1)]
    print(f"of {len(cases)} zones; 90 % at inner {chosen[0]:.3f}, outer {chosen[1]:.3f}")


def main() -> None:
    """Print the table, or the calibration."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data-dir", type=Path, default=os.environ.get("GAIA_DATA_DIR"))
    parser.add_argument("--episodes", type=int, default=300)
    parser.add_argument("--calibrate", action="store_true")
    parser.add_argument("--denoiser", default=PipelineConfig().denoiser)
    given = parser.parse_args()
    config = PipelineConfig(denoiser=given.denoiser)
    if given.calibrate:
        calibrate(given.episodes, config)
        return
    start = time.perf_counter()
    print(table_head(COLUMNS))
    for test in TESTS:
        name = test.format(n=given.episodes)
        episodes = [prepare(scene) for scene in load_scenes(name)]
        cases = list(reconstructed(episodes, [None] * len(episodes), config))
        print(row(name, cases), flush=True)
    if given.data_dir is not None:
        for name, cases in real_cases(Path(given.data_dir), config).items():
            print(row(name, cases), flush=True)
    print(f"\n{time.perf_counter() - start:.0f} s")


if __name__ == "__main__":
    main()
