"""Tables made from logs that are not tables: lines of text, messages of a bag, mapped columns.

They are checked by the same rules as GAIA's own files, and their errors name the line or the
message, because each row remembers where it came from.
"""

from __future__ import annotations

import codecs
import io
from array import array
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import BinaryIO

import numpy as np

from gaia_uwb._shared import Array, InputError, Int64, open_regular
from gaia_uwb.logs._lever_arm import MAX_TAGS
from gaia_uwb.logs._table import MAX_ROWS, Table

MAX_ANCHORS = 4096
"""More distinct ids than this cannot be anchors: the wrong field was used as the id."""

MAX_TEXT_BYTES = 4 * 2**30
"""A larger text log is refused before it is read."""

_MAX_LINE_BYTES = 2**16
_MAX_ID_LENGTH = 200


@dataclass(frozen=True)
class LogTable(Table):
    """A table whose rows come from lines or messages.

    Parameters
    ----------
    path, columns, labels, unknown
        Like those of :class:`Table`.
    number : (R,)
        Number of each row's line or message, from 1.
    origin : (R,)
        Index into ``origins``.
    origins
        What stands before the number in an error: ``"a.log, row"``.
    names
        Column -> how its source calls it, where that differs.
    """

    number: Int64[Array, "R"] = field(default_factory=lambda: np.zeros(0, np.int64))
    origin: Int64[Array, "R"] = field(default_factory=lambda: np.zeros(0, np.int64))
    origins: tuple[str, ...] = ()
    names: Mapping[str, str] = field(default_factory=dict)

    def error(
        self, problem: str, *, index: int | None = None, column: str | None = None
    ) -> InputError:
        """Return the error that names the line or message of the row ``index``."""
        source = str(self.path)
        if index is not None:
            source = f"{self.origins[self.origin[index]]} {self.number[index]}"
        name = None if column is None else self.names.get(column, column)
        return InputError(problem, source=source, column=name)

    def take(self, rows: Array) -> LogTable:
        """Return the table of some rows, named by index or by a mask."""
        columns = {name: values[rows] for name, values in self.columns.items()}
        return replace(self, columns=columns, number=self.number[rows], origin=self.origin[rows])


def from_table(
    table: Table,
    columns: Mapping[str, Array],
    *,
    labels: Mapping[str, tuple[str, ...]] | None = None,
    names: Mapping[str, str] | None = None,
) -> LogTable:
    """Return a file's table under our names and in our units.

    Parameters
    ----------
    table
        The table as it was read.
    columns
        Our columns, with a value for each of its rows.
    labels, names
        Like those of :class:`LogTable`.
    """
    first_row = 1 if table.dialect is None else table.dialect.header_row + 1
    kept = np.arange(len(table), dtype=np.int64) if table.kept is None else table.kept
    return LogTable(
        path=table.path,
        columns=columns,
        labels={} if labels is None else labels,
        unknown=table.unknown,
        number=kept + first_row,
        origin=np.zeros(len(table), np.int64),
        origins=(f"{table.path}, row",),
        names={} if names is None else names,
    )


class LogRows:
    """Rows that grow one by one, in bounded memory.

    Parameters
    ----------
    path
        The file.
    names
        Columns of numbers; the first is ``t_s``.
    row_word
        What a row is called: ``"row"`` for a line, ``"topic /uwb, message"`` for a message.
    tagged
        Whether each row has a tag.
    """

    def __init__(
        self, path: Path, names: Sequence[str], row_word: str = "row", *, tagged: bool = False
    ) -> None:
        self.path = path
        self.names = tuple(names)
        self.row_word = row_word
        self._values = array("d")
        self._number = array("q")
        self._anchor = array("q")
        self._ids: dict[str, int] = {}
        self._tag = array("q")
        self._tags: dict[str, int] | None = {} if tagged else None

    def __len__(self) -> int:
        return len(self._number)

    def add(
        self,
        number: int,
        values: Iterable[float],
        anchor_id: str | None = None,
        tag_id: str = "",
    ) -> None:
        """Append a row.

        Raises
        ------
        InputError
            If there are too many rows, anchors or tags.
        """
        if len(self._number) >= MAX_ROWS:
            raise InputError(f"more than {MAX_ROWS:,} rows: split the log", source=self.path)
        if anchor_id is not None:
            code = self._ids.get(anchor_id)
            self._anchor.append(self._code(anchor_id, number) if code is None else code)
        if self._tags is not None:
            code = self._tags.setdefault(tag_id, len(self._tags))
            if code == MAX_TAGS:
                problem = f"more than {MAX_TAGS:,} tags: is this field the tag's id?"
                raise InputError(problem, source=f"{self.path}, {self.row_word} {number}")
            self._tag.append(code)
        self._values.extend(values)
        self._number.append(number)

    def _code(self, anchor_id: str, number: int) -> int:
        code = self._ids.setdefault(anchor_id, len(self._ids))
        if code == MAX_ANCHORS or len(anchor_id) > _MAX_ID_LENGTH:
            source = f"{self.path}, {self.row_word} {number}"
            if code == MAX_ANCHORS:
                problem = f"more than {MAX_ANCHORS:,} anchors: is this field the anchor's id?"
            else:
                problem = f"an anchor's id of {len(anchor_id):,} characters: is this field its id?"
            raise InputError(problem, source=source)
        return code

    def table(self) -> LogTable:
        """Return the rows as a table; ids become text columns ``anchor_id`` and ``tag_id``."""
        values = np.frombuffer(self._values, np.float64).reshape(-1, len(self.names))
        columns: dict[str, Array] = {name: values[:, k] for k, name in enumerate(self.names)}
        labels = {}
        for name, ids, codes in (
            ("anchor_id", self._ids, self._anchor),
            ("tag_id", self._tags, self._tag),
        ):
            if ids:
                labels[name] = tuple(sorted(ids))
                place = {text: k for k, text in enumerate(labels[name])}
                sorted_code = np.array([place[text] for text in ids], np.int64)
                columns[name] = sorted_code[np.frombuffer(codes, np.int64)]
        return LogTable(
            path=self.path,
            columns=columns,
            labels=labels,
            unknown=(),
            number=np.frombuffer(self._number, np.int64),
            origin=np.zeros(len(self), np.int64),
            origins=(f"{self.path}, {self.row_word}",),
        )


def join(tables: Sequence[LogTable]) -> LogTable:
    """Return the rows of several tables of ranges as one.

    A column that one lacks is NaN there, and a tag that it does not name is an empty text.

    Raises
    ------
    InputError
        If there are too many rows.
    """
    if len(tables) == 1:
        return tables[0]
    if sum(map(len, tables)) > MAX_ROWS:
        raise InputError(f"more than {MAX_ROWS:,} ranges: split the log", source=tables[0].path)
    names = dict.fromkeys(name for table in tables for name in table.columns)
    labels: dict[str, tuple[str, ...]] = {
        name: tuple(sorted({label for t in tables for label in t.labels.get(name, ("",))}))
        for name in ("anchor_id", "tag_id")
        if name in names
    }
    columns = {
        name: np.concatenate([_column(table, name, labels.get(name)) for table in tables])
        for name in names
    }
    starts = np.cumsum([0, *(len(table.origins) for table in tables)])
    return LogTable(
        path=tables[0].path,
        columns=columns,
        labels=labels,
        unknown=(),
        number=np.concatenate([table.number for table in tables]),
        origin=np.concatenate([t.origin + s for t, s in zip(tables, starts, strict=False)]),
        origins=tuple(origin for table in tables for origin in table.origins),
        names=tables[0].names,
    )


def _column(table: LogTable, name: str, labels: tuple[str, ...] | None) -> Array:
    """Return a column's values; those of texts point into ``labels``."""
    if labels is None:
        return np.full(len(table), np.nan) if name not in table else table[name]
    if name not in table:
        return np.full(len(table), labels.index(""), np.int64)
    place = {label: k for k, label in enumerate(labels)}
    return np.array([place[label] for label in table.labels[name]], np.int64)[table[name]]


def read_lines(path: Path) -> Iterator[tuple[int, str]]:
    """Yield number (from 1) and text of a log's lines; a byte that is not ASCII becomes ``?``.

    A line longer than 64 KiB comes in pieces, so that memory stays bounded.

    Raises
    ------
    InputError
        If the file cannot be read or is too large.
    """
    check_file(path, MAX_TEXT_BYTES)
    try:
        with open_regular(path) as file:
            for number, line in enumerate(_lines_in(file), 1):
                yield number, line.decode("ascii", "replace").replace("\ufffd", "?").strip()
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror or error}", source=path) from error


def _lines_in(file: BinaryIO) -> Iterator[bytes]:
    """Yield a file's lines, without the mark at its start; a Windows shell writes UTF-16."""
    mark = file.read(len(codecs.BOM_UTF8))
    file.seek(len(mark) if mark == codecs.BOM_UTF8 else 0)
    if mark.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        with io.TextIOWrapper(file, "utf-16", errors="replace", newline="\n") as text:
            while wide := text.readline(_MAX_LINE_BYTES):
                yield wide.encode("ascii", "replace")
        return
    while line := file.readline(_MAX_LINE_BYTES):
        yield line


def check_number_of_anchors(table: Table) -> None:
    """Refuse a table with so many ids that another column must have been used as the id.

    Raises
    ------
    InputError
        If there are more than :data:`MAX_ANCHORS`.
    """
    n_ids = len(table.labels["anchor_id"])
    if n_ids > MAX_ANCHORS:
        problem = f"{n_ids:,} different anchors, but at most {MAX_ANCHORS:,} are read"
        raise table.error(problem, column="anchor_id")


def check_file(path: Path, most_bytes: int) -> None:
    """Refuse what is not a regular file (a pipe would wait for ever), and a file that is too large.

    Raises
    ------
    InputError
        If it is either, or empty.
    """
    try:
        if not path.is_file():
            problem = "is not a regular file" if path.exists() else "no such file"
            raise InputError(problem, source=path)
        size = path.stat().st_size
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror or error}", source=path) from error
    except ValueError as error:
        raise InputError(f"cannot be read: {error}", source=path) from error
    if not size:
        raise InputError("is empty", source=path)
    if size > most_bytes:
        problem = f"has {size:,} bytes, but at most {most_bytes:,} are read at once: split the log"
        raise InputError(problem, source=path)
