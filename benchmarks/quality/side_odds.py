"""How often sides are wrong, at which odds: by the ranges alone, and by all cones together.

Usage: python benchmarks/quality/side_odds.py [--data FOLDER] [--episodes N] [--seed N]

Of each cone whose two places are more than a metre apart: the log odds of its side by its ranges
alone, and by the ranges of all cones and what is known of neighbours (``raw``), and whether its
other place is nearer to the truth. The last columns are those that raw calls ok. Data are windows
of 8 s of ``lias``, windows of 64 steps of ``outdoor-uwb`` (what is not present is left out), and
simulated passes: of presets, of straight closures, of zones with cones on both sides of the path,
and (with line of sight, noise and roads of another kind) of tapers on straight roads. Nothing was
tuned on seeds below 1000.
"""

from __future__ import annotations

import argparse
import itertools
import sys
from collections.abc import Iterator, Sequence
from importlib import import_module
from pathlib import Path

import numpy as np

from _drives import HELPERS
from gaia_uwb.api import load_scenes
from gaia_uwb.episode import Episode
from gaia_uwb.estimate import AnchorFix, AnchorStatus
from gaia_uwb.locate import Hypotheses, find_places
from gaia_uwb.pipeline import prepare
from gaia_uwb.simulate import PRESETS, PassConfig, find_preset, simulate_episodes, simulate_pass
from gaia_uwb.zone import decide_sides

_EDGES = (0.0, 0.5, 1.0, 2.0, 4.0, 8.0, np.inf)
_APART_M = 1.0


def data_sets(data: Path, episodes: int, seed: int) -> Iterator[tuple[str, list[Episode]]]:
    """Yield names and episodes of what is present."""
    runs = sorted((data / "lias").glob("*_tag*"))
    if runs:
        cut = []
        for run in runs:
            episode = prepare(load_scenes(str(run))[0])
            cut += episode.windows(int(8.0 / np.median(np.diff(episode.t_s))))
        yield "lias, 8 s", cut
    if (data / "outdoor-uwb").exists():
        scenes = load_scenes("outdoor-uwb", data_dir=data)
        yield "outdoor-uwb, 64 steps", [w for s in scenes for w in prepare(s).windows(64)]
    for name in ("straight", "lane-closure", "wild-test"):
        yield f"sim:{name}", list(simulate_episodes(find_preset(name), episodes, seed))
    for name in ("straight", "wild-test"):
        config = on_both_sides(find_preset(name))
        yield f"two rows: {name}", list(simulate_episodes(config, episodes, seed))
    for work_m in (300.0, 900.0):
        passes = [simulate_pass(straight_closure(work_m), seed + k) for k in range(episodes // 5)]
        yield f"closure of {work_m:.0f} m", [prepare(scene) for scene in passes]
    yield from road_sets(episodes // 5, seed)


def road_sets(n: int, seed: int) -> Iterator[tuple[str, list[Episode]]]:
    """Yield the drives past tapers that the tests use."""
    sys.path.append(str(HELPERS))
    roads = import_module("roads")
    for name, radius_m in (("taper, straight", np.inf), ("taper, any road", None)):
        drives = [roads.road_drives("single", seed + k, radius_m=radius_m)[0] for k in range(n)]
        yield name, [prepare(drive) for drive in drives]


def on_both_sides(preset: PassConfig) -> PassConfig:
    """Return a preset with two rows of cones, one on either side of the path."""
    if "closure.both_sides" in preset.vary:
        return preset.model_copy(update={"vary": {**preset.vary, "closure.both_sides": [True]}})
    closure = preset.closure.model_copy(update={"both_sides": True})
    return preset.model_copy(update={"closure": closure})


def straight_closure(work_m: float) -> PassConfig:
    """Return a pass on one side of a long closure, without a lane change."""
    preset = PRESETS["lane-closure"]
    drive = {"lane_change": False, "speed_mps": 15.0, "duration_s": 40.0 + work_m / 15.0}
    closure = {"work_m": work_m, "n_anchors": 24}
    return preset.model_copy(
        update={
            "closure": preset.closure.model_copy(update=closure),
            "road": preset.road.model_copy(update={"curvature_per_m": -0.0002}),
            "drive": preset.drive.model_copy(update=drive),
        }
    )


class Sides:
    """Probabilities of the other side, and whether it is the right one."""

    def __init__(self) -> None:
        self._other: list[float] = []
        self._wrong: list[bool] = []

    def add(self, other: float, *, wrong: bool) -> None:
        """Count a cone."""
        self._other.append(min(other, 1.0 - other))
        self._wrong.append(wrong if other <= 0.5 else not wrong)

    def at(self, low: float, high: float) -> str:
        """Return count, wrong ones and how many were expected, between two log odds."""
        other, wrong = np.array(self._other), np.array(self._wrong, dtype=np.bool_)
        with np.errstate(divide="ignore"):
            odds = np.log1p(-other) - np.log(other)
        own = (odds >= low) & (odds < high)
        return f"{own.sum():>7}{wrong[own].sum():>7}{other[own].sum():>10.1f}"


def count(
    found: Hypotheses, fixes: Sequence[AnchorFix], true_m: np.ndarray, tallies: Sequence[Sides]
) -> None:
    """Count the cones of an episode: by ranges, together, and those that are ok."""
    alone, together, ok = tallies
    for place_m, odds, fix, own_m in zip(
        found.position_m, found.log_odds, fixes, true_m, strict=True
    ):
        if not np.hypot(*(place_m[0] - place_m[1])) > _APART_M:
            continue
        first_m, second_m = np.hypot(*(place_m - own_m).T)
        alone.add(1.0 / (1.0 + np.exp(min(odds, 700.0))), wrong=bool(first_m > second_m))
        is_second = bool((fix.mirror_position_m == place_m[0]).all())
        wrong = bool(second_m > first_m if is_second else first_m > second_m)
        together.add(fix.mirror_probability, wrong=wrong)
        if fix.status is AnchorStatus.OK:
            ok.add(fix.mirror_probability, wrong=wrong)


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--data", type=Path, default=Path("../shared/data"))
    parser.add_argument("--episodes", type=int, default=100)
    parser.add_argument("--seed", type=int, default=5)
    given = parser.parse_args()
    counted = f"{'cones':>7}{'wrong':>7}{'expected':>10}"
    print(f"{'':<36}{'by ranges':>24}{'together':>24}{'together, ok':>24}")
    print(f"{'data':<24}{'log odds':>12}{3 * counted}")
    for name, episodes in data_sets(given.data, given.episodes, given.seed):
        tallies = [Sides() for _ in range(3)]
        known = [episode for episode in episodes if episode.truth is not None]
        for episode, places in zip(known, find_places([[e] for e in known]), strict=True):
            found = places.hypotheses
            fixes = decide_sides(episode.anchor_ids, found, episode.position_m).anchors
            assert episode.truth is not None
            count(found, fixes, episode.truth.anchor_m, tallies)
        for low, high in [*itertools.pairwise(_EDGES), (0.0, np.inf)]:
            span = "all" if (low, high) == (0.0, np.inf) else f"{low:g} to {high:g}"
            print(f"{name:<24}{span:>12}{''.join(sides.at(low, high) for sides in tallies)}")


if __name__ == "__main__":
    main()
