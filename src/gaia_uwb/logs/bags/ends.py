"""Which end of a range is the anchor: of the ids in a message, by the values that they have.

A drive has several anchors and, if nothing else is said, one tag. So of two fields the one that
varies beside one that does not is the anchor's; where that does not decide, the user is asked. And
once the anchor's field is known, no other id may vary on its own: that would be a second tag. Where
it is said which tags there are, the tag's field is known by its values.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence

from gaia_uwb.logs._tags import WHERE_THEY_ARE, arms_wanted
from gaia_uwb.logs.bags.names import end_of, end_of_array, is_role

_MOST_TAGS = 200
_FEW = 10

Seen = Mapping[tuple[str, ...], int]
"""Values of the ids of a reading, in the order of their names -> how many readings have them."""


def values_of(seen: Seen, k: int) -> dict[str, int]:
    """Return the values of one field, and how many readings have each."""
    values: dict[str, int] = {}
    for key, count in seen.items():
        values[key[k]] = values.get(key[k], 0) + count
    return values


class EndsError(ValueError):
    """It cannot be told which end is the anchor, or there are several tags."""


def choose_anchor(names: Sequence[str], seen: Seen) -> str:
    """Return the name of the field that is the anchor's id.

    Parameters
    ----------
    names
        The fields that may be, the likeliest first.
    seen
        Their values in the log.

    Raises
    ------
    EndsError
        If the values do not tell.

    Examples
    --------
    >>> choose_anchor(["to_id", "from_id"], {("10", "0"): 5, ("10", "1"): 5})
    'from_id'
    """
    own = [k for k, name in enumerate(names) if not (name.startswith(".") or is_role(name))]
    named = [k for k in own if end_of(names[k]) == "anchor"]
    if named:
        return names[named[0]]
    free = [k for k in own if end_of(names[k]) != "tag" and not _counts(seen, k)]
    varying = [k for k in free if len(values_of(seen, k)) > 1]
    if varying and all(_decides(seen, j, k) for j in varying for k in varying):
        return names[varying[0]]
    tags = [k for k in own if k not in free and len(values_of(seen, k)) > 1]
    if not varying and len(free) < 2 and (not free or all(_counts(seen, k) for k in tags)):
        return names[(free or own)[0]]
    listed = "; ".join(f"{names[k][:60]} is {_shown(values_of(seen, k))}" for k in own)
    raise EndsError(
        f"which field is the anchor's id? {listed}: set fields: {{anchor: ..., range: ...}}"
    )


def choose_tag(names: Sequence[str], seen: Seen, is_tag: Callable[[str], bool]) -> str | None:
    """Return the name of the field that names the tag, where it is known which tags there are.

    Parameters
    ----------
    names
        The fields that may.
    seen
        Their values in the log.
    is_tag
        Tells whether a value is one of the tags.

    Returns
    -------
    str, optional
        A field all of whose values are tags, or else one that is called after the tag; ``None``
        if there is none.

    Examples
    --------
    >>> tags = {"10", "11"}
    >>> choose_tag(["to_id", "from_id"], {("10", "0"): 5, ("11", "1"): 5}, tags.__contains__)
    'to_id'
    """
    values = {name: values_of(seen, k) for k, name in enumerate(names)}
    ends = {name: end_of(_last(name)) or end_of_array(_last(name)) for name in names}
    able = [name for name in names if ends[name] in {"tag", "either"}]
    named = [name for name in able if ends[name] == "tag"]
    fitting = [name for name in able if values[name] and all(map(is_tag, values[name]))]
    if fitting:
        return max(fitting, key=lambda name: (name in named, len(values[name])))
    return named[0] if named else None


def _last(name: str) -> str:
    """Return the last word of a path; a dot stands before a message's own field."""
    return name.rpartition(".")[2]


def check_one_tag(anchor: str, names: Sequence[str], seen: Seen) -> None:
    """Refuse the ranges of several tags, or of anchors and tags together.

    Parameters
    ----------
    anchor
        Name of the anchor's field.
    names
        Names of the other ids.
    seen
        Values of all of them in the log, the anchor's first.

    Raises
    ------
    EndsError
        If another id than the anchor's varies on its own.

    Examples
    --------
    >>> check_one_tag("anchor_id", ["tag_id"], {("A", "1"): 5, ("B", "1"): 5})
    >>> check_one_tag("anchor_id", ["tag_id"], {("A", "1"): 5, ("A", "2"): 5})
    Traceback (most recent call last):
    gaia_uwb.logs.bags.ends.EndsError: tag_id has several values ('1', '2'), as of several tags ...
    """
    for k, name in enumerate(names, 1):
        values = values_of(seen, k)
        if len(values) < 2 or _counts(seen, k):
            continue
        if is_role(name) or not _decides(seen, 0, k):
            first = max(values, key=lambda value: values[value])
            of = "anchors and tags" if is_role(name) else f"several tags (the anchor is {anchor})"
            arms = "" if is_role(name) else f"{WHERE_THEY_ARE}{arms_wanted(first)}, or "
            raise EndsError(
                f"{name} has several values ({_shown(values)}), as of {of}: {arms}"
                f"choose one, where: {{{name}: {first}}}"
            )


def _decides(seen: Seen, a: int, b: int) -> bool:
    """Tell whether one field's value always has the same value of another beside it."""
    return len({(key[a], key[b]) for key in seen}) == len({key[a] for key in seen})


def _counts(seen: Seen, k: int) -> bool:
    """Tell whether a field is a counter: hardly a value comes twice."""
    n_values = len(values_of(seen, k))
    return n_values > _MOST_TAGS or n_values > max(_FEW, sum(seen.values()) / 3)


def _shown(values: Iterable[str]) -> str:
    """Return the first few values."""
    some = sorted(values, key=lambda value: (len(value), value))
    more = f" and {len(some) - 5} more" if len(some) > 5 else ""
    return ", ".join(repr(value[:30]) for value in some[:5]) + more
