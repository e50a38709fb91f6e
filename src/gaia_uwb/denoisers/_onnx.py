"""Trained networks in ONNX Runtime: find a model, start it and run it.

A model may be a stranger's. Whatever it does to ONNX Runtime (outputs of other names, types or
shapes, a loop without end, data in other files) becomes one line.
"""

from __future__ import annotations

import os
import re
import threading
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import Field

from gaia_uwb._shared import Array, ConfigError, Float64
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

_LARGEST = 1e12  # of an output: far beyond any, and its square is a number
_SILENT = 4  # of what it logs, only what ends the process
_FOLDER_OF_OTHER_FILES = "session.model_external_initializers_file_folder_path"
# Threads that wait for work in a loop take as much of the processors as half the work itself.
_WAIT_IN_A_LOOP = "session.intra_op.allow_spinning"
_LONGEST_RUN_S = 600.0  # our own networks take seconds
_COLOURS = re.compile(r"\x1b\[[0-9;]*m")


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


class Network:
    """A network that is ready to run.

    Parameters
    ----------
    session
        That runs it.
    source
        What to call it.
    """

    def __init__(self, session: onnxruntime.InferenceSession, source: str) -> None:
        self._session = session
        self._source = source

    def run(
        self, inputs: Mapping[str, Array], shapes: Mapping[str, tuple[int, ...]]
    ) -> dict[str, Float64[Array, "*shape"]]:
        """Return the network's outputs by name.

        Parameters
        ----------
        inputs
            Its inputs by name.
        shapes
            The shape of each output that is wanted.

        Raises
        ------
        ConfigError
            If it cannot be run, takes too long, or an output is of another shape or not of numbers
            that anything can be computed with.
        """
        values = self._values(list(shapes), dict(inputs))
        found = {}
        for (name, shape), value in zip(shapes.items(), values, strict=True):
            if not isinstance(value, np.ndarray) or value.dtype.kind not in "fiu":
                raise self._error(f"output {name}: expected numbers")
            if value.shape != shape:
                raise self._error(f"output {name}: expected the shape {shape}, got {value.shape}")
            found[name] = value.astype(np.float64)
            if not (np.abs(found[name]) < _LARGEST).all():  # nor is NaN
                raise self._error(f"output {name}: expected numbers below {_LARGEST:g}")
        return found

    def _values(self, names: list[str], inputs: dict[str, Array]) -> list[Any]:
        """Run it in a thread of its own: this one can be interrupted, ONNX Runtime cannot."""
        import onnxruntime

        options = onnxruntime.RunOptions()
        options.log_severity_level = _SILENT
        results: list[Any] = []
        errors: list[Exception] = []

        def work() -> None:
            try:
                results.append(self._session.run(names, inputs, options))
            except Exception as error:  # onnxruntime's own classes have no common base but this
                errors.append(error)

        thread = threading.Thread(target=work, daemon=True)
        thread.start()
        try:
            thread.join(_LONGEST_RUN_S)
        finally:
            options.terminate = True  # where it still runs: an interrupt, or a loop without end
        if errors:
            raise self._error(_reason(errors[0])) from errors[0]
        if not results:
            raise self._error(f"no result within {_LONGEST_RUN_S:g} s")
        values: list[Any] = results[0]
        return values

    def _error(self, problem: str) -> ConfigError:
        return ConfigError(f"{self._source}: cannot run this model: {problem}")


def start_network(
    folder: Path, description: WindowModel | ZoneModel, inputs: Mapping[str, int | None]
) -> Network:
    """Return a model's network, ready to run; its session is reused while its file is the same.

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
    found = {part.name: part.shape[-1] if part.shape else 1 for part in session.get_inputs()}
    if found.keys() != inputs.keys() or any(inputs[k] not in (None, found[k]) for k in found):
        raise ConfigError(f"{source}: cannot run this model: expected the inputs {dict(inputs)}")
    return Network(session, source)


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
    options.log_severity_level = _SILENT
    # Weights in other files would be in no checksum: they are looked for where no file can lie.
    options.add_session_config_entry(_FOLDER_OF_OTHER_FILES, os.devnull)
    options.add_session_config_entry(_WAIT_IN_A_LOOP, "0")
    try:
        return onnxruntime.InferenceSession(content, options, providers=["CPUExecutionProvider"])
    except Exception as error:  # onnxruntime's own classes have no common base but this
        raise ConfigError(f"{source}: cannot run this model: {_reason(error)}") from error


def _reason(error: Exception) -> str:
    return " ".join(_COLOURS.sub("", str(error)).split())[:300]


def _n_processors() -> int:
    """Return how many processors this process may use, where the system says so."""
    there = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    allowed = os.environ.get("OMP_NUM_THREADS", "")
    if allowed.isdecimal() and int(allowed):
        return min(there or 1, int(allowed))
    return there or 1
