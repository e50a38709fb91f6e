"""Which rows of a table of ranges count, and which tag took each of them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gaia_uwb._shared import Array, Float64, Int64, counted, shown
from gaia_uwb.logs._lever_arm import TagInput, tag_of, tag_text
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


WHERE_THEY_ARE = "say where each is on the vehicle, "
"""Before :func:`arms_wanted`."""


@dataclass(frozen=True)
class TagPlaces:
    """Where the tags of a vehicle are, and where that and ``where`` are to be written.

    Parameters
    ----------
    given
        Tag's id -> where its antenna is; empty if nothing is given.
    file
        The file that holds ``tags``.
    entry
        What holds ``where``.
    naming
        How to say which tag took what.
    """

    given: Mapping[str, TagInput]
    file: str = "gaia.yaml"
    entry: str = "this file's entry in gaia.yaml"
    naming: str = "map tag_id (ROS: fields: {tag: ...}), or set tag_id where each has its own log"


def choose_rows(
    table: Table,
    where: Mapping[str, Value | Sequence[Value]],
    columns: Sequence[str],
    places: TagPlaces,
) -> tuple[Table, str | None]:
    """Return the rows that count, and the column that names the tag, if one does.

    Parameters
    ----------
    table
        The ranges.
    where
        Column -> the value, or one of several, that it must have.
    columns
        Those that may name the tag.
    places
        Where the tags are.

    Raises
    ------
    InputError
        If no row has what is wanted, a column holds numbers that cannot be compared, or there are
        ranges of a tag of which it is not known where it is.
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
    if not places.given:
        _check_one_tag(table, columns, places)
    return replace(table, remarks=remarks), _tag_column(table, columns, places)


def tags_present(table: Table, name: str = "tag_id") -> list[str]:
    """Return the tags of which a table has ranges, as a column of it names them."""
    labels = [table.labels[name][code] for code in np.unique(table[name])]
    return list(dict.fromkeys(tag_text(label) for label in labels if label))


def check_given(table: Table, tags: Sequence[str], places: TagPlaces, column: str) -> None:
    """Refuse tags of which it is not given where they are.

    Raises
    ------
    InputError
        If there are such.
    """
    unknown = [tag for tag in tags if tag_of(tag, places.given) is None]
    if unknown:
        problem = (
            f"holds ranges of {_some(unknown)}, which tags in {places.file} (or in the vehicle's "
            f"file) lacks: add {_in_yaml(unknown[0])}: {{forward_m: ..., left_m: ...}} there, or "
            f"leave it out by where in {places.entry}"
        )
        raise table.error(problem, column=column)


def several_tags(tags: Sequence[str], places: TagPlaces, name: str | None = None) -> str:
    """Say that ranges are of several tags, and what to do if it is not given where they are.

    Parameters
    ----------
    tags
        Their ids.
    places
        Where to write what is missing.
    name
        By what ``where`` takes one of them; ``None`` if each has a file of its own.
    """
    one = f"take one by where: {{{name}: {_in_yaml(tags[0])}}} in {places.entry}"
    none = "name the files of one, or, if they are one, set the same tag_id for each file"
    return (
        f"holds ranges of {len(tags)} tags ({_some(tags)}): {WHERE_THEY_ARE}"
        f"{arms_wanted(tags[0], places)}, or {one if name else none}"
    )


def arms_wanted(tag: str, places: TagPlaces | None = None) -> str:
    """Return what to write where it is not given where several tags are, of which this is one."""
    file = TagPlaces({}).file if places is None else places.file
    return (
        f"tags: {{{_in_yaml(tag)}: {{forward_m: ..., left_m: ...}}, ...}} in {file} or in a "
        "vehicle's file (--vehicle)"
    )


def sources(table: Table) -> Int64[Array, "R"]:
    """Return a number for the anchor of each reading, and for its tag, where the table has tags."""
    anchor, tag = table["anchor_id"], table.get("tag_id")
    return anchor if tag is None else anchor * len(table.labels["tag_id"]) + tag


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


def _check_one_tag(table: Table, names: Sequence[str], places: TagPlaces) -> None:
    for name in names:
        tags = tags_present(table, name)
        if len(tags) > 1:
            one_anchor = any(len(table.labels[n]) == 1 for n in table.labels if n not in names)
            other = " (or is this the anchor's id?)" if one_anchor else ""
            problem = several_tags(tags, places, _in_yaml(name))
            raise table.error(f"{problem}{other}", column=name)


def _tag_column(table: Table, names: Sequence[str], places: TagPlaces) -> str | None:
    """Return the column that names the tag: of several, the one with the tags that are given."""
    if not places.given:
        return names[0] if len(names) == 1 else "tag_id" if "tag_id" in names else None
    present = {name: tags_present(table, name) for name in names}
    fitting = [n for n in names if all(tag_of(tag, places.given) for tag in present[n])]
    if fitting:
        return max(fitting, key=lambda name: (len(present[name]), name == "tag_id"))
    for name in sorted(names, key=lambda name: name != "tag_id"):
        if len(present[name]) > 1 or name.lower().startswith(("tag", "tid")):
            check_given(table, present[name], places, name)
    return None


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
