from __future__ import annotations

import pytest

from gaia_uwb.logs.serial.dwm1001 import Dwm1001

LEC = "DIST,2,AN0,022E,7.94,8.03,0.00,3.44,AN1,0C1D,-1.00,0.00,0.00,12.30,POS,6.95,5.37,-1.97,52"
LES = "022E[7.94,8.03,0.00]=3.38 0C1D[0.00,0.00,0.00]=12.31 le_us=2576 est[6.95,5.37,-1.97,52]"


def pairs(content: str) -> list[tuple[str, float]] | None:
    readings = Dwm1001().read(content)
    return None if readings is None else [(each.anchor_id, each.value) for each in readings]


def test_lec_and_les() -> None:
    lec = [("022E", 3.44), ("0C1D", 12.3)]
    assert pairs(LEC) == lec
    assert pairs(LEC.partition(",POS")[0]) == lec
    assert pairs(LES) == [("022E", 3.38), ("0C1D", 12.31)]
    assert pairs(LES.partition(" le_us")[0]) == [("022E", 3.38), ("0C1D", 12.31)]


@pytest.mark.parametrize("line", [LEC, LES])
@pytest.mark.parametrize("unknown", ["nan,nan,nan", "-nan,nan,inf"])
def test_places_that_are_not_known_do_not_matter(line: str, unknown: str) -> None:
    for place in ("7.94,8.03,0.00", "6.95,5.37,-1.97"):
        assert pairs(line.replace(place, unknown)) == pairs(line)
    assert pairs(line.replace("12.3", "nan")) is None


@pytest.mark.parametrize("line", [LEC, LES])
def test_a_line_cut_anywhere_gives_no_range_that_was_not_there(line: str) -> None:
    whole = pairs(line)
    assert whole is not None
    for k in range(len(line)):
        left = pairs(line[:k]) or []
        # Only a cut within the last range's decimals cannot be told from a whole line.
        assert {anchor_id for anchor_id, _ in left} <= {anchor_id for anchor_id, _ in whole}
        for (_, a), (_, b) in zip(left, whole, strict=False):
            assert abs(a - b) < 0.5
