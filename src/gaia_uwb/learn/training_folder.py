"""What a training leaves in its folder: the state that it resumes from, its log, and its model.

The state belongs to one task, known by a checksum of all that the result depends on. It is written
completely after every step of the training (an epoch, a portion), so that a killed training loses
at most that step.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor

from gaia_uwb._shared import ConfigError, OutputFolder, figure_png
from gaia_uwb.learn.loss_plots import plot_losses
from gaia_uwb.models import CARD, DESCRIPTION, ONNX, WEIGHTS, Model, model_card, pack, seal, unpack

STATE = "training-state.safetensors"
LOG = "training-log.jsonl"
CURVES = "loss-curves.png"

TRAINING_FILES = (STATE, LOG, CURVES, DESCRIPTION, ONNX, WEIGHTS, CARD)
"""All that a training writes."""
_FORMAT = 2  # of the state


class Means:
    """Means of loss terms over episodes, batch by batch."""

    def __init__(self) -> None:
        self._sums: dict[str, float] = {}
        self._n = 0

    def add(self, terms: Mapping[str, Tensor], n: int) -> None:
        """Add the means of a batch of n episodes."""
        self._n += n
        for name, value in terms.items():
            self._sums[name] = self._sums.get(name, 0.0) + n * value.item()

    def values(self) -> dict[str, float]:
        """Return the mean of every term over all episodes so far."""
        return {name: value / self._n for name, value in self._sums.items()}


@dataclass(frozen=True)
class State:
    """All that the next step of a training depends on.

    Parameters
    ----------
    log
        A line per step that is done.
    weights
        Sets of weights by their names, each a network's ``state_dict``.
    moments
        For each optimiser by its name, the moments of each of its weights.
    """

    log: list[dict[str, Any]]
    weights: dict[str, dict[str, Tensor]]
    moments: dict[str, dict[int, dict[str, Tensor]]]

    def load_optimisers(self, optimisers: Mapping[str, torch.optim.Optimizer]) -> None:
        """Give optimisers their moments; their settings stay.

        Parameters
        ----------
        optimisers
            By the names under which they were written.
        """
        for name, optimiser in optimisers.items():
            groups = optimiser.state_dict()["param_groups"]
            moments = self.moments.get(name, {})
            optimiser.load_state_dict({"state": moments, "param_groups": groups})


def write_state(
    folder: OutputFolder,
    key: str,
    log: Sequence[Mapping[str, Any]],
    weights: Mapping[str, Mapping[str, Tensor]],
    optimisers: Mapping[str, torch.optim.Optimizer],
) -> None:
    """Write the log, and then all that the next step depends on.

    Parameters
    ----------
    folder
        Of the training.
    key
        Checksum of its task.
    log
        A line per step that is done.
    weights
        Sets of weights by their names.
    optimisers
        By names of their own.
    """
    # In this order: whoever is killed in between does the step again and writes the log anew.
    folder.write(LOG, "".join(json.dumps(line) + "\n" for line in log))
    arrays = {
        f"weights.{part}.{name}": value.cpu().numpy()
        for part, tensors in weights.items()
        for name, value in tensors.items()
    }
    for part, optimiser in optimisers.items():
        for index, moments in optimiser.state_dict()["state"].items():
            arrays |= {
                f"moments.{part}.{index}.{name}": value.cpu().numpy()
                for name, value in moments.items()
            }
    note = json.dumps({"format": _FORMAT, "key": key, "log": log}).encode()
    arrays["note"] = np.frombuffer(note, dtype=np.uint8)
    folder.write(STATE, pack(arrays))


def read_state(folder: OutputFolder, key: str) -> State | None:
    """Return the state that an earlier run left; None if there is none.

    Parameters
    ----------
    folder
        Of the training.
    key
        Checksum of its task.

    Raises
    ------
    ConfigError
        If the file is the state of another task, or not a training state.
    """
    path = folder.path / STATE
    if not path.is_file():
        return None
    arrays = unpack(path.read_bytes(), str(path))
    if "note" not in arrays:
        raise ConfigError(f"{path}: not a training state; remove it")
    note = json.loads(arrays.pop("note").tobytes())
    if (note.get("format"), note["key"]) != (_FORMAT, key):
        raise ConfigError(
            f"{path}: belongs to another training (other data, base, sizes, settings or version); "
            "remove it or choose another folder"
        )
    state = State(note["log"], {}, {})
    for place, value in arrays.items():
        kind, part, name = place.split(".", 2)
        tensor = torch.from_numpy(value.copy())
        if kind == "weights":
            state.weights.setdefault(part, {})[name] = tensor
        else:
            index, moment = name.split(".", 1)
            state.moments.setdefault(part, {}).setdefault(int(index), {})[moment] = tensor
    return state


def write_model(
    folder: OutputFolder,
    description: Model,
    weights: Mapping[str, Tensor],
    onnx: bytes,
    log: Sequence[Mapping[str, Any]],
    unit: str,
) -> Model:
    """Write a trained model with all that belongs to it, and return its sealed description.

    Parameters
    ----------
    folder
        Of the training.
    description
        Of the model, without the checksums of its files.
    weights
        Of the network.
    onnx
        The network as ONNX Runtime reads it.
    log
        A line per step of the training.
    unit
        What a step is called.
    """
    packed = pack({name: value.cpu().numpy() for name, value in weights.items()})
    sealed = seal(description, {WEIGHTS: packed, ONNX: onnx})
    folder.write(WEIGHTS, packed)
    folder.write(ONNX, onnx)
    folder.write(CURVES, figure_png(plot_losses(log, unit)))
    folder.write(CARD, model_card(sealed))
    folder.write(DESCRIPTION, sealed.model_dump_json(by_alias=True, indent=2) + "\n")
    return sealed
