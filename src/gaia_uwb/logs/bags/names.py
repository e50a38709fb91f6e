"""Names of fields: which of them may hold an id of one end of a range, or the range itself.

Vendors write ``anchor_id``, ``anchorId`` or ``AnchorID``; names are compared without capitals and
underscores.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Literal

from gaia_uwb.logs.bags.types import Fields

End = Literal["anchor", "tag", "either"]
"""Which end of a range a name speaks of."""

_ANCHOR = ("anchor", "beacon", "cone", "aid")
_TAG = ("tag", "rover", "mobile", "vehicle", "robot", "tid")
_EITHER = (
    *("from", "to", "src", "destination", "dest", "dst", "sender", "receiver"),
    *("initiator", "responder", "requester", "remote", "peer", "neighbor", "neighbour", "node"),
)
_OF_SOMETHING = ("source", "target", "local", "self", "own", "device", "dev", "module", "sensor")
"""Words that are an id only with a suffix: ``sensor_id``, but not ``sensor``."""

_SUFFIXES = ("id", "", "name", "address", "addr", "mac", "macaddress", "uid", "index", "idx")
_GENERIC = ("id", "address", "addr", "mac", "macaddress", "uid")
_END = re.compile(
    rf"(?:(?P<anchor>{'|'.join(_ANCHOR)})|(?P<tag>{'|'.join(_TAG)})|{'|'.join(_EITHER)}"
    rf"|(?:{'|'.join(_OF_SOMETHING)})(?=.))(?P<suffix>{'|'.join(_SUFFIXES)})"
)

RANGES = ("range", "distance", "dist", "dis", "slantrange", "measureddistance", "measuredrange")
"""Names of a range, plain, the likeliest first."""

_UNITS_M = {"m": 1.0, "meters": 1.0, "metres": 1.0, "mm": 0.001, "cm": 0.01}

RANGE_ARRAYS = ("ranges", "distances", "dists", "disarr", "distarr", "rangearr", "distancearray")
"""Names of an array of ranges."""

RSSI = ("rssidbm", "rssi", "rxrssi", "rss", "rxpower")
RSSI_FP = ("rssifpdbm", "fprssi", "fppower", "firstpathpower")

WHOLE = frozenset(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64))
FLOATS = frozenset({"float32", "float64"})
_OCTETS = frozenset({"uint8", "byte", "char", "octet"})
SINGLE, MESSAGE, ARRAY, SEQUENCE = 1, 2, 3, 4
"""Kinds of fields, as rosbags numbers them."""


def plain(name: str) -> str:
    """Return a name without capitals and underscores.

    Examples
    --------
    >>> plain("anchor_id"), plain("AnchorId")
    ('anchorid', 'anchorid')
    """
    return name.replace("_", "").lower()


def end_of(name: str) -> End | None:
    """Return which end of a range a name may be the id of; ``None`` if it is no id.

    Examples
    --------
    >>> end_of("anchorId"), end_of("tag_id"), end_of("from_id"), end_of("mac"), end_of("source")
    ('anchor', 'tag', 'either', 'either', None)
    """
    word = plain(name)
    match = _END.fullmatch(word)
    if match is None:
        return "either" if word in _GENERIC else None
    return "anchor" if match["anchor"] else "tag" if match["tag"] else "either"


def end_of_array(name: str) -> End | None:
    """Return which end the ids in an array are of, by its name in the plural."""
    word = plain(name)
    return end_of(word.removesuffix("es")) or end_of(word.removesuffix("s"))


def unit_of(name: str) -> float | None:
    """Return the metres per unit that a range's name ends in; ``None`` if it names none.

    Examples
    --------
    >>> unit_of("range_mm"), unit_of("distanceInCm"), unit_of("range")
    (0.001, 0.01, None)
    """
    word = plain(name)
    for base in RANGES:
        ending = word.removeprefix(base).removeprefix("in")
        if word.startswith(base) and ending in _UNITS_M:
            return _UNITS_M[ending]
    return None


def find_range(names: Iterable[str]) -> str | None:
    """Return the name that is the likeliest to be a range's: the plain ones come first."""
    some = list(names)
    return first(some, RANGES) or next((name for name in some if unit_of(name)), None)


def is_role(name: str) -> bool:
    """Tell whether a field says if a radio is an anchor or a tag."""
    return plain(name) == "role"


def ids_of(types: Fields, msgtype: str, *, arrays: bool = False) -> list[str]:
    """Return a type's own fields that may be ids of an end of a range, the likeliest anchor first.

    Parameters
    ----------
    types, msgtype
        The type, and descriptions of it and those it uses.
    arrays
        Look for arrays of ids instead of single ones.
    """
    found = []
    for place, (name, description) in enumerate(types[msgtype][1]):
        word = plain(name)
        if arrays:
            word = word.removesuffix("es") if word.endswith("addresses") else word.removesuffix("s")
        end = end_of(word)
        if end is not None and _holds_ids(description, arrays=arrays):
            match = _END.fullmatch(word)
            suffix = _SUFFIXES.index(match["suffix"]) if match else 0
            found.append((end != "anchor", suffix, place, name))
    return [name for *_, name in sorted(found)]


def _holds_ids(description: tuple[int, object], *, arrays: bool) -> bool:
    """Tell whether a field has values that can be ids: whole numbers, texts or bytes."""
    kind, content = description
    if kind in (ARRAY, SEQUENCE):
        inner: object = content[0]  # type: ignore[index]
        base = inner[1][0] if inner[0] == SINGLE else ""  # type: ignore[index]
        return base in {*WHOLE, "string"} if arrays else base in _OCTETS
    return not arrays and kind == SINGLE and content[0] in {*WHOLE, "string", "wstring"}  # type: ignore[index]


def first(names: Iterable[str], wanted: Iterable[str]) -> str | None:
    """Return the name that is wanted most."""
    there = {plain(name): name for name in names}
    return next((there[word] for word in wanted if word in there), None)
