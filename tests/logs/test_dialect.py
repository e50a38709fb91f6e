from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings, strategies as st

from gaia_uwb._shared.errors import InputError
from gaia_uwb.logs._cells import Kind
from gaia_uwb.logs._dialect import sniff
from gaia_uwb.logs._table import Table, read_table

KINDS = {"t": Kind.NUMBER, "east": Kind.NUMBER, "who": Kind.TEXT}


def write(folder: Path, content: str | bytes, encoding: str = "utf-8") -> Path:
    path = folder / "log.csv"
    path.write_bytes(content if isinstance(content, bytes) else content.encode(encoding))
    return path


def rows_of(table: Table) -> list[tuple[float, float, str]]:
    who = [table.labels["who"][code] for code in table["who"]]
    return list(zip(table["t"].tolist(), table["east"].tolist(), who, strict=True))


ROWS = [(0.5, -1.25, "cone 1"), (1.0, 2.0, "b")]


@pytest.mark.parametrize(
    ("content", "encoding", "note"),
    [
        ("t;east;who\n0.5;-1.25;cone 1\n1;2.0;b\n", "utf-8", "semicolons between the columns"),
        ("t\teast\twho\n0.5\t-1.25\tcone 1\n1\t2.0\tb\n", "utf-8", "tabs between the columns"),
        (
            "t;east;who\r\n0,5;-1,25;cone 1\r\n1;2,0;b\r\n",
            "utf-8-sig",
            "semicolons between the columns and decimal commas",
        ),
        ('sep=;\nt;east;who\n0,5;-1,25;"cone 1"\n1,0;2,0;b', "utf-8", "semicolons"),
        ("# made by a logger\n# t,east,who\n\n0.5,-1.25,cone 1\n# half\n1,2,b\n", "utf-8", ""),
        ("t,east,who\n0.5,-1.25,cone 1\n1,2.0,b\n", "utf-16", ""),
        ("t\teast\twho\r\n0,5\t-1,25\tcone 1\r\n1\t2\tb\r\n", "utf-16", "tabs"),
        ("t,east,who\r0.5,-1.25,cone 1\r\r1,2.0,b\r", "utf-8", ""),
        ("\n\nt,east,who\n0.5,-1.25,cone 1\n1,2.0,b\n", "utf-8", ""),
    ],
)
def test_what_spreadsheets_and_loggers_write(
    tmp_path: Path, content: str, encoding: str, note: str
) -> None:
    path = write(tmp_path, content, encoding)
    table = read_table(path, KINDS)
    assert rows_of(table) == ROWS
    assert note in "".join(table.remarks)
    assert bool(note) == bool(table.remarks)


def test_any_number_of_blanks_and_a_name_in_a_comment(tmp_path: Path) -> None:
    path = write(tmp_path, "# by hand\n# t east  who\n 0.5   -1.25 a\n# x\n1\t2 b\nx 3 c\n")
    with pytest.raises(InputError, match=r"row 6, column t: expected a finite number, got 'x'"):
        read_table(path, KINDS)
    table = read_table(write(tmp_path, path.read_bytes().replace(b"\nx 3 c", b"")), KINDS)
    assert rows_of(table) == [(0.5, -1.25, "a"), (1.0, 2.0, "b")]
    assert table.remarks == ("log.csv: read with blanks between the columns",)
    assert str(table.error("is odd", index=1)) == f"{path}, row 5: is odd"


def test_a_first_name_with_its_comment_sign_is_the_same_name(tmp_path: Path) -> None:
    path = write(tmp_path, "#t [ns],x\n1,2\n3,4\n")
    for name in ("#t [ns]", "t [ns]"):
        assert read_table(path, {name: Kind.NUMBER})[name].tolist() == [1.0, 3.0]


def test_a_table_without_names_gets_them(tmp_path: Path) -> None:
    path = write(tmp_path, "% comment\n0.5 7\n1 8 \nx 9\n")
    dialect = sniff(path, ("t", "x"))
    with pytest.raises(InputError, match=r"row 4, column t: .* got 'x'"):
        read_table(path, {"t": Kind.NUMBER}, dialect=dialect)
    assert read_table(path, {"x": Kind.NUMBER}, dialect=dialect)["x"].tolist() == [7, 8, 9]
    with pytest.raises(InputError, match="has no rows"):
        sniff(write(tmp_path, "% comment\n"), ("t", "x"))


@pytest.mark.parametrize(
    ("rows", "got"),
    [
        ("1,5;1\n2.5;1\n", "'1,5'"),
        ("1.234,5;2\n", r"'1\.234,5'"),
        ("1,5;2\n" * 300 + "2.5;1\n", r"'2\.5'"),  # the first rows say commas
    ],
)
def test_commas_and_points_are_not_mixed(tmp_path: Path, rows: str, got: str) -> None:
    with pytest.raises(InputError, match=f"expected a finite number, got {got}"):
        read_table(write(tmp_path, f"t;x\n{rows}"), {"t": Kind.NUMBER})


def test_a_column_of_times_with_commas_does_not_spoil_points_elsewhere(tmp_path: Path) -> None:
    path = write(tmp_path, "t;version\n0,5;1.2\n1,5;1.2\n")
    assert read_table(path, {"t": Kind.NUMBER})["t"].tolist() == [0.5, 1.5]


def test_a_date_where_seconds_are_wanted_names_the_way_out(tmp_path: Path) -> None:
    path = write(tmp_path, "t,x\n2026/03/03 09:00:00,1\n")
    with pytest.raises(InputError, match=r"got '2026/03/03 09:00:00'; for dates, map the column"):
        read_table(path, {"t": Kind.NUMBER})


def test_what_an_optional_number_may_say_instead(tmp_path: Path) -> None:
    path = write(tmp_path, "t,p\n1,N/A\n2,null\n3,-7\n4,-\n5,\n")
    table = read_table(path, {"t": Kind.NUMBER, "p": Kind.OPTIONAL})
    np.testing.assert_array_equal(table["p"], [np.nan, np.nan, -7, np.nan, np.nan])


def test_some_rows_of_a_table_remember_their_place(tmp_path: Path) -> None:
    table = read_table(write(tmp_path, "t\n1\n2\n\n3\n"), {"t": Kind.NUMBER})
    some = table.take(table["t"] > 1).take(np.array([1]))
    assert some["t"].tolist() == [3]
    assert some.error("is odd", index=0).row == 5


def test_a_pipe_does_not_hang(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "log.csv")
    with pytest.raises(InputError, match="is not a regular file"):
        read_table(tmp_path / "log.csv", KINDS)


NUMBERS = st.floats(-1e6, 1e6).map(lambda number: round(number, 3))
WORDS = st.text("abcXYZ01-_", min_size=1, max_size=6)


@example([(0.0, 0.5, "0")], " ", True, "utf-8", "\n", "# made by us\n#")
@example([(0.0, 0.5, "0")], "\t", True, "utf-8", "\n", "# made by us\n#")
@settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    rows=st.lists(st.tuples(NUMBERS, NUMBERS, WORDS), min_size=1, max_size=8),
    separator=st.sampled_from([",", ";", "\t", " ", "   "]),
    comma=st.booleans(),
    encoding=st.sampled_from(["utf-8", "utf-8-sig", "utf-16"]),
    line_end=st.sampled_from(["\n", "\r\n", "\r"]),
    head=st.sampled_from(["", "# made by us\n", "# made by us\n#", "\n"]),
)
def test_whatever_the_dialect_the_table_is_the_same(
    tmp_path: Path,
    rows: list[tuple[float, float, str]],
    separator: str,
    comma: bool,
    encoding: str,
    line_end: str,
    head: str,
) -> None:
    lines = [separator.join(("t", "east", "who"))]
    for t, east, who in rows:
        numbers = [f"{t:.3f}", f"{east:.3f}"]
        if comma and separator != ",":
            numbers = [number.replace(".", ",") for number in numbers]
        lines.append(separator.join((*numbers, who)))
    text = (head + "\n".join(lines) + "\n").replace("\n", line_end)
    assert rows_of(read_table(write(tmp_path, text, encoding), KINDS)) == rows
