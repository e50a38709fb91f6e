"""What holds for any cones beside any drives, however odd."""

from __future__ import annotations

import numpy as np
import pytest

from cones_beside import BEND, STRAIGHT, drive, inside_m, there_and_back
from gaia_uwb.config import BoundaryConfig
from gaia_uwb.roadside import Drive, find_zones
from road_forms import SCurve
from roads import Line, Numbers, Road

SETTINGS = (
    BoundaryConfig(),
    BoundaryConfig(closed_width_m=3.0),
    *(
        BoundaryConfig.model_validate({"form": form, "closed_lanes": 2})
        for form in ("one-row", "lane-between", "works-between", "area")
    ),
)


def any_line(rng: np.random.Generator) -> Line:
    bend, tight = Road(1.0, 1 / rng.uniform(15.0, 100.0)), Road(0.3, 1 / rng.uniform(50.0, 400.0))
    lines: tuple[Line, ...] = (STRAIGHT, BEND, bend, SCurve(tight, rng.uniform(0.0, 300.0)))
    return lines[rng.integers(4)]


def any_cones(line: Line, length_m: float, rng: np.random.Generator) -> Numbers:
    """Along the road, on it, across it, in one place; some of them not located."""
    n = int(rng.integers(1, 30))
    station_m = rng.uniform(-50.0, length_m + 50.0, n)
    offsets_m = (
        rng.uniform(-10.0, 10.0, n), rng.choice([-3.0, 3.0], n), np.zeros(n), np.full(n, -3.0)
    )  # fmt: skip
    cones_m = line.place(station_m, offsets_m[rng.integers(4)])
    if rng.random() < 0.2:
        cones_m = line.place(np.full(n, length_m / 2), rng.uniform(-10.0, 10.0, n))
    if rng.random() < 0.1:
        cones_m[:] = cones_m[0]
    if rng.random() < 0.2:
        cones_m[1:][rng.random(n - 1) < 0.3] = np.nan
    return cones_m


def any_drives(line: Line, length_m: float, rng: np.random.Generator) -> list[Drive]:
    first = drive(line, 0.0, length_m)
    noise_m = rng.choice([0.0, 0.05, 0.3, 1.0]) * rng.normal(size=first.position_m.shape)
    others = (
        drive(line, length_m, 0.0, rng.uniform(-8.0, 8.0)),
        there_and_back(line, 0.0, length_m, rng.choice([-1.0, 1.0]) * rng.uniform(5.0, 20.0)),
        drive(Road(rng.uniform(0.0, 6.0), 0.0), -100.0, 100.0),
        drive(line, 0.3 * length_m, 0.6 * length_m, rng.uniform(-5.0, 5.0)),
    )
    kept = [other for other in others if rng.random() < 0.3]
    return [Drive(first.name, first.t_s, first.position_m + noise_m), *kept]


@pytest.mark.parametrize("seed", range(20))
def test_zones_hold_every_cone_and_no_path(seed: int) -> None:
    rng = np.random.default_rng([7, seed])
    for _ in range(5):
        line, length_m = any_line(rng), float(rng.choice([20.0, 100.0, 500.0, 1500.0]))
        cones_m, drives = any_cones(line, length_m, rng), any_drives(line, length_m, rng)
        located = np.isfinite(cones_m).all(axis=1)
        noise_m = rng.choice([0.0, 0.1, 1.0, 20.0]) * rng.normal(size=(50, len(cones_m), 2))
        ids = [f"c{k}" for k in range(len(cones_m))]
        config = SETTINGS[rng.integers(len(SETTINGS))]
        found = find_zones(drives, ids, cones_m, (cones_m + noise_m)[:, located], config)
        assert found is not None
        held = [cone for zone in found.zones for cone in zone.cones]
        assert sorted([*held, *found.unlocated]) == sorted(ids)
        for zone in found.zones:
            assert sum(zone.form_probability.values()) == pytest.approx(1.0)
            assert zone.edges
            for edge in zone.edges:
                assert (np.diff(edge.station_m) >= 0).all()
                assert (np.abs(edge.band.far_m) >= np.abs(edge.band.near_m)).all()
                assert len(edge.lines) == len(edge.pieces) == len(edge.gaps) + 1
                assert 0 <= edge.free.least_m <= edge.beside_m.min() + 1e-9
            if zone.closed is not None:
                for path in drives[1:]:  # positions of the first one are noisy
                    for region in (zone.closed.region, zone.closed.inner, zone.closed.outer):
                        assert inside_m(region, path) == 0.0
