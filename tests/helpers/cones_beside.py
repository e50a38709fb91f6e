"""Drives along lines, and cones beside them, whose stations and offsets are known exactly."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from shapely import LineString, MultiPolygon, Polygon, union_all

from gaia_uwb.config import BoundaryConfig
from gaia_uwb.roadside import Drive, RoadBoundary, WorkZone, find_zones
from gaia_uwb.zone import Region
from roads import Line, Road

Numbers = NDArray[np.float64]
STRAIGHT = Road(0.4, 0.0)
BEND = Road(0.4, 1 / 800.0)
SPEED_MPS = 15.0


def drive(
    line: Line, start_m: float, stop_m: float, lane_m: float = 0.0, name: str = "drive"
) -> Drive:
    """Drive in a lane from one station to another, forwards or backwards."""
    n = int(abs(stop_m - start_m) / 0.75) + 1
    place_m = line.place(np.linspace(start_m, stop_m, n), lane_m)
    return Drive(name, 0.75 / SPEED_MPS * np.arange(n), place_m)


def there_and_back(line: Line, start_m: float, stop_m: float, lane_m: float) -> Drive:
    """Drive out in the first lane, turn round and come back in another one."""
    radius_m = abs(lane_m) / 2
    angle = np.linspace(0.0, np.pi, 40)[1:-1]
    turn_m = line.place(stop_m + radius_m * np.sin(angle), 0.5 * lane_m * (1 - np.cos(angle)))
    out, back = drive(line, start_m, stop_m), drive(line, stop_m, start_m, lane_m)
    place_m = np.concatenate([out.position_m, turn_m, back.position_m])
    return Drive("u-turn", 0.05 * np.arange(len(place_m)), place_m)


def zones_of(
    drives: Sequence[Drive],
    cones_m: Numbers,
    *,
    sigma_m: float = 0.0,
    config: BoundaryConfig | None = None,
    n_scenes: int = 400,
) -> RoadBoundary:
    """Return what is found with places known to a standard deviation."""
    noise_m = np.random.default_rng(5).normal(0.0, 1.0, (n_scenes, len(cones_m), 2))
    located = np.isfinite(cones_m).all(axis=1)
    scene_m = (cones_m + sigma_m * noise_m)[:, located]
    ids = [f"c{k:02d}" for k in range(len(cones_m))]
    found = find_zones(drives, ids, cones_m, scene_m, config or BoundaryConfig())
    assert found is not None
    return found


def only_zone(
    drives: Sequence[Drive],
    cones_m: Numbers,
    *,
    sigma_m: float = 0.0,
    config: BoundaryConfig | None = None,
) -> WorkZone:
    """Return the only zone that is found."""
    (zone,) = zones_of(drives, cones_m, sigma_m=sigma_m, config=config).zones
    return zone


def ground(region: Region) -> Polygon | MultiPolygon:
    """Return a region's ground."""
    return union_all([Polygon(rings[0], rings[1:]) for rings in region.polygons])


def inside_m(region: Region, path: Drive) -> float:
    """Return how many metres of a path lie in a region."""
    return float(LineString(path.position_m).intersection(ground(region)).length)
