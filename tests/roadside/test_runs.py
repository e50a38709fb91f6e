"""Drives are cut where they turn back, and the line is the run that passes the cones nearest."""

from __future__ import annotations

import numpy as np
import pytest

from cones_beside import BEND, STRAIGHT, drive, there_and_back
from gaia_uwb.roadside import Drive
from gaia_uwb.roadside.runs import beside, cut_at_turns, road_line, smooth
from roads import Road


def runs_of(*drives: Drive) -> list:  # type: ignore[type-arg]  # of a class that is not public
    whole = [run for each in drives if (run := smooth(each)) is not None]
    return [part for run in whole for part in cut_at_turns(run)]


@pytest.mark.parametrize("lane_m", [7.2, 14.4, 20.0, -10.0])
@pytest.mark.parametrize("road", [STRAIGHT, BEND])
def test_a_u_turn_makes_two_runs(road: Road, lane_m: float) -> None:
    out, back = runs_of(there_and_back(road, 0.0, 300.0, lane_m))
    assert out.length_m == pytest.approx(300.0, abs=10.0)
    assert back.length_m == pytest.approx(300.0, abs=20.0)


@pytest.mark.parametrize("radius_m", [30.0, 60.0, 400.0])
def test_a_road_that_bends_by_a_right_angle_is_one_run(radius_m: float) -> None:
    length_m = 0.5 * np.pi * radius_m
    (run,) = runs_of(drive(Road(0.0, 1 / radius_m), 0.0, length_m))
    assert run.length_m == pytest.approx(length_m, abs=1.5)


def test_a_vehicle_that_stands_makes_no_run_of_its_own() -> None:
    moving = drive(STRAIGHT, 0.0, 200.0)
    rng = np.random.default_rng(1)
    standing_m = STRAIGHT.place(np.full(600, 100.0), 0.0) + rng.normal(0.0, 0.1, (600, 2))
    k = int(np.argmin(np.hypot(*(moving.position_m - standing_m[0]).T)))
    place_m = np.concatenate([moving.position_m[:k], standing_m, moving.position_m[k:]])
    (run,) = runs_of(Drive("stands", 0.05 * np.arange(len(place_m)), place_m))
    assert run.length_m == pytest.approx(200.0, abs=3.0)
    assert smooth(Drive("parked", np.arange(600.0), standing_m)) is None


def test_the_line_is_the_nearest_run_whatever_the_order() -> None:
    cones_m = STRAIGHT.place(np.linspace(50.0, 250.0, 20), -3.0)
    near, far = drive(STRAIGHT, 0.0, 300.0), drive(STRAIGHT, 300.0, 0.0, 7.2)
    for drives in ((near, far), (far, near)):
        line = road_line(runs_of(*drives), cones_m)
        assert line is not None
        np.testing.assert_allclose(line.locate(cones_m)[:, 1], -3.0, atol=0.02)


def test_a_run_that_passes_few_cones_is_not_the_line() -> None:
    cones_m = STRAIGHT.place(np.linspace(50.0, 250.0, 20), -3.0)
    near_few, far_all = drive(STRAIGHT, 30.0, 60.0), drive(STRAIGHT, 0.0, 300.0, 3.6)
    line = road_line(runs_of(near_few, far_all), cones_m)
    assert line is not None
    assert line.length_m > 290.0


def test_paths_beside_the_line_tell_direction_and_offset() -> None:
    runs = runs_of(drive(BEND, 0.0, 300.0), drive(BEND, 290.0, 10.0, 7.2), drive(BEND, 0.0, 300.0))
    paths = beside(runs[0].line(), runs)
    assert [path.along for path in paths] == [1, -1, 1]
    np.testing.assert_allclose(paths[1].offset_at(np.linspace(20.0, 280.0, 30)), 7.2, atol=0.03)
    assert np.isnan(paths[1].offset_at(np.array([5.0, 295.0]))).all()
    assert (np.diff(paths[1].t_s) < 0).all()


def test_a_crossing_street_is_not_beside_the_line() -> None:
    line = runs_of(drive(STRAIGHT, 0.0, 300.0))[0].line()
    across = drive(Road(0.4 + np.pi / 2, 0.0), -100.0, 100.0)
    assert beside(line, runs_of(across)) == ()


@pytest.mark.parametrize("noise_m", [0.05, 0.15, 0.3])
def test_noise_of_a_standing_receiver_is_no_path(noise_m: float) -> None:
    rng = np.random.default_rng(3)
    t_s = np.arange(0.0, 100.0, 0.1)
    east_m = 5.0 * np.where(t_s < 20.0, t_s, np.maximum(t_s - 60.0, 20.0))
    noisy_m = np.stack([east_m, np.zeros(len(t_s))], axis=1) + noise_m * rng.normal(size=(1000, 2))
    (run,) = runs_of(Drive("stop", t_s, noisy_m))
    driven_m = np.hypot(*np.diff(run.place_m, axis=0).T).sum()
    assert driven_m == pytest.approx(200.0, rel=0.03)
