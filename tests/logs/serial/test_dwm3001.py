from __future__ import annotations

from pathlib import Path

import pytest

from gaia_uwb.logs.serial import read_serial
from gaia_uwb.logs.serial.dwm3001 import Dwm3001

HEAD = "SESSION_INFO_NTF: {session_handle=1, sequence_number=5, block_index=5, n_measurements=3"
NEAR = '[mac_address=0x0001, status="SUCCESS", distance[cm]=344, loc_az=24.90, RSSI[dBm]=-70.5]'
FAR = '[mac_address=0x0003, status="SUCCESS", distance[cm]=1230]'
LOST = '[mac_address=0x0004, status="RX_TIMEOUT"]'
JSON = (
    '{"Block":7, "results":[{"Addr":"0x0001","Status":"Ok","D_cm":344,"LFoM":85},'
    '{"Addr":"0x0004","Status":"Err"},{"Addr":"0x0003","Status":"Ok","D_cm":1230}]}'
)


def read(content: str) -> list[tuple[str, float]] | None:
    readings = Dwm3001().read(content)
    return None if readings is None else [(each.anchor_id, each.value) for each in readings]


@pytest.mark.parametrize(
    "line", [f"{HEAD} {NEAR}; {FAR}; {LOST}}}", f"{HEAD} {NEAR}{FAR}{LOST}}}", JSON]
)
def test_one_line_for_all_anchors(line: str) -> None:
    assert read(line) == [("0x0001", 344.0), ("0x0003", 1230.0)]


@pytest.mark.parametrize(
    "line",
    [
        f"{HEAD} {NEAR}; {FAR}}}",  # the third measurement is lost
        NEAR.replace("344", "3x4"),
        NEAR[:-1],
        NEAR.replace("distance[cm]=344, ", ""),
        JSON[:-2],
        JSON.replace("344", '"far"'),
        JSON.replace("344", "1e999"),
        '{"Block":7, "results":5}',
        '{"Block":' * 9000,
    ],
)
def test_what_is_not_whole_gives_nothing(line: str) -> None:
    assert read(line) is None


@pytest.mark.parametrize("stamps", [("1.5 ", "1.5 ", "1.5 ", "1.5 "), ("1.5 ", " ", "", "  ")])
def test_a_session_on_several_lines(tmp_path: Path, stamps: tuple[str, ...]) -> None:
    parts = (HEAD, f" {NEAR};", f" {FAR};", f" {LOST}}}")
    path = tmp_path / "tag.log"
    path.write_text("".join(f"{a}{b}\n" for a, b in zip(stamps, parts, strict=True)), "utf-8")
    table, notes = read_serial(path)
    assert table["t_s"].tolist() == [1.5, 1.5]
    assert table["range_m"].tolist() == pytest.approx([3.44, 12.3])
    assert table["rssi_dbm"][0] == -70.5
    assert len(notes) == 1
