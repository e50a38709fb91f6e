"""Tables with any column names: a map says which column is what, and in which unit.

A column is named, or named with a scale: ``t_s: {column: time_ms, scale: 0.001}``. Times may be
dates: ``t_s: {column: time, iso: true}``, or ``{columns: [date, time], iso: true}`` where they
stand apart. Ranges are one per row (``anchor_id``, ``range_m``) or in one column per anchor
(``anchors: {cone-1: d1, cone-2: d2}``). An empty cell, or a number that ``missing`` lists, is no
range.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, TypeVar

import numpy as np
from pydantic import Field, ValidationError, model_validator

from gaia_uwb._shared import Array, InputError
from gaia_uwb.config import Settings
from gaia_uwb.logs._cells import Kind
from gaia_uwb.logs._dates import column_seconds
from gaia_uwb.logs._logs import MAX_ANCHORS, LogTable, check_number_of_anchors, from_table, join
from gaia_uwb.logs._selection import Value
from gaia_uwb.logs._stamps import StampOptions
from gaia_uwb.logs._table import Table, read_names, read_table
from gaia_uwb.logs._tags import choose_rows, gaps_remark, tag_columns, with_nothing

_Name = Annotated[str, Field(min_length=1)]


class Column(Settings):
    """A column and its unit."""

    column: _Name | None = None
    """Its name in the file."""
    columns: Annotated[list[_Name], Field(min_length=2, max_length=2)] | None = None
    """Instead: names of the columns of date and time (``t_s`` only)."""
    scale: float = Field(default=1.0, ge=-1e12, le=1e12)
    """Our unit (seconds, metres, degrees, dBm) per unit of the file; below 0 for heights only, in a
    file that counts down."""
    iso: bool = False
    """Dates and times instead of numbers (``t_s`` only)."""

    @model_validator(mode="after")
    def _possible(self) -> Column:
        if (self.column is None) is (self.columns is None):
            raise ValueError("give column, or columns: [date, time]")
        if self.columns is not None and not self.iso:
            raise ValueError("two columns hold a date and a time: add iso: true")
        if abs(self.scale) < 1e-12:
            raise ValueError("a scale of 0 leaves nothing")
        return self

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns in the file."""
        return (self.column,) if self.column is not None else tuple(self.columns or ())


_Given = _Name | Column
_HEIGHTS = ("alt_m", "up_m", "down_m")


def _check_scales(columns: Settings) -> None:
    """Refuse what only some columns can be: upside down, or dates."""
    for name in type(columns).model_fields:
        given = getattr(columns, name)
        for each in given.values() if isinstance(given, dict) else [given]:
            if isinstance(each, Column) and each.scale < 0 and name not in _HEIGHTS:
                raise ValueError(f"{name}: a scale below 0 is for heights only")
            if isinstance(each, Column) and each.iso and name != "t_s":
                raise ValueError(f"{name}: iso is for t_s only")


class TrajectoryColumns(Settings):
    """Where a table keeps the trajectory: on Earth, or on site."""

    t_s: _Given = "t_s"
    lat: _Given | None = None
    lon: _Given | None = None
    alt_m: _Given | None = None
    east_m: _Given | None = None
    north_m: _Given | None = None
    up_m: _Given | None = None
    down_m: _Given | None = None
    """Instead of ``up_m``: metres below the origin, as in north, east, down."""

    @model_validator(mode="after")
    def _one_kind_of_place(self) -> TrajectoryColumns:
        _check_scales(self)
        earth = self.lat is not None and self.lon is not None
        site = self.east_m is not None and self.north_m is not None
        some = {name for name in ("lat", "lon", "alt_m") if getattr(self, name) is not None}
        local = ("east_m", "north_m", "up_m", "down_m")
        other = {name for name in local if getattr(self, name) is not None}
        if earth is site or (some and other) or {"up_m", "down_m"} <= other:
            raise ValueError(
                "give either lat and lon [and alt_m], or east_m and north_m [and up_m or down_m]"
            )
        return self


class RangeColumns(Settings):
    """Where a table keeps the ranges: one per row, or one column per anchor."""

    t_s: _Given = "t_s"
    anchor_id: _Name | None = None
    range_m: _Given | None = None
    rssi_dbm: _Given | None = None
    rssi_fp_dbm: _Given | None = None
    anchors: dict[_Name, _Given] | None = None
    """Anchor -> its column of ranges."""

    @model_validator(mode="after")
    def _one_layout(self) -> RangeColumns:
        _check_scales(self)
        per_row = (self.anchor_id, self.range_m, self.rssi_dbm, self.rssi_fp_dbm)
        if self.anchors is None and (self.anchor_id is None or self.range_m is None):
            raise ValueError("give anchor_id and range_m, or anchors")
        if self.anchors is not None and any(each is not None for each in per_row):
            raise ValueError("give anchor_id and range_m, or anchors, not both")
        if self.anchors is not None and not 0 < len(self.anchors) <= MAX_ANCHORS:
            raise ValueError("anchors must name at least one column")
        return self


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
        the heights if they are mapped.
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

    Returns
    -------
    LogTable
        ``t_s`` in seconds, ``anchor_id``, ``range_m`` in metres, powers in dBm.
    list of str
        Notes on how the file was read and what was left out.

    Raises
    ------
    InputError
        Like :func:`read_trajectory`; and if there is no range, or there are ranges of several tags.
    """
    where = {} if where is None else where
    columns = _own(path, RangeColumns) if columns is None else columns
    mapped = _columns(columns)
    if columns.anchors is not None:
        mapped = {f"anchor {k}": _column(c) for k, c in enumerate(columns.anchors.values())}
        mapped = {"t_s": _column(columns.t_s), **mapped}
    kinds = _kinds(path, mapped)
    choices = {name: Kind.ANYTHING for name in where if name not in kinds}
    tags = [name for name in tag_columns(read_names(path)) if name not in kinds]
    table = read_table(path, kinds | choices, dict.fromkeys(tags, Kind.ANYTHING))
    table = choose_rows(table, where, tags, "this file's entry in gaia.yaml")
    notes = list(table.remarks)
    log = _log_table(table, mapped, stamps, missing)
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
        labels = {"anchor_id": (anchor_id,)}
        names = {"t_s": wide.names["t_s"], "range_m": wide.names[name]}
        parts.append(replace(kept, columns=values, labels=labels, names=names))
    if not parts:
        raise InputError("contains no ranges in the columns of the anchors", source=wide.path)
    return join(parts)


M = TypeVar("M", TrajectoryColumns, RangeColumns)


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
    given = ((name, getattr(columns, name)) for name in type(columns).model_fields)
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
    if name == "anchor_id":
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
    with np.errstate(over="ignore"):  # what comes out as infinite is refused as such
        return values if column.scale == 1 else np.asarray(values * column.scale)
