"""From tables to the parts of a scene, the same for GAIA's own format and for described logs."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np

from gaia_uwb._shared import Array, Float64, InputError, Int64, shown
from gaia_uwb.logs._cells import Kind
from gaia_uwb.logs._logs import check_number_of_anchors
from gaia_uwb.logs._placeholders import Drive, no_ranges
from gaia_uwb.logs._places import place_kinds, to_places
from gaia_uwb.logs._plausible import check_one_drive, check_seconds
from gaia_uwb.logs._table import Table, read_names, read_table
from gaia_uwb.scene import LocalFrame, RangeLog, Truth

_Table = TypeVar("_Table", bound=Table)


@dataclass(frozen=True)
class Anchors:
    """The anchors of the anchors table, then those that appear only in the ranges."""

    table: Table | None
    ids: tuple[str, ...]
    position_m: Float64[Array, "N 2"]
    up_m: Float64[Array, "N"] | None


def read_anchors(path: Path | None, frame: LocalFrame | None, ranged: tuple[str, ...]) -> Anchors:
    """Read the anchors table, if there is one, and append the anchors that only have ranges.

    Raises
    ------
    InputError
        If the table is wrong, or names an anchor twice.
    """
    if path is None:
        ids = tuple(sorted(ranged, key=_natural_key))
        return Anchors(None, ids, np.full((len(ids), 2), np.nan), None)
    survey, heights = place_kinds(path, Kind.OPTIONAL)
    optional = {"up_m": Kind.OPTIONAL, **heights}
    if {"up_m", "alt_m"} <= optional.keys() & set(read_names(path)):
        raise InputError("has both up_m and alt_m: keep one", source=path)
    table = read_table(path, {"anchor_id": Kind.TEXT, **survey}, optional)
    check_number_of_anchors(table)
    codes, labels = table["anchor_id"], table.labels["anchor_id"]
    listed = tuple(labels[code] for code in codes)
    if len(labels) < len(listed):
        index = next(k for k, label in enumerate(listed) if label in listed[:k])
        raise table.error(f"{shown(listed[index])} appears twice", index=index, column="anchor_id")
    places = to_places(table, frame)
    ids = listed + tuple(sorted(set(ranged) - set(listed), key=_natural_key))
    more = (0, len(ids) - len(listed))
    up_m = None if places.up_m is None else np.pad(places.up_m, more, constant_values=np.nan)
    return Anchors(
        table, ids, np.pad(places.position_m, (more, (0, 0)), constant_values=np.nan), up_m
    )


def _natural_key(anchor_id: str) -> tuple[Any, ...]:
    """Return a key that sorts ``cone-9`` before ``cone-10``."""
    words = re.split("([0-9]+)", anchor_id)
    numbers = [word.lstrip("0") for word in words[1::2]]
    words[1::2] = [f"{len(number):06d}{number}" for number in numbers]
    return (*words, anchor_id)


def ranges_of_drive(
    ranges: _Table, drive: Table, position_m: Float64[Array, "T 2"]
) -> tuple[_Table, list[str]]:
    """Leave out what is no range, and refuse ranges that cannot belong to the drive.

    Returns
    -------
    (Table, list of str)
        The ranges, and notes on what was left out.

    Raises
    ------
    InputError
        If no range is left, times do not overlap, or the unit is wrong.
    """
    check_seconds(ranges)
    none, notes = no_ranges(ranges, Drive(drive["t_s"], position_m))
    ranges = cast("_Table", ranges.take(~none)) if none.any() else ranges
    check_one_drive(ranges, drive, position_m)
    return ranges, notes


def range_log(ranges: Table, order: Int64[Array, "R"], ids: tuple[str, ...]) -> RangeLog:
    """Return the rows of a table of ranges in an order, pointing into ``ids``."""
    index_of = {anchor_id: index for index, anchor_id in enumerate(ids)}
    indices = np.array([index_of[label] for label in ranges.labels["anchor_id"]])
    return RangeLog(
        t_s=ranges["t_s"][order],
        anchor=indices[ranges["anchor_id"]][order],
        range_m=ranges["range_m"][order],
        rssi_dbm=_column(ranges, "rssi_dbm", order),
        rssi_fp_dbm=_column(ranges, "rssi_fp_dbm", order),
    )


def make_truth(
    ranges: Table, order: Int64[Array, "R"], anchors: Anchors, clock_offset_s: float | None
) -> Truth | None:
    """Return what was surveyed or simulated, if the place of every anchor was."""
    if not np.isfinite(anchors.position_m).all():
        return None
    return Truth(
        anchor_m=anchors.position_m,
        nlos=_column(ranges, "nlos", order),
        range_m=_column(ranges, "true_range_m", order),
        clock_offset_s=clock_offset_s,
        outlier=_column(ranges, "outlier", order),
        bias_m=_column(ranges, "true_bias_m", order),
    )


def _column(table: Table, name: str, order: Int64[Array, "R"]) -> Array | None:
    values = table.get(name)
    return None if values is None else values[order]
