"""Read JSON from anybody: strictly, and bounded in size and depth.

Python's own reader takes NaN, lets the last of two equal keys win, and has no limit on
size. A feed that relies on any of that is read differently by every reader.
"""

from __future__ import annotations

import codecs
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
_SHOWN = 1000
_COMPRESSED = {
    "gzip": b"\x1f\x8b",
    "zip": b"PK\x03\x04",
    "bzip2": b"BZh",
    "xz": b"\xfd7zXZ",
    "zstd": b"\x28\xb5\x2f\xfd",
    "7z": b"7z\xbc\xaf",
}
_UTF16_MARKS = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE, codecs.BOM_UTF32_BE)
_RECORD_SEPARATOR = b"\x1e"
_SEVERAL = "it holds several JSON texts, one after another, but a feed is one"


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
        finite, or is nested deeper than :data:`DEEPEST`. The message says what it is instead, where
        that is known: HTML, compressed, several texts one after another.

    Examples
    --------
    >>> parse_json(b'{"a": 1, "a": 2}')
    Traceback (most recent call last):
        ...
    ValueError: duplicate key 'a' in one object
    """
    other = _other_kind(content)
    if other is not None:
        raise ValueError(other)
    try:
        document = json.loads(
            content.decode("utf-8-sig"),
            object_pairs_hook=_object,
            parse_constant=_constant,
            parse_float=_float,
            parse_int=_integer,
        )
    except json.JSONDecodeError as error:
        raise ValueError(_what_is_wrong(error)) from error
    except RecursionError:
        document = None
        depth = DEEPEST + 1
    else:
        depth = _depth(document)
    if depth > DEEPEST:
        raise ValueError(f"nested deeper than {DEEPEST} levels")
    return document


def _other_kind(content: bytes) -> str | None:
    """Say what a file is that is not JSON; None where it may be."""
    for name, start in _COMPRESSED.items():
        if content.startswith(start):
            return f"the file is compressed ({name}): unpack it first"
    start = content[:_SHOWN]
    if start.startswith(_UTF16_MARKS) or b"\0" in start[:4]:
        return "the text is in UTF-16 or UTF-32, but JSON is in UTF-8"
    text = start.removeprefix(codecs.BOM_UTF8).lstrip()
    if not content.removeprefix(codecs.BOM_UTF8).strip():
        return "the file is empty"
    if text.startswith(b"<"):
        is_page = b"<html" in start.lower() or text.lower().startswith(b"<!doctype html")
        return "it is HTML: perhaps the error page of a server" if is_page else "it is XML"
    if text.startswith(_RECORD_SEPARATOR):
        return f"{_SEVERAL} (RFC 8142)"
    return None


def _what_is_wrong(error: json.JSONDecodeError) -> str:
    rest = error.doc[error.pos :].lstrip()
    if error.msg == "Extra data" and rest.startswith(("{", "[")):
        return f"{_SEVERAL}: the second begins in line {error.lineno}"
    if not rest or error.msg.startswith("Unterminated string"):
        return f"the text ends too early, in line {error.doc.count(chr(10)) + 1}: is it cut off?"
    return f"{error}; there is {shown(rest[:_SHOWN])}"


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
