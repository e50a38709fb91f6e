"""MCAP files, walked record by record."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from gaia_uwb._shared import InputError, open_regular
from gaia_uwb.logs.bags.container import (
    MAX_CHUNK_BYTES,
    MAX_MESSAGE_BYTES,
    Bag,
    Channel,
    CutOffError,
    Message,
    take,
    unpack,
)

_U16, _U32, _U64 = struct.Struct("<H"), struct.Struct("<I"), struct.Struct("<Q")
_START, _MESSAGE, _MESSAGE_KIND = struct.Struct("<BQ"), struct.Struct("<HIQ"), 5
_SMALL = {b"\x03", b"\x04", b"\x0b"}
_MCAP_MAGIC = b"\x89MCAP0\r\n"


class McapBag(Bag):
    """MCAP with ROS 2 (or ROS 1) messages, as a file of its own or within a ROS 2 folder."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._schemas: dict[int, tuple[str, str, str]] = {}

    def scan(self) -> None:
        """Find the channels, see :meth:`Bag.scan`; an index may lack the types."""
        super().scan()
        if not all(channel.msgtype for channel in self.channels.values()):
            self.channels.clear()
            for _ in self.walk(set()):
                pass

    def walk(self, wanted: set[int], *, inside: bool = True) -> Iterator[Message]:
        """Yield the wanted messages, see :meth:`Bag.walk`."""
        size, self.unpacked = self.path.stat().st_size, 0
        with open_regular(self.path) as file:
            if file.read(len(_MCAP_MAGIC)) != _MCAP_MAGIC:
                raise InputError("is not an MCAP file", source=self.path)
            while (at := file.tell()) < size:
                try:
                    kind = file.read(1)
                    (n,) = _U64.unpack(take(file, 8, size - at))
                    yield from self._record(kind, file, n, wanted, inside)
                    if kind == b"\x02":
                        return
                    file.seek(at + 9 + n)
                except CutOffError:
                    break
                except (ValueError, struct.error) as error:
                    raise self.damaged(str(error), at) from error
            self.cut_off_at = at

    def _record(
        self, kind: bytes, file: BinaryIO, n: int, wanted: set[int], inside: bool
    ) -> Iterator[Message]:
        if n > self.path.stat().st_size - file.tell():
            raise CutOffError
        if kind == b"\x06" and inside:
            if n > MAX_CHUNK_BYTES + 1024:
                raise ValueError(f"chunk too large: {n:,} bytes")
            yield from self._chunk(file.read(n), wanted)
        elif n <= MAX_MESSAGE_BYTES and (kind in _SMALL or (kind == b"\x05" and inside)):
            yield from self._small(kind, file.read(n), wanted)

    def _chunk(self, data: bytes, wanted: set[int]) -> Iterator[Message]:
        _, _, unpacked_size, crc = struct.unpack_from("<QQQI", data)
        if unpacked_size > MAX_CHUNK_BYTES:
            raise ValueError(f"chunk too large: {unpacked_size:,} bytes")
        compression, place = _string(data, 28)
        (n,) = _U64.unpack_from(data, place)
        if n != len(data) - place - 8:
            raise ValueError("a chunk's size does not match its record")
        self.spend(unpacked_size)
        chunk = unpack(compression, data[place + 8 :], unpacked_size)
        if crc and zlib.crc32(chunk) != crc:
            raise ValueError("a chunk's checksum is wrong")
        yield from self._messages(chunk, wanted)

    def _messages(self, chunk: bytes, wanted: set[int]) -> Iterator[Message]:
        """Yield the wanted messages of an unpacked chunk."""
        place, end = 0, len(chunk)
        unpack_start, unpack_message = _START.unpack_from, _MESSAGE.unpack_from
        while place < end:
            kind, n = unpack_start(chunk, place)
            start, place = place + 9, place + 9 + n
            if place > end:
                raise ValueError("message extends past the end of its chunk")
            if kind != _MESSAGE_KIND:
                yield from self._small(bytes([kind]), chunk[start:place], wanted)
            elif n >= 22:
                key, _, time_ns = unpack_message(chunk, start)
                if key in wanted and n <= MAX_MESSAGE_BYTES:
                    yield Message(self.channels[key], time_ns, chunk[start + 22 : place])

    def _small(self, kind: bytes, data: bytes, wanted: set[int]) -> Iterator[Message]:
        """Handle a record that is not a chunk."""
        if kind == b"\x05":
            key, _, log_ns = _MESSAGE.unpack_from(data)
            if key in wanted and len(data) <= MAX_MESSAGE_BYTES:
                yield Message(self.channels[key], log_ns, data[22:])
        elif kind == b"\x03":
            (key,) = _U16.unpack_from(data)
            name, place = _string(data, 2)
            encoding, place = _string(data, place)
            self._schemas[key] = (name, encoding, _string(data, place)[0])
        elif kind == b"\x04":
            self._channel(data)
        elif kind == b"\x0b":
            counts = data[46 : 46 + _U32.unpack_from(data, 42)[0] // 10 * 10]
            self.counts = dict(struct.iter_unpack("<HQ", counts[: len(counts) // 10 * 10]))

    def _channel(self, data: bytes) -> None:
        key, schema_key = struct.unpack_from("<HH", data)
        topic, place = _string(data, 4)
        encoding, _ = _string(data, place)
        name, schema_encoding, text = self._schemas.get(schema_key, ("", "", ""))
        known = schema_encoding in {"ros1msg", "ros2msg"}
        words = name.split("/")
        msgtype = f"{words[0]}/msg/{words[-1]}" if len(words) > 1 else name
        self.add(Channel(key, topic, msgtype, text if known else None, encoding))


def _string(data: bytes, place: int) -> tuple[str, int]:
    """Return a text that stands behind its length, and where it ends."""
    (size,) = _U32.unpack_from(data, place)
    end = place + 4 + size
    if end > len(data):
        raise ValueError("text extends past the end of its record")
    return data[place + 4 : end].decode("utf-8", "replace"), end
