"""Serial logs of Qorvo (Decawave) DWM1001 tags: the shell's ``lec`` and ``les``, with host stamps.

``lec``: ``STAMP DIST,4,AN0,022E,7.94,8.03,0.00,3.44,AN1,...,POS,6.95,5.37,-1.97,52``

``les``: ``STAMP 022E[7.94,8.03,0.00]=3.38 0C1D[...]=... le_us=2576 est[6.95,5.37,-1.97,52]``

Serial lines lose characters, and a number that lost a digit looks like a number. So a line counts
only if all of it is well-formed; the others are counted. The anchors' places in the lines are
what someone once typed into the radios, and are not used.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

from gaia_uwb._shared import InputError, counted
from gaia_uwb.logs._logs import LogRows, LogTable, read_lines
from gaia_uwb.logs._stamps import StampOptions, Stamps

_NUMBER = r"-?\d{1,7}\.\d{1,3}"
_PLACE = rf"{_NUMBER},{_NUMBER},{_NUMBER}"
_LEC_ANCHOR = rf"AN\d{{1,2}},([0-9A-F]{{4}}),{_PLACE},({_NUMBER})"
_LEC = re.compile(
    rf"DIST,(\d{{1,2}})((?:,{_LEC_ANCHOR}){{0,99}})(?:,POS,{_PLACE},\d{{1,3}})?", re.ASCII
)
_LES_ANCHOR = rf"([0-9A-F]{{4}})\[{_PLACE}\]=({_NUMBER})"
_LES = re.compile(
    rf"((?:{_LES_ANCHOR} ?){{1,99}})(?:le_us=\d{{1,9}} ?)?(?:est\[{_PLACE},\d{{1,3}}\])?", re.ASCII
)
_LEC_EACH, _LES_EACH = re.compile(_LEC_ANCHOR, re.ASCII), re.compile(_LES_ANCHOR, re.ASCII)
_SOME_RANGES = re.compile(r"DIST|AN\d|[0-9A-F]{2,4}\[|\]=|est\[|POS,", re.ASCII)
_GIVE_UP_LINES = 200_000


class _Count(NamedTuple):
    n_broken: int
    n_without_stamp: int
    n_other: int
    first_broken: int


def read_dwm1001(path: Path, options: StampOptions | None = None) -> tuple[LogTable, list[str]]:
    """Read the ranges of a DWM1001's serial log.

    Parameters
    ----------
    path
        Text file of stamped ``lec`` or ``les`` lines; other lines are ignored.
    options
        How to read the stamps.

    Returns
    -------
    LogTable
        ``t_s`` in seconds, ``anchor_id``, ``range_m`` in metres.
    list of str
        Notes: how many lines are broken.

    Raises
    ------
    InputError
        If the file cannot be read or contains no ranges.
    """
    rows = LogRows(path, ("t_s", "range_m"))
    count = _read(path, rows, Stamps(options))
    if not len(rows):
        if count.n_without_stamp:
            problem = "its lines have no host time: log them as 'SECONDS DIST,...'"
        elif count.n_broken:
            problem = "all lines with ranges are broken"
            raise InputError(problem, source=path, row=count.first_broken)
        else:
            problem = "contains no 'lec' lines (DIST,...) or 'les' lines (ID[x,y,z]=range)"
        raise InputError(problem, source=path)
    notes = []
    if count.n_broken:
        broken = counted(count.n_broken, "broken line")
        notes.append(f"{path.name}: skipped {broken}, the first is line {count.first_broken}")
    if count.n_without_stamp:
        lines = counted(count.n_without_stamp, "line")
        notes.append(f"{path.name}: skipped {lines} without a stamp")
    return rows.table(), notes


def parse_line(line: str) -> list[tuple[str, float]] | None:
    """Return a line's (anchor id, range in metres); ``None`` if it is not a whole line.

    Examples
    --------
    >>> parse_line("DIST,1,AN0,022E,7.94,8.03,0.00,3.44,POS,6.95,5.37,-1.97,52")
    [('022E', 3.44)]
    >>> parse_line("022E[7.94,8.03,0.00]=3.38 le_us=2576 est[6.95,5.37,-1.97,52]")
    [('022E', 3.38)]
    >>> parse_line("DIST,2,AN0,022E,7.94,8.03,0.00,3.44")
    """
    if lec := _LEC.fullmatch(line):
        pairs = _LEC_EACH.findall(lec[2])
        if len(pairs) != int(lec[1]):
            return None
    elif les := _LES.fullmatch(line):
        pairs = _LES_EACH.findall(les[1])
    else:
        return None
    if len({anchor_id for anchor_id, _ in pairs}) < len(pairs):
        return None
    return [(anchor_id, float(text)) for anchor_id, text in pairs]


def _read(path: Path, rows: LogRows, stamps: Stamps) -> _Count:
    """Append all readings, and count the lines that give none."""
    n_broken = n_without_stamp = n_other = first_broken = 0
    for number, line in read_lines(path):
        stamped = stamps.split(line)
        pairs = parse_line(line if stamped is None else stamped[1])
        if pairs is None and not _SOME_RANGES.search(line):
            n_other += 1
        elif pairs is None:
            n_broken += 1
            first_broken = first_broken or number
        elif stamped is None:
            n_without_stamp += 1
        else:
            for anchor_id, range_m in pairs:
                rows.add(number, (stamped[0], range_m), anchor_id)
        if number >= _GIVE_UP_LINES and not len(rows):
            break
    return _Count(n_broken, n_without_stamp, n_other, first_broken)
