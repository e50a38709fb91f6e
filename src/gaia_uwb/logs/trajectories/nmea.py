"""NMEA 0183 logs of a GNSS receiver: GGA and GNS sentences give the trajectory, else RMC.

HDT and THS sentences give the vehicle's heading.

They have a time of day only. The date comes from the first RMC sentence with a fix, from ZDA or
from the options; without one, times are seconds since midnight (UTC). Heights are ellipsoidal: the
altitude above the geoid plus the geoid separation, both from the sentence.

Parsed here and not by pynmeagps: a sentence takes a quarter of the time, and host stamps before a
sentence and glued or binary lines are read as well.
"""

from __future__ import annotations

import datetime as dt
import math
import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from gaia_uwb._shared import Array, InputError, counted, shown
from gaia_uwb.logs._logs import LogRows, LogTable, read_lines
from gaia_uwb.logs._stamps import DAY_S, DayClock, StampOptions, Stamps, day_s
from gaia_uwb.logs.trajectories import fixes
from gaia_uwb.logs.trajectories.nmea_heading import KINDS, Headings

Checksums = Literal["required", "optional"]

_SENTENCE = re.compile(r"\$([A-Z]{2})([A-Z]{3}),([^*$]{0,200})(?:\*([0-9A-Fa-f]{2}))?$", re.ASCII)
_KNOWN = re.compile(r"\$(?:G?.?(?:GGA|GNS|RMC|ZDA)|[A-Z]{2}(?:HDT|THS),)", re.ASCII)
_TIME = re.compile(r"(\d\d)(\d\d)(\d\d(?:\.\d{1,9})?)", re.ASCII)
_ANGLE = re.compile(r"(\d{2,3})(\d\d(?:\.\d{1,12})?)", re.ASCII)
_NUMBER = re.compile(r"-?\d{1,7}(?:\.\d{1,9})?", re.ASCII)
_GIVE_UP_LINES = 200_000
_COLUMNS = ("t_s", "lat", "lon", "alt_m", "moment_s", "rank", "geoid")

_GGA_RANKS = {
    "1": fixes.SINGLE,
    "2": fixes.DIFFERENTIAL,
    "3": fixes.PPS,
    "4": fixes.RTK_FIXED,
    "5": fixes.RTK_FLOAT,
    "6": fixes.DEAD_RECKONING,
    "7": fixes.BY_HAND,
    "8": fixes.SIMULATED,
    "9": fixes.SBAS,
}
_MODE_RANKS = {
    "R": fixes.RTK_FIXED,
    "F": fixes.RTK_FLOAT,
    "P": fixes.PPS,
    "D": fixes.DIFFERENTIAL,
    "A": fixes.SINGLE,
    "E": fixes.DEAD_RECKONING,
    "M": fixes.BY_HAND,
    "S": fixes.SIMULATED,
}


@dataclass
class _Count:
    n_broken: int = 0
    n_bare: int = 0
    n_no_fix: int = 0
    n_at_zero: int = 0
    n_no_stamp: int = 0
    other_stamp: str = ""
    first_broken: int = 0


@dataclass
class _Date:
    """The start of the first day, and where it is known from."""

    first_day_s: float
    words: str


@dataclass(frozen=True)
class _Fix:
    time_of_day_s: float
    lat: float
    lon: float
    rank: int
    alt_m: float = math.nan
    separation_known: bool = False


def read_nmea(
    path: Path,
    options: StampOptions | None = None,
    clock: Literal["gnss", "host"] = "gnss",
    checksums: Checksums = "required",
) -> tuple[LogTable, list[str]]:
    """Read the trajectory of an NMEA log.

    Parameters
    ----------
    path
        Text file; sentences other than GGA, GNS, RMC, ZDA, HDT and THS are ignored.
    options
        How to read host stamps; ``date`` is the first day of ``gnss`` times.
    clock
        Time of the sentence (``gnss``), or of the stamp before it (``host``).
    checksums
        Whether a sentence without a checksum is read; one with a wrong checksum never is.

    Returns
    -------
    LogTable
        ``t_s`` in seconds, ``lat`` and ``lon`` in degrees, ``alt_m`` in metres where all fixes have
        it, and ``heading_deg`` where there are headings. Of several fixes of one moment it is the
        best.
    list of str
        Notes: date, quality of the fixes, sentences that are broken or have no fix.

    Raises
    ------
    InputError
        If the file cannot be read or contains no sentence with a fix.
    """
    count = _Count()
    stamps = Stamps(options)
    reader = _Reader(path, count, stamps, host=clock == "host", checksums=checksums)
    for number, line in read_lines(path):
        reader.read(number, line)
        if number >= _GIVE_UP_LINES and not len(reader.rows) and not len(reader.bare_rows):
            break
    rows = reader.rows if len(reader.rows) else reader.bare_rows
    _need_rows(rows, count)
    stamps.check(path)
    notes = _skipped(path, count)
    if rows is reader.bare_rows:
        notes.append(f"{path.name}: no GGA or GNS sentences with a fix: positions from RMC")
    table, quality = _best(rows.table())
    t_s = table["t_s"]
    if clock == "gnss":
        date = None if options is None else options.date
        first_day_s, words = reader.first_day(None if date is None else day_s(date))
        t_s, notes = t_s + first_day_s, [*notes, f"{path.name}: {words}"]
    columns = {"t_s": t_s, "lat": table["lat"], "lon": table["lon"]}
    heights, problem = _heights(table)
    notes += [f"{path.name}: {problem}"] if problem else []
    heading_deg = reader.headings.at(table["moment_s"])
    n_headings = int(np.isfinite(heading_deg).sum())
    if n_headings:
        columns["heading_deg"] = heading_deg
        some = counted(n_headings, "fix", "fixes")
        notes.append(f"{path.name}: heading of {some} from {' and '.join(KINDS)}")
    return replace(table, columns=columns | heights), notes + quality


def parse_sentence(line: str, checksums: Checksums = "required") -> tuple[str, list[str]] | None:
    """Return a sentence's kind and fields; ``None`` where its form or its checksum is wrong.

    Examples
    --------
    >>> parse_sentence("$GPZDA,120000.00,01,01,2026,00,00*63")
    ('ZDA', ['120000.00', '01', '01', '2026', '00', '00'])
    >>> parse_sentence("$GPZDA,120000.00,01,01,2027,00,00*63")
    >>> parse_sentence("$GPZDA,120000.00,01,01,2027,00,00", checksums="optional")
    ('ZDA', ['120000.00', '01', '01', '2027', '00', '00'])
    """
    match = _SENTENCE.match(line)
    if match is None:
        return None
    if match[4] is None:
        return (match[2], match[3].split(",")) if checksums == "optional" else None
    checksum = 0
    for character in line[1 : line.rindex("*")]:
        checksum ^= ord(character)
    if checksum != int(match[4], 16):
        return None
    return match[2], match[3].split(",")


class _Reader:
    """Reads one log's sentences in their order."""

    def __init__(
        self, path: Path, count: _Count, stamps: Stamps, *, host: bool, checksums: Checksums
    ) -> None:
        self.rows = LogRows(path, _COLUMNS)
        self.bare_rows = LogRows(path, _COLUMNS)
        """Positions of RMC sentences, as long as there are no others."""
        self.headings = Headings(path)
        self._count = count
        self._stamps = stamps
        self._host = host
        self._checksums: Checksums = checksums
        self._day = DayClock()
        self._time_of_day_s: float | None = None
        self._fixed = False
        self._dates: dict[str, _Date] = {}

    def read(self, number: int, line: str) -> None:
        start = line.rfind("$")
        if start < 0 or not _KNOWN.match(line, start):
            return
        sentence = parse_sentence(line[start:], self._checksums)
        if sentence is None:
            self._broken(number, bare=self._checksums == "required" and "*" not in line[start:])
            return
        kind, fields = sentence
        if kind in KINDS:
            if self._time_of_day_s is not None:
                self.headings.add(number, self._day.seconds(self._time_of_day_s), kind, fields)
            return
        if kind != "ZDA":
            self._time_of_day_s = _time_of_day_s(fields[0])
        if kind in {"GGA", "GNS"}:
            self._add(number, kind, fields, line[:start])
        elif kind == "RMC":
            self._add_bare(number, fields, line[:start])
        elif kind == "ZDA":
            self._learn_date("ZDA" if self._fixed else "ZDA before the fix", fields[0], fields[1:4])

    def first_day(self, given_s: float | None) -> tuple[float, str]:
        """Return the start of the first day, and where it is known from, in words."""
        if given_s is not None:
            return given_s, f"date {_iso(given_s)} from gaia.yaml"
        for source in ("RMC", "ZDA", "ZDA before the fix"):
            if source in self._dates:
                date = self._dates[source]
                return date.first_day_s, f"date {date.words} from {source}"
        return 0.0, "no date (RMC, ZDA or date:), so times count from midnight UTC"

    def _add(self, number: int, kind: str, fields: list[str], prefix: str) -> None:
        rank = _gga_rank(fields) if kind == "GGA" else _gns_rank(fields)
        if rank is None:
            self._count.n_no_fix += 1
            return
        fix = _parse_gga(fields, rank, separation=10 if kind == "GGA" else 9)
        self._add_fix(self.rows, number, fix, prefix)

    def _add_bare(self, number: int, fields: list[str], prefix: str) -> None:
        """Learn the date of an RMC sentence with a fix, and its position if there is no better."""
        if len(fields) < 9 or fields[1] != "A":
            return
        text = fields[8]
        self._learn_date("RMC", fields[0], [text[:2], text[2:4], text[4:]])
        if not len(self.rows):
            mode = fields[11] if len(fields) > 11 else ""
            rank = _MODE_RANKS.get(mode, fixes.UNKNOWN)
            self._add_fix(self.bare_rows, number, _parse_rmc(fields, rank), prefix)

    def _add_fix(self, rows: LogRows, number: int, fix: _Fix | None, prefix: str) -> None:
        if fix is None:
            self._broken(number)
            return
        if fix.lat == 0 and fix.lon == 0:
            self._count.n_at_zero += 1
            return
        self._fixed = True
        moment_s = t_s = self._day.seconds(fix.time_of_day_s)
        if self._host:
            stamp_s = self._stamps.read(f"{prefix} ")
            if stamp_s is None:
                self._count.n_no_stamp += 1
                self._count.other_stamp = self._count.other_stamp or prefix.strip()
                return
            t_s = stamp_s
        values = (t_s, fix.lat, fix.lon, fix.alt_m, moment_s)
        rows.add(number, (*values, float(fix.rank), float(fix.separation_known)))

    def _learn_date(self, source: str, time: str, parts: list[str]) -> None:
        """Learn the first day from day, month and year; the first sentence counts."""
        if source in self._dates or self._host:
            return
        try:
            day, month, year = map(int, parts)
            date = dt.date(year + (2000 if year < 80 else 1900 if year < 100 else 0), month, day)
        except ValueError:
            return
        time_s = _time_of_day_s(time)
        if time_s is not None and date.year >= 2000:
            first_day_s = day_s(date) + time_s - self._day.seconds(time_s)
            self._dates[source] = _Date(first_day_s, date.isoformat())

    def _broken(self, number: int, *, bare: bool = False) -> None:
        self._count.n_broken += 1
        self._count.n_bare += bare
        self._count.first_broken = self._count.first_broken or number


def _gga_rank(fields: list[str]) -> int | None:
    """Return the rank of a GGA sentence's fix, ``None`` if it has none."""
    quality = fields[5] if len(fields) > 5 else "1"
    return None if quality in {"", "0"} else _GGA_RANKS.get(quality, fixes.UNKNOWN)


def _gns_rank(fields: list[str]) -> int | None:
    """Return the rank of a GNS sentence's fix: that of its best constellation."""
    modes = fields[5] if len(fields) > 5 else ""
    return min((_MODE_RANKS[mode] for mode in modes if mode in _MODE_RANKS), default=None)


def _parse_gga(fields: list[str], rank: int, separation: int) -> _Fix | None:
    """Return the fix of a GGA or GNS sentence, ``None`` if a field is not what it must be."""
    if len(fields) < 9:
        return None
    fields = fields + [""] * 6
    place = _place(fields[0], fields[1:5])
    if place is None:
        return None
    alt_m = float(fields[8]) if _NUMBER.fullmatch(fields[8]) else math.nan
    known = bool(_NUMBER.fullmatch(fields[separation]))
    return _Fix(*place, rank, alt_m + (float(fields[separation]) if known else 0.0), known)


def _parse_rmc(fields: list[str], rank: int) -> _Fix | None:
    place = _place(fields[0], fields[2:6])
    return None if place is None else _Fix(*place, rank)


def _place(time: str, fields: list[str]) -> tuple[float, float, float] | None:
    """Return time of day, latitude and longitude; ``None`` if one is not what it must be."""
    time_s = _time_of_day_s(time)
    lat = _angle(fields[0], fields[1], "NS", 90.0)
    lon = _angle(fields[2], fields[3], "EW", 180.0)
    return None if time_s is None or lat is None or lon is None else (time_s, lat, lon)


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


def _best(table: LogTable) -> tuple[LogTable, list[str]]:
    return fixes.keep_best(table, table["moment_s"], table["rank"].astype(np.int64))


def _heights(table: LogTable) -> tuple[dict[str, Array], str]:
    """Return the heights if all fixes have them from one surface, and a note if not."""
    alt_m, geoid = table["alt_m"], table["geoid"]
    n_none = int(np.isnan(alt_m).sum())
    if n_none == len(table):
        return {}, "no heights"
    if n_none:
        return {}, f"heights ignored, as {counted(n_none, 'fix', 'fixes')} had none"
    if 0 < geoid.sum() < len(table):
        return {}, "heights ignored, as only some fixes have a geoid separation"
    note = "" if geoid.all() else "no geoid separation, so heights are above the geoid"
    return {"alt_m": alt_m}, note


def _iso(day_start_s: float) -> str:
    return (dt.date(1970, 1, 1) + dt.timedelta(days=day_start_s // DAY_S)).isoformat()


def _need_rows(rows: LogRows, count: _Count) -> None:
    if len(rows):
        return
    row = None
    if count.n_bare:
        problem = "its sentences have no checksums: checksums: optional reads them"
        row = count.first_broken
    elif count.n_broken:
        problem, row = "all sentences with a fix are broken (form or checksum)", count.first_broken
    elif count.other_stamp:
        stamp = shown(count.other_stamp[:60])
        problem = f"the stamps before '$' are in a form that is not read (docs/inputs.md): {stamp}"
    elif count.n_no_stamp:
        problem = "its sentences have no host time before '$': use clock: gnss"
    elif count.n_at_zero:
        problem = f"all its {count.n_at_zero} fixes are at latitude 0, longitude 0: no fix"
    elif count.n_no_fix:
        problem = f"no fix in any of its {count.n_no_fix} GGA and GNS sentences"
    else:
        problem = "contains no GGA, GNS or RMC sentences with a fix ($..GGA,...)"
    raise InputError(problem, source=rows.path, row=row)


def _skipped(path: Path, count: _Count) -> list[str]:
    """Return notes on the sentences that were not used."""
    notes = []
    if count.n_broken:
        broken = counted(count.n_broken, "broken sentence")
        notes.append(f"{path.name}: skipped {broken}, the first is in line {count.first_broken}")
    for number, problem in (
        (count.n_no_fix, "without a fix"),
        (count.n_at_zero, "at latitude 0, longitude 0 (no fix)"),
        (count.n_no_stamp, "without a stamp"),
    ):
        if number:
            notes.append(f"{path.name}: skipped {counted(number, 'sentence')} {problem}")
    return notes
