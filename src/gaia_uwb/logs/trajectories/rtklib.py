"""Solutions of RTKLIB (``.pos``): the usual file of a drive that was processed after it.

Above the rows stands a line like ``%  GPST  latitude(deg) longitude(deg) height(m) Q ns ...``: it
says whether times are GPS time, UTC or JST, and what the positions are. GPS time is brought to UTC.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from itertools import islice
from pathlib import Path
from typing import Literal

import numpy as np

from gaia_uwb._shared import Array, Float64, InputError
from gaia_uwb.logs._cells import Kind
from gaia_uwb.logs._dates import column_seconds
from gaia_uwb.logs._dialect import sniff
from gaia_uwb.logs._logs import LogTable, from_table, read_lines
from gaia_uwb.logs._table import Table, read_table
from gaia_uwb.logs.trajectories import fixes
from gaia_uwb.logs.trajectories.gps_time import GPS_EPOCH_S, WEEK_S, gps_ahead_s

_CLOCKS = ("GPST", "UTC", "JST")
_JST_AHEAD_S = 9 * 3600.0
_MOST_LINES_ABOVE = 1000
_RANKS = {
    1: fixes.RTK_FIXED,
    2: fixes.RTK_FLOAT,
    3: fixes.SBAS,
    4: fixes.DIFFERENTIAL,
    5: fixes.SINGLE,
    6: fixes.PPP,
}
_PLACES: dict[tuple[str, ...], tuple[str, ...]] = {
    ("latitude(deg)", "longitude(deg)", "height(m)"): ("lat", "lon", "alt_m"),
    ("x-ecef(m)", "y-ecef(m)", "z-ecef(m)"): ("x_m", "y_m", "z_m"),
    ("e-baseline(m)", "n-baseline(m)", "u-baseline(m)"): ("east_m", "north_m", "up_m"),
    ("latitude(d'\")", "longitude(d'\")", "height(m)"): (
        *("lat_d", "lat_m", "lat_s", "lon_d", "lon_m", "lon_s", "alt_m"),
    ),
}


def read_rtklib(path: Path, clock: Literal["utc", "gps"] = "utc") -> tuple[LogTable, list[str]]:
    """Read a solution of RTKLIB.

    Parameters
    ----------
    path
        The ``.pos`` file.
    clock
        The clock of the ranges, into which times are brought.

    Returns
    -------
    LogTable
        ``t_s`` in seconds; ``lat`` and ``lon`` in degrees and ``alt_m`` in metres, or for a
        baseline ``east_m``, ``north_m`` and ``up_m`` in metres from the base.
    list of str
        Notes: the clock, and the quality of the fixes.

    Raises
    ------
    InputError
        If the file cannot be read, has no header line, or a cell is wrong.
    """
    header, first, heights = _header(path)
    places = _PLACES[tuple(header[1:4])]
    dated = "/" in re.split(r"[\s,;]", first)[0]
    in_one = dated and re.search("[,;\t]", first)  # then a blank is within the first cell
    times = ("time",) if in_one else ("date", "time") if dated else ("week", "tow_s")
    names = (*times, *places, *header[4:])
    kinds = dict.fromkeys(times, Kind.TEXT if dated else Kind.NUMBER)
    kinds |= dict.fromkeys(places, Kind.NUMBER)
    optional = {"Q": Kind.INTEGER}
    table = read_table(path, kinds, optional, dialect=sniff(path, names))
    t_s = (
        column_seconds(table, times)
        if dated
        else GPS_EPOCH_S + WEEK_S * table["week"] + table["tow_s"]
    )
    t_s, notes = _in_clock(path, t_s, header[0], clock)
    log = from_table(table, {"t_s": t_s, **_places(table)})
    quality = table["Q"] if "Q" in table else np.zeros(len(table), np.int64)
    rank = np.full(len(table), fixes.UNKNOWN, np.int64)
    for code, each in _RANKS.items():
        rank[quality == code] = each
    log, counted = fixes.keep_best(log, t_s, rank)
    return log, notes + heights + counted


def _header(path: Path) -> tuple[list[str], str, list[str]]:
    """Return the words of the line that names the columns, the first row, and a note on heights."""
    words: list[str] | None = None
    notes: list[str] = []
    for _, line in islice(read_lines(path), _MOST_LINES_ABOVE):
        if not line.startswith("%"):
            if line and words is not None:
                return words, line, notes
            if line:
                break
            continue
        if "/geodetic" in line:
            notes = [f"{path.name}: heights are above the geoid"]
        found = re.split(r"[\s,;]+", line.lstrip("% "))
        if found[0] in _CLOCKS and tuple(found[1:4]) in _PLACES:
            words = found
    if words is not None:
        raise InputError("has no rows", source=path)
    problem = "has no line like '%  GPST  latitude(deg) longitude(deg) height(m) Q' above its rows"
    raise InputError(problem, source=path)


def _in_clock(
    path: Path, t_s: Float64[Array, "R"], theirs: str, ours: Literal["utc", "gps"]
) -> tuple[Float64[Array, "R"], list[str]]:
    """Bring times from the file's clock into the ranges' clock."""
    if theirs == "JST":
        t_s = t_s - _JST_AHEAD_S
    ahead_s = gps_ahead_s(t_s)
    if (theirs == "GPST") is (ours == "gps"):
        return t_s, []
    step = f"{ahead_s[0]:g} leap seconds"
    if ours == "gps":
        return t_s + ahead_s, [f"{path.name}: times are UTC: brought to GPS time by {step}"]
    note = f"{path.name}: times are GPS time: brought to UTC by {step} (clock: gps keeps them)"
    return t_s - ahead_s, [note]


def _places(table: Table) -> Mapping[str, Array]:
    if "x_m" in table:
        return _on_earth(table)
    if "lat_d" not in table:
        return {name: table[name] for name in table.columns if name in _OURS}
    columns = {"alt_m": table["alt_m"]}
    for name in ("lat", "lon"):
        degrees = table[f"{name}_d"]
        part = np.abs(degrees) + table[f"{name}_m"] / 60 + table[f"{name}_s"] / 3600
        columns[name] = np.where(np.signbit(degrees), -part, part)  # -0 12 30 is south of 0
    return columns


_OURS = ("lat", "lon", "alt_m", "east_m", "north_m", "up_m")


def _on_earth(table: Table) -> Mapping[str, Array]:
    """Return geocentric positions as latitude, longitude and height."""
    from pyproj import Transformer

    transformer = Transformer.from_pipeline(
        "+proj=pipeline +step +inv +proj=cart +ellps=WGS84 "
        "+step +proj=unitconvert +xy_in=rad +xy_out=deg"
    )
    lon, lat, alt_m = transformer.transform(table["x_m"], table["y_m"], table["z_m"])
    wrong = ~(np.isfinite(lon) & np.isfinite(lat) & np.isfinite(alt_m))
    if wrong.any():
        index = int(np.argmax(wrong))
        raise table.error("expected a position on Earth", index=index, column="x_m")
    return {"lat": lat, "lon": lon, "alt_m": alt_m}
