from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings, strategies as st

from gaia_uwb._shared.errors import InputError
from gaia_uwb.logs._stamps import StampOptions
from gaia_uwb.logs.serial import DEVICES, read_serial

LEC = "DIST,2,AN0,022E,7.94,8.03,0.00,3.44,AN1,0C1D,-1.00,0.00,0.00,12.30,POS,6.95,5.37,-1.97,52"
MC = "mc 05 00000d70 00000000 0000300c 00000000 6cc0 0a 00a0642b a0:0"
RANGE = "AT+RANGE=tid:4,mask:05,seq:218,range:(344,0,1230,0),rssi:(-70.10,0.00,-82.50,0.00)"
SESSION = (
    "SESSION_INFO_NTF: {session_handle=1, sequence_number=5, block_index=5, n_measurements=2"
    ' [mac_address=0x0001, status="SUCCESS", distance[cm]=344, RSSI[dBm]=-70.0];'
    ' [mac_address=0x0003, status="SUCCESS", distance[cm]=1230]}'
)
LINES = {"dwm1001": LEC, "trek1000": MC, "mauwb": RANGE, "dwm3001": SESSION}
NEW_YEAR_S = 1767225600.0  # 2026-01-01 00:00 UTC


def write(folder: Path, *lines: str) -> Path:
    path = folder / "tag.log"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


@pytest.mark.parametrize("name", DEVICES)
def test_each_device_is_read_and_found_by_its_lines(tmp_path: Path, name: str) -> None:
    path = write(tmp_path, "1.5 hello", f"2.5 {LINES[name]}", f"3.5 {LINES[name]}")
    for given_name in (name, None):
        table, notes = read_serial(path, given_name)
        assert table["t_s"].tolist() == [2.5, 2.5, 3.5, 3.5]
        assert table["range_m"].tolist() == pytest.approx([3.44, 12.3] * 2)
        assert len(table.labels["anchor_id"]) == 2
        assert len(notes) == 1
        assert notes[0].startswith(f"tag.log: {name}, anchor: ")


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "utf-16-le"])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r\r\n"])
def test_text_as_windows_writes_it(tmp_path: Path, encoding: str, end: str) -> None:
    path = tmp_path / "tag.log"
    mark = "\ufeff" if encoding == "utf-16-le" else ""
    text = mark + "".join(f"[2026-01-01 00:00:0{k}] {LEC}{end}" for k in range(3))
    path.write_bytes(text.encode(encoding))
    table, notes = read_serial(path)
    assert table["t_s"].tolist()[::2] == [NEW_YEAR_S + k for k in range(3)]
    assert len(notes) == 1
    path.write_bytes(path.read_bytes()[:-101])  # cut within a line, and within a character
    assert len(read_serial(path)[0]) == 4


@pytest.mark.parametrize("name", DEVICES)
def test_the_wrong_format_is_told_which_is_right(tmp_path: Path, name: str) -> None:
    path = write(tmp_path, f"2.5 {LINES[name]}")
    for other in set(DEVICES) - {name}:
        with pytest.raises(InputError, match=f"set format: {name}$"):
            read_serial(path, other)


@pytest.mark.parametrize("name", DEVICES)
def test_broken_lines_are_counted_and_give_nothing(tmp_path: Path, name: str) -> None:
    line = LINES[name]
    lines = [line, line[: len(line) * 3 // 5], line.replace("12", "1x").replace("30", "3x"), line]
    table, notes = read_serial(write(tmp_path, *(f"{k} {each}" for k, each in enumerate(lines))))
    assert table["t_s"].tolist() == [0, 0, 3, 3]
    assert notes[1:] == ["tag.log: skipped 2 broken lines, the first is line 2"]
    assert table.number.tolist() == [1, 1, 4, 4]


def test_lines_of_two_devices_are_not_mixed(tmp_path: Path) -> None:
    path = write(tmp_path, f"1.0 {MC}", f"2.0 {LEC}")
    with pytest.raises(InputError, match="has lines of dwm1001 and trek1000: name one as format"):
        read_serial(path)
    assert len(read_serial(path, "trek1000")[0]) == 2


@pytest.mark.parametrize(
    ("stamp", "options", "t_s"),
    [
        ("1767225600.25 ", {}, 0.25),
        ("1767225600250,", {"unit": "ms"}, 0.25),
        ("[2026-01-01 00:00:00.250] ", {}, 0.25),
        ("[2026-01-01 00:00:01] ", {}, 1),
        ("2026-01-01T00:00:00,250Z -> ", {}, 0.25),
        ("2026-01-01T09:00:00.250+09:00; ", {}, 0.25),
        ("2026-01-01 09:00:00.250: ", {"utc_offset_h": 9.0}, 0.25),
        ("2026/01/01 00:00:00.250 ", {}, 0.25),
        ("01.02.2026 00:00:00 ", {}, 31 * 86400),
        ("1/2/2026 12:00:00.5 AM -> ", {"date_order": "dmy"}, 31 * 86400 + 0.5),
        ("12:00:00.500 AM -> ", {"date": "2026-01-01"}, 0.5),
        ("1:00:00 pm ", {"date": "2026-01-01"}, 13 * 3600),
        ("[Thu Jan 01 00:00:01.500 2026] ", {}, 1.5),
        ("Thu Jan  1 00:00:01 2026: ", {}, 1),
        ("Jan 01 00:00:01 ", {"date": "2026-01-01"}, 1),
        ("Jan 01 00:00:01.50 ", {"date": "2026-01-01"}, 1.5),
        ("Jan 01 09:00:01 ", {"date": "2026-01-01", "utc_offset_h": 9.0}, 1),
        ("00:00:00.250 -> ", {"date": "2026-01-01"}, 0.25),
        ("00:00:00.250 > ", {"date": "2026-01-01"}, 0.25),
        ("[09:00:00.250]", {"date": "2026-01-01", "utc_offset_h": 9.0}, 0.25),
        ("00:00:00.250 ", {}, 0.25 - NEW_YEAR_S),
    ],
)
def test_stamps_of_all_kinds(
    tmp_path: Path, stamp: str, options: dict[str, Any], t_s: float
) -> None:
    stamps = StampOptions.model_validate(options, strict=False)
    table, notes = read_serial(write(tmp_path, stamp + LEC), "dwm1001", stamps)
    assert table["t_s"].tolist() == pytest.approx([NEW_YEAR_S + t_s] * 2, abs=1e-6)
    assert len(notes) == 1


def test_days_and_years_go_on_and_come_from_elsewhere(tmp_path: Path) -> None:
    times = (23 * 3600, 24 * 3600)
    path = write(tmp_path, f"23:00:00 -> {MC}", f"00:00:00 -> {MC}")
    table, notes = read_serial(path, near_s=NEW_YEAR_S + 25 * 3600)
    assert table["t_s"].tolist()[::2] == [NEW_YEAR_S + t for t in times]
    assert notes[1] == "tag.log: first day 2026-01-01, from the trajectory"
    assert read_serial(path)[0]["t_s"].tolist()[::2] == list(times)
    path = write(tmp_path, f"Dec 31 23:59:59 {MC}", f"Jan 01 00:00:01 {MC}")
    for how in ({"near_s": NEW_YEAR_S}, {"near_s": NEW_YEAR_S - 9e6}):
        table, notes = read_serial(path, **how)
        assert table["t_s"].tolist()[::2] == [NEW_YEAR_S - 1, NEW_YEAR_S + 1]
        assert notes[1] == "tag.log: first day 2025-12-31, from the trajectory"
    with pytest.raises(InputError, match=r"stamps have no year: set stamps: \{date"):
        read_serial(path)


def test_a_leap_day_without_a_year(tmp_path: Path) -> None:
    table, _ = read_serial(write(tmp_path, f"Feb 29 00:00:00 {MC}"), near_s=1709164800.0 + 40)
    assert table["t_s"][0] == 1709164800.0


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("hello", "has no lines of a device that is read"),
        (LEC, "its lines have no host time"),
        (
            "03/03/2026 09:00:00 " + LEC,
            r"row 1: the stamps .* not read: '03/.*{date_order: dmy} or",
        ),
        ("at 9 " + LEC, r"row 1: the stamps .* not read: 'at 9 ' \(docs/inputs\.md lists"),
        ("13:00:00 pm " + LEC, "form that is not read"),
        ("Foo 03 09:00:00 " + MC, r"form that is not read: 'Foo 03 09:00:00 '"),
        ("31.02.2026 09:00:00 " + MC, "form that is not read"),
    ],
)
def test_logs_without_ranges(tmp_path: Path, line: str, message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        read_serial(write(tmp_path, line))
    assert "\n" not in str(caught.value)
    with pytest.raises(InputError, match="row 1: all lines with ranges are broken"):
        read_serial(write(tmp_path, "1.0 " + LEC[:30]), "dwm1001")


def test_lines_that_give_nothing_are_counted(tmp_path: Path) -> None:
    path = write(tmp_path, f"1 {MC}", MC, f"then {MC}", f"\x1b[32m2 {MC}\x1b[0m")
    table, notes = read_serial(path)
    assert table["t_s"].tolist() == [1, 1, 2, 2]
    assert notes[1:] == [
        "tag.log: skipped 1 broken line, the first is line 3; 1 after no stamp but 'then '",
        "tag.log: skipped 1 line without a stamp",
    ]


@pytest.mark.parametrize(("line", "word"), [(MC, "tag_id"), (RANGE, "tid")])
def test_of_several_tags_one_is_chosen(tmp_path: Path, line: str, word: str) -> None:
    other = line.replace("a0:", "a9:").replace("tid:4", "tid:9")
    path = write(tmp_path, f"1 {line}", f"2 {other}", f"3 {other}")
    message = rf"several tags, {word} .* \(2 readings\), 9 \(4 readings\): .*where: {{{word}: 9}}"
    with pytest.raises(InputError, match=message):
        read_serial(path)
    table, notes = read_serial(path, where={word: 9})
    assert table["t_s"].tolist() == [2, 2, 3, 3]
    assert notes[1:] == ["tag.log: skipped 2 readings of other tags"]
    assert len(read_serial(path, where={word: ["9", 0, 4]})[0]) == 6
    with pytest.raises(InputError, match="none of its 6 readings is of the tag that where names"):
        read_serial(path, where={word: 7})
    with pytest.raises(InputError, match=r"where: a .* log is chosen by"):
        read_serial(path, where={"mac": 7})


def test_numbers_that_are_missing(tmp_path: Path) -> None:
    path = write(tmp_path, f"1 {RANGE}", f"2 {RANGE}")
    table, notes = read_serial(path, missing=[344.0])
    assert table["range_m"].tolist() == [12.3, 12.3]
    assert notes[1:] == ["tag.log: skipped 2 readings that are missing"]
    with pytest.raises(InputError, match="all of its 4 readings are missing"):
        read_serial(path, missing=[344.0, 1230.0])


@settings(max_examples=300, deadline=None)
@given(st.data())
def test_any_damage_is_read_or_refused(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    name = data.draw(st.sampled_from([*DEVICES, None]))
    text = "".join(f"{k}.5 {data.draw(st.sampled_from(list(LINES.values())))}\n" for k in range(3))
    noise = data.draw(st.binary(max_size=8))
    a, b = sorted(data.draw(st.lists(st.integers(0, len(text)), min_size=2, max_size=2)))
    path = tmp_path_factory.mktemp("damaged") / "tag.log"
    path.write_bytes(text[:a].encode() + noise + text[b:].encode())
    try:
        table, notes = read_serial(path, name)
    except InputError as error:
        assert str(error).isprintable()
    else:
        assert len(table)
        assert all(note.isprintable() for note in notes)
