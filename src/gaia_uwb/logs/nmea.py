"""NMEA 0183 logs of a GNSS receiver: GGA sentences give the trajectory.

GGA has a time of day only. The date comes from an RMC or ZDA sentence of the same log or from the
options; without one, times are seconds since midnight (UTC). Heights are ellipsoidal: the altitude
above the geoid plus the geoid separation, both from the sentence.
"""

from __future__ import annotations

import datetime as dt
import math
import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from gaia_uwb._shared import InputError, counted
from gaia_uwb.logs._logs import LogRows, LogTable, read_lines
from gaia_uwb.logs._stamps import DAY_S, DayClock, StampOptions, Stamps, day_s

_SENTENCE = re.compile(r"\$([A-Z]{2})([A-Z]{3}),([^*$]{0,200})\*([0-9A-Fa-f]{2})$", re.ASCII)
_TIME = re.compile(r"(\d\d)(\d\d)(\d\d(?:\.\d{1,9})?)", re.ASCII)
_ANGLE = re.compile(r"(\d{2,3})(\d\d(?:\.\d{1,12})?)", re.ASCII)
_NUMBER = re.compile(r"-?\d{1,7}(?:\.\d{1,9})?", re.ASCII)
_GIVE_UP_LINES = 200_000


@dataclass
class _Count:
    n_broken: int = 0
    n_no_fix: int = 0
    n_no_stamp: int = 0
    n_no_height: int = 0
    n_no_geoid: int = 0
    first_broken: int = 0


@dataclass(frozen=True)
class _Fix:
    time_of_day_s: float
    lat: float
    lon: float
    alt_m: float
    separation_known: bool


def read_nmea(
    path: Path, options: StampOptions | None = None, clock: Literal["gnss", "host"] = "gnss"
) -> tuple[LogTable, list[str]]:
    """Read the trajectory of an NMEA log.

    Parameters
    ----------
    path
        Text file; sentences other than GGA, RMC and ZDA are ignored.
    options
        How to read host stamps; ``date`` is the first day of ``gnss`` times.
    clock
        Time of the sentence (``gnss``), or of the stamp before it (``host``).

    Returns
    -------
    LogTable
        ``t_s`` in seconds, ``lat`` and ``lon`` in degrees, and ``alt_m`` in metres where all
        sentences have it.
    list of str
        Notes: sentences that are broken or have no fix.

    Raises
    ------
    InputError
        If the file cannot be read or contains no GGA sentence with a fix.
    """
    rows = LogRows(path, ("t_s", "lat", "lon", "alt_m"))
    count = _Count()
    reader = _Reader(rows, count, Stamps(options), clock)
    for number, line in read_lines(path):
        reader.read(number, line)
        if number >= _GIVE_UP_LINES and not len(rows):
            break
    _need_rows(rows, count)
    table = rows.table()
    columns = dict(table.columns)
    if clock == "gnss":
        date = None if options is None else options.date
        first_day_s = day_s(date) if date is not None else reader.first_day_s
        columns["t_s"] = columns["t_s"] + (first_day_s or 0.0)
    if count.n_no_height:
        del columns["alt_m"]
    table = replace(table, columns=columns)
    return table, _notes(path, count, dated=clock == "host" or bool(columns["t_s"][0] > 10 * DAY_S))


def parse_sentence(line: str) -> tuple[str, list[str]] | None:
    """Return a sentence's kind and fields; ``None`` where its form or its checksum is wrong.

    Examples
    --------
    >>> parse_sentence("$GPZDA,120000.00,01,01,2026,00,00*63")
    ('ZDA', ['120000.00', '01', '01', '2026', '00', '00'])
    >>> parse_sentence("$GPZDA,120000.00,01,01,2027,00,00*63")
    """
    match = _SENTENCE.match(line)
    if match is None:
        return None
    checksum = 0
    for character in line[1 : line.rindex("*")]:
        checksum ^= ord(character)
    if checksum != int(match[4], 16):
        return None
    return match[2], match[3].split(",")


class _Reader:
    """Reads one log's sentences in their order."""

    def __init__(self, rows: LogRows, count: _Count, stamps: Stamps, clock: str) -> None:
        self.first_day_s: float | None = None
        self._rows = rows
        self._count = count
        self._stamps = stamps
        self._host = clock == "host"
        self._day = DayClock()

    def read(self, number: int, line: str) -> None:
        start = line.find("$")
        if start < 0:
            return
        sentence = parse_sentence(line[start:])
        if sentence is None:
            if re.match(r"\$G?.?(GGA|RMC|ZDA)", line[start:]):
                self._broken(number)
            return
        kind, fields = sentence
        if kind == "GGA":
            self._add(number, fields, line[:start])
        elif kind in {"RMC", "ZDA"} and self.first_day_s is None and not self._host:
            self._date(kind, fields)

    def _add(self, number: int, fields: list[str], prefix: str) -> None:
        if len(fields) > 5 and fields[5] in {"", "0"}:
            self._count.n_no_fix += 1
            return
        fix = _parse_gga(fields)
        if fix is None:
            self._broken(number)
            return
        t_s = self._day.seconds(fix.time_of_day_s)
        if self._host:
            stamp_s = self._stamps.read(f"{prefix} ")
            if stamp_s is None:
                self._count.n_no_stamp += 1
                return
            t_s = stamp_s
        self._count.n_no_height += math.isnan(fix.alt_m)
        self._count.n_no_geoid += not fix.separation_known
        self._rows.add(number, (t_s, fix.lat, fix.lon, fix.alt_m))

    def _date(self, kind: str, fields: list[str]) -> None:
        """Learn the first day from a sentence that has a date."""
        try:
            if kind == "ZDA":
                day = dt.date(int(fields[3]), int(fields[2]), int(fields[1]))
            else:
                text = fields[8]
                day = dt.date(2000 + int(text[4:6]), int(text[2:4]), int(text[:2]))
        except (ValueError, IndexError):
            return
        time_s = _time_of_day_s(fields[0])
        if time_s is not None and day.year >= 2000:
            self.first_day_s = day_s(day) + time_s - self._day.seconds(time_s)

    def _broken(self, number: int) -> None:
        self._count.n_broken += 1
        self._count.first_broken = self._count.first_broken or number


def _parse_gga(fields: list[str]) -> _Fix | None:
    """Return a GGA sentence's fix, ``None`` if a field is not what it must be."""
    if len(fields) < 9:
        return None
    time_s = _time_of_day_s(fields[0])
    lat = _angle(fields[1], fields[2], "NS", 90.0)
    lon = _angle(fields[3], fields[4], "EW", 180.0)
    if time_s is None or lat is None or lon is None:
        return None
    fields = fields + [""] * 6
    alt_m = float(fields[8]) if _NUMBER.fullmatch(fields[8]) else math.nan
    known = bool(_NUMBER.fullmatch(fields[10]))
    return _Fix(time_s, lat, lon, alt_m + (float(fields[10]) if known else 0.0), known)


def _time_of_day_s(text: str) -> float | None:
    match = _TIME.fullmatch(text)
    if match is None or int(match[1]) > 23 or int(match[2]) > 59 or float(match[3]) >= 61:
        return None
    return 3600 * int(match[1]) + 60 * int(match[2]) + float(match[3])


def _angle(text: str, letter: str, letters: str, most: float) -> float | None:
    """Return ``ddmm.mmmm`` and its letter in degrees."""
    match = _ANGLE.fullmatch(text)
    if match is None or len(letter) != 1 or letter not in letters:
        return None
    angle = int(match[1]) + float(match[2]) / 60
    if float(match[2]) >= 60 or angle > most:
        return None
    return angle if letter == letters[0] else -angle


def _need_rows(rows: LogRows, count: _Count) -> None:
    if len(rows):
        return
    if count.n_broken:
        problem = "all GGA sentences are broken (form or checksum)"
        raise InputError(problem, source=rows.path, row=count.first_broken)
    if count.n_no_stamp:
        problem = "its sentences have no host time before '$': use clock: gnss"
    elif count.n_no_fix:
        problem = f"no fix in any of its {count.n_no_fix} GGA sentences"
    else:
        problem = "contains no GGA sentences ($..GGA,...)"
    raise InputError(problem, source=rows.path)


def _notes(path: Path, count: _Count, *, dated: bool) -> list[str]:
    notes = []
    if count.n_broken:
        broken = counted(count.n_broken, "broken sentence")
        notes.append(f"{path.name}: skipped {broken}, the first is in line {count.first_broken}")
    if count.n_no_fix:
        sentences = counted(count.n_no_fix, "sentence")
        notes.append(f"{path.name}: skipped {sentences} without a fix")
    if count.n_no_stamp:
        sentences = counted(count.n_no_stamp, "sentence")
        notes.append(f"{path.name}: skipped {sentences} without a stamp")
    if count.n_no_height:
        fixes = counted(count.n_no_height, "fix", "fixes")
        notes.append(f"{path.name}: heights ignored, as {fixes} had none")
    elif count.n_no_geoid:
        notes.append(f"{path.name}: no geoid separation, so heights are above the geoid")
    if not dated:
        notes.append(f"{path.name}: no date (RMC, ZDA or date:), so times count from midnight UTC")
    return notes
