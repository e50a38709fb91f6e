from __future__ import annotations

from pathlib import Path

import pytest

from gaia_uwb._shared.errors import InputError
from gaia_uwb.logs._stamps import StampOptions
from gaia_uwb.logs.dwm1001 import parse_line, read_dwm1001

LEC = "DIST,2,AN0,022E,7.94,8.03,0.00,3.44,AN1,0C1D,-1.00,0.00,0.00,12.30,POS,6.95,5.37,-1.97,52"
LES = "022E[7.94,8.03,0.00]=3.38 0C1D[0.00,0.00,0.00]=12.31 le_us=2576 est[6.95,5.37,-1.97,52]"
PAIRS = [("022E", 3.44), ("0C1D", 12.3)]


def write(folder: Path, *lines: str) -> Path:
    path = folder / "tag.log"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("stamp", "options", "t_s"),
    [
        ("1767225600.25 ", {}, 1767225600.25),
        ("1767225600250,", {"unit": "ms"}, 1767225600.25),
        ("[2026-01-01 00:00:00.250] ", {}, 1767225600.25),
        ("2026-01-01T00:00:00,250Z -> ", {}, 1767225600.25),
        ("2026-01-01T09:00:00.250+09:00; ", {}, 1767225600.25),
        ("2026-01-01 09:00:00.250: ", {"utc_offset_h": 9.0}, 1767225600.25),
        ("00:00:00.250 ", {}, 0.25),
    ],
)
def test_stamps_of_all_kinds(
    tmp_path: Path, stamp: str, options: dict[str, object], t_s: float
) -> None:
    table, notes = read_dwm1001(write(tmp_path, stamp + LEC), StampOptions.model_validate(options))
    assert table["t_s"].tolist() == pytest.approx([t_s, t_s], abs=1e-6)
    assert table["range_m"].tolist() == [3.44, 12.3]
    assert [table.labels["anchor_id"][k] for k in table["anchor_id"]] == ["022E", "0C1D"]
    assert notes == []


def test_lec_and_les() -> None:
    assert parse_line(LEC) == PAIRS
    assert parse_line(LEC.partition(",POS")[0]) == PAIRS
    assert parse_line(LES) == [("022E", 3.38), ("0C1D", 12.31)]
    assert parse_line(LES.partition(" le_us")[0]) == [("022E", 3.38), ("0C1D", 12.31)]


@pytest.mark.parametrize("line", [LEC, LES])
def test_a_line_cut_anywhere_gives_no_range_that_was_not_there(line: str) -> None:
    whole = parse_line(line)
    assert whole is not None
    for k in range(len(line)):
        pairs = parse_line(line[:k]) or []
        # Only a cut within the last range's decimals cannot be told from a whole line.
        assert {anchor_id for anchor_id, _ in pairs} <= {anchor_id for anchor_id, _ in whole}
        for (_, a), (_, b) in zip(pairs, whole, strict=False):
            assert abs(a - b) < 0.5


def test_broken_lines_are_counted(tmp_path: Path) -> None:
    good = "1.5 " + LEC
    lines = ["dwm> lec", good, "1.6 " + LEC[:40], "1.7 " + LEC.replace("12.30", "12.3O"), "", good]
    table, notes = read_dwm1001(write(tmp_path, *lines, LEC))
    assert len(table) == 4
    assert table.number.tolist() == [2, 2, 6, 6]
    assert notes == [
        "tag.log: skipped 2 broken lines, the first is line 3",
        "tag.log: skipped 1 line without a stamp",
    ]
    assert str(table.error("is odd", index=2, column="range_m")).endswith(
        "tag.log, row 6, column range_m: is odd"
    )


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("hello", "contains no 'lec' lines"),
        (LEC, "have no host time"),
        ("1.0 " + LEC[:30], "row 1: all lines with ranges are broken"),
    ],
)
def test_logs_without_ranges(tmp_path: Path, line: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        read_dwm1001(write(tmp_path, line))


def test_times_of_day_go_on_after_midnight(tmp_path: Path) -> None:
    path = write(tmp_path, "23:59:59.5 " + LEC, "00:00:00.5 " + LEC)
    seconds = read_dwm1001(path)[0]["t_s"]
    assert seconds[2] - seconds[0] == 1.0
    options = StampOptions.model_validate({"date": "2026-01-01"}, strict=False)
    assert read_dwm1001(path, options)[0]["t_s"][2] == 1767225600 + 86400.5
