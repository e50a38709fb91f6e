"""A zone that was driven through is told as such, and no other."""

from __future__ import annotations

import numpy as np

from cones_beside import BEND, STRAIGHT, drive, only_zone
from gaia_uwb.roadside import ZoneForm

STATION_M = 100.0 + 15.0 * np.arange(20)


def test_a_row_across_the_path_was_driven_through() -> None:
    """From 4 m left to 4 m right: a row at an angle, which the vehicle crossed in its middle."""
    cones_m = STRAIGHT.place(STATION_M, np.linspace(4.0, -4.0, 20))
    through = only_zone([drive(STRAIGHT, 0.0, 500.0)], cones_m, sigma_m=0.05).drove_through
    assert through is not None
    assert through.probability > 0.95
    assert {"c09", "c10"} <= set(through.cones)
    assert 215.0 < through.from_station_m < 242.5 < through.to_station_m < 270.0


def test_a_cone_on_the_path_was_driven_over() -> None:
    left_m = np.where(np.arange(20) == 4, -0.2, -2.5)
    zone = only_zone([drive(BEND, 0.0, 500.0)], BEND.place(STATION_M, left_m), sigma_m=0.05)
    assert zone.drove_through is not None
    assert zone.drove_through.cones == ("c04",)


def test_another_drive_that_crosses_the_edge() -> None:
    cones_m = BEND.place(STATION_M, -3.0)
    first = drive(BEND, 0.0, 500.0)
    station_m = np.arange(0.0, 500.0, 0.75)
    lane_m = -7.0 * np.clip((station_m - 200.0) / 50.0, 0.0, 1.0)
    second = type(first)("second", 0.05 * np.arange(len(station_m)), BEND.place(station_m, lane_m))
    through = only_zone([first, second], cones_m, sigma_m=0.05).drove_through
    assert through is not None
    assert {"c08", "c09"} <= set(through.cones), "it leads over at 221 m"
    assert only_zone([first], cones_m, sigma_m=0.05).drove_through is None


def test_two_rows_were_not_driven_through() -> None:
    drives = [drive(STRAIGHT, 0.0, 800.0)]
    both = np.concatenate([STRAIGHT.place(STATION_M, 2.5), STRAIGHT.place(STATION_M, -2.5)])
    apart = np.concatenate([STRAIGHT.place(STATION_M, 2.5), STRAIGHT.place(STATION_M + 350, -2.5)])
    for cones_m in (both, apart):
        zone = only_zone(drives, cones_m, sigma_m=0.1)
        assert zone.form is ZoneForm.LANE_BETWEEN
        assert zone.drove_through is None


def test_cones_that_are_little_known_were_not_driven_over() -> None:
    """Any of twenty may stand on the path, none is likely to."""
    cones_m = BEND.place(STATION_M, -2.2)
    assert only_zone([drive(BEND, 0.0, 500.0)], cones_m, sigma_m=1.0).drove_through is None
