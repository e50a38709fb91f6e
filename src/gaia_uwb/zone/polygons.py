"""Plane geometry: convex hull, intersection, IoU, Hausdorff distance, reflection.

Points are (east, north) in metres. Polygons are convex and given by points whose hull they are, in
any order, so a hull that has shrunk to a segment or a point needs no special case. Every sum runs
on coordinates relative to a point nearby: results are the same at UTM-sized coordinates.
"""

from __future__ import annotations

import numpy as np

from gaia_uwb._shared import Array, Float64, InputError, Int64


def convex_hull(points_m: Float64[Array, "N 2"]) -> Float64[Array, "K 2"]:
    """Return the convex hull of points.

    Parameters
    ----------
    points_m : (N, 2)
        East and north, in metres. Points that hold a NaN or an infinity (anchors that were not
        located) are ignored; whether that is right is the caller's decision.

    Returns
    -------
    (K, 2)
        The hull's corners, rows of ``points_m``, counter-clockwise, not closed. Fewer than 3 where
        the points enclose no area: 2 ends of a segment, 1 point, or none.

    Notes
    -----
    A corner must stand out from the segment between its neighbours by more than 1e-9 of the hull's
    size plus the coordinates' rounding: points on a line are still on one after being turned.

    Examples
    --------
    >>> convex_hull(np.array([[0.0, 0.0], [4.0, 0.0], [2.0, 1.0], [4.0, 3.0], [2.0, 0.0]])).tolist()
    [[0.0, 0.0], [4.0, 0.0], [4.0, 3.0]]
    """
    points_m = points_m[np.isfinite(points_m).all(axis=1)]
    return points_m[hull_index(points_m)]


def hull_index(points: Float64[Array, "N 2"]) -> Int64[Array, "K"]:
    """Return the rows of finite points that are corners of their hull, counter-clockwise."""
    if not len(points):
        return np.zeros(0, dtype=np.int64)
    local = points - points[0]
    order = np.lexsort((local[:, 1], local[:, 0]))
    hull = np.array(_half_hull(local, order) + _half_hull(local, order[::-1]) or [0])
    # The chain loses no extreme point, but keeps corners that are mere rounding.
    tolerance_m = 1e-9 * np.ptp(local, axis=0).max() + 8 * np.finfo(float).eps * abs(points).max()
    while len(hull) > 1:
        corner = local[hull]
        before, after = np.roll(corner, 1, axis=0), np.roll(corner, -1, axis=0)
        offset_m = _distance_to_segments(corner, before, after)
        flattest = int(np.argmin(offset_m))
        if offset_m[flattest] > tolerance_m:
            break
        hull = np.delete(hull, flattest)
    return hull


def _half_hull(points: Float64[Array, "N 2"], order: Int64[Array, "N"]) -> list[int]:
    """Return one half of Andrew's monotone chain, without its last point."""
    place = points.tolist()
    chain: list[int] = []
    for new in order.tolist():
        while len(chain) > 1:
            (x0, y0), (x1, y1), (x2, y2) = place[chain[-2]], place[chain[-1]], place[new]
            if (x1 - x0) * (y2 - y0) - (y1 - y0) * (x2 - x0) > 0:
                break
            chain.pop()
        chain.append(new)
    return chain[:-1]


def polygon_area(polygon_m: Float64[Array, "K 2"]) -> float:
    """Return the area inside a simple polygon, in square metres; 0 for fewer than 3 corners.

    Parameters
    ----------
    polygon_m : (K, 2)
        Corners in order, in either sense, not closed, in metres.

    Examples
    --------
    >>> polygon_area(np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 3.0]]))
    6.0
    """
    return abs(signed_area(polygon_m))


def signed_area(polygon: Float64[Array, "K 2"]) -> float:
    """Return the area, positive where the corners run counter-clockwise."""
    if len(polygon) < 3:
        return 0.0
    local = polygon - polygon[0]
    return 0.5 * float(cross(local, np.roll(local, -1, axis=0)).sum())


def convex_intersection(
    first_m: Float64[Array, "K 2"], second_m: Float64[Array, "L 2"]
) -> Float64[Array, "M 2"]:
    """Return the intersection of two convex polygons.

    Parameters
    ----------
    first_m, second_m : (K, 2), (L, 2)
        Points whose convex hulls are the polygons, in metres.

    Returns
    -------
    (M, 2)
        Its corners, counter-clockwise, not closed; none if the polygons are apart or either
        encloses no area, and fewer than 3 where they only touch.

    Examples
    --------
    >>> square = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]])
    >>> convex_intersection(square, square + 1.0).tolist()
    [[1.0, 1.0], [2.0, 1.0], [2.0, 2.0], [1.0, 2.0]]
    """
    corner, clip = convex_hull(first_m), convex_hull(second_m)
    if min(len(corner), len(clip)) < 3:
        return np.zeros((0, 2))
    origin = clip[0]
    corner, clip = corner - origin, clip - origin
    # Sutherland and Hodgman: cut along each edge; exact, because the clip polygon is convex.
    for start, end in zip(clip, np.roll(clip, -1, axis=0), strict=True):
        height = cross(end - start, corner - start)  # >= 0 on the inner side of the edge
        inside, following = height >= 0, np.roll(height, -1)
        crossing = inside != (following >= 0)
        fraction = np.where(crossing, height, 0.0) / np.where(crossing, height - following, 1.0)
        entry = corner + fraction[:, None] * (np.roll(corner, -1, axis=0) - corner)
        keep = np.stack([inside, crossing], axis=1)
        corner = np.stack([corner, entry], axis=1)[keep]
    return convex_hull(corner + origin)


def polygon_iou(first_m: Float64[Array, "K 2"], second_m: Float64[Array, "L 2"]) -> float:
    """Return the intersection over union of two convex polygons.

    Parameters
    ----------
    first_m, second_m : (K, 2), (L, 2)
        Points whose convex hulls are the polygons, in metres.

    Returns
    -------
    float
        Shared area over joint area, from 0 to 1; 0 where either polygon encloses no area.

    Examples
    --------
    >>> square = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]])
    >>> polygon_iou(square, square + [1.0, 0.0])
    0.3333333333333333
    """
    first_m2, second_m2 = (polygon_area(convex_hull(points)) for points in (first_m, second_m))
    shared_m2 = min(polygon_area(convex_intersection(first_m, second_m)), first_m2, second_m2)
    return shared_m2 / (first_m2 + second_m2 - shared_m2) if shared_m2 > 0 else 0.0


def hausdorff(first_m: Float64[Array, "K 2"], second_m: Float64[Array, "L 2"]) -> float:
    """Return the Hausdorff distance between the boundaries of two convex polygons.

    Parameters
    ----------
    first_m, second_m : (K, 2), (L, 2)
        Points whose convex hulls are the polygons, in metres. A hull that is a segment or a point
        is its own boundary.

    Returns
    -------
    float
        The distance in metres, exact up to rounding.

    Raises
    ------
    InputError
        If either has no finite point.

    Notes
    -----
    One boundary's supremum may lie inside an edge, where the edge crosses the other polygon's
    medial axis. The larger of the two suprema never needs such a point: let x on the boundary of A
    lie within B, at distance r from B's boundary. The disk of radius r around x belongs to B, and
    its point straight out from A, along the normal of a supporting line at x, is r away from A. So
    some point of B is at least r away from A; that distance is convex, hence largest at a corner
    of B, which lies outside A. Therefore the corners of both polygons are enough, and the result
    equals the distance between the filled polygons [1]_.

    References
    ----------
    .. [1] M. D. Wills, "Hausdorff distance and convex sets", J. Convex Analysis 14 (2007).

    Examples
    --------
    >>> square = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]])
    >>> hausdorff(square, square + [3.0, 0.0])
    3.0
    """
    first, second = convex_hull(first_m), convex_hull(second_m)
    if not (len(first) and len(second)):
        raise InputError("a Hausdorff distance needs a finite point on both sides, got none")
    gap_m = [
        _distance_to_segments(a[:, None], b, np.roll(b, -1, axis=0)).min(axis=1).max()
        for a, b in ((first, second), (second, first))
    ]
    return float(max(gap_m))


def reflect_in_line(
    points_m: Float64[Array, "N 2"], origin_m: Float64[Array, "2"], direction: Float64[Array, "2"]
) -> Float64[Array, "N 2"]:
    """Return the mirror images of points in a line.

    Parameters
    ----------
    points_m : (N, 2)
        East and north, in metres.
    origin_m : (2,)
        A point of the line, in metres.
    direction : (2,)
        Along the line, of any length above 0.

    Raises
    ------
    InputError
        If ``direction`` has no length or is not finite.

    Examples
    --------
    >>> reflect_in_line(np.array([[3.0, 1.0]]), np.zeros(2), np.array([1.0, 1.0])).round(9).tolist()
    [[1.0, 3.0]]
    """
    length = float(np.hypot(*direction))
    if not (np.isfinite(length) and length > 0):
        raise InputError(f"expected a direction with a length, got {direction}", column="direction")
    unit = direction / length
    local = points_m - origin_m
    return np.asarray(origin_m + 2.0 * (local @ unit)[:, None] * unit - local)


def cross(a: Array, b: Array) -> Array:
    """Return the third component of the cross product along the last axis."""
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def _distance_to_segments(point: Array, start: Array, end: Array) -> Array:
    """Return the distances from points to segments along the last axis, by broadcasting."""
    along = end - start
    squared = (along**2).sum(axis=-1)
    fraction = ((point - start) * along).sum(axis=-1) / np.where(squared > 0, squared, 1.0)
    offset = point - start - np.clip(fraction, 0.0, 1.0)[..., None] * along
    return np.asarray(np.hypot(offset[..., 0], offset[..., 1]))
