""""""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given
from shapely import LinearRing, MultiPoint, Point, Polygon

from gaia_uwb._shared.errors import InputError
from gaia_uwb.evaluate.rigid_alignment import rotation_matrix
from gaia_uwb.zone.polygons import (
    convex_hull,
    convex_intersection,
    hausdorff,
    polygon_area,
    polygon_iou,
    reflect_in_line,
)
from point_clouds import EAST, NOWHERE, SQUARE, UTM, angles, clouds, moved, quick, small_grids


def sampled_boundary(corners: np.ndarray, n: int = 4000) -> np.ndarray:
    """Corners and n points of each edge."""
    fraction = np.arange(n)[:, None] / n
    ends = np.roll(corners, -1, axis=0)
    return np.concatenate([a + fraction * (b - a) for a, b in zip(corners, ends, strict=True)])


class TestConvexHull:
    @quick
    @given(clouds(1) | small_grids())
    def test_is_shapelys(self, points: np.ndarray) -> None:
        hull = convex_hull(points)
        reference = MultiPoint(points).convex_hull
        assert {tuple(p) for p in hull} <= {tuple(p) for p in points}
        if reference.geom_type == "Polygon":
            assert Polygon(hull).normalize() == reference.normalize()
            assert LinearRing(hull).is_ccw
        else:
            assert len(hull) == len(reference.coords)
            assert {tuple(p) for p in hull} == set(reference.coords)

    @quick
    @given(small_grids(), angles)
    def test_keeps_its_corners_when_turned_and_shifted_far(
        self, points: np.ndarray, angle_rad: float
    ) -> None:
        here, there = convex_hull(points), convex_hull(moved(points, angle_rad))
        assert len(there) == len(here)
        order = np.lexsort(moved(here, angle_rad).round(5).T)
        np.testing.assert_allclose(
            there[np.lexsort(there.round(5).T)], moved(here, angle_rad)[order], atol=1e-6
        )

    @pytest.mark.parametrize("angle_rad", np.linspace(0.0, np.pi, 25))
    @pytest.mark.parametrize("shift", [np.zeros(2), UTM])
    def test_points_on_a_line_have_two_ends(self, angle_rad: float, shift: np.ndarray) -> None:
        along = np.array([3.0, 0.0, 1.0, 7.0, 0.1, 5.5, 7.0])
        line = moved(np.stack([along, np.zeros(7)], axis=1), angle_rad, shift)
        hull = convex_hull(line)
        assert sorted(np.argmin(np.hypot(*(line - end).T)) for end in hull) == [1, 3]

    def test_keeps_a_corner_of_a_millimetre_on_a_kilometre(self) -> None:
        assert len(convex_hull(np.array([[0.0, 0.0], [1000.0, 0.0], [500.0, 0.001]]) + UTM)) == 3

    def test_ignores_points_that_were_not_located(self) -> None:
        points = np.concatenate([NOWHERE, SQUARE, [[np.inf, 0.0]]])
        np.testing.assert_array_equal(convex_hull(points), SQUARE)

    def test_of_nothing_is_nothing(self) -> None:
        assert convex_hull(NOWHERE).shape == (0, 2)
        assert convex_hull(np.zeros((0, 2))).shape == (0, 2)


class TestArea:
    def test_takes_either_sense_and_any_simple_polygon(self) -> None:
        arrow = np.array([[0.0, 0.0], [4.0, 0.0], [1.0, 1.0], [0.0, 4.0]])
        assert polygon_area(arrow) == polygon_area(arrow[::-1]) == 4.0

    @pytest.mark.parametrize("n", [0, 1, 2])
    def test_is_zero_below_three_corners(self, n: int) -> None:
        assert polygon_area(SQUARE[:n]) == 0.0

    def test_loses_nothing_far_from_the_origin(self) -> None:
        assert polygon_area(SQUARE + UTM) == pytest.approx(4.0, abs=1e-6)


class TestIntersection:
    @quick
    @given(clouds(), clouds())
    def test_is_shapelys(self, first: np.ndarray, second: np.ndarray) -> None:
        reference = MultiPoint(first).convex_hull.intersection(MultiPoint(second).convex_hull)
        shared = convex_intersection(first, second)
        assert polygon_area(shared) == pytest.approx(reference.area, abs=1e-6)
        if len(shared) >= 3:
            assert all(reference.distance(Point(corner)) < 1e-6 for corner in shared)
            assert LinearRing(shared).is_ccw

    def test_of_polygons_apart_is_empty(self) -> None:
        assert convex_intersection(SQUARE, SQUARE + 5.0).shape == (0, 2)

    @pytest.mark.parametrize("shift", [[2.0, 0.5], [2.0, 2.0]])
    def test_of_polygons_that_touch_has_no_area(self, shift: list[float]) -> None:
        assert polygon_area(convex_intersection(SQUARE, SQUARE + shift)) == 0.0

    def test_of_a_polygon_inside_is_that_polygon(self) -> None:
        inner = SQUARE / 4.0 + 0.5
        np.testing.assert_array_equal(convex_intersection(SQUARE, inner), inner)
        np.testing.assert_array_equal(convex_intersection(inner, SQUARE), inner)


class TestIou:
    @quick
    @given(clouds(), clouds(), angles)
    def test_is_shapelys_symmetric_and_the_same_anywhere(
        self, first: np.ndarray, second: np.ndarray, angle_rad: float
    ) -> None:
        a, b = MultiPoint(first).convex_hull, MultiPoint(second).convex_hull
        assume(min(a.area, b.area) > 0.1)
        iou = polygon_iou(first, second)
        assert iou == pytest.approx(a.intersection(b).area / a.union(b).area, abs=1e-9)
        assert polygon_iou(second, first) == pytest.approx(iou, abs=1e-9)
        there = polygon_iou(moved(first, angle_rad), moved(second, angle_rad))
        assert there == pytest.approx(iou, abs=1e-6)

    @quick
    @given(clouds())
    def test_is_one_only_with_itself(self, points: np.ndarray) -> None:
        assume(MultiPoint(points).convex_hull.area > 0.1)
        assert polygon_iou(points, points) == pytest.approx(1.0, abs=1e-12)
        assert polygon_iou(points, points + EAST / 10.0) < 1.0

    def test_is_never_above_one(self) -> None:
        # Shifted there and back a polygon is itself up to rounding.
        rng = np.random.default_rng(0)
        for _ in range(200):
            points = moved(rng.uniform(-10.0, 10.0, (6, 2)), rng.uniform(-3.0, 3.0), np.zeros(2))
            again = (points - points.mean(axis=0)) + points.mean(axis=0)
            assert 1.0 - 1e-12 < polygon_iou(points, again) <= 1.0

    @pytest.mark.parametrize("degenerate", [SQUARE[:0], SQUARE[:1], SQUARE[:2], NOWHERE])
    def test_is_zero_without_area(self, degenerate: np.ndarray) -> None:
        assert polygon_iou(degenerate, SQUARE) == 0.0
        assert polygon_iou(SQUARE, degenerate) == 0.0
        assert polygon_iou(degenerate, degenerate) == 0.0


class TestHausdorff:
    @quick
    @given(clouds(1, 8), clouds(1, 8))
    def test_is_that_of_densely_sampled_boundaries(
        self, first: np.ndarray, second: np.ndarray
    ) -> None:
        a, b = convex_hull(first), convex_hull(second)
        dense_a, dense_b = sampled_boundary(a, 60), sampled_boundary(b, 60)
        gap = np.hypot(*(dense_a[:, None] - dense_b).transpose(2, 0, 1))
        dense = max(gap.min(axis=1).max(), gap.min(axis=0).max())
        longest_edge_m = max(np.ptp(c, axis=0).max() * np.sqrt(2.0) for c in (a, b))
        assert hausdorff(first, second) == pytest.approx(dense, abs=longest_edge_m / 60 + 1e-9)

    def test_needs_no_point_inside_an_edge(self) -> None:
        # The lower edge of the slab, inside the square, is farthest from the square's boundary in
        # its middle (10 m); a corner of the square is still farther from the slab.
        square = 10.0 * SQUARE
        slab = np.array([[1.0, 10.0], [19.0, 10.0], [19.0, 11.0], [1.0, 11.0]])
        inner, outer = sampled_boundary(slab), sampled_boundary(square)
        from_slab = np.minimum(inner, 20.0 - inner).min(axis=1)
        assert from_slab.max() == pytest.approx(10.0, abs=1e-2)
        to_slab = np.hypot(*(outer - np.clip(outer, [1.0, 10.0], [19.0, 11.0])).T)
        assert hausdorff(square, slab) == pytest.approx(max(from_slab.max(), to_slab.max()))
        assert hausdorff(square, slab) == pytest.approx(np.hypot(1.0, 10.0))

    @quick
    @given(clouds(1, 6), clouds(1, 6), clouds(1, 6), angles)
    def test_is_a_metric_and_the_same_anywhere(
        self, first: np.ndarray, second: np.ndarray, third: np.ndarray, angle_rad: float
    ) -> None:
        distance = hausdorff(first, second)
        assert hausdorff(second, first) == pytest.approx(distance, abs=1e-12)
        assert hausdorff(first, first) == 0.0
        assert distance <= hausdorff(first, third) + hausdorff(third, second) + 1e-9
        there = hausdorff(moved(first, angle_rad), moved(second, angle_rad))
        assert there == pytest.approx(distance, abs=1e-6)

    @pytest.mark.parametrize(
        ("first", "second", "expected_m"),
        [
            ([[0, 0]], [[3, 4]], 5.0),
            ([[0, 0], [4, 0]], [[2, 1]], np.hypot(2, 1)),
            ([[0, 0], [4, 0], [2, 0]], [[0, 3], [4, 3]], 3.0),
            ([[1, 1]], SQUARE.tolist(), np.sqrt(2)),
            ([[0, 0], [2, 0]], SQUARE.tolist(), 2.0),
        ],
    )
    def test_of_segments_and_points(
        self, first: list[list[float]], second: list[list[float]], expected_m: float
    ) -> None:
        distance = hausdorff(np.array(first, dtype=float), np.array(second, dtype=float))
        assert distance == pytest.approx(expected_m)

    @pytest.mark.parametrize("nothing", [np.zeros((0, 2)), NOWHERE])
    def test_of_nothing_is_refused(self, nothing: np.ndarray) -> None:
        with pytest.raises(InputError, match="finite point on both sides"):
            hausdorff(SQUARE, nothing)
        with pytest.raises(InputError, match="finite point on both sides"):
            hausdorff(nothing, SQUARE)


class TestReflection:
    @quick
    @given(clouds(), angles)
    def test_twice_is_nothing_and_the_line_stays(
        self, points: np.ndarray, angle_rad: float
    ) -> None:
        direction = 3.0 * rotation_matrix(angle_rad)[:, 0]
        normal = rotation_matrix(angle_rad)[:, 1]
        mirrored = reflect_in_line(points + UTM, UTM, direction)
        again = reflect_in_line(mirrored, UTM, direction)
        np.testing.assert_allclose(again, points + UTM, atol=1e-6)
        np.testing.assert_allclose((mirrored - UTM) @ normal, -(points @ normal), atol=1e-6)
        np.testing.assert_allclose((mirrored - UTM) @ direction, points @ direction, atol=1e-6)

    @pytest.mark.parametrize("direction", [[0.0, 0.0], [np.nan, 1.0], [np.inf, 0.0]])
    def test_needs_a_direction(self, direction: list[float]) -> None:
        with pytest.raises(InputError, match="direction with a length"):
            reflect_in_line(SQUARE, np.zeros(2), np.array(direction))
