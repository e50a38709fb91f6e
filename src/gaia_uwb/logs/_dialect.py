"""How a text file holds a table: its encoding, what separates its columns, where its names stand.

A comma is the rule. Semicolons, tabs and blanks, names in a comment line (``# timestamp tx ty``),
decimal commas, UTF-16 and the line ends of an old Mac are recognised where the first lines leave no
doubt; what was recognised is said in a note.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import count, islice
from pathlib import Path

from gaia_uwb._shared import InputError, open_regular

BLANKS = " "
"""The separator of tables whose cells stand apart by any number of blanks and tabs."""

SEPARATOR_WORDS = {",": "commas", ";": "semicolons", "\t": "tabs", "|": "bars", BLANKS: "blanks"}
"""What the separators are called."""

MAX_LINE_BYTES = 2**20
_SAMPLE_LINES, _SAMPLE_CHARACTERS = 200, 2**20
_COMMENT = ("#", "%")
_SEPARATORS = ("\t", ";", ",")  # a comma may be that of numbers, so that it comes last
_WITH_COMMA = re.compile(r"[+-]?\d+,\d+([eE][+-]?\d+)?", re.ASCII)
_WITH_POINT = re.compile(r"[+-]?\d*\.\d*([eE][+-]?\d+)?", re.ASCII)
_EXCEL = re.compile(r'"?sep=([,;\t|])"?', re.IGNORECASE)
_MARKS = {b"\xff\xfe": "utf-16", b"\xfe\xff": "utf-16"}


@dataclass(frozen=True)
class Dialect:
    """How one text file holds a table.

    Parameters
    ----------
    names
        Names of the columns, in their order.
    separator
        What stands between two cells; :data:`BLANKS` is any number of blanks and tabs.
    header_row
        Line of the names, from 1; 0 where the file has none.
    comments
        Whether lines that start with ``#`` or ``%`` are left out.
    decimal_commas
        Columns whose numbers have a comma for a point.
    encoding
        Of the text.
    line_end
        Between the lines.
    """

    names: tuple[str, ...]
    separator: str = ","
    header_row: int = 1
    comments: bool = False
    decimal_commas: frozenset[str] = frozenset()
    encoding: str = "utf-8"
    line_end: str = "\n"

    @property
    def delimiter(self) -> str:
        """Character between the cells of :func:`table_lines`."""
        return "\t" if self.separator == BLANKS else self.separator

    @property
    def is_plain(self) -> bool:
        """Whether a CSV reader that is told the separator needs no other help."""
        plain = self.header_row == 1 and not self.comments and self.separator != BLANKS
        return plain and self.encoding == "utf-8" and self.line_end == "\n"

    def notes(self, path: Path) -> list[str]:
        """Return what a user should know who expects a plain CSV file."""
        found = (
            []
            if self.separator == ","
            else [f"{SEPARATOR_WORDS[self.separator]} between the columns"]
        )
        found += ["decimal commas"] if self.decimal_commas else []
        return [f"{path.name}: read with {' and '.join(found)}"] if found else []


def sniff(path: Path, names: Sequence[str] | None = None) -> Dialect:
    """Find out how a text file holds a table.

    Parameters
    ----------
    path
        The file.
    names
        Names of the columns of a format that has none in the file; then lines that start with
        ``#`` or ``%`` are comments.

    Raises
    ------
    InputError
        If the file cannot be read or is empty, or what comes first is not text.
    """
    try:
        return _sniff(path, names)
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror or error}", source=path) from error


def _sniff(path: Path, names: Sequence[str] | None) -> Dialect:
    encoding, line_end = _encoding(path)
    text = Dialect((), encoding=encoding, line_end=line_end)
    above, sample = _split_off_comments(_first_lines(path, text))
    if not sample and (names is not None or not above):
        raise InputError("is empty" if not above else "has no rows", source=path)
    if names is not None:
        lines = [line for _, line in sample]
        separator = _separator(lines, len(names))
        decimal = _decimal_commas(names, lines, separator)
        return replace(
            text,
            names=tuple(names),
            separator=separator,
            header_row=0,
            comments=True,
            decimal_commas=decimal,
        )
    excel = _EXCEL.fullmatch(sample[0][1].strip()) if len(sample) > 1 else None
    row, first = (sample[1:] if excel else sample or above[-1:])[0]
    lines = [first, *(line for number, line in sample if number > row)]
    separator = excel[1] if excel else _separator(lines)
    columns = _cells(path, row, lines, separator)
    if above and sample and columns and _looks_like_data(columns):
        row, columns = _names_above(above, len(columns), separator) or (row, columns)
    decimal = _decimal_commas(columns, lines, separator)
    return replace(
        text,
        names=tuple(columns),
        separator=separator,
        header_row=row,
        comments=bool(above),
        decimal_commas=decimal,
    )


def table_lines(path: Path, dialect: Dialect) -> Iterator[str]:
    """Yield a table's lines for a CSV reader: the names first, and an empty line for a comment.

    Without names in the file there is one line more than the file has.

    Raises
    ------
    InputError
        If a line is too long, or not text.
    OSError
        If the file cannot be read.
    """
    header = io.StringIO()
    csv.writer(header, delimiter=dialect.delimiter, lineterminator="\n").writerow(dialect.names)
    if dialect.header_row == 0:
        yield header.getvalue()
    for row, line in _lines(path, dialect):
        if row < dialect.header_row:
            yield "\n"
        elif row == dialect.header_row and (dialect.comments or dialect.separator == BLANKS):
            yield header.getvalue()
        elif dialect.comments and line.lstrip().startswith(_COMMENT):
            yield "\n"
        elif dialect.separator == BLANKS:
            yield "\t".join(line.split()) + "\n"
        else:
            yield line


def _encoding(path: Path) -> tuple[str, str]:
    """Return the encoding and the line end of a file's first bytes."""
    with open_regular(path) as file:
        start = file.read(2**16)
    encoding = _MARKS.get(start[:2], "utf-8")
    text = start.decode(encoding, "replace")
    return encoding, "\r" if "\r" in text and "\n" not in text else "\n"


def _lines(path: Path, dialect: Dialect) -> Iterator[tuple[int, str]]:
    """Yield number and text of a file's lines, without the mark at its start."""
    with open_regular(path) as file:
        plain = dialect.encoding == "utf-8" and dialect.line_end == "\n"
        source = file if plain else io.TextIOWrapper(file, dialect.encoding, newline=None)
        for row in count(1):
            try:
                line = source.readline(MAX_LINE_BYTES + 1)
                if isinstance(line, bytes) and len(line) <= MAX_LINE_BYTES:
                    line = line.decode()
            except UnicodeError as error:
                wanted = dialect.encoding.upper()
                got = ""
                if isinstance(error, UnicodeDecodeError):
                    got = f", got the byte 0x{error.object[error.start]:02x}"
                raise InputError(f"expected {wanted} text{got}", source=path, row=row) from error
            if not line:
                return
            if len(line) > MAX_LINE_BYTES or isinstance(line, bytes):
                problem = f"no line end within {MAX_LINE_BYTES:,} bytes: this is not a table"
                raise InputError(problem, source=path, row=row)
            yield row, line.removeprefix("\ufeff") if row == 1 else line


def _first_lines(path: Path, dialect: Dialect) -> Iterator[tuple[int, str]]:
    """Yield the lines that tell the rest."""
    n_characters = 0
    for row, line in islice(_lines(path, dialect), _SAMPLE_LINES):
        yield row, line
        n_characters += len(line)
        if n_characters > _SAMPLE_CHARACTERS:
            return


def _split_off_comments(
    lines: Iterator[tuple[int, str]],
) -> tuple[list[tuple[int, str]], list[tuple[int, str]]]:
    """Return the comments above a table and its first lines; blank lines are left out."""
    above: list[tuple[int, str]] = []
    for row, line in lines:
        if line.lstrip().startswith(_COMMENT):
            above.append((row, line))
        elif line.strip():
            rest = [(row, line)]
            for further in lines:
                if further[1].strip() and not further[1].lstrip().startswith(_COMMENT):
                    rest.append(further)
            return above, rest
    return above, []


def _separator(lines: Sequence[str], n_columns: int | None = None) -> str:
    """Return the separator that the first line has, and that gives most lines as many cells."""
    header = lines[0]
    candidates = [s for s in _SEPARATORS if len(_split(header, s)) > 1] or [BLANKS]
    commas = [cell for line in lines for cell in line.split() if "," in cell]
    if candidates == [","] and all(map(_WITH_COMMA.fullmatch, commas)) and header.split()[1:]:
        candidates = [BLANKS]  # all commas are those of numbers
    n_even = {}
    for separator in candidates:
        n = n_columns or len(_split(header, separator))
        n_even[separator] = sum(len(_split(line, separator)) == n for line in lines)
    best = max(candidates, key=lambda separator: n_even[separator])
    if best == BLANKS:
        enough = n_columns is not None or 2 * n_even[best] > len(lines)
        return BLANKS if enough and len(header.split()) > 1 else ","
    return best


def _split(line: str, separator: str) -> list[str]:
    """Return a line's cells as far as they can be told from one line."""
    if separator == BLANKS:
        return line.split()
    try:
        return next(csv.reader([line], delimiter=separator), [])
    except csv.Error:
        return line.split(separator)


def _cells(path: Path, row: int, lines: Sequence[str], separator: str) -> list[str]:
    """Return the cells of the first record, which may go over several lines."""
    if separator == BLANKS:
        return lines[0].split()
    try:
        return next(csv.reader(lines, delimiter=separator, strict=True))
    except csv.Error as error:
        problem = f"cannot be split into cells: {error}"
        raise InputError(problem, source=path, row=row) from error


def _looks_like_data(cells: Sequence[str]) -> bool:
    return bool(re.match(r"[+-]?[.,]?\d", cells[0].strip()))


def _names_above(
    above: Sequence[tuple[int, str]], n_columns: int, separator: str
) -> tuple[int, list[str]] | None:
    """Return the last comment that has a name for each column, and its row."""
    for row, line in reversed(above):
        text = line.strip().lstrip("#% ")
        for each in (separator, BLANKS, ","):
            names = [name.strip() for name in _split(text, each)]
            if n_columns == len(names) and not _looks_like_data(names):
                return row, names
    return None


def _decimal_commas(names: Sequence[str], lines: Sequence[str], separator: str) -> frozenset[str]:
    """Return the columns that hold numbers with a comma and none with a point."""
    if separator == ",":
        return frozenset()
    table = [_split(line, separator) for line in lines]
    found = set()
    for k, name in enumerate(names):
        cells = [row[k].strip() for row in table if k < len(row)]
        commas = any(_WITH_COMMA.fullmatch(cell) for cell in cells)
        if commas and not any(_WITH_POINT.fullmatch(cell) for cell in cells):
            found.add(name)
    return frozenset(found)
