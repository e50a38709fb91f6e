"""Containers of ROS messages, walked record by record: ROS 1 bags, MCAP, and ROS 2's SQLite.

Nothing that a file declares about itself is trusted: sizes are compared with what is there, and
chunks are unpacked up to a limit. A recording that was cut off (a crash, a full disk) or never
indexed is read up to where it ends, and a note says so.
"""

from __future__ import annotations

import bz2
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

from gaia_uwb._shared import InputError

MAX_FILE_BYTES = 2**40
"""Bags stream through, so that their size does not affect memory."""

MAX_CHUNK_BYTES = 128 * 2**20
"""Chunks that unpack to more are refused; recorders write 1 to 4 MiB."""

MAX_MESSAGE_BYTES = 16 * 2**20
"""Larger messages are images or clouds, never positions or ranges."""

MAX_RATIO = 200
"""A file that unpacks to more than this times its size, beyond a free amount, is a bomb."""

_FREE_BYTES = 192 * 2**20
_MAX_CONNECTIONS = 10_000
_ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"


class Channel(NamedTuple):
    """One topic of one file.

    Parameters
    ----------
    key
        Its id within the file.
    topic, msgtype
        Names; the type is ``package/msg/Name``.
    definition
        The text of the type's ``.msg`` file with those it uses; ``None`` where the bag lacks it.
    encoding
        ``"ros1"``, ``"cdr"``, or what cannot be read.
    """

    key: int
    topic: str
    msgtype: str
    definition: str | None
    encoding: str


class Message(NamedTuple):
    """One message: its channel, its receive time in nanoseconds and its bytes."""

    channel: Channel
    time_ns: int
    data: bytes


@dataclass
class Bag:
    """What is known of a file after :meth:`scan`.

    Parameters
    ----------
    path
        The file.
    channels
        Key -> channel.
    counts
        Key -> declared number of messages, for listings only.
    cut_off_at
        Byte at which the file ends within a record, if it does.
    unpacked
        Bytes that this walk has unpacked.
    notes
        What a user should know of how it was read.
    """

    path: Path
    channels: dict[int, Channel] = field(default_factory=dict)
    counts: dict[int, int] = field(default_factory=dict)
    cut_off_at: int | None = None
    unpacked: int = 0
    notes: list[str] = field(default_factory=list)

    def scan(self) -> None:
        """Find the channels: in the index, or within the chunks where there is no index.

        Raises
        ------
        InputError
            If the file is corrupt.
        """
        for inside in (False, True):
            if not self.channels:
                for _ in self.walk(set(), inside=inside):
                    pass

    def walk(self, wanted: set[int], *, inside: bool = True) -> Iterator[Message]:
        """Yield the messages of the wanted channels in the file's order; learn channels.

        Raises
        ------
        InputError
            If the file is corrupt: the message names the byte.
        """
        raise NotImplementedError

    def spend(self, n_bytes: int) -> None:
        """Count what is going to be unpacked in this walk: a small file must not cost hours.

        Raises
        ------
        ValueError
            If it is too much for the file's size.
        """
        self.unpacked += n_bytes
        over = self.unpacked - _FREE_BYTES
        if over > 0 and over > MAX_RATIO * self.path.stat().st_size:
            raise ValueError(f"decompresses to more than {MAX_RATIO} times the file's size")

    def add(self, channel: Channel) -> None:
        """Remember a channel; its names come into messages, so they are made printable."""
        if len(self.channels) >= _MAX_CONNECTIONS:
            raise InputError(f"more than {_MAX_CONNECTIONS:,} topics", source=self.path)
        topic, msgtype = _printable(channel.topic), _printable(channel.msgtype)
        self.channels.setdefault(channel.key, channel._replace(topic=topic, msgtype=msgtype))

    def damaged(self, problem: str, at: int) -> InputError:
        """Return the error for damage at a byte."""
        return InputError(f"corrupt at byte {at:,}: {problem}", source=self.path)


def _printable(text: str) -> str:
    return "".join(letter if letter.isprintable() else "?" for letter in text)


def unpack(compression: str, data: bytes, size: int) -> bytes:
    """Return the unpacked bytes of a chunk.

    Parameters
    ----------
    compression
        ``""`` or ``"none"``, ``"bz2"``, ``"lz4"``, ``"zstd"``.
    data
        The packed bytes.
    size
        What the file declares; never more is unpacked.

    Raises
    ------
    ValueError
        If the bytes are corrupt or do not have that size.
    """
    if compression in {"", "none"}:
        unpacked = data
    else:
        try:
            unpacked = _decompressor(compression).decompress(data, max_length=size + 1)
        except ValueError:
            raise
        except Exception as error:  # each library has errors of its own
            raise ValueError(f"a {compression} chunk cannot be decompressed: {error}") from error
    if len(unpacked) != size:
        raise ValueError(f"a chunk does not decompress to the {size:,} bytes it declares")
    return bytes(unpacked)


def is_packed(message: Message) -> bool:
    """Tell whether a message was packed by itself: CDR starts with other bytes than zstd."""
    return message.channel.encoding == "cdr" and message.data.startswith(_ZSTD_MAGIC)


def unpack_message(data: bytes) -> bytes:
    """Return a message that was packed with zstd; the end of a long one is lost.

    Raises
    ------
    Exception
        From the library, if the bytes are corrupt.
    """
    from backports import zstd

    return bytes(zstd.ZstdDecompressor().decompress(data, max_length=MAX_MESSAGE_BYTES))


def _decompressor(compression: str) -> Any:
    if compression == "bz2":
        return bz2.BZ2Decompressor()
    if compression == "lz4":
        import lz4.frame

        return lz4.frame.LZ4FrameDecompressor()
    if compression == "zstd":
        from backports import zstd

        return zstd.ZstdDecompressor()
    raise ValueError(f"chunks use the compression {compression[:20]!r}, which is not supported")


class CutOffError(Exception):
    """The file ends within a record."""


def take(file: BinaryIO, size: int, left: int) -> bytes:
    """Read exactly so many bytes of the ``left`` ones."""
    data = file.read(size) if size <= left else b""
    if len(data) != size:
        raise CutOffError
    return data
