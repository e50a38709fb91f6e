"""Plain data of GAIA as bytes and back: arrays and JSON, never code.

The bytes are those of a ``.npz`` file. Its member ``content`` is JSON that names a dataclass with
its fields, and the arrays that these hold; only the dataclasses that are listed here can be read.
The same data give the same bytes.
"""

from __future__ import annotations

import io
import json
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from typing import Any

import numpy as np

from gaia_uwb._shared import Array, InputError
from gaia_uwb.episode import (
    ClockOffset,
    DriveErrors,
    Episode,
    ErrorSizes,
    RangeCalibration,
    RangeReadings,
    ReadingCounts,
)
from gaia_uwb.estimate import Reason, ReasonKind
from gaia_uwb.kept.changes import Stay, Suspicion, Watched
from gaia_uwb.kept.estimates import CommonPrior
from gaia_uwb.kept.scatter import OwnPlaces, ScatterSums
from gaia_uwb.kept.state import Counts, Folded
from gaia_uwb.kept.sums import ZoneSums
from gaia_uwb.locate import DriveBlock, DrivePrior, KeptSizes, Point, SizeSums
from gaia_uwb.scene import ConeRanges, LocalFrame, Tag, Trajectory

FORMAT = 1
"""Of the files; a reader knows its own only."""

_CLASSES: dict[str, Any] = {
    each.__name__: each
    for each in (
        ClockOffset,
        CommonPrior,
        ConeRanges,
        Counts,
        DriveBlock,
        DriveErrors,
        DrivePrior,
        Episode,
        ErrorSizes,
        Folded,
        KeptSizes,
        LocalFrame,
        OwnPlaces,
        Point,
        RangeCalibration,
        RangeReadings,
        ReadingCounts,
        Reason,
        ScatterSums,
        SizeSums,
        Stay,
        Suspicion,
        Tag,
        Trajectory,
        Watched,
        ZoneSums,
    )
}
_ENUMS: dict[str, Any] = {ReasonKind.__name__: ReasonKind}


def to_bytes(content: Any) -> bytes:
    """Return data as bytes.

    Parameters
    ----------
    content
        Numbers, words, arrays, and tuples, lists, mappings with words as keys and known dataclasses
        of these.

    Raises
    ------
    TypeError
        If it holds anything else.

    Examples
    --------
    >>> from_bytes(to_bytes({"place_m": np.array([1.0, 2.0]), "name": "cone-1"}))
    {'place_m': array([1., 2.]), 'name': 'cone-1'}
    """
    arrays: dict[str, Array] = {}
    text = json.dumps({"format": FORMAT, "content": _plain(content, arrays)})
    file = io.BytesIO()
    members: dict[str, Any] = {"content": np.frombuffer(text.encode(), dtype=np.uint8), **arrays}
    np.savez(file, **members)
    return file.getvalue()


def from_bytes(data: bytes, source: str = "data") -> Any:
    """Return the data that :func:`to_bytes` made bytes of.

    Parameters
    ----------
    data
        The bytes.
    source
        What to call them in an error's message.

    Raises
    ------
    InputError
        If they are something else, damaged, or of another format.
    """
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
        tree = json.loads(arrays.pop("content").tobytes())
        found = tree["format"]
        if found == FORMAT:
            return _built(tree["content"], arrays)
    except Exception as error:  # whatever is wrong with a file that is not ours
        raise InputError(f"cannot be read: {error}", source=source) from error
    raise InputError(f"has format {found}, but this program reads {FORMAT}", source=source)


def _plain(value: Any, arrays: dict[str, Array]) -> Any:
    if isinstance(value, Enum):
        return {"enum": type(value).__name__, "value": value.value}
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    if isinstance(value, (np.generic, np.ndarray)):
        return _number(value, arrays)
    if is_dataclass(value) and type(value).__name__ in _CLASSES:
        known = {field.name: getattr(value, field.name) for field in fields(value) if field.init}
        content = {name: _plain(each, arrays) for name, each in known.items()}
        return {"class": type(value).__name__, "fields": content}
    if isinstance(value, (tuple, list)):
        return {type(value).__name__: [_plain(each, arrays) for each in value]}
    if isinstance(value, Mapping):
        return {"mapping": {key: _plain(each, arrays) for key, each in value.items()}}
    raise TypeError(f"cannot be kept: {type(value).__name__}")


def _number(value: np.generic | Array, arrays: dict[str, Array]) -> Any:
    if isinstance(value, np.generic):
        return value.item()
    name = f"a{len(arrays)}"
    arrays[name] = value
    return {"array": name}


def _built(tree: Any, arrays: Mapping[str, Array]) -> Any:
    if not isinstance(tree, dict):
        return tree
    if "array" in tree:
        return arrays[tree["array"]]
    if "enum" in tree:
        return _ENUMS[tree["enum"]](tree["value"])
    if "class" in tree:
        known = {name: _built(each, arrays) for name, each in tree["fields"].items()}
        return _CLASSES[tree["class"]](**known)
    if "mapping" in tree:
        return {key: _built(each, arrays) for key, each in tree["mapping"].items()}
    kind, items = next(iter(tree.items()))
    built = [_built(each, arrays) for each in items]
    return tuple(built) if kind == "tuple" else built
