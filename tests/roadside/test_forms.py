"""Forms of zones from stations and offsets alone."""

from __future__ import annotations

import numpy as np
import pytest

from gaia_uwb.roadside import ZoneForm
from gaia_uwb.roadside.forms import facing, forms, split_zones, two_rows_form
from roads import Numbers


def form_of(station_m: Numbers, left_m: Numbers) -> str:
    away_m = np.abs(left_m)
    two_rows = two_rows_form(station_m, away_m, facing(station_m, away_m))
    return forms(station_m[None], left_m[None], two_rows)[0].value


ROW_M = 12.0 * np.arange(20)
TAPER_IN = np.clip(1.0 - np.arange(20) / 6.0, 0.0, 1.0)
TAPER_OUT = np.clip(1.0 - np.arange(20)[::-1] / 3.0, 0.0, 1.0)
TWO_ROWS_M = np.concatenate([ROW_M, ROW_M + 4.0])
BLOCK_M = np.array([0.0, 0.0, 5.0, 5.0])


@pytest.mark.parametrize(
    ("form", "station_m", "left_m"),
    [
        ("one-row", ROW_M, np.full(20, 2.2)),
        ("one-row", ROW_M, -2.2 - 3.0 * TAPER_IN),
        ("one-row", ROW_M, -2.2 - 3.0 * TAPER_OUT),
        ("area", ROW_M, -2.2 - 3.6 * (TAPER_IN + TAPER_OUT)),
        ("lane-between", TWO_ROWS_M, np.repeat([2.2, -2.0], 20)),
        ("works-between", TWO_ROWS_M, np.repeat([2.2, 6.0], 20)),
        ("works-between", TWO_ROWS_M, -np.repeat([2.2, 6.0], 20)),
        ("area", BLOCK_M, np.array([3.0, 6.0, 3.0, 6.0])),
        ("area", np.array([0.0, 2.0, 4.0]), np.array([4.0, 7.0, 4.0])),
        ("one-row", ROW_M, 2.2 + 3.0 * TAPER_IN + 1.6 * (np.arange(20) == 12)),
        ("works-between", np.r_[ROW_M, 20.0, 90.0, 170.0], np.repeat([2.2, 6.0], [20, 3])),
        ("area", np.array([0.0, 3.0, 80.0, 83.0]), np.array([2.0, 6.0, 2.0, 6.0])),
        ("one-row", np.array([0.0]), np.array([3.0])),
        ("one-row", np.array([0.0, 9.0]), np.array([3.0, 6.0])),
        ("lane-between", np.array([0.0, 0.5]), np.array([3.0, -3.0])),
    ],
)  # fmt: skip
def test_form(form: str, station_m: Numbers, left_m: Numbers) -> None:
    assert form_of(station_m, left_m) == form
    assert form_of(station_m, -left_m) == form, "seen in a mirror"
    assert form_of(-station_m, -left_m) == form, "driven in the other direction"
    rng = np.random.default_rng(1)
    shuffled = rng.permutation(len(station_m))
    assert form_of(station_m[shuffled], left_m[shuffled]) == form, "in another order"
    for _ in range(20):
        moved_m = rng.normal(0.0, 0.1, (2, len(station_m)))
        assert form_of(station_m + moved_m[0], left_m + moved_m[1]) == form, "put down by hand"


def test_every_scene_has_its_own_form() -> None:
    left_m = np.stack([np.full(20, 2.2), np.where(np.arange(20) == 7, -2.2, 2.2)])
    found = forms(np.stack([ROW_M, ROW_M]), left_m, ZoneForm.AREA)
    assert found == [ZoneForm.ONE_ROW, ZoneForm.LANE_BETWEEN]


def test_cones_that_face_traffic() -> None:
    near_m, far_m = 2.2 + 3.0 * TAPER_IN, np.full(20, 6.5)
    found = facing(TWO_ROWS_M, np.concatenate([near_m, far_m]))
    assert found.tolist() == [True] * 20 + [False] * 20
    earlier = facing(np.concatenate([ROW_M, ROW_M - 0.5]), np.concatenate([near_m - 1, far_m]))
    assert not earlier[20:].any(), "the first of all cones is behind the next"
    diamond = facing(np.array([0.0, 5.0, 5.0, 10.0]), np.array([5.0, 2.0, 8.0, 5.0]))
    assert diamond.tolist() == [True, True, False, True]


@pytest.mark.parametrize(("between_m", "n_zones"), [(60.0, 1), (190.0, 1), (210.0, 2)])
def test_zones_far_apart_are_two(between_m: float, n_zones: int) -> None:
    station_m = np.concatenate([ROW_M, ROW_M[-1] + between_m + ROW_M])
    rng = np.random.default_rng(2)
    shuffled = rng.permutation(len(station_m))
    found = split_zones(station_m[shuffled])
    assert len(found) == n_zones
    in_order = shuffled[np.concatenate(found)]
    assert in_order.tolist() == list(range(len(station_m)))


def test_few_cones_far_apart_are_one_zone() -> None:
    assert len(split_zones(np.array([0.0, 165.0, 365.0, 380.0]))) == 1
    assert len(split_zones(np.array([0.0, 400.0]))) == 1


def test_a_weaving_vehicle_makes_no_second_row() -> None:
    station_m = 10.0 * np.arange(21)
    for length_m in (60.0, 90.0, 150.0):
        left_m = -3.0 + 1.5 * np.sin(2 * np.pi * station_m / length_m)
        assert form_of(station_m, left_m) == "one-row"
