"""Qorvo (Decawave) TREK1000 and boards with its firmware (EVK1000, Haoru): ``mc`` and ``mr`` lines.

``mc 07 000004ec 000008ee 0000087e 00000000 6cc0 0a 00a0642b a0:0``

Numbers are hexadecimal. After the kind come a mask (bit k: anchor k answered), the ranges to the
anchors 0, 1, ... in millimetres, a count of ranges, a sequence number, a word for debugging, and
``aT:A``: tag T. ``mr`` holds ranges as they were measured, ``mc`` the same ones corrected for the
radio's bias; ``ma`` holds those between anchors and is not read.
"""

from __future__ import annotations

import re

from gaia_uwb.logs.serial.device import Device, SerialReading

_LINE = re.compile(
    r"m([rc]) +([0-9a-f]{2}) +((?:[0-9a-f]{8} +){3,8})[0-9a-f]{4} +[0-9a-f]{2} +[0-9a-f]{1,8} +"
    r"[at](\d{1,3}):\d{1,3}(?: +[0-9a-f]{1,8})?",
    re.ASCII | re.IGNORECASE,
)
_LONGEST_MM = 2**31  # what is above is a negative number, or no range


class Trek1000(Device):
    """TREK1000 and what prints its lines."""

    name = "trek1000"
    lines = "'mc' or 'mr' lines (mc MASK RANGE0 RANGE1 ... aT:A)"
    taken = "anchor: a range's place in the line (from 0), range: hexadecimal millimetres"
    metres = 0.001
    start = re.compile(r"\bm[rc] +[0-9a-f]", re.ASCII | re.IGNORECASE)
    tag_words = ("tag_id",)

    def read(self, content: str) -> list[SerialReading] | None:
        """Return the ranges of a line.

        Examples
        --------
        >>> line = "mc 05 000004ec 000008ee 0000087e 00000000 6cc0 0a 00a0642b a3:0"
        >>> [reading[:2] for reading in Trek1000().read(line)]
        [('0', 1260.0), ('2', 2174.0)]
        >>> Trek1000().read(line[:-3])
        """
        line = _LINE.fullmatch(content)
        if line is None:
            return None
        mask, values = int(line[2], 16), [int(word, 16) for word in line[3].split()]
        if mask >> len(values):
            return None
        heard = [k for k, value in enumerate(values) if mask >> k & 1 and 0 < value < _LONGEST_MM]
        return [
            SerialReading(str(k), float(values[k]), tag_id=line[4], raw=line[1] in "rR")
            for k in heard
        ]
