"""Drives along real roads past tapers of cones, by code of its own.

What the program is developed on must not be all that it is judged on. These drives have other
roads (straight, or bends of any radius), another law of every error, latitude and longitude, and
readings at their own times, radio by radio. Times are in seconds, lengths in metres.

>>> drive = road_drives("two lanes", seed=0)[0]
>>> drive.n_anchors, drive.frame is not None
(35, True)
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from gaia_uwb.scene import LocalFrame, RangeLog, Scene, Trajectory, Truth

Numbers = NDArray[np.float64]

KINDS = ("single", "two lanes", "opposite directions", "u-turn")
LANE_M = 3.6
REACH_M = 75.0
TAG_UP_M, CONE_UP_M = 1.9, 0.8
POSES_PER_S, READINGS_PER_S = 20.0, 10.0


@dataclass(frozen=True)
class Radios:
    """The errors of all radios of a drive.

    Parameters
    ----------
    noise_m
        Standard deviation of the white part.
    bias_m
        What all ranges are too long by.
    delay_m
        Standard deviation of each cone's own delay.
    offset_s
        Added to the time of every reading.
    trucks_per_s
        How often a truck comes between the vehicle and the cones.
    tag_pattern_m, cone_pattern_m
        Standard deviation of what the range depends on the direction by: each of two harmonics of
        the bearing from the vehicle's course, and of one of the bearing from the cone.
    clock_spread_s
        Standard deviation of a drive's own clock offset about that of all.
    """

    noise_m: float = 0.06
    bias_m: float = 0.15
    delay_m: float = 0.03
    offset_s: float = 0.12
    trucks_per_s: float = 0.08
    tag_pattern_m: float = 0.0
    cone_pattern_m: float = 0.0
    clock_spread_s: float = 0.0


WITH_PATTERNS = Radios(tag_pattern_m=0.05, cone_pattern_m=0.03, clock_spread_s=0.005)
"""Radios whose antennas are not alike in all directions."""


@dataclass(frozen=True)
class Road:
    """A lane's line of constant curvature through (0, 0), where it runs in a given direction.

    Parameters
    ----------
    heading_rad
        Direction of travel at the start, from east to north.
    curvature_per_m
        Positive bends to the left.
    """

    heading_rad: float
    curvature_per_m: float

    def place(self, along_m: Numbers, left_m: Numbers | float) -> Numbers:
        """Return the places (n, 2) at a station and an offset to the left of the line."""
        turned = self.curvature_per_m * along_m
        # sinc keeps the chord of a straight road, where the arc has no centre.
        chord = along_m * np.sinc(turned / 2 / np.pi)
        middle, heading = self.heading_rad + turned / 2, self.heading_rad + turned
        line = chord[:, None] * np.stack([np.cos(middle), np.sin(middle)], axis=1)
        return line + np.asarray(left_m)[..., None] * np.stack(
            [-np.sin(heading), np.cos(heading)], axis=1
        )


class Line(Protocol):
    """A lane's line: places at stations along it and offsets to its left."""

    def place(self, along_m: Numbers, left_m: Numbers | float) -> Numbers:
        """Return the places (n, 2)."""
        ...


def lanes(kind: str, away_m: float) -> list[tuple[float, int]]:
    """Return where drives of a kind are beside the first lane, and in which direction they go.

    Direction 0 is out on the first lane and back on another one.
    """
    return {
        "single": [(0.0, 1)],
        "two lanes": [(0.0, 1), (away_m, 1)],
        "opposite directions": [(0.0, 1), (2 * away_m, -1)],
        "u-turn": [(4 * away_m, 0)],
    }[kind]


def road_drives(
    kind: str, seed: int, *, radius_m: float | None = None, radios: Radios = Radios()
) -> list[Scene]:
    """Return the drives past one zone, with their truth.

    Parameters
    ----------
    kind
        One of :data:`KINDS`.
    seed
        Of everything that is drawn: road, cones, speeds, errors.
    radius_m
        Of the bend; None draws a straight road or one of 300 to 2,000 m.
    radios
        The errors.
    """
    rng = np.random.default_rng([20261130, KINDS.index(kind), seed])
    drawn_m = rng.choice([np.inf, rng.uniform(300.0, 2000.0)]) if radius_m is None else radius_m
    road = Road(rng.uniform(0, 2 * np.pi), rng.choice([-1, 1]) / drawn_m)
    along_m, left_m = _cones(rng)
    away = -np.sign(left_m[0])  # the other lanes lie beyond the first, as seen from the cones
    cones = road.place(along_m, left_m)
    frame = LocalFrame(48.1 + rng.normal(0, 0.2), 11.6 + rng.normal(0, 0.2), 510.0)
    delays_m = radios.delay_m * rng.normal(size=len(cones))
    other = np.random.default_rng([20261201, KINDS.index(kind), seed])
    turned_m = radios.cone_pattern_m * other.normal(size=(len(cones), 2))
    start_m, stop_m = along_m[0] - 100.0, along_m[-1] + 100.0
    scenes = []
    for number, (lane_m, direction) in enumerate(lanes(kind, away * LANE_M)):
        path = driven(road, start_m, stop_m, lane_m, direction, rng)
        name = f"road-{kind.replace(' ', '-')}-{seed}-{number}"
        drive = replace(
            radios,
            offset_s=radios.offset_s + radios.clock_spread_s * other.normal(),
        )
        lasting = Lasting(delays_m, turned_m, radios.tag_pattern_m * other.normal(size=4))
        scenes.append(measured(name, path, cones, lasting, frame, drive, rng))
    return scenes


def _cones(rng: np.random.Generator) -> tuple[Numbers, Numbers]:
    """Return station and offset of 20 to 40 cones: a taper from the shoulder, and a line after."""
    n = int(rng.integers(20, 41))
    spacing_m, side = rng.uniform(8.0, 18.0), rng.choice([-1, 1])
    n_taper = int(rng.integers(5, 9))
    far_m, near_m = rng.uniform(4.5, 5.5), rng.uniform(1.9, 2.4)
    share = np.clip(np.arange(n) / n_taper, 0.0, 1.0)
    along_m = spacing_m * np.arange(n) + rng.normal(0, 0.4, n)
    offset_m = far_m + share * (near_m - far_m) + rng.normal(0, 0.08, n)
    return along_m, side * offset_m


def driven(
    road: Line,
    start_m: float,
    stop_m: float,
    lane_m: float,
    direction: int,
    rng: np.random.Generator,
) -> Trajectory:
    """Drive from end to end of a lane; with direction 0 out on the first lane and back on it."""
    step_s = 1 / POSES_PER_S
    speed_mps = rng.uniform(14.0, 18.5)
    length_m = stop_m - start_m
    n = int(length_m / speed_mps / step_s)
    t_s = step_s * np.arange(n)
    ripple = 0.03 * np.sin(2 * np.pi * t_s / rng.uniform(15.0, 40.0))
    went_m = np.clip(speed_mps * (t_s + ripple), 0, length_m)
    if direction:
        station_m = start_m + went_m if direction > 0 else stop_m - went_m
        place = road.place(station_m, lane_m + wander(station_m, rng))
        return _trajectory(t_s, place)
    steady = np.clip(np.minimum(went_m, went_m[-1] - went_m) / 30.0, 0.0, 1.0)
    out = road.place(start_m + went_m, steady * wander(went_m, rng))
    end_m = start_m + went_m[-1]
    back = road.place(end_m - went_m, lane_m + steady * wander(went_m, rng))
    half_m = lane_m / 2
    turn_s = np.pi * abs(half_m) / 4.0  # at 4 m/s
    angle = np.pi * np.arange(step_s, turn_s, step_s) / turn_s
    turn = road.place(end_m + abs(half_m) * np.sin(angle), half_m * (1 - np.cos(angle)))
    place = np.concatenate([out, turn, back])
    return _trajectory(step_s * np.arange(len(place)), place)


def wander(along_m: Numbers, rng: np.random.Generator) -> Numbers:
    """Return how far a driver is beside the middle of the lane: 0.12 m, over tens of metres."""
    waves = [(rng.uniform(35.0, 150.0), rng.uniform(0, 2 * np.pi)) for _ in range(6)]
    each = [np.sin(2 * np.pi * along_m / length_m + phase) for length_m, phase in waves]
    return np.asarray(0.12 * np.sqrt(2 / len(waves)) * np.sum(each, axis=0))


def _trajectory(t_s: Numbers, place: Numbers) -> Trajectory:
    return Trajectory(t_s=t_s, position_m=place, up_m=np.full(len(t_s), TAG_UP_M))


@dataclass(frozen=True)
class Lasting:
    """Errors that stay as they are: the cones' delays, and what depends on directions."""

    delays_m: Numbers
    cones_m: Numbers
    tag_m: Numbers

    def error_m(self, cone: int, towards_m: Numbers, ahead_m: Numbers) -> Numbers:
        """Return what ranges to a cone in these directions are too long by."""
        bearing = np.arctan2(towards_m[:, 1], towards_m[:, 0])
        turned = bearing - np.arctan2(ahead_m[:, 1], ahead_m[:, 0])
        waves = [np.cos(turned), np.sin(turned), np.cos(2 * turned), np.sin(2 * turned)]
        own = [np.cos(bearing), np.sin(bearing)]
        return np.asarray(self.delays_m[cone] + self.tag_m @ waves + self.cones_m[cone] @ own)


def _ahead(path: Trajectory, t_s: Numbers) -> Numbers:
    """Return the way of half a second around each time."""
    ends = [
        np.stack([np.interp(t_s + by_s, path.t_s, x) for x in path.position_m.T], axis=1)
        for by_s in (-0.25, 0.25)
    ]
    return np.asarray(ends[1] - ends[0])


def measured(
    name: str,
    path: Trajectory,
    cones: Numbers,
    lasting: Lasting,
    frame: LocalFrame,
    radios: Radios,
    rng: np.random.Generator,
) -> Scene:
    """Measure every cone within reach at its own times, through the radios' errors."""
    trucks = trucks_past(path.t_s[-1], radios.trucks_per_s, rng)
    parts = []
    for k, cone in enumerate(cones):
        t_s = np.arange(rng.uniform(0, 0.1), path.t_s[-1], 1 / READINGS_PER_S)
        t_s = np.sort(np.clip(t_s + rng.uniform(-0.02, 0.02, len(t_s)), 0, path.t_s[-1]))
        tag = np.stack([np.interp(t_s, path.t_s, x) for x in path.position_m.T], axis=1)
        flat_m = np.hypot(*(tag - cone).T)
        true_m = np.hypot(flat_m, TAG_UP_M - CONE_UP_M)
        heard = (true_m < REACH_M) & (rng.random(len(t_s)) < 0.95 - 0.6 * (true_m / REACH_M) ** 3)
        error_m = radios.bias_m + radios.noise_m * rng.normal(size=len(t_s))
        error_m += lasting.error_m(k, cone - tag, _ahead(path, t_s))
        behind, more_m = np.zeros(len(t_s), np.bool_), np.zeros(len(t_s))
        for start_s, stop_s, extra_m in trucks:
            hidden = (t_s >= start_s) & (t_s <= stop_s) & (rng.random() < 0.7)
            behind |= hidden
            more_m += hidden * extra_m * rng.gamma(4.0, 0.25, len(t_s))
        range_m = true_m + error_m + more_m
        parts.append((k, t_s[heard], range_m[heard], true_m[heard], behind[heard]))
    anchor = np.concatenate([np.full(len(t_s), k) for k, t_s, *_ in parts]).astype(np.int64)
    t_s, range_m, true_m = (np.concatenate([part[i] for part in parts]) for i in (1, 2, 3))
    behind = np.concatenate([part[4] for part in parts])
    order = np.argsort(t_s, kind="stable")
    ids = tuple(f"c{k:02d}" for k in range(len(cones)))
    return Scene(
        name=name,
        trajectory=path,
        ranges=RangeLog(t_s[order] + radios.offset_s, anchor[order], range_m[order]),
        anchor_ids=ids,
        anchor_up_m=np.full(len(cones), CONE_UP_M),
        frame=frame,
        truth=Truth(
            anchor_m=cones,
            range_m=true_m[order],
            nlos=behind[order],
            clock_offset_s=radios.offset_s,
        ),
    )


def trucks_past(
    duration_s: float, per_s: float, rng: np.random.Generator
) -> list[tuple[float, float, float]]:
    """Return start, end and extra length of the times that a truck is in the way."""
    n = rng.poisson(per_s * duration_s)
    starts = np.sort(rng.uniform(0, duration_s, n))
    return [(s, s + rng.uniform(0.5, 2.5), rng.uniform(0.3, 2.0)) for s in starts]
