r"""Write CSV that a spreadsheet only shows: no cell of it runs as a formula or steers a screen.

Spreadsheets take a cell that begins with one of ``= + - @`` for a formula, even in quotes. Such a
text gets an apostrophe in front, which they read as "this is text"; numbers stay numbers. The
library's writers know nothing of this.

>>> print(csv_text(["anchor_id", "east_m"], [["=1+1", -2.5], ["a\x1b[2J", None]]), end="")
anchor_id,east_m
'=1+1,-2.5
a\x1b[2J,
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

from gaia_uwb._shared.text import written_out

# Also the wide forms of the signs, which some spreadsheets take for the narrow ones.
_FORMULA = re.compile(r"\s*[=+\-@\uff1d\uff0b\uff0d\uff20]")
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?|[+-]?(inf|nan)", re.ASCII)
_PLAIN = re.compile(r"[\w .:/()\[\]%+'=@\\-]*")

Cell = str | float | int | bool | None


def csv_text(header: Sequence[str], rows: Iterable[Sequence[Cell]]) -> str:
    r"""Return a table as CSV, ending in a line end.

    Parameters
    ----------
    header
        Names of the columns.
    rows
        Their values. None and NaN become empty cells; numbers are written so that they read back
        equal. In texts, unprintable characters are escaped, and what would be a formula begins with
        an apostrophe.

    Examples
    --------
    >>> csv_text(["id", "ok"], [["-12", True], ["@SUM(A1)", False], ['a"b;c', None]])
    'id,ok\n-12,true\n\'@SUM(A1),false\n"a""b;c",\n'
    """
    return "".join(f"{','.join(map(_cell, row))}\n" for row in (header, *rows))


def _cell(value: Cell) -> str:
    if isinstance(value, str):
        return _text(value)
    if value is None or value != value:  # noqa: PLR0124  # NaN alone differs from itself
        return ""
    if isinstance(value, bool):
        return "true" if value else "false"
    return repr(float(value)) if isinstance(value, float) else str(int(value))


def _text(value: str) -> str:
    text = written_out(value)
    if _FORMULA.match(value) and not _NUMBER.fullmatch(value):
        text = f"'{text}"
    # Quoted also where a spreadsheet of another language would split the cell.
    return text if _PLAIN.fullmatch(text) else '"{}"'.format(text.replace('"', '""'))
