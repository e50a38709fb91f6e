"""Train ``gaia-set``: an endless stream of simulated scenes, every portion a new one."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, ClassVar, TypeAlias

import numpy as np
import torch
from torch import Tensor, nn

from gaia_uwb._shared import CHI_SQUARE_90, Array, OutputFolder
from gaia_uwb.learn.loop import Progress, Task, Training, unwatched
from gaia_uwb.learn.networks import (
    GaiaSet,
    ZoneTargets,
    export_zone,
    place_log_density,
    wrong_side_share,
    zone_loss_terms,
)
from gaia_uwb.learn.training_folder import Means
from gaia_uwb.learn.zone_sets import MIX, ZoneBatch, training_portion, validation_portion
from gaia_uwb.models import GaiaSetArchitecture, ZoneModel, ZoneTrainingOptions

__all__ = ["ZoneTask", "train_zone"]

_LEAST_MATRIX = 16  # rows and columns of the smallest weights between layers; smaller are heads
_MATRIX_DECAY = 0.01
_CALIBRATED_ON = "wild"
_CALIBRATED_STEPS = (64, 256, 1024)

ZoneTask: TypeAlias = Task[GaiaSetArchitecture, ZoneTrainingOptions]


def train_zone(
    task: ZoneTask, folder: OutputFolder, *, progress: Progress = unwatched
) -> ZoneModel:
    """Train a network and write it with all that belongs to it; resume where a run was stopped.

    Parameters
    ----------
    task
        What to do.
    folder
        Where the model, the log of every loss term and the state are written.
    progress
        A progress bar may stand here.

    Raises
    ------
    ConfigError
        If the folder holds the state of another task, the loss grows beyond all numbers, or a file
        cannot be written.
    """
    return _ZoneTraining(task, folder).run(progress)


def _optimisers(
    network: nn.Module, options: ZoneTrainingOptions
) -> dict[str, torch.optim.Optimizer]:
    """Return the optimiser of the matrices between layers, and AdamW for all other weights.

    Muon moves all directions of a matrix alike (K. Jordan et al., 2024), and needs far fewer scenes
    to get as far (docs/design-notes.md).
    """
    matrices: list[nn.Parameter] = []
    others: list[nn.Parameter] = []
    for weights in network.parameters():
        between = weights.ndim == 2 and min(weights.shape) >= _LEAST_MATRIX
        apart = between and options.matrix_optimiser == "muon"
        (matrices if apart else others).append(weights)
    optimisers: dict[str, torch.optim.Optimizer] = {
        "adamw": torch.optim.AdamW(
            others, lr=options.learning_rate, weight_decay=options.weight_decay
        )
    }
    if matrices:
        optimisers["muon"] = torch.optim.Muon(
            matrices,
            lr=options.matrix_learning_rate,
            weight_decay=_MATRIX_DECAY,
            adjust_lr_fn="match_rms_adamw",
        )
    return optimisers


class _ZoneTraining(Training[ZoneModel]):
    """The training of a ``gaia-set``; it ends with the last weights."""

    unit: ClassVar[str] = "portion"
    task: ZoneTask
    options: ZoneTrainingOptions
    network: GaiaSet

    def start(self) -> None:
        self.length = self.options.portions
        self.network = GaiaSet(self.task.network)
        self.network.to(self.device)
        self.optimisers = _optimisers(self.network, self.options)
        self.validation = {
            kind: validation_portion(kind, self.options.validation_episodes) for kind in MIX
        }
        self.n_batches = 0

    def depends_on(self) -> tuple[list[str], Iterable[Array]]:
        words = [self.task.network.model_dump_json(), self.options.model_dump_json(), str(MIX)]
        batches = (batch for own in self.validation.values() for batch in own)
        return words, (
            values
            for batch in batches
            for values in (*batch.inputs, batch.anchor_m, batch.range_m, batch.nlos)
        )

    def step(self, number: int) -> Iterator[tuple[dict[str, Tensor], int]]:
        batches = training_portion(self.options.seed, number, self.options.portion_episodes)
        self.n_batches = self.log[-1]["steps"] if self.log else 0
        for k, batch in enumerate(batches):
            self.n_batches += 1
            warm = min(1.0, self.n_batches / max(1, self.options.warm_up_steps))
            done = (number + k / len(batches)) / self.options.portions
            self.set_rates(warm * 0.5 * (1 + math.cos(math.pi * done)))
            inputs, targets = self._tensors(batch)
            terms = zone_loss_terms(self.network.predictions(*inputs), inputs[3], targets)
            yield terms, batch.n_episodes

    def noted(self, number: int) -> dict[str, Any]:
        del number
        return {"steps": self.n_batches, "skipped_steps": 0}

    def _tensors(self, batch: ZoneBatch) -> tuple[list[Tensor], ZoneTargets]:
        inputs = [torch.from_numpy(values).to(self.device) for values in batch.inputs]
        truth = (batch.anchor_m, batch.range_m, batch.nlos)
        targets = (torch.from_numpy(values).float().to(self.device) for values in truth)
        return inputs, ZoneTargets(*targets)

    def validate(self) -> dict[str, Any]:
        kinds = {kind: self._means(batches) for kind, batches in self.validation.items()}
        return {
            "validation": {
                name: float(np.mean([terms[name] for terms in kinds.values()]))
                for name in kinds[next(iter(MIX))]
            },
            "kinds": kinds,
        }

    def _means(self, batches: Sequence[ZoneBatch]) -> dict[str, float]:
        """Return every term's mean over validation scenes, and the share of wrong sides."""
        means = Means()
        for batch in batches:
            inputs, targets = self._tensors(batch)
            predictions = self.network.predictions(*inputs)
            terms = zone_loss_terms(predictions, inputs[3], targets)
            observed = inputs[3].amax(dim=-1)
            terms["wrong_side_share"] = wrong_side_share(predictions[-1], targets.anchor, observed)
            means.add(terms, batch.n_episodes)
        return means.values()

    def _variance_scale(self, n_steps: int) -> float:
        """Return what makes 90 % of the 90 % ellipses of validation scenes hold their anchor."""
        squares = []
        for batch in validation_portion(_CALIBRATED_ON, self.options.validation_episodes, n_steps):
            inputs, targets = self._tensors(batch)
            prediction = self.network(*inputs)
            # The place that explains the anchor better: an ellipse is right given the side.
            density = place_log_density(prediction, targets.anchor)
            off = targets.anchor.unsqueeze(2) - prediction.place
            aa, al, ll = prediction.information.unbind(-1)
            square = aa * off[..., 0] ** 2 + 2 * al * off[..., 0] * off[..., 1]
            square = square + ll * off[..., 1] ** 2
            better = square.gather(-1, density.argmax(dim=-1, keepdim=True)).squeeze(-1)
            squares.append(better[inputs[3].amax(dim=-1) > 0])
        return float(torch.quantile(torch.cat(squares), 0.9)) / CHI_SQUARE_90

    def describe(self, line: dict[str, Any]) -> ZoneModel:
        shares = ", ".join(f"{share:.0%} {kind}" for kind, share in MIX.items())
        n_scenes = self.options.portions * self.options.portion_episodes
        return ZoneModel(
            schema=1,
            network=self.task.network,
            variance_scales=tuple(
                (steps, round(self._variance_scale(steps), 6)) for steps in _CALIBRATED_STEPS
            ),
            data={
                "source": "sim:mixed",
                "training": f"{n_scenes} scenes, none used twice: {shares}; training layouts only",
                "validation": f"{self.options.validation_episodes} scenes of each kind",
            },
            training=self.options,
            metrics={
                f"{kind}_{name}": round(value, 6)
                for kind, terms in line["kinds"].items()
                for name, value in terms.items()
            },
            version=self.task.version,
        )

    def export(self) -> bytes:
        return export_zone(self.network)
