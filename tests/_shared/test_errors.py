"""One base class, one line of text, and the place of the fault."""

from __future__ import annotations

from pathlib import Path

import pytest

from gaia_uwb._shared import errors


@pytest.mark.parametrize(
    "kind", [errors.ConfigError, errors.SourceError, errors.DownloadError, errors.InputError]
)
def test_one_base_class_catches_all(kind: type[errors.GaiaError]) -> None:
    with pytest.raises(errors.GaiaError, match=r"^what went wrong$"):
        raise kind("what went wrong")


@pytest.mark.parametrize(
    ("place", "text"),
    [
        ({}, "bad"),
        ({"source": Path("a.csv")}, "a.csv: bad"),
        ({"row": 3}, "row 3: bad"),
        ({"column": "t_s"}, "column t_s: bad"),
        ({"source": "a.csv", "row": 3, "column": "t_s"}, "a.csv, row 3, column t_s: bad"),
    ],
)
def test_input_error_says_where(place: dict, text: str) -> None:
    error = errors.InputError("bad", **place)
    assert str(error) == text
    assert error.problem == "bad"
    assert (error.source, error.row, error.column) == tuple(
        place.get(name) for name in ("source", "row", "column")
    )


def test_a_name_of_any_kind_leaves_one_line() -> None:
    error = errors.InputError("is wrong", source="a\nb\0", column="x" * 10_000, row=3)
    text = str(error)
    assert text.startswith("a\\nb\\x00, row 3, column xxx") and text.endswith("xxx: is wrong")
    assert text.isprintable() and len(text) < 500
    assert error.column == "x" * 10_000


@pytest.mark.parametrize("kind", [errors.ConfigError, errors.InputError])
def test_whatever_a_message_quotes_it_is_one_line(kind: type[errors.GaiaError]) -> None:
    error = kind("expected a name, got 'a\nb\x1b[2J" + "x" * 100_000 + "' here")
    text = str(error)
    assert text.startswith("expected a name, got 'a\\nb\\x1b[2Jxxx")
    assert text.endswith("xxx' here")
    assert text.isprintable()
    assert len(text) < 2000
