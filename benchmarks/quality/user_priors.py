"""Measure how much a user's knowledge about a zone helps: docs/howto/known-facts.md.

The same simulated test passes are reconstructed without and with true statements, and with wrong
ones.

    python benchmarks/quality/user_priors.py [--episodes N] [--source SPEC] [--denoiser NAME]

"""

from __future__ import annotations

import argparse
from collections.abc import Callable

import numpy as np

from _tally import means, table_head, table_row
from gaia_uwb.api import load_scenes
from gaia_uwb.config import PipelineConfig, make_config
from gaia_uwb.episode import Episode
from gaia_uwb.estimate import ReasonKind
from gaia_uwb.evaluate import score_episode
from gaia_uwb.pipeline import prepare, reconstruct_episodes
from gaia_uwb.zone import PathSides

Said = Callable[[Episode], dict[str, object]]
OBJECTIONS = {ReasonKind.STATEMENT, ReasonKind.EXCEPTION}
COLUMNS = (
    "said", "IoU", "anchor error (m)", "wrong sides", "side unknown", "statement contradicted",
)  # fmt: skip
OTHER = {"left": "right", "right": "left"}


def side_of(episode: Episode) -> str | None:
    """Return the side on which all true places are, or None where they are on both."""
    assert episode.truth is not None
    left = PathSides(episode.position_m).are_left(episode.truth.anchor_m)
    if left.all():
        return "left"
    return None if left.any() else "right"


def surveyed(episode: Episode, off_m: float = 0.0) -> dict[str, object]:
    """Return the first anchor's true place, moved east by ``off_m``."""
    assert episode.truth is not None
    east_m, north_m = episode.truth.anchor_m[0].tolist()
    known = {"anchor_id": episode.anchor_ids[0], "east_m": east_m + off_m, "north_m": north_m}
    return {"known_anchors": [known]}


STATEMENTS: dict[str, Said] = {
    "nothing": lambda _: {},
    "one side (lane-closure)": lambda _: {"closure": "lane-closure"},
    "the right side": lambda e: {"side": side_of(e)},
    "first cone surveyed": surveyed,
    "side and first cone": lambda e: {"side": side_of(e)} | surveyed(e),
    "WRONG: the other side": lambda e: {"side": OTHER[side_of(e) or "left"]},
    "WRONG: first cone 25 m off": lambda e: surveyed(e, 25.0),
}


def row(name: str, said: Said, episodes: list[Episode], denoiser: str) -> str:
    """Reconstruct all episodes with one statement and return a row of the table."""
    scores, noticed, doubtful = [], [], []
    for episode in episodes:
        config = make_config({"denoiser": denoiser, "prior": said(episode)})
        (found,) = reconstruct_episodes([episode], config)
        scores.append(score_episode(episode, found.denoised, found.anchors))
        noticed.append(any(reason.kind in OBJECTIONS for reason in found.reasons))
        doubtful.append(np.mean([fix.side_is_open for fix in found.anchors]))
    names = [episode.name for episode in episodes]
    mean = means(scores, names, ("polygon_iou", "anchor_mae", "wrong_side_share"))
    return table_row(
        [
            name,
            f"{mean['polygon_iou']:.3f}",
            f"{mean['anchor_mae']:.2f}",
            f"{100 * mean['wrong_side_share']:.1f} %",
            f"{100 * np.mean(doubtful):.0f} %",
            f"{100 * np.mean(noticed):.0f} %",
        ]
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--episodes", type=int, default=300)
    parser.add_argument("--source", default="sim:wild-test/1")
    parser.add_argument("--denoiser", default=PipelineConfig().denoiser)
    given = parser.parse_args()
    runs = [prepare(scene) for scene in load_scenes(f"{given.source}/{given.episodes}")]
    episodes = [run for run in runs if side_of(run) is not None]
    print(f"{len(episodes)} of {len(runs)} zones have all cones on one side; {given.denoiser}\n")
    print(table_head(COLUMNS))
    for name, said in STATEMENTS.items():
        print(row(name, said, episodes, given.denoiser), flush=True)


if __name__ == "__main__":
    main()
