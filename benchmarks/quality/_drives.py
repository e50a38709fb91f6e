"""The drives of the comparison with general solvers: recorded, shuffled, and along roads."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from importlib import import_module
from pathlib import Path

import numpy as np

from gaia_uwb import Scene, Truth
from gaia_uwb._shared import Array, Bool, Float64, Int64
from gaia_uwb.api import load_scenes

HELPERS = Path(__file__).parents[2] / "tests" / "helpers"
ROAD_KINDS = ("single", "two lanes", "opposite directions", "u-turn")
PAIRS = ROAD_KINDS[1:3]
SHUFFLED = {"errors shuffled": None, "blocks of 8 s shuffled": 8.0}
SHUFFLE_SEED = 20261130
OFFSETS_S = np.arange(-0.5, 0.505, 0.01)


@dataclass(frozen=True)
class Case:
    """What one result is made from: a drive, or several past one zone, with their truth."""

    name: str
    passes: tuple[Scene, ...]


def data_sets(
    names: Sequence[str], n_seeds: int, data_dir: Path
) -> dict[str, Callable[[], Iterator[Case]]]:
    """Return what makes the cases of each data set, and print which ones are not here."""
    found: dict[str, Callable[[], Iterator[Case]]] = {}
    if "lias" in names and _is_here(data_dir / "lias"):
        found["lias"] = partial(_recorded, data_dir / "lias")
    outdoor = {"outdoor-uwb", "shuffled"} & set(names)
    if outdoor and _is_here(data_dir / "outdoor-uwb" / "Dynamic_measurements"):
        if "outdoor-uwb" in outdoor:
            found["outdoor-uwb"] = partial(_recorded, "outdoor-uwb", data_dir)
        if "shuffled" in outdoor:
            for title, block_s in SHUFFLED.items():
                found[f"outdoor-uwb, {title}"] = partial(_shuffled_runs, data_dir, block_s)
    if "patterns" in names:
        found |= {
            f"road with patterns, {kind}": partial(road_cases, kind, n_seeds, patterns=True)
            for kind in ROAD_KINDS
        }
    if "roads" in names:
        found |= {f"road, {kind}": partial(road_cases, kind, n_seeds) for kind in ROAD_KINDS}
        for kind in PAIRS:
            found[passes_of(f"road, {kind}")] = partial(_road_passes, kind, n_seeds)
    return found


def passes_of(pairs: str) -> str:
    """Return the name of the data set that holds the passes of pairs, each by itself."""
    return f"{pairs}, each pass"


def _is_here(folder: Path) -> bool:
    if not folder.is_dir():
        print(f"left out: there is no {folder}", file=sys.stderr)
    return folder.is_dir()


def _recorded(source: str | Path, data_dir: Path | None = None) -> Iterator[Case]:
    for scene in load_scenes(source, data_dir=data_dir):
        yield Case(scene.name, (scene,))


def _shuffled_runs(data_dir: Path, block_s: float | None) -> Iterator[Case]:
    for scene in load_scenes("outdoor-uwb", data_dir=data_dir):
        yield Case(scene.name, (shuffled(scene, block_s),))


def road_cases(kind: str, n_seeds: int, *, patterns: bool = False) -> Iterator[Case]:
    """Yield the zones of one kind, each with all passes; of radios with patterns if wanted."""
    if str(HELPERS) not in sys.path:
        sys.path.insert(0, str(HELPERS))
    roads = import_module("roads")
    for seed in range(n_seeds):
        radios = roads.WITH_PATTERNS if patterns else roads.Radios()
        passes = tuple(roads.road_drives(kind, seed, radios=radios))
        yield Case(passes[0].name.rpartition("-")[0], passes)


def _road_passes(kind: str, n_seeds: int) -> Iterator[Case]:
    for case in road_cases(kind, n_seeds):
        yield from (Case(scene.name, (scene,)) for scene in case.passes)


def shuffled(scene: Scene, block_s: float | None) -> Scene:
    """Return a run in which every anchor's range errors stand at other moments.

    Parameters
    ----------
    scene
        The run with its surveyed anchors. Its clock offset stays as it is.
    block_s
        How long the blocks are that keep their order inside; None moves each reading by itself.

    Notes
    -----
    What an error has to do with the place of the vehicle is lost: that of the frame, of the
    antennas, of what stands around. Its distribution is kept, and with blocks also how it follows
    the error before it.
    """
    assert scene.truth is not None
    true_m = _true_range_m(scene, _clock_offset_s(scene))
    log = scene.ranges
    range_m = log.range_m.copy()
    rng = np.random.default_rng(SHUFFLE_SEED)
    for anchor in range(scene.n_anchors):
        rows = np.flatnonzero((log.anchor == anchor) & in_drive(scene))
        moved = rows[_other_order(log.t_s[rows], block_s, rng)]
        range_m[rows] = true_m[rows] + (log.range_m - true_m)[moved]
    return replace(
        scene, ranges=replace(log, range_m=range_m), truth=Truth(anchor_m=scene.truth.anchor_m)
    )


def _other_order(
    t_s: Float64[Array, "K"], block_s: float | None, rng: np.random.Generator
) -> Int64[Array, "K"]:
    if block_s is None:
        return rng.permutation(len(t_s))
    block = ((t_s - t_s[0]) // block_s).astype(np.int64)
    place = rng.permutation(block[-1] + 1)
    return np.argsort(place[block], kind="stable")


def in_drive(scene: Scene) -> Bool[Array, "R"]:
    """Return which readings have stamps within the trajectory."""
    drive_s = scene.trajectory.t_s
    return np.asarray((scene.ranges.t_s >= drive_s[0]) & (scene.ranges.t_s <= drive_s[-1]))


def _true_range_m(scene: Scene, offset_s: float) -> Float64[Array, "R"]:
    """Return the slant ranges to the surveyed places, with the clock offset accounted for."""
    assert scene.truth is not None
    tag_m, tag_up_m = tag_at(scene, scene.ranges.t_s - offset_s)
    flat_m = np.hypot(*(tag_m - scene.truth.anchor_m[scene.ranges.anchor]).T)
    return np.asarray(np.hypot(flat_m, height_gap_m(scene, tag_up_m, scene.ranges.anchor)))


def _clock_offset_s(scene: Scene) -> float:
    """Return the offset at which the errors of each anchor vary least about their median."""
    inside = in_drive(scene)
    anchor = scene.ranges.anchor[inside]

    def spread_m(offset_s: float) -> float:
        error_m = (scene.ranges.range_m - _true_range_m(scene, offset_s))[inside]
        about_m = [error_m[anchor == n] - np.median(error_m[anchor == n]) for n in set(anchor)]
        return float(np.median(np.abs(np.concatenate(about_m))))

    return float(min(OFFSETS_S, key=spread_m))


def tag_at(
    scene: Scene, t_s: Float64[Array, "R"]
) -> tuple[Float64[Array, "R 2"], Float64[Array, "R"] | None]:
    """Return the tag's position and height at given times of the trajectory's clock."""
    drive = scene.trajectory
    east_m, north_m = (np.interp(t_s, drive.t_s, axis) for axis in drive.position_m.T)
    up_m = None if drive.up_m is None else np.interp(t_s, drive.t_s, drive.up_m)
    return np.stack([east_m, north_m], axis=1), up_m


def height_gap_m(
    scene: Scene, tag_up_m: Float64[Array, "R"] | None, anchor: Int64[Array, "R"]
) -> Float64[Array, "R"]:
    """Return tag minus anchor, 0 where a height is unknown."""
    if tag_up_m is None or scene.anchor_up_m is None:
        return np.zeros(len(anchor))
    return np.asarray(np.nan_to_num(tag_up_m - scene.anchor_up_m[anchor]))
