"""Tables with any column names: a map says which column is what, and in which unit.

A column is named, or named with a scale: ``t_s: {column: time_ms, scale: 0.001}``. Times may be
dates: ``t_s: {column: time, iso: true}``, or ``{columns: [date, time], iso: true}`` where they
stand apart. Ranges are one per row (``anchor_id``, ``range_m``) or in one column per anchor
(``anchors: {cone-1: d1, cone-2: d2}``). An empty cell, or a number that ``missing`` lists, is no
range, and an empty angle is unknown.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import numpy as np
from pydantic import ValidationError

from gaia_uwb._shared import Array, InputError
from gaia_uwb.config import Settings
from gaia_uwb.logs._cells import Kind
from gaia_uwb.logs._cones import ENDS
from gaia_uwb.logs._dates import column_seconds
from gaia_uwb.logs._lever_arm import TagInput
from gaia_uwb.logs._logs import LogTable, check_number_of_anchors, from_table, join
from gaia_uwb.logs._selection import Value
from gaia_uwb.logs._stamps import StampOptions
from gaia_uwb.logs._table import Table, read_names, read_table
from gaia_uwb.logs._tags import TagPlaces, choose_rows, gaps_remark, tag_columns, with_nothing
from gaia_uwb.logs.csv_columns import (
    Column,
    ConeColumns,
    RangeColumns,
    TrajectoryColumns,
)


def read_trajectory(
    path: Path, columns: TrajectoryColumns | None, stamps: StampOptions
) -> tuple[LogTable, list[str]]:
    """Read a trajectory.

    Parameters
    ----------
    path
        CSV or Parquet file.
    columns
        Which column is what; ``None``: they bear GAIA's own names.
    stamps
        How to read dates and times without a zone.

    Returns
    -------
    LogTable
        ``t_s`` in seconds; ``lat``, ``lon`` in degrees or ``east_m``, ``north_m`` in metres, and
        heights and attitude if they are mapped.
    list of str
        Notes on how the file was read.

    Raises
    ------
    InputError
        If the file cannot be read, lacks a column, or a cell is wrong.
    """
    columns = _own(path, TrajectoryColumns) if columns is None else columns
    table = read_table(path, _kinds(path, _columns(columns)))
    log = _log_table(table, _columns(columns), stamps)
    if "down_m" in log:
        values = {name: values for name, values in log.columns.items() if name != "down_m"}
        names = {**log.names, "up_m": log.names["down_m"]}
        log = replace(log, columns={**values, "up_m": -log["down_m"]}, names=names)
    return log, list(table.remarks)


def read_ranges(
    path: Path,
    columns: RangeColumns | None,
    stamps: StampOptions,
    *,
    where: Mapping[str, Value | Sequence[Value]] | None = None,
    missing: Sequence[float | int] = (),
    tags: Mapping[str, TagInput] | None = None,
) -> tuple[LogTable, list[str]]:
    """Read ranges.

    Parameters
    ----------
    path, columns, stamps
        Like those of :func:`read_trajectory`.
    where
        Column -> the value, or one of several, that it must have in the rows that count.
    missing
        Numbers that mean "no range", as the file holds them, before they are scaled.
    tags
        Tag's id -> where it is on the vehicle, if that is given.

    Returns
    -------
    LogTable
        ``t_s`` in seconds, ``anchor_id``, ``range_m`` in metres, powers in dBm, angles of arrival,
        and ``tag_id`` where a column tells.
    list of str
        Notes on how the file was read and what was left out.

    Raises
    ------
    InputError
        Like :func:`read_trajectory`; and if there is no range, or there are ranges of a tag of
        which it is not known where it is.
    """
    where = {} if where is None else where
    columns = _own(path, RangeColumns) if columns is None else columns
    mapped = _columns(columns)
    if columns.anchors is not None:
        mapped = {f"anchor {k}": _column(c) for k, c in enumerate(columns.anchors.values())}
        mapped = {"t_s": _column(columns.t_s), **mapped}
    kinds = _kinds(path, mapped)
    own = () if columns.tag_id is None else (columns.tag_id,)
    choices = {name: Kind.ANYTHING for name in (*where, *own) if name not in kinds}
    others = [name for name in tag_columns(read_names(path)) if name not in {*kinds, *own}]
    table = read_table(path, kinds | choices, dict.fromkeys(others, Kind.ANYTHING))
    names = own if own and tags else (*own, *others)
    table, tag = choose_rows(table, where, names, TagPlaces(tags or {}))
    notes = list(table.remarks)
    log = _log_table(table, mapped, stamps, missing)
    log = log if tag is None else _with_texts(log, {"tag_id": (tag, table)})
    if columns.anchors is None:
        check_number_of_anchors(log)
    n_gaps = sum(int((~np.isfinite(log[name])).sum()) for name in mapped if _is_range(name))
    log = _without_gaps(log) if columns.anchors is None else _unfold(log, columns.anchors)
    return log, [*notes, gaps_remark(table, n_gaps, missing)] if n_gaps else notes


def _without_gaps(log: LogTable) -> LogTable:
    """Return the rows that have a range."""
    there = np.isfinite(log["range_m"])
    if not there.any():
        raise log.error("contains no ranges", column="range_m")
    return log if there.all() else log.take(there)


def _unfold(wide: LogTable, anchors: Mapping[str, str | Column]) -> LogTable:
    """Return a table with one column per anchor as one with a range per row."""
    parts = []
    for k, anchor_id in enumerate(anchors):
        name = f"anchor {k}"
        kept = wide.take(np.isfinite(wide[name]))
        if not len(kept):
            continue
        values = {"t_s": kept["t_s"], "range_m": kept[name]}
        values["anchor_id"] = np.zeros(len(kept), np.int64)
        labels = {**kept.labels, "anchor_id": (anchor_id,)}
        values |= {"tag_id": kept["tag_id"]} if "tag_id" in kept else {}
        names = {**kept.names, "range_m": wide.names[name]}
        parts.append(replace(kept, columns=values, labels=labels, names=names))
    if not parts:
        raise InputError("contains no ranges in the columns of the anchors", source=wide.path)
    return join(parts)


def read_cone_ranges(path: Path, columns: ConeColumns | None, stamps: StampOptions) -> LogTable:
    """Read ranges between cones.

    Parameters
    ----------
    path, columns, stamps
        Like those of :func:`read_trajectory`.

    Returns
    -------
    LogTable
        ``anchor_a``, ``anchor_b``, ``range_m`` in metres and, if it is mapped, ``t_s`` in seconds.

    Raises
    ------
    InputError
        Like :func:`read_trajectory`.
    """
    columns = _own(path, ConeColumns) if columns is None else columns
    mapped = _columns(columns)
    table = read_table(path, _kinds(path, mapped))
    log = _log_table(table, {name: c for name, c in mapped.items() if name not in ENDS}, stamps)
    log = _with_texts(log, {end: (getattr(columns, end), table) for end in ENDS})
    return replace(log, remarks=table.remarks)


def _with_texts(log: LogTable, texts: Mapping[str, tuple[str, Table]]) -> LogTable:
    """Return a table with more columns of text: our name -> a file's column and its table."""
    columns = {name: table[theirs] for name, (theirs, table) in texts.items()}
    labels = {name: table.labels[theirs] for name, (theirs, table) in texts.items()}
    names = {name: theirs for name, (theirs, _) in texts.items()}
    return replace(
        log,
        columns={**log.columns, **columns},
        labels={**log.labels, **labels},
        names={**log.names, **names},
    )


M = TypeVar("M", TrajectoryColumns, RangeColumns, ConeColumns)


def _own(path: Path, model: type[M]) -> M:
    """Return the map of a table whose columns bear our names."""
    names = [name for name in read_names(path) if name in model.model_fields]
    try:
        return model.model_validate({name: name for name in names})
    except ValidationError as error:
        wanted = ", ".join(name for name in model.model_fields if name != "anchors")
        problem = f"has not the columns of GAIA's own format ({wanted}): map them by columns"
        raise InputError(problem, source=path) from error


def _column(given: str | Column) -> Column:
    return Column(column=given) if isinstance(given, str) else given


def _columns(columns: Settings) -> dict[str, Column]:
    """Return our name -> column, for what is mapped."""
    names = (name for name in type(columns).model_fields if name != "tag_id")
    given = ((name, getattr(columns, name)) for name in names)
    return {
        name: _column(column)
        for name, column in given
        if column is not None and not isinstance(column, dict)
    }


def _kinds(path: Path, columns: Mapping[str, Column]) -> dict[str, Kind]:
    """Return what each of the file's columns must hold."""
    kinds: dict[str, Kind] = {}
    for name, column in columns.items():
        kind = Kind.TEXT if column.iso else _kind(name)
        for theirs in column.names:
            if kinds.setdefault(theirs, kind) is not kind:
                raise InputError(
                    "is mapped twice: as text and as a number", source=path, column=name
                )
    return kinds


def _log_table(
    table: Table,
    columns: Mapping[str, Column],
    stamps: StampOptions,
    missing: Sequence[float | int] = (),
) -> LogTable:
    """Return the mapped columns under our names and in our units."""
    ours = {name: _values(table, name, column, stamps, missing) for name, column in columns.items()}
    ids = columns.get("anchor_id")
    labels = {} if ids is None else {"anchor_id": table.labels[ids.names[0]]}
    names = {name: " and ".join(column.names) for name, column in columns.items()}
    return from_table(table, ours, labels=labels, names=names)


def _is_range(name: str) -> bool:
    return name.startswith(("range_m", "anchor ")) and name != "anchor_id"


def _kind(name: str) -> Kind:
    if name in {"anchor_id", *ENDS}:
        return Kind.TEXT
    return Kind.NUMBER if name == "t_s" else Kind.OPTIONAL  # an empty cell: no fix, no range


def _values(
    table: Table, name: str, column: Column, stamps: StampOptions, missing: Sequence[float | int]
) -> Array:
    if column.iso:
        hours, order = stamps.utc_offset_h, stamps.date_order
        return column_seconds(table, column.names, utc_offset_h=hours, order=order)
    values = table[column.names[0]]
    if name == "anchor_id":
        return values
    if _is_range(name):
        values = with_nothing(values, missing)
    scale = -column.scale if column.clockwise else column.scale
    with np.errstate(over="ignore"):  # what comes out as infinite is refused as such
        return values if scale == 1 else np.asarray(values * scale)
