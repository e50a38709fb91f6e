"""The one loop that trains every network, and goes on where it was stopped.

After every step (an epoch of windows, a portion of new scenes) the whole state is written. What a
step does depends only on the seed, its number and that state, so a training that was killed and
started again ends with the same weights as one that was not, on the same machine and number of
threads.

The paper's networks (``window_training.py``) and ``gaia-set`` (``zone_training.py``) say how they
start, what a step's losses are, how they are validated and what the result is; all else is here.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from hashlib import sha256
from typing import Any, ClassVar, Generic, TypeAlias, TypeVar

import numpy as np
import torch
from torch import Tensor, nn

from gaia_uwb._shared import Array, ConfigError, OutputFolder
from gaia_uwb.learn.training_folder import (
    TRAINING_FILES,
    Means,
    read_state,
    write_model,
    write_state,
)
from gaia_uwb.models import Model

_TORCH_SEED = 1_000_003  # a seed has its own numbers for as many steps

Architecture = TypeVar("Architecture")
Options = TypeVar("Options")

Progress: TypeAlias = Callable[[Iterable[int], str, int], Iterable[int]]
"""Goes through the steps that are left, given the network's kind and how many are done; a progress
bar may stand here."""


def unwatched(steps: Iterable[int], _name: str, _done: int) -> Iterable[int]:
    """Go through the steps and show nothing."""
    return steps


@dataclass(frozen=True)
class Task(Generic[Architecture, Options]):
    """What to train, and how.

    Parameters
    ----------
    network
        Kind and sizes.
    training
        How.
    version
        Of the package.
    """

    network: Architecture
    training: Options
    version: str


class Training(ABC, Generic[Model]):
    """One training: network, optimisers, what was best so far, and its files.

    Parameters
    ----------
    task
        What to do.
    folder
        Where the model, the log of every loss term and the state are written.

    Raises
    ------
    ConfigError
        If the folder holds the state of another task, or a file cannot be written.
    """

    unit: ClassVar[str]
    """What a step is called."""
    length: int
    """Steps of the whole training."""
    patience: int | None = None
    """Steps without a better validation loss after which it ends with the best weights; without, it
    ends with the last."""
    network: nn.Module
    optimisers: dict[str, torch.optim.Optimizer]

    def __init__(self, task: Task[Any, Any], folder: OutputFolder) -> None:
        self.task, self.folder, self.options = task, folder, task.training
        self.device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
        self.log: list[dict[str, Any]] = []
        self._best: dict[str, Tensor] = {}
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(self.options.seed)
            self.start()
        self._key = self._checksum()
        self._resume()

    @abstractmethod
    def start(self) -> None:
        """Make the network, its optimisers and its data on ``device``; torch is seeded."""

    @abstractmethod
    def depends_on(self) -> tuple[list[str], Iterable[Array]]:
        """Return in words and numbers all that the result depends on."""

    @abstractmethod
    def step(self, number: int) -> Iterator[tuple[dict[str, Tensor], int]]:
        """Yield the losses of each batch, ``total`` and its terms, and its number of episodes.

        The weights go down the gradient of each before the next is asked for.
        """

    def noted(self, number: int) -> dict[str, Any]:
        """Return what the log says of a step besides its losses."""
        del number
        return {}

    @abstractmethod
    def validate(self) -> dict[str, Any]:
        """Return every term's mean under ``validation``, and what the log says beside it."""

    @abstractmethod
    def describe(self, line: dict[str, Any]) -> Model:
        """Return what the model is, given the log's line of the weights that it ended with."""

    @abstractmethod
    def export(self) -> bytes:
        """Return the network as ONNX."""

    def run(self, progress: Progress) -> Model:
        """Train to the end, and write the model with all that belongs to it.

        Parameters
        ----------
        progress
            Goes through the steps that are left.

        Raises
        ------
        ConfigError
            If the loss grows beyond all numbers, or a file cannot be written.
        """
        self.folder.claim(TRAINING_FILES)
        done = self.length if self._finished else len(self.log)
        for number in progress(range(done, self.length), self.task.network.kind, done):
            self._step(number)
            if self._finished:
                break
        return self._finish()

    def set_rates(self, share: float) -> None:
        """Set every learning rate to a share of what the options say."""
        for optimiser in self.optimisers.values():
            for group in optimiser.param_groups:
                group["lr"] = share * optimiser.defaults["lr"]

    @property
    def _chosen(self) -> int:
        """The step after which the weights were those that count."""
        if self.patience is None:
            return len(self.log) - 1
        return int(np.argmin([line["validation"]["total"] for line in self.log]))

    @property
    def _finished(self) -> bool:
        """Whether nothing has improved for so long that it is time to stop."""
        if self.patience is None or not self.log:
            return False
        return len(self.log) - 1 - self._chosen >= self.patience

    def _step(self, number: int) -> None:
        """Go through the batches of a step, validate, and write the state."""
        self.network.train()
        trained, skipped = Means(), 0
        with torch.random.fork_rng():
            torch.manual_seed(_TORCH_SEED * self.options.seed + number)
            for terms, n in self.step(number):
                if self._descend(terms["total"]):
                    trained.add(terms, n)
                else:
                    skipped += 1
        self.network.eval()
        with torch.no_grad():
            validated = self.validate()
        total = validated["validation"]["total"]
        if not math.isfinite(total):
            raise ConfigError(
                f"{self.folder.path}: the loss is {total} after {self.unit} {number}; lower the "
                "learning rate"
            )
        left_out = {"skipped_steps": skipped} if skipped else {}
        line = {"epoch": number} | self.noted(number) | left_out | {"training": trained.values()}
        self.log.append(line | validated)
        if self.patience is not None and self._chosen == number:
            weights = self.network.state_dict()
            self._best = {name: value.detach().clone() for name, value in weights.items()}
        parts = {"network": self.network.state_dict(), "best": self._best}
        write_state(self.folder, self._key, self.log, parts, self.optimisers)

    def _descend(self, total: Tensor) -> bool:
        """Move the weights down a loss; not where one degenerate scene would end the training."""
        self.network.zero_grad(set_to_none=True)
        total.backward()  # type: ignore[no-untyped-call]
        norm = nn.utils.clip_grad_norm_(self.network.parameters(), self.options.gradient_norm)
        finite = bool(torch.isfinite(norm))
        if finite:
            for optimiser in self.optimisers.values():
                optimiser.step()
        return finite

    def _checksum(self) -> str:
        """Return a checksum of all that the result depends on."""
        words, numbers = self.depends_on()
        digest = sha256("\n".join(words).encode())
        for values in numbers:
            digest.update(np.ascontiguousarray(values).tobytes())
        return digest.hexdigest()

    def _resume(self) -> None:
        """Take up the state that an earlier run left."""
        state = read_state(self.folder, self._key)
        if state is None:
            return
        self.network.load_state_dict(state.weights["network"])
        best = state.weights.get("best", {})
        self._best = {name: value.to(self.device) for name, value in best.items()}
        state.load_optimisers(self.optimisers)
        self.log = state.log

    def _finish(self) -> Model:
        """Write the model with all that belongs to it."""
        self.device = torch.device("cpu")
        if self._best:
            self.network.load_state_dict(self._best)
        self.network.eval().to(self.device)
        with torch.no_grad():
            description = self.describe(self.log[self._chosen])
        weights = self.network.state_dict()
        return write_model(self.folder, description, weights, self.export(), self.log, self.unit)
