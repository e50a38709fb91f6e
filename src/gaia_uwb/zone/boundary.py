"""The boundary of a zone: the convex hull of its anchors, and an outline that visits all of them.

The outline is a short closed tour. A start tour through some of the points grows by farthest
insertion; 2-opt exchanges and moves of single points then shorten it until neither helps. In such a
tour no two edges cross, because uncrossing them would shorten it. The loops are compiled
(``_tour.c``).
"""

from __future__ import annotations

import numpy as np

from gaia_uwb._shared import Array, Float64, Int64
from gaia_uwb.estimate import Boundary, BoundaryStatus
from gaia_uwb.zone import _tour
from gaia_uwb.zone.polygons import convex_hull, hull_index, polygon_area, signed_area


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


def ordered_outline(points_m: Float64[Array, "N 2"]) -> tuple[int, ...]:
    """Return the order in which a closed outline visits all points without crossing itself.

    Where cones follow a bend, the outline does too, while the hull cuts across. It is a short
    closed tour grown from the hull; see :func:`gaia_uwb.zone.boundary.short_tour`.

    Parameters
    ----------
    points_m : (N, 2)
        East and north, in metres. Points that hold a NaN or an infinity are left out.

    Returns
    -------
    tuple of int
        Rows of ``points_m``, counter-clockwise, from the lowest row on. Points in one place
        follow one another.

    Examples
    --------
    >>> ordered_outline(np.array([[0.0, 0.0], [4.0, 0.0], [0.0, 4.0], [2.0, 1.0], [4.0, 4.0]]))
    (0, 3, 1, 4, 2)
    """
    located = np.flatnonzero(np.isfinite(points_m).all(axis=1))
    if not len(located):
        return ()
    # Points in one place are one stop of the tour.
    place_m, stop = np.unique(points_m[located], axis=0, return_inverse=True)
    stop = stop.ravel()  # NumPy 2.0 gave it a second axis
    tour = short_tour(place_m, start=hull_index(place_m))
    if signed_area(place_m[tour]) < 0:
        tour = tour[::-1]
    tour = np.roll(tour, -int(np.argmax(tour == stop[0])))
    return tuple(int(row) for visited in tour for row in located[stop == visited])


def make_boundary(points_m: Float64[Array, "N 2"]) -> Boundary:
    """Return the hull and the ordered outline of the located anchors.

    Parameters
    ----------
    points_m : (N, 2)
        East and north of the anchors, in metres; NaN for an anchor without a position.

    Returns
    -------
    Boundary
        Status ``too-few-anchors`` with fewer than 3 located anchors, ``collinear`` where they
        stand on one line or in one place, else ``ok``.

    Examples
    --------
    >>> boundary = make_boundary(np.array([[0.0, 0.0], [4.0, 0.0], [0.0, 3.0]]))
    >>> boundary.status.value, boundary.area_m2
    ('ok', 6.0)
    """
    hull_m, order = convex_hull(points_m), ordered_outline(points_m)
    status = BoundaryStatus.OK
    if len(order) < 3:
        status = BoundaryStatus.TOO_FEW_ANCHORS
    elif len(hull_m) < 3:
        status = BoundaryStatus.COLLINEAR
    return Boundary(hull_m, points_m[list(order)], order, polygon_area(hull_m), status)
