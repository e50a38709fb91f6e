"""The settings' reference page, from the pydantic models and the docstrings of their fields.

Types, defaults and bounds come from the models; meanings from the strings below the fields, which
are read from the source (as mkdocstrings does), since Python does not keep them; units from
the suffixes of the names (``docs/conventions.md``).
"""

from __future__ import annotations

import functools
import inspect
import types
import typing
from collections.abc import Iterator
from datetime import date, datetime
from enum import Enum
from typing import Any

import griffe
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from gaia_uwb.config import PipelineConfig
from gaia_uwb.logs import InputDescription
from gaia_uwb.simulate import PassConfig
from gaia_uwb.wzdx import FeedConfig

_HEAD = """# Settings

Generated from the settings' own models. Every file is YAML; what it omits keeps its default, and an
unknown key or an impossible value is an error that names the key. A name ends in its
unit ([conventions](../conventions.md)).

"""

_PARTS: list[tuple[str, str, type[BaseModel]]] = [
    (
        "Reconstruction",
        "`gaia reconstruct --config FILE`; in Python `PipelineConfig`. Precedence: the defaults, "
        "then the file, then the command line's options. Each result holds the settings that made "
        "it, as `config.yaml`.",
        PipelineConfig,
    ),
    (
        "A log's description, `gaia.yaml`",
        "Which files hold a drive and how to read them: [inputs](../inputs.md).",
        InputDescription,
    ),
    (
        "Work-zone feeds, `feed.yaml`",
        "`gaia wzdx write --config FILE`: [feeds](../wzdx.md).",
        FeedConfig,
    ),
    (
        "Simulated passes",
        "`gaia simulate --preset FILE`: [the simulator](../simulator.md).",
        PassConfig,
    ),
]

_UNITS = {
    "m": "m", "m2": "m²", "s": "s", "hz": "Hz", "mps": "m/s", "rad": "rad", "deg": "°",
    "dbm": "dBm", "db": "dB", "mph": "mph", "kph": "km/h", "h": "h",
    "m2ps3": "m²/s³",
}  # fmt: skip


def settings_page() -> str:
    """Return the page's Markdown.

    Examples
    --------
    >>> "| `solver.min_ranges` | whole number, 3 to 1,000,000 | `4` |" in settings_page()
    True
    """
    parts = [_HEAD]
    for title, text, model in _PARTS:
        parts.append(f"## {title}\n\n{text}\n\n")
        parts.append("| setting | value | default | unit | meaning |\n|---|---|---|---|---|\n")
        parts += [f"| {' | '.join(row)} |\n" for row in _rows(model, "", {})]
        parts.append("\n")
    return "".join(parts)


def unit_of(name: str) -> str:
    """Return the unit that a setting's name ends in.

    Parameters
    ----------
    name
        Of the setting.

    Examples
    --------
    >>> unit_of("max_gap_s"), unit_of("bias_sigma_m"), unit_of("burst_per_s"), unit_of("gate")
    ('s', 'm', 'per s', '')
    """
    words = name.split("_")
    unit = _UNITS.get(words[-1], "") if len(words) > 1 else ""
    return f"per {unit}" if unit and words[-2] == "per" else unit


def _rows(model: type[BaseModel], prefix: str, seen: dict[type, str]) -> Iterator[list[str]]:
    """Yield a row per setting; those of an inner model follow where it first appears."""
    for name, info in model.model_fields.items():
        path, inner = prefix + name, _inner_models(info.annotation)
        meaning = " ".join(_meaning(model, name).split()).replace("|", "\\|")
        if not inner:
            value = _value(info.annotation, info.metadata)
            yield [f"`{path}`", value, _default(info), unit_of(name), meaning]
            continue
        default = "**required**" if info.is_required() else ""
        what = _container(info.annotation)
        if inner[0] in seen:
            yield [f"`{path}`", f"{what}, like `{seen[inner[0]]}`", default, "", meaning]
            continue
        yield [f"`{path}`", what, default, "", meaning]
        for each in inner:
            mark = _discriminator(each)
            seen[each] = f"{path}[{mark}]" if mark else path
            yield from _rows(each, f"{seen[each]}.", seen)


def _inner_models(annotation: Any) -> list[type[BaseModel]]:
    """Return the models within an annotation."""
    if inspect.isclass(annotation) and issubclass(annotation, BaseModel):
        return [annotation]
    return [model for part in typing.get_args(annotation) for model in _inner_models(part)]


def _container(annotation: Any) -> str:
    """Say whether an annotation holds one model, a list or a mapping of them."""
    if typing.get_origin(annotation) in _CONTAINERS:
        return _CONTAINERS[typing.get_origin(annotation)]
    found = [_container(part) for part in typing.get_args(annotation)]
    return next((word for word in found if word != "section"), "section")


def _discriminator(model: type[BaseModel]) -> str:
    """Return the word that distinguishes a model from its alternatives, as its ``format``."""
    for name in ("format", "kind"):
        info = model.model_fields.get(name)
        if info is not None and typing.get_origin(info.annotation) is typing.Literal:
            words = typing.get_args(info.annotation)
            if len(words) == 1:
                return str(words[0])
    return ""


_NAMES: dict[Any, str] = {
    bool: "true or false", int: "whole number", float: "number", str: "text",
    date: "date", datetime: "date and time",
}  # fmt: skip
_CONTAINERS: dict[Any, str] = {list: "list of sections", dict: "mapping to sections"}


def _value(annotation: Any, metadata: list[Any]) -> str:
    """Say in words what a setting accepts."""
    origin, parts = typing.get_origin(annotation), typing.get_args(annotation)
    if origin is typing.Annotated:
        words = _value(parts[0], [*parts[1:], *metadata])
    elif origin is typing.Literal:
        words = ", ".join(f"`{word}`" for word in parts)
    elif origin in (typing.Union, types.UnionType):
        each = [_value(part, metadata) for part in parts if part is not types.NoneType]
        words = " or ".join(dict.fromkeys(each))
    elif origin in (list, tuple):
        words = f"list of: {_value(parts[0], [])}"
    elif origin is dict:
        words = f"mapping to: {_value(parts[1], [])}"
    elif inspect.isclass(annotation) and issubclass(annotation, Enum):
        words = ", ".join(f"`{member.value}`" for member in annotation)
    else:
        words = _NAMES.get(annotation, str(getattr(annotation, "__name__", annotation)).lower())
        bounds = _bounds(metadata) if annotation in (int, float) else ""
        words += f", {bounds}" if bounds else ""
    return words


def _bounds(metadata: list[Any]) -> str:
    """Say in words between which bounds a number lies."""
    found: dict[str, float] = {}
    for each in metadata:
        for inner in getattr(each, "metadata", [each]):  # a Field within an Annotated holds some
            for key in ("ge", "gt", "le", "lt"):
                if getattr(inner, key, None) is not None:
                    found[key] = getattr(inner, key)
    low = _number(found["ge"]) if "ge" in found else ""
    low = f"above {_number(found['gt'])}" if "gt" in found else low
    high = _number(found["le"]) if "le" in found else ""
    high = f"below {_number(found['lt'])}" if "lt" in found else high
    if low and high:
        return f"{low} to {high}"
    if low:
        return low if "gt" in found else f"at least {low}"
    return high if "lt" in found or not high else f"at most {high}"


def _number(value: float) -> str:
    """Write a bound: whole numbers up to ten millions in full."""
    return f"{value:,.0f}" if value == int(value) and abs(value) < 1e7 else f"{value:g}"


def _default(info: FieldInfo) -> str:
    """Return a setting's default as YAML would have it."""
    if info.is_required():
        return "**required**"
    value = info.get_default(call_default_factory=True)
    if value is None:
        return "none"
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    if isinstance(value, float):
        return f"`{value:g}`"
    return f"`{list(value) if isinstance(value, tuple) else value}`"


def _meaning(model: type[BaseModel], name: str) -> str:
    """Return the string below a field's definition; the model's own where it inherits the field."""
    for owner in model.__mro__:
        if name in getattr(owner, "__annotations__", {}):
            member = _package()[f"{owner.__module__.partition('.')[2]}.{owner.__name__}.{name}"]
            return member.docstring.value if member.docstring else ""
    return ""


@functools.cache
def _package() -> griffe.Object:
    """Read the package's source, without importing it."""
    loaded = griffe.load("gaia_uwb", try_relative_path=False)
    assert isinstance(loaded, griffe.Object)
    return loaded
