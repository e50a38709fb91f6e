"""Checks and read-only storage: what is refused, what is copied, what is shared."""

from __future__ import annotations

import re
from types import SimpleNamespace

import numpy as np
import pytest

from gaia_uwb._shared.checks import (
    check_finite,
    check_heights,
    check_ids,
    check_increasing,
    check_shape,
    freeze,
)
from gaia_uwb._shared.errors import InputError


def test_freeze_copies_what_others_can_write_to() -> None:
    owner, given = SimpleNamespace(), np.arange(3.0)
    stored = freeze(owner, "x", given, np.float64)
    given[0] = 99.0
    assert stored is owner.x
    assert stored[0] == 0.0
    assert not stored.flags.writeable


def test_freeze_shares_constant_arrays_and_their_views() -> None:
    constant = np.arange(6.0)
    constant.flags.writeable = False
    assert freeze(SimpleNamespace(), "x", constant, np.float64) is constant
    assert np.shares_memory(freeze(SimpleNamespace(), "x", constant[2:4], np.float64), constant)


def test_freeze_is_not_deceived_by_a_read_only_view() -> None:
    given = np.arange(3.0)
    view = given.view()
    view.flags.writeable = False
    stored = freeze(SimpleNamespace(), "x", view, np.float64)
    given[0] = 99.0
    assert stored[0] == 0.0


def test_freeze_is_not_deceived_by_a_foreign_buffer() -> None:
    buffer = bytearray(16)
    view = np.frombuffer(buffer, dtype=np.float64)
    view.flags.writeable = False
    stored = freeze(SimpleNamespace(), "x", view, np.float64)
    buffer[7] = 0x40
    assert stored[0] == 0.0


def test_freeze_makes_rows_contiguous() -> None:
    stored = freeze(SimpleNamespace(), "x", np.asfortranarray(np.eye(3)), np.float64)
    assert stored.flags.c_contiguous


@pytest.mark.parametrize(
    ("given", "dtype", "message"),
    [
        ([0.5, 1.0], np.int64, "x: expected int64 values, got float64"),
        ([0, 1], np.bool_, "x: expected bool values, got int64"),
        (["a"], np.float64, "x: expected float64 values, got <U1"),
        ([1 + 2j], np.float64, "x: expected float64 values, got complex128"),
        ([None], np.float64, "x: expected float64 values, got object"),
    ],
)
def test_freeze_refuses_lossy_conversions(given: list, dtype: type, message: str) -> None:
    with pytest.raises(InputError, match=re.escape(message)):
        freeze(SimpleNamespace(), "x", np.array(given), dtype)


def test_freeze_takes_numbers_that_fit() -> None:
    for given in ([1, 2], [True, False], np.float32([1.5])):
        assert freeze(SimpleNamespace(), "x", np.asarray(given), np.float64).dtype == np.float64
    assert freeze(SimpleNamespace(), "x", np.array([]), np.int64).dtype == np.int64


def test_check_shape_says_what_came() -> None:
    check_shape("x", np.zeros((2, 3)), (2, 3))
    with pytest.raises(InputError, match=re.escape("run, column x: expected shape (3,), got (2,)")):
        check_shape("x", np.zeros(2), (3,), source="run")


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("shape", [(4,), (4, 2), (4, 2, 3)])
def test_check_finite_names_the_first_bad_row(bad: float, shape: tuple[int, ...]) -> None:
    array = np.zeros(shape)
    check_finite("x", array)
    array[2] = array[3] = bad
    with pytest.raises(InputError, match="row 3, column x: expected finite numbers") as caught:
        check_finite("x", array)
    assert caught.value.row == 3


def test_check_finite_passes_empty_arrays() -> None:
    check_finite("x", np.zeros((0, 2)))


def test_check_increasing() -> None:
    level = np.array([0.0, 1.0, 1.0, 2.0])
    check_increasing("t_s", level, strictly=False)
    with pytest.raises(InputError, match=r"row 3.*got 1\.000000 s after 1\.000000 s"):
        check_increasing("t_s", level, strictly=True)
    with pytest.raises(InputError, match=r"row 2.*got -1\.000000 s after 0\.000000 s"):
        check_increasing("t_s", np.array([0.0, -1.0]), strictly=False)


def test_check_heights() -> None:
    check_heights("up_m", np.array([1.0, np.nan]), 2, source="run")
    with pytest.raises(InputError, match=r"run, row 2, column up_m: expected finite heights"):
        check_heights("up_m", np.array([1.0, -np.inf]), 2, source="run")
    with pytest.raises(InputError, match="expected shape"):
        check_heights("up_m", np.array([1.0]), 2, source="run")


@pytest.mark.parametrize(
    ("ids", "message"),
    [
        ((), "expected at least one anchor, got none"),
        (("a", ""), "anchor ids must be non-empty text"),
        (("a", "b", "a"), "anchor ids must be unique, got 'a' twice"),
    ],
)
def test_check_ids(ids: tuple[str, ...], message: str) -> None:
    check_ids(("a", "b"))
    with pytest.raises(InputError, match=f"run, column anchor_id: {message}"):
        check_ids(ids, source="run")
