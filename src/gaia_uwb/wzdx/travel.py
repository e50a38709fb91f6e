"""The order in which a drive passes cones, and the stretch of its path along them.

The line of a work zone is the vehicle's own path from abeam of the first cone to abeam of the last
one: it lies on the road, follows its curves, and runs from upstream to downstream. Where the drive
passes the zone several times, it is the shortest stretch that passes every cone; of several about
as short, as there and back, the one nearest to the cones; of several about as near, the first.
"""

from __future__ import annotations

import math

import numpy as np

from gaia_uwb._shared import Array, Float64, Int64

_PASSING_FACTOR, _PASSING_MARGIN_M = 2.0, 10.0  # a passing much further away is another road's
_ABOUT_AS_SHORT, _SHORT_M, _ABOUT_AS_NEAR_M = 1.2, 5.0, 1.0
_RISE_M = 2.0  # between two passings of a cone the distance to it grows by more than jitter
_STEP_M = 0.5  # closer points of the path are jitter while the vehicle stands
_SIMPLIFIED_M = 0.05  # a point of the line that changes it by less is left out


def passed_at(path_m: Float64[Array, "T 2"], cones_m: Float64[Array, "K 2"]) -> Float64[Array, "K"]:
    """Return where along a path each cone was passed, within one passing of all of them.

    Parameters
    ----------
    path_m : (T, 2)
        East and north of the path, in metres.
    cones_m : (K, 2)
        East and north of the cones, in metres.

    Returns
    -------
    (K,)
        Distance along the path to the place abeam of each cone, in metres.

    Examples
    --------
    >>> import numpy as np
    >>> there_and_back_m = np.array([[0.0, 0.0], [50.0, 0.0], [0.0, 0.0]])
    >>> passed_at(there_and_back_m, np.array([[30.0, 4.0], [10.0, 4.0]]))
    array([30., 10.])
    """
    travelled_m = _travelled(path_m)
    passings = [_passings(path_m, travelled_m, cone_m) for cone_m in cones_m]
    cone = np.concatenate([np.full(len(at_m), k) for k, (at_m, _) in enumerate(passings)])
    at_m = np.concatenate([at_m for at_m, _ in passings])
    distance_m = np.concatenate([d for _, d in passings])
    order = np.argsort(at_m, kind="stable")
    cone, at_m, distance_m = cone[order], at_m[order], distance_m[order]
    first, last = _best_window(cone, at_m, distance_m, len(cones_m))
    found = np.empty(len(cones_m))
    for k in range(len(cones_m)):
        inside = first + np.flatnonzero(cone[first : last + 1] == k)
        found[k] = at_m[inside[np.argmin(distance_m[inside])]]
    return found


def _travelled(path_m: Float64[Array, "T 2"]) -> Float64[Array, "T"]:
    return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path_m, axis=0).T))])


def _passings(
    path_m: Float64[Array, "T 2"], travelled_m: Float64[Array, "T"], cone_m: Float64[Array, "2"]
) -> tuple[Float64[Array, "E"], Float64[Array, "E"]]:
    """Return where a path comes nearest to a cone, each time that it does, and how near."""
    start_m, step_m = path_m[:-1], np.diff(path_m, axis=0)
    length2_m2 = np.maximum(np.sum(step_m**2, axis=1), 1e-18)
    share = np.clip(np.sum((cone_m - start_m) * step_m, axis=1) / length2_m2, 0.0, 1.0)
    near_m = np.hypot(*(start_m + share[:, None] * step_m - cone_m).T)  # of each segment
    lowest = _valleys(near_m)
    lowest = lowest[near_m[lowest] <= _PASSING_FACTOR * near_m.min() + _PASSING_MARGIN_M]
    at_m = travelled_m[:-1] + share * np.diff(travelled_m)
    return at_m[lowest], near_m[lowest]


def _valleys(values_m: Float64[Array, "E"]) -> Int64[Array, "V"]:
    """Return the indices of the lowest values between rises by more than jitter."""
    turns = np.flatnonzero(np.diff(np.sign(np.diff(values_m)))) + 1
    found: list[int] = []
    low, high, falling = 0, 0, True
    for k in (*turns.tolist(), len(values_m) - 1):
        if falling:
            low = k if values_m[k] < values_m[low] else low
            if values_m[k] > values_m[low] + _RISE_M:
                found.append(low)
                high, falling = k, False
        else:
            high = k if values_m[k] > values_m[high] else high
            if values_m[k] < values_m[high] - _RISE_M:
                low, falling = k, True
    return np.array(found + [low] * falling, dtype=np.int64)


def _best_window(
    cone: Int64[Array, "E"],
    at_m: Float64[Array, "E"],
    distance_m: Float64[Array, "E"],
    n_cones: int,
) -> tuple[int, int]:
    """Return the first of the about nearest of the about shortest runs with every cone."""
    windows = _windows(cone, n_cones)
    length_m = np.array([at_m[last] - at_m[first] for first, last in windows])
    short = np.flatnonzero(length_m <= _ABOUT_AS_SHORT * length_m.min() + _SHORT_M)
    near_m = np.empty(len(short))
    for k, window in enumerate(short):
        first, last = windows[window]
        nearest_m = np.full(n_cones, np.inf)
        np.minimum.at(nearest_m, cone[first : last + 1], distance_m[first : last + 1])
        near_m[k] = nearest_m.mean()
    chosen = short[np.argmax(near_m <= near_m.min() + _ABOUT_AS_NEAR_M)]
    return windows[int(chosen)]


def _windows(cone: Int64[Array, "E"], n_cones: int) -> list[tuple[int, int]]:
    """Return, for every last passing, the shortest run up to it that holds every cone."""
    count = np.zeros(n_cones, dtype=np.int64)
    missing, first = n_cones, 0
    found: list[tuple[int, int]] = []
    for last in range(len(cone)):
        missing -= int(count[cone[last]] == 0)
        count[cone[last]] += 1
        while count[cone[first]] > 1:
            count[cone[first]] -= 1
            first += 1
        if not missing:
            found.append((first, last))
    return found


def thinned(path_m: Float64[Array, "T 2"]) -> Float64[Array, "S 2"]:
    """Return a path without the points at which the vehicle has hardly moved on.

    Parameters
    ----------
    path_m : (T, 2)
        East and north, in metres.

    Returns
    -------
    (S, 2)
        Points at least half a metre from each other in turn, and the last point; at least two.
    """
    points = path_m.tolist()
    kept = [0]
    for k in range(1, len(points) - 1):
        if math.dist(points[k], points[kept[-1]]) >= _STEP_M:
            kept.append(k)
    return path_m[[*kept, len(points) - 1]]


def stretch(path_m: Float64[Array, "T 2"], from_m: float, to_m: float) -> Float64[Array, "P 2"]:
    """Return a path between two distances along it, without points that make no difference.

    Parameters
    ----------
    path_m : (T, 2)
        East and north of the path, in metres.
    from_m, to_m
        Distances along the path, in metres, the first one not larger.

    Returns
    -------
    (P, 2)
        East and north, in metres; fewer than two points if the path has no length between the ends.
    """
    from shapely import LineString, get_coordinates

    travelled_m = _travelled(path_m)
    inside = (travelled_m > from_m) & (travelled_m < to_m)
    at_m = np.concatenate([[from_m], travelled_m[inside], [to_m]])
    line_m = np.stack([np.interp(at_m, travelled_m, axis) for axis in path_m.T], axis=1)
    if np.ptp(line_m, axis=0).max() < _SIMPLIFIED_M:
        return line_m[:1]
    kept = LineString(line_m).simplify(_SIMPLIFIED_M, preserve_topology=False)
    return np.asarray(get_coordinates(kept))
