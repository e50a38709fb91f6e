"""Damaged inputs: one clear line or what they hold, never another exception.

GAIA_FUZZ sets how many; ``tests/endurance/damaged_inputs.py`` does it by the ten thousand.
"""

from __future__ import annotations

import os
import shutil
import struct
import time
import zlib
from pathlib import Path

import lz4.frame
import numpy as np
import polars as pl
import pytest
from backports import zstd

from damage import damage_log
from gaia_uwb._shared.errors import GaiaError
from gaia_uwb.evaluate.source_check import check_source
from gaia_uwb.logs.bags.container import unpack
from gaia_uwb.logs.ros import RosLog
from good_logs import write_serial, write_tables
from memory import start_measuring
from readers import READERS, Reader

N = int(os.environ.get("GAIA_FUZZ", "30"))
LIMIT_S = 5.0
LIMIT_GIB = 1.0
LOG = READERS["own"]  # all logs are read by one function


def read_or_refuse(path: Path, reader: Reader = LOG) -> str | None:
    """Read an input within the limits; return the error's line, if it is refused."""
    start = time.process_time()
    try:
        for line in reader.read(path):
            assert line.isprintable()
            assert len(line) < 2000
    except GaiaError as error:
        text = str(error)
        assert text.isprintable()
        assert "Traceback" not in text
        assert len(text) < 2000
        return text
    finally:
        assert time.process_time() - start < LIMIT_S
    return None


@pytest.mark.parametrize("reader", READERS.values(), ids=READERS)
def test_damage_gives_one_line_or_is_read(tmp_path: Path, reader: Reader) -> None:
    good = tmp_path / "good"
    good.mkdir()
    log = reader.write(good)
    assert read_or_refuse(log, reader) is None
    refused, grown = 0, start_measuring()
    for case in range(N):
        work = tmp_path / "work"
        shutil.copytree(good, work)
        path = work / log.relative_to(good)
        damage_log(path, np.random.default_rng([20261122, case]))
        refused += read_or_refuse(path, reader) is not None
        shutil.rmtree(work)
    assert 0 < refused < N
    assert grown() < LIMIT_GIB * 2**30


def test_a_library_that_panics_is_not_heard(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    def panic(*_: object) -> None:
        os.write(2, b"stack backtrace:\n")
        raise pl.exceptions.PanicException("called unwrap on None")

    log = write_tables(tmp_path, ".parquet")
    monkeypatch.setattr(pl, "scan_parquet", panic)
    assert read_or_refuse(log) == f"{log / 'drive.parquet'}: cannot be read: it is corrupt"
    os.write(2, b"heard again")
    assert capfd.readouterr() == ("", "heard again")


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
    grown = start_measuring()
    line = read_or_refuse(path)
    assert line is not None
    assert "corrupt at byte" in line
    assert grown() < 2**28


def test_many_small_bombs_are_not_unpacked_one_after_the_other(tmp_path: Path) -> None:
    # Each chunk is well formed: one schema of 100 MB of blanks, ten thousand times smaller in the
    # file.
    blanks = struct.pack("<H", 2) + text("a/msg/C") + text("ros2msg") + text(" " * 100 * 2**20)
    record = mcap_record(3, blanks)
    path = tmp_path / "bombs.mcap"
    path.write_bytes(mcap(*[chunk(zstd.compress(record), len(record), "zstd")] * 50))
    line = read_or_refuse(path)
    assert line is not None
    assert "decompresses to more than 200 times the file's size" in line


@pytest.mark.parametrize("compression", ["bz2", "lz4", "zstd", "rar"])
def test_unpacking_stops_at_the_declared_size(compression: str) -> None:
    with pytest.raises(ValueError, match="chunk"):
        unpack(compression, b"nonsense", 100)


@pytest.mark.parametrize(
    ("definition", "message"),
    [
        ("string[100000000] anchor_id\nfloat32 range\n", "has too many elements: 100,000,000"),
        ("Nothing[] nodes\n" + "=" * 80 + "\nMSG: a/Nothing\n", "is an array of empty elements"),
        ("Own own\n" + "=" * 80 + "\nMSG: a/Own\nOwn own\n", "contains itself"),
        ("gone/Type x\n", "used but not defined"),
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
    (tmp_path / "lec.log").unlink()
    os.mkfifo(tmp_path / "lec.log")
    (report,) = check_source(str(tmp_path))
    assert report.problems == (f"{tmp_path / 'lec.log'}: is not a regular file",)
