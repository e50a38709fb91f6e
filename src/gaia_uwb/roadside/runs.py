"""From drives to a line along the road: smooth paths, cut where they turn back.

A drive that turns round passes a zone twice, and several drives pass it in their own lanes, also in
opposite directions. Stations and offsets need one line. So every path is smoothed and cut into
*runs* wherever it turns back; the run that passes most cones, and of these the nearest to them, is
the line along the road. All other runs on this road are laid beside it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gaia_uwb._shared import Array, Float64, Int64
from gaia_uwb.roadside.road_line import DrivenPath, RoadLine

_STEP_M = 0.5  # closer points are jitter while the vehicle stands
_STAND_S, _STAND_MPS = 2.0, 0.2  # slower on average is standing
_SMOOTH_M = 2.5  # standard deviation of the kernel; in a bend of radius R it is off by 3.1 m² / R
_TURN_WITHIN_M, _TURN_RAD = 60.0, math.radians(135.0)  # what no road does, but a vehicle does
_TURNING_RAD = math.radians(60.0)
_SHORTEST_M = 10.0  # of a run that can be the line
_SIMPLIFY_M = 0.01  # a vertex that changes the line by less is left out
_ABEAM_M = 5.0  # a cone may stand this far beyond a run's end and was passed still
_LONGER = 2.0  # along a line than over the ground: it goes round the cones, or comes back to them
_SHARE_PASSED = 0.9  # of what the best run passes, to be a line as good
_EVERY = 4  # of a run's points that a driven path tells
_ALONG = 0.5  # of its length that a run makes along the line, to be on this road


@dataclass(frozen=True)
class Drive:
    """Where a vehicle was, and when.

    Parameters
    ----------
    name
        Of the pass.
    t_s : (T,)
        Increasing, in seconds.
    position_m : (T, 2)
        East and north, in metres.
    """

    name: str
    t_s: Float64[Array, "T"]
    position_m: Float64[Array, "T 2"]


@dataclass(frozen=True)
class Run:
    """A part of a drive without a turn, smoothed, with points at even distances.

    Parameters
    ----------
    name
        Of the pass.
    t_s : (P,)
        In seconds.
    place_m : (P, 2)
        East and north, in metres.
    """

    name: str
    t_s: Float64[Array, "P"]
    place_m: Float64[Array, "P 2"]

    @property
    def length_m(self) -> float:
        """Length of the run, in metres."""
        return float(np.hypot(*np.diff(self.place_m, axis=0).T).sum())

    def line(self) -> RoadLine:
        """Return the run without vertices that make no difference."""
        from shapely import LineString, get_coordinates

        kept = LineString(self.place_m).simplify(_SIMPLIFY_M, preserve_topology=False)
        return RoadLine.through(get_coordinates(kept))


def smooth(drive: Drive) -> Run | None:
    """Return the whole drive, smoothed; None where the vehicle stood all the time.

    Parameters
    ----------
    drive
        As it was recorded.
    """
    moving = _moving(drive.t_s, drive.position_m)
    place_m, t_s = drive.position_m[moving], drive.t_s[moving]
    kept = _moved(place_m)
    place_m, t_s = place_m[kept], t_s[kept]
    at_m = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(place_m, axis=0).T))])
    if at_m[-1] < 2.0 * _STEP_M:
        return None
    even_m = np.arange(0.0, at_m[-1] + 0.5 * _STEP_M, _STEP_M)
    t_s = np.interp(even_m, at_m, t_s)
    even = np.stack([np.interp(even_m, at_m, axis) for axis in place_m.T], axis=1)
    reach = min(int(3 * _SMOOTH_M / _STEP_M), len(even) - 1)
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) * _STEP_M / _SMOOTH_M) ** 2)
    # Reflected in its ends, a straight path stays as it is up to there.
    before, after = 2 * even[0] - even[reach:0:-1], 2 * even[-1] - even[-2 : -reach - 2 : -1]
    longer = np.concatenate([before, even, after])
    each = [np.convolve(axis, kernel / kernel.sum(), mode="valid") for axis in longer.T]
    return Run(drive.name, t_s, np.stack(each, axis=1))


def _moving(t_s: Float64[Array, "T"], position_m: Float64[Array, "T 2"]) -> Int64[Array, "K"]:
    """Return the rows at which the vehicle does not stand: there, positions are but noise.

    It stands where its mean places before and after are the same.
    """
    since = np.concatenate([np.zeros((1, 2)), np.cumsum(position_m, axis=0)])
    now = np.arange(len(t_s))
    before = np.minimum(np.searchsorted(t_s, t_s - _STAND_S), np.maximum(now - 1, 0))
    after = np.maximum(np.searchsorted(t_s, t_s + _STAND_S, side="right"), now + 2).clip(
        max=len(t_s)
    )
    past = (since[now + 1] - since[before]) / (now + 1 - before)[:, None]
    next_ = (since[after] - since[now]) / (after - now)[:, None]
    onwards_m = np.hypot(*(next_ - past).T)
    moves = onwards_m >= _STAND_MPS * _STAND_S
    moves[[0, -1]] = True
    return np.flatnonzero(moves)


def _moved(position_m: Float64[Array, "T 2"]) -> list[int]:
    """Return the rows at which the vehicle has moved on."""
    points = position_m.tolist()
    kept = [0]
    for k in range(1, len(points)):
        if math.dist(points[k], points[kept[-1]]) >= _STEP_M:
            kept.append(k)
    return kept


def cut_at_turns(run: Run) -> list[Run]:
    """Return the parts of a run between which it turns back; the turns themselves belong to none.

    Parameters
    ----------
    run
        From :func:`smooth`.
    """
    step = np.diff(run.place_m, axis=0)
    heading_rad = np.unwrap(np.arctan2(step[:, 1], step[:, 0]))
    found = []
    left = [(0, len(heading_rad))]
    while left:
        start, stop = left.pop()
        if stop - start < 2:
            continue
        part = heading_rad[start:stop]
        cut = _turn(part)
        if cut is None:
            found.append((start, stop))
            continue
        turning = np.abs(part - part[cut]) < _TURNING_RAD
        before, after = np.flatnonzero(~turning[:cut]), np.flatnonzero(~turning[cut:])
        if len(after):
            left.append((start + cut + int(after[0]), stop))
        if len(before):
            left.append((start, start + int(before[-1]) + 1))
    return [Run(run.name, run.t_s[a : b + 1], run.place_m[a : b + 1]) for a, b in sorted(found)]


def _turn(heading_rad: Float64[Array, "P"]) -> int | None:
    """Return the middle of the sharpest turn, or None where nothing turns back."""
    reach = int(0.5 * _TURN_WITHIN_M / _STEP_M)
    each = np.arange(len(heading_rad))
    first, last = np.maximum(each - reach, 0), np.minimum(each + reach, len(each) - 1)
    turned_rad = np.abs(heading_rad[last] - heading_rad[first])
    if turned_rad.max() < _TURN_RAD:
        return None
    sharpest = int(np.argmax(turned_rad))
    start, stop = first[sharpest], last[sharpest]
    halfway_rad = 0.5 * (heading_rad[start] + heading_rad[stop])
    return int(start + np.argmin(np.abs(heading_rad[start : stop + 1] - halfway_rad)))


def road_line(runs: Sequence[Run], place_m: Float64[Array, "M 2"]) -> RoadLine | None:
    """Return the line along the road: the run that passes most cones, of these the nearest.

    Parameters
    ----------
    runs
        All runs of all drives.
    place_m : (M, 2)
        Estimated places of the cones, in metres.

    Returns
    -------
    RoadLine or None
        None where no run is long enough.
    """
    lines = [run.line() for run in runs if run.length_m >= _SHORTEST_M]
    if not lines:
        return None
    extent_m = float(np.hypot(*np.ptp(place_m, axis=0)))
    passed, near_m = [], []
    for line in lines:
        station_m, offset_m = line.locate(place_m).T
        is_abeam = (station_m > -_ABEAM_M) & (station_m < line.length_m + _ABEAM_M)
        goes_round = np.ptp(station_m) > _LONGER * extent_m + _ABEAM_M
        passed.append(0 if goes_round else int(is_abeam.sum()))
        near_m.append(float(np.median(np.abs(offset_m))))
    enough = _SHARE_PASSED * max(passed)
    best = min((near, k) for k, near in enumerate(near_m) if passed[k] >= enough)
    return lines[best[1]]


def beside(line: RoadLine, runs: Sequence[Run]) -> tuple[DrivenPath, ...]:
    """Return the runs on the road of a line, in its order.

    Parameters
    ----------
    line
        Along the road.
    runs
        All runs of all drives.
    """
    found = []
    for run in runs:
        rows = np.unique([*range(0, len(run.place_m), _EVERY), len(run.place_m) - 1])
        station_m, offset_m = line.locate(run.place_m[rows]).T
        onwards_m = station_m[-1] - station_m[0]
        if abs(onwards_m) < max(_ALONG * run.length_m, _STEP_M):
            continue
        along = 1 if onwards_m > 0 else -1
        rows, station_m, offset_m = rows[::along], station_m[::along], offset_m[::along]
        # A path that wavers along the line is told once for every station.
        first = np.diff(np.maximum.accumulate(station_m), prepend=-np.inf) > 0
        rows = rows[first]
        found.append(
            DrivenPath(
                run.name, along, run.t_s[rows], run.place_m[rows], station_m[first], offset_m[first]
            )
        )
    return tuple(found)
