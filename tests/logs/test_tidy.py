"""Rows in the order of time, and clocks that were set during the log."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gaia_uwb.logs._logs import LogTable
from gaia_uwb.logs._table import Table
from gaia_uwb.logs._tidy import Tidied, tidy

STEP_S = 0.2


def make_table(t_s: np.ndarray, *, n_anchors: int = 3, range_m: np.ndarray | None = None) -> Table:
    """Return readings of some anchors in turn at each of these times, in this order."""
    rng = np.random.default_rng(4)
    times = (t_s[:, None] + 0.01 * np.arange(n_anchors)).ravel()
    anchor = np.tile(np.arange(n_anchors), len(t_s))
    values = rng.uniform(5, 50, len(times)) if range_m is None else range_m
    ids = tuple(f"a{k}" for k in range(n_anchors))
    columns = {"t_s": times, "anchor_id": anchor, "range_m": values}
    return Table(Path("uwb.parquet"), columns, {"anchor_id": ids}, ())


def read_order(tidied: Tidied[Table]) -> np.ndarray:
    return np.asarray(tidied.table["t_s"])


def test_rows_in_order_stay_as_they_are() -> None:
    table = make_table(np.arange(0, 20, STEP_S))
    tidied = tidy(table)
    assert tidied.table is table
    assert tidied.notes == tidied.problems == ()


@pytest.mark.parametrize("size_s", [2.0, 3.3, 30.0])
def test_a_clock_that_was_set_back_is_a_problem_with_row_and_size(size_s: float) -> None:
    t_s = np.arange(0, 60, STEP_S)
    t_s[200:] -= size_s
    tidied = tidy(make_table(t_s))
    (problem,) = tidied.problems
    start = f"uwb.parquet, row 601, column t_s: the time jumps back by {size_s:.1f} s"
    assert problem.startswith(start)
    assert not [note for note in tidied.notes if "late" in note]
    assert (np.diff(read_order(tidied)) >= 0).all()


def test_each_place_is_named_once_whatever_the_number_of_anchors() -> None:
    t_s = np.arange(0, 60, STEP_S)
    t_s[100:] -= 3.0
    t_s[200:] -= 4.0
    problems = tidy(make_table(t_s, n_anchors=5)).problems
    assert [problem.split(",")[1] for problem in problems] == [" row 501", " row 1001"]
    assert ["3.0 s" in problems[0], "4.0 s" in problems[1]] == [True, True]


def test_a_path_whose_clock_was_set_back_is_named_too() -> None:
    t_s = np.arange(0, 60, STEP_S)
    t_s[150:] -= 5.0
    columns = {"t_s": t_s, "east_m": 3 * np.arange(300.0), "north_m": np.zeros(300)}
    (problem,) = tidy(Table(Path("gps.parquet"), columns, {}, ())).problems
    assert problem.startswith("gps.parquet, row 151, column t_s: the time jumps back by 5.0 s")


def late_by_a_buffer() -> np.ndarray:
    t_s = np.arange(0, 60, STEP_S)
    return np.concatenate([t_s[:100], t_s[110:140], t_s[100:110], t_s[140:]])


def here_and_there() -> np.ndarray:
    t_s = np.arange(0, 60, STEP_S)
    for k in range(20, 280, 40):
        t_s[k], t_s[k + 3] = t_s[k + 3], t_s[k]
    return t_s


@pytest.mark.parametrize(
    "t_s",
    [
        late_by_a_buffer(),
        here_and_there(),
        np.random.default_rng(1).permutation(np.arange(0, 60, STEP_S)),
        np.arange(60, 0, -STEP_S),
    ],
    ids=["buffer", "here and there", "no order", "backwards"],
)
def test_rows_that_are_only_late_are_sorted_with_a_note(t_s: np.ndarray) -> None:
    tidied = tidy(make_table(t_s))
    assert tidied.problems == ()
    assert "sorted by time" in tidied.notes[0]
    assert (np.diff(read_order(tidied)) >= 0).all()
    assert len(tidied.table) == 3 * len(t_s)


def test_logs_of_several_radios_one_after_the_other_are_no_clock_step() -> None:
    table = make_table(np.arange(0, 60, STEP_S))
    order = np.argsort(table["anchor_id"], kind="stable")
    assert tidy(table.take(order)).problems == ()


def test_a_log_that_was_appended_twice_is_no_clock_step() -> None:
    table = make_table(np.arange(0, 20, STEP_S))
    twice = table.take(np.tile(np.arange(len(table)), 2))
    tidied = tidy(twice)
    assert tidied.problems == ()
    assert tidied.notes[-1] == "uwb.parquet: skipped 300 rows with the anchor and time of another"
    np.testing.assert_array_equal(tidied.table["range_m"], table["range_m"])


def test_a_table_with_a_column_per_anchor() -> None:
    """Its readings come anchor by anchor, each in the order of the file."""
    t_s = np.arange(0, 60, STEP_S)
    tidied = tidy(make_wide_table(t_s))
    assert tidied.notes == tidied.problems == ()
    t_s[200:] -= 5.0
    (problem,) = tidy(make_wide_table(t_s)).problems
    assert problem.startswith("wide.csv, row 202, column t_s: the time jumps back by 5.0 s")


def make_wide_table(t_s: np.ndarray) -> LogTable:
    n = len(t_s)
    columns = {
        "t_s": np.tile(t_s, 2),
        "anchor_id": np.repeat([0, 1], n),
        "range_m": np.random.default_rng(0).uniform(5, 50, 2 * n),
    }
    return LogTable(
        Path("wide.csv"),
        columns,
        {"anchor_id": ("a", "b")},
        (),
        number=np.tile(np.arange(2, n + 2), 2),
        origin=np.zeros(2 * n, np.int64),
        origins=("wide.csv, row",),
    )


def test_whole_seconds_are_named_where_they_cost_much() -> None:
    t_s = np.repeat(np.arange(0.0, 30.0), 3)
    columns = {"t_s": t_s, "anchor_id": np.zeros(90, np.int64), "range_m": np.arange(90.0)}
    tidied = tidy(Table(Path("u.csv"), columns, {"anchor_id": ("a",)}, ()))
    assert tidied.notes == (
        "u.csv: skipped 60 rows with the anchor and time of another, 67 % of all: the stamps are "
        "whole seconds",
    )
    np.testing.assert_array_equal(tidied.table["range_m"], np.arange(0.0, 90.0, 3.0))
