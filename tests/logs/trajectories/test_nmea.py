from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gaia_uwb._shared.errors import InputError
from gaia_uwb.logs._stamps import StampOptions
from gaia_uwb.logs.trajectories.nmea import parse_sentence, read_nmea

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


def at_zero() -> str:
    return sentence("GPGGA,115959.00,0000.0,N,00000.0,E,1,04,9.9,0.0,M,0.0,M,,")


def rmc(time: str = "120000.00", status: str = "A", date: str = "010126", lat: str = "30") -> str:
    return sentence(f"GNRMC,{time},{status},3733.{lat},N,12702.70,W,1,2,{date},,,A")


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
    assert notes == [
        "drive.nmea: date 2026-01-01 from RMC",
        "drive.nmea: 2 fixes: 2 RTK fixed",
    ]


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
    path = write(tmp_path, f"{DAY_S}.25 {gga()}", f"{DAY_S}.50 -> {gga('120000.50')}", gga())
    table, notes = read_nmea(path, clock="host")
    assert table["t_s"].tolist() == [DAY_S + 0.25, DAY_S + 0.5]
    assert notes[0] == "drive.nmea: skipped 1 sentence without a stamp"
    with pytest.raises(InputError, match="use clock: gnss"):
        read_nmea(write(tmp_path, gga()), clock="host")
    with pytest.raises(InputError, match=r"in a form that is not read .*: 'at noon'"):
        read_nmea(write(tmp_path, f"at noon {gga()}"), clock="host")


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
    assert "heights ignored, as 1 fix had none" in " ".join(notes)


@pytest.mark.parametrize("order", [1, -1])
def test_of_one_moment_the_best_fix_counts(tmp_path: Path, order: int) -> None:
    qualities = ["1", "2", "5", "4", "9"][::order]
    fixes = [gga(fix=fix, alt=f"{fix}0.0") for fix in qualities]
    later = [gga("120001.00", fix="1"), gga("120002.00", fix="6"), gga("120003.00", fix="8")]
    table, notes = read_nmea(write(tmp_path, rmc(), *fixes, *later))
    assert table["alt_m"][0] == 40 + 20.5
    assert len(table) == 4
    assert notes[1] == (
        "drive.nmea: 4 fixes: 1 RTK fixed, 1 single, 1 dead reckoning, 1 simulated; "
        "where the quality changes, the path may step"
    )
    assert "skipped 4 fixes, as one of the same moment was as good or better" in notes[2]


def test_the_best_fix_counts_by_host_stamps_too(tmp_path: Path) -> None:
    lines = [f"{DAY_S}.10 {gga(fix='1')}", f"{DAY_S}.11 {gga()}", f"{DAY_S}.60 {gga('120000.50')}"]
    table, _ = read_nmea(write(tmp_path, *lines), clock="host")
    assert table["t_s"].tolist() == [DAY_S + 0.11, DAY_S + 0.6]


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        ([rmc("115958.00", "V", "060180")], [rmc()], "date 2026-01-01 from RMC"),
        ([rmc("115958.00", "V", "311225")], [rmc()], "date 2026-01-01 from RMC"),
        ([rmc("115958.00")], [rmc(date="190846")], "date 2026-01-01 from RMC"),  # the first counts
        ([sentence("GPZDA,115959.00,01,06,2013,00,00")], [rmc()], "date 2026-01-01 from RMC"),
        ([], [sentence("GPZDA,120000.00,01,01,2026,00,00")], "date 2026-01-01 from ZDA"),
        ([sentence("GPZDA,115959.00,01,01,2026,,")], [], "date 2026-01-01 from ZDA before the fix"),
        ([rmc("115958.00", "V", "010126")], [], "no date"),
    ],
)
def test_which_date_counts(tmp_path: Path, before: list[str], after: list[str], words: str) -> None:
    table, notes = read_nmea(write(tmp_path, *before, gga(), *after, gga("120001.00")))
    assert any(words in note for note in notes)
    dated = 0 if words == "no date" else DAY_S
    assert table["t_s"].tolist() == [dated + 43200, dated + 43201]


def test_rmc_alone_gives_positions_without_heights(tmp_path: Path) -> None:
    path = write(tmp_path, rmc(status="V"), rmc("120001.00"), rmc("120002.00", lat="36"))
    table, notes = read_nmea(path)
    assert set(table.columns) == {"t_s", "lat", "lon"}
    assert table["t_s"].tolist() == [DAY_S + 43201, DAY_S + 43202]
    assert table["lat"].tolist() == pytest.approx([37.555, 37.556])
    assert "no GGA or GNS sentences with a fix: positions from RMC" in notes[0]
    assert "drive.nmea: no heights" in notes


def test_gns_sentences(tmp_path: Path) -> None:
    place = "3733.31200,N,12702.71200,W"
    none = sentence(f"GNGNS,115959.00,{place},NN,00,9.9,,,,")
    gns = sentence(f"GNGNS,120000.00,{place},RA,12,0.7,48.5,20.5,,")
    table, notes = read_nmea(write(tmp_path, rmc(), none, gns))
    assert table["alt_m"].tolist() == [69.0]
    assert "drive.nmea: skipped 1 sentence without a fix" in notes
    assert "1 fix: 1 RTK fixed" in notes[-1]


def test_sentences_without_checksums_on_request(tmp_path: Path) -> None:
    path = write(tmp_path, gga()[:-3], gga("120001.00"), gga("120002.00")[:-1] + "?")
    assert len(read_nmea(path)[0]) == 1
    table, notes = read_nmea(path, checksums="optional")
    assert len(table) == 2
    assert "skipped 1 broken sentence, the first is in line 3" in notes[0]


def test_zero_zero_before_the_fix_is_no_place(tmp_path: Path) -> None:
    table, notes = read_nmea(write(tmp_path, at_zero(), at_zero(), rmc(), gga()))
    assert len(table) == 1
    assert notes[0] == "drive.nmea: skipped 2 sentences at latitude 0, longitude 0 (no fix)"


def test_sentences_among_binary_messages_and_glued_ones(tmp_path: Path) -> None:
    path = tmp_path / "drive.nmea"
    glued = gga("115959.00")[:30] + gga()
    path.write_bytes(
        f"{rmc()}\r\n{glued}\r\n".encode() + b"\xb5\x62$\x01" + gga("120001.00").encode()
    )
    table, _ = read_nmea(path)
    assert table["t_s"].tolist() == [DAY_S + 43200, DAY_S + 43201]


def test_heights_above_two_surfaces_are_none(tmp_path: Path) -> None:
    other = sentence("GNGGA,120001.00,3733.31200,N,12702.71200,W,4,12,0.7,48.5,M,,M,,")
    table, notes = read_nmea(write(tmp_path, gga(), other))
    assert "alt_m" not in table
    assert "drive.nmea: heights ignored, as only some fixes have a geoid separation" in notes


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("hello", "contains no GGA, GNS or RMC sentences"),
        (gga(fix="0"), "no fix in any of its 1 GGA and GNS sentences"),
        (gga()[:-1] + "?", "row 1: all sentences with a fix are broken"),
        (gga()[:-3], "row 1: its sentences have no checksums: checksums: optional"),
        (at_zero(), "all its 1 fixes are at latitude 0, longitude 0"),
    ],
)
def test_logs_without_a_trajectory(tmp_path: Path, line: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        read_nmea(write(tmp_path, line))


def hdt(heading: str, mode: str = "T", kind: str = "GPHDT") -> str:
    return sentence(f"{kind},{heading},{mode}")


def test_headings_belong_to_the_sentence_before_them(tmp_path: Path) -> None:
    """Also where another sentence of the same moment comes first."""
    path = write(
        tmp_path,
        hdt("10.0"),  # before any time
        gga("120000.00"),
        hdt("90.5"),
        hdt("95.0"),
        rmc("120001.00"),
        hdt("180", "A", "GNTHS"),
        gga("120001.00"),
        gga("120002.00"),
        hdt("", "T"),
        gga("120003.00"),
        hdt("270", "V", "GNTHS"),
        gga("120004.00"),
        hdt("0.25", kind="HEHDT"),
    )
    table, notes = read_nmea(path)
    np.testing.assert_array_equal(table["heading_deg"], [90.5, 180.0, np.nan, np.nan, 0.25])
    assert f"{path.name}: heading of 3 fixes from HDT and THS" in notes


def test_headings_of_positions_from_rmc_over_midnight(tmp_path: Path) -> None:
    lines = [rmc("235959.00"), hdt("1"), rmc("000000.00", date="020126"), hdt("2")]
    table, _ = read_nmea(write(tmp_path, *lines))
    assert table["heading_deg"].tolist() == [1.0, 2.0]


def test_a_log_without_headings_has_no_column(tmp_path: Path) -> None:
    table, notes = read_nmea(write(tmp_path, gga(), sentence("GPHDT,"), hdt("400"), hdt("nan")))
    assert "heading_deg" not in table
    assert not [note for note in notes if "heading" in note]
