"""Tables with any column names: a map says which column is what, and in which unit.

A column is named, or named with a scale: ``t_s: {column: time_ms, scale: 0.001}``. Times may be ISO
dates: ``t_s: {column: time, iso: true}``. Ranges are one per row (``anchor_id``, ``range_m``) or in
one column per anchor (``anchors: {cone-1: d1, cone-2: d2}``), where an empty cell means no range.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field, model_validator

from gaia_uwb._shared import Array, InputError
from gaia_uwb.config import Settings
from gaia_uwb.logs._cells import Kind
from gaia_uwb.logs._logs import MAX_ANCHORS, LogTable, join
from gaia_uwb.logs._stamps import StampOptions, Stamps
from gaia_uwb.logs._table import Table, read_table

_Name = Annotated[str, Field(min_length=1)]


class Column(Settings):
    """A column and its unit."""

    column: _Name
    """Its name in the file."""
    scale: float = Field(default=1.0, ge=1e-12, le=1e12)
    """Our unit (seconds, metres, degrees, dBm) per unit of the file."""
    iso: bool = False
    """Dates and times instead of numbers (``t_s`` only)."""


_Given = _Name | Column


class TrajectoryColumns(Settings):
    """Where a table keeps the trajectory: on Earth, or on site."""

    t_s: _Given = "t_s"
    lat: _Given | None = None
    lon: _Given | None = None
    alt_m: _Given | None = None
    east_m: _Given | None = None
    north_m: _Given | None = None
    up_m: _Given | None = None

    @model_validator(mode="after")
    def _one_kind_of_place(self) -> TrajectoryColumns:
        earth = self.lat is not None and self.lon is not None
        site = self.east_m is not None and self.north_m is not None
        some = {name for name in ("lat", "lon", "alt_m") if getattr(self, name) is not None}
        other = {name for name in ("east_m", "north_m", "up_m") if getattr(self, name) is not None}
        if earth is site or (some and other):
            raise ValueError(
                "give either lat and lon [and alt_m], or east_m and north_m [and up_m]"
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
        per_row = (self.anchor_id, self.range_m, self.rssi_dbm, self.rssi_fp_dbm)
        if self.anchors is None and (self.anchor_id is None or self.range_m is None):
            raise ValueError("give anchor_id and range_m, or anchors")
        if self.anchors is not None and any(each is not None for each in per_row):
            raise ValueError("give anchor_id and range_m, or anchors, not both")
        if self.anchors is not None and not 0 < len(self.anchors) <= MAX_ANCHORS:
            raise ValueError("anchors must name at least one column")
        return self


def read_trajectory(path: Path, columns: TrajectoryColumns, stamps: StampOptions) -> LogTable:
    """Read a trajectory.

    Parameters
    ----------
    path
        CSV or Parquet file.
    columns
        Which column is what.
    stamps
        How to read ISO times without a zone.

    Returns
    -------
    LogTable
        ``t_s`` in seconds; ``lat``, ``lon`` in degrees or ``east_m``, ``north_m`` in metres, and
        the heights if they are mapped.

    Raises
    ------
    InputError
        If the file cannot be read, lacks a column, or a cell is wrong.
    """
    return _read(path, _columns(columns), {}, stamps)


def read_ranges(path: Path, columns: RangeColumns, stamps: StampOptions) -> LogTable:
    """Read ranges.

    Parameters
    ----------
    path, columns, stamps
        Like those of :func:`read_trajectory`.

    Returns
    -------
    LogTable
        ``t_s`` in seconds, ``anchor_id``, ``range_m`` in metres, powers in dBm.

    Raises
    ------
    InputError
        Like :func:`read_trajectory`; and if there is no range.
    """
    if columns.anchors is None:
        return _read(path, _columns(columns), {"anchor_id": Kind.TEXT}, stamps)
    anchors = {f"anchor {k}": _column(c) for k, c in enumerate(columns.anchors.values())}
    wide = _read(path, {"t_s": _column(columns.t_s), **anchors}, {}, stamps)
    parts = []
    for name, anchor_id in zip(anchors, columns.anchors, strict=True):
        kept = wide.take(np.isfinite(wide[name]))
        if not len(kept):
            continue
        values = {"t_s": kept["t_s"], "range_m": kept[name]}
        values["anchor_id"] = np.zeros(len(kept), np.int64)
        labels = {"anchor_id": (anchor_id,)}
        names = {"t_s": wide.names["t_s"], "range_m": wide.names[name]}
        parts.append(replace(kept, columns=values, labels=labels, names=names))
    if not parts:
        raise InputError("contains no ranges in the columns of the anchors", source=path)
    return join(parts)


def _column(given: str | Column) -> Column:
    return Column(column=given) if isinstance(given, str) else given


def _columns(columns: Settings) -> dict[str, Column]:
    """Return our name -> column, for what is mapped."""
    given = ((name, getattr(columns, name)) for name in type(columns).model_fields)
    return {name: _column(column) for name, column in given if column is not None}


def _read(
    path: Path, columns: Mapping[str, Column], kinds: Mapping[str, Kind], stamps: StampOptions
) -> LogTable:
    """Return the mapped columns under our names and in our units."""
    wanted: dict[str, Kind] = {}
    for name, column in columns.items():
        kind = Kind.TEXT if column.iso else kinds.get(name, _kind(name))
        if wanted.setdefault(column.column, kind) is not kind:
            raise InputError("is mapped twice: as text and as a number", source=path, column=name)
    table = read_table(path, wanted)
    ours = {name: _values(table, name, column, stamps) for name, column in columns.items()}
    labels = {"anchor_id": table.labels[columns["anchor_id"].column]} if kinds else {}
    return LogTable(
        path=path,
        columns=ours,
        labels=labels,
        unknown=table.unknown,
        number=np.arange(len(table), dtype=np.int64) + (1 if path.suffix == ".parquet" else 2),
        origin=np.zeros(len(table), np.int64),
        origins=(f"{path}, row",),
        names={name: column.column for name, column in columns.items()},
    )


def _kind(name: str) -> Kind:
    optional = name.startswith(("rssi", "anchor "))
    return Kind.OPTIONAL if optional else Kind.NUMBER


def _values(table: Table, name: str, column: Column, stamps: StampOptions) -> Array:
    values = table[column.column]
    if name == "anchor_id":
        return values
    if not column.iso:
        with np.errstate(over="ignore"):  # what comes out as infinite is refused as such
            return values if column.scale == 1 else np.asarray(values * column.scale)
    if name != "t_s":
        raise InputError("iso is for t_s only", source=table.path, column=column.column)
    reader = Stamps(stamps)
    seconds = [reader.iso_s(text) for text in table.labels[column.column]]
    if None in seconds:
        index = int(np.argmax(values == seconds.index(None)))
        text = table.labels[column.column][seconds.index(None)]
        problem = f"expected an ISO date and time, got {text[:40]!r}"
        raise table.error(problem, index=index, column=column.column)
    return np.array(seconds, np.float64)[values]
