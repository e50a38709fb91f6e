"""Tables on disk (CSV, Parquet), read strictly: an error names the file, the row and the column.

A good file is read once, by polars, with the types that are wanted. Only when that fails, or finds
a value that is not allowed, ``_cells.py`` walks through the text to name the first wrong cell.

Memory stays bounded whatever the size of a file: only wanted columns are read, and a table of more
than :data:`MAX_ROWS` rows is refused before it is read.
"""

from __future__ import annotations

import difflib
import os
import sys
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from gaia_uwb._shared import Array, InputError, Int64, open_regular
from gaia_uwb.logs._cells import NOTHING, Kind, find_row, find_wrong_cell, first_cell, is_date
from gaia_uwb.logs._dialect import SEPARATOR_WORDS, Dialect, sniff, table_lines

MAX_ROWS = 16_000_000
"""Most rows of one table; reading so many ranges takes about 2 GiB of memory."""

_CHUNK_BYTES = 16 * 2**20
_STDERR = 2
_TEXTS = (Kind.TEXT, Kind.ANYTHING)
_FEW_ROWS = 1_000_000  # of more, times and ranges that differ take a byte a row at the very least


@dataclass(frozen=True)
class Table:
    """The wanted columns of a table.

    Parameters
    ----------
    path
        The file.
    columns
        Column -> values: float64 for numbers (NaN for nothing), int64 for integers, bool for flags.
        A text column holds int64 indices into its ``labels``.
    labels
        Text column -> its distinct texts, without spaces around them, sorted.
    unknown
        Names of the columns that were not asked for.
    dialect
        How the file holds the table; ``None`` for Parquet.
    kept : (R,)
        Which of the file's rows the values are of, from 0; ``None`` if all are there.
    remarks
        What a user should know of how the file was read, and what was left out.
    """

    path: Path
    columns: Mapping[str, Array]
    labels: Mapping[str, tuple[str, ...]]
    unknown: tuple[str, ...]
    dialect: Dialect | None = None
    kept: Int64[Array, "R"] | None = None
    remarks: tuple[str, ...] = ()

    def __contains__(self, name: str) -> bool:
        return name in self.columns

    def __getitem__(self, name: str) -> Array:
        return self.columns[name]

    def get(self, name: str) -> Array | None:
        """Return a column's values, or ``None`` if the table lacks it."""
        return self.columns.get(name)

    def __len__(self) -> int:
        return len(next(iter(self.columns.values())))

    def take(self, rows: Array) -> Table:
        """Return the table of some rows, named by index or by a mask."""
        columns = {name: values[rows] for name, values in self.columns.items()}
        kept = np.arange(len(self), dtype=np.int64) if self.kept is None else self.kept
        return replace(self, columns=columns, kept=kept[rows])

    def error(
        self, problem: str, *, index: int | None = None, column: str | None = None
    ) -> InputError:
        """Return the error that names the row of values ``index`` as the file's reader sees it."""
        row: int | None = None
        if index is not None:
            index = index if self.kept is None else int(self.kept[index])
            dialect, row = self.dialect, index + 1
            if dialect is not None:
                names = [name for name in self.columns if name in dialect.names]
                row = find_row(self.path, dialect, names, index)
        return InputError(problem, source=self.path, row=row, column=column)


def read_table(
    path: Path,
    required: Mapping[str, Kind],
    optional: Mapping[str, Kind] | None = None,
    dialect: Dialect | None = None,
) -> Table:
    """Read the columns of a CSV or Parquet file (recognised by the name's ending).

    Parameters
    ----------
    path
        The file.
    required
        Columns that must be there, and what they hold.
    optional
        Columns that are read if they are there.
    dialect
        How a text file holds the table; ``None`` finds out.

    Raises
    ------
    InputError
        If the file cannot be read, is empty or too long, lacks a column or has it twice, or a cell
        does not hold what its column must hold.
    """
    import polars as pl

    known = {**required, **(optional or {})}
    with read_errors(path):
        if dialect is None and not _is_parquet(path):
            dialect = _as_wanted(sniff(path), known)
        header = list(_parquet_schema(path) if dialect is None else dialect.names)
    _check_names(path, header, required, known, dialect)
    kinds = {name: kind for name, kind in known.items() if name in header}
    with read_errors(path):
        frame = _read_parquet(path, kinds) if dialect is None else _read_csv(path, dialect, kinds)
    if not len(frame):
        raise InputError("has a header but no rows", source=path)
    nothing = [name for name, kind in kinds.items() if kind is Kind.ANYTHING]
    frame = frame.with_columns(pl.col(nothing).fill_null("")) if nothing else frame
    labels = {
        name: tuple(frame[name].unique().sort()) for name, kind in kinds.items() if kind in _TEXTS
    }
    columns = {
        name: _to_array(frame[name], kind, labels.get(name, ())) for name, kind in kinds.items()
    }
    unknown = tuple(name for name in header if name not in known)
    remarks = () if dialect is None else tuple(dialect.notes(path))
    return Table(path, columns, labels, unknown, dialect, remarks=remarks)


def read_names(path: Path) -> list[str]:
    """Return the names of a table's columns.

    Raises
    ------
    InputError
        If the file cannot be read or is empty.
    """
    with read_errors(path):
        return list(_parquet_schema(path) if _is_parquet(path) else sniff(path).names)


def holds_dates(path: Path, name: str) -> bool:
    """Tell whether a column's first value is a date, not a number.

    Raises
    ------
    InputError
        If the file cannot be read.
    """
    import polars as pl

    with read_errors(path):
        if _is_parquet(path):
            return _parquet_schema(path)[name] in (pl.String, pl.Datetime)
        return is_date(first_cell(path, sniff(path), name))


def _as_wanted(dialect: Dialect, known: Mapping[str, Kind]) -> Dialect:
    """Return a dialect whose first name is as it is wanted, with the ``#`` before it or without."""
    if not dialect.comments or not dialect.names or dialect.names[0] in known:
        return dialect
    bare = dialect.names[0].lstrip("#% ")
    first = next((name for name in known if name.lstrip("#% ") == bare), dialect.names[0])
    return replace(dialect, names=(first, *dialect.names[1:]))


def _check_names(
    path: Path,
    header: list[str],
    required: Mapping[str, Kind],
    known: Mapping[str, Kind],
    dialect: Dialect | None,
) -> None:
    """Refuse a table that lacks a column or has one twice."""
    for name in required:
        if name not in header:
            found = f"found {', '.join(map(repr, header))}" if any(header) else "found no header"
            if dialect is not None and dialect.separator != ",":
                found += f", with {SEPARATOR_WORDS.get(dialect.separator)} between them"
            near = difflib.get_close_matches(name, [h for h in header if h not in known], n=1)
            hint = f"; is {near[0]!r} this column?" if near else ""
            raise InputError(f"missing; {found[:200]}{hint}", source=path, column=name)
    for name in known:
        if header.count(name) > 1:
            raise InputError("appears twice in the header", source=path, row=1, column=name)


def _read_csv(path: Path, dialect: Dialect, kinds: Mapping[str, Kind]) -> Any:
    """Return the polars frame of the wanted columns, without blank rows; flags are still texts."""
    with _plain_text(path, dialect) as plain:
        try:
            try:
                frame = _collect(plain, dialect, kinds, nothing=())
            except InputError:  # rare, and slower to read
                frame = _collect(plain, dialect, kinds, nothing=NOTHING)
        except InputError as error:
            raise find_wrong_cell(path, dialect, kinds, otherwise=error.problem) from error
    if _first_refused(frame, kinds):
        raise find_wrong_cell(path, dialect, kinds, otherwise="a cell cannot be parsed")
    return frame


@contextmanager
def _plain_text(path: Path, dialect: Dialect) -> Iterator[Path]:
    """Give the table as a file that polars' CSV reader understands: UTF-8, the names first."""
    if dialect.is_plain:
        _check_length(path)
        yield path
        return
    with tempfile.NamedTemporaryFile("w", suffix=".csv", encoding="utf-8", newline="") as file:
        for row, line in enumerate(table_lines(path, dialect)):
            if line.strip():
                file.write(line)
            if row > MAX_ROWS:
                _check_n_rows(path, row)
        file.flush()
        yield Path(file.name)


def _collect(
    path: Path, dialect: Dialect, kinds: Mapping[str, Kind], nothing: tuple[str, ...]
) -> Any:
    """Return the frame of the wanted columns; words that mean nothing are null where allowed."""
    import polars as pl

    values = {}
    for name, dtype in _polars_types(kinds).items():
        stripped = pl.col(name).str.strip_chars()
        if nothing and kinds[name] is Kind.OPTIONAL:
            is_nothing = stripped.str.to_lowercase().is_in(list(nothing))
            stripped = pl.when(~is_nothing).then(stripped)
        if name in dialect.decimal_commas and dtype == pl.Float64:
            stripped = stripped.str.replace_all(".", "?", literal=True)
            stripped = stripped.str.replace_all(",", ".", literal=True)
        # Cast here, chunk by chunk, and not by polars' CSV reader: that one panics on a cell that
        # is a single quote, with a stack trace on stderr.
        values[name] = pl.when(stripped != "").then(stripped).cast(dtype)
    # polars gets the open file: names that are not UTF-8, or that hold an asterisk, upset it.
    with read_errors(path), open_regular(path) as file:
        scan = pl.scan_csv(file, separator=dialect.delimiter, infer_schema=False).select(**values)
        return scan.filter(~pl.all_horizontal(pl.all().is_null())).collect(engine="streaming")


def _check_length(path: Path) -> None:
    """Refuse a text file with too many rows; a small file is not even opened."""
    if path.stat().st_size <= _CHUNK_BYTES:
        return
    n_rows = 0
    with open_regular(path) as file:
        while chunk := file.read(_CHUNK_BYTES):
            n_lines = chunk.count(b"\n")
            if not n_lines and len(chunk) == _CHUNK_BYTES:
                problem = f"no line end within {_CHUNK_BYTES:,} bytes: this is not a table"
                raise InputError(problem, source=path, row=n_rows + 1)
            n_rows += n_lines
    _check_n_rows(path, n_rows - 1)  # without the header


def _check_n_rows(path: Path, n_rows: int) -> None:
    if n_rows > MAX_ROWS:
        problem = f"has {n_rows:,} rows, but at most {MAX_ROWS:,} are read at once: split the log"
        raise InputError(problem, source=path)


def _read_parquet(path: Path, kinds: Mapping[str, Kind]) -> Any:
    """Return the polars frame of the wanted columns; flags are still texts."""
    import polars as pl

    schema = _parquet_schema(path)
    for name, kind in kinds.items():
        if not _fits(schema[name], kind):
            problem = f"expected a type that holds {kind}, got {schema[name]}"
            raise InputError(problem, source=path, column=name)
    casts = [
        pl.col(name).cast(dtype).str.strip_chars()
        if kinds[name] in _TEXTS
        else pl.col(name).cast(dtype)
        for name, dtype in _polars_types(kinds).items()
    ]
    with open_regular(path) as file:
        scan = pl.scan_parquet(file)
        n_rows = int(scan.select(pl.len()).collect().item())
        _check_n_rows(path, n_rows)
        if n_rows > _FEW_ROWS + path.stat().st_size:
            raise InputError(
                f"declares {n_rows:,} rows, more than a file of its size can hold", source=path
            )
        frame = scan.select(casts).collect(engine="streaming")
    if refused := _first_refused(frame, kinds):
        name, index = refused
        value = frame[name][index]
        problem = f"expected {kinds[name]}, got {'nothing' if value in (None, '') else value}"
        raise InputError(problem, source=path, row=index + 1, column=name)
    return frame


def _is_parquet(path: Path) -> bool:
    return path.suffix == ".parquet"


def _parquet_schema(path: Path) -> dict[str, Any]:
    import polars as pl

    with open_regular(path) as file:
        return dict(pl.read_parquet_schema(file))


def _fits(dtype: Any, kind: Kind) -> bool:
    """Tell whether a Parquet column of this type can hold what is wanted."""
    import polars as pl

    match kind:
        case Kind.FLAG:
            return bool(dtype == pl.Boolean)
        case Kind.INTEGER:
            return bool(dtype.is_integer())
        case Kind.TEXT:
            texts = (pl.String, pl.Categorical, pl.Enum, pl.Datetime, pl.Date)
            return bool(dtype.is_integer() or dtype in texts)
        case Kind.ANYTHING:
            return not dtype.is_nested() and dtype != pl.Binary
    return bool(dtype.is_numeric())


def _polars_types(kinds: Mapping[str, Kind]) -> dict[str, Any]:
    import polars as pl

    types = {Kind.NUMBER: pl.Float64, Kind.OPTIONAL: pl.Float64, Kind.INTEGER: pl.Int64}
    return {name: types.get(kind, pl.String) for name, kind in kinds.items()}


@contextmanager
def read_errors(path: Path) -> Iterator[None]:
    """Turn the system's and polars' many-lined errors into one line of ours.

    Parameters
    ----------
    path
        What is read.

    Raises
    ------
    InputError
        If it cannot be read.
    """
    import polars as pl

    try:
        with _quiet():
            yield
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror or error}", source=path) from error
    except pl.exceptions.PanicException as error:
        raise InputError("cannot be read: it is corrupt", source=path) from error
    except pl.exceptions.PolarsError as error:
        reason = " ".join(str(error).split())[:200]
        raise InputError(f"cannot be read: {reason}", source=path) from error


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep libraries off stderr: where a damaged file makes polars panic, it prints a trace."""
    try:
        sys.stderr.flush()
        kept = os.dup(_STDERR)
    except (OSError, ValueError, AttributeError):  # nobody listens
        yield
        return
    try:
        with Path(os.devnull).open("wb") as nowhere:
            os.dup2(nowhere.fileno(), _STDERR)
        yield
    finally:
        os.dup2(kept, _STDERR)
        os.close(kept)


def _first_refused(frame: Any, kinds: Mapping[str, Kind]) -> tuple[str, int] | None:
    """Return column and index of a value that its column must not hold, if there is one."""
    import polars as pl

    for name, kind in kinds.items():
        column = pl.col(name)
        match kind:
            case Kind.NUMBER:
                refused = ~column.is_finite()
            case Kind.TEXT:
                refused = column.str.strip_chars() == ""
            case Kind.FLAG:
                refused = ~column.str.to_lowercase().is_in(["true", "false", "1", "0"])
            case Kind.INTEGER:
                refused = pl.lit(value=False)
            case Kind.OPTIONAL | Kind.ANYTHING:
                continue
        index = frame.select((column.is_null() | refused).arg_true().first()).item()
        if index is not None:
            return name, int(index)
    return None


def _to_array(column: Any, kind: Kind, labels: tuple[str, ...]) -> Array:
    """Return a checked column's values (of a text: the index into its labels)."""
    import polars as pl

    match kind:
        case Kind.TEXT | Kind.ANYTHING:
            values = column.cast(pl.Enum(labels)).to_physical().cast(pl.Int64).to_numpy()
        case Kind.FLAG:
            values = column.str.to_lowercase().is_in(["true", "1"]).to_numpy()
        case Kind.OPTIONAL:
            values = np.nan_to_num(column.to_numpy(), nan=np.nan, posinf=np.nan, neginf=np.nan)
        case _:
            values = column.to_numpy()
    return np.asarray(values)
