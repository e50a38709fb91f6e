"""Where the boundary may be: a probability map, and outlines that hold with 90 % probability.

The true zone is the convex hull of the true places of the located anchors. From possible scenes
(``scene_samples.py``) follows, for every point of the ground, the probability ``p`` that it is
inside. Its level sets are nested regions; two of them are chosen by the scenes themselves so that
what they say holds *for the whole region at once*, not point by point (how many scenes are enough
for 90 % of real zones is in :class:`Levels`):

- **inner region**: ``{p > a}`` with the lowest ``a`` for which enough of the scenes' zones hold
  the whole region. With 90 % probability all of it is work zone. It is empty where no region
  has that property: all anchors may as well stand across the path.
- **outer region**: for each combination of sides, a convex region that leaves every scene's zone
  room in every direction: the mean of how far the zones reach there, plus k standard deviations;
  and the union of these. The combinations are the likeliest ones, until few are left out, and k is
  the lowest for which enough of all scenes' zones lie wholly within one of them. With 90 %
  probability nothing of the work zone is outside of it. Where sides are open it may have several
  pieces.

Point-wise 90 % level sets of ``p`` would be too large (inner) or too small (outer): a zone with
eight corners is seldom right at all eight. A level set of ``p`` would be no good outer region
either: so far out, only the very scenes from which ``p`` was counted have been.

How it is computed: in the zone's own axes, every scene's hull is cut by lines across it. On a line
each hull is an interval, so ``p`` is a step function whose steps are the intervals' ends, exact
without any grid in that direction. The lines stand close together where the hulls have their
corners. The highest ``p`` outside of a scene's hull tells which inner regions the hull holds.

>>> import numpy as np
>>> corners = np.array([[0.0, 0.0], [40.0, 0.0], [40.0, 8.0], [0.0, 8.0]])
>>> scenes = corners + np.random.default_rng(0).normal(0.0, 0.2, (1024, 4, 2))
>>> sure = boundary_uncertainty(scenes, np.zeros(1024, dtype=int))
>>> sure.inner.area_m2 < 320.0 < sure.outer.area_m2
True
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from gaia_uwb._shared import Array, Bool, Float64, Int64
from gaia_uwb.zone.hull_cuts import CutHulls, chords, scene_hulls
from gaia_uwb.zone.polygons import convex_hull

if TYPE_CHECKING:
    from shapely import Polygon

PROBABILITY = 0.9
"""Of each of the two statements."""


@dataclass(frozen=True)
class Levels:
    """Share of the scenes that a region must be right about, so that 90 % of true zones hold it.

    Were the scenes a perfect account of what is possible, both would be 0.9. They are not: walls
    and vehicles delay ranges in ways that a log does not show. So they were chosen on simulated
    passes of the preset ``wild``, its training layouts only, and on nothing that a test uses::

        python benchmarks/quality/boundary_coverage.py --calibrate --denoiser pose-kalman
        python benchmarks/quality/boundary_coverage.py --calibrate --denoiser gaia-set

    The first gave the defaults, the second what :meth:`of` returns of what was learned.

    Parameters
    ----------
    inner, outer
        Above 0, at most 1.
    """

    inner: float = 0.985
    outer: float = 0.772

    @classmethod
    def of(cls, *, learned: bool) -> Levels:
        """Return the levels for scenes of the solver, or of a denoiser that locates anchors.

        Parameters
        ----------
        learned
            Like :class:`~gaia_uwb.zone.Combinations`.
        """
        return cls(inner=0.90, outer=0.905) if learned else cls()


_SIMPLIFY_M = 0.002  # corners of a region that matter less are left out
_DIRECTIONS = 96
_FEWEST_FOR_SIGMA = 32  # scenes of a combination, else its spread is taken as that of all
_CELLS = 64  # of a probability map, along its longer side

Ring = Float64[Array, "_ 2"]


@dataclass(frozen=True)
class Region:
    """A part of the ground, in no, one or several pieces.

    Parameters
    ----------
    polygons
        Each has an exterior ring, counter-clockwise, and after it its holes, clockwise; (K, 2)
        arrays of corners in metres, not closed.
    area_m2
        Its area.
    """

    polygons: tuple[tuple[Ring, ...], ...]
    area_m2: float


@dataclass(frozen=True)
class ProbabilityMap:
    """The probability of being inside the work zone, on a grid.

    Parameters
    ----------
    origin_m : (2,)
        East and north of the south-western corner of the grid, in metres.
    cell_m
        Side of a cell, in metres.
    probability : (rows, columns)
        At the cells' centres; rows run north, columns east.
    """

    origin_m: Float64[Array, "2"]
    cell_m: float
    probability: Float64[Array, "rows columns"]


@dataclass(frozen=True)
class BoundaryUncertainty:
    """What the boundary may be instead; see the module's text for the definitions.

    Parameters
    ----------
    inner
        With ``probability`` all of it is inside the true zone.
    outer
        With ``probability`` all of the true zone is inside of it.
    probability
        Of each of the two statements.
    map
        The probability of being inside, point by point.
    """

    inner: Region
    outer: Region
    probability: float
    map: ProbabilityMap


def boundary_uncertainty(
    place_m: Float64[Array, "S N 2"],
    combination: Int64[Array, "S"],
    levels: Levels = Levels(),
) -> BoundaryUncertainty:
    """Find the inner and the outer region of possible scenes' zones.

    Parameters
    ----------
    place_m : (S, N, 2)
        Places of N anchors, at least 3, in S equally likely scenes, in metres; all finite.
    combination : (S,)
        Which combination of sides each scene belongs to.
    levels
        Shares of the scenes that the two regions must be right about.
    """
    origin_m = place_m.mean(axis=(0, 1))
    hulls = scene_hulls(place_m - origin_m)
    axes = _axes(hulls.reshape(-1, 2))
    turned = hulls @ axes
    place = _Place(origin_m, axes)
    lines = CutHulls.across(turned)
    inner = lines.intervals(lines.count > lines.inner_level(levels.inner))
    return BoundaryUncertainty(
        inner=place.region(_strips(lines.line, inner)),
        outer=place.region(_outer(turned, combination, levels.outer)),
        probability=PROBABILITY,
        map=_map(hulls, origin_m),
    )


def _outer(
    hulls: Float64[Array, "S K 2"], combination: Int64[Array, "S"], share: float
) -> list[Ring]:
    """Return the convex pieces of the outer region, one per combination."""
    # Directions are evenly spread over the zone's shape, not over the compass.
    size = np.maximum(np.std(hulls, axis=(0, 1)), 1e-9)
    angle = np.arange(_DIRECTIONS) * (2.0 * np.pi / _DIRECTIONS)
    direction = np.stack([np.cos(angle), np.sin(angle)])
    reach = (hulls / size @ direction).max(axis=1)  # (S, directions)
    kept, group = _likeliest(combination, 0.5 * (1.0 + share))
    drawn = reach[kept]
    mean = np.stack([drawn[group == g].mean(axis=0) for g in range(group.max() + 1)])
    off = drawn - mean[group]
    pooled = np.sqrt((off**2).mean(axis=0))
    sigma = np.stack(
        [
            np.sqrt((off[group == g] ** 2).mean(axis=0))
            if np.sum(group == g) >= _FEWEST_FOR_SIGMA
            else pooled
            for g in range(len(mean))
        ]
    )
    sigma = np.maximum(sigma, 1e-9)
    # A zone need not lie in its own combination's region: in any of them it is in their union.
    needed = np.min(
        [((reach - m) / s).max(axis=1) for m, s in zip(mean, sigma, strict=True)], axis=0
    )
    factor = np.sort(needed)[int(np.ceil(share * len(hulls))) - 1]
    return [_polygon(limit, direction) * size for limit in mean + factor * sigma]


def _likeliest(
    combination: Int64[Array, "S"], share: float
) -> tuple[Bool[Array, "S"], Int64[Array, "R"]]:
    """Return which scenes belong to the likeliest combinations that hold a share of all.

    The second is the kept scenes' combinations, numbered from 0.
    """
    value, group, count = np.unique(combination, return_inverse=True, return_counts=True)
    order = np.argsort(-count, kind="stable")
    needed = int(np.searchsorted(np.cumsum(count[order]), share * len(combination))) + 1
    number = np.full(len(value), -1)
    number[order[:needed]] = np.arange(min(needed, len(value)))
    return number[group] >= 0, number[group][number[group] >= 0]


def _polygon(limit: Float64[Array, "D"], direction: Float64[Array, "2 D"]) -> Ring:
    """Return the corners of the points whose reach in every direction is within its limit.

    By duality: about a point inside, the half-planes' normals over their distances span a hull
    whose edges are the region's corners.
    """
    centre = _middle(limit, direction)
    distance = np.maximum(limit - centre @ direction, 1e-9)
    edge = convex_hull((direction / distance).T)
    following = np.roll(edge, -1, axis=0)
    area = edge[:, 0] * following[:, 1] - edge[:, 1] * following[:, 0]
    corner = np.stack([following[:, 1] - edge[:, 1], edge[:, 0] - following[:, 0]], axis=1)
    return np.asarray(corner / np.maximum(area, 1e-12)[:, None] + centre)


def _middle(limit: Float64[Array, "D"], direction: Float64[Array, "2 D"]) -> Float64[Array, "2"]:
    """Return the middle of the limits' extent in each axis's direction, by least squares."""
    half = len(limit) // 2
    middle = 0.5 * (limit[:half] - limit[half:])
    solved, *_ = np.linalg.lstsq(direction[:, :half].T, middle)
    return np.asarray(solved)


def _axes(points: Float64[Array, "P 2"]) -> Float64[Array, "2 2"]:
    """Return the points' principal axes as columns, the longer first."""
    _, vector = np.linalg.eigh(np.cov(points.T))
    return np.asarray(vector[:, ::-1])


def _strips(line: Float64[Array, "R"], intervals: list[Float64[Array, "_ 2"]]) -> list[Ring]:
    """Return the quadrilaterals between neighbouring lines that a region covers."""
    return [
        np.array([(u0, a0), (u1, b0), (u1, b1), (u0, a1)])
        for u0, u1, here, there in zip(line, line[1:], intervals, intervals[1:], strict=False)
        for (a0, a1), (b0, b1) in _neighbours(here, there)
        if a1 > a0 or b1 > b0
    ]


@dataclass(frozen=True)
class _Place:
    """Where the zone's own axes lie."""

    origin_m: Float64[Array, "2"]
    axes: Float64[Array, "2 2"]

    def region(self, pieces: list[Ring]) -> Region:
        """Return the union of polygons given in the zone's own axes."""
        import shapely

        merged = shapely.union_all([shapely.Polygon(piece) for piece in pieces])
        merged = merged.simplify(_SIMPLIFY_M)
        parts = [p for p in getattr(merged, "geoms", [merged]) if p.geom_type == "Polygon"]
        polygons = tuple(self._rings(part) for part in parts if not part.is_empty)
        return Region(polygons, float(sum(part.area for part in parts)))

    def _rings(self, piece: Polygon) -> tuple[Ring, ...]:
        rings = []
        for k, ring in enumerate([piece.exterior, *piece.interiors]):
            corners_m = np.asarray(ring.coords)[:-1] @ self.axes.T + self.origin_m
            local = corners_m - corners_m[0]
            east, north = local.T
            twice_area = np.sum(east * np.roll(north, -1) - np.roll(east, -1) * north)
            rings.append(corners_m if bool(twice_area > 0) is (k == 0) else corners_m[::-1])
        return tuple(rings)


def _neighbours(
    here: Float64[Array, "I 2"], there: Float64[Array, "J 2"]
) -> list[tuple[Float64[Array, "2"], Float64[Array, "2"]]]:
    """Pair the stretches of two neighbouring lines that belong to one piece of a region."""
    if len(here) == len(there):
        return list(zip(here, there, strict=True))
    return [(a, b) for a in here for b in there if a[0] <= b[1] and b[0] <= a[1]]


def _map(hulls: Float64[Array, "S K 2"], origin_m: Float64[Array, "2"]) -> ProbabilityMap:
    """Count the hulls that hold the cells' centres of a grid, line by line."""
    low, high = hulls.min(axis=(0, 1)), hulls.max(axis=(0, 1))
    cell_m = float(max((high - low).max(), 1e-3)) / _CELLS
    columns, rows = np.maximum(np.ceil((high - low) / cell_m), 1.0).astype(int)
    north = low[1] + (np.arange(rows) + 0.5) * cell_m
    enter, leave = chords(hulls[..., ::-1], north)
    steps = np.zeros((rows, columns + 1))
    for values, sign in ((enter, 1.0), (leave, -1.0)):
        reached = np.isfinite(values)
        # The first cell whose centre is beyond the end.
        column = np.ceil((np.where(reached, values, 0.0) - low[0]) / cell_m - 0.5)
        column = np.clip(column, 0, columns).astype(int)
        flat = (np.arange(rows)[:, None] * (columns + 1) + column)[reached]
        steps += sign * np.bincount(flat, minlength=steps.size).reshape(steps.shape)
    return ProbabilityMap(origin_m + low, cell_m, np.cumsum(steps, axis=1)[:, :-1] / len(hulls))
