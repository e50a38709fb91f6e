"""Measures what each part of gaia-set contributes and writes docs/gaia-set-ablation.md.

    python benchmarks/quality/ablation.py --out out/ablation [--portions 12] [--workers 2]

Every variant is trained from scratch on the same scenes for the same number of portions, far fewer
than the shipped model's, and scored on validation scenes: training layouts, but other scenes. So
no test data are used. An interrupted training resumes where it stopped.
"""

from __future__ import annotations

import argparse
import os
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import _tally
from gaia_uwb import __version__
from gaia_uwb._shared import OutputFolder, replace_file
from gaia_uwb.models import GaiaSetArchitecture, ZoneModel, ZoneTrainingOptions

PAGE = Path(__file__).parents[2] / "docs" / "gaia-set-ablation.md"
ADAMW = "AdamW for all weights, no Muon"
VARIANTS = {
    "whole": GaiaSetArchitecture(),
    ADAMW: GaiaSetArchitecture(),
    "without attention: every anchor on its own": GaiaSetArchitecture(layers=0),
    "one round": GaiaSetArchitecture(rounds=1),
    "half the channels of the temporal encoder": GaiaSetArchitecture(channels=12),
}
KINDS = ("wild", "roaming", "stress")
METRICS = {
    "distance_mse_overall": "range MSE (m²)",
    "wrong_side_share": "wrong sides",
    "scene": "−ln likelihood of an anchor's position",
}
HEAD = """\
# gaia-set: without one of its parts

Written by `python benchmarks/quality/ablation.py`; not edited by hand. Every
variant is trained with one seed ({seed}) on {portions} portions of {episodes} scenes (the shipped
model: {shipped} portions) and scored on {validation} validation scenes of each kind. Lower is
better in every column.
"""


def main() -> None:
    """Train, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True, help="folder for the models")
    parser.add_argument("--portions", type=int, default=12)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--page", type=Path, default=PAGE)
    given = parser.parse_args()
    options = ZoneTrainingOptions(portions=given.portions)
    os.environ["OMP_NUM_THREADS"] = "1"  # read by the processes that are started below
    places = [given.out / str(k) for k in range(len(VARIANTS))]
    pool = ProcessPoolExecutor(given.workers, get_context("spawn"), max_tasks_per_child=1)
    with pool:
        jobs = [
            pool.submit(train, network, optimised(options, name), place)
            for (name, network), place in zip(VARIANTS.items(), places, strict=True)
        ]
        found = dict(zip(VARIANTS, (job.result() for job in jobs), strict=True))
    head = HEAD.format(
        seed=options.seed,
        portions=options.portions,
        episodes=options.portion_episodes,
        shipped=ZoneTrainingOptions().portions,
        validation=options.validation_episodes,
    )
    text = "\n".join([head, *(table(kind, found) for kind in KINDS), f"gaia {__version__}.\n"])
    replace_file(given.page, text)


def optimised(options: ZoneTrainingOptions, variant: str) -> ZoneTrainingOptions:
    """Return the settings of a variant."""
    optimiser = "adamw" if variant == ADAMW else "muon"
    return options.model_copy(update={"matrix_optimiser": optimiser})


def train(network: GaiaSetArchitecture, options: ZoneTrainingOptions, place: Path) -> ZoneModel:
    """Train a variant."""
    from gaia_uwb.learn import ZoneTask, train_zone

    return train_zone(ZoneTask(network, options, __version__), OutputFolder(place))


def table(kind: str, found: dict[str, ZoneModel]) -> str:
    """Return all variants on one kind of scene, as Markdown."""
    rows = [
        [variant, *(f"{model.metrics[f'{kind}_{name}']:.4g}" for name in METRICS)]
        for variant, model in found.items()
    ]
    return f"## `{kind}`\n\n" + _tally.table(["variant", *METRICS.values()], rows)


if __name__ == "__main__":
    main()
