r"""Text for people: names and ids from a log made harmless, and numbers as people read them.

>>> print(printable("A\u202eB"), in_markdown("*1* <b>"), in_html("<b>"))
A\u202eB \*1\* \<b\> &lt;b&gt;
"""

from __future__ import annotations

import html
import re
import reprlib
from collections.abc import Sequence

# What CommonMark, GitHub's tables, automatic links, mentions, mathematics and smileys act on.
_MARKS = re.compile(r"([\\`*_{}\[\]()<>#!|&~$@])")
_LONGEST_TEXT = 150
_LINKS = re.compile(r"(?i)(https?|ftp|mailto|xmpp):|\b(www)\.|:(?=[\w+-]+:)")


def written_out(text: str) -> str:
    r"""Return text with unprintable characters escaped, line ends included.

    So it cannot steer a terminal, and is one line.

    Parameters
    ----------
    text
        Any.

    Examples
    --------
    >>> written_out("a\nb\x1b[2J")
    'a\\nb\\x1b[2J'
    """
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)


def printable(text: str) -> str:
    """Return text on one line, with characters that steer a screen or reverse its order escaped.

    Parameters
    ----------
    text
        Any.
    """
    return written_out(" ".join(text.split())) or "(no name)"


def shown(value: object) -> str:
    """Return how Python writes a value, shortened, for a message that says what came.

    Parameters
    ----------
    value
        Any, of any size.

    Examples
    --------
    >>> from gaia_uwb._shared import shown
    >>> shown(["A", "B"]), len(shown([["A" * 1000] * 1000] * 1000)) < 200
    ("['A', 'B']", True)
    """
    return shortened(reprlib.repr(value))


def shortened(text: str) -> str:
    """Return the start of a text that is longer than a message can hold.

    Parameters
    ----------
    text
        Any.
    """
    return text if len(text) <= _LONGEST_TEXT else f"{text[:_LONGEST_TEXT]}..."


def in_a_line(text: str, longest: int) -> str:
    r"""Return text that a line can hold: unprintable characters escaped, the middle left out.

    Parameters
    ----------
    text
        Any.
    longest
        Characters from which on the middle is left out.

    Examples
    --------
    >>> in_a_line("a\nb", 10), in_a_line("0123456789", 4)
    ('a\\nb', '01...89')
    """
    line = written_out(text)
    half = longest // 2
    return line if len(line) <= longest else f"{line[:half]}...{line[-half:]}"


def in_markdown(text: str) -> str:
    """Return Markdown that shows a text and does nothing else, within a line or a table's cell.

    Parameters
    ----------
    text
        Any.
    """
    escaped = _MARKS.sub(r"\\\1", printable(text))
    return _LINKS.sub(lambda found: f"{found[0][:-1]}\\{found[0][-1]}", escaped)


def in_html(text: str) -> str:
    """Return HTML that shows a text and does nothing else, within an element or an attribute.

    Parameters
    ----------
    text
        Any.
    """
    return html.escape(printable(text))


def metres(value_m: float) -> str:
    """Return a length as people read it.

    Parameters
    ----------
    value_m
        In metres.

    Examples
    --------
    >>> metres(0.123), metres(45.67), metres(1234.5)
    ('0.12 m', '45.7 m', '1234 m')
    """
    digits = 2 if abs(value_m) < 10.0 else 1 if abs(value_m) < 100.0 else 0
    return f"{value_m:.{digits}f} m"


def percent(share: float) -> str:
    """Return a share as people read it, never rounded up to certainty.

    Parameters
    ----------
    share
        Between 0 and 1.

    Examples
    --------
    >>> percent(0.002), percent(0.37), percent(0.999)
    ('less than 1 %', '37 %', 'more than 99 %')
    """
    if share < 0.01:
        return "less than 1 %"
    if share > 0.99:
        return "more than 99 %"
    return f"{100.0 * share:.0f} %"


def counted(n: int, one: str, many: str | None = None) -> str:
    """Return a number with its noun, in the singular for 1.

    Parameters
    ----------
    n
        How many.
    one, many
        The noun; by default the plural is ``one`` with an s.

    Examples
    --------
    >>> counted(1, "row"), counted(12_000, "row"), counted(2, "fix", "fixes")
    ('1 row', '12,000 rows', '2 fixes')
    """
    return f"{n:,} {one if n == 1 else many or f'{one}s'}"


def some_of(names: Sequence[str]) -> str:
    """Name up to five, and say how many more there are.

    Parameters
    ----------
    names
        At least one.

    Examples
    --------
    >>> some_of(["a", "b"]), some_of(list("abcdefg"))
    ('a, b', 'a, b, c, d, e and 2 more')
    """
    more = f" and {len(names) - 5} more" if len(names) > 5 else ""
    return f"{', '.join(names[:5])}{more}"
