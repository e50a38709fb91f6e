"""Trajectories of odometry and SLAM in local metres: TUM, EuRoC and KITTI.

=====  ==========================================================================================
TUM    ``timestamp tx ty tz qx qy qz qw`` in seconds and metres, separated by blanks
EuRoC  ``#timestamp [ns],p_RS_R_x [m],p_RS_R_y [m],p_RS_R_z [m],...``
KITTI  12 numbers a line, the rows of a pose's 3 by 4 matrix, and the times in a file of their own
=====  ==========================================================================================

The positions are taken as they are: x east, y north, z up, about an origin that is nowhere on
Earth. KITTI's are those of a camera that looks ahead (x right, y down, z ahead): x is east and z
north.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Literal

from gaia_uwb._shared import InputError
from gaia_uwb.logs._cells import Kind
from gaia_uwb.logs._dialect import sniff
from gaia_uwb.logs._logs import LogTable, from_table
from gaia_uwb.logs._table import Table, read_table

_TUM = ("timestamp", "tx", "ty", "tz", "qx", "qy", "qz", "qw")
_KITTI = tuple(f"{row}{column}" for row in "123" for column in "1234")
_PLACE = re.compile(r"p(?:_\w+)?_([xyz])(?:\s*\[m\])?\s*", re.ASCII)
_UNITS_S = {"ns": 1e-9, "us": 1e-6, "ms": 1e-3, "s": 1.0}


def read_tum(path: Path) -> tuple[LogTable, list[str]]:
    """Read a TUM trajectory.

    Parameters
    ----------
    path
        Text file; lines that start with ``#`` are left out.

    Returns
    -------
    LogTable
        ``t_s`` in seconds, ``east_m``, ``north_m``, ``up_m`` in metres.
    list of str
        Notes.

    Raises
    ------
    InputError
        If the file cannot be read, or a line does not hold 8 numbers.
    """
    table = _read(path, _TUM)
    names = {"t_s": "timestamp", "east_m": "tx", "north_m": "ty", "up_m": "tz"}
    return _renamed(table, names), []


def read_euroc(path: Path) -> tuple[LogTable, list[str]]:
    """Read a trajectory of the EuRoC data set's form.

    Parameters
    ----------
    path
        The ``data.csv`` of a pose or position.

    Returns
    -------
    LogTable, list of str
        Like those of :func:`read_tum`.

    Raises
    ------
    InputError
        If the file cannot be read or has no columns of positions, or a cell is wrong.
    """
    dialect = sniff(path)
    places = {match[1]: name for name in dialect.names if (match := _PLACE.fullmatch(name.strip()))}
    if len(places) != 3:
        found = ", ".join(map(repr, dialect.names))[:200]
        raise InputError(f"expected columns like 'p_RS_R_x [m]', found {found}", source=path)
    time = dialect.names[0]
    unit = re.search(r"\[(ns|us|ms|s)\]", time)
    table = read_table(path, dict.fromkeys([time, *places.values()], Kind.NUMBER), dialect=dialect)
    names = {"t_s": time, "east_m": places["x"], "north_m": places["y"], "up_m": places["z"]}
    return _renamed(table, names, {"t_s": _UNITS_S[unit[1] if unit else "ns"]}), []


def read_kitti(
    path: Path, times: Path, axes: Literal["camera", "east-north-up"] = "camera"
) -> tuple[LogTable, list[str]]:
    """Read poses of the KITTI odometry benchmark's form.

    Parameters
    ----------
    path
        Text file of 12 numbers a line.
    times
        Text file of one time a line, in seconds.
    axes
        Of the positions: the camera's (x right, y down, z ahead) or x east, y north, z up.

    Returns
    -------
    LogTable, list of str
        Like those of :func:`read_tum`.

    Raises
    ------
    InputError
        If a file cannot be read, a cell is wrong, or there is not one time for each pose.
    """
    poses, stamps = _read(path, _KITTI), _read(times, ("time",))
    if len(poses) != len(stamps):
        problem = f"has {len(stamps):,} times for the {len(poses):,} poses of {path.name}"
        raise InputError(problem, source=times)
    names = {"east_m": "14", "north_m": "24", "up_m": "34"}
    scales: Mapping[str, float] = {}
    notes = []
    if axes == "camera":
        names, scales = {"east_m": "14", "north_m": "34", "up_m": "24"}, {"up_m": -1.0}
        notes = [f"{path.name}: a camera's axes: x is east, z north, and heights count down in y"]
    table = _renamed(poses, names, scales)
    return from_table(poses, {"t_s": stamps["time"], **table.columns}, names=table.names), notes


def _read(path: Path, names: tuple[str, ...]) -> Table:
    """Return a table of numbers that has no header."""
    return read_table(path, dict.fromkeys(names, Kind.NUMBER), dialect=sniff(path, names))


def _renamed(
    table: Table, names: Mapping[str, str], scales: Mapping[str, float] | None = None
) -> LogTable:
    """Return columns under our names and in our units."""
    scales = {} if scales is None else scales
    columns = {our: table[their] * scales.get(our, 1.0) for our, their in names.items()}
    return from_table(table, columns, names=names)
