"""Qorvo (Decawave) DWM1001: the shell's ``lec`` and ``les``.

``lec``: ``DIST,4,AN0,022E,7.94,8.03,0.00,3.44,AN1,...,POS,6.95,5.37,-1.97,52``

``les``: ``022E[7.94,8.03,0.00]=3.38 0C1D[...]=... le_us=2576 est[6.95,5.37,-1.97,52]``

The places in the lines are not used: those of anchors are what someone once typed into the radios,
and that of the tag is ``nan`` with fewer than three anchors.
"""

from __future__ import annotations

import re

from gaia_uwb.logs.serial.device import Device, SerialReading

_NUMBER = r"-?\d{1,7}\.\d{1,3}"
_COORDINATE = rf"(?:{_NUMBER}|-?nan|-?inf)"
_PLACE = rf"{_COORDINATE},{_COORDINATE},{_COORDINATE}"
_LEC_ANCHOR = rf"AN\d{{1,2}},([0-9A-F]{{4}}),{_PLACE},({_NUMBER})"
_LEC = re.compile(
    rf"DIST,(\d{{1,2}})((?:,{_LEC_ANCHOR}){{0,99}})(?:,POS,{_PLACE},\d{{1,3}})?", re.ASCII
)
_LES_ANCHOR = rf"([0-9A-F]{{4}})\[{_PLACE}\]=({_NUMBER})"
_LES = re.compile(
    rf"((?:{_LES_ANCHOR} ?){{1,99}})(?:le_us=\d{{1,9}} ?)?(?:est\[{_PLACE},\d{{1,3}}\])?", re.ASCII
)
_LEC_EACH, _LES_EACH = re.compile(_LEC_ANCHOR, re.ASCII), re.compile(_LES_ANCHOR, re.ASCII)


class Dwm1001(Device):
    """DWM1001 and MDEK1001 with the firmware's shell."""

    name = "dwm1001"
    lines = "'lec' lines (DIST,...) or 'les' lines (ID[x,y,z]=range)"
    taken = "anchor: the radio's id, range: the last number of each anchor, in metres"
    metres = 1.0
    start = re.compile(r"DIST|AN\d|[0-9A-F]{1,4}\[|\]=|est\[|POS,", re.ASCII)

    def read(self, content: str) -> list[SerialReading] | None:
        """Return the ranges of a line.

        Examples
        --------
        >>> [reading[:2] for reading in Dwm1001().read("DIST,1,AN0,022E,7.94,8.03,0.00,3.44")]
        [('022E', 3.44)]
        >>> [r[:2] for r in Dwm1001().read("022E[0.00,0.00,0.00]=3.38 est[nan,nan,nan,0]")]
        [('022E', 3.38)]
        >>> Dwm1001().read("DIST,2,AN0,022E,7.94,8.03,0.00,3.44")
        """
        if lec := _LEC.fullmatch(content):
            pairs = _LEC_EACH.findall(lec[2])
            if len(pairs) != int(lec[1]):
                return None
        elif les := _LES.fullmatch(content):
            pairs = _LES_EACH.findall(les[1])
        else:
            return None
        if len({anchor_id for anchor_id, _ in pairs}) < len(pairs):
            return None
        return [SerialReading(anchor_id, float(text)) for anchor_id, text in pairs]
