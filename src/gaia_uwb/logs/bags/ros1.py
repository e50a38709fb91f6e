"""ROS 1's bags, version 2.0, walked record by record."""

from __future__ import annotations

import struct
from collections.abc import Iterator
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

_MAX_HEADER_BYTES = 2**20
_U32, _TIME = struct.Struct("<I"), struct.Struct("<II")
_ROS1_MAGIC = b"#ROSBAG V2.0\n"


class Ros1Bag(Bag):
    """ROS 1's bag, version 2.0; bags that were never indexed are fine."""

    def walk(self, wanted: set[int], *, inside: bool = True) -> Iterator[Message]:
        """Yield the wanted messages, see :meth:`Bag.walk`."""
        size, self.unpacked = self.path.stat().st_size, 0
        with open_regular(self.path) as file:
            if file.read(len(_ROS1_MAGIC)) != _ROS1_MAGIC:
                raise InputError("is not a ROS 1 bag (version 2.0)", source=self.path)
            while (at := file.tell()) < size:
                try:
                    yield from self._record(file, at, size, wanted, inside)
                except CutOffError:
                    self.cut_off_at = at
                    return
                except (ValueError, KeyError, struct.error) as error:
                    raise self.damaged(str(error), at) from error

    def _record(
        self, file: BinaryIO, at: int, size: int, wanted: set[int], inside: bool
    ) -> Iterator[Message]:
        (n_header,) = _U32.unpack(take(file, 4, size - at))
        if n_header > _MAX_HEADER_BYTES:
            raise ValueError("header too long")
        header = _ros1_header(take(file, n_header, size - file.tell()))
        (n_data,) = _U32.unpack(take(file, 4, size - file.tell()))
        start, kind = file.tell(), header[b"op"]
        if n_data > size - start:
            raise CutOffError
        if kind == b"\x05" and inside:
            (unpacked_size,) = _U32.unpack(header[b"size"])
            if max(unpacked_size, n_data) > MAX_CHUNK_BYTES:
                raise ValueError(f"chunk too large: {max(unpacked_size, n_data):,} bytes")
            compression = header[b"compression"].decode("ascii", "replace")
            self.spend(unpacked_size)
            chunk = unpack(compression, take(file, n_data, size - start), unpacked_size)
            yield from self._messages(chunk, wanted)
        elif kind == b"\x07" and n_data <= MAX_MESSAGE_BYTES:
            self._connection(header, take(file, n_data, size - start))
        elif kind == b"\x06" and n_data <= MAX_MESSAGE_BYTES:
            data = take(file, n_data, size - start)
            for key, count in struct.iter_unpack("<II", data[: n_data // 8 * 8]):
                self.counts[key] = self.counts.get(key, 0) + count
        elif kind == b"\x02" and inside and n_data <= MAX_MESSAGE_BYTES:
            yield from self._message(header, take(file, n_data, size - start), wanted)
        file.seek(start + n_data)

    def _messages(self, chunk: bytes, wanted: set[int]) -> Iterator[Message]:
        """Yield the wanted messages of an unpacked chunk."""
        place, end = 0, len(chunk)
        unpack_u32, usual = _U32.unpack_from, _UsualHeader()
        while place < end:
            (n_header,) = unpack_u32(chunk, place)
            header = chunk[place + 4 : place + 4 + n_header]
            place += 4 + n_header
            (n_data,) = unpack_u32(chunk, place)
            data_at, place = place + 4, place + 4 + n_data
            if place > end:
                raise ValueError("message extends past the end of its chunk")
            found = usual.read(header)
            if found is not None:
                key, time_ns = found
                if key in wanted and n_data <= MAX_MESSAGE_BYTES:
                    yield Message(self.channels[key], time_ns, chunk[data_at:place])
                continue
            fields = _ros1_header(header)
            if fields[b"op"] == b"\x07":
                self._connection(fields, chunk[data_at:place])
            elif fields[b"op"] == b"\x02":
                usual.learn(header, fields)
                if n_data <= MAX_MESSAGE_BYTES:
                    yield from self._message(fields, chunk[data_at:place], wanted)

    def _message(
        self, header: dict[bytes, bytes], data: bytes, wanted: set[int]
    ) -> Iterator[Message]:
        (key,) = _U32.unpack(header[b"conn"])
        if key in wanted:
            seconds, nanoseconds = _TIME.unpack(header[b"time"])
            yield Message(self.channels[key], seconds * 10**9 + nanoseconds, data)

    def _connection(self, header: dict[bytes, bytes], data: bytes) -> None:
        (key,) = _U32.unpack(header[b"conn"])
        fields = _ros1_header(data)
        topic = header[b"topic"].decode("utf-8", "replace")
        package, _, name = fields[b"type"].decode("ascii", "replace").partition("/")
        definition = fields[b"message_definition"].decode("utf-8", "replace")
        self.add(Channel(key, topic, f"{package}/msg/{name}", definition, "ros1"))


class _UsualHeader:
    """The layout of the last message's header: the next one is most often laid out alike."""

    def __init__(self) -> None:
        self._size = -1
        self._conn = self._time = 0
        self._cuts = (0, 0, 0, 0)
        self._rest = b""

    def learn(self, header: bytes, fields: dict[bytes, bytes]) -> None:
        """Remember the layout of a message's header."""
        key, time = fields[b"conn"], fields[b"time"]
        self._conn = header.find(b"conn=" + key) + 5
        self._time = header.find(b"time=" + time) + 5
        self._size = len(header) if len(key) == 4 and len(time) == 8 else -1
        (a, m), (b, n) = sorted([(self._conn, 4), (self._time, 8)])
        self._cuts = (a, a + m, b, b + n)
        self._rest = self._without_values(header)

    def read(self, header: bytes) -> tuple[int, int] | None:
        """Return channel and time in nanoseconds; ``None`` if the layout is another."""
        if len(header) != self._size or self._without_values(header) != self._rest:
            return None
        seconds, nanoseconds = _TIME.unpack_from(header, self._time)
        return _U32.unpack_from(header, self._conn)[0], seconds * 10**9 + nanoseconds

    def _without_values(self, header: bytes) -> bytes:
        a, b, c, d = self._cuts
        return header[:a] + header[b:c] + header[d:]


def _ros1_header(data: bytes) -> dict[bytes, bytes]:
    """Return the fields of a record's header."""
    fields, place = {}, 0
    while place < len(data):
        (size,) = _U32.unpack_from(data, place)
        name, sign, value = data[place + 4 : place + 4 + size].partition(b"=")
        place += 4 + size
        if place > len(data) or not sign:
            raise ValueError("header field without an end or a name")
        fields[name] = value
    if b"op" not in fields and b"type" not in fields:
        raise ValueError("header without a record type")
    return fields
