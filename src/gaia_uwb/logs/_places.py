"""The places in a table: ``east_m,north_m[,up_m]``, or ``lat,lon[,alt_m]`` to be projected."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gaia_uwb._shared import Array, Float64, InputError
from gaia_uwb.logs._cells import Kind
from gaia_uwb.logs._plausible import check_geodetic, check_near, check_site
from gaia_uwb.logs._table import Table, read_names
from gaia_uwb.projection import to_local
from gaia_uwb.scene import LocalFrame


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
    if on_site:
        return {"east_m": kind, "north_m": kind}, {"up_m": kind}
    if not on_earth:
        return {}, {}
    if {"up_m", "alt_m"} <= names and kind is Kind.OPTIONAL:
        raise InputError("has both up_m and alt_m: keep one", source=path)
    return {"lat": kind, "lon": kind}, {"alt_m": kind}


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


def to_places(table: Table, frame: LocalFrame | None) -> Places:
    """Return a table's places in the local frame.

    Raises
    ------
    InputError
        If places are impossible, far from the frame's origin or each other, or those on Earth have
        no frame.
    """
    up_m = table.get("up_m")
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
