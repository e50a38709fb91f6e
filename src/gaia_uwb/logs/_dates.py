"""Dates and times in a table's cells: ISO, and the forms of spreadsheets and RTKLIB.

>>> seconds_of("2026-01-01T00:00:00,25Z"), seconds_of("2026/01/01 0:00:00.250")
(1767225600.25, 1767225600.25)
>>> seconds_of("01.01.2026 01:00", utc_offset_h=1.0), seconds_of("1/1/2026 12:00 AM", order="mdy")
(1767225600.0, 1767225600.0)
"""

from __future__ import annotations

import datetime as dt
import re
from collections.abc import Sequence
from typing import Literal

import numpy as np

from gaia_uwb._shared import Array, Float64
from gaia_uwb.logs._table import Table

DateOrder = Literal["dmy", "mdy"]

_EPOCH = dt.datetime(1970, 1, 1, tzinfo=dt.UTC)
_FORM = re.compile(
    r"(?P<first>\d{1,4})(?P<mark>[-/.])(?P<second>\d{1,2})(?P=mark)(?P<third>\d{1,4})[T\s]\s*"
    r"(?P<hour>\d{1,2}):(?P<minute>\d\d)(?::(?P<second_s>\d\d(?:[.,]\d{0,12})?))?\s*"
    r"(?P<half>[AaPp]\.?[Mm]\.?)?\s*(?P<zone>Z|UTC|GMT|[+-]\d\d:?\d\d)?",
    re.ASCII,
)


def seconds_of(
    text: str, *, utc_offset_h: float = 0.0, order: DateOrder | None = None
) -> float | None:
    """Return a date and time as seconds since 1970, ``None`` if its form is not known.

    Parameters
    ----------
    text
        ``2026-01-01T09:00:00.25Z``, with a blank for the T, slashes, a decimal comma, an offset;
        or a date that ends in the year: with points the day comes first, with slashes ``order``
        must tell.
    utc_offset_h
        Hours by which times without a zone are ahead of UTC.
    order
        Whether day or month comes first.
    """
    match = _FORM.fullmatch(text.strip())
    try:
        moment = _in_iso(text) if match is None else _in_parts(match, order)
    except (ValueError, OverflowError):
        return None
    if moment is None:
        return None
    if moment.tzinfo is None:
        zone = dt.timedelta(hours=utc_offset_h)
        return (moment.replace(tzinfo=dt.UTC) - _EPOCH - zone).total_seconds()
    return (moment - _EPOCH).total_seconds()


def way_out(text: str, order: DateOrder | None) -> str:
    """Return what to add to ``gaia.yaml`` where a date may be of two days, else nothing.

    Examples
    --------
    >>> way_out("03/04/2026 09:00:00", None)
    '; day or month first? Add stamps: {date_order: dmy} or mdy'
    """
    match = _FORM.fullmatch(text.strip())
    if re.match(r"\d{1,2}:\d\d", text.strip()):
        return "; where the date has a column of its own: t_s: {columns: [DATE, TIME], iso: true}"
    unclear = match is not None and len(match["third"]) == 4 and match["mark"] != "."
    if not unclear or order is not None:
        return ""
    return "; day or month first? Add stamps: {date_order: dmy} or mdy"


def column_seconds(
    table: Table,
    names: Sequence[str],
    *,
    utc_offset_h: float = 0.0,
    order: DateOrder | None = None,
) -> Float64[Array, "R"]:
    """Return the dates and times of a table in seconds since 1970.

    Parameters
    ----------
    table
        With text in these columns.
    names
        One column, or that of the dates and that of the times of day.
    utc_offset_h, order
        Like those of :func:`seconds_of`.

    Raises
    ------
    InputError
        If a cell's form is not known.
    """
    codes, texts = table[names[0]], list(table.labels[names[0]])
    if len(names) > 1:
        times = table.labels[names[1]]
        pairs, codes = np.unique(codes * len(times) + table[names[1]], return_inverse=True)
        texts = [f"{texts[pair // len(times)]} {times[pair % len(times)]}" for pair in pairs]
    seconds = [seconds_of(text, utc_offset_h=utc_offset_h, order=order) for text in texts]
    if None in seconds:
        wrong = seconds.index(None)
        text, index = texts[wrong], int(np.argmax(codes == wrong))
        problem = f"expected an ISO date and time, got {text[:40]!r}{way_out(text, order)}"
        raise table.error(problem, index=index, column=names[0])
    return np.array(seconds, np.float64)[codes]


def _in_iso(text: str) -> dt.datetime:
    return dt.datetime.fromisoformat(text.strip().replace(",", "."))


def _in_parts(match: re.Match[str], order: DateOrder | None) -> dt.datetime | None:
    parts = [match["first"], match["second"], match["third"]]
    if len(parts[0]) == 4:
        year, month, day = map(int, parts)
    elif len(parts[2]) == 4 and (order is not None or match["mark"] == "."):
        month_first = order == "mdy" and match["mark"] != "."
        day, month = (int(parts[k]) for k in ((1, 0) if month_first else (0, 1)))
        year = int(parts[2])
    else:
        return None
    hour = int(match["hour"])
    if half := match["half"]:
        if not 1 <= hour <= 12:
            return None
        hour = hour % 12 + 12 * (half[0] in "Pp")
    moment = dt.datetime(year, month, day, hour, int(match["minute"]))
    second_s = float((match["second_s"] or "0").replace(",", "."))
    if second_s >= 60:
        return None
    moment += dt.timedelta(seconds=second_s)
    zone = match["zone"]
    if zone is None:
        return moment
    if zone[0] not in "+-":
        return moment.replace(tzinfo=dt.UTC)
    offset = dt.timedelta(hours=int(zone[1:3]), minutes=int(zone[-2:]))
    return moment.replace(tzinfo=dt.timezone(-offset if zone[0] == "-" else offset))
