"""Binary logs of u-blox receivers (UBX): NAV-PVT messages, refined by NAV-HPPOSLLH.

NMEA, RTCM and other messages may stand between them. Frames are found by their header and checksum
and not by pyubx2, which after one false header loses all that the length in it spans: 600 of 610
messages in a trial, where this loses none.
"""

from __future__ import annotations

import datetime as dt
import re
import struct
from array import array
from collections.abc import Iterator
from dataclasses import replace
from itertools import accumulate
from pathlib import Path

import numpy as np

from gaia_uwb._shared import Array, InputError, counted, open_regular
from gaia_uwb.logs._logs import LogRows, LogTable, check_file
from gaia_uwb.logs.trajectories import fixes

_MAX_BYTES = 16 * 2**30
_CHUNK_BYTES = 2**20
_LENGTHS = {b"\x07": (84, 92), b"\x14": (36,)}  # NAV-PVT had 84 bytes up to u-blox 7
_HEADER = re.compile(rb"\xb5\x62\x01([\x07\x14])", re.DOTALL)
_LONGEST_FRAME = 8 + 92
_PVT = struct.Struct("<IHBBBBBBIiBBBBiii")
_HP = struct.Struct("<BxxBIiiiibbbb")
_DATE_AND_TIME = 0b11


def read_ubx(path: Path) -> tuple[LogTable, list[str]]:
    """Read the trajectory of a u-blox receiver's binary log.

    Parameters
    ----------
    path
        The file.

    Returns
    -------
    LogTable
        ``t_s`` in seconds (UTC), ``lat`` and ``lon`` in degrees, ``alt_m`` above the ellipsoid in
        metres.
    list of str
        Notes: the quality of the fixes, and messages without a fix or a date.

    Raises
    ------
    InputError
        If the file cannot be read or holds no NAV-PVT message with a fix in three dimensions.
    """
    check_file(path, _MAX_BYTES)
    log = _Log(path)
    for kind, payload in _frames(path):
        if kind == b"\x07":
            log.add(payload)
        else:
            log.refine(payload)
    if not len(log.rows):
        raise log.nothing()
    table, n_refined = log.table()
    names = ("t_s", "lat", "lon", "alt_m")
    rank = table["rank"].astype(np.int64)
    table, notes = fixes.keep_best(
        replace(table, columns={name: table[name] for name in names}), table["t_s"], rank
    )
    for number, lack in ((log.n_no_fix, "a fix in three dimensions"), (log.n_no_date, "a date")):
        if number:
            notes.append(f"{path.name}: skipped {counted(number, 'message')} without {lack}")
    if 0 < n_refined < len(table):
        some = counted(n_refined, "fix", "fixes")
        notes.append(f"{path.name}: {some} of high precision (NAV-HPPOSLLH)")
    return table, notes


def _frames(path: Path) -> Iterator[tuple[bytes, bytes]]:
    """Yield kind and payload of each whole message that is wanted."""
    rest = b""
    try:
        with open_regular(path) as file:
            while True:
                chunk = file.read(_CHUNK_BYTES)
                data = rest + chunk
                last = len(data) - _LONGEST_FRAME if chunk else len(data)
                for match in _HEADER.finditer(data):
                    if match.start() >= max(last, 0):
                        break
                    payload = _payload(data, match.start(), match[1])
                    if payload is not None:
                        yield match[1], payload
                if not chunk:
                    return
                rest = data[max(last, 0) :]
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror or error}", source=path) from error


def _payload(data: bytes, start: int, kind: bytes) -> bytes | None:
    """Return the payload of the message that starts there, if its length and checksum are right."""
    length = int.from_bytes(data[start + 4 : start + 6], "little")
    end = start + 6 + length
    if length not in _LENGTHS[kind] or end + 2 > len(data):
        return None
    sums = list(accumulate(data[start + 2 : end]))
    if data[end] != sums[-1] & 255 or data[end + 1] != sum(sums) & 255:
        return None
    return data[start + 6 : end]


class _Log:
    """The fixes of one log."""

    def __init__(self, path: Path) -> None:
        self.rows = LogRows(path, ("t_s", "lat", "lon", "alt_m", "rank", "itow"), "NAV-PVT message")
        self.n_no_fix = self.n_no_date = self._n = 0
        self._fine = array("d")

    def add(self, payload: bytes) -> None:
        """Append the fix of a NAV-PVT message."""
        self._n += 1
        itow, year, month, day, hour, minute, second, valid, _, nano_s, *more = _PVT.unpack_from(
            payload
        )
        kind, flags, _, _, lon, lat, height_mm = more
        if kind not in {3, 4} or not flags & 1:
            self.n_no_fix += 1
            return
        if valid & _DATE_AND_TIME != _DATE_AND_TIME:
            self.n_no_date += 1
            return
        try:
            midnight = dt.datetime(year, month, day, tzinfo=dt.UTC).timestamp()
        except ValueError:
            self.n_no_date += 1
            return
        t_s = midnight + 3600 * hour + 60 * minute + second + nano_s * 1e-9
        carrier = flags >> 6
        rank = {2: fixes.RTK_FIXED, 1: fixes.RTK_FLOAT}.get(
            carrier, fixes.DIFFERENTIAL if flags & 2 else fixes.SINGLE
        )
        values = (t_s, lat * 1e-7, lon * 1e-7, height_mm * 1e-3, float(rank), float(itow))
        self.rows.add(self._n, values)

    def refine(self, payload: bytes) -> None:
        """Remember the position of a NAV-HPPOSLLH message."""
        _, flags, itow, lon, lat, height_mm, _, lon_hp, lat_hp, height_hp, _ = _HP.unpack_from(
            payload
        )
        if not flags & 1:
            fine = (lat * 1e-7 + lat_hp * 1e-9, lon * 1e-7 + lon_hp * 1e-9)
            self._fine.extend((itow, *fine, height_mm * 1e-3 + height_hp * 1e-4))

    def table(self) -> tuple[LogTable, int]:
        """Return the fixes, as precise as they are known, and how many have high precision."""
        table = self.rows.table()
        fine = np.frombuffer(self._fine, np.float64).reshape(-1, 4)
        if not len(fine):
            return table, 0
        itow, first = np.unique(fine[:, 0], return_index=True)
        place = np.searchsorted(itow, table["itow"]).clip(max=len(itow) - 1)
        match = itow[place] == table["itow"]
        columns: dict[str, Array] = dict(table.columns)
        for k, name in enumerate(("lat", "lon", "alt_m"), start=1):
            columns[name] = np.where(match, fine[first[place], k], table[name])
        return replace(table, columns=columns), int(match.sum())

    def nothing(self) -> InputError:
        """Return why no message could be used."""
        if not self._n:
            problem = "contains no whole NAV-PVT messages (UBX 01 07): turn them on in the receiver"
        elif self.n_no_date:
            problem = "its NAV-PVT messages have no valid date and time"
        else:
            problem = f"no fix in three dimensions in any of its {self._n:,} NAV-PVT messages"
        return InputError(problem, source=self.rows.path)
