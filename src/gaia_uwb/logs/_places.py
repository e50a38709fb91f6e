"""The places in a table: ``east_m,north_m`` or ``lat,lon``, and heights: ``up_m`` or ``alt_m``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar, cast

import numpy as np

from gaia_uwb._shared import Array, Float64, InputError, counted
from gaia_uwb.logs._cells import Kind
from gaia_uwb.logs._logs import LogTable
from gaia_uwb.logs._plausible import check_geodetic, check_near, check_site
from gaia_uwb.logs._table import Table, read_names
from gaia_uwb.projection import to_local
from gaia_uwb.scene import LocalFrame

T = TypeVar("T", bound=Table)

_MAX_HEIGHT_M = 1e5
_NEAR_DEG = 1.0
"""Nearer to latitude 0, longitude 0 than this, a drive may go through it."""


@dataclass(frozen=True)
class Places:
    """Places in the local frame, in metres; NaN where unknown, ``None`` if no height is known."""

    position_m: Float64[Array, "R 2"]
    up_m: Float64[Array, "R"] | None


def place_kinds(path: Path, kind: Kind) -> tuple[dict[str, Kind], dict[str, Kind]]:
    """Return the required and the optional columns of a table's places; the former may be none.

    Raises
    ------
    InputError
        If the table gives them in two ways.
    """
    names = set(read_names(path))
    on_site, on_earth = names & {"east_m", "north_m"}, names & {"lat", "lon"}
    if on_site and on_earth:
        raise InputError("has both east_m,north_m and lat,lon: keep one pair", source=path)
    height = {"up_m": kind} if "up_m" in names else {"alt_m": kind}
    if on_site:
        return {"east_m": kind, "north_m": kind}, height
    if not on_earth:
        return {}, height
    return {"lat": kind, "lon": kind}, {"alt_m": kind}


def only_fixes(drive: T) -> tuple[T, list[str]]:
    """Leave out the rows of a trajectory where the receiver knew no place, yet.

    Parameters
    ----------
    drive
        With the columns of :func:`place_kinds`.

    Returns
    -------
    Table
        The rows that have a place and do not stand at latitude 0, longitude 0 (if others do not
        stand near it): so receivers write it until they have a fix.
    list of str
        Notes on the rows that were left out.

    Raises
    ------
    InputError
        If no row is left, or a row that is left has no height where others have one.
    """
    east, north = ("lon", "lat") if "lat" in drive else ("east_m", "north_m")
    notes = []
    known = np.isfinite(drive[east]) & np.isfinite(drive[north])
    if not known.all():
        notes.append(_left_out(drive, ~known, "without a place"))
        if not known.any():
            raise drive.error("no row has a place", column=north)
        drive = cast(T, drive.take(known))
    at_zero = (drive[east] == 0) & (drive[north] == 0)
    away_deg = np.hypot(drive[east], drive[north])[~at_zero]
    if north == "lat" and at_zero.any() and len(away_deg) and away_deg.min() > _NEAR_DEG:
        notes.append(_left_out(drive, at_zero, "at latitude 0, longitude 0 (no fix)"))
        drive = cast(T, drive.take(~at_zero))
    for name in ("up_m", "alt_m"):
        unknown = ~np.isfinite(drive[name]) if name in drive else np.zeros(0, np.bool_)
        if unknown.any():
            index = int(np.argmax(unknown))
            raise drive.error("expected a finite number, got nothing", index=index, column=name)
    return drive, notes


def _left_out(table: Table, rows: Array, what: str) -> str:
    """Return the note on rows that are left out."""
    index = int(np.argmax(rows))
    row = table.error("", index=index).row
    if isinstance(table, LogTable):
        row = int(table.number[index])
    some = counted(int(rows.sum()), "row")
    return f"{table.path.name}: skipped {some} {what}, the first is row {row}"


def first_place(table: Table) -> LocalFrame | None:
    """Return the local frame at a table's first place, if the table has places on Earth.

    Raises
    ------
    InputError
        If a latitude, longitude or height cannot be one.
    """
    if "lat" not in table:
        return None
    check_geodetic(table)
    alt_m = float(table["alt_m"][0]) if "alt_m" in table else 0.0
    return LocalFrame(float(table["lat"][0]), float(table["lon"][0]), alt_m)


def _above_origin(table: Table, frame: LocalFrame | None) -> Float64[Array, "R"]:
    """Return ellipsoidal heights as heights above the origin; without a frame that is at 0."""
    alt_m = table["alt_m"]
    wrong = np.abs(alt_m) > _MAX_HEIGHT_M
    if wrong.any():
        index = int(np.argmax(wrong))
        problem = f"expected metres between -1e5 and 1e5, got {alt_m[index]:g}"
        raise table.error(problem, index=index, column="alt_m")
    return alt_m - (0.0 if frame is None else frame.alt_m)


def to_places(table: Table, frame: LocalFrame | None) -> Places:
    """Return a table's places in the local frame.

    Raises
    ------
    InputError
        If places are impossible, far from the frame's origin or each other, or those on Earth have
        no frame.
    """
    up_m = table.get("up_m")
    if up_m is None and "lat" not in table and "alt_m" in table:
        up_m = _above_origin(table, frame)
    check_site(table)
    if "east_m" in table:
        return Places(np.column_stack([table["east_m"], table["north_m"]]), up_m)
    position_m = np.full((len(table), 2), np.nan)
    if "lat" not in table:
        return Places(position_m, up_m)
    if frame is None:
        problem = "positions in lat,lon need a local frame: add frame to scene.yaml"
        raise table.error(problem, column="lat")
    check_geodetic(table)
    alt_m = table.get("alt_m")
    known = np.isfinite(table["lat"]) & np.isfinite(table["lon"])
    # A place of unknown height is taken at the origin's; its own height stays unknown.
    height_m = np.full(len(table), frame.alt_m) if alt_m is None else alt_m
    height_m = np.where(np.isfinite(height_m), height_m, frame.alt_m)
    position_m[known], above_m = to_local(
        frame, table["lat"][known], table["lon"][known], height_m[known]
    )
    check_near(table, position_m, frame, column="lat")
    if alt_m is not None:
        up_m = np.full(len(table), np.nan)
        up_m[known] = above_m
        up_m[~np.isfinite(alt_m)] = np.nan
    return Places(position_m, up_m)
