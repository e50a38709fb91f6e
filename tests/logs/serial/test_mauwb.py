from __future__ import annotations

import math

import pytest

from gaia_uwb.logs.serial.mauwb import MaUwb

PLAIN = "AT+RANGE=tid:4,mask:05,seq:218,range:(344,0,1230,0,0,0,0,0)"
POWER = ",rssi:(-70.10,0.00,-82.50,0.00,0.00,0.00,0.00,0.00)"
IDS = ",ancid:(6,-1,2,-1,-1,-1,-1,-1)"


def read(content: str) -> list[tuple[str, float, float]] | None:
    readings = MaUwb().read(content)
    return None if readings is None else [(r.anchor_id, r.value, r.rssi_dbm) for r in readings]


def test_each_firmware_is_read() -> None:
    assert read(PLAIN + POWER) == [("0", 344.0, -70.1), ("2", 1230.0, -82.5)]
    assert read(PLAIN + POWER + IDS) == [("6", 344.0, -70.1), ("2", 1230.0, -82.5)]
    plain = read(PLAIN + IDS)
    assert plain is not None
    assert [each[0] for each in plain] == ["6", "2"]
    assert math.isnan(plain[0][2])
    assert read(PLAIN.replace(",", ", ") + ", kx:152.75,user:user1") is not None


@pytest.mark.parametrize(
    "line",
    [
        PLAIN[:-1],
        PLAIN.replace("1230", "12x0"),
        PLAIN.replace("seq", "sq"),
        PLAIN + IDS.replace(",-1)", ")"),
        PLAIN + IDS.replace("2", "6"),
        PLAIN.replace("344", ""),
    ],
)
def test_what_is_not_whole_gives_nothing(line: str) -> None:
    assert read(line) is None
