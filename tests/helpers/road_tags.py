"""Drives of vehicles with several tags, angles of arrival and ranges among cones, along roads.

Like ``roads.py``, by code of its own, and with the same radios. What a log states of a vehicle is
not quite true here: antennas are up to centimetres from where the lever arms say, the vehicle
points beside its course, and every tag has a delay, a pattern and a bias of its angles.

>>> drive = road_drive_with_tags(0, [(0.0, 0.8), (0.0, -0.8)])
>>> drive.n_anchors, [tag.left_m for tag in drive.tags]
(20, [0.8, -0.8])
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from gaia_uwb.scene import ConeRanges, LocalFrame, RangeLog, Scene, Tag, Trajectory, Truth
from roads import (
    CONE_UP_M,
    POSES_PER_S,
    REACH_M,
    READINGS_PER_S,
    TAG_UP_M,
    Lasting,
    Numbers,
    Radios,
    Road,
    trucks_past,
    wander,
)

ON_A_VEHICLE = Radios(tag_pattern_m=0.03)
"""Radios of tags that are mounted on sheet metal."""

N_CONES = 20
SPEED_MPS, STEADY_WANDER, POSITION_SIGMA_M = 60 / 3.6, 1 / 6, 0.01
SLOWEST_MPS, FASTEST_MPS, SPEED_WAVE_M, TURN_M = 2.0, 14.0, 100.0, 6.0
LEVER_SIGMA_M, HEADING_SIGMA_RAD, TAG_DELAY_SIGMA_M = 0.02, np.radians(1.0), 0.05
ANGLE_BIAS_SIGMA_RAD, WILD_ANGLES = np.radians(3.0), 0.05
FURTHEST_CONE_M, READINGS_PER_PAIR = 40.0, 20

Lever = Sequence[float]
"""Forward and left, and perhaps up, in metres."""


@dataclass(frozen=True)
class Vehicle:
    """What is true of a vehicle, where a log states something else or nothing."""

    levers_m: Numbers
    turned_rad: float
    delays_m: Numbers
    patterns_m: Numbers
    angle_biases_rad: Numbers


def vehicle_with_tags(seed: int, levers: Sequence[Lever], radios: Radios = ON_A_VEHICLE) -> Vehicle:
    """Draw the vehicle of :func:`road_drive_with_tags` with these stated lever arms."""
    rng = np.random.default_rng([20261202, seed])
    turned_rad = HEADING_SIGMA_RAD * rng.normal()
    own = rng.normal(size=(len(levers), 9))  # a row for each tag: one more leaves the others alone
    stated_m = np.array([[*lever, 0.0][:3] for lever in levers])
    return Vehicle(
        levers_m=stated_m + LEVER_SIGMA_M * own[:, :3] * [1.0, 1.0, 0.0],
        turned_rad=turned_rad,
        delays_m=TAG_DELAY_SIGMA_M * own[:, 3],
        patterns_m=radios.tag_pattern_m * own[:, 4:8],
        angle_biases_rad=ANGLE_BIAS_SIGMA_RAD * own[:, 8],
    )


def road_drive_with_tags(
    seed: int,
    levers: Sequence[Lever],
    *,
    rows: Literal["one", "both sides"] | None = None,
    steady: bool = True,
    there_and_back: bool = False,
    radius_m: float | None = None,
    radios: Radios = ON_A_VEHICLE,
    angle_sigma_deg: float | None = None,
    cone_to_cone: bool = False,
    neighbours: int = 2,
    vehicle: int | None = None,
) -> Scene:
    """Return one drive past 20 cones, with its truth.

    Drives of one seed differ in nothing but what they are asked for.

    Parameters
    ----------
    seed
        Of everything that is drawn.
    levers
        Where the log says that the tags' antennas are from the vehicle's reference point.
    rows
        Whether the cones stand on one side or in two rows; None: on both sides for odd seeds.
    steady
        Whether the vehicle keeps its speed and hardly wanders in its lane: such a drive tells
        neither the clock offset nor the sides. Otherwise it drives as in ``road_drives``.
    there_and_back
        Whether it turns after the cones and comes back in the next lane but two, now fast, now
        slow: the drive to calibrate a vehicle by.
    radius_m
        Of the bend; None for a straight road.
    radios
        The errors.
    angle_sigma_deg
        Standard deviation of the angles of arrival; None for a log without.
    cone_to_cone
        Whether cones range each other.
    neighbours
        How many of its nearest cones each cone then ranges.
    vehicle
        Seed of the vehicle, for several drives of one; its own by default.
    """
    road_rng, errors_rng, cones_rng = (
        np.random.default_rng([20261202, 1 + part, seed]) for part in range(3)
    )
    curvature = 0.0 if radius_m is None else road_rng.choice([-1, 1]) / radius_m
    road = Road(road_rng.uniform(0, 2 * np.pi), curvature)
    along_m, left_m = _cones(rows or ("one", "both sides")[seed % 2], road_rng)
    cones_m = road.place(along_m, left_m)
    drive = _there_and_back if there_and_back else _path
    path = drive(road, along_m, steady, road_rng)
    delays_m = radios.delay_m * errors_rng.normal(size=N_CONES)
    patterns_m = radios.cone_pattern_m * errors_rng.normal(size=(N_CONES, 2))
    trucks = trucks_past(path.t_s[-1], radios.trucks_per_s, errors_rng)
    hidden = errors_rng.random((N_CONES, len(trucks))) < 0.7
    noise_m = POSITION_SIGMA_M * errors_rng.normal(size=path.position_m.shape)
    own = vehicle_with_tags(seed if vehicle is None else vehicle, levers, radios)
    tables = []
    for number in range(len(levers)):
        rng = np.random.default_rng([20261203, number, seed])
        lasting = Lasting(delays_m, patterns_m, own.patterns_m[number])
        antenna_m, heading_rad = _antenna(path, own, number)
        for cone, cone_m in enumerate(cones_m):
            table = _polls(path.t_s, antenna_m, heading_rad, cone_m, rng)
            truck_m = _truck_m(table.t_s, trucks, hidden[cone], rng)
            error_m = radios.bias_m + own.delays_m[number] + radios.noise_m * table.noise
            error_m += lasting.error_m(cone, table.towards_m, table.ahead_m) + truck_m
            sigma_rad = np.radians(angle_sigma_deg or 0.0)
            azimuth_rad = table.azimuth_rad(own.angle_biases_rad[number], sigma_rad, rng)
            columns = (table.t_s, table.range_m, error_m, truck_m > 0, azimuth_rad)
            heard = np.flatnonzero(table.heard)
            names = np.full((2, len(heard)), [[cone], [number]])
            tables.append((*names, *(column[heard] for column in columns)))
    joined = [np.concatenate(column) for column in zip(*tables, strict=True)]
    order = np.argsort(joined[2], kind="stable")
    anchor, tag, t_s, true_m, error_m, behind, azimuth_rad = (each[order] for each in joined)
    log = RangeLog(t_s + radios.offset_s, anchor, true_m + error_m, tag=tag)
    if angle_sigma_deg is not None:
        sigma_rad = np.full(len(log), np.radians(angle_sigma_deg))
        log = replace(log, azimuth_rad=azimuth_rad, azimuth_sigma_rad=sigma_rad)
    ranged = _ranged(cones_m, delays_m, neighbours, radios, cones_rng) if cone_to_cone else None
    return Scene(
        name=f"road-tags-{seed}",
        trajectory=replace(path, position_m=path.position_m + noise_m),
        ranges=log,
        anchor_ids=tuple(f"c{k:02d}" for k in range(N_CONES)),
        anchor_up_m=np.full(N_CONES, CONE_UP_M),
        frame=LocalFrame(48.1, 11.6, 510.0),
        truth=Truth(cones_m, behind, true_m, radios.offset_s),
        tags=tuple(Tag(f"t{k}", *lever) for k, lever in enumerate(levers)),
        cone_ranges=ranged,
    )


def _cones(rows: str, rng: np.random.Generator) -> tuple[Numbers, Numbers]:
    """Return station and offset of the cones: a taper and a line, on one side or on both."""
    side, n = rng.choice([-1, 1]), N_CONES if rows == "one" else N_CONES // 2
    stations_m, offsets_m = [], []
    for row in range(N_CONES // n):
        far_m, near_m = rng.uniform(4.5, 5.5), rng.uniform(1.9, 2.4)
        share = np.clip(np.arange(n) / rng.integers(3, 7), 0.0, 1.0)
        spacing_m, start_m = rng.uniform(8.0, 16.0), rng.uniform(0.0, 8.0)
        stations_m.append(start_m + spacing_m * np.arange(n) + rng.normal(0, 0.4, n))
        left_m = far_m + share * (near_m - far_m) + rng.normal(0, 0.08, n)
        offsets_m.append((-1) ** row * side * left_m)
    return np.concatenate(stations_m), np.concatenate(offsets_m)


def _path(road: Road, along_m: Numbers, steady: bool, rng: np.random.Generator) -> Trajectory:
    """Drive 100 m before the cones to 100 m after them."""
    length_m = np.ptp(along_m) + 200.0
    t_s = np.arange(0.0, length_m / SPEED_MPS, 1 / POSES_PER_S)
    ripple_s, period_s = 0.03 * (not steady), rng.uniform(15.0, 40.0)
    station_m = SPEED_MPS * (t_s + ripple_s * np.sin(2 * np.pi * t_s / period_s))
    station_m += along_m.min() - 100.0
    aside_m = wander(station_m, rng) * (STEADY_WANDER if steady else 1.0)
    return Trajectory(t_s, road.place(station_m, aside_m), np.full(len(t_s), TAG_UP_M))


def _there_and_back(
    road: Road, along_m: Numbers, steady: bool, rng: np.random.Generator
) -> Trajectory:
    """Drive past the cones, turn, and come back, accelerating and braking all the way."""
    station_m = np.arange(along_m.min() - 60.0, along_m.max() + 60.0, 0.1)
    aside_m = wander(station_m, rng) * (STEADY_WANDER if steady else 1.0)
    angle = np.arange(0.0, np.pi, 0.1 / TURN_M)
    turn_m = station_m[-1] + TURN_M * np.sin(angle), TURN_M * (1.0 - np.cos(angle))
    place_m = np.concatenate(
        [
            road.place(station_m, aside_m),
            road.place(*turn_m),
            road.place(station_m[::-1], 2.0 * TURN_M + aside_m),
        ]
    )
    step_m = np.hypot(*np.diff(place_m, axis=0).T)
    wave = 0.5 + 0.5 * np.sin(2 * np.pi * (np.cumsum(step_m) / SPEED_WAVE_M + rng.random()))
    at_s = np.append(0.0, np.cumsum(step_m / (SLOWEST_MPS + (FASTEST_MPS - SLOWEST_MPS) * wave)))
    t_s = np.arange(0.0, at_s[-1], 1 / POSES_PER_S)
    position_m = np.stack([np.interp(t_s, at_s, axis) for axis in place_m.T], axis=1)
    return Trajectory(t_s, position_m, np.full(len(t_s), TAG_UP_M))


def _antenna(path: Trajectory, own: Vehicle, number: int) -> tuple[Numbers, Numbers]:
    """Return where a tag's antenna is (T, 3), and where the vehicle's front points."""
    assert path.up_m is not None
    step_m = np.gradient(path.position_m, axis=0)
    heading_rad = np.unwrap(np.arctan2(step_m[:, 1], step_m[:, 0])) + own.turned_rad
    forward_m, left_m, up_m = own.levers_m[number]
    cosine, sine = np.cos(heading_rad), np.sin(heading_rad)
    lever_m = np.stack([forward_m * cosine - left_m * sine, forward_m * sine + left_m * cosine])
    return np.column_stack([path.position_m + lever_m.T, path.up_m + up_m]), heading_rad


@dataclass(frozen=True)
class _Polls:
    """A tag's polls of one cone: what is true, whether an answer came, and noise of variance 1."""

    t_s: Numbers
    towards_m: Numbers
    ahead_m: Numbers
    range_m: Numbers
    heard: NDArray[np.bool_]
    noise: Numbers

    def azimuth_rad(self, bias_rad: float, sigma_rad: float, rng: np.random.Generator) -> Numbers:
        """Return angles of arrival in the vehicle's frame, some of which say nothing."""
        cone, ahead = (np.arctan2(*way.T[::-1]) for way in (self.towards_m, self.ahead_m))
        azimuth_rad = cone - ahead + bias_rad + sigma_rad * rng.normal(size=len(self.t_s))
        wild = rng.random(len(self.t_s)) < WILD_ANGLES
        azimuth_rad = np.where(wild, rng.uniform(-np.pi, np.pi, len(self.t_s)), azimuth_rad)
        return np.asarray((azimuth_rad + np.pi) % (2 * np.pi) - np.pi)


def _polls(
    path_s: Numbers,
    antenna_m: Numbers,
    heading_rad: Numbers,
    cone_m: Numbers,
    rng: np.random.Generator,
) -> _Polls:
    t_s = np.arange(rng.uniform(0, 0.1), path_s[-1], 1 / READINGS_PER_S)
    t_s = np.sort(np.clip(t_s + rng.uniform(-0.02, 0.02, len(t_s)), 0, path_s[-1]))
    at_m = np.stack([np.interp(t_s, path_s, axis) for axis in antenna_m.T], axis=1)
    ahead_rad = np.interp(t_s, path_s, heading_rad)
    towards_m = cone_m - at_m[:, :2]
    range_m = np.hypot(np.hypot(*towards_m.T), at_m[:, 2] - CONE_UP_M)
    answered = rng.random(len(t_s)) < 0.95 - 0.6 * (range_m / REACH_M) ** 3
    return _Polls(
        t_s,
        towards_m,
        np.column_stack([np.cos(ahead_rad), np.sin(ahead_rad)]),
        range_m,
        answered & (range_m < REACH_M),
        rng.normal(size=len(t_s)),
    )


def _truck_m(
    t_s: Numbers,
    trucks: Sequence[tuple[float, float, float]],
    hidden: NDArray[np.bool_],
    rng: np.random.Generator,
) -> Numbers:
    """Return what trucks between a cone and the vehicle make its ranges longer by."""
    more_m = np.zeros(len(t_s))
    for (start_s, stop_s, extra_m), behind in zip(trucks, hidden, strict=True):
        on = behind & (t_s >= start_s) & (t_s <= stop_s)
        more_m += on * extra_m * rng.gamma(4.0, 0.25, len(t_s))
    return more_m


def _ranged(
    cones_m: Numbers,
    delays_m: Numbers,
    neighbours: int,
    radios: Radios,
    rng: np.random.Generator,
) -> ConeRanges:
    """Range each cone to those nearest to it, through the delays of both."""
    apart_m = np.hypot(*(cones_m[:, None] - cones_m).transpose(2, 0, 1))
    nearest = np.argsort(apart_m, axis=1)[:, 1 : 1 + neighbours]
    pairs = {
        (min(a, b), max(a, b))
        for a, row in enumerate(nearest.tolist())
        for b in row
        if apart_m[a, b] < FURTHEST_CONE_M
    }
    a, b = np.repeat(np.array(sorted(pairs)), READINGS_PER_PAIR, axis=0).T
    range_m = apart_m[a, b] + radios.bias_m + delays_m[a] + delays_m[b]
    return ConeRanges(a, b, range_m + radios.noise_m * rng.normal(size=len(a)))
