"""The host's time at the start of a logged line: seconds, an ISO date and time, or a time of day.

>>> stamps = Stamps()
>>> stamps.split("1767225600.25 DIST,1")
(1767225600.25, 'DIST,1')
>>> stamps.split("[2026-01-01 00:00:00.250] DIST,1")
(1767225600.25, 'DIST,1')
"""

from __future__ import annotations

import datetime as dt
import re
from typing import Literal

from pydantic import Field

from gaia_uwb.config import Settings

DAY_S = 86_400.0

_NUMBER = r"\d{1,20}(?:\.\d{1,12})?"
_ISO = r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d:\d\d(?:[.,]\d{1,9})?(?:Z|[+-]\d\d:?\d\d)?"
_TIME = r"\d\d:\d\d:\d\d(?:[.,]\d{1,9})?"
_STAMP = re.compile(
    rf"\[?(?:(?P<iso>{_ISO})|(?P<time>{_TIME})|(?P<number>{_NUMBER}))\]?"
    r"(?:\s*[,;|]\s*|\s*->\s*|:?\s+)(?P<rest>.*)",
    re.ASCII,
)
_UNIT_S = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}


class StampOptions(Settings):
    """How to read the stamps of a log's lines."""

    unit: Literal["s", "ms", "us", "ns"] = "s"
    """Unit of stamps that are plain numbers."""
    utc_offset_h: float = Field(default=0.0, ge=-24, le=24)
    """Hours by which the stamps' clock is ahead of UTC, for dates and times without a zone."""
    date: dt.date | None = None
    """First day, for times of day without a date; without it, seconds since midnight."""


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
    """

    def __init__(self, options: StampOptions | None = None) -> None:
        self._options = StampOptions() if options is None else options
        self._clock = DayClock()
        self._first_day_s = 0.0
        if self._options.date is not None:
            self._first_day_s = day_s(self._options.date) - 3600 * self._options.utc_offset_h

    def split(self, line: str) -> tuple[float, str] | None:
        """Return a line's stamp in seconds and what follows it; ``None`` if it has no stamp."""
        match = _STAMP.match(line)
        if match is None:
            return None
        if match["number"]:
            return float(match["number"]) * _UNIT_S[self._options.unit], match["rest"]
        seconds = self._time_s(match["time"]) if match["time"] else self.iso_s(match["iso"])
        return None if seconds is None else (seconds, match["rest"])

    def iso_s(self, text: str) -> float | None:
        """Return an ISO date and time as seconds since 1970, ``None`` if it is not one."""
        try:
            moment = dt.datetime.fromisoformat(text.strip().replace(",", "."))
        except ValueError:
            return None
        if moment.tzinfo is None:
            zone = dt.timedelta(hours=self._options.utc_offset_h)
            return (moment.replace(tzinfo=dt.UTC) - _EPOCH - zone).total_seconds()
        return (moment - _EPOCH).total_seconds()

    def _time_s(self, text: str) -> float | None:
        hours, minutes, seconds = text.replace(",", ".").split(":")
        of_day_s = 3600 * int(hours) + 60 * int(minutes) + float(seconds)
        if of_day_s > DAY_S:
            return None
        return self._first_day_s + self._clock.seconds(of_day_s)


_EPOCH = dt.datetime(1970, 1, 1, tzinfo=dt.UTC)


def day_s(day: dt.date) -> float:
    """Return a day's midnight (UTC) in seconds since 1970."""
    return float((day - _EPOCH.date()).days) * DAY_S
