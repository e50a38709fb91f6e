"""A trained model as files: written whole, loaded strictly, never unpickled.

=======================  ==========================================================
``model.json``           what it is, with checksums: see ``description.py``
``model.onnx``           the network for ONNX Runtime, dynamic batch and length
``weights.safetensors``  its weights, for further training or inspection
``MODEL_CARD.md``        what it is, what it was trained on, its scores, its limits
=======================  ==========================================================
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from contextlib import suppress
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from gaia_uwb._shared import Array, ConfigError, read_regular
from gaia_uwb.models.description import (
    SCHEMA,
    GaiaSetArchitecture,
    Model,
    ModelDescription,
    WindowModel,
    ZoneModel,
)

DESCRIPTION = "model.json"
ONNX = "model.onnx"
WEIGHTS = "weights.safetensors"
CARD = "MODEL_CARD.md"

_LARGEST_BYTES = 1 << 30  # a larger file is none of ours


def shipped_models() -> dict[str, Path]:
    """Return the folders of the models inside the package, by name (``gaia-stress``)."""
    base = Path(str(files("gaia_uwb") / "models" / "shipped"))
    return {path.parent.name: path.parent for path in sorted(base.glob(f"*/{DESCRIPTION}"))}


def find_model(kind: str, model: str) -> Path:
    """Return the folder of a model.

    Parameters
    ----------
    kind
        Kind of network: ``mlp``, ``pose-mlp``, ``gaia`` or ``gaia-set``.
    model
        The name of its training data, if it comes with the package (``stress``), or a folder
        written by ``gaia train``.

    Raises
    ------
    ConfigError
        If there is neither.

    Examples
    --------
    >>> find_model("gaia", "stress").name
    'gaia-stress'
    """
    shipped = shipped_models()
    if f"{kind}-{model}" in shipped:
        return shipped[f"{kind}-{model}"]
    with suppress(OSError, ValueError):  # a name that no file can have
        if (Path(model) / DESCRIPTION).is_file():
            return Path(model)
    known = [name.removeprefix(f"{kind}-") for name in shipped if name.startswith(f"{kind}-")]
    raise ConfigError(
        f"no {kind} model {model!r}: neither a folder with {DESCRIPTION} nor one of "
        f"{', '.join(known) or 'none'}"
    )


def read_description(folder: Path) -> WindowModel | ZoneModel:
    """Read what a model is.

    Parameters
    ----------
    folder
        Holds the model's files.

    Raises
    ------
    ConfigError
        If it cannot be read, is corrupt, or comes from another version of the format.
    """
    path = folder / DESCRIPTION
    content = _read(path)
    try:
        fields = json.loads(content)
        if isinstance(fields, dict) and fields.get("schema") != SCHEMA:
            raise ConfigError(
                f"{path}: expected a model of schema {SCHEMA}, got {fields.get('schema')!r}"
            )
        description = _family(fields).model_validate_json(content)
    except (ValidationError, ValueError, RecursionError) as error:
        if isinstance(error, ValidationError):
            first = error.errors()[0]
            problem = f"{'.'.join(map(str, first['loc'])) or 'top level'}: {first['msg']}"
        else:
            problem = " ".join(str(error).split())
        raise ConfigError(f"{path}: not a model description: {problem}") from error
    own = description.sha256.get(DESCRIPTION, _checksum(fields))
    if own != _checksum(fields) or set(description.sha256) - {ONNX, WEIGHTS, DESCRIPTION}:
        raise ConfigError(f"{path}: corrupt: its checksum is wrong")
    return description


def _family(fields: Any) -> type[WindowModel] | type[ZoneModel]:
    """Return which description some fields are, by the kind of the network."""
    network = fields.get("network") if isinstance(fields, dict) else None
    kind = network.get("kind") if isinstance(network, dict) else None
    return ZoneModel if kind == GaiaSetArchitecture().kind else WindowModel


def seal(description: Model, contents: Mapping[str, bytes]) -> Model:
    """Return a description with the checksums of the files next to it, and with its own.

    Parameters
    ----------
    description
        Of the model.
    contents
        What :data:`ONNX` and :data:`WEIGHTS` hold.
    """
    sums = {name: hashlib.sha256(content).hexdigest() for name, content in contents.items()}
    fields = json.loads(description.model_dump_json(by_alias=True)) | {"sha256": sums}
    return description.model_copy(update={"sha256": sums | {DESCRIPTION: _checksum(fields)}})


def _checksum(fields: Mapping[str, Any]) -> str:
    """Return the checksum of a description's fields, that checksum itself left out."""
    sums = fields.get("sha256", {})
    others = {name: value for name, value in sums.items() if name != DESCRIPTION}
    content = json.dumps({**fields, "sha256": others}, sort_keys=True)
    return hashlib.sha256(content.encode()).hexdigest()


def read_file(folder: Path, name: str, description: ModelDescription) -> bytes:
    """Read a model's file and check it against its checksum.

    Parameters
    ----------
    folder
        Holds the model's files.
    name
        :data:`ONNX` or :data:`WEIGHTS`.
    description
        Of the model.

    Raises
    ------
    ConfigError
        If it cannot be read, or is not the file that the description belongs to.
    """
    content = _read(folder / name)
    if hashlib.sha256(content).hexdigest() != description.sha256.get(name):
        raise ConfigError(
            f"{folder / name}: corrupt, or not part of this model: its checksum is wrong"
        )
    return content


def read_weights(folder: Path, description: ModelDescription) -> dict[str, Array]:
    """Read a model's weights by name.

    Parameters
    ----------
    folder, description
        Like :func:`read_file`.

    Raises
    ------
    ConfigError
        If they cannot be read or are corrupt.
    """
    return unpack(read_file(folder, WEIGHTS, description), str(folder / WEIGHTS))


def pack(tensors: Mapping[str, Array]) -> bytes:
    """Return arrays as the content of a safetensors file.

    Parameters
    ----------
    tensors
        By name.
    """
    from safetensors.numpy import save

    # An array in another order would be written as it lies in the memory, and come back mixed up.
    return save({name: np.asarray(value, order="C") for name, value in tensors.items()})


def unpack(content: bytes, source: str) -> dict[str, Array]:
    """Return the arrays of a safetensors file.

    Parameters
    ----------
    content
        The file's.
    source
        What to call it.

    Raises
    ------
    ConfigError
        If it is not a safetensors file, or is corrupt.
    """
    from safetensors import SafetensorError
    from safetensors.numpy import load

    try:
        found: dict[str, Array] = load(content)
    except (SafetensorError, ValueError, KeyError, TypeError) as error:
        raise ConfigError(
            f"{source}: not a safetensors file: {' '.join(str(error).split())}"
        ) from error
    return found


def _read(path: Path) -> bytes:
    try:
        return read_regular(path, most_bytes=_LARGEST_BYTES)
    except OSError as error:
        raise ConfigError(f"{path}: cannot read this file: {error.strerror or error}") from error
