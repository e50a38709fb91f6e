"""Which rows of a table of ranges count: those of one tag, and those that hold a range."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from gaia_uwb._shared import Array, Float64, counted, shown
from gaia_uwb.logs._selection import Value, Wanted
from gaia_uwb.logs._table import Table

_TAG = re.compile(
    "(tag|initiator|from|src|sender|rover|mobile|robot|vehicle)(_?id|_name|_mac|_addr|_address)?|"
    "tid|source_id"
)


def tag_columns(names: Iterable[str]) -> list[str]:
    """Return the columns that name the tag by whom a range was measured.

    Examples
    --------
    >>> tag_columns(["t", "Tag ID", "anchor", "tagId", "fromId", "tagged"])
    ['Tag ID', 'tagId', 'fromId']
    """
    found = []
    for name in names:
        words = re.sub(r"(?<=[a-z])(?=[A-Z])|[^A-Za-z0-9]+", "_", name.strip()).strip("_").lower()
        if _TAG.fullmatch(words):
            found.append(name)
    return found


def choose_rows(
    table: Table, where: Mapping[str, Value | Sequence[Value]], tags: Sequence[str], place: str
) -> Table:
    """Return the rows that count, and refuse ranges of several tags: they are not in one place.

    Parameters
    ----------
    table
        The ranges.
    where
        Column -> the value, or one of several, that it must have.
    tags
        The columns that name the tag.
    place
        Where ``where`` stands or is to be written.

    Raises
    ------
    InputError
        If no row has what is wanted, a column holds numbers that cannot be compared, or more than
        one tag is left.
    """
    wanted, kept = Wanted(where), np.ones(len(table), np.bool_)
    for name in wanted.fields:
        if name not in table.labels:
            raise table.error("where cannot choose by a number that is measured", column=name)
        labels = table.labels[name]
        accepted = np.array([_accepts(wanted, name, label) for label in labels], np.bool_)
        if not accepted.any():
            problem = f"no row has what where wants; there are: {_some(labels)}"
            raise table.error(problem, column=name)
        kept &= accepted[table[name]]
    if not kept.any():
        raise table.error(f"no row has all that where wants: {', '.join(wanted.fields)}")
    remarks = table.remarks
    if not kept.all():
        rows = f"{int(kept.sum()):,} of {counted(len(table), 'row')}"
        table = table.take(kept)
        remarks = (*remarks, f"{table.path.name}: {rows} are those that where wants")
    _check_one_tag(table, tags, place)
    return replace(table, remarks=remarks)


def drop_missing(table: Table, missing: Sequence[float | int]) -> Table:
    """Return the rows that have a range, where some cells are empty or hold a placeholder.

    Raises
    ------
    InputError
        If no row has a range.
    """
    none = ~np.isfinite(with_nothing(table["range_m"], missing))
    if none.all():
        raise table.error("contains no ranges", column="range_m")
    if not none.any():
        return table
    remark = gaps_remark(table, int(none.sum()), missing)
    return replace(table.take(~none), remarks=(*table.remarks, remark))


def with_nothing(
    range_m: Float64[Array, "R"], missing: Sequence[float | int]
) -> Float64[Array, "R"]:
    """Return ranges with NaN where they are placeholders.

    Examples
    --------
    >>> with_nothing(np.array([5.0, 65.53500366210938]), [65.535])
    array([ 5., nan])
    """
    for number in missing:  # floats of 32 bits hold 65.535 to 7 digits only
        range_m = np.where(np.abs(range_m - number) <= 1e-7 * abs(number), np.nan, range_m)
    return range_m


def gaps_remark(table: Table, n_gaps: int, missing: Sequence[float | int]) -> str:
    """Return the note on cells that hold no range."""
    numbers = f" (empty, or {', '.join(f'{number:g}' for number in missing)})" if missing else ""
    cells = counted(n_gaps, "cell")
    return f"{table.path.name}: skipped {cells} without a range{numbers}"


def _check_one_tag(table: Table, names: Sequence[str], place: str) -> None:
    for name in names:
        tags = [table.labels[name][code] for code in np.unique(table[name])]
        tags = [tag.removesuffix(".0") for tag in tags if tag]
        if len(tags) > 1:
            one_anchor = any(len(table.labels[n]) == 1 for n in table.labels if n not in names)
            other = " (or is this the anchor's id?)" if one_anchor else ""
            problem = (
                f"holds ranges of {len(tags)} tags ({_some(tags)}), and one log is of one tag: "
                f"choose it by where: {{{_in_yaml(name)}: {_in_yaml(tags[0])}}} in {place}{other}"
            )
            raise table.error(problem, column=name)


def _in_yaml(text: str) -> str:
    """Return a text as it can be copied into YAML, where ``no`` and ``010`` are no texts."""
    words = {"y", "n", "yes", "no", "on", "off", "true", "false", "null"}
    plain = re.fullmatch(r"[A-Za-z][\w -]*|0|[1-9][0-9]{0,9}", text, re.ASCII)
    return text if plain and text.lower() not in words else "'" + text.replace("'", "''") + "'"


def _some(texts: Sequence[str]) -> str:
    return ", ".join(map(shown, texts[:5])) + (", ..." if len(texts) > 5 else "")


def _accepts(wanted: Wanted, name: str, label: str) -> bool:
    if wanted.accepts(name, label):
        return True
    try:
        return wanted.accepts(name, float(label))
    except (ValueError, OverflowError):
        return False
