"""A short closed tour through points of the plane, for the ordered outline of a work zone.

A start tour through some of the points grows by farthest insertion; 2-opt exchanges and moves of
single points then shorten it until neither helps. In such a tour no two edges cross, because
uncrossing them would shorten it. The loops are compiled (``_tour.c``).
"""

from __future__ import annotations

import numpy as np

from gaia_uwb import _tour
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

    Raises
    ------
    ValueError
        If ``start`` is empty or names a row twice or one that is not there.

    Notes
    -----
    Time grows with the square of N, memory with N.

    Examples
    --------
    >>> corners = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0], [3.0, 2.0]])
    >>> short_tour(corners, start=np.array([0, 1, 2, 3])).tolist()
    [0, 1, 4, 2, 3]
    """
    n = len(points_m)
    tour = np.full(n, -1, dtype=np.int64)
    tour[: len(start)] = start
    points_m = np.ascontiguousarray(points_m, dtype=np.float64)
    _tour.short_tour(points_m, np.empty(n), tour, len(start))
    return tour
