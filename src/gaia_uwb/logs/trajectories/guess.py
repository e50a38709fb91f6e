"""Which format a trajectory has, by what stands in the file."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Literal

from gaia_uwb._shared import InputError, open_regular
from gaia_uwb.logs._dialect import BLANKS, Dialect, sniff
from gaia_uwb.logs._logs import check_file
from gaia_uwb.logs.trajectories.nmea import parse_sentence

Guess = Literal["ros", "ubx", "nmea", "gpx", "rtklib", "euroc", "tum", "csv"]

_HEAD_BYTES = 2**18
_ROS = (b"#ROSBAG V", b"\x89MCAP0\r\n", b"SQLite format 3\0")
_UBX = re.compile(rb"\xb5\x62\x01\x07(?:\x5c|\x54)\x00", re.DOTALL)
_RTKLIB = re.compile(r"^%\s+(?:GPST|UTC|JST)\b.*\b(?:latitude|x-ecef|e-baseline)\(", re.MULTILINE)
_GPX = re.compile(r"<(?:\w+:)?gpx[\s>]")
_NMEA = re.compile(r"\$G[A-Z](?:GGA|GNS|RMC),[^\r\n]*")


def guess_format(path: Path) -> Guess:
    """Return the format of a trajectory, by the start of the file.

    Parameters
    ----------
    path
        The file.

    Raises
    ------
    InputError
        If the file cannot be read, or its format cannot be told.
    """
    check_file(path, 2**62)
    try:
        with open_regular(path) as file:
            head = file.read(_HEAD_BYTES)
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror or error}", source=path) from error
    if head.startswith(_ROS):
        return "ros"
    if _UBX.search(head):
        return "ubx"
    text = head.decode("ascii", "replace")
    if any(parse_sentence(match[0].strip(), "optional") for match in _NMEA.finditer(text)):
        return "nmea"
    if _GPX.search(text):
        return "gpx"
    if _RTKLIB.search(text):
        return "rtklib"
    return _guess_table(path)


def _guess_table(path: Path) -> Guess:
    dialect = sniff(path)
    names = dialect.names
    if names and "timestamp" in names[0] and any(name.strip().startswith("p_") for name in names):
        return "euroc"
    if _is_tum(dialect):
        return "tum"
    if "t_s" in names and ({"lat", "lon"} <= set(names) or {"east_m", "north_m"} <= set(names)):
        return "csv"
    wanted = "tum, euroc, kitti, rtklib, gpx, ubx, nmea, ros or csv (with columns)"
    if len(names) == 12 and all(map(_is_number, names)):
        wanted = "kitti, and the file of its times (times: times.txt)"
    raise InputError(f"its format cannot be told: add format: {wanted}", source=path)


def _is_tum(dialect: Dialect) -> bool:
    """Tell whether a table has TUM's 8 columns, by their names or by the numbers in them."""
    if dialect.separator != BLANKS or len(dialect.names) != 8:
        return False
    if dialect.names[1:4] == ("tx", "ty", "tz"):
        return True
    if not all(map(_is_number, dialect.names)):
        return False
    length = sum(float(number) ** 2 for number in dialect.names[4:])
    return abs(length - 1) < 0.01  # the rotation: a quaternion of length 1


def _is_number(text: str) -> bool:
    return bool(re.fullmatch(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d{1,3})?", text, re.ASCII))
