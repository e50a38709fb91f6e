"""Tiny episodes and models for the tests of the learned denoisers: all is over in a second."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any
from unittest.mock import patch

import numpy as np

from gaia_uwb.episode import Episode, EpisodeTruth
from gaia_uwb.learn.window_sets import WindowSets
from gaia_uwb.models.description import (
    GaiaArchitecture,
    GaiaSetArchitecture,
    MlpArchitecture,
    PoseMlpArchitecture,
    WindowArchitecture,
)
from gaia_uwb.models.training_options import WindowTrainingOptions, ZoneTrainingOptions

if TYPE_CHECKING:
    from gaia_uwb.models.description import WindowModel, ZoneModel

N_ANCHORS = 3
N_STEPS = 8
SIZES: dict[str, Any] = {"base_hidden": 8, "gru_hidden": 8, "layout_hidden": 8, "head_hidden": 8}
NETWORKS: dict[str, WindowArchitecture] = {
    "mlp": MlpArchitecture(hidden=8),
    "pose-mlp": PoseMlpArchitecture(hidden=8),
    "gaia": GaiaArchitecture(**SIZES),
    "without-layout-head": GaiaArchitecture(**SIZES, layout_head=False),
    "without-geo-dist": GaiaArchitecture(**SIZES, geo_dist=False),
    "unfrozen-base": GaiaArchitecture(**SIZES, train_base=True),
    "causal": GaiaArchitecture(**SIZES, causal=True),
    "causal-look-ahead": GaiaArchitecture(**SIZES, causal=True, look_ahead_steps=2),
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


def make_sets(n_training: int = 8, n_validation: int = 4, **changes: Any) -> WindowSets:
    runs = [make_run(seed, **changes) for seed in range(n_training + n_validation)]
    source = {"source": "tiny runs"}
    return WindowSets(tuple(runs[:n_training]), tuple(runs[n_training:]), (), (), source)


class InterruptionError(Exception):
    """Stands for whatever stops a training."""


def stop_after(n: int) -> Callable[[Iterable[int], str, int], Iterator[int]]:
    """Stop the named training after n steps; that of a base runs through."""

    def go(steps: Iterable[int], name: str, done: int) -> Iterator[int]:
        for step in steps:
            if name != "pose-mlp" and step - done >= n:
                raise InterruptionError
            yield step

    return go


@contextmanager
def no_curves() -> Iterator[None]:
    folder = "gaia_uwb.learn.training_folder"
    with patch(f"{folder}.plot_losses"), patch(f"{folder}.figure_png", return_value=b""):
        yield


def train_tiny(
    folder: Path,
    network: WindowArchitecture,
    sets: WindowSets | None = None,
    *,
    base: Path | None = None,
    progress: Any = None,
    curves: bool = False,
    **training: Any,
) -> WindowModel:
    """Train; drawing the loss curves takes far longer than all else, so they are left out."""
    from gaia_uwb._shared.files import OutputFolder
    from gaia_uwb.learn.window_training import WindowTask, train_window

    settings = WindowTrainingOptions(**({"epochs": 2, "batch_size": 4} | training))
    task = WindowTask(network, settings, "0.0", make_sets() if sets is None else sets)
    more = {} if progress is None else {"progress": progress}
    with nullcontext() if curves else no_curves():
        return train_window(task, OutputFolder(folder), base=base, **more)


def train_tiny_zone(
    folder: Path, *, progress: Any = None, curves: bool = False, **training: Any
) -> ZoneModel:
    """Train a small ``gaia-set`` for a moment; without the loss curves, like ``train_tiny``."""
    from gaia_uwb._shared.files import OutputFolder
    from gaia_uwb.learn.zone_training import ZoneTask, train_zone

    settings = {"portions": 2, "portion_episodes": 16, "validation_episodes": 8, "warm_up_steps": 4}
    task = ZoneTask(
        GaiaSetArchitecture(channels=4, width=8, layers=1, rounds=2),
        ZoneTrainingOptions(**(settings | training)),
        "0",
    )
    watch = {} if progress is None else {"progress": progress}
    with nullcontext() if curves else no_curves():
        return train_zone(task, OutputFolder(folder), **watch)


def train_tiny_steps(folder: Path, network: str, n_steps: int, **training: Any) -> None:
    """Train one of either family for some epochs, or portions."""
    if network == "gaia-set":
        train_tiny_zone(folder, portions=n_steps, **training)
    else:
        train_tiny(folder, NETWORKS[network], epochs=n_steps, position_noise_m=0.05, **training)
