"""The host's time before a logged line: in all forms that terminals and loggers write.

========================================  =====================================================
seconds (or ms, us, ns) since 1970        ``1767225600.25``, ``ts %.s``
date and time, as in tables               ``[2026-01-01 09:00:00.250]`` (Tera Term, minicom)
month's name, with or without the year    ``Jan 01 09:00:00`` (``ts``), ``Thu Jan 01 09:00:00 2026``
time of day                               ``09:00:00.250 ->`` (Arduino)
========================================  =====================================================

>>> stamps = Stamps()
>>> stamps.read("1767225600.25 ")
1767225600.25
>>> stamps.read("[2026-01-01 00:00:00.250] -> ")
1767225600.25
>>> stamps.read("yesterday ")
"""

from __future__ import annotations

import calendar
import datetime as dt
import re
from pathlib import Path
from typing import Literal

from pydantic import Field

from gaia_uwb._shared import InputError
from gaia_uwb.config import Settings
from gaia_uwb.logs._dates import DateOrder, seconds_of, way_out

DAY_S = 86_400.0

_NUMBER = r"\d{1,20}(?:\.\d{1,12})?"
_TIME = r"\d\d?:\d\d:\d\d(?:[.,]\d{1,9})?(?: ?[AaPp][Mm])?"
_ZONE = r"(?: ?(?:Z|UTC|GMT|[+-]\d\d:?\d\d))?"
_MONTHS = {name.lower(): month for month, name in enumerate(calendar.month_abbr) if name}
_STAMP = re.compile(
    r"\s*\[?\s*(?:"
    rf"(?P<dated>\d{{1,4}}[-/.]\d{{1,2}}[-/.]\d{{1,4}}[T ] *{_TIME}{_ZONE})"
    rf"|(?:[A-Z][a-z]{{2}},? +)?(?P<month>[A-Z][a-z]{{2}}) +(?P<day>\d\d?) +(?P<named>{_TIME})"
    r"(?: +(?P<year>\d{4}))?"
    rf"|(?:(?P<days>\d{{1,3}}) +)?(?P<time>{_TIME})"
    rf"|(?P<number>{_NUMBER})"
    r")(?:\s*\]?\s*(?:[,;|:]|-?>)\s*|\s*\]\s*|\s+)",
    re.ASCII,
)
_DATE = re.compile(r"\d{1,4}[-/.]\d{1,2}[-/.]\d{1,4} +\d\d?:\d\d(?::\d\d)?", re.ASCII)
_UNIT_S = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}


class StampOptions(Settings):
    """How to read the stamps of a log's lines."""

    unit: Literal["s", "ms", "us", "ns"] = "s"
    """Unit of stamps that are plain numbers."""
    utc_offset_h: float = Field(default=0.0, ge=-24, le=24)
    """Hours by which the stamps' clock is ahead of UTC, for dates and times without a zone."""
    date_order: DateOrder | None = None
    """Whether day or month comes first in dates that end in the year (03/04/2026)."""
    date: dt.date | None = None
    """First day, for stamps without a date or without a year; without it the trajectory's."""


class DayClock:
    """Times of day -> seconds that keep counting after midnight."""

    def __init__(self) -> None:
        self._last_s: float | None = None
        self._days_s = 0.0

    def seconds(self, time_of_day_s: float) -> float:
        """Return the seconds since the first midnight."""
        if self._last_s is not None and abs(time_of_day_s - self._last_s) > DAY_S / 2:
            self._days_s += DAY_S if time_of_day_s < self._last_s else -DAY_S
        self._last_s = time_of_day_s
        return self._days_s + time_of_day_s


class Stamps:
    """Reads the stamps of one log's lines, in their order.

    Parameters
    ----------
    options
        How they are meant.
    near_s
        A time of the same drive by another clock, in seconds since 1970: it tells the day of
        stamps without a date, and the year of those without a year, where the options do not.

    Attributes
    ----------
    first_day
        The first day, where it was taken from ``near_s``.
    """

    def __init__(self, options: StampOptions | None = None, near_s: float | None = None) -> None:
        self._options = StampOptions() if options is None else options
        self._near_s = near_s
        self._clock = DayClock()
        self._first_day_s: float | None = None
        self._last_s: float | None = None
        self._lacks_year = False
        self.first_day: dt.date | None = None

    def read(self, text: str) -> float | None:
        """Return the time of a stamp, in seconds; ``None`` if its form is not known.

        Parameters
        ----------
        text
            All that stands before a line's content, with brackets and separators.
        """
        match = _STAMP.fullmatch(text)
        if match is None:
            return None
        if match["number"]:
            return float(match["number"]) * _UNIT_S[self._options.unit]
        if dated := match["dated"]:
            order = self._options.date_order
            return seconds_of(dated, utc_offset_h=self._options.utc_offset_h, order=order)
        if match["time"]:
            return self._of_day(match["time"], int(match["days"] or 0))
        month = _MONTHS.get(match["month"].lower(), 0)
        return self._named(match["year"], month, int(match["day"]), match["named"])

    def check(self, path: Path) -> None:
        """Refuse stamps that have no year where nothing tells it.

        Raises
        ------
        InputError
            If there were any.
        """
        if self._lacks_year:
            problem = "its stamps have no year: set stamps: {date: YYYY-MM-DD}, the first day"
            raise InputError(problem, source=path)

    def way_out(self, text: str) -> str:
        """Return what to add to ``gaia.yaml`` for a stamp whose date may be of two days."""
        found = _DATE.search(text)
        return "" if found is None else way_out(found[0], self._options.date_order)

    @property
    def _offset_s(self) -> float:
        return 3600 * self._options.utc_offset_h

    def _dated(self, year: int, month: int, day: int, time: str) -> float | None:
        of_day_s = _time_of_day_s(time)
        try:
            midnight_s = day_s(dt.date(year, month, day))
        except ValueError:
            return None
        return None if of_day_s is None else midnight_s + of_day_s - self._offset_s

    def _named(self, year: str | None, month: int, day: int, time: str) -> float | None:
        """Return the time of a stamp with a month's name.

        Without a year it is in the one nearest to what is known; the last stamp is known best, so
        that the new year comes by itself.
        """
        if year is not None:
            return self._dated(int(year), month, day, time)
        near_s = self._last_s
        if near_s is None:
            near_s = self._near_s if self._options.date is None else day_s(self._options.date)
        near = 1972 if near_s is None else (_EPOCH + dt.timedelta(seconds=near_s)).year
        times = (self._dated(each, month, day, time) for each in (near - 1, near, near + 1))
        found = [t_s for t_s in times if t_s is not None]
        if not found:
            return None
        t_s = min(found, key=lambda t_s: abs(t_s - (near_s or 0.0)))
        if near_s is None:
            self._lacks_year = True
        elif self._last_s is None and self._options.date is None:
            self.first_day = (_EPOCH + dt.timedelta(seconds=t_s + self._offset_s)).date()
        self._last_s = t_s
        return t_s

    def _of_day(self, time: str, days: int) -> float | None:
        of_day_s = _time_of_day_s(time)
        if of_day_s is None:
            return None
        t_s = days * DAY_S + of_day_s if days else self._clock.seconds(of_day_s)
        if self._first_day_s is None:
            self._first_day_s = self._find_first_day(of_day_s)
        return self._first_day_s + t_s

    def _find_first_day(self, of_day_s: float) -> float:
        """Return the start, in seconds since 1970, of the day that the first time of day is in."""
        if self._options.date is not None:
            return day_s(self._options.date) - self._offset_s
        if self._near_s is None:
            return 0.0
        local_s = self._near_s + self._offset_s
        days = round((local_s - of_day_s) / DAY_S)
        self.first_day = (_EPOCH + dt.timedelta(days=days)).date()
        return days * DAY_S - self._offset_s


_EPOCH = dt.datetime(1970, 1, 1, tzinfo=dt.UTC)


def _time_of_day_s(text: str) -> float | None:
    half = text[-2:].lower() if text[-1] in "mM" else ""
    hours, minutes, seconds = text.rstrip("AaPpMm ").replace(",", ".").split(":")
    hour = int(hours)
    if half:
        if not 1 <= hour <= 12:
            return None
        hour = hour % 12 + 12 * (half == "pm")
    if hour > 23 or int(minutes) > 59 or float(seconds) >= 61:
        return None
    return 3600 * hour + 60 * int(minutes) + float(seconds)


def day_s(day: dt.date) -> float:
    """Return a day's midnight (UTC) in seconds since 1970."""
    return float((day - _EPOCH.date()).days) * DAY_S
