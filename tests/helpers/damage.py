"""Ways to damage a log, from a lost byte to a bomb; ``damage_log`` spoils one of its files.

Damage is of two kinds: blind, on a file's bytes, and inside, where checksums, sizes and packing are
made right again so that what is wrong reaches the innermost code: the messages of a chunk, the
cells of a table, the rows of a database, the branches of a document.
"""

from __future__ import annotations

import bz2
import re
import sqlite3
import struct
import zlib
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import lz4.frame
import numpy as np
import polars as pl
from backports import zstd

from damage_documents import damage_document

Rng = np.random.Generator

_WORDS = """
nan NaN inf -inf 1e999 -1e308 1e308 0 -0.0 -1 1e-320 1767225600000 1767225600000000000 0x10 1_000
-9223372036854775808 2026-01-01T00:00:00Z 9999-12-31T23:59:59Z 0001-01-01T00:00:00Z 2026-02-30
24:00:00 true null ~ None ä ٣ a,b *a &a [ ] { } % $GNGGA, DIST,99, AN0,FFFF,1,1,1,1e9 " "" '
"""
WORDS = [
    *_WORDS.split(),
    "",
    " ",
    "a\nb",
    "\0",
    "\x1b[2J",
    "\u202e",
    "- ",
    ": ",
    "<<: *a",
    "!!bool x",
]
WORDS += ["x" * 300, "9" * 30, "9" * 5000, "0" * 70_000, "[" * 3000, "1:" * 2000]
"""What a cell, a value or a line may hold and should not."""

BOMB_MIB = 300


def damage_log(log: Path, rng: Rng) -> None:
    """Spoil one file of a log."""
    files = sorted(path for path in [log, *log.glob("*")] if path.is_file())
    path = files[int(rng.integers(len(files)))]
    inside = {
        ".bag": damage_bag,
        ".mcap": damage_mcap,
        ".db3": damage_database,
        ".parquet": damage_parquet,
        ".json": damage_document,
        ".geojson": damage_document,
        ".ubx": damage_ubx,
        ".gpx": damage_gpx,
    }.get(path.suffix, damage_text)
    if path.suffix == ".yaml" and rng.random() < 0.5:
        inside = damage_document
    if rng.random() < 0.5:
        inside(path, rng)
    else:
        path.write_bytes(damage_bytes(path.read_bytes(), rng))


def damage_bytes(data: bytes, rng: Rng) -> bytes:
    """Cut, flip bits, put huge counts or numbers, repeat or remove a part, or put other bytes."""
    content = bytearray(data)
    at = int(rng.integers(len(content))) if content else 0
    match int(rng.integers(9)):
        case 0:
            del content[at:]
        case 1:
            for place in rng.integers(max(len(content), 1), size=int(rng.integers(1, 20))):
                content[place : place + 1] = bytes([content[place] ^ 1 << int(rng.integers(8))])
        case 2:
            content[at : at + 4] = struct.pack("<I", int(rng.choice([2**32 - 1, 2**31, 2**28])))
        case 3:
            content[at : at + 8] = struct.pack("<Q", int(rng.choice([2**63 - 1, 2**40, 2**33])))
        case 4:
            content[at : at + 8] = struct.pack("<d", rng.choice([np.nan, np.inf, 1e300, -1e300, 0]))
        case 5:
            content[at : at + 4] = struct.pack("<f", rng.choice([np.nan, -np.inf, 3e38, 1e-44]))
        case 6:
            del content[at : at + int(rng.integers(1, 200))]
        case 7:
            content[at:at] = content[at : at + int(rng.integers(1, 2000))]
        case _:
            size = int(rng.integers(1, 64))
            content[at : at + size] = rng.integers(256, size=size, dtype=np.uint8).tobytes()
    return bytes(content)


def damage_text(path: Path, rng: Rng) -> None:
    """Spoil a table, a serial log or a description in its lines and cells."""
    lines = path.read_text(encoding="utf-8").split("\n")
    at = int(rng.integers(len(lines)))
    word = WORDS[int(rng.integers(len(WORDS)))]
    match int(rng.integers(8)):
        case 0 | 1 | 2:  # other words in a cell, a field or a value
            separator = next((s for s in (",", ": ", "=", " ") if s in lines[at]), ",")
            cells = lines[at].split(separator)
            cells[int(rng.integers(len(cells)))] = word
            lines[at] = separator.join(cells)
        case 3:  # a line, a name or a key twice
            lines.insert(int(rng.integers(len(lines))), lines[at])
        case 4:
            lines[at] = word
        case 5:  # another order
            other = int(rng.integers(len(lines)))
            lines[at], lines[other] = lines[other], lines[at]
        case 6:  # one column, everywhere
            k = int(rng.integers(5))
            lines[1:] = [
                ",".join([*c[:k], word, *c[k + 1 :]]) for c in (s.split(",") for s in lines[1:])
            ]
        case _:  # too few or too many cells
            lines[at] += "," * int(rng.integers(1, 4)) if rng.random() < 0.5 else ""
            lines[at] = lines[at].replace(",", "", 1)
    text = "\n".join(lines)
    encoding = rng.choice(["utf-8", "utf-16", "latin-1"], p=[0.96, 0.02, 0.02])
    path.write_bytes(text.encode(encoding, "replace"))


def damage_ubx(path: Path, rng: Rng) -> None:
    """Spoil the payload of some u-blox messages and make their checksums right."""
    data = bytearray(path.read_bytes())
    starts = [match.start() for match in re.finditer(rb"\xb5\x62\x01", data)]
    for start in rng.choice(starts, size=int(rng.integers(1, len(starts))), replace=False):
        n = int.from_bytes(data[start + 4 : start + 6], "little")
        for _ in range(int(rng.integers(1, 4))):
            data[start + 6 + int(rng.integers(n))] = int(rng.integers(256))
        a = b = 0
        for byte in data[start + 2 : start + 6 + n]:
            a = a + byte & 255
            b = b + a & 255
        data[start + 6 + n : start + 8 + n] = bytes([a, b])
    path.write_bytes(bytes(data))


def damage_gpx(path: Path, rng: Rng) -> None:
    """Spoil an element, an attribute, the nesting or the head of a GPX file."""
    text = path.read_text(encoding="utf-8")
    word = WORDS[int(rng.integers(len(WORDS)))]
    marks = [match.span() for match in re.finditer(r"<[^>]*>|\"[^\"]*\"|(?<=>)[^<]+", text)]
    start, end = marks[int(rng.integers(len(marks)))]
    bomb = '<!DOCTYPE gpx [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;">]>'
    match int(rng.integers(6)):
        case 0 | 1:
            text = text[:start] + word + text[end:]
        case 2:
            text = text[:end] + text[start:end] * int(rng.choice([1, 3, 200])) + text[end:]
        case 3:
            text = text.replace("<gpx ", f"{bomb}<gpx ", 1).replace("drive", "&b;")
        case 4:
            text = text.replace('encoding="UTF-8"', f'encoding="{word[:20]}"', 1)
        case _:
            tag = ("time", "ele", "trkpt", "trkseg", "trk", "gpx")[int(rng.integers(6))]
            text = text.replace(f"<{tag}", "<other").replace(f"</{tag}", "</other")
    path.write_text(text, encoding="utf-8", errors="replace")


def damage_mcap(path: Path, rng: Rng) -> None:
    """Spoil one record, or the messages of a chunk, and make sizes and checksums right."""
    records = list(_mcap_records(path.read_bytes()))
    at = int(rng.integers(len(records)))
    chunks = [k for k, (kind, _) in enumerate(records) if kind == 6]
    if chunks and rng.random() < 0.7:
        at = chunks[int(rng.integers(len(chunks)))]
    kind, content = records[at]
    if kind != 6:
        records[at] = (kind, damage_bytes(content, rng))
    else:
        chunk = _mcap_chunk(content)
        pack = ["", "lz4", "zstd"][int(rng.integers(3))]
        if rng.random() < 0.03:
            packed, size, crc = bomb(pack), int(rng.choice([100, 2**27, 2**40])), 0
        else:
            chunk = damage_bytes(chunk, rng)
            packed, size, crc = PACK[pack](chunk), len(chunk), zlib.crc32(chunk)
        head = content[:16] + struct.pack("<QI", size, crc) + _mcap_text(pack)
        records[at] = (6, head + struct.pack("<Q", len(packed)) + packed)
    magic = b"\x89MCAP0\r\n"
    body = b"".join(struct.pack("<BQ", kind, len(content)) + content for kind, content in records)
    path.write_bytes(magic + body + magic)


PACK: dict[str, Callable[[bytes], bytes]] = {
    "": bytes,
    "none": bytes,
    "bz2": bz2.compress,
    "lz4": lz4.frame.compress,
    "zstd": zstd.compress,
}


@cache
def bomb(kind: str) -> bytes:
    """Return few bytes that unpack to many."""
    packers: dict[str, Callable[[], Any]] = {
        "bz2": bz2.BZ2Compressor,
        "lz4": lz4.frame.LZ4FrameCompressor,
        "zstd": zstd.ZstdCompressor,
    }
    if kind not in packers:
        return bytes(1000)
    packer, block = packers[kind](), bytes(2**20)
    head = packer.begin() if kind == "lz4" else b""
    return b"".join([head, *(packer.compress(block) for _ in range(BOMB_MIB)), packer.flush()])


def _mcap_records(data: bytes) -> Iterator[tuple[int, bytes]]:
    place = 8
    while place < len(data) - 8:
        kind, size = struct.unpack_from("<BQ", data, place)
        yield kind, data[place + 9 : place + 9 + size]
        place += 9 + size


def _mcap_chunk(content: bytes) -> bytes:
    """Return what a chunk holds, unpacked."""
    (n_name,) = struct.unpack_from("<I", content, 28)
    kind, packed = content[32 : 32 + n_name], content[40 + n_name :]
    return zstd.decompress(packed) if kind == b"zstd" else packed


def _mcap_text(words: str) -> bytes:
    return struct.pack("<I", len(words)) + words.encode()


def damage_bag(path: Path, rng: Rng) -> None:
    """Spoil one record of a ROS 1 bag, or the messages of a chunk, and make sizes right."""
    data = path.read_bytes()
    magic = b"#ROSBAG V2.0\n"
    records = list(_bag_records(data, len(magic)))
    at = int(rng.integers(len(records)))
    chunks = [k for k, (header, _) in enumerate(records) if b"op=\x05" in header]
    if chunks and rng.random() < 0.7:
        at = chunks[int(rng.integers(len(chunks)))]
    header, content = records[at]
    if at not in chunks:
        damaged = (damage_bytes(header, rng), content), (header, damage_bytes(content, rng))
        records[at] = damaged[int(rng.integers(2))]
    else:
        pack = ["none", "bz2", "lz4"][int(rng.integers(3))]
        if rng.random() < 0.03:
            packed, size = bomb(pack), int(rng.choice([100, 2**27, 2**32 - 1]))
        else:
            chunk = damage_bytes(_bag_chunk(header, content), rng)
            packed, size = PACK[pack](chunk), len(chunk)
        fields = b"op=\x05", b"compression=" + pack.encode(), b"size=" + struct.pack("<I", size)
        records[at] = (b"".join(struct.pack("<I", len(f)) + f for f in fields), packed)
    body = b"".join(struct.pack("<I", len(part)) + part for record in records for part in record)
    path.write_bytes(magic + body)


def _bag_records(data: bytes, place: int) -> Iterator[tuple[bytes, bytes]]:
    while place < len(data):
        parts = []
        for _ in range(2):
            (size,) = struct.unpack_from("<I", data, place)
            parts.append(data[place + 4 : place + 4 + size])
            place += 4 + size
        yield parts[0], parts[1]


def _bag_chunk(header: bytes, content: bytes) -> bytes:
    if b"compression=bz2" in header:
        return bz2.decompress(content)
    return lz4.frame.decompress(content) if b"compression=lz4" in header else content


def damage_database(path: Path, rng: Rng) -> None:
    """Put other values, types and counts into a ROS 2 database, or other tables."""
    values: list[Any] = [None, "x", b"", b"\x00\x01\x00\x00", -1, 0, 2**62, -(2**63), 1e308, 0.5]
    values += [
        float("inf"),
        "9" * 400,
        b"\xff" * 5000,
        "\x00",
        "acme_uwb/msg/Range\n",
        zstd.compress(bytes(2**25)),
    ]
    places = [("messages", c) for c in ("id", "topic_id", "timestamp", "data")]
    places += [("topics", c) for c in ("id", "name", "type", "serialization_format")]
    places += [("message_definitions", "encoded_message_definition")]
    table, column = places[int(rng.integers(len(places)))]
    value = values[int(rng.integers(len(values)))]
    with sqlite3.connect(path) as database:
        match int(rng.integers(6)):
            case 0 | 1:
                where = f"rowid % {int(rng.integers(1, 50))} = 0"
                _execute(database, f"UPDATE {table} SET {column} = ? WHERE {where}", (value,))
            case 2:
                rows = database.execute("SELECT rowid, data FROM messages").fetchall()
                rowid, data = rows[int(rng.integers(len(rows)))]
                changed = damage_bytes(data, rng)
                _execute(database, "UPDATE messages SET data = ? WHERE rowid = ?", (changed, rowid))
            case 3:
                _execute(database, f"DELETE FROM {table} WHERE rowid > {int(rng.integers(3))}")
            case 4:
                _execute(database, f"ALTER TABLE {table} RENAME COLUMN {column} TO other")
            case _:
                endless = "WITH RECURSIVE n(id) AS (SELECT 1 UNION ALL SELECT id + 1 FROM n)"
                _execute(database, f"ALTER TABLE {table} RENAME TO other")
                columns = ("name", "type", "serialization_format", "topic_id", "timestamp", "data")
                all_of_them = ", ".join(f"id AS {column}" for column in columns)
                _execute(
                    database, f"CREATE VIEW {table} AS {endless} SELECT id, {all_of_them} FROM n"
                )
    database.close()


def _execute(database: sqlite3.Connection, query: str, values: tuple[Any, ...] = ()) -> None:
    try:
        database.execute(query, values)
    except sqlite3.Error:  # a key that is there, a column that is not: then another damage is left
        database.execute("DELETE FROM messages WHERE rowid % 2 = 0")


def damage_parquet(path: Path, rng: Rng) -> None:
    """Give a column another type, name, order, or values that it must not hold."""
    table = pl.read_parquet(path)
    name = table.columns[int(rng.integers(len(table.columns)))]
    series, n = table[name], len(table)
    number = [np.nan, np.inf, -np.inf, 1e308, -1e18, 1.7e12][int(rng.integers(6))]
    one = int(rng.integers(n))
    match int(rng.integers(9)):
        case 0:
            table = table.with_columns(pl.Series(name, [f"{v}" for v in series]))
        case 1:
            table = table.with_columns(pl.Series(name, [[1.0]] * n))
        case 2:
            table = table.with_columns(pl.Series(name, [number] * n))
        case 3:
            values = [number if k == one else k for k in range(n)]
            table = table.with_columns(pl.Series(name, values, strict=False))
        case 4:
            values = [None if k == one else v for k, v in enumerate(series)]
            table = table.with_columns(pl.Series(name, values, series.dtype))
        case 5:
            table = table.drop(name)
        case 6:
            table = table.sample(n, with_replacement=True, seed=int(rng.integers(2**31)))
        case 7:
            table = table.clear() if rng.random() < 0.5 else table.head(1)
        case _:
            strange: list[Any] = [True, b"x", {"a": 1}, 2**63, -1]
            table = table.with_columns(pl.Series(name, [strange[int(rng.integers(5))]] * n))
    kinds = ("zstd", "lz4", "snappy", "gzip", "uncompressed")
    table.write_parquet(path, compression=kinds[int(rng.integers(5))])
