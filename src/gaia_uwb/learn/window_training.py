"""Train a network: one loop, which can be stopped at any time and goes on where it was.

After every epoch the whole state is written; what an epoch does depends only on the seed, its
number and that state. So a run that was killed and started again ends with the same weights as one
that was not, on the same machine and number of threads.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from gaia_uwb._shared import ConfigError, InputError, OutputFolder
from gaia_uwb.episode import Episode
from gaia_uwb.learn.networks import Batch, Gaia, export_onnx, loss_terms, make_network, varied
from gaia_uwb.learn.training_folder import Means, read_state, write_model, write_state
from gaia_uwb.learn.window_sets import LearningSets
from gaia_uwb.models import (
    Domain,
    GaiaOptions,
    ModelDescription,
    NetworkOptions,
    Normalisation,
    PoseMlpOptions,
    TrainingOptions,
    make_features,
    make_targets,
    per_step,
    plausible_correction_m,
    read_description,
    read_weights,
)

BASE = "base"
"""Sub-folder of the PoseMLP that ``gaia`` was built on."""

_EVALUATION_BATCH = 512
_TORCH_SEED = 1_000_003  # a seed has its own numbers for as many epochs

Progress = Callable[[Iterable[int], str, int], Iterable[int]]
"""Goes through epochs, given what they are called and how many are done already."""


@dataclass(frozen=True)
class Task:
    """What to train, on what, and how.

    Parameters
    ----------
    network
        Kind and sizes.
    training
        How.
    sets
        On what.
    version
        Of the package.
    """

    network: NetworkOptions
    training: TrainingOptions
    sets: LearningSets
    version: str


def train(
    task: Task,
    folder: OutputFolder,
    *,
    base: Path | None = None,
    progress: Progress = lambda epochs, name, done: epochs,
) -> ModelDescription:
    """Train a network and write it with all that belongs to it; go on where a run was stopped.

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
        raise InputError("expected episodes to train and to validate on, got none")
    base_weights: Mapping[str, Tensor] = {}
    if isinstance(task.network, GaiaOptions):
        base_weights = _base(task, task.network, folder, base, progress)
    run = _Run(task, folder, base_weights)
    done = run.resume()
    for epoch in progress(range(done, task.training.epochs), task.network.kind, done):
        run.epoch(epoch)
        if run.finished:
            break
    return run.finish()


def base_task(task: Task, network: GaiaOptions) -> Task:
    """Return the task of training the PoseMLP that a ``gaia`` is built on.

    Parameters
    ----------
    task
        The task of training ``gaia``.
    network
        Its network.
    """
    options = PoseMlpOptions(hidden=network.base_hidden)
    training = per_step(task.training)
    return Task(options, training, task.sets, task.version)


def _base(
    task: Task, network: GaiaOptions, folder: OutputFolder, base: Path | None, progress: Progress
) -> dict[str, Tensor]:
    """Return the base's weights; train it first if there is none."""
    if base is None:
        base = folder.path / BASE
        train(base_task(task, network), OutputFolder(base), progress=progress)
    found = read_description(base)
    expected = PoseMlpOptions(hidden=network.base_hidden)
    if found.network != expected:
        raise ConfigError(f"{base}: expected {expected!r} as the base, got {found.network!r}")
    if found.n_anchors != _n_channels(task.sets):
        raise ConfigError(
            f"{base}: expected a base with channels for {_n_channels(task.sets)} anchors, got "
            f"{found.n_anchors}"
        )
    if found.normalisation != Normalisation.fit(task.sets.training):
        raise ConfigError(f"{base}: the base was trained with another normalisation")
    weights = read_weights(base, found)
    return {name: torch.from_numpy(value) for name, value in weights.items()}


def _n_channels(sets: LearningSets) -> int:
    """Return how many anchors a network for these episodes has channels for."""
    return max(episode.n_anchors for episode in (*sets.training, *sets.validation))


class _Run:
    """One training run: network, optimiser, what was best so far, and its files."""

    def __init__(self, task: Task, folder: OutputFolder, base: Mapping[str, Tensor]) -> None:
        self.task, self.folder = task, folder
        self.options = task.training
        self.n_anchors = _n_channels(task.sets)
        self.normalisation = Normalisation.fit(task.sets.training)
        self.device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(self.options.seed)
            self.network = make_network(self.n_anchors, task.network)
        if base:
            self.network.get_submodule("base").load_state_dict(base)
        self.network.to(self.device)
        trained = [weights for weights in self.network.parameters() if weights.requires_grad]
        self.optimiser = torch.optim.AdamW(
            trained, lr=self.options.learning_rate, weight_decay=self.options.weight_decay
        )
        self.training = self._batch(task.sets.training)
        self.validation = self._batch(task.sets.validation)
        if isinstance(self.network, Gaia):
            true_distance = self.training.range_m / self.normalisation.scale_m
            self.network.standardise(*self.training[:3], true_distance, self.training.anchor)
        self.key = self._key(base)
        self.best_loss, self.best_epoch = math.inf, -1
        self.best: dict[str, Tensor] = {}
        self.log: list[dict[str, Any]] = []

    @property
    def finished(self) -> bool:
        """Whether nothing has improved for so long that it is time to stop."""
        return len(self.log) - 1 - self.best_epoch >= self.options.patience

    def epoch(self, epoch: int) -> None:
        """Go through the training data once, validate, and write the state."""
        rate = (
            self.options.learning_rate * 0.5 * (1 + math.cos(math.pi * epoch / self.options.epochs))
        )
        for group in self.optimiser.param_groups:
            group["lr"] = rate
        with torch.random.fork_rng():
            torch.manual_seed(_TORCH_SEED * self.options.seed + epoch)
            trained = self._train(epoch)
        validated = self._validate()
        if not math.isfinite(validated["total"]):
            raise ConfigError(
                f"{self.folder.path}: the loss is {validated['total']} after epoch {epoch}: lower "
                "the learning rate"
            )
        self.log.append(
            {"epoch": epoch, "learning_rate": rate, "training": trained, "validation": validated}
        )
        if validated["total"] < self.best_loss:
            self.best_loss, self.best_epoch = validated["total"], epoch
            self.best = {
                name: value.detach().clone() for name, value in self.network.state_dict().items()
            }
        self._write_state()

    def _train(self, epoch: int) -> dict[str, float]:
        """Go through the training data once; return every term's mean over the episodes."""
        self.network.train()
        rng = np.random.default_rng([self.options.seed, epoch])
        order = rng.permutation(len(self.task.sets.training))
        means = Means()
        for start in range(0, len(order), self.options.batch_size):
            chosen = torch.from_numpy(order[start : start + self.options.batch_size])
            batch = Batch(*(part[chosen] for part in self.training))
            batch = varied(batch, rng, self.normalisation.scale_m, self.options)
            terms = loss_terms(
                self.network(*batch[:4]), batch, self.normalisation.scale_m, self.options
            )
            self.optimiser.zero_grad(set_to_none=True)
            terms["total"].backward()  # type: ignore[no-untyped-call]
            nn.utils.clip_grad_norm_(self.network.parameters(), self.options.gradient_norm)
            self.optimiser.step()
            means.add(terms, len(chosen))
        return means.values()

    @torch.no_grad()
    def _validate(self) -> dict[str, float]:
        """Return every term's mean over the validation data, and the mean squared range error."""
        self.network.eval()
        means = Means()
        for start in range(0, len(self.task.sets.validation), _EVALUATION_BATCH):
            batch = Batch(*(part[start : start + _EVALUATION_BATCH] for part in self.validation))
            prediction = self.network(*batch[:4])
            scale_m = self.normalisation.scale_m
            terms = loss_terms(prediction, batch, scale_m, self.options)
            square_m2 = (prediction.distance * scale_m - batch.range_m).square() * batch.mask
            count = batch.mask.sum(dim=(1, 2)).clamp_min(1)
            terms["distance_mse_overall"] = (square_m2.sum(dim=(1, 2)) / count).mean()
            means.add(terms, len(count))
        return means.values()

    def _batch(self, episodes: Sequence[Episode]) -> Batch:
        """Return episodes as tensors on the device."""
        features = make_features(episodes, self.n_anchors, self.normalisation)
        targets = make_targets(episodes, self.n_anchors, self.normalisation)
        return Batch(*(torch.from_numpy(part).to(self.device) for part in (*features, *targets)))

    def _key(self, base: Mapping[str, Tensor]) -> str:
        """Return a checksum of all that the result depends on."""
        parts = [
            self.task.network.model_dump_json(),
            self.options.model_dump_json(),
            json.dumps(self.task.sets.description, sort_keys=True),
        ]
        digest = sha256("\n".join(parts).encode())
        for part in (*self.training, *self.validation, *(base[name] for name in sorted(base))):
            digest.update(part.cpu().numpy().tobytes())
        return digest.hexdigest()

    def _write_state(self) -> None:
        weights = {"network": self.network.state_dict(), "best": self.best}
        write_state(self.folder, self.key, self.log, weights, {"adamw": self.optimiser})

    def resume(self) -> int:
        """Take up the state that an earlier run left, and return how many epochs are done."""
        state = read_state(self.folder, self.key)
        if state is None:
            return 0
        self.network.load_state_dict(state.weights["network"])
        self.best = {name: value.to(self.device) for name, value in state.weights["best"].items()}
        state.load_optimisers({"adamw": self.optimiser})
        self.log = state.log
        losses = [line["validation"]["total"] for line in self.log]
        self.best_epoch = int(np.argmin(losses))
        self.best_loss = losses[self.best_epoch]
        return self.options.epochs if self.finished else len(self.log)

    def _plausible_correction_m(self) -> float | None:
        network = self.task.network
        if isinstance(network, GaiaOptions) and network.layout_head:
            return plausible_correction_m(self.task.sets.training)
        return None

    def finish(self) -> ModelDescription:
        """Write the best model with all that belongs to it."""
        self.network.load_state_dict(self.best)
        self.network.eval().cpu()
        metrics = self.log[self.best_epoch]["validation"]
        description = ModelDescription(
            schema=1,
            network=self.task.network,
            n_anchors=self.n_anchors,
            window_steps=self.task.sets.training[0].n_steps,
            normalisation=self.normalisation,
            domain=Domain.of(self.task.sets.training),
            sigma_m=math.sqrt(metrics["distance_mse_overall"]),
            plausible_correction_m=self._plausible_correction_m(),
            data=self.task.sets.description,
            training=self.options,
            metrics={f"validation_{name}": round(value, 6) for name, value in metrics.items()}
            | {"epochs": float(len(self.log)), "best_epoch": float(self.best_epoch)},
            version=self.task.version,
        )
        onnx = export_onnx(self.network, self.n_anchors)
        return write_model(self.folder, description, self.best, onnx, self.log)
