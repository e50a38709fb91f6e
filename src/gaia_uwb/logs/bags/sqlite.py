"""ROS 2's SQLite storage (``.db3``), read with the standard library."""

from __future__ import annotations

import shutil
import sqlite3
import tempfile
import weakref
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from urllib.parse import quote

from gaia_uwb._shared import InputError
from gaia_uwb.logs.bags.container import MAX_MESSAGE_BYTES, Bag, Channel, Message

_MAX_TABLES = 1000
_BESIDE = ("-wal", "-journal")


def _has_content(path: Path) -> bool:
    try:
        return path.is_file() and path.stat().st_size > 0
    except OSError:
        return False


class SqliteBag(Bag):
    """One ``.db3`` file; it has its own definitions since ROS 2 Iron.

    A recorder that was killed leaves messages in a file beside it (``-wal``; or ``-journal``, from
    which the last change is undone). SQLite writes when it reads those, so it gets a copy.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._copy: Path | None = None

    def walk(self, wanted: set[int], *, inside: bool = True) -> Iterator[Message]:
        """Yield the wanted messages, see :meth:`Bag.walk`; ``inside`` has no meaning here."""
        self.unpacked = 0
        try:
            with closing(self._connect()) as connection:
                if not self.channels:
                    self._read_channels(connection)
                if wanted:
                    yield from self._messages(connection, wanted)
        except (sqlite3.Error, ValueError, OverflowError) as error:
            reason = " ".join(str(error).split())[:200]
            raise InputError(
                f"corrupt or not a ROS 2 database: {reason}", source=self.path
            ) from error

    def _connect(self) -> sqlite3.Connection:
        beside = [path for path in map(self._beside, _BESIDE) if _has_content(path)]
        if beside and self._copy is None:
            self._copy = self._copy_with(beside)
        path, mode = self.path.resolve(), "ro&immutable=1"
        if self._copy is not None:
            path, mode = self._copy, "rw"
        connection = sqlite3.connect(f"file:{quote(bytes(path))}?mode={mode}", uri=True)
        connection.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, 4 * MAX_MESSAGE_BYTES)
        connection.text_factory = lambda text: text.decode("utf-8", "replace")
        return connection

    def _beside(self, ending: str) -> Path:
        return self.path.with_name(self.path.name + ending)

    def _copy_with(self, beside: list[Path]) -> Path:
        """Copy the database and the files beside it to a folder that is deleted with this object.

        Raises
        ------
        InputError
            If they cannot be read, or the disk is too full.
        """
        folder = Path(tempfile.mkdtemp(prefix="gaia-"))
        weakref.finalize(self, shutil.rmtree, folder, ignore_errors=True)
        try:
            for path in (self.path, *beside):
                shutil.copyfile(path, folder / path.name)
        except OSError as error:
            names = ", ".join(path.name for path in beside)
            problem = f"cannot be copied to read {names} with it: {error.strerror or error}"
            raise InputError(problem, source=self.path) from error
        names = " and ".join(path.name for path in beside)
        self.notes.append(f"{self.path.name}: its recording was not closed; read with {names}")
        return folder / self.path.name

    def _read_channels(self, connection: sqlite3.Connection) -> None:
        rows = connection.execute("SELECT name, type FROM sqlite_master LIMIT ?", (_MAX_TABLES,))
        kinds = dict(rows.fetchall())
        # A view could compute for ever; only tables are read.
        for table in ("topics", "messages"):
            if kinds.get(table) != "table":
                problem = f"is not a ROS 2 database: it has no table {table}"
                raise InputError(problem, source=self.path)
        definitions = {}
        if kinds.get("message_definitions") == "table":
            query = (
                "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"
            )
            for name, encoding, text in connection.execute(query):
                if encoding == "ros2msg" and isinstance(text, str) and text:
                    definitions[name] = text
        for row in connection.execute("SELECT id, name, type, serialization_format FROM topics"):
            key, topic, msgtype, encoding = row
            if not (isinstance(key, int) and all(isinstance(text, str) for text in row[1:])):
                raise InputError("corrupt: a topic without a name or a type", source=self.path)
            self.add(Channel(key, topic, msgtype, definitions.get(msgtype), encoding))
        query = "SELECT topic_id, count(*) FROM messages GROUP BY topic_id"
        self.counts = dict(connection.execute(query).fetchall())

    def _messages(self, connection: sqlite3.Connection, wanted: set[int]) -> Iterator[Message]:
        marks = ",".join("?" * len(wanted))
        query = f"SELECT topic_id, timestamp, data FROM messages WHERE topic_id IN ({marks})"  # noqa: S608  # only marks
        for row, (key, time_ns, data) in enumerate(connection.execute(query, sorted(wanted)), 1):
            if not (isinstance(time_ns, int) and isinstance(data, bytes)):
                problem = "corrupt: expected a time and bytes in the table messages"
                raise InputError(problem, source=self.path, row=row)
            if len(data) <= MAX_MESSAGE_BYTES:
                yield Message(self.channels[key], time_ns, data)
