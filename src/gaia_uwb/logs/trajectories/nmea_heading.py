"""Headings in an NMEA log: HDT and THS sentences, of receivers with two antennas and of compasses.

They hold no time. A heading belongs to the moment of the GGA, GNS or RMC sentence before it; of
several after one such sentence, the first counts.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from gaia_uwb._shared import Array, Float64
from gaia_uwb.logs._logs import LogRows

KINDS = ("HDT", "THS")
"""The sentences that hold a heading."""

_NUMBER = re.compile(r"\d{1,3}(?:\.\d{1,9})?", re.ASCII)
_FULL_TURN_DEG = 360.0
_GOOD_MODES = ("A", "E")  # of THS: autonomous, estimated (dead reckoning)


class Headings:
    """The headings of one log, in their order.

    Parameters
    ----------
    path
        The log.
    """

    def __init__(self, path: Path) -> None:
        self._rows = LogRows(path, ("moment_s", "heading_deg"))

    def add(self, number: int, moment_s: float, kind: str, fields: list[str]) -> None:
        """Add the heading of a sentence, if it has one.

        Parameters
        ----------
        number
            Of the line.
        moment_s
            The moment of the sentence before it that has a time.
        kind, fields
            The sentence.

        Raises
        ------
        InputError
            If there are too many.
        """
        text, mode = (*fields, "")[:2]
        good = mode == "T" if kind == "HDT" else mode in _GOOD_MODES
        if good and _NUMBER.fullmatch(text) and float(text) <= _FULL_TURN_DEG:
            self._rows.add(number, (moment_s, float(text)))

    def at(self, moment_s: Float64[Array, "R"]) -> Float64[Array, "R"]:
        """Return the heading at some moments, in degrees clockwise from north; NaN for none."""
        heading_deg = np.full(len(moment_s), np.nan)
        if not len(self._rows):
            return heading_deg
        table = self._rows.table()
        known_s, first = np.unique(table["moment_s"], return_index=True)
        place = np.minimum(np.searchsorted(known_s, moment_s), len(known_s) - 1)
        there = known_s[place] == moment_s
        heading_deg[there] = table["heading_deg"][first[place[there]]]
        return heading_deg
