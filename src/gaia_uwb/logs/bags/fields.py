"""Fields of messages: where a type keeps its ranges and ids, looked up or guessed.

There is no standard message for UWB. A :class:`FieldMap` says which fields of a vendor's message
hold what; without one, usual names of such fields are tried.

===============================  ==========================================================
one range per message            ``anchor: responder_id``, ``range: distance``
an array of messages             ``each: nodes``, ``anchor: id``, ``range: dis``
parallel arrays                  ``anchor: anchor_ids``, ``range: ranges``
one topic per anchor             ``anchor: (topic)``, ``range: range``
===============================  ==========================================================
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from operator import attrgetter
from typing import Any, NamedTuple

from pydantic import Field

from gaia_uwb.config import Settings
from gaia_uwb.logs.bags.types import Fields

BY_TOPIC = "(topic)"
"""As the anchor's field: the topic's name is its id."""

_RANGES = ["range", "distance", "dist", "dis", "slant_range", "range_m", "distance_m", "dist_m"]
_RANGES += ["range_mm", "distance_mm", "dist_mm", "range_cm", "distance_cm", "dist_cm"]
_IDS = ["anchor_id", "anchor", "anchor_name", "responder_id", "responder", "node_id", "id", "to_id"]
_IDS += [
    "source_id",
    "src_id",
    "from_id",
    "remote_id",
    "target_id",
    "address",
    "addr",
    "mac",
    "uid",
]
_RSSI = ["rssi_dbm", "rssi", "rx_rssi", "rx_power"]
_RSSI_FP = ["rssi_fp_dbm", "fp_rssi", "fp_power", "first_path_power"]
_RANGE_ARRAYS = ["ranges", "distances", "dists"]
_ID_ARRAYS = ["anchor_ids", "anchors", "ids", "responder_ids", "node_ids"]
_NAME, _ARRAY, _SEQUENCE = 2, 3, 4


class FieldMap(Settings):
    """Where a message keeps its ranges; a path through nested messages has dots."""

    each: str | None = None
    """Array of messages with one range each; the fields below are then the elements'."""
    anchor: str
    """The anchor's id, or ``(topic)``."""
    range: str
    """The range."""
    scale: float = Field(default=1.0, gt=0, le=1e6)
    """Metres per unit of the range: 0.001 for millimetres."""
    rssi: str | None = None
    """Received power, in dBm."""
    rssi_fp: str | None = None
    """Received power of the first path, in dBm."""
    stamp: str | None = None
    """The message's time, if that is not ``header.stamp``: a ROS time, or seconds."""


class Reading(NamedTuple):
    """One range of one message."""

    anchor_id: str
    range_m: float
    rssi_dbm: float
    rssi_fp_dbm: float


class FieldError(ValueError):
    """A path leads to no field, or to one of the wrong kind."""


@dataclass(frozen=True)
class RangeFields:
    """A field map, resolved for one type of message.

    Parameters
    ----------
    fields
        What the map says.
    parallel
        Whether ids and ranges are parallel arrays.
    elements, anchor, range_, rssi, rssi_fp
        Getters.
    """

    fields: FieldMap
    parallel: bool
    elements: Callable[[Any], Any] | None
    anchor: Callable[[Any], Any] | None
    range_: Callable[[Any], Any]
    rssi: Callable[[Any], Any] | None
    rssi_fp: Callable[[Any], Any] | None

    def readings(self, message: Any, topic: str) -> Iterator[Reading]:
        """Yield a message's ranges.

        Raises
        ------
        ValueError
            If a value is not what its field is for, or arrays differ in length.
        """
        for part in (message,) if self.elements is None else self.elements(message):
            anchor = topic if self.anchor is None else self.anchor(part)
            rssi = None if self.rssi is None else self.rssi(part)
            rssi_fp = None if self.rssi_fp is None else self.rssi_fp(part)
            if self.parallel:
                yield from self._side_by_side(anchor, self.range_(part), [rssi, rssi_fp])
            else:
                yield self._reading(anchor, self.range_(part), rssi, rssi_fp)

    def _side_by_side(self, ids: Any, ranges: Any, powers: list[Any]) -> Iterator[Reading]:
        columns = [ids, ranges, *(power for power in powers if power is not None)]
        if len({len(column) for column in columns}) > 1:
            sizes = ", ".join(str(len(column)) for column in columns)
            raise ValueError(f"parallel arrays differ in length: {sizes}")
        for k, value in enumerate(ranges):
            rssi, rssi_fp = (None if power is None else power[k] for power in powers)
            yield self._reading(ids[k], value, rssi, rssi_fp)

    def _reading(self, anchor: Any, value: Any, rssi: Any, rssi_fp: Any) -> Reading:
        return Reading(
            anchor.strip() if isinstance(anchor, str) else _text(anchor),
            float(value) * self.fields.scale,
            math.nan if rssi is None else float(rssi),
            math.nan if rssi_fp is None else float(rssi_fp),
        )


def resolve_ranges(types: Fields, msgtype: str, fields: FieldMap) -> RangeFields:
    """Return the getters of a field map for a type.

    Parameters
    ----------
    types
        Descriptions of the type and those it uses.
    msgtype
        The type.
    fields
        The map.

    Raises
    ------
    FieldError
        If a path leads to no field or to one of the wrong kind.
    """
    inner, elements = msgtype, None
    if fields.each is not None:
        kind, content = find_field(types, msgtype, fields.each)
        if kind not in (_ARRAY, _SEQUENCE) or content[0][0] != _NAME:
            raise FieldError(f"{fields.each} is not an array of messages")
        inner, elements = content[0][1], getter(fields.each)
    range_kind, content = find_field(types, inner, fields.range)
    parallel = range_kind in (_ARRAY, _SEQUENCE)
    base = content[0] if parallel else (range_kind, content)
    if base[0] == _NAME or base[1][0] in {"string", "wstring"}:
        raise FieldError(f"{fields.range} is not a number")
    by_topic = fields.anchor == BY_TOPIC
    if not by_topic:
        _check_id(types, inner, fields.anchor, parallel)
    elif parallel:
        raise FieldError("an array of ranges needs an array of ids as anchor")
    for path in (fields.rssi, fields.rssi_fp):
        if path and (find_field(types, inner, path)[0] in (_ARRAY, _SEQUENCE)) is not parallel:
            raise FieldError(f"{path} and {fields.range} must both be arrays or both numbers")
    return RangeFields(
        fields=fields,
        parallel=parallel,
        elements=elements,
        anchor=None if by_topic else getter(fields.anchor),
        range_=getter(fields.range),
        rssi=getter(fields.rssi) if fields.rssi else None,
        rssi_fp=getter(fields.rssi_fp) if fields.rssi_fp else None,
    )


def _check_id(types: Fields, msgtype: str, path: str, parallel: bool) -> None:
    kind, content = find_field(types, msgtype, path)
    octets = kind in (_ARRAY, _SEQUENCE) and content[0][1][0] in {"uint8", "byte", "char", "octet"}
    if kind == _NAME or (parallel and kind not in (_ARRAY, _SEQUENCE)):
        raise FieldError(f"{path} is not {'an array of ids' if parallel else 'an id'}")
    if not parallel and kind in (_ARRAY, _SEQUENCE) and not octets:
        raise FieldError(f"{path} is an array, but the range is a single number")


def find_field(types: Fields, msgtype: str, path: str) -> Any:
    """Return the description of the field at a path.

    Raises
    ------
    FieldError
        If there is none: the message lists those there are.
    """
    description: Any = (_NAME, msgtype)
    for word in path.split("."):
        kind, content = description
        known = dict(types[content][1]) if kind == _NAME else {}
        if word not in known:
            there = ", ".join(known)[:200] if known else "no fields"
            raise FieldError(f"no field {path[:80]!r}; available: {there}")
        description = known[word]
    return description


def getter(path: str) -> Callable[[Any], Any]:
    """Return the function from a message to the field at a path."""
    from rosbags.typesys.base import normalize_fieldname

    return attrgetter(".".join(normalize_fieldname(word) for word in path.split(".")))


def guess_ranges(types: Fields, msgtype: str) -> FieldMap | None:
    """Return where a type probably keeps its ranges; ``None`` if it seems to have none."""
    if found := _guess_flat(types, msgtype, None):
        return found
    own = dict(types[msgtype][1])
    for name, (kind, content) in own.items():
        of_messages = kind in (_ARRAY, _SEQUENCE) and content[0][0] == _NAME
        if of_messages and (found := _guess_flat(types, content[0][1], name)):
            return found
    arrays = [name for name, (kind, content) in own.items() if kind in (_ARRAY, _SEQUENCE)]
    ids, ranges = _first(arrays, _ID_ARRAYS), _first(arrays, _RANGE_ARRAYS)
    if ids and ranges and own[ids][1][0][0] != _NAME and _is_float(own[ranges][1][0]):
        return FieldMap(anchor=ids, range=ranges)
    if msgtype == "sensor_msgs/msg/Range":
        return FieldMap(anchor="header.frame_id", range="range")
    return None


def _guess_flat(types: Fields, msgtype: str, each: str | None) -> FieldMap | None:
    """Look for an id and a range, both single values, among a type's own fields."""
    own = dict(types[msgtype][1])
    single = [name for name, (kind, _) in own.items() if kind == 1]
    anchor = _first(single, _IDS)
    numbers = [n for n in single if _is_float(own[n]) or n.endswith(("_mm", "_cm"))]
    range_ = _first(numbers, _RANGES)
    if anchor is None or range_ is None:
        return None
    floats = [name for name in single if _is_float(own[name])]
    return FieldMap(
        each=each,
        anchor=anchor,
        range=range_,
        scale={"mm": 0.001, "cm": 0.01}.get(range_[-2:], 1.0),
        rssi=_first(floats, _RSSI),
        rssi_fp=_first(floats, _RSSI_FP),
    )


def _is_float(description: Any) -> bool:
    return bool(description[0] == 1 and description[1][0] in {"float32", "float64"})


def _first(names: list[str], wanted: list[str]) -> str | None:
    """Return the name that is wanted most, whatever its capitals."""
    lower = {name.lower(): name for name in names}
    return next((lower[name] for name in wanted if name in lower), None)


def _text(value: Any) -> str:
    """Return an id as text: numbers in decimal, arrays of bytes (a MAC address) in hexadecimal."""
    if hasattr(value, "tobytes") and value.ndim > 0:
        return bytes(value.tobytes()).hex()
    number = float(value)
    if not number.is_integer():
        raise ValueError(f"expected an id, got {number:g}")
    return str(int(value))
