"""Where antennas are on a vehicle, as a user writes it: one lever arm, or ``tags`` with one each.

>>> from gaia_uwb.logs._lever_arm import tag_of
>>> tag_of("1.0", {"1": TagInput(forward_m=2.0), "2": TagInput()})
'1'
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Annotated

from pydantic import BeforeValidator, Field

from gaia_uwb.config import Settings
from gaia_uwb.logs._selection import Value, as_text

MAX_TAGS = 100
"""More than this are no tags of one vehicle."""

_WHOLE = re.compile(r"[+-]?\d+\.0+", re.ASCII)


class LeverArm(Settings):
    """Where the tag's antenna is, seen from the GNSS antenna, in metres."""

    forward_m: float = Field(default=0.0, ge=-50, le=50)
    left_m: float = Field(default=0.0, ge=-50, le=50)
    up_m: float = Field(default=0.0, ge=-50, le=50)


class TagInput(LeverArm):
    """Where one of several tags has its antenna, seen from the point whose path is given."""

    own_clock: bool = False
    """Whether a clock of its own stamps its readings, not one that all tags share."""


def ids_as_text(given: object) -> object:
    """Return tags under their ids as text, as ``where`` compares them: 1, '1' and 1.0 are one.

    Raises
    ------
    ValueError
        If an id is neither text nor a number, or stands twice.
    """
    if not isinstance(given, dict):
        return given
    tags: dict[str, object] = {}
    for tag_id, place in given.items():
        if not _is_id(tag_id):  # YAML takes a bare no or on for a truth value
            raise ValueError("a tag's id must be a number or text (in quotes)")
        text = tag_text(tag_id)
        if text in tags:
            raise ValueError(f"tag {text} appears twice")
        tags[text] = place
    return tags


def _is_id(tag_id: object) -> bool:
    return isinstance(tag_id, (str, int, float)) and not isinstance(tag_id, bool) and tag_id != ""


Tags = Annotated[dict[str, TagInput], BeforeValidator(ids_as_text), Field(max_length=MAX_TAGS)]
"""Tag's id -> where its antenna is."""


def tag_of(label: str, given: Mapping[str, TagInput]) -> str | None:
    """Return under which id a tag is given, ``None`` if it is not.

    Parameters
    ----------
    label
        The tag's id as the log holds it.
    given
        As a user wrote them.
    """
    text = tag_text(label)
    if text in given:
        return text
    try:
        number = as_text(float(text))
    except (ValueError, OverflowError):
        return None
    return number if number in given else None


def tag_text(tag_id: Value) -> str:
    """Return a tag's id as it is shown and compared: a whole number without decimals.

    Examples
    --------
    >>> tag_text(1.0), tag_text("1.0"), tag_text(" roof 1.0")
    ('1', '1', 'roof 1.0')
    """
    text = as_text(tag_id)
    return text.split(".")[0] if _WHOLE.fullmatch(text) else text
