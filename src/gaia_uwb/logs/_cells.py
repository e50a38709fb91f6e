"""The cells of a CSV file, one by one: slow, and used only to find the wrong one.

Rows are counted as an editor counts lines: the header is row 1, blank lines and line breaks inside
quotes count.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Mapping
from enum import StrEnum
from itertools import count, islice
from math import isfinite
from pathlib import Path

from gaia_uwb._shared import InputError

_MAX_LINE_BYTES = 2**20
_NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")
_NO_NUMBER = re.compile(r"|[+-]?(nan|inf|infinity)", re.IGNORECASE)
_INTEGER = re.compile(r"[+-]?[0-9]{1,19}")


class Kind(StrEnum):
    """What a column holds; the value is its name in errors."""

    NUMBER = "a finite number"
    OPTIONAL = "a number or nothing"
    INTEGER = "an integer"
    TEXT = "text"
    FLAG = "true or false"

    def allows(self, cell: str) -> bool:
        """Tell whether a cell of a text file may stand in such a column; spaces around are fine."""
        cell = cell.strip()
        match self:
            case Kind.TEXT:
                return cell != ""
            case Kind.FLAG:
                return cell.lower() in {"true", "false", "1", "0"}
            case Kind.INTEGER:
                return bool(_INTEGER.fullmatch(cell)) and -(2**63) <= int(cell) < 2**63
            case Kind.OPTIONAL if _NO_NUMBER.fullmatch(cell):
                return True
        return bool(_NUMBER.fullmatch(cell)) and isfinite(float(cell))


def read_header(path: Path) -> list[str]:
    """Return the names in the first row.

    Raises
    ------
    InputError
        If the file is empty or its first row is not text.
    OSError
        If the file cannot be read.
    """
    for _, cells in _records(path):
        return cells
    raise InputError("is empty", source=path)


def find_wrong_cell(path: Path, kinds: Mapping[str, Kind], *, otherwise: str) -> InputError:
    """Return the error for the first cell that is not what its column must hold.

    Parameters
    ----------
    path
        A CSV file whose header has all the columns.
    kinds
        Column -> what it must hold.
    otherwise
        What to say if every cell is as it must be.
    """
    try:
        for row, cells, n_surplus in _wanted(path, list(kinds)):
            if n_surplus:
                return InputError(
                    f"has {n_surplus} more cells than the header", source=path, row=row
                )
            for (name, kind), cell in zip(kinds.items(), cells, strict=True):
                if not kind.allows(cell):
                    got = repr(cell[:40]) if cell else "an empty cell"
                    problem = f"expected {kind}, got {got}"
                    return InputError(problem, source=path, row=row, column=name)
    except InputError as error:  # the file cannot even be split into cells
        return error
    return InputError(f"cannot be read: {otherwise}", source=path)


def find_row(path: Path, names: list[str], index: int) -> int | None:
    """Return the row that holds record ``index`` (from 0), counting those with a wanted cell."""
    return next((row for row, _, _ in islice(_wanted(path, names), index, None)), None)


def _wanted(path: Path, names: list[str]) -> Iterator[tuple[int, list[str], int]]:
    """Yield row, wanted cells and number of surplus cells of each record that is not blank."""
    records = _records(path)
    _, header = next(records)
    places = [header.index(name) for name in names]
    for row, cells in records:
        wanted = [cells[place] if place < len(cells) else "" for place in places]
        if any(cell.strip() for cell in wanted):
            yield row, wanted, max(0, len(cells) - len(header))


def _records(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Yield each record's first row and cells; the header and blank lines are records too."""
    reader = csv.reader(_lines(path), strict=True)
    while True:
        row = reader.line_num + 1
        try:
            cells = next(reader)
        except StopIteration:
            return
        except csv.Error as error:
            problem = f"cannot be split into cells: {error}"
            raise InputError(problem, source=path, row=row) from error
        yield row, cells


def _lines(path: Path) -> Iterator[str]:
    try:
        opened = path.open("rb")
    except ValueError as error:
        raise InputError(f"is not a valid file name: {error}", source=path) from error
    with opened as file:
        for row in count(1):
            line = file.readline(_MAX_LINE_BYTES + 1)
            if not line:
                return
            if len(line) > _MAX_LINE_BYTES:
                problem = f"no line end within {_MAX_LINE_BYTES:,} bytes: this is not a table"
                raise InputError(problem, source=path, row=row)
            try:
                yield line.decode("utf-8-sig" if row == 1 else "utf-8")
            except UnicodeDecodeError as error:
                problem = f"expected UTF-8 text, got the byte 0x{error.object[error.start]:02x}"
                raise InputError(problem, source=path, row=row) from error
