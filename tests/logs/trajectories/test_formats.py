"""Every format gives the same drive; what only some formats can say is tested below."""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import good_trajectories as good
from gaia_uwb._shared.errors import GaiaError, InputError
from gaia_uwb.logs._logs import LogTable
from gaia_uwb.logs.described import read_described
from gaia_uwb.logs.trajectories.fixes import QUALITIES
from gaia_uwb.logs.trajectories.gpx import read_gpx
from gaia_uwb.logs.trajectories.guess import guess_format
from gaia_uwb.logs.trajectories.poses import read_euroc, read_kitti, read_tum
from gaia_uwb.logs.trajectories.rtklib import read_rtklib
from gaia_uwb.logs.trajectories.ubx import read_ubx
from gaia_uwb.projection import to_local

DRIVE = np.array(list(good.drive()))
EARTH = np.array(list(good.on_earth()))


def write(folder: Path, content: str | bytes, name: str = "drive.log") -> Path:
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


@pytest.mark.parametrize("kind", good.TRAJECTORIES)
def test_every_format_gives_the_drive(tmp_path: Path, kind: str) -> None:
    scene = read_described(good.TRAJECTORIES[kind](tmp_path))
    notes = scene.notes
    path, position_m, up_m = scene.trajectory, DRIVE[:, 1:3], DRIVE[:, 3]
    if scene.frame is not None:
        position_m, up_m = to_local(scene.frame, *EARTH[:, 1:].T)
    np.testing.assert_allclose(path.t_s, good.START_S + DRIVE[:, 0], atol=1e-6)
    np.testing.assert_allclose(path.position_m, position_m, atol=0.02)
    assert path.up_m is not None
    np.testing.assert_allclose(path.up_m, up_m, atol=0.01)
    assert (kind == "guessed") == any("read as gpx" in note for note in notes)


@pytest.mark.parametrize(
    ("kind", "content"),
    [
        ("gpx", good.gpx()),
        ("ubx", good.ubx()),
        ("rtklib", good.rtklib()),
        ("euroc", good.euroc()),
        ("tum", good.tum()),
        ("tum", "".join(good.tum().splitlines(keepends=True)[2:])),
        ("nmea", "junk\r\n12.5 $GNGGA,120000.00,3733.312,N,12702.712,W,4,12,0.7,48,M,20,M,,\r\n"),
        ("csv", "t_s,lat,lon\n0,1,2\n"),
        ("ros", b"\x89MCAP0\r\n"),
    ],
)
def test_what_a_file_tells_of_its_format(tmp_path: Path, kind: str, content: str | bytes) -> None:
    assert guess_format(write(tmp_path, content)) == kind


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (good.kitti(), "add format: kitti, and the file of its times"),
        ("t,x,y\n0,1,2\n", "add format: tum, euroc"),
        ("0 1 2 3 0.5 0 0 0.1\n", "add format: tum, euroc"),  # no rotation
        (b"\0" * 1000, "add format: tum, euroc"),
    ],
)
def test_what_it_does_not_tell(tmp_path: Path, content: str | bytes, words: str) -> None:
    with pytest.raises(InputError, match=words):
        guess_format(write(tmp_path, content))


@pytest.mark.parametrize("kind", ["rtklib", "gpx", "ubx", "tum"])
def test_a_file_that_is_mapped_as_a_table_and_is_none(tmp_path: Path, kind: str) -> None:
    folder = good.TRAJECTORIES[kind](tmp_path)
    description = yaml.safe_load((folder / "gaia.yaml").read_text(encoding="utf-8"))
    columns = {"t_s": {"column": "GPST", "iso": True}, "lat": "latitude(deg)", "lon": "lon"}
    description["trajectory"] |= {"format": "csv", "columns": columns}
    (folder / "gaia.yaml").write_text(yaml.safe_dump(description), encoding="utf-8")
    with pytest.raises(InputError, match=f"this is {kind}: format: {kind} reads it"):
        read_described(folder)


# RTKLIB ------------------------------------------------------------------------------------------

HEAD = "%  {clock}  {places}  Q  ns\n"
LLH = "latitude(deg) longitude(deg) height(m)"


def rtklib(clock: str = "GPST", places: str = LLH, *rows: str) -> str:
    return "% program : us\n" + HEAD.format(clock=clock, places=places) + "\n".join(rows) + "\n"


@pytest.mark.parametrize(
    ("clock", "row", "ours", "seconds"),
    [
        ("GPST", "2026/03/03 09:00:18.250 48 11 520 1 9", "utc", 0.25),
        ("GPST", "2408 205218.250 48 11 520 1 9", "utc", 0.25),
        ("UTC", "2026/03/03 09:00:00.250 48 11 520 1 9", "utc", 0.25),
        ("UTC", "2408 205200.250 48 11 520 1 9", "utc", 0.25),
        ("JST", "2026/03/03 18:00:00.250 48 11 520 1 9", "utc", 0.25),
        ("GPST", "2026/03/03 09:00:18.250 48 11 520 1 9", "gps", 18.25),
        ("UTC", "2026/03/03 09:00:00.250 48 11 520 1 9", "gps", 18.25),
        ("GPST", "2026/03/03 09:00:18.250,48,11,520,1,9", "utc", 0.25),
        ("GPST", "2408,205218.250,48,11,520,1,9", "utc", 0.25),
    ],
)
def test_clocks_of_rtklib(tmp_path: Path, clock: str, row: str, ours: Any, seconds: float) -> None:
    table, notes = read_rtklib(write(tmp_path, rtklib(clock, LLH, row)), ours)
    assert table["t_s"].tolist() == pytest.approx([good.START_S + seconds], abs=1e-6)
    moved = (clock == "GPST") is (ours == "utc")
    assert moved == any("18 leap seconds" in note for note in notes)


@pytest.mark.parametrize(
    ("places", "cells", "expected"),
    [
        (LLH, "-48.5 11.25 520", {"lat": -48.5, "lon": 11.25, "alt_m": 520.0}),
        (
            "latitude(d'\") longitude(d'\") height(m)",
            "-00 30 36.0 11 15 00.0 520",
            {"lat": -0.51, "lon": 11.25, "alt_m": 520.0},
        ),
        (
            "x-ecef(m) y-ecef(m) z-ecef(m)",
            "6378637.0 0 0",
            {"lat": 0.0, "lon": 0.0, "alt_m": 500.0},
        ),
        (
            "e-baseline(m) n-baseline(m) u-baseline(m)",
            "-3.5 12.25 0.5",
            {"east_m": -3.5, "north_m": 12.25, "up_m": 0.5},
        ),
    ],
)
def test_places_of_rtklib(
    tmp_path: Path, places: str, cells: str, expected: dict[str, float]
) -> None:
    row = f"2026/03/03 09:00:18.0 {cells} 1 9"
    table, _ = read_rtklib(write(tmp_path, rtklib("GPST", places, row)))
    found = {name: float(table[name][0]) for name in expected}
    assert found == pytest.approx(expected, abs=1e-6)
    assert set(table.columns) == {"t_s", *expected}


def test_quality_of_rtklib(tmp_path: Path) -> None:
    rows = [f"2026/03/03 09:00:{s:02d} 48 11 {520 + q} {q} 9" for s, q in ((1, 5), (1, 2), (2, 1))]
    table, notes = read_rtklib(write(tmp_path, rtklib("UTC", LLH, *rows)))
    assert table["alt_m"].tolist() == [522, 521]
    assert notes[0].startswith("drive.log: 2 fixes: 1 RTK fixed, 1 RTK float; where the quality")
    geodetic = "% (lat/lon/height=WGS84/geodetic,Q=1:fix)\n" + rtklib("UTC", LLH, *rows)
    _, notes = read_rtklib(write(tmp_path, geodetic))
    assert notes[0] == "drive.log: heights are above the geoid"


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("2026/03/03 09:00:18 48 11 520 1 9\n", "has no line like '%  GPST  latitude"),
        (rtklib(), "has no rows"),
        (
            rtklib("UTC", LLH, "2026/03/33 09:00:18 48 11 520 1 9"),
            "row 3, column date: expected an ISO",
        ),
        (rtklib("UTC", LLH, "2026/03/03 09:00:18 48 x 520 1 9"), "row 3, column lon: expected a f"),
    ],
)
def test_what_is_no_solution(tmp_path: Path, content: str, message: str) -> None:
    with pytest.raises(InputError, match=message.replace("(", r"\(")):
        read_rtklib(write(tmp_path, content))


# Poses -------------------------------------------------------------------------------------------


def test_tum_with_commas_and_comments_amid(tmp_path: Path) -> None:
    text = "1.5,1,2,3,0,0,0,1\n# lost\n2.5,4,5,6,0,0,0,1\n"
    table, _ = read_tum(write(tmp_path, text))
    assert (table["t_s"].tolist(), table["up_m"].tolist()) == ([1.5, 2.5], [3, 6])
    with pytest.raises(InputError, match="row 2, column ty: expected a finite number"):
        read_tum(write(tmp_path, "1.5 1 2 3 0 0 0 1\n2.5 4\n"))


def test_data_of_an_imu_are_no_euroc_trajectory(tmp_path: Path) -> None:
    path = write(tmp_path, "#timestamp [ns],w_RS_S_x [rad s^-1],a_RS_S_x [m s^-2]\n1,2,3\n")
    with pytest.raises(InputError, match=r"expected columns like 'p_RS_R_x \[m\]', found 'timest"):
        read_euroc(path)


def test_kitti_needs_a_time_for_each_pose(tmp_path: Path) -> None:
    poses, times = write(tmp_path, good.kitti()), write(tmp_path, "1\n2\n", "times.txt")
    with pytest.raises(InputError, match=r"times\.txt: has 2 times for the 40 poses of drive\.log"):
        read_kitti(poses, times)
    upright = write(tmp_path, "1 0 0 1 0 1 0 2 0 0 1 3\n" * 2, "up.txt")
    table, _ = read_kitti(upright, times, "east-north-up")
    assert [table[name][0] for name in ("east_m", "north_m", "up_m")] == [1, 2, 3]
    table, notes = read_kitti(upright, times)
    assert [table[name][0] for name in ("east_m", "north_m", "up_m")] == [1, 3, -2]
    assert "a camera's axes" in notes[0]


# GPX ---------------------------------------------------------------------------------------------


def test_a_track_that_is_cut_off_is_read_up_to_there(tmp_path: Path) -> None:
    text = good.gpx()
    table, notes = read_gpx(write(tmp_path, text[: text.index("09:00:30")]))
    assert len(table) == 30
    assert notes == ["drive.log: is cut off in line 35: read up to there"]


def test_what_extensions_say_is_not_taken(tmp_path: Path) -> None:
    more = "<extensions><ele>9</ele><x:time xmlns:x='x'>1</x:time></extensions></trkpt>"
    table, notes = read_gpx(write(tmp_path, good.gpx().replace("</trkpt>", more)))
    assert table["alt_m"].tolist() == pytest.approx(EARTH[:, 3], abs=0.01)
    assert notes == []


def test_points_without_time_or_place_are_counted(tmp_path: Path) -> None:
    lines = good.gpx().splitlines(keepends=True)
    lines[4] = lines[4].replace("<time>", "<!--").replace("</time>", "-->")
    lines[5] = lines[5].replace('lat="', 'lat="x')
    lines[6] = lines[6].replace("<ele>", "<eye>").replace("</ele>", "</eye>")
    table, notes = read_gpx(write(tmp_path, "".join(lines)))
    assert len(table) == 38
    assert "alt_m" not in table
    assert notes == [
        "drive.log: skipped 1 track point with a wrong time or place",
        "drive.log: skipped 1 track point without time",
        "drive.log: heights ignored, as 1 track point had none",
    ]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("time>", "when>"), "row 4: its track points have no <time>: a drive needs"),
        (('lat="', 'lat="_'), "row 4: all its track points are broken"),
        (("trkpt", "rtept"), "contains no track points"),
        (("gpx", "kml"), "row 1: is no GPX: it starts with <kml>"),
        (("<gpx", '<!DOCTYPE gpx [<!ENTITY a "b">]><gpx'), "row 2: declares a document type"),
        (("</name>", "</other>"), "row 3: is no XML that can be read: mismatched tag"),
        (('"UTF-8"', '"EBCDIC-9"'), "is no XML that can be read: unknown encoding"),
        (("<name>", "<a>" * 200), "is nested too deeply"),
    ],
)
def test_what_is_no_track(tmp_path: Path, change: tuple[str, str], message: str) -> None:
    with pytest.raises(InputError, match=message):
        read_gpx(write(tmp_path, good.gpx().replace(*change)))


# UBX ---------------------------------------------------------------------------------------------


def ubx_quality(notes: list[str]) -> str:
    return next(note for note in notes if " fixes: " in note or " fix: " in note)


def test_only_messages_with_a_fix_and_a_date_count(tmp_path: Path) -> None:
    place = (48.0, 11.0, 520.0)
    messages = [
        good.nav_pvt(0, *place, kind=2),
        good.nav_pvt(1, *place, flags=2),
        good.nav_pvt(2, *place, kind=5),
        good.nav_pvt(3, *place, valid=1),
        good.nav_pvt(4, *place, valid=2),
        good.nav_pvt(5.25, *place),
        good.nav_pvt(6, *place, carrier=1),
        good.nav_pvt(7, *place, carrier=0),
        good.nav_pvt(8, *place, carrier=0, flags=1, kind=4),
    ]
    table, notes = read_ubx(write(tmp_path, b"".join(messages)))
    assert (table["t_s"] - good.START_S).tolist() == pytest.approx([5.25, 6, 7, 8])
    assert "1 RTK fixed, 1 RTK float, 1 differential, 1 single" in ubx_quality(notes)
    assert "drive.log: skipped 3 messages without a fix in three dimensions" in notes
    assert "drive.log: skipped 2 messages without a date" in notes


def test_a_false_header_and_a_wrong_checksum_cost_one_message(tmp_path: Path) -> None:
    messages = [good.nav_pvt(t, 48, 11, 520) for t in range(9)]
    messages[4] = messages[4][:-1] + bytes([messages[4][-1] ^ 1])
    data = b"".join([*messages[:2], b"\xb5\x62\x01\x07\xff\xff", *messages[2:]])
    table, _ = read_ubx(write(tmp_path, data[:-5]))
    assert (table["t_s"] - good.START_S).tolist() == [0, 1, 2, 3, 5, 6, 7]


def test_messages_across_the_pieces_in_which_a_file_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write(tmp_path, good.ubx())
    whole, _ = read_ubx(path)
    for size in (1, 7, 100, 1001):
        monkeypatch.setattr("gaia_uwb.logs.trajectories.ubx._CHUNK_BYTES", size)
        table, _ = read_ubx(path)
        assert table["lat"].tolist() == whole["lat"].tolist()


def test_high_precision_refines_the_place(tmp_path: Path) -> None:
    pvt = good.nav_pvt(0, 48.1370001, 11.5750001, 520.123)
    (itow,) = struct.unpack_from("<I", pvt, 6)
    fine = struct.pack("<BxxBIiiii", 0, 0, itow, 115750001, 481370001, 520123, 0)
    fine = good.ubx_frame(0x14, fine + struct.pack("<bbbb", -45, 49, 4, 0) + bytes(8))
    bad = good.ubx_frame(0x14, struct.pack("<BxxBI", 0, 1, itow + 1000) + bytes(28))
    later = good.nav_pvt(1, 48.1370001, 11.5750001, 520.123)
    table, notes = read_ubx(write(tmp_path, pvt + fine + later + bad))
    assert table["lat"].tolist() == pytest.approx([48.137000149, 48.1370001], abs=1e-12)
    assert table["lon"].tolist() == pytest.approx([11.575000055, 11.5750001], abs=1e-12)
    assert table["alt_m"].tolist() == pytest.approx([520.1234, 520.123], abs=1e-9)
    assert "drive.log: 1 fix of high precision (NAV-HPPOSLLH)" in notes


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"$GNGGA,\r\n" * 20, "contains no whole NAV-PVT messages"),
        (good.nav_pvt(0, 1, 2, 3, kind=0), "no fix in three dimensions in any of its 1 NAV-PVT"),
        (good.nav_pvt(0, 1, 2, 3, valid=0), "have no valid date and time"),
    ],
)
def test_what_is_no_ubx(tmp_path: Path, content: bytes, message: str) -> None:
    with pytest.raises(InputError, match=message):
        read_ubx(write(tmp_path, content))


def test_the_worst_rank_is_named() -> None:
    assert QUALITIES[-1] == "of unknown quality"


@pytest.mark.parametrize("read", [read_tum, read_euroc, read_rtklib, read_gpx, read_ubx])
def test_what_is_no_file(
    tmp_path: Path, read: Callable[[Path], tuple[LogTable, list[str]]]
) -> None:
    for path in (tmp_path, tmp_path / "none", write(tmp_path, "")):
        with pytest.raises(GaiaError):
            read(path)
