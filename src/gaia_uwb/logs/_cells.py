"""The cells of a CSV file, one by one: slow, and used only to find the wrong one.

Rows are counted as an editor counts lines: the header is row 1, blank lines and line breaks inside
quotes count.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Mapping
from enum import StrEnum
from itertools import islice
from math import isfinite
from pathlib import Path

from gaia_uwb._shared import InputError
from gaia_uwb.logs._dialect import Dialect, table_lines

_NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")
NOTHING = ("nan", "na", "n/a", "null", "none", "-", "--")
"""What tables hold where there is no number, in small letters; an empty cell is the rule."""
_NO_NUMBER = re.compile(rf"|[+-]?(inf|infinity|nan)|{'|'.join(NOTHING)}", re.IGNORECASE)
_DATE = re.compile(r"\d{1,4}[-/.]\d{1,2}[-/.]\d{1,4}(?!\d)|\d{1,2}:\d\d:", re.ASCII)
_INTEGER = re.compile(r"[+-]?[0-9]{1,19}")


class Kind(StrEnum):
    """What a column holds; the value is its name in errors."""

    NUMBER = "a finite number"
    OPTIONAL = "a number or nothing"
    INTEGER = "an integer"
    TEXT = "text"
    ANYTHING = "text or nothing"
    FLAG = "true or false"

    def allows(self, cell: str) -> bool:
        """Tell whether a cell of a text file may stand in such a column; spaces around are fine."""
        cell = cell.strip()
        match self:
            case Kind.TEXT:
                return cell != ""
            case Kind.ANYTHING:
                return True
            case Kind.FLAG:
                return cell.lower() in {"true", "false", "1", "0"}
            case Kind.INTEGER:
                return bool(_INTEGER.fullmatch(cell)) and -(2**63) <= int(cell) < 2**63
            case Kind.OPTIONAL if _NO_NUMBER.fullmatch(cell):
                return True
        return bool(_NUMBER.fullmatch(cell)) and isfinite(float(cell))


def find_wrong_cell(
    path: Path, dialect: Dialect, kinds: Mapping[str, Kind], *, otherwise: str
) -> InputError:
    """Return the error for the first cell that is not what its column must hold.

    Parameters
    ----------
    path, dialect
        A text file, and how it holds a table that has all the columns.
    kinds
        Column -> what it must hold.
    otherwise
        What to say if every cell is as it must be.
    """
    try:
        for row, cells, n_surplus in _wanted(path, dialect, list(kinds)):
            if n_surplus:
                return InputError(
                    f"has {n_surplus} more cells than the header", source=path, row=row
                )
            for (name, kind), cell in zip(kinds.items(), cells, strict=True):
                if not kind.allows(_with_point(cell, name, dialect)):
                    got = repr(cell[:40]) if cell else "an empty cell"
                    problem = f"expected {kind}, got {got}{_way_out(cell, kind)}"
                    return InputError(problem, source=path, row=row, column=name)
    except InputError as error:  # the file cannot even be split into cells
        return error
    return InputError(f"cannot be read: {otherwise}", source=path)


def find_row(path: Path, dialect: Dialect, names: list[str], index: int) -> int | None:
    """Return the row that holds record ``index`` (from 0), counting those with a wanted cell."""
    return next((row for row, _, _ in islice(_wanted(path, dialect, names), index, None)), None)


def first_cell(path: Path, dialect: Dialect, name: str) -> str:
    """Return a column's first cell that is not blank, ``""`` if there is none."""
    return next((cells[0].strip() for _, cells, _ in _wanted(path, dialect, [name])), "")


def is_date(cell: str) -> bool:
    """Tell whether a cell holds a date or a time of day rather than a number."""
    return bool(_DATE.match(cell))


def _with_point(cell: str, name: str, dialect: Dialect) -> str:
    """Return a cell with a decimal point for its decimal comma, where its column has commas."""
    return cell.replace(".", "?").replace(",", ".") if name in dialect.decimal_commas else cell


def _way_out(cell: str, kind: Kind) -> str:
    """Return what to do about a date where a number is expected."""
    if kind is not Kind.NUMBER or not is_date(cell.strip()):
        return ""
    return "; for dates, map the column in gaia.yaml: t_s: {column: NAME, iso: true}"


def _wanted(path: Path, dialect: Dialect, names: list[str]) -> Iterator[tuple[int, list[str], int]]:
    """Yield row, wanted cells and number of surplus cells of each record that is not blank."""
    places = [dialect.names.index(name) for name in names]
    for row, cells in _records(path, dialect):
        wanted = [cells[place] if place < len(cells) else "" for place in places]
        if row > dialect.header_row and any(cell.strip() for cell in wanted):
            yield row, wanted, max(0, len(cells) - len(dialect.names))


def _records(path: Path, dialect: Dialect) -> Iterator[tuple[int, list[str]]]:
    """Yield each record's first row and cells; the header and blank lines are records too."""
    reader = csv.reader(table_lines(path, dialect), delimiter=dialect.delimiter, strict=True)
    while True:
        row = reader.line_num + bool(dialect.header_row)
        try:
            cells = next(reader)
        except StopIteration:
            return
        except csv.Error as error:
            problem = f"cannot be split into cells: {error}"
            raise InputError(problem, source=path, row=row) from error
        yield row, cells
