"""Qorvo DWM3001CDK and QM33 with the CLI firmware: session lines, or JSON in earlier versions.

.. code-block:: text

    SESSION_INFO_NTF: {session_handle=1, sequence_number=7, block_index=7, n_measurements=2
     [mac_address=0x0001, status="SUCCESS", distance[cm]=245, RSSI[dBm]=-78.0];
     [mac_address=0x0002, status="RX_TIMEOUT"]}

    {"Block":7, "results":[{"Addr":"0x0001","Status":"Ok","D_cm":245,"LFoM":85}]}

A session may be one line or several; a line without a stamp belongs to the one above.
"""

from __future__ import annotations

import json
import math
import re
from typing import Any

from gaia_uwb.logs.serial.device import Device, SerialReading

_ADDRESS = r"(?:0x)?[0-9A-Fa-f]{2,16}|(?:[0-9A-Fa-f]{2}:){1,7}[0-9A-Fa-f]{2}"
_VALUE = r"(?:\"[^\"\[\]]{0,60}\"|[^,;\"\[\]{}]{1,60})"
_KEY = r"\w{1,40}(?:\[\w{1,10}\])?"
_GROUP = rf"\[mac_address=({_ADDRESS})((?:, ?{_KEY}= ?{_VALUE}){{1,40}})\]"
_EACH = re.compile(_GROUP, re.ASCII)
_LINE = re.compile(
    rf"(?:SESSION_INFO_NTF: ?\{{[\w=, ]{{0,300}})?\s*(?:{_GROUP}[;,]?\s*){{0,99}}\}}?", re.ASCII
)
_COUNT = re.compile(r"n_measurements=(\d{1,3})", re.ASCII)
_DISTANCE = re.compile(r"distance\[cm\]= ?(-?\d{1,6})(?:,|$)", re.ASCII)
_POWER = re.compile(r"RSSI\[dBm\]= ?(-\d{1,3}(?:\.\d{1,3})?)(?:,|$)", re.ASCII | re.IGNORECASE)


class Dwm3001(Device):
    """DWM3001CDK and QM33 with Qorvo's command line."""

    name = "dwm3001"
    lines = "session lines (SESSION_INFO_NTF: {... [mac_address=..., distance[cm]=...]})"
    taken = "anchor: mac_address, range: distance[cm]"
    metres = 0.01
    start = re.compile(
        r"SESSION_INFO_NTF|\[?mac_address=|distance\[cm|\{ ?\"(?:Block|results)\"", re.ASCII
    )
    stamped_once = True

    def read(self, content: str) -> list[SerialReading] | None:
        """Return the ranges of a line.

        Examples
        --------
        >>> line = '[mac_address=0x0001, status="SUCCESS", distance[cm]=245]}'
        >>> [reading[:2] for reading in Dwm3001().read(line)]
        [('0x0001', 245.0)]
        >>> line = '{"Block":7, "results":[{"Addr":"0x0001","Status":"Ok","D_cm":245}]}'
        >>> [reading[:2] for reading in Dwm3001().read(line)]
        [('0x0001', 245.0)]
        >>> Dwm3001().read(line[:-4])
        """
        if content.startswith("{"):
            return _read_json(content)
        if not _LINE.fullmatch(content):
            return None
        groups = list(_EACH.finditer(content))
        count = _COUNT.search(content)
        if count is not None and groups and int(count[1]) != len(groups):
            return None
        readings = []
        for group in groups:
            if 'status="SUCCESS"' not in group[2]:
                continue
            distance, power = _DISTANCE.search(group[2]), _POWER.search(group[2])
            if distance is None:
                return None
            rssi_dbm = math.nan if power is None else float(power[1])
            readings.append(SerialReading(group[1], float(distance[1]), rssi_dbm))
        return readings


def _read_json(content: str) -> list[SerialReading] | None:
    try:
        block: Any = json.loads(content)
        results = [each for each in block["results"] if str(each["Status"]).lower() == "ok"]
        readings = [SerialReading(str(each["Addr"]), float(each["D_cm"])) for each in results]
    except (ValueError, KeyError, TypeError, RecursionError, OverflowError):
        return None
    whole = all(math.isfinite(each.value) and each.anchor_id for each in readings)
    return readings if whole else None
