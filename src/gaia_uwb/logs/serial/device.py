"""What a device's lines look like: the base of all devices whose serial logs are read.

A line is stamp and content. Serial lines lose characters, and a number that lost a digit looks like
a number. So content counts only if all of it is well-formed.
"""

from __future__ import annotations

import math
import re
from typing import ClassVar, NamedTuple


class SerialReading(NamedTuple):
    """One range of one line.

    Parameters
    ----------
    anchor_id
        The anchor.
    value
        The range in the device's unit; 0 where the device says so of anchors it did not hear.
    rssi_dbm
        Received power.
    tag_id
        The tag, where lines name it.
    raw
        Whether this is an uncorrected range, which is used only where there are no corrected ones.
    """

    anchor_id: str
    value: float
    rssi_dbm: float = math.nan
    tag_id: str | None = None
    raw: bool = False


class Device:
    """One kind of device; an object reads the lines of one log in their order."""

    name: ClassVar[str]
    """Its name in ``gaia.yaml``."""
    lines: ClassVar[str]
    """What its lines are, for messages."""
    taken: ClassVar[str]
    """Which parts of a line are the anchor and the range, for a note."""
    metres: ClassVar[float]
    """Metres per unit of its ranges."""
    start: ClassVar[re.Pattern[str]]
    """Where the content of a line with ranges starts; also found in lines that are broken."""
    tag_words: ClassVar[tuple[str, ...]] = ()
    """How ``where`` may name the tag."""
    stamped_once: ClassVar[bool] = False
    """Whether one stamp may serve several lines."""

    def read(self, content: str) -> list[SerialReading] | None:
        """Return the ranges of a line's content; ``None`` if it is not whole.

        Parameters
        ----------
        content
            From :attr:`start` on.
        """
        raise NotImplementedError
