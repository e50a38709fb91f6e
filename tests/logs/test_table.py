from __future__ import annotations

import io
import os
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from gaia_uwb._shared.errors import InputError
from gaia_uwb.logs import _table
from gaia_uwb.logs._cells import Kind
from gaia_uwb.logs._table import Table, read_table

KINDS = {"t": Kind.NUMBER, "id": Kind.TEXT}
OPTIONAL = {"rssi": Kind.OPTIONAL, "stamp": Kind.INTEGER, "los": Kind.FLAG}


def read(tmp_path: Path, content: bytes) -> Table:
    path = tmp_path / "log.csv"
    path.write_bytes(content)
    return read_table(path, KINDS, OPTIONAL)


def ids(table: Table) -> list[str]:
    return [table.labels["id"][code] for code in table["id"]]


@pytest.mark.parametrize(
    "content",
    [
        b"t,id\n1,a\n2.5,12\n",
        b"t,id\r\n1,a\r\n2.5,12\r\n",
        b"\xef\xbb\xbft,id\n1,a\n2.5,12\n",
        b't,id\n1,"a"\n"2.5","12"',
        b"id,t\na,1.\n\n\n12,+.25e1\n   ,\n",
        b"other,t,id\nx,1,a\n,2.5,12\n,,\n",
        b"t,id\n 1, a\n2.5\t,12 \n",
    ],
    ids=["plain", "windows", "byte order mark", "quotes", "blank lines", "others", "spaces"],
)
def test_reads_what_spreadsheets_write(tmp_path: Path, content: bytes) -> None:
    table = read(tmp_path, content)
    np.testing.assert_array_equal(table["t"], [1.0, 2.5])
    assert ids(table) == ["a", "12"]


def test_a_small_file_of_millions_of_equal_rows_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "bomb.parquet"
    n = 3_000_000
    frame = pl.select(t=pl.repeat(1.0, n), id=pl.repeat("a", n))
    frame.write_parquet(path, compression="zstd")
    assert path.stat().st_size < 100_000
    with pytest.raises(InputError, match="declares 3,000,000 rows, more than a file of its size"):
        read_table(path, {"t": Kind.NUMBER, "id": Kind.TEXT})


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_spaces_around_a_text_do_not_make_it_another(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"table{suffix}"
    frame = pl.DataFrame({"t": [1.0, 2.0, 3.0, 4.0], "id": ["a b", " a b", "a b ", "\ta b"]})
    frame.write_csv(path) if suffix == ".csv" else frame.write_parquet(path)
    assert read_table(path, KINDS).labels["id"] == ("a b",)


def test_each_kind_gets_its_type(tmp_path: Path) -> None:
    table = read(
        tmp_path,
        b"t,id,rssi,stamp,los,x\n"
        b'1,b,-80.5,1730017526478717088,true,0\n2,a,-inf,-1,0,0\n3,b,"",0,FALSE,0\n4,b,nan,7,1,0\n',
    )
    np.testing.assert_array_equal(table["rssi"], [-80.5, np.nan, np.nan, np.nan])
    np.testing.assert_array_equal(table["stamp"], [1730017526478717088, -1, 0, 7])
    assert table["los"].tolist() == [True, False, False, True]
    assert ids(table) == ["b", "a", "b", "b"]
    assert [table[name].dtype for name in ("t", "id", "rssi", "stamp", "los")] == [
        np.float64,
        np.int64,
        np.float64,
        np.int64,
        np.bool_,
    ]
    assert table.unknown == ("x",)
    assert len(table) == 4
    assert "los" in table
    assert table.get("nothing") is None


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "log.csv: is empty"),
        (b"t,id\n", "log.csv: has a header but no rows"),
        (b"t,id\n\n,\n", "log.csv: has a header but no rows"),
        (b"t,name\n1,a\n", "log.csv, column id: missing; found 't', 'name'"),
        (b"t,idd\n1,a\n", "column id: missing; found 't', 'idd'; is 'idd' this column?"),
        (b"\n1,a\n", "column t: missing; found '1', 'a'"),
        (b"t;name\n1;a\n", "column id: missing; found 't', 'name', with semicolons between them"),
        (b"t,id,t\n1,a,2\n", "row 1, column t: appears twice in the header"),
        (b"t,id\n1,a\n\nx,b\n", "row 4, column t: expected a finite number, got 'x'"),
        (b"t,id\n1,a\n,b\n", "row 3, column t: expected a finite number, got an empty cell"),
        (b"t,id\n1,a\nnan,b\n", "row 3, column t: expected a finite number, got 'nan'"),
        (b"t,id\n1,a\n-inf,b\n", "row 3, column t: expected a finite number, got '-inf'"),
        (b"t,id\n1,a\n1e999,b\n", "row 3, column t: expected a finite number, got '1e999'"),
        (b't,id\n1,a\n"1,5",b\n', "row 3, column t: expected a finite number, got '1,5'"),
        (b"t,id\n1,\n", "row 2, column id: expected text, got an empty cell"),
        (b"t,id\n1, \n", "row 2, column id: expected text, got ' '"),
        (b"t,id\n1\n", "row 2, column id: expected text, got an empty cell"),
        (b"t,id\n1,a,2,3\n", "row 2: has 2 more cells than the header"),
        (b't,id\n1,"a\nb"\nx,c\n', "row 4, column t: expected a finite number, got 'x'"),
        (b't,id\n1,"a\n2,b\n', "row 2: cannot be split into cells: unexpected end of data"),
        (b"t,id\n1,a\n2,\xff\n", "row 3: expected UTF-8 text, got the byte 0xff"),
        (b"\xff\xfet\x00,\x00i", "row 1: expected UTF-16 text"),
        (b"t,id,stamp\n1,a,1.5\n", "row 2, column stamp: expected an integer, got '1.5'"),
        (b"t,id,stamp\n1,a,9223372036854775808\n", "column stamp: expected an integer"),
        (b"t,id,los\n1,a,maybe\n", "row 2, column los: expected true or false, got 'maybe'"),
        (b"t,id,rssi\n1,a,-8O\n", "row 2, column rssi: expected a number or nothing, got '-8O'"),
    ],
)
def test_names_what_is_wrong_and_where(tmp_path: Path, content: bytes, message: str) -> None:
    with pytest.raises(InputError) as caught:
        read(tmp_path, content)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_an_endless_line_is_no_table(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="row 1: no line end within 1,048,576 bytes"):
        read(tmp_path, b"t,id" * 300_000)


def test_an_endless_line_in_a_huge_file_is_not_read(tmp_path: Path) -> None:
    """2 GiB of nothing below a header: a sparse file, which costs no disk."""
    path = tmp_path / "log.csv"
    path.write_bytes(b"t,id\n1,a\n")
    os.truncate(path, 2**31)
    with pytest.raises(InputError, match="row 3: no line end within 1,048,576 bytes"):
        read_table(path, KINDS)


def test_too_many_rows_are_refused_unread(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_table, "MAX_ROWS", 3)
    monkeypatch.setattr(_table, "_CHUNK_BYTES", 8)
    assert len(read(tmp_path, b"t,id\n1,a\n2,a\n3,a\n")) == 3
    with pytest.raises(InputError, match="has 4 rows, but at most 3 are read at once"):
        read(tmp_path, b"t,id\n1,a\n2,a\n3,a\n4,a\n")
    path = tmp_path / "log.parquet"
    pl.DataFrame({"t": [0.0] * 4, "id": ["a"] * 4}).write_parquet(path)
    with pytest.raises(InputError, match="has 4 rows"):
        read_table(path, KINDS)


def test_a_file_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none\.csv: cannot be read: No such file"):
        read_table(tmp_path / "none.csv", KINDS)
    (tmp_path / "folder.csv").mkdir()
    with pytest.raises(InputError, match="cannot be read: it is not a regular file"):
        read_table(tmp_path / "folder.csv", KINDS)


def test_a_pipe_is_refused_and_does_not_hang(tmp_path: Path) -> None:
    for name in ("log.csv", "log.parquet"):
        os.mkfifo(tmp_path / name)
        with pytest.raises(InputError, match="it is not a regular file"):
            read_table(tmp_path / name, KINDS)


def test_a_file_may_have_any_name(tmp_path: Path) -> None:
    for name in (b"\xff.csv", b"[ab]*.csv", b"\xff.parquet"):
        path = tmp_path / os.fsdecode(name)
        frame = pl.DataFrame({"t": [1.5], "id": ["a"]})
        content = io.BytesIO()
        if path.suffix == ".csv":
            frame.write_csv(content)
        else:
            frame.write_parquet(content)
        path.write_bytes(content.getvalue())
        assert read_table(path, KINDS)["t"].tolist() == [1.5]


def test_error_names_the_row_of_the_file(tmp_path: Path) -> None:
    table = read(tmp_path, b't,id\n\n1,"a\nb"\n,\n2,c\n')
    assert str(table.error("no", index=1, column="t")).endswith("log.csv, row 6, column t: no")


def test_parquet(tmp_path: Path) -> None:
    path = tmp_path / "log.parquet"
    frame = pl.DataFrame(
        {
            "t": pl.Series([1, 2], dtype=pl.Int32),
            "id": pl.Series([12, 3], dtype=pl.Int64),
            "rssi": [None, float("-inf")],
            "los": [True, False],
            "more": ["x", "y"],
        }
    )
    frame.write_parquet(path)
    table = read_table(path, KINDS, OPTIONAL)
    np.testing.assert_array_equal(table["t"], [1.0, 2.0])
    assert ids(table) == ["12", "3"]
    assert np.isnan(table["rssi"]).all()
    assert table["los"].tolist() == [True, False]
    assert table.unknown == ("more",)
    assert "row 2" in str(table.error("no", index=1))


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ({"t": ["1"], "id": ["a"]}, "column t: expected a type that holds a finite number, got S"),
        ({"t": [1.0], "id": [1.5]}, "column id: expected a type that holds text, got Float64"),
        ({"t": [1.0], "id": ["a"], "los": [1]}, "column los: expected a type that holds true or"),
        ({"t": [1.0], "id": ["a"], "stamp": [0.5]}, "column stamp: expected a type that holds an"),
        ({"t": [1.0, None], "id": ["a", "b"]}, "row 2, column t: expected a finite number, got no"),
        ({"t": [float("nan")], "id": ["a"]}, "row 1, column t: expected a finite number, got nan"),
        ({"t": [1.0], "id": [""]}, "row 1, column id: expected text, got nothing"),
        ({"t": [], "id": []}, "column t: expected a type that holds a finite number, got Null"),
        ({"t": [1.0]}, "column id: missing; found 't'"),
    ],
)
def test_parquet_names_what_is_wrong(
    tmp_path: Path, columns: dict[str, list[object]], message: str
) -> None:
    path = tmp_path / "log.parquet"
    pl.DataFrame(columns).write_parquet(path)
    with pytest.raises(InputError) as caught:
        read_table(path, KINDS, OPTIONAL)
    assert message in str(caught.value)


@pytest.mark.parametrize(
    "content", [b"", b"PAR1", b"t,id\n1,a\n", b"PAR1" + b"\x07" * 99 + b"PAR1"]
)
def test_a_broken_parquet_file(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "log.parquet"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"log\.parquet: cannot be read: "):
        read_table(path, KINDS)
