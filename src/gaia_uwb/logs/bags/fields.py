"""Fields of messages: where a type keeps its ranges and ids.

There is no standard message for UWB. A :class:`FieldMap` says which fields of a vendor's message
hold what; without one, usual names of such fields are tried (``guess.py``).

===============================  ==========================================================
one range per message            ``anchor: responder_id``, ``range: distance``
an array of messages             ``each: nodes``, ``anchor: id``, ``range: dis``
parallel arrays                  ``anchor: anchor_ids``, ``range: ranges``
an array whose place is the id   ``anchor: (index)``, ``range: dis_arr``
one topic per anchor             ``anchor: (topic)``, ``range: range``
===============================  ==========================================================
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np
from pydantic import Field

from gaia_uwb.config import Settings
from gaia_uwb.logs._selection import Wanted, as_text, is_missing
from gaia_uwb.logs.bags.names import (
    ARRAY,
    FLOATS,
    MESSAGE,
    SEQUENCE,
    SINGLE,
    WHOLE,
    ids_of,
    is_role,
)
from gaia_uwb.logs.bags.types import Fields

BY_TOPIC = "(topic)"
"""As the anchor's field: the topic's name is its id."""

BY_INDEX = "(index)"
"""As the anchor's field: the place in the array of ranges, from 0, is its id."""

_MOST_SEEN = 20_000
_OCTETS = {"uint8", "byte", "char", "octet"}

Get = Callable[[Any], Any]
"""From a message to one of its fields."""


class FieldMap(Settings):
    """Where a message keeps its ranges; a path through nested messages has dots."""

    each: str | None = None
    """Array of messages with one range each; the fields below are then the elements'."""
    anchor: str
    """The anchor's id, ``(topic)`` or ``(index)``."""
    range: str
    """The range."""
    scale: float = Field(default=1.0, gt=0, le=1e6)
    """Metres per unit of the range: 0.001 for millimetres."""
    rssi: str | None = None
    """Received power, in dBm."""
    rssi_fp: str | None = None
    """Received power of the first path, in dBm."""
    tag: str | None = None
    """The tag's id, where there are several; a dot in front names the message's own."""
    stamp: str | None = None
    """The message's time, if that is not ``header.stamp``: a ROS time, or seconds."""


class Reading(NamedTuple):
    """One range of one message."""

    anchor_id: str
    range_m: float
    rssi_dbm: float
    rssi_fp_dbm: float
    tag_id: str


class FieldError(ValueError):
    """A path leads to no field, or to one of the wrong kind."""


class _Part(NamedTuple):
    """One field of a message, or of an element of its array.

    Parameters
    ----------
    name
        How messages name it.
    get
        From the message or the element to its value.
    inner
        Whether it is the element's.
    """

    name: str
    get: Get
    inner: bool


@dataclass
class RangeFields:
    """A field map, resolved for one type of message; made by :func:`resolve_ranges`.

    Parameters
    ----------
    fields
        What the map says.
    parallel
        Whether ids and ranges are parallel arrays.
    elements, anchor, range_, rssi, rssi_fp
        Getters.
    tag
        The field that names the tag.
    wanted, where
        The values that fields must have, and those fields.
    missing
        Numbers that mean "no range", before they are scaled.
    parties
        Fields that may name an end of the range; not the anchor's or the tag's, nor one that must
        have a value.
    """

    fields: FieldMap
    parallel: bool
    elements: Get | None
    anchor: Get | None
    range_: Get
    rssi: Get | None
    rssi_fp: Get | None
    tag: _Part | None
    wanted: Wanted
    where: tuple[_Part, ...]
    missing: tuple[float, ...]
    parties: tuple[_Part, ...] = ()
    seen: dict[tuple[str, ...], int] = field(default_factory=dict)
    """Each id of an anchor with the values of the parties beside it -> how many readings."""
    n_read: int = 0
    n_missing: int = 0
    n_left_out: int = 0

    def readings(self, message: Any, topic: str) -> Iterator[Reading]:
        """Yield a message's ranges that count.

        Raises
        ------
        ValueError
            If a value is not what its field is for, or arrays differ in length.
        """
        for part in (message,) if self.elements is None else self.elements(message):
            values = self.range_(part)
            columns = [topic] if self.anchor is None else [self.anchor(part)]
            columns += [None if get is None else get(part) for get in (self.rssi, self.rssi_fp)]
            tag = self.tag
            columns.append("" if tag is None else tag.get(part if tag.inner else message))
            others = [each.get(part if each.inner else message) for each in self.parties]
            kept = [each.get(part if each.inner else message) for each in self.where]
            if not self.parallel:
                yield from self._one(values, columns, others, kept)
                continue
            if self.fields.anchor == BY_INDEX:
                columns[0] = range(len(values))
            columns = [_column(column, len(values)) for column in columns]
            others, kept = ([_column(c, len(values)) for c in cs] for cs in (others, kept))
            for k, value in enumerate(values):
                rows = ([column[k] for column in each] for each in (columns, others, kept))
                yield from self._one(value, *rows)

    def _one(
        self, value: Any, columns: list[Any], others: list[Any], kept: list[Any]
    ) -> Iterator[Reading]:
        """Yield one range, if it counts."""
        if kept and not all(
            self.wanted.accepts(each.name, text)
            for each, text in zip(self.where, map(_text, kept), strict=True)
        ):
            self.n_left_out += 1
            return
        raw = float(value)
        if self.missing and is_missing(raw, self.missing):
            self.n_missing += 1
            return
        anchor, rssi, rssi_fp, tag = columns
        anchor_id = id_text(anchor)
        self.n_read += 1
        if others and raw > 0:  # an entry without a range may be there to fill an array
            key = (anchor_id, *map(id_text, others))
            if key in self.seen or len(self.seen) < _MOST_SEEN:
                self.seen[key] = self.seen.get(key, 0) + 1
        yield Reading(
            anchor_id,
            raw * self.fields.scale,
            math.nan if rssi is None else float(rssi),
            math.nan if rssi_fp is None else float(rssi_fp),
            id_text(tag),
        )


def _column(values: Any, n: int) -> Any:
    """Return n values: those of an array beside the ranges, or one for all."""
    if values is None or isinstance(values, str) or not hasattr(values, "__len__"):
        return [values] * n
    if len(values) != n:
        raise ValueError(f"parallel arrays differ in length: {len(values)}, {n}")
    return values


def resolve_ranges(
    types: Fields,
    msgtype: str,
    fields: FieldMap,
    wanted: Wanted | None = None,
    missing: Sequence[float] = (),
) -> RangeFields:
    """Return the getters of a field map for a type.

    Parameters
    ----------
    types
        Descriptions of the type and those it uses.
    msgtype
        The type.
    fields
        The map.
    wanted
        The values that fields must have.
    missing
        Numbers that mean "no range", before they are scaled; those of an array whose place is
        the id include 0 if none are given.

    Raises
    ------
    FieldError
        If a path leads to no field or to one of the wrong kind.
    """
    wanted = Wanted({}) if wanted is None else wanted
    inner, elements = msgtype, None
    if fields.each is not None:
        kind, content = find_field(types, msgtype, fields.each)
        if kind not in (ARRAY, SEQUENCE) or content[0][0] != MESSAGE:
            raise FieldError(f"{fields.each} is not an array of messages")
        inner, elements = content[0][1], getter(fields.each)
    parallel = _check_range(types, inner, fields)
    by_field = fields.anchor not in (BY_TOPIC, BY_INDEX)
    if by_field:
        _check_id(types, inner, fields, parallel=parallel)
    elif parallel is not (fields.anchor == BY_INDEX):
        what = "an array" if fields.anchor == BY_INDEX else "a single number"
        raise FieldError(f"anchor: {fields.anchor} needs a range that is {what}")
    for path in (fields.rssi, fields.rssi_fp):
        if path and (find_field(types, inner, path)[0] in (ARRAY, SEQUENCE)) is not parallel:
            raise FieldError(f"{path} and {fields.range} must both be arrays or both numbers")
    if fields.anchor == BY_INDEX and not missing:
        missing = (0.0,)
    tag = None if fields.tag is None else _value_at(types, msgtype, inner, fields.tag, "tag")
    return RangeFields(
        fields=fields,
        parallel=parallel,
        elements=elements,
        anchor=getter(fields.anchor) if by_field else None,
        range_=getter(fields.range),
        rssi=getter(fields.rssi) if fields.rssi else None,
        rssi_fp=getter(fields.rssi_fp) if fields.rssi_fp else None,
        tag=tag,
        wanted=wanted,
        where=tuple(_value_at(types, msgtype, inner, name, "where") for name in wanted.fields),
        missing=tuple(missing),
        parties=tuple(
            party
            for party in _parties(types, msgtype, inner, fields, parallel=parallel)
            if party.name not in {*wanted.fields, fields.tag}
        ),
    )


def _parties(
    types: Fields, msgtype: str, inner: str, fields: FieldMap, *, parallel: bool
) -> tuple[_Part, ...]:
    """Return the fields, beside the anchor's, that may name an end of the range."""
    own = dict(types[inner][1])
    names = [name for name in ids_of(types, inner) if not parallel or own[name][0] == SINGLE]
    names += ids_of(types, inner, arrays=True) if parallel else []
    names += [name for name in own if is_role(name) and own[name][0] == SINGLE]
    found = [_Part(name, getter(name), inner=True) for name in names if name != fields.anchor]
    if fields.each is not None:
        outer = ids_of(types, msgtype)
        found += [_Part(f".{name}", getter(name), inner=False) for name in outer]
    return tuple(found)


def _value_at(types: Fields, msgtype: str, inner: str, name: str, what: str) -> _Part:
    """Return a field with one value: the element's, or else the message's."""
    path, of_element = name.removeprefix("."), not name.startswith(".")
    if of_element and inner != msgtype:
        try:
            find_field(types, inner, path)
        except FieldError:
            of_element = False
    if find_field(types, inner if of_element else msgtype, path)[0] == MESSAGE:
        raise FieldError(f"{what}: {path} is a message, not a value")
    return _Part(name, getter(path), inner=of_element)


def _check_range(types: Fields, msgtype: str, fields: FieldMap) -> bool:
    """Tell whether the range's field is an array; refuse what is no number."""
    kind, content = find_field(types, msgtype, fields.range)
    base = content[0] if kind in (ARRAY, SEQUENCE) else (kind, content)
    if base[0] == MESSAGE or base[1][0] not in WHOLE | FLOATS:
        raise FieldError(f"{fields.range} is not a number")
    return kind in (ARRAY, SEQUENCE)


def _check_id(types: Fields, msgtype: str, fields: FieldMap, *, parallel: bool) -> None:
    path = fields.anchor
    kind, content = find_field(types, msgtype, path)
    is_array = kind in (ARRAY, SEQUENCE)
    octets = is_array and content[0][1][0] in _OCTETS
    if parallel and not is_array:
        hint = f"if the place in {fields.range} is the id, set anchor: {BY_INDEX}"
        raise FieldError(f"{path} is not an array of ids; {hint}")
    if kind == MESSAGE or (is_array and content[0][0] == MESSAGE):
        raise FieldError(f"{path} is not {'an array of ids' if parallel else 'an id'}")
    if not parallel and is_array and not octets:
        raise FieldError(f"{path} is an array, but the range is a single number")


def find_field(types: Fields, msgtype: str, path: str) -> Any:
    """Return the description of the field at a path.

    Raises
    ------
    FieldError
        If there is none: the message lists those there are.
    """
    description: Any = (MESSAGE, msgtype)
    for word in path.split("."):
        kind, content = description
        known = dict(types[content][1]) if kind == MESSAGE else {}
        if word not in known:
            there = ", ".join(known)[:200] if known else "no fields"
            raise FieldError(f"no field {path[:80]!r}; available: {there}")
        description = known[word]
    return description


def getter(path: str) -> Get:
    """Return the function from a message to the field at a path."""
    from rosbags.typesys.base import normalize_fieldname

    return attrgetter(".".join(normalize_fieldname(word) for word in path.split(".")))


def id_text(value: Any) -> str:
    """Return an id as text: numbers in decimal, arrays of bytes (a MAC address) in hexadecimal.

    Raises
    ------
    ValueError
        If it is a number with decimals.
    """
    if isinstance(value, (float, np.floating)) and not value.is_integer():
        raise ValueError(f"expected an id, got {value:g}")
    return _text(value)


def _text(value: Any) -> str:
    """Return a value as ``where`` compares it."""
    if hasattr(value, "tobytes") and value.ndim > 0:
        return bytes(value.tobytes()).hex()
    return bytes(value).hex() if isinstance(value, list) else as_text(value)
