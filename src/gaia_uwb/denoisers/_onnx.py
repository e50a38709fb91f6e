"""Trained networks in ONNX Runtime: find a model and start it."""

from __future__ import annotations

import os
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from pydantic import Field

from gaia_uwb._shared import ConfigError
from gaia_uwb.denoisers._base import Options
from gaia_uwb.models import (
    ONNX,
    Model,
    WindowModel,
    ZoneModel,
    find_model,
    read_description,
    read_file,
)

if TYPE_CHECKING:
    import onnxruntime


class TrainedOptions(Options):
    """Options of the trained networks."""

    model: str = Field(default="stress", min_length=1)
    """A model: the name of its training data, if it comes with the package (``stress``,
    ``outdoor-uwb``), or a folder written by ``gaia train``."""


def find_trained(kind: str, model: str, family: type[Model]) -> tuple[Path, Model]:
    """Return a model's folder, and what it is.

    Parameters
    ----------
    kind
        Of the network.
    model
        Like ``TrainedOptions.model``.
    family
        The class of its description.

    Raises
    ------
    ConfigError
        If the model is missing, corrupt or of another kind.
    """
    folder = find_model(kind, model)
    found = read_description(folder)
    if not isinstance(found, family) or found.network.kind != kind:
        raise ConfigError(f"{folder}: expected a model of kind {kind}, got {found.network.kind}")
    return folder, found


def start_network(
    folder: Path, description: WindowModel | ZoneModel, inputs: Mapping[str, int | None]
) -> onnxruntime.InferenceSession:
    """Return a session that runs a model's network; reused while its file stays the same.

    Parameters
    ----------
    folder
        Holds the model's files.
    description
        Of the model.
    inputs
        Names of the network's inputs, each with the length of its last axis; None where any is
        allowed.

    Raises
    ------
    ConfigError
        If the network is missing or corrupt, cannot be run, or has other inputs.
    """
    source = str(folder / ONNX)
    session = _kept_session(read_file(folder, ONNX, description), source)
    found = {part.name: part.shape[-1] for part in session.get_inputs()}
    if found.keys() != inputs.keys() or any(inputs[k] not in (None, found[k]) for k in found):
        raise ConfigError(f"{source}: cannot run this model: expected the inputs {dict(inputs)}")
    return session


@lru_cache(maxsize=8)
def _kept_session(content: bytes, source: str) -> onnxruntime.InferenceSession:
    return start_session(content, source)


def start_session(content: bytes, source: str) -> onnxruntime.InferenceSession:
    """Return a session that runs a network on all processors that this process may use.

    Like other numerical libraries it uses no more than ``OMP_NUM_THREADS``, where that is set.

    Parameters
    ----------
    content
        An ONNX file's.
    source
        What to call it.

    Raises
    ------
    ConfigError
        If it is not an ONNX file, or cannot be run.
    """
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = _n_processors()
    options.log_severity_level = 3
    try:
        return onnxruntime.InferenceSession(content, options, providers=["CPUExecutionProvider"])
    except Exception as error:  # onnxruntime's own classes have no common base but this
        reason = " ".join(str(error).split())
        raise ConfigError(f"{source}: cannot run this model: {reason}") from error


def _n_processors() -> int:
    """Return how many processors this process may use, where the system says so."""
    there = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    allowed = os.environ.get("OMP_NUM_THREADS", "")
    if allowed.isdecimal() and int(allowed):
        return min(there or 1, int(allowed))
    return there or 1
