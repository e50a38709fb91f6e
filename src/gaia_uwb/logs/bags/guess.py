"""Guess where a type of message keeps its ranges, by the names of its fields.

Nothing is guessed quietly: what was taken is noted, and where two fields could be the anchor's id,
their values decide (``ends.py``) or the user is asked.
"""

from __future__ import annotations

from gaia_uwb.logs.bags.fields import BY_INDEX, FieldMap
from gaia_uwb.logs.bags.names import (
    ARRAY,
    FLOATS,
    MESSAGE,
    RANGE_ARRAYS,
    RANGES,
    RSSI,
    RSSI_FP,
    SEQUENCE,
    SINGLE,
    WHOLE,
    end_of,
    end_of_array,
    find_range,
    first,
    ids_of,
    plain,
    unit_of,
)
from gaia_uwb.logs.bags.types import Fields

_LINKTRACK_ARRAY = "disarr"  # of Nooploop's tag frames: eight ranges, the place is the anchor


def guess_ranges(types: Fields, msgtype: str) -> FieldMap | None:
    """Return where a type probably keeps its ranges; ``None`` if it seems to have none.

    Parameters
    ----------
    types
        Descriptions of the type and those it uses.
    msgtype
        The type.
    """
    found = _guess_flat(types, msgtype, None)
    for name, (kind, content) in types[msgtype][1]:
        if found is None and kind in (ARRAY, SEQUENCE) and content[0][0] == MESSAGE:
            found = _guess_flat(types, content[0][1], name)
            found = found or _guess_places(types, content[0][1], name)
    found = found or _guess_arrays(types, msgtype) or _guess_places(types, msgtype, None)
    if found is None and msgtype == "sensor_msgs/msg/Range":
        return FieldMap(anchor="header.frame_id", range="range")
    return found


def hint_ranges(types: Fields, msgtype: str) -> str:
    """Return what to set for a type that nearly looks like ranges; empty if it does not.

    Parameters
    ----------
    types, msgtype
        Like those of :func:`guess_ranges`.
    """
    if msgtype.startswith("sensor_msgs/"):
        return ""
    own = dict(types[msgtype][1])
    scopes: list[tuple[str, str]] = [("", msgtype)]
    for name, (kind, content) in own.items():
        if kind in (ARRAY, SEQUENCE) and content[0][0] == MESSAGE:
            scopes.append((f"each: {name}, ", content[0][1]))
    for each, inner in scopes:
        ids, whole = ids_of(types, inner), find_range(_of(types, inner, WHOLE))
        if ids and whole:
            fields = f"fields: {{{each}anchor: {ids[0]}, range: {whole}, scale: 0.001}}"
            return f"{whole} is a whole number of unknown unit; if of millimetres, set {fields}"
    range_ = _range_array(types, msgtype)
    if range_:
        fields = f"fields: {{anchor: {BY_INDEX}, range: {range_}}}"
        return f"{range_} has no ids beside it; if the place in it is the id, set {fields}"
    return ""


def _guess_flat(types: Fields, msgtype: str, each: str | None) -> FieldMap | None:
    """Look for an id and a range, both single values, among a type's own fields."""
    ids = ids_of(types, msgtype)
    floats, whole = _of(types, msgtype, FLOATS), _of(types, msgtype, WHOLE)
    range_ = find_range(floats + [name for name in whole if unit_of(name)])
    if not ids or range_ is None or all(end_of(name) == "tag" for name in ids):
        return None
    return FieldMap(
        each=each,
        anchor=next(name for name in ids if end_of(name) != "tag"),
        range=range_,
        scale=unit_of(range_) or 1.0,
        rssi=first(floats, RSSI),
        rssi_fp=first(floats, RSSI_FP),
    )


def _of(types: Fields, msgtype: str, bases: frozenset[str]) -> list[str]:
    """Return a type's single fields of some basic types."""
    fields = types[msgtype][1]
    return [name for name, (kind, base) in fields if kind == SINGLE and base[0] in bases]


def _guess_arrays(types: Fields, msgtype: str) -> FieldMap | None:
    """Look for arrays of ids and of ranges beside each other."""
    range_ = _range_array(types, msgtype)
    ids = [name for name in ids_of(types, msgtype, arrays=True) if end_of_array(name) != "tag"]
    return FieldMap(anchor=ids[0], range=range_) if range_ and ids else None


def _guess_places(types: Fields, msgtype: str, each: str | None) -> FieldMap | None:
    """Look for an array of ranges whose name says that the place in it is the anchor's id."""
    name = _range_array(types, msgtype)
    if name is None or plain(name) != _LINKTRACK_ARRAY:
        return None
    fixed = dict(types[msgtype][1])[name][0] == ARRAY
    return FieldMap(each=each, anchor=BY_INDEX, range=name) if fixed else None


def _range_array(types: Fields, msgtype: str) -> str | None:
    """Return the array of numbers that is probably one of ranges."""
    fields = types[msgtype][1]
    arrays = [
        name
        for name, (kind, content) in fields
        if kind in (ARRAY, SEQUENCE) and content[0][0] == SINGLE and content[0][1][0] in FLOATS
    ]
    return first(arrays, (*RANGE_ARRAYS, *RANGES))
