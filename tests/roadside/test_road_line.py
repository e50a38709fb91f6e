"""Stations and offsets: exact on a straight line, and the way there and back."""

from __future__ import annotations

import numpy as np
import pytest

from cones_beside import BEND, STRAIGHT, drive
from gaia_uwb.roadside import RoadLine
from gaia_uwb.roadside.runs import smooth
from road_forms import SCurve
from roads import Road

LINES = {"straight": STRAIGHT, "bend": BEND, "s-curve": SCurve(BEND, 120.0)}


def made(line: Road | SCurve, noise_m: float = 0.0) -> RoadLine:
    path = drive(line, -100.0, 400.0)
    rng = np.random.default_rng(1)
    noisy_m = path.position_m + noise_m * rng.normal(size=path.position_m.shape)
    run = smooth(type(path)(path.name, path.t_s, noisy_m))
    assert run is not None
    return run.line()


@pytest.mark.parametrize("name", LINES)
def test_stations_and_offsets_are_those_of_the_road(name: str) -> None:
    rng = np.random.default_rng(2)
    station_m, offset_m = rng.uniform(-80.0, 380.0, 200), rng.uniform(-12.0, 12.0, 200)
    found_m = made(LINES[name]).locate(LINES[name].place(station_m, offset_m))
    np.testing.assert_allclose(found_m[:, 1], offset_m, atol=0.03)
    # A bend is polygonal here: along it, a place far aside may be taken to be at the next vertex.
    np.testing.assert_allclose(found_m[:, 0], station_m + 100.0, atol=0.2)


@pytest.mark.parametrize("name", LINES)
def test_there_and_back(name: str) -> None:
    line = made(LINES[name])
    rng = np.random.default_rng(3)
    place_m = LINES[name].place(rng.uniform(-200.0, 500.0, 300), rng.uniform(-10.0, 10.0, 300))
    back_m = line.place(*line.locate(place_m).T)
    off_m = np.hypot(*(back_m - place_m).T)
    assert np.median(off_m) < 1e-6
    assert off_m.max() < 0.2  # outside of a vertex, all places are at its station


def test_noise_of_the_positions_is_smoothed() -> None:
    noisy = made(STRAIGHT, noise_m=0.1)
    station_m = np.linspace(-80.0, 380.0, 100)
    offset_m = noisy.locate(STRAIGHT.place(station_m, 3.0))[:, 1]
    assert np.std(offset_m - 3.0) < 0.05
    assert noisy.length_m == pytest.approx(500.0, abs=0.5)


def test_scenes_are_located_as_places_are() -> None:
    line = made(LINES["s-curve"])
    rng = np.random.default_rng(4)
    mirrored_m = np.stack(
        [LINES["s-curve"].place(20.0 * np.arange(15), side * 4.0) for side in (1, -1) * 20]
    )
    scene_m = mirrored_m + rng.normal(0.0, 0.5, mirrored_m.shape)
    np.testing.assert_allclose(line.locate_scenes(scene_m), line.locate(scene_m), atol=1e-9)
