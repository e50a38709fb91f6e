"""What is said where the clocks of two logs do not meet."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gaia_uwb._shared.errors import InputError
from gaia_uwb.logs._plausible import check_one_drive, gap_hint
from gaia_uwb.logs._table import Table

NOW_S = 1_772_528_400.0


@pytest.mark.parametrize(
    ("ahead_s", "hint"),
    [
        (3600.0, "the ranges are 1 h ahead: is utc_offset_h: 1 missing"),
        (-7195.0, "the ranges are 2 h behind: is utc_offset_h: -2 missing"),
        (19_800.0, "the ranges are 5.5 h ahead: is utc_offset_h: 5.5 missing"),
        (86_400.0, "the ranges are 1 day ahead: is a date wrong?"),
        (-3 * 86_400.0, "the ranges are 3 days behind"),
        (-NOW_S, "one counts from its own start and the other from 1970"),
        (-315_964_782.0, "count from 1970 and from GPS time's start in 1980"),
    ],
)
def test_the_usual_reasons_are_named(ahead_s: float, hint: str) -> None:
    drive_s = (NOW_S, NOW_S + 40.0)
    assert hint in gap_hint((drive_s[0] + 2 + ahead_s, drive_s[1] - 3 + ahead_s), drive_s)


@pytest.mark.parametrize("ahead_s", [1000.0, 5 * 3600.0 + 1200.0, -432.0])
def test_nothing_is_guessed_where_no_reason_fits(ahead_s: float) -> None:
    drive_s = (NOW_S, NOW_S + 40.0)
    assert gap_hint((drive_s[0] + ahead_s, drive_s[1] + ahead_s), drive_s) == ""


def test_leap_seconds_between_short_logs() -> None:
    assert "18 leap seconds" in gap_hint((NOW_S + 18, NOW_S + 28), (NOW_S, NOW_S + 10))


def make_tables(range_s: np.ndarray) -> tuple[Table, Table, np.ndarray]:
    n = len(range_s)
    columns = {"t_s": range_s, "anchor_id": np.zeros(n, np.int64), "range_m": np.full(n, 9.0)}
    ranges = Table(Path("u.parquet"), columns, {"anchor_id": ("a",)}, ())
    drive = Table(Path("d.parquet"), {"t_s": np.arange(0.0, 60.0, 0.1)}, {}, ())
    return ranges, drive, np.zeros((600, 2))


@pytest.mark.parametrize(("scale", "unit"), [(1e3, "milli"), (1e6, "micro"), (1e9, "nano")])
def test_times_of_the_ranges_in_another_unit(scale: float, unit: str) -> None:
    with pytest.raises(InputError, match=f"column t_s: expected seconds: .* are these {unit}sec"):
        check_one_drive(*make_tables(scale * np.arange(0.0, 60.0, 0.2)))


def test_a_radio_that_was_on_all_day_is_no_error() -> None:
    check_one_drive(*make_tables(np.arange(0.0, 60_000.0, 0.5)))
