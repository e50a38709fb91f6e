"""Damaged logs: one clear line or a scene, never another exception; GAIA_FUZZ sets how many."""

from __future__ import annotations

import os
import resource
import shutil
import struct
import time
import zlib
from collections.abc import Callable
from pathlib import Path

import lz4.frame
import numpy as np
import pytest
import yaml
from bags import FORMATS, write_drive

from gaia_uwb.datasets._bag_files import unpack
from gaia_uwb.datasets.described import read_described
from gaia_uwb.datasets.ros import RosLog
from gaia_uwb.errors import GaiaError
from gaia_uwb.sources import check_source

N = int(os.environ.get("GAIA_FUZZ", "50"))
LIMIT_S = 5.0
LIMIT_GIB = 1.0

LEC = "{t:.2f} DIST,2,AN0,022E,7.94,8.03,0.00,{a:.2f},AN1,0C1D,1.00,0.00,0.00,{b:.2f}\n"


def gga(t: int) -> str:
    body = f"GNGGA,1200{t:02d}.00,3733.3{t:02d},N,12702.7,E,4,12,0.7,48.5,M,20.5,M,,"
    checksum = 0
    for character in body:
        checksum ^= ord(character)
    return f"${body}*{checksum:02X}\n"


def write_serial(folder: Path) -> Path:
    """Write a DWM1001 log, an NMEA log and their description."""
    nmea = "".join(gga(t) for t in range(40))
    lines = "".join(LEC.format(t=43200 + t / 2, a=5 + t, b=9 + t) for t in range(80))
    description = {
        "trajectory": {"file": "drive.nmea", "format": "nmea"},
        "ranges": [{"file": "tag.log", "format": "dwm1001"}],
    }
    (folder / "drive.nmea").write_text(nmea, encoding="utf-8")
    (folder / "tag.log").write_text(lines, encoding="utf-8")
    (folder / "gaia.yaml").write_text(yaml.safe_dump(description), encoding="utf-8")
    return folder


def write_tables(folder: Path) -> Path:
    """Write mapped CSV tables and their description."""
    drive = "".join(f"{t},{t * 3},{t * t / 9}\n" for t in range(40))
    ranges = "".join(f"{t / 2},c{t % 3},{5000 + t},\n" for t in range(80))
    millimetres = {"column": "mm", "scale": 0.001}
    description = {
        "trajectory": {
            "file": "drive.csv",
            "format": "csv",
            "columns": {"t_s": "t", "east_m": "x", "north_m": "y"},
        },
        "ranges": [
            {
                "file": "uwb.csv",
                "format": "csv",
                "columns": {"t_s": "t", "anchor_id": "id", "range_m": millimetres, "rssi_dbm": "p"},
            }
        ],
        "lever_arm": {"forward_m": 1.0},
    }
    (folder / "drive.csv").write_text("t,x,y\n" + drive, encoding="utf-8")
    (folder / "uwb.csv").write_text("t,id,mm,p\n" + ranges, encoding="utf-8")
    (folder / "gaia.yaml").write_text(yaml.safe_dump(description), encoding="utf-8")
    return folder


WRITERS: dict[str, Callable[[Path], Path]] = {
    **{kind: (lambda folder, kind=kind: write_drive(folder, kind)) for kind in FORMATS},
    "serial": write_serial,
    "tables": write_tables,
}


def damage(data: bytes, rng: np.random.Generator) -> bytes:
    """Cut, flip bits, put huge counts, repeat or remove a part, or put other bytes."""
    content = bytearray(data)
    at = int(rng.integers(len(content)))
    match int(rng.integers(7)):
        case 0:
            del content[at:]
        case 1:
            for place in rng.integers(len(content), size=int(rng.integers(1, 20))):
                content[place] ^= 1 << int(rng.integers(8))
        case 2:
            content[at : at + 4] = struct.pack("<I", int(rng.choice([2**32 - 1, 2**31, 2**28])))
        case 3:
            content[at : at + 8] = struct.pack("<Q", int(rng.choice([2**63 - 1, 2**40, 2**33])))
        case 4:
            del content[at : at + int(rng.integers(1, 200))]
        case 5:
            content[at:at] = content[at : at + int(rng.integers(1, 2000))]
        case _:
            size = int(rng.integers(1, 64))
            content[at : at + size] = rng.integers(256, size=size, dtype=np.uint8).tobytes()
    return bytes(content)


def damage_a_file(log: Path, rng: np.random.Generator) -> None:
    files = sorted(path for path in [log, *log.glob("*")] if path.is_file())
    path = files[int(rng.integers(len(files)))]
    path.write_bytes(damage(path.read_bytes(), rng))


def read_or_refuse(log: Path) -> str | None:
    """Read a log within the limits; return the error's line, if it is refused."""
    start = time.perf_counter()
    try:
        read_described(log)
    except GaiaError as error:
        text = str(error)
        assert "\n" not in text
        assert "Traceback" not in text
        assert len(text) < 2000
        return text
    finally:
        assert time.perf_counter() - start < LIMIT_S
    return None


@pytest.mark.parametrize("kind", list(WRITERS))
def test_damage_gives_one_line_or_a_scene(tmp_path: Path, kind: str) -> None:
    good = tmp_path / "good"
    good.mkdir()
    log = WRITERS[kind](good)
    rng = np.random.default_rng(20261122)
    refused = 0
    for _ in range(N):
        work = tmp_path / "work"
        shutil.copytree(good, work)
        damage_a_file(work / log.relative_to(good), rng)
        refused += read_or_refuse(work / log.relative_to(good)) is not None
        shutil.rmtree(work)
    assert 0 < refused <= N
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss < LIMIT_GIB * 2**20


def mcap_record(kind: int, content: bytes) -> bytes:
    return struct.pack("<BQ", kind, len(content)) + content


def text(words: str) -> bytes:
    return struct.pack("<I", len(words)) + words.encode()


def mcap(*records: bytes) -> bytes:
    magic = b"\x89MCAP0\r\n"
    return magic + mcap_record(1, text("ros2") + text("")) + b"".join(records) + magic


def chunk(packed: bytes, size: int, compression: str = "lz4") -> bytes:
    head = struct.pack("<QQQI", 0, 0, size, 0) + text(compression)
    return mcap_record(6, head + struct.pack("<Q", len(packed)) + packed)


@pytest.mark.parametrize("declared", [100, 2**30, 2**62])
def test_a_bomb_is_not_unpacked(tmp_path: Path, declared: int) -> None:
    path = tmp_path / "bomb.mcap"
    path.write_bytes(mcap(chunk(lz4.frame.compress(bytes(300 * 2**20)), declared)))
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    line = read_or_refuse(path)
    assert line is not None
    assert "damaged at byte" in line
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 2**18


@pytest.mark.parametrize("compression", ["bz2", "lz4", "zstd", "rar"])
def test_unpacking_stops_at_the_declared_size(compression: str) -> None:
    with pytest.raises(ValueError, match="chunk"):
        unpack(compression, b"nonsense", 100)


@pytest.mark.parametrize(
    ("definition", "message"),
    [
        ("string[100000000] anchor_id\nfloat32 range\n", "has 100,000,000 elements"),
        ("Nothing[] nodes\n" + "=" * 80 + "\nMSG: a/Nothing\n", "is an array of nothing"),
        ("Own own\n" + "=" * 80 + "\nMSG: a/Own\nOwn own\n", "contains itself"),
        ("gone/Type x\n", "used and not defined"),
        ("float32 range\n" * 6000, "too many types or fields"),
        ("float32 " + "r" * 300_000, "characters"),
        ("import os\n", "cannot be used"),
    ],
)
def test_definitions_that_ask_for_too_much(tmp_path: Path, definition: str, message: str) -> None:
    schema = struct.pack("<H", 1) + text("a/msg/B") + text("ros2msg") + text(definition)
    channel = struct.pack("<HH", 1, 1) + text("/uwb") + text("cdr") + struct.pack("<I", 0)
    sent = struct.pack("<HIQQ", 1, 0, 0, 0) + b"\0\1\0\0" + bytes(8)
    records = mcap_record(3, schema), mcap_record(4, channel), mcap_record(5, sent)
    path = tmp_path / "log.mcap"
    path.write_bytes(mcap(*records))
    with pytest.raises(GaiaError, match=message) as caught:
        RosLog(path).ranges("/uwb")
    assert "\n" not in str(caught.value)


def test_a_checksum_that_is_wrong(tmp_path: Path) -> None:
    content = mcap_record(4, struct.pack("<HH", 1, 0) + text("/x") + text("cdr") + bytes(4))
    head = struct.pack("<QQQI", 0, 0, len(content), zlib.crc32(content) ^ 1) + text("")
    path = tmp_path / "log.mcap"
    path.write_bytes(mcap(mcap_record(6, head + struct.pack("<Q", len(content)) + content)))
    line = read_or_refuse(path)
    assert line is not None
    assert "checksum is wrong" in line


def test_a_pipe_is_no_file_and_does_not_hang(tmp_path: Path) -> None:
    write_serial(tmp_path)
    (tmp_path / "tag.log").unlink()
    os.mkfifo(tmp_path / "tag.log")
    (report,) = check_source(str(tmp_path))
    assert report.problems == (f"{tmp_path / 'tag.log'}: is no file",)
