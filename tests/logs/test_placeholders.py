"""Numbers that mean "no range" are found, and ranges that honestly repeat are left alone."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gaia_uwb._shared.errors import InputError
from gaia_uwb.logs._placeholders import Drive, no_ranges
from gaia_uwb.logs._table import Table

PLACES_M = np.array([[10.0, 8.0], [40.0, -9.0], [75.0, 10.0], [110.0, -8.0]])


def make_drive(*, parked_s: float = 0.0, speed_mps: float = 4.0) -> Drive:
    t_s = np.arange(0.0, 30.0 + parked_s, 0.25)
    return Drive(t_s, np.column_stack([speed_mps * np.maximum(t_s - parked_s, 0), 0 * t_s]))


def make_ranges(drive: Drive, *, every_s: float = 0.2, unit_m: float = 0.001) -> Table:
    """Return the readings of four anchors, in whole units."""
    t_s = np.repeat(np.arange(drive.t_s[0], drive.t_s[-1], every_s), len(PLACES_M))
    anchor = np.tile(np.arange(len(PLACES_M)), len(t_s) // len(PLACES_M))
    range_m = np.hypot(*(drive.at(t_s) - PLACES_M[anchor]).T)
    range_m += 0.03 * np.random.default_rng(5).standard_normal(len(t_s))
    columns = {
        "t_s": t_s, "anchor_id": anchor, "range_m": np.round(range_m / unit_m) * unit_m
    }  # fmt: skip
    return Table(Path("u.csv"), columns, {"anchor_id": ("a", "b", "c", "d")}, ())


def beyond(ranges: Table, most_m: float, value: float) -> tuple[Table, np.ndarray]:
    """Return the table with a number instead of long ranges, and where it stands."""
    far = ranges["range_m"] > most_m
    columns = {**ranges.columns, "range_m": np.where(far, value, ranges["range_m"])}
    return Table(ranges.path, columns, ranges.labels, ()), far


@pytest.mark.parametrize("value", [0.0, -1.0, 65.535, 655.35, 327.67, 99.99, 8190.0, 51.0, 0.01])
def test_the_number_that_stands_for_no_range_is_left_out_and_named(value: float) -> None:
    drive = make_drive()
    ranges, far = beyond(make_ranges(drive), 50.0, value)
    assert 0.1 < far.mean() < 0.6
    none, (note,) = no_ranges(ranges, drive)
    np.testing.assert_array_equal(none, far)
    readings = f"u.csv: skipped {far.sum()} readings of "
    assert note.startswith(readings + ("0 m or less" if value <= 0 else f"exactly {value:g} m ("))


def test_a_number_of_one_anchor_that_is_rarely_out_of_reach() -> None:
    drive = make_drive()
    ranges = make_ranges(drive)
    range_m = ranges["range_m"].copy()
    mine = np.flatnonzero(ranges["anchor_id"] == 2)
    range_m[mine[5:25]] = 130.0
    table = Table(ranges.path, {**ranges.columns, "range_m": range_m}, ranges.labels, ())
    none, notes = no_ranges(table, drive)
    assert np.flatnonzero(none).tolist() == mine[5:25].tolist()
    assert "exactly 130 m (3 %)" in notes[0]


@pytest.mark.parametrize("unit_m", [0.001, 0.01, 0.1, 1.0])
@pytest.mark.parametrize("parked_s", [0.0, 30.0, 300.0])
def test_honest_repeats_stay(unit_m: float, parked_s: float) -> None:
    """A parked vehicle repeats its ranges, and a radio that counts in decimetres does it often."""
    drive = make_drive(parked_s=parked_s)
    none, notes = no_ranges(make_ranges(drive, unit_m=unit_m), drive)
    assert not none.any()
    assert notes == []


def test_a_crawl_with_a_radio_of_whole_decimetres_is_honest() -> None:
    drive = make_drive(speed_mps=0.1)
    none, _ = no_ranges(make_ranges(drive, unit_m=0.1), drive)
    assert not none.any()


def test_a_log_without_any_range_is_refused_in_one_line() -> None:
    drive = make_drive()
    ranges, _ = beyond(make_ranges(drive), -1.0, 0.0)
    with pytest.raises(InputError, match=r"none of the 596 readings is a range: they are 0$"):
        no_ranges(ranges, drive)
