"""Tiny episodes and models for the tests of the learned denoisers: all is over in a second."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any
from unittest.mock import patch

import numpy as np

from gaia_uwb.episode import Episode, EpisodeTruth
from gaia_uwb.learn.window_sets import LearningSets
from gaia_uwb.models.description import (
    GaiaOptions,
    GaiaSetOptions,
    MlpOptions,
    NetworkOptions,
    PoseMlpOptions,
    SetTrainingOptions,
    TrainingOptions,
)

if TYPE_CHECKING:
    from gaia_uwb.models.description import ModelDescription, SetModelDescription

N_ANCHORS = 3
N_STEPS = 8
SIZES: dict[str, Any] = {"base_hidden": 8, "gru_hidden": 8, "layout_hidden": 8, "head_hidden": 8}
NETWORKS: dict[str, NetworkOptions] = {
    "mlp": MlpOptions(hidden=8),
    "pose-mlp": PoseMlpOptions(hidden=8),
    "gaia": GaiaOptions(**SIZES),
    "without-layout-head": GaiaOptions(**SIZES, layout_head=False),
    "without-geo-dist": GaiaOptions(**SIZES, geo_dist=False),
    "unfrozen-base": GaiaOptions(**SIZES, train_base=True),
    "causal": GaiaOptions(**SIZES, causal=True),
    "causal-look-ahead": GaiaOptions(**SIZES, causal=True, look_ahead_steps=2),
}


def make_run(
    seed: int, n_steps: int = N_STEPS, n_anchors: int = N_ANCHORS, *, missing: float = 0.1
) -> Episode:
    """Return a drive along y = -4 m past anchors at random places, with a bias of 0.3 m."""
    rng = np.random.default_rng(seed)
    path_m = np.stack([np.linspace(-10.0, 10.0, n_steps), np.full(n_steps, -4.0)], axis=1)
    anchor_m = rng.uniform([-5.0, 0.0], [5.0, 3.0], size=(n_anchors, 2))
    range_m = np.sqrt(np.square(path_m[:, None] - anchor_m).sum(axis=2) + 1.0)
    valid = rng.random(range_m.shape) >= missing
    return Episode(
        name=f"run-{seed}",
        anchor_ids=tuple(f"cone-{k}" for k in range(n_anchors)),
        t_s=np.arange(n_steps) * 0.1,
        position_m=path_m,
        range_m=np.where(valid, range_m + 0.3, np.nan),
        valid=valid,
        tag_up_m=np.full(n_steps, 2.0),
        anchor_up_m=np.ones(n_anchors),
        truth=EpisodeTruth(anchor_m, range_m, rng.random(range_m.shape) < 0.3),
    )


def make_sets(n_training: int = 8, n_validation: int = 4, **changes: Any) -> LearningSets:
    runs = [make_run(seed, **changes) for seed in range(n_training + n_validation)]
    source = {"source": "tiny runs"}
    return LearningSets(tuple(runs[:n_training]), tuple(runs[n_training:]), (), (), source)


def train_tiny(
    folder: Path,
    network: NetworkOptions,
    sets: LearningSets | None = None,
    *,
    base: Path | None = None,
    progress: Any = None,
    curves: bool = False,
    **training: Any,
) -> ModelDescription:
    """Train; drawing the loss curves takes far longer than all else, so they are left out."""
    from gaia_uwb._shared.files import OutputFolder
    from gaia_uwb.learn.window_training import Task, train

    settings = TrainingOptions(**({"epochs": 2, "batch_size": 4} | training))
    task = Task(network, settings, make_sets() if sets is None else sets, "0.0")
    more = {} if progress is None else {"progress": progress}
    with ExitStack() as stack:
        if not curves:
            stack.enter_context(patch("gaia_uwb.learn.training_folder.plot_losses"))
            stack.enter_context(
                patch("gaia_uwb.learn.training_folder.figure_png", return_value=b"")
            )
        return train(task, OutputFolder(folder), base=base, **more)


def train_tiny_set(
    folder: Path, *, progress: Any = None, curves: bool = False, **training: Any
) -> SetModelDescription:
    """Train a small ``gaia-set`` for a moment; without the loss curves, like ``train_tiny``."""
    from gaia_uwb._shared.files import OutputFolder
    from gaia_uwb.learn.zone_training import SetTask, train_set

    settings = {"portions": 2, "portion_episodes": 16, "validation_episodes": 8, "warm_up_steps": 4}
    task = SetTask(
        GaiaSetOptions(channels=4, width=8, layers=1, rounds=2),
        SetTrainingOptions(**(settings | training)),
        "0",
    )
    watch = {} if progress is None else {"progress": progress}
    with ExitStack() as stack:
        if not curves:
            stack.enter_context(patch("gaia_uwb.learn.training_folder.plot_losses"))
            stack.enter_context(
                patch("gaia_uwb.learn.training_folder.figure_png", return_value=b"")
            )
        return train_set(task, OutputFolder(folder), **watch)
