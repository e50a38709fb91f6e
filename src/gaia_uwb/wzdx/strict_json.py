"""Read JSON from anybody: strictly, and bounded in size and depth.

Python's own reader takes NaN, lets the last of two equal keys win, and has no limit on
size. A feed that relies on any of that is read differently by every reader.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NoReturn

from gaia_uwb._shared import InputError, open_regular, shown

LARGEST_BYTES = 25_000_000
"""A larger file is refused: parsed, JSON may take thirty times its size."""
DEEPEST = 50
"""Levels of nested lists and objects; a feed has about ten."""
_LONGEST_NUMBER = 300  # digits; such a number still is a float


def read_json(path: Path) -> Any:
    """Read a JSON file.

    Parameters
    ----------
    path
        A regular file of at most :data:`LARGEST_BYTES`.

    Raises
    ------
    InputError
        If it cannot be read, is too large or nested too deeply, is not UTF-8 or not JSON, repeats a
        key in an object, or holds NaN or a number that is not finite.
    """
    try:
        with open_regular(path) as file:
            content = file.read(LARGEST_BYTES + 1)
    except OSError as error:
        reason = error.strerror or str(error)
        raise InputError(f"cannot read this file: {reason}", source=path) from error
    if len(content) > LARGEST_BYTES:
        raise InputError(f"larger than {LARGEST_BYTES // 10**6} MB", source=path)
    try:
        return parse_json(content)
    except ValueError as error:
        raise InputError(f"not usable JSON: {error}", source=path) from error


def parse_json(content: bytes) -> Any:
    """Return what a strict JSON text holds.

    Raises
    ------
    ValueError
        If it is not UTF-8 or not JSON, repeats a key in an object, holds a number that is not
        finite, or is nested deeper than :data:`DEEPEST`.

    Examples
    --------
    >>> parse_json(b'{"a": 1, "a": 2}')
    Traceback (most recent call last):
        ...
    ValueError: duplicate key 'a' in one object
    """
    try:
        document = json.loads(
            content.decode("utf-8-sig"),
            object_pairs_hook=_object,
            parse_constant=_constant,
            parse_float=_float,
            parse_int=_integer,
        )
    except RecursionError:
        document = None
        depth = DEEPEST + 1
    else:
        depth = _depth(document)
    if depth > DEEPEST:
        raise ValueError(f"nested deeper than {DEEPEST} levels")
    return document


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        seen: set[str] = set()
        for key, _ in pairs:
            if key in seen:
                raise ValueError(f"duplicate key {shown(key)} in one object")
            seen.add(key)
    return found


def _constant(text: str) -> NoReturn:
    raise ValueError(f"{text} is not a JSON number")


def _float(text: str) -> float:
    number = float(text)
    if not math.isfinite(number):
        raise ValueError(f"the number {shown(text)} is too large")
    return number


def _integer(text: str) -> int:
    if len(text) > _LONGEST_NUMBER:
        raise ValueError(f"the number {shown(text)} is too large")
    return int(text)


def _depth(document: Any) -> int:
    """Return how deep lists and objects are nested, no further than one beyond the limit."""
    deepest = 0
    open_nodes: list[Iterator[Any]] = [iter((document,))]
    while open_nodes:
        for node in open_nodes[-1]:
            if isinstance(node, (dict, list)) and node:
                open_nodes.append(iter(node.values() if isinstance(node, dict) else node))
                deepest = max(deepest, len(open_nodes) - 1)
                break
        else:
            open_nodes.pop()
        if deepest > DEEPEST:
            break
    return deepest
