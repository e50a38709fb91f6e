from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given, strategies as st

from gaia_uwb._shared.errors import InputError
from gaia_uwb.logs._cells import Kind, find_row, find_wrong_cell
from gaia_uwb.logs._dialect import sniff


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_every_finite_number_is_one(number: float) -> None:
    assert Kind.NUMBER.allows(repr(number))
    assert Kind.OPTIONAL.allows(f" {number:+.17e} ")


@given(st.integers(-(2**63), 2**63 - 1))
def test_every_64_bit_integer_is_one(number: int) -> None:
    assert Kind.INTEGER.allows(str(number))


@pytest.mark.parametrize(
    ("kind", "cells"),
    [
        (Kind.NUMBER, ["", "-", "1,5", "1 5", "1_000", "0x1f", "nan", "inf", "1e999", "١"]),
        (Kind.OPTIONAL, ["nine", "1.2.3", "---", "infinite"]),
        (Kind.INTEGER, ["", "1.0", "1e3", "9223372036854775808", "1" * 5000]),
        (Kind.TEXT, ["", "  ", "\t"]),
        (Kind.FLAG, ["", "yes", "2", "NLOS"]),
    ],
)
def test_what_is_not_allowed(kind: Kind, cells: list[str]) -> None:
    assert not any(kind.allows(cell) for cell in cells)


def test_no_number_is_allowed_where_there_may_be_none() -> None:
    assert all(Kind.OPTIONAL.allows(cell) for cell in ("", " ", "nan", "-inf", "Infinity", "-80"))
    assert all(Kind.OPTIONAL.allows(cell) for cell in ("NA", "n/a", "null", "None", "-"))


def test_the_first_wrong_cell_of_several_is_told(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("a,b,c\n1,,x\n\n2,nan,y\n3,+,z\nw,+,z\n")
    kinds = {"a": Kind.NUMBER, "b": Kind.OPTIONAL}
    dialect = sniff(path)
    error = find_wrong_cell(path, dialect, kinds, otherwise="unreadable")
    assert (error.row, error.column) == (5, "b")
    assert [find_row(path, dialect, ["a"], k) for k in range(5)] == [2, 4, 5, 6, None]


def test_what_only_polars_refuses_is_told_too(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("a\n1\n")
    error = find_wrong_cell(path, sniff(path), {"a": Kind.NUMBER}, otherwise="unreadable")
    assert isinstance(error, InputError)
    assert str(error) == f"{path}: cannot be read: unreadable"
