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
_SECOND = slice(17, 19)
_UTC = ("Z", "+00:00", "-00:00")


def parse_date(text: str) -> datetime:
    """Return the moment that an RFC 3339 text names, in UTC.

    All that RFC 3339 allows is read. A leap second counts as the one before it, and a moment that
    lies beyond the years 1 to 9999 in UTC only is the first or the last one in them.

    Raises
    ------
    ValueError
        If it is not such a text, or the moment does not exist; the message says what was expected.

    Examples
    --------
    >>> parse_date("9999-12-31T23:59:59-05:00").year
    9999
    """
    text = text.upper()
    if _RFC3339.fullmatch(text) is None:
        raise ValueError(EXPECTED)
    if text[_SECOND] == "60":
        text = f"{text[: _SECOND.start]}59{text[_SECOND.stop :]}"
    try:
        date = datetime.fromisoformat(text)
    except ValueError as error:  # the 31st of February
        raise ValueError(EXPECTED) from error
    try:
        return date.astimezone(UTC)
    except OverflowError:
        return (datetime.min if date.year == 1 else datetime.max).replace(tzinfo=UTC)


def is_in_utc(text: str) -> bool:
    """Whether a text is an RFC 3339 date without an offset from UTC, or no such date at all."""
    return _RFC3339.fullmatch(text.upper()) is None or text.upper().endswith(_UTC)


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
