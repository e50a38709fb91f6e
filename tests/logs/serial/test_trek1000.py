from __future__ import annotations

from pathlib import Path

import pytest

from gaia_uwb._shared.errors import InputError
from gaia_uwb.logs.serial import read_serial
from gaia_uwb.logs.serial.trek1000 import Trek1000

MC = "mc 0b 000003e8 000007d0 00000bb8 00000fa0 6cc0 0a 00a0642b a0:0"
MR = MC.replace("mc", "mr").replace("3e8", "3f2")


def write(folder: Path, *lines: str) -> Path:
    path = folder / "tag.log"
    path.write_text("\n".join(f"{k}.5 {line}" for k, line in enumerate(lines)), encoding="utf-8")
    return path


def ranges(content: str) -> list[tuple[str, float]] | None:
    readings = Trek1000().read(content)
    return None if readings is None else [(each.anchor_id, each.value) for each in readings]


def test_the_mask_says_which_anchors_answered() -> None:
    assert ranges(MC) == [("0", 1000.0), ("1", 2000.0), ("3", 4000.0)]
    assert ranges(MC.replace("mc 0b", "mc 00")) == []
    assert ranges(MC.replace("mc 0b", "mc 1b")) is None  # a fifth anchor without a range
    assert ranges(MC.replace("000003e8", "ffffffff")) == [("1", 2000.0), ("3", 4000.0)]


def test_boards_with_more_ranges_and_a_checksum() -> None:
    more = MC.replace("00000fa0", "00000fa0 00001388 ffffffff ffffffff") + " 22be"
    assert ranges(more.replace("mc 0b", "mc 18")) == [("3", 4000.0), ("4", 5000.0)]
    assert ranges(MC.upper()) == ranges(MC.replace(" ", "  ")) == ranges(MC)
    assert ranges(MC.replace("00a0642b", "0").replace("a0:", "t0:")) == ranges(MC)


@pytest.mark.parametrize("k", range(0, len(MC), 3))
def test_a_character_that_is_lost_breaks_the_line(k: int) -> None:
    assert ranges(MC[:k] + MC[k + 1 :]) in (None, ranges(MC))


def test_corrected_ranges_come_before_raw_ones(tmp_path: Path) -> None:
    table, notes = read_serial(write(tmp_path, MR, MC, MR, MC))
    assert set(table["range_m"]) == {1.0, 2.0, 4.0}
    assert set(table["t_s"]) == {1.5, 3.5}
    assert "as measured" not in notes[0]
    table, notes = read_serial(write(tmp_path, MR, MR))
    assert table["range_m"][0] == 1.01
    assert notes[0].endswith("as measured (there are no corrected ones)")


def test_ranges_between_anchors_are_not_read(tmp_path: Path) -> None:
    path = write(tmp_path, MC.replace("mc", "ma"))
    with pytest.raises(InputError, match="contains no 'mc' or 'mr' lines"):
        read_serial(path, "trek1000")
