"""Train one of the paper's networks on windows: the same ones in every epoch."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import torch
from torch import Tensor

from gaia_uwb._shared import Array, ConfigError, InputError, OutputFolder
from gaia_uwb.episode import Episode
from gaia_uwb.learn.loop import Progress, Task, Training, unwatched
from gaia_uwb.learn.networks import (
    Gaia,
    WindowBatch,
    export_window,
    make_network,
    varied,
    window_loss_terms,
)
from gaia_uwb.learn.training_folder import Means
from gaia_uwb.learn.window_sets import WindowSets
from gaia_uwb.models import (
    Domain,
    GaiaArchitecture,
    Normalisation,
    PoseMlpArchitecture,
    WindowArchitecture,
    WindowModel,
    WindowTrainingOptions,
    base_training,
    make_window_inputs,
    plausible_correction_m,
    read_description,
    read_weights,
    window_targets,
)

BASE = "base"
"""Sub-folder of the PoseMLP that ``gaia`` was built on."""

_EVALUATION_BATCH = 512


@dataclass(frozen=True)
class WindowTask(Task[WindowArchitecture, WindowTrainingOptions]):
    """What to train, how, and on what.

    Parameters
    ----------
    network, training, version
        Like those of :class:`gaia_uwb.learn.loop.Task`.
    sets
        On what.
    """

    sets: WindowSets


def train_window(
    task: WindowTask,
    folder: OutputFolder,
    *,
    base: Path | None = None,
    progress: Progress = unwatched,
) -> WindowModel:
    """Train a network and write it with all that belongs to it; resume where a run was stopped.

    Parameters
    ----------
    task
        What to do.
    folder
        Where the model, the log of every loss term and the state are written.
    base
        For ``gaia``: folder of a trained ``pose-mlp`` with the same channels and normalisation.
        Without, one is trained first, in the sub-folder ``base``.
    progress
        A progress bar may stand here.

    Raises
    ------
    ConfigError
        If the folder holds the state of another task, the base does not fit, the loss grows beyond
        all numbers, or a file cannot be written.
    InputError
        If there are no episodes, or they have no ranges or no truth.
    """
    if not task.sets.training or not task.sets.validation:
        raise InputError("expected training and validation episodes, got none")
    weights: Mapping[str, Tensor] = {}
    if isinstance(task.network, GaiaArchitecture):
        if base is None:
            base = folder.path / BASE
            train_window(base_task(task, task.network), OutputFolder(base), progress=progress)
        weights = _base_weights(base, task.network, task.sets)
    return _WindowTraining(task, folder, weights).run(progress)


def base_task(task: WindowTask, network: GaiaArchitecture) -> WindowTask:
    """Return the task of training the PoseMLP that a ``gaia`` is built on.

    Parameters
    ----------
    task
        The task of training ``gaia``.
    network
        Its network.
    """
    base = PoseMlpArchitecture(hidden=network.base_hidden)
    return WindowTask(base, base_training(task.training), task.version, task.sets)


def _base_weights(base: Path, network: GaiaArchitecture, sets: WindowSets) -> dict[str, Tensor]:
    """Return the base's weights, if it fits."""
    found = read_description(base)
    expected, n_anchors = PoseMlpArchitecture(hidden=network.base_hidden), _n_channels(sets)
    if not isinstance(found, WindowModel) or found.network != expected:
        raise ConfigError(f"{base}: expected {expected!r} as the base, got {found.network!r}")
    if found.n_anchors != n_anchors:
        raise ConfigError(
            f"{base}: expected a base with channels for {n_anchors} anchors, got {found.n_anchors}"
        )
    if found.normalisation != Normalisation.fit(sets.training):
        raise ConfigError(f"{base}: the base was trained with a different normalisation")
    weights = read_weights(base, found)
    return {name: torch.from_numpy(value) for name, value in weights.items()}


def _n_channels(sets: WindowSets) -> int:
    """Return how many anchors a network for these episodes has channels for."""
    return max(episode.n_anchors for episode in (*sets.training, *sets.validation))


class _WindowTraining(Training[WindowModel]):
    """The training of one of the paper's networks, from the weights of its base, if it has one."""

    unit: ClassVar[str] = "epoch"
    task: WindowTask
    options: WindowTrainingOptions

    def __init__(self, task: WindowTask, folder: OutputFolder, base: Mapping[str, Tensor]) -> None:
        self.base = base
        super().__init__(task, folder)

    def start(self) -> None:
        sets = self.task.sets
        self.length, self.patience = self.options.epochs, self.options.patience
        self.n_anchors = _n_channels(sets)
        self.normalisation = Normalisation.fit(sets.training)
        self.network = make_network(self.n_anchors, self.task.network)
        if self.base:
            self.network.get_submodule("base").load_state_dict(self.base)
        self.network.to(self.device)
        trained = [weights for weights in self.network.parameters() if weights.requires_grad]
        rate, decay = self.options.learning_rate, self.options.weight_decay
        self.optimisers = {"adamw": torch.optim.AdamW(trained, lr=rate, weight_decay=decay)}
        self.training = self._batch(sets.training)
        self.validation = self._batch(sets.validation)
        if isinstance(self.network, Gaia):
            true_distance = self.training.range_m / self.normalisation.scale_m
            self.network.standardise(*self.training[:3], true_distance, self.training.anchor)

    def _batch(self, episodes: Sequence[Episode]) -> WindowBatch:
        """Return episodes as tensors on the device."""
        inputs = make_window_inputs(episodes, self.n_anchors, self.normalisation)
        targets = window_targets(episodes, self.n_anchors, self.normalisation)
        parts = (torch.from_numpy(part).to(self.device) for part in (*inputs, *targets))
        return WindowBatch(*parts)

    def depends_on(self) -> tuple[list[str], Iterable[Array]]:
        words = [
            self.task.network.model_dump_json(),
            self.options.model_dump_json(),
            json.dumps(self.task.sets.description, sort_keys=True),
        ]
        base = (self.base[name] for name in sorted(self.base))
        return words, (part.cpu().numpy() for part in (*self.training, *self.validation, *base))

    def step(self, number: int) -> Iterator[tuple[dict[str, Tensor], int]]:
        self.set_rates(self._share(number))
        rng = np.random.default_rng([self.options.seed, number])
        order = rng.permutation(len(self.task.sets.training))
        for start in range(0, len(order), self.options.batch_size):
            chosen = torch.from_numpy(order[start : start + self.options.batch_size])
            batch = WindowBatch(*(part[chosen] for part in self.training))
            batch = varied(batch, rng, self.normalisation.scale_m, self.options)
            prediction = self.network(*batch[:4])
            terms = window_loss_terms(prediction, batch, self.normalisation.scale_m, self.options)
            yield terms, len(chosen)

    def _share(self, epoch: int) -> float:
        """Return which share of the learning rate an epoch has: half a cosine."""
        return 0.5 * (1 + math.cos(math.pi * epoch / self.options.epochs))

    def noted(self, number: int) -> dict[str, Any]:
        return {"learning_rate": self.options.learning_rate * self._share(number)}

    def validate(self) -> dict[str, Any]:
        means, scale_m = Means(), self.normalisation.scale_m
        for start in range(0, len(self.task.sets.validation), _EVALUATION_BATCH):
            chosen = slice(start, start + _EVALUATION_BATCH)
            batch = WindowBatch(*(part[chosen] for part in self.validation))
            prediction = self.network(*batch[:4])
            terms = window_loss_terms(prediction, batch, scale_m, self.options)
            square_m2 = (prediction.distance * scale_m - batch.range_m).square() * batch.mask
            count = batch.mask.sum(dim=(1, 2)).clamp_min(1)
            terms["distance_mse_overall"] = (square_m2.sum(dim=(1, 2)) / count).mean()
            means.add(terms, len(count))
        return {"validation": means.values()}

    def describe(self, line: dict[str, Any]) -> WindowModel:
        network, sets, metrics = self.task.network, self.task.sets, line["validation"]
        placed = isinstance(network, GaiaArchitecture) and network.layout_head
        return WindowModel(
            schema=1,
            network=network,
            n_anchors=self.n_anchors,
            window_steps=sets.training[0].n_steps,
            normalisation=self.normalisation,
            domain=Domain.of(sets.training),
            sigma_m=math.sqrt(metrics["distance_mse_overall"]),
            plausible_correction_m=plausible_correction_m(sets.training) if placed else None,
            data=sets.description,
            training=self.options,
            metrics={f"validation_{name}": round(value, 6) for name, value in metrics.items()}
            | {"epochs": float(len(self.log)), "best_epoch": float(line["epoch"])},
            version=self.task.version,
        )

    def export(self) -> bytes:
        return export_window(self.network, self.n_anchors)
