"""Rows in the order of time, each time (of an anchor) once; and clocks that were set on the way.

A log may be late by a little here and there, since buffers and networks deliver late: then its rows
are sorted. Where the times go back at one place and go on from there, the clock was set during the
log: times before and after that place mean something else, and sorting would only hide it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Generic, TypeVar, cast

import numpy as np

from gaia_uwb._shared import Array, Bool, Float64, counted, percent
from gaia_uwb.logs._logs import LogTable
from gaia_uwb.logs._table import Table
from gaia_uwb.logs._tags import sources

_Table = TypeVar("_Table", bound=Table)

_MOST_STEPS_BACK = 0.1  # of all rows: times that go back more often are in no order at all
_LARGEST = 20  # steps back of one anchor that are looked at
_FEWEST_LATE = 5  # rows that come again after a step back; of fewer, a buffer may be the cause
_MOST_NAMED = 3
_MANY = 0.4  # of the rows repeat a time: that is worth a cause


@dataclass(frozen=True)
class Tidied(Generic[_Table]):
    """A log in the order of time.

    Parameters
    ----------
    table
        Its rows.
    notes
        What was sorted and left out.
    problems
        Places at which the clock was set.
    """

    table: _Table
    notes: tuple[str, ...]
    problems: tuple[str, ...]


def tidy(table: _Table, *, merged: bool = False) -> Tidied[_Table]:
    """Sort a log by time, and keep the first of rows that repeat a time (of an anchor).

    Parameters
    ----------
    table
        The rows as they were read.
    merged
        They come from several logs one after the other, so that their order says nothing.
    """
    t_s = table["t_s"]
    notes, problems = [], []
    goes_back = np.diff(t_s) < 0
    if goes_back.any() and not merged:
        problems = list(dict.fromkeys(_clock_steps(table)))
        # Where a row of the file holds all anchors, each anchor's readings begin anew.
        n_late = int((goes_back & _goes_on(table)).sum())
        if n_late and not problems:
            late = counted(n_late, "row")
            notes.append(f"{table.path.name}: sorted by time, as {late} came late")
    keys = (t_s,) if "anchor_id" not in table else (sources(table), t_s)
    order = np.lexsort(keys)
    repeat = np.ones(max(len(table) - 1, 0), np.bool_)
    for key in keys:
        repeat &= np.diff(key[order]) == 0
    if repeat.any():
        notes.append(_repeats(table, int(repeat.sum())))
    elif not goes_back.any():
        return Tidied(table, (), ())
    kept = np.ones(len(table), np.bool_)
    kept[order[1:][repeat]] = False
    rows = np.flatnonzero(kept)
    rows = rows[np.argsort(t_s[rows], kind="stable")]
    return Tidied(cast("_Table", table.take(rows)), tuple(notes), tuple(problems))


def _goes_on(table: Table) -> Bool[Array, "K"]:
    """Return which readings stand after the one before them in the file too."""
    if isinstance(table, LogTable):
        return np.asarray(np.diff(table.number) > 0)
    return np.ones(max(len(table) - 1, 0), np.bool_)


def _repeats(table: Table, n_repeats: int) -> str:
    """Say that rows which repeat a time are left out, and why there are so many."""
    what = "the time of another" if "anchor_id" not in table else "the anchor and time of another"
    if len(table.labels.get("tag_id", ())) > 1:
        what = "the tag, anchor and time of another"
    note = f"{table.path.name}: skipped {counted(n_repeats, 'row')} with {what}"
    share = n_repeats / len(table)
    if share > _MANY and (table["t_s"] == np.floor(table["t_s"])).all():
        note += f", {percent(share)} of all: the stamps are whole seconds"
    return note


def _clock_steps(table: Table) -> Iterator[str]:
    """Yield the places at which the times of the rows go back and go on from there."""
    t_s = table["t_s"]
    who = sources(table) if "anchor_id" in table else np.zeros(len(t_s), np.int64)
    values = [table[name] for name in ("range_m", "east_m", "lat") if name in table][:1]
    value = values[0] if values else np.zeros(len(t_s))
    order = np.argsort(who, kind="stable")
    found: list[tuple[int, int, float]] = []
    for own in np.split(order, np.flatnonzero(np.diff(who[order])) + 1):
        found += [
            (int(own[before]), int(own[before + 1]), size_s)
            for before, size_s in _own_steps(t_s[own], value[own])
        ]
    places: list[tuple[int, float]] = []
    reach = -1
    for first, last, size_s in sorted(found):
        if first > reach:  # another anchor's rows tell of the same step again
            row = first + 1 + int(np.argmin(np.diff(t_s[first : last + 1])))
            places.append((row, size_s))
        reach = max(reach, last)
    for row, size_s in places[:_MOST_NAMED]:
        more = len(places) - _MOST_NAMED
        others = f" (and at {counted(more, 'more place')})" if more > 0 else ""
        problem = (
            f"the time jumps back by {size_s:.1f} s and goes on from there{others}: the clock was "
            "set during the log; cut the log here, or correct the times"
        )
        yield said_at(table, row, problem, column="t_s")


def said_at(table: Table, index: int, text: str, *, column: str | None = None) -> str:
    """Return a text with the file, the row and the column before it, as in an error.

    Parameters
    ----------
    table, index
        Which row of which table.
    text
        What to say of it.
    column
        Where in the row.
    """
    said = str(table.error(text, index=index, column=column))
    return said.replace(str(table.path), table.path.name)


def _own_steps(t_s: Float64[Array, "K"], value: Float64[Array, "K"]) -> Iterator[tuple[int, float]]:
    """Yield the row before each clock step among the rows of one anchor, and the step's size.

    Rows that were only late fill a gap that they left. After a clock step times come again that
    were there before, with other values.
    """
    step_s = np.diff(t_s)
    back = np.flatnonzero(step_s < 0)
    if not back.size or back.size > max(_MOST_STEPS_BACK * len(t_s), 1):
        return
    usual_s = float(np.median(step_s[step_s > 0])) if (step_s > 0).any() else 0.0
    for before in np.sort(back[np.argsort(step_s[back])][:_LARGEST]).tolist():
        passed = np.flatnonzero(t_s[before + 1 :] > t_s[: before + 1].max())
        end = before + 1 + int(passed[0]) if passed.size else len(t_s)
        late = slice(before + 1, end)
        if end - before - 1 < _FEWEST_LATE:
            continue
        again = _comes_again(
            t_s[: before + 1], value[: before + 1], t_s[late], value[late], usual_s
        )
        if again.mean() > 0.5:
            yield before, float(t_s[before] - t_s[before + 1]) + usual_s


def _comes_again(
    earlier_s: Float64[Array, "K"],
    earlier: Float64[Array, "K"],
    late_s: Float64[Array, "L"],
    late: Float64[Array, "L"],
    usual_s: float,
) -> Bool[Array, "L"]:
    """Return which late rows lie where there was no gap, and are no copies of earlier rows."""
    order = np.argsort(earlier_s, kind="stable")
    known_s = earlier_s[order]
    right = np.searchsorted(known_s, late_s)
    nearest = np.minimum(right, len(known_s) - 1)
    same_time = known_s[nearest] == late_s
    copy = same_time & (earlier[order][nearest] == late)
    no_gap = (right > 0) & (known_s[nearest] - known_s[np.maximum(right, 1) - 1] <= 1.5 * usual_s)
    return np.asarray((same_time | no_gap) & ~copy)
