"""How often the estimator's better place of a cone is the wrong one, at which odds.

Usage: python benchmarks/quality/side_odds.py [--data FOLDER] [--episodes N]

Of each cone whose two places are more than a metre apart: the log odds of its side by its ranges
alone, and whether its other place is nearer to the truth. Data are windows of 8 s of ``lias``,
windows of 64 steps of ``outdoor-uwb`` (what is not present is left out), and simulated passes.
"""

from __future__ import annotations

import argparse
import itertools
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from gaia_uwb.api import load_scenes
from gaia_uwb.episode import Episode
from gaia_uwb.locate import find_places
from gaia_uwb.pipeline import prepare
from gaia_uwb.simulate import find_preset, simulate_episodes

_EDGES = (0.0, 0.5, 1.0, 2.0, 4.0, 8.0, np.inf)
_APART_M = 1.0


def data_sets(data: Path, episodes: int) -> Iterator[tuple[str, list[Episode]]]:
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
    for preset in ("straight", "lane-closure"):
        yield f"sim:{preset}", list(simulate_episodes(find_preset(preset), episodes, 5))


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--data", type=Path, default=Path("../shared/data"))
    parser.add_argument("--episodes", type=int, default=100)
    given = parser.parse_args()
    print(f"{'data':<24}{'log odds':>12}{'cones':>7}{'wrong':>7}{'expected':>10}")
    for name, episodes in data_sets(given.data, given.episodes):
        odds, wrong = [], []
        for episode, places in zip(episodes, find_places([[e] for e in episodes]), strict=True):
            if episode.truth is None:
                continue
            found = places.hypotheses
            for place_m, own, true_m in zip(
                found.position_m, found.log_odds, episode.truth.anchor_m, strict=True
            ):
                if np.hypot(*(place_m[0] - place_m[1])) > _APART_M:
                    off_m = np.hypot(*(place_m - true_m).T)
                    odds.append(own)
                    wrong.append(off_m[0] > off_m[1])
        stated = 1.0 / (1.0 + np.exp(odds))
        bins = np.digitize(odds, _EDGES) - 1
        for k, (low, high) in enumerate(itertools.pairwise(_EDGES)):
            own = bins == k
            counts = f"{own.sum():>7}{np.sum(np.array(wrong)[own]):>7}{stated[own].sum():>10.1f}"
            print(f"{name:<24}{f'{low:g} to {high:g}':>12}{counts}")


if __name__ == "__main__":
    main()
