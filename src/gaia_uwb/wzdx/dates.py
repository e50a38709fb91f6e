"""Dates in feeds: RFC 3339, in UTC.

>>> from gaia_uwb.wzdx.dates import date_text
>>> from gaia_uwb.wzdx import parse_date
>>> date_text(parse_date("2026-11-22T10:00:00+02:00"))
'2026-11-22T08:00:00Z'
"""

from __future__ import annotations

import re
from datetime import UTC, datetime

_RFC3339 = re.compile(
    r"[0-9]{4}-[0-9]{2}-[0-9]{2}T[0-9]{2}:[0-9]{2}:[0-9]{2}(\.[0-9]+)?(Z|[+-][0-9]{2}:[0-9]{2})"
)
EXPECTED = "expected a date like 2026-11-22T10:00:00Z"


def parse_date(text: str) -> datetime:
    """Return the moment that an RFC 3339 text names, in UTC.

    Raises
    ------
    ValueError
        If it is not such a text, or the moment does not exist; the message says what was expected.
    """
    if _RFC3339.fullmatch(text) is None:
        raise ValueError(EXPECTED)
    try:
        return datetime.fromisoformat(text).astimezone(UTC)
    except (ValueError, OverflowError) as error:  # the 31st of February; before the year 1
        raise ValueError(EXPECTED) from error


def in_utc(date: datetime) -> datetime:
    """Return the same moment in UTC, to the second.

    Raises
    ------
    ValueError
        If the date has no time zone, or lies outside the years 1 to 9999 in UTC.
    """
    if date.tzinfo is None:
        raise ValueError("expected a date with its time zone, such as 2026-11-22T10:00:00Z")
    try:
        return date.astimezone(UTC).replace(microsecond=0)
    except OverflowError as error:  # the first day of the year 1, east of Greenwich
        raise ValueError(EXPECTED) from error


def date_text(date: datetime) -> str:
    """Return a date with a time zone as RFC 3339 in UTC, to the second."""
    return in_utc(date).replace(tzinfo=None).isoformat() + "Z"
