"""Train ``gaia-set``: an endless stream of simulated scenes, one readable loop.

After every portion the whole state is written. What a portion does depends only on the seed, its
number and that state, so a training that was killed and started again ends with the same weights
as one that was not, on the same machine and number of threads.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from hashlib import sha256
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from gaia_uwb._shared import ConfigError, OutputFolder
from gaia_uwb.learn.networks import (
    GaiaSet,
    ZoneTargets,
    export_set_onnx,
    place_log_density,
    wrong_side_share,
    zone_losses,
)
from gaia_uwb.learn.training_folder import Means, read_state, write_model, write_state
from gaia_uwb.learn.zone_sets import MIX, ZoneBatch, training_portion, validation_portion
from gaia_uwb.models import GaiaSetOptions, SetModelDescription, SetTrainingOptions

__all__ = ["SetTask", "train_set"]

_LEAST_MATRIX = 16  # rows and columns of the smallest weights between layers; smaller are heads
_MATRIX_DECAY = 0.01
_ELLIPSE_SHARE = 0.9
_CHI2_90 = -2.0 * math.log(1 - _ELLIPSE_SHARE)  # with two degrees of freedom
_CALIBRATED_ON = "wild"
_CALIBRATED_STEPS = (64, 256, 1024)

Progress = Callable[[Iterable[int], int], Iterable[int]]
"""Goes through portions, given how many are done already."""


@dataclass(frozen=True)
class SetTask:
    """What to train, and how.

    Parameters
    ----------
    network
        Sizes.
    training
        How.
    version
        Of the package.
    """

    network: GaiaSetOptions
    training: SetTrainingOptions
    version: str


def train_set(
    task: SetTask,
    folder: OutputFolder,
    *,
    progress: Progress = lambda portions, done: portions,
) -> SetModelDescription:
    """Train a network and write it with all that belongs to it; go on where a run was stopped.

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
    run = _Run(task, folder)
    done = run.resume()
    for portion in progress(range(done, task.training.portions), done):
        run.portion(portion)
    return run.finish()


def _optimisers(
    network: nn.Module, options: SetTrainingOptions
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


class _Run:
    """One training run: network, optimiser, and its files."""

    def __init__(self, task: SetTask, folder: OutputFolder) -> None:
        self.task, self.folder, self.options = task, folder, task.training
        self.device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(self.options.seed)
            self.network = GaiaSet(task.network)
        self.network.to(self.device)
        self.optimisers = _optimisers(self.network, self.options)
        self.validation = {
            kind: validation_portion(kind, self.options.validation_episodes) for kind in MIX
        }
        self.steps = 0
        self.log: list[dict[str, Any]] = []
        self.key = self._key()

    def portion(self, number: int) -> None:
        """Go through new scenes once, validate, and write the state."""
        batches = training_portion(self.options.seed, number, self.options.portion_episodes)
        self.network.train()
        trained, skipped = Means(), 0
        for k, batch in enumerate(batches):
            self._set_rate((number + k / len(batches)) / self.options.portions)
            terms = self._losses(batch)
            self.network.zero_grad(set_to_none=True)
            terms["total"].backward()  # type: ignore[no-untyped-call]
            norm = nn.utils.clip_grad_norm_(self.network.parameters(), self.options.gradient_norm)
            self.steps += 1
            if not bool(torch.isfinite(norm)):  # one degenerate scene must not end a training
                skipped += 1
                continue
            for optimiser in self.optimisers.values():
                optimiser.step()
            trained.add(terms, batch.n_episodes)
        validated = {kind: self._validate(own) for kind, own in self.validation.items()}
        total = float(np.mean([terms["total"] for terms in validated.values()]))
        if not math.isfinite(total):
            raise ConfigError(
                f"{self.folder.path}: the loss is {total} after portion {number}: lower the "
                "learning rate"
            )
        self.log.append(
            {
                "epoch": number,
                "steps": self.steps,
                "skipped_steps": skipped,
                "training": trained.values(),
                "validation": {
                    name: float(np.mean([terms[name] for terms in validated.values()]))
                    for name in validated[next(iter(MIX))]
                },
                "kinds": validated,
            }
        )
        self._write_state()

    def _key(self) -> str:
        """Return a checksum of all that the result depends on, the simulator's scenes as well."""
        description = [
            self.task.network.model_dump_json(), self.options.model_dump_json(), str(MIX)
        ]  # fmt: skip
        digest = sha256("\n".join(description).encode())
        for batch in (batch for own in self.validation.values() for batch in own):
            for values in (*batch.inputs, batch.anchor_m, batch.range_m, batch.nlos):
                digest.update(np.ascontiguousarray(values).tobytes())
        return digest.hexdigest()

    def _set_rate(self, done: float) -> None:
        warm = min(1.0, (self.steps + 1) / max(1, self.options.warm_up_steps))
        share = warm * 0.5 * (1 + math.cos(math.pi * done))
        for optimiser in self.optimisers.values():
            for group in optimiser.param_groups:
                group["lr"] = share * optimiser.defaults["lr"]

    def _losses(self, batch: ZoneBatch) -> dict[str, Tensor]:
        inputs, targets = self._tensors(batch)
        return zone_losses(self.network.predictions(*inputs), inputs[3], targets)

    def _tensors(self, batch: ZoneBatch) -> tuple[list[Tensor], ZoneTargets]:
        inputs = [torch.from_numpy(values).to(self.device) for values in batch.inputs]
        truth = (batch.anchor_m, batch.range_m, batch.nlos)
        targets = (torch.from_numpy(values).float().to(self.device) for values in truth)
        return inputs, ZoneTargets(*targets)

    @torch.no_grad()
    def _validate(self, batches: Sequence[ZoneBatch]) -> dict[str, float]:
        """Return every term's mean over validation scenes, and the share of wrong sides."""
        self.network.eval()
        means = Means()
        for batch in batches:
            inputs, targets = self._tensors(batch)
            predictions = self.network.predictions(*inputs)
            terms = zone_losses(predictions, inputs[3], targets)
            observed = inputs[3].amax(dim=-1)
            terms["wrong_side_share"] = wrong_side_share(predictions[-1], targets.anchor, observed)
            means.add(terms, batch.n_episodes)
        return means.values()

    def _write_state(self) -> None:
        weights = {"network": self.network.state_dict()}
        write_state(self.folder, self.key, self.log, weights, self.optimisers)

    def resume(self) -> int:
        """Take up the state that an earlier run left, and return how many portions are done."""
        state = read_state(self.folder, self.key)
        if state is None:
            return 0
        self.network.load_state_dict(state.weights["network"])
        state.load_optimisers(self.optimisers)
        self.log, self.steps = state.log, state.log[-1]["steps"]
        return len(self.log)

    @torch.no_grad()
    def _variance_scale(self, n_steps: int) -> float:
        """Return what makes 90 % of the 90 % ellipses of validation scenes hold their anchor."""
        self.network.eval()
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
        return float(torch.quantile(torch.cat(squares), _ELLIPSE_SHARE)) / _CHI2_90

    def finish(self) -> SetModelDescription:
        """Write the model with all that belongs to it."""
        self.network.eval().cpu()
        self.device = torch.device("cpu")
        onnx = export_set_onnx(self.network)
        shares = ", ".join(f"{share:.0%} {kind}" for kind, share in MIX.items())
        n_scenes = self.options.portions * self.options.portion_episodes
        description = SetModelDescription(
            schema=1,
            network=self.task.network,
            variance_scales=tuple(
                (steps, round(self._variance_scale(steps), 6)) for steps in _CALIBRATED_STEPS
            ),
            data={
                "source": "sim:mixed",
                "training": f"{n_scenes} scenes, none twice: {shares}; training layouts only",
                "validation": f"{self.options.validation_episodes} scenes of each kind",
            },
            training=self.options,
            metrics={
                f"{kind}_{name}": round(value, 6)
                for kind, terms in self.log[-1]["kinds"].items()
                for name, value in terms.items()
            },
            version=self.task.version,
        )
        weights = self.network.state_dict()
        return write_model(self.folder, description, weights, onnx, self.log)
