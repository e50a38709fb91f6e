"""A day at one work zone: many drives by several vehicles, while its cones are moved about.

Drives are those of :func:`simulate_zone`, ten minutes apart. A cone that was moved keeps the errors
of its ranges: what changes is the true range in them. One vehicle may have a clock of its own, and
the positions of one may be off by metres, as with a wrong base station.

>>> from gaia_uwb.simulate import PRESETS, simulate_day
>>> day = simulate_day(PRESETS["lane-closure"], seed=1, n_drives=20)
>>> len(day.scenes), sorted(change.kind for change in day.changes)
(20, ['added', 'moved', 'removed'])
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from gaia_uwb._shared import Array, Bool, ConfigError, Float64
from gaia_uwb.scene import RangeLog, Scene, Truth
from gaia_uwb.simulate.passes import simulate_zone
from gaia_uwb.simulate.settings import PassConfig

LATE_VEHICLE, LYING_VEHICLE = "vehicle-late", "vehicle-lying"
"""The vehicles whose clock is 0.4 s off, and whose positions are wrong."""

_LATE_S, _LIE_M = 0.4, 2.0
_START_S, _APART_S = 1_767_225_600.0, 600.0  # 1 January 2026, and between two drives
_LANES_M = (0.0, 3.6)
_FIRST = 8  # drives before the first change, and after the last


@dataclass(frozen=True)
class Change:
    """A change of one cone, as it truly was.

    Parameters
    ----------
    kind
        What was done.
    anchor_id
        To which cone.
    drive
        Number of the first drive after it.
    at_s
        When, in seconds since 1970.
    place_m : (2,)
        Where the cone stands afterwards; where it stood, if it was removed.
    """

    kind: Literal["moved", "removed", "added"]
    anchor_id: str
    drive: int
    at_s: float
    place_m: Float64[Array, "2"]


@dataclass(frozen=True)
class Day:
    """The drives of a day, and what truly changed.

    Parameters
    ----------
    scenes
        In the order of time; their times are seconds since 1970, their truth that of the moment.
    changes
        In the order of time.
    """

    scenes: tuple[Scene, ...]
    changes: tuple[Change, ...]


def simulate_day(
    config: PassConfig,
    seed: int,
    *,
    n_drives: int = 60,
    n_vehicles: int = 4,
    moved_m: float = 1.0,
    zone: int = 0,
) -> Day:
    """Simulate a day in which a cone is moved, one removed and one added.

    Parameters
    ----------
    config
        Settings of the zone; of at least 4 cones.
    seed
        Seed of the batch, at least 0.
    n_drives
        Past the zone, at least 20.
    n_vehicles
        That drive by turns; beside them, one with a clock that is 0.4 s off drives every tenth time
        and one with wrong positions twice.
    moved_m
        How far the cone is moved.
    zone
        Number of the zone in its batch.

    Raises
    ------
    ConfigError
        If there are too few drives or cones; or like :func:`simulate_zone`.
    """
    if n_drives < 2 * _FIRST + 4:
        raise ConfigError(f"expected at least {2 * _FIRST + 4} drives for a day, got {n_drives}")
    rng = np.random.default_rng([20261130, seed, zone])
    vehicles = [f"vehicle-{k % n_vehicles + 1}" for k in range(n_drives)]
    vehicles[5::10] = [LATE_VEHICLE] * len(vehicles[5::10])
    for k in (n_drives // 3 + 1, 2 * n_drives // 3 + 1):
        vehicles[k] = LYING_VEHICLE
    lanes_m = rng.choice(_LANES_M, n_drives) + rng.normal(0.0, 0.15, n_drives)
    lanes_m[:2] = _LANES_M  # both sides of the cones' mirror images early on
    scenes = simulate_zone(config, seed, lanes_m=lanes_m.tolist(), zone=zone, vehicles=vehicles)
    changes = _drawn(scenes[0], n_drives, moved_m, rng)
    width = len(str(n_drives - 1))
    day = []
    for k, scene in enumerate(scenes):
        now = _changed(scene, k, changes)
        if vehicles[k] == LATE_VEHICLE:
            now = _late(now)
        if vehicles[k] == LYING_VEHICLE:
            now = _lying(now, rng)
        name = f"sim-{seed}-{zone}-drive-{k:0{width}d}"
        day.append(replace(_at(now, _START_S + _APART_S * k), name=name))
    return Day(tuple(day), changes)


def _drawn(
    scene: Scene, n_drives: int, moved_m: float, rng: np.random.Generator
) -> tuple[Change, ...]:
    """Draw what changes, and when."""
    if scene.n_anchors < 4 or scene.truth is None:
        raise ConfigError(f"expected at least 4 cones for a day, got {scene.n_anchors}")
    cones = rng.choice(scene.n_anchors, 3, replace=False)
    drives = np.sort(rng.choice(np.arange(_FIRST, n_drives - _FIRST), 3, replace=False))
    kinds: list[Literal["moved", "removed", "added"]] = ["moved", "removed", "added"]
    order = rng.permutation(3)
    changes = []
    for k, drive in zip(order.tolist(), drives.tolist(), strict=True):
        place_m = scene.truth.anchor_m[cones[k]].copy()
        if kinds[k] == "moved":
            angle = rng.uniform(0.0, 2.0 * np.pi)
            place_m += moved_m * np.array([np.cos(angle), np.sin(angle)])
        at_s = _START_S + _APART_S * (drive - 0.5)
        name = scene.anchor_ids[int(cones[k])]
        changes.append(Change(kinds[k], name, int(drive), at_s, place_m))
    return tuple(changes)


def _changed(scene: Scene, drive: int, changes: tuple[Change, ...]) -> Scene:
    """Return a drive as it was with all changes before it."""
    for change in changes:
        own = scene.ranges.anchor == scene.anchor_ids.index(change.anchor_id)
        is_there = drive < change.drive if change.kind == "removed" else drive >= change.drive
        if change.kind == "moved":
            scene = _moved(scene, own, change) if is_there else scene
        elif not is_there:
            scene = _rows(scene, ~own)
    return scene


def _moved(scene: Scene, own: Bool[Array, "R"], change: Change) -> Scene:
    """Return a drive with a cone elsewhere."""
    log, truth, path = scene.ranges, scene.truth, scene.trajectory
    if truth is None or truth.range_m is None:
        return scene
    n = scene.anchor_ids.index(change.anchor_id)
    at_s = log.t_s[own] - (truth.clock_offset_s or 0.0)
    tag_m = np.stack([np.interp(at_s, path.t_s, x) for x in path.position_m.T], axis=1)
    before_m, after_m = (
        np.hypot(*(tag_m - place_m).T) for place_m in (truth.anchor_m[n], change.place_m)
    )
    height2 = np.maximum(truth.range_m[own] ** 2 - before_m**2, 0.0)
    range_m, true_m = log.range_m.copy(), truth.range_m.copy()
    longer_m = np.sqrt(after_m**2 + height2) - truth.range_m[own]
    range_m[own], true_m[own] = log.range_m[own] + longer_m, true_m[own] + longer_m
    anchor_m = truth.anchor_m.copy()
    anchor_m[n] = change.place_m
    keep = np.ones(len(range_m), dtype=np.bool_)
    keep[own] = range_m[own] > 0.0
    there = replace(
        scene,
        ranges=replace(log, range_m=range_m),
        truth=replace(truth, range_m=true_m, anchor_m=anchor_m),
    )
    return _rows(there, keep)


def _rows(scene: Scene, rows: Bool[Array, "R"]) -> Scene:
    """Return a drive with some of its readings."""
    if rows.all():
        return scene
    n = len(scene.ranges)

    def of(values: object) -> object:
        is_column = isinstance(values, np.ndarray) and len(values) == n
        return values[rows] if is_column else values  # type: ignore[index]  # it is an array

    log = {name: of(values) for name, values in vars(scene.ranges).items()}
    truth = scene.truth
    if truth is not None:
        columns = {name: of(values) for name, values in vars(truth).items() if name != "anchor_m"}
        truth = Truth(anchor_m=truth.anchor_m, **columns)  # type: ignore[arg-type]  # as they were
    return replace(scene, ranges=RangeLog(**log), truth=truth)  # type: ignore[arg-type]  # as above


def _late(scene: Scene) -> Scene:
    """Return a drive whose radios have another clock."""
    truth = scene.truth
    if truth is not None:
        truth = replace(truth, clock_offset_s=(truth.clock_offset_s or 0.0) + _LATE_S)
    log = replace(scene.ranges, t_s=scene.ranges.t_s + _LATE_S)
    return replace(scene, ranges=log, truth=truth)


def _lying(scene: Scene, rng: np.random.Generator) -> Scene:
    """Return a drive whose positions are off."""
    angle = rng.uniform(0.0, 2.0 * np.pi)
    off_m = _LIE_M * np.array([np.cos(angle), np.sin(angle)])
    path = scene.trajectory
    return replace(scene, trajectory=replace(path, position_m=path.position_m + off_m))


def _at(scene: Scene, start_s: float) -> Scene:
    """Return a drive that started at another time."""
    path, log = scene.trajectory, scene.ranges
    return replace(
        scene,
        trajectory=replace(path, t_s=path.t_s + start_s),
        ranges=replace(log, t_s=log.t_s + start_s),
    )
