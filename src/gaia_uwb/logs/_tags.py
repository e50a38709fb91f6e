"""Which rows of a table of ranges count: those of one tag, as ``where`` says."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from gaia_uwb._shared import Array, InputError, shown
from gaia_uwb.logs._selection import Value, Wanted
from gaia_uwb.logs._table import Table

_TAG = re.compile(
    "tag|tag_?id|tag_name|tag_mac|tag_addr|tag_address|tid|initiator|initiator_id|from|from_?id|"
    "src_id|src_addr|source_id|mobile_id|rover_id"
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


def rows_where(table: Table, where: Mapping[str, Value | Sequence[Value]]) -> Array:
    """Return which rows of a table have the wanted values, as a mask.

    Raises
    ------
    InputError
        If none has.
    """
    wanted = Wanted(where)
    kept = np.ones(len(table), np.bool_)
    for name in wanted.fields:
        labels = table.labels[name]
        accepted = np.array([_accepts(wanted, name, label) for label in labels], np.bool_)
        if not accepted.any():
            held = ", ".join(map(shown, labels[:5])) + (", ..." if len(labels) > 5 else "")
            raise InputError(
                f"no row has what where wants; there are: {held}", source=table.path, column=name
            )
        kept &= accepted[table[name]]
    if not kept.any():
        raise InputError(f"no row has all of where: {', '.join(where)}", source=table.path)
    return kept


def check_one_tag(table: Table, names: Sequence[str], kept: Array, place: str) -> None:
    """Refuse ranges of several tags: their antennas are not in one place.

    Parameters
    ----------
    table
        The ranges.
    names
        Its columns that name the tag.
    kept
        Mask of the rows that count.
    place
        Where ``where`` is to be written.

    Raises
    ------
    InputError
        If a column has more than one value.
    """
    for name in names:
        codes = np.unique(table[name][kept])
        tags = [table.labels[name][code] for code in codes if table.labels[name][code]]
        if len(tags) > 1:
            some = ", ".join(map(shown, tags[:5])) + (", ..." if len(tags) > 5 else "")
            problem = (
                f"holds ranges of {len(tags)} tags ({some}), and one log is of one tag: "
                f"choose it by where: {{{name}: {tags[0]}}} in {place}"
            )
            raise InputError(problem, source=table.path, column=name)


def _accepts(wanted: Wanted, name: str, label: str) -> bool:
    if wanted.accepts(name, label):
        return True
    try:
        return wanted.accepts(name, float(label))
    except (ValueError, OverflowError):
        return False
