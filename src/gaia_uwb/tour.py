"""A short closed tour through points of the plane, for the ordered outline of a work zone.

A start tour through some of the points grows by farthest insertion; 2-opt exchanges and moves of
single points then shorten it until neither helps. In such a tour no two edges cross, because
uncrossing them would shorten it. Inside, points are complex numbers: ``abs`` is the distance.
"""

from __future__ import annotations

import numpy as np

from gaia_uwb._typing import Array, Float64, Int64


def short_tour(points_m: Float64[Array, "N 2"], start: Int64[Array, "K"]) -> Int64[Array, "N"]:
    """Return a short closed tour through all points.

    Parameters
    ----------
    points_m : (N, 2)
        Finite points, no two in one place, in metres.
    start : (K,)
        Rows of ``points_m`` that make up the first tour, at least one.

    Returns
    -------
    (N,)
        All rows in the order of the tour, which no exchange of two edges and no move of a single
        point shortens. It crosses itself only where all points stand on one line: it goes there
        in order and comes back.

    Notes
    -----
    Time grows with the square of N, memory with N.

    Examples
    --------
    >>> corners = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0], [3.0, 2.0]])
    >>> short_tour(corners, start=np.array([0, 1, 2, 3])).tolist()
    [0, 1, 4, 2, 3]
    """
    place = (points_m - points_m[0]) @ np.array([1.0, 1.0j])
    # Every change must gain more than rounding, so that the tour cannot go round in circles.
    least_gain_m = 1e-12 * float(abs(place).max())
    tour = _insert_farthest_first(place, start)
    length_m = np.inf
    while (shorter_m := float(_edges(place[tour]).sum())) < length_m:
        length_m = shorter_m
        tour = _move_single_points(place, _exchange_edges(place, tour, least_gain_m), least_gain_m)
    return tour


def _edges(visited: Array) -> Array:
    """Return the length of the edge that leaves each visited point."""
    return np.asarray(abs(np.roll(visited, -1) - visited))


def _insert_farthest_first(place: Array, tour: Array) -> Array:
    """Return the tour grown to all points; the one farthest from its points comes next."""
    gap = abs(place[:, None] - place[tour]).min(axis=1)
    gap[tour] = -np.inf
    for _ in range(len(place) - len(tour)):
        new = int(np.argmax(gap))
        tour = _insert(place, tour, new)[0]
        gap = np.minimum(gap, abs(place - place[new]))
        gap[new] = -np.inf
    return tour


def _insert(place: Array, tour: Array, new: int) -> tuple[Array, float]:
    """Return the tour with a point added where that lengthens it least, and by how much."""
    visited = place[tour]
    to_new = abs(visited - place[new])
    detour = to_new + np.roll(to_new, -1) - _edges(visited)
    best = int(np.argmin(detour))
    return np.insert(tour, best + 1, new), float(detour[best])


def _exchange_edges(place: Array, tour: Array, least_gain_m: float) -> Array:
    """Return the tour after one sweep of 2-opt: each edge is exchanged with its best partner."""
    for k in range(len(tour) - 2):
        here = place[tour]
        following = np.roll(here, -1)
        edge = _edges(here)
        gain = edge[k] + edge - abs(here - here[k]) - abs(following - following[k])
        other = k + 1 + int(np.argmax(gain[k + 1 :]))
        if gain[other] > least_gain_m:
            tour = np.concatenate([tour[: k + 1], tour[other:k:-1], tour[other + 1 :]])
    return tour


def _move_single_points(place: Array, tour: Array, least_gain_m: float) -> Array:
    """Return the tour after each point in turn was moved to where the tour gets shortest."""
    for point in range(len(tour) if len(tour) > 3 else 0):
        k = int(np.argmax(tour == point))
        before, after = place[tour[k - 1]], place[tour[(k + 1) % len(tour)]]
        saved = abs(place[point] - before) + abs(after - place[point]) - abs(after - before)
        moved, cost = _insert(place, np.delete(tour, k), point)
        if saved - cost > least_gain_m:
            tour = moved
    return tour
