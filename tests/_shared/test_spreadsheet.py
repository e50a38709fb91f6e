from __future__ import annotations

import csv
import io
import math

import pytest
from hypothesis import given, strategies as st

from gaia_uwb._shared.spreadsheet import csv_text


def cells(text: str) -> list[list[str]]:
    return list(csv.reader(io.StringIO(text, newline="")))


@pytest.mark.parametrize(
    "text",
    ["=cmd|'/c calc'!A0", "+1+cmd", "-2+3", "@SUM(A1)", "  =A1", "\uff1dA1", "\uff20f", "=", "-"],
)
def test_a_formula_is_told_to_be_text(text: str) -> None:
    (_, (cell, number)) = cells(csv_text(["id", "x"], [[text, -1.5]]))
    assert cell == f"'{text}"
    assert number == "-1.5"


@pytest.mark.parametrize("text", ["-12", "+7", "-1.5e-3", "nan", "cone-1", "a=b", "", "ä b"])
def test_what_is_no_formula_stays_as_it_is(text: str) -> None:
    assert cells(csv_text(["id", "x"], [[text, 1]]))[1] == [text, "1"]


@given(st.text(), st.floats(allow_nan=False))
def test_no_text_steers_a_screen_or_splits_a_cell(text: str, number: float) -> None:
    written = csv_text(["id", "x"], [[text, number]])
    assert all(c.isprintable() or c == "\n" for c in written)
    header, (cell, back) = cells(written)
    assert header == ["id", "x"]
    assert float(back) == number
    assert cell.lstrip()[:1] not in tuple("=+@\uff1d\uff0b\uff20") or float(cell) is not None


def test_what_is_unknown_is_an_empty_cell() -> None:
    assert csv_text(["a", "b", "c"], [[None, math.nan, math.inf]]) == "a,b,c\n,,inf\n"


def test_another_separator_of_cells_is_quoted() -> None:
    assert csv_text(["id", "x"], [["a;=1+1", 1]]) == 'id,x\n"a;=1+1",1\n'
