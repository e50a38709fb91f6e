"""Makerfabs MaUWB and other boards with its AT firmware: ``AT+RANGE`` lines.

``AT+RANGE=tid:1,mask:04,seq:63,range:(0,0,30,0,0,0,0,0),rssi:(0.00,0.00,-77.93,...)``, and since a
later firmware ``ancid:(...)``, which names the anchor of each place (-1: none). Ranges are whole
centimetres, 0 where an anchor was not heard.
"""

from __future__ import annotations

import math
import re

from gaia_uwb.logs.serial.device import Device, SerialReading

_LIST = r"\(([-0-9., ]{0,400})\)"
_LINE = re.compile(
    r"AT\+RANGE=tid: ?(\d{1,5}), ?mask: ?[0-9A-Fa-f]{1,8}, ?seq: ?\d{1,10}"
    rf", ?range: ?{_LIST}(?:, ?rssi: ?{_LIST})?(?:, ?ancid: ?{_LIST})?"
    r"(?:, ?\w{1,20}: ?[^,()]{0,40}){0,20}",
    re.ASCII,
)
_WHOLE = re.compile(r"-?\d{1,6}", re.ASCII)
_POWER = re.compile(r"-?\d{1,3}(?:\.\d{1,4})?", re.ASCII)


class MaUwb(Device):
    """MaUWB with ESP32 and STM32."""

    name = "mauwb"
    lines = "AT+RANGE lines (AT+RANGE=tid:...,range:(...))"
    taken = "anchor: ancid, or else the place in range:(...) from 0, range: centimetres"
    metres = 0.01
    start = re.compile(r"AT\+RANGE|AT\+RAN|range:? ?\(|tid:", re.ASCII)
    tag_words = ("tid", "tag_id")

    def read(self, content: str) -> list[SerialReading] | None:
        """Return the ranges of a line.

        Examples
        --------
        >>> line = "AT+RANGE=tid:1,mask:05,seq:63,range:(310,0,30),rssi:(-80.10,0.00,-77.93)"
        >>> [reading[:3] for reading in MaUwb().read(line)]
        [('0', 310.0, -80.1), ('2', 30.0, -77.93)]
        >>> [reading[:2] for reading in MaUwb().read(line + ",ancid:(7,-1,9)")]
        [('7', 310.0), ('9', 30.0)]
        >>> MaUwb().read(line[:-1])
        """
        line = _LINE.fullmatch(content)
        if line is None:
            return None
        ranges = _items(line[2], _WHOLE)
        powers = [] if line[3] is None else _items(line[3], _POWER)
        ids = list(range(len(ranges or ()))) if line[4] is None else _items(line[4], _WHOLE)
        if ranges is None or powers is None or ids is None or len(ids) != len(ranges):
            return None
        powers = powers if len(powers) == len(ranges) else []
        readings = [
            SerialReading(str(int(ids[k])), value, _power(powers, k), line[1])
            for k, value in enumerate(ranges)
            if value > 0 and ids[k] >= 0
        ]
        return readings if len({r.anchor_id for r in readings}) == len(readings) else None


def _items(text: str, form: re.Pattern[str]) -> list[float] | None:
    """Return the numbers of a list; ``None`` if one is broken."""
    words = [word.strip() for word in text.split(",")]
    return [float(word) for word in words] if all(map(form.fullmatch, words)) else None


def _power(powers: list[float], k: int) -> float:
    """Return an anchor's received power; 0 stands for none."""
    return powers[k] if powers and powers[k] < 0 else math.nan
