from __future__ import annotations

from pathlib import Path

import pytest

from gaia_uwb._shared.errors import InputError
from gaia_uwb.logs._stamps import StampOptions
from gaia_uwb.logs.nmea import parse_sentence, read_nmea

DAY_S = 1767225600  # 2026-01-01


def sentence(body: str) -> str:
    checksum = 0
    for character in body:
        checksum ^= ord(character)
    return f"${body}*{checksum:02X}"


def gga(
    time: str = "120000.00", lat: str = "3733.31200,N", fix: str = "4", alt: str = "48.5"
) -> str:
    return sentence(f"GNGGA,{time},{lat},12702.71200,W,{fix},12,0.7,{alt},M,20.5,M,1.0,0000")


def write(folder: Path, *lines: str) -> Path:
    path = folder / "drive.nmea"
    path.write_text("\r\n".join(lines) + "\r\n", encoding="utf-8")
    return path


def test_degrees_minutes_and_ellipsoidal_height(tmp_path: Path) -> None:
    rmc = sentence("GNRMC,120000.00,A,3733.3,N,12702.7,W,1,2,010126,,,A")
    table, notes = read_nmea(write(tmp_path, rmc, gga(), gga("120000.10", "3733.312,S")))
    assert table["t_s"].tolist() == pytest.approx([DAY_S + 43200, DAY_S + 43200.1])
    assert table["lat"].tolist() == pytest.approx([37.5552, -37.5552], abs=1e-9)
    assert table["lon"].tolist() == pytest.approx([-127.0452, -127.0452], abs=1e-9)
    assert table["alt_m"].tolist() == [69.0, 69.0]
    assert notes == []


def test_the_date_may_come_late_and_midnight_goes_by(tmp_path: Path) -> None:
    zda = sentence("GPZDA,000000.50,02,01,2026,00,00")
    table, _ = read_nmea(write(tmp_path, gga("235959.50"), gga("000000.50"), zda))
    assert table["t_s"].tolist() == [DAY_S + 86399.5, DAY_S + 86400.5]


def test_without_a_date_times_count_from_midnight(tmp_path: Path) -> None:
    path = write(tmp_path, gga(), gga("120001.00"))
    table, notes = read_nmea(path)
    assert table["t_s"].tolist() == [43200, 43201]
    assert "no date" in notes[0]
    dated = StampOptions.model_validate({"date": "2026-01-01"}, strict=False)
    assert read_nmea(path, dated)[0]["t_s"][0] == DAY_S + 43200


def test_host_stamps(tmp_path: Path) -> None:
    path = write(tmp_path, f"{DAY_S}.25 {gga()}", f"{DAY_S}.50 -> {gga()}", gga())
    table, notes = read_nmea(path, clock="host")
    assert table["t_s"].tolist() == [DAY_S + 0.25, DAY_S + 0.5]
    assert notes == ["drive.nmea: skipped 1 sentence without a stamp"]
    with pytest.raises(InputError, match="use clock: gnss"):
        read_nmea(write(tmp_path, gga()), clock="host")


def test_checksum() -> None:
    assert parse_sentence(gga()) is not None
    body = gga()
    for k in range(1, len(body) - 3):
        flipped = body[:k] + chr(ord(body[k]) ^ 1) + body[k + 1 :]
        assert parse_sentence(flipped) is None, flipped


def test_broken_sentences_and_missing_fixes_are_counted(tmp_path: Path) -> None:
    wrong = gga().replace("48.5", "98.5")
    odd = sentence("GNGGA,999999.00,3733.3,N,12702.7,W,4,12,0.7,48.5,M,20.5,M,,")
    table, notes = read_nmea(
        write(
            tmp_path, gga(), wrong, odd, gga()[:30], gga(fix="0"), gga("120001.00"), "$GPGSV,1*00"
        )
    )
    assert len(table) == 2
    assert notes[:2] == [
        "drive.nmea: skipped 3 broken sentences, the first is in line 2",
        "drive.nmea: skipped 1 sentence without a fix",
    ]


def test_a_fix_without_a_height(tmp_path: Path) -> None:
    table, notes = read_nmea(write(tmp_path, gga(), gga("120001.00", alt="")))
    assert "alt_m" not in table
    assert "heights ignored, as 1 fix had none" in notes[0]


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("hello", "contains no GGA sentences"),
        (gga(fix="0"), "no fix in any of its 1 GGA sentences"),
        (gga()[:-1] + "?", "row 1: all GGA sentences are broken"),
    ],
)
def test_logs_without_a_trajectory(tmp_path: Path, line: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        read_nmea(write(tmp_path, line))
