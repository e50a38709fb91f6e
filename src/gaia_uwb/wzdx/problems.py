"""What is wrong with a feed, and where: one line each.

>>> from gaia_uwb.wzdx import Problem
>>> from gaia_uwb.wzdx.problems import json_path
>>> print(Problem(json_path("features", 0, "id"), "expected a text, got 7"))
$.features[0].id: expected a text, got 7
"""

from __future__ import annotations

import re
from dataclasses import dataclass

_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")


@dataclass(frozen=True)
class Problem:
    """One thing that is wrong, or looks wrong, in a feed.

    Parameters
    ----------
    path
        Where it is, as a JSON path.
    text
        What is wrong.
    is_error
        Whether it makes the feed invalid; otherwise it is a warning.
    """

    path: str
    text: str
    is_error: bool = True

    def __str__(self) -> str:
        return f"{self.path}: {'' if self.is_error else 'warning: '}{self.text}"


def json_path(*steps: str | int) -> str:
    """Return a place in a JSON document as text, from the top.

    Examples
    --------
    >>> json_path("features", 3, "a b")
    "$.features[3]['a b']"
    """
    words = []
    for step in steps:
        if isinstance(step, int):
            words.append(f"[{step}]")
        else:
            words.append(f".{step}" if _NAME.fullmatch(step) else f"[{step!r}]")
    return "$" + "".join(words)
