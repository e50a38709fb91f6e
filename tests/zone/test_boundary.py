"""The outline visits every anchor once, in a short tour; the boundary encloses them."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest
from hypothesis import given, strategies as st
from shapely import LinearRing, MultiPoint

from gaia_uwb.estimate import BoundaryStatus
from gaia_uwb.zone.boundary import make_boundary, ordered_outline, short_tour
from gaia_uwb.zone.polygons import (
    polygon_area,
)
from point_clouds import NOWHERE, SQUARE, UTM, clouds, moved, quick, small_grids


class TestOutline:
    @quick
    @given(clouds(1, 20) | small_grids(16))
    def test_is_simple_counter_clockwise_and_visits_each_point_once(
        self, points: np.ndarray
    ) -> None:
        order = ordered_outline(points)
        assert sorted(order) == list(range(len(points)))
        assert order[0] == 0
        if MultiPoint(points).convex_hull.area > 0.0:
            stops = points[list(order)]
            stops = stops[np.any(stops != np.roll(stops, 1, axis=0), axis=1)]
            assert len(stops) == len(np.unique(points, axis=0))  # one place, one visit
            ring = LinearRing(stops)
            assert ring.is_simple
            assert ring.is_ccw

    @quick
    @given(clouds(1, 12), st.randoms(use_true_random=False))
    def test_does_not_depend_on_the_order_or_the_frame(self, points: np.ndarray, random) -> None:  # type: ignore[no-untyped-def]  # hypothesis' Random
        points = np.unique(points, axis=0)
        shuffled = list(range(len(points)))
        random.shuffle(shuffled)
        outline, other = ordered_outline(points), ordered_outline(points[shuffled])
        visited = [shuffled[k] for k in other]
        start = visited.index(outline[0])
        assert tuple(visited[start:] + visited[:start]) == outline

    def test_stays_counter_clockwise_where_an_exchange_turns_the_tour_round(self) -> None:
        grid = [[0, 2], [3, 4], [3, 7], [4, 3], [5, 1], [6, 2], [9, 0]]
        points = np.array(grid, dtype=float)
        assert LinearRing(points[list(ordered_outline(points))]).is_ccw

    def test_of_points_on_a_circle_is_their_hull(self) -> None:
        angle_rad = np.array([0.3, 5.0, 2.0, 4.1, 1.0, 3.3])
        circle = 20.0 * np.stack([np.cos(angle_rad), np.sin(angle_rad)], axis=1) + UTM
        assert ordered_outline(circle) == (0, 4, 2, 5, 3, 1)

    def test_follows_a_bend_where_the_hull_cuts_across(self) -> None:
        # A lane closure round a bend of 90 degrees: cones on its inner and its outer side.
        angle_rad = np.linspace(0.0, np.pi / 2, 12)
        arc = np.stack([np.cos(angle_rad), np.sin(angle_rad)], axis=1)
        cones = np.concatenate([30.0 * arc, 26.5 * arc])
        boundary = make_boundary(cones)
        assert boundary.outline_index == (*range(12), *range(23, 11, -1))
        lane_m2 = np.pi / 4 * (30.0**2 - 26.5**2)
        assert polygon_area(boundary.outline_m) == pytest.approx(lane_m2, rel=0.02)
        assert boundary.area_m2 > 1.9 * lane_m2

    def test_leaves_out_points_that_were_not_located(self) -> None:
        points = np.concatenate([NOWHERE, SQUARE[[2, 0]], NOWHERE, SQUARE[[3, 1]]])
        assert ordered_outline(points) == (1, 4, 2, 5)

    def test_of_a_line_goes_there_in_order(self) -> None:
        line = moved(np.array([[0.0, 0.0], [5.0, 0.0], [2.0, 0.0], [3.0, 0.0]]), 0.7)
        assert ordered_outline(line) in {(0, 2, 3, 1), (0, 1, 3, 2)}

    @pytest.mark.parametrize("n", [0, 1, 2])
    def test_of_less_than_three_points(self, n: int) -> None:
        assert ordered_outline(SQUARE[:n]) == tuple(range(n))


class TestBoundary:
    def test_encloses_the_anchors(self) -> None:
        boundary = make_boundary(np.concatenate([SQUARE, [[1.0, 0.5]], NOWHERE]))
        assert boundary.status is BoundaryStatus.OK
        assert boundary.area_m2 == 4.0
        np.testing.assert_array_equal(boundary.hull_m, SQUARE)
        assert boundary.outline_index == (0, 4, 1, 2, 3)
        np.testing.assert_array_equal(boundary.outline_m[1], [1.0, 0.5])

    @pytest.mark.parametrize(
        ("points", "status", "corners"),
        [
            (NOWHERE, BoundaryStatus.TOO_FEW_ANCHORS, 0),
            (SQUARE[:1], BoundaryStatus.TOO_FEW_ANCHORS, 1),
            (SQUARE[:2], BoundaryStatus.TOO_FEW_ANCHORS, 2),
            (np.array([[0.0, 0.0], [0.1, 0.1], [0.3, 0.3]]) + UTM, BoundaryStatus.COLLINEAR, 2),
            (np.ones((4, 2)), BoundaryStatus.COLLINEAR, 1),
        ],
    )
    def test_says_why_it_encloses_nothing(
        self, points: np.ndarray, status: BoundaryStatus, corners: int
    ) -> None:
        boundary = make_boundary(points)
        assert boundary.status is status
        assert boundary.area_m2 == 0.0
        assert len(boundary.hull_m) == corners
        assert len(boundary.outline_m) == np.isfinite(points).all(axis=1).sum()


def tour_length_m(points: np.ndarray, tour: np.ndarray) -> float:
    visited = points[tour]
    return float(np.hypot(*(np.roll(visited, -1, axis=0) - visited).T).sum())


@pytest.mark.parametrize("seed", range(8))
def test_is_nearly_the_shortest_of_all_tours(seed: int) -> None:
    points = np.random.default_rng(seed).uniform(0.0, 50.0, size=(7, 2))
    best_m = min(
        tour_length_m(points, np.array([0, *order])) for order in permutations(range(1, 7))
    )
    tour = short_tour(points, start=np.array([0]))
    assert sorted(tour) == list(range(7))
    assert best_m - 1e-9 <= tour_length_m(points, tour) <= 1.05 * best_m


def test_no_exchange_of_two_edges_and_no_move_shortens_it() -> None:
    points = np.random.default_rng(1).uniform(0.0, 100.0, size=(40, 2))
    tour = short_tour(points, start=np.array([3, 5]))
    length_m = tour_length_m(points, tour)
    for i in range(40):
        for j in range(i + 1, 40):
            exchanged = np.concatenate([tour[:i], tour[i:j][::-1], tour[j:]])
            moved = np.insert(np.delete(tour, i), j - 1, tour[i])
            assert tour_length_m(points, exchanged) >= length_m - 1e-9
            assert tour_length_m(points, moved) >= length_m - 1e-9


def test_stays_short_with_many_points() -> None:
    # A random tour of n points in a square of side a is about 0.52 n a long, the best one about
    # 0.71 a sqrt(n).
    points = np.random.default_rng(2).uniform(0.0, 100.0, size=(400, 2))
    tour = short_tour(points, start=np.array([0]))
    assert sorted(tour) == list(range(400))
    assert tour_length_m(points, tour) < 0.85 * 100.0 * np.sqrt(400.0)


@pytest.mark.parametrize("n", [1, 2, 3])
def test_of_very_few_points(n: int) -> None:
    points = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])[:n]
    assert sorted(short_tour(points, start=np.array([0]))) == list(range(n))


@pytest.mark.parametrize("start", [[], [0, 0], [5], [-1]])
def test_a_start_that_is_none_is_refused(start: list[int]) -> None:
    points = np.random.default_rng(0).uniform(0.0, 1.0, (5, 2))
    with pytest.raises(ValueError, match="different rows"):
        short_tour(points, np.array(start, dtype=np.int64))


@pytest.mark.parametrize("n", [4, 5, 50])
def test_points_in_one_place_or_on_one_line_come_to_an_end(n: int) -> None:
    assert sorted(short_tour(np.zeros((n, 2)), np.array([0]))) == list(range(n))
    line = np.stack([np.random.default_rng(n).permutation(n) * 0.1, np.zeros(n)], axis=-1)
    tour = short_tour(line, np.array([2]))
    assert tour_length_m(line, tour) == pytest.approx(0.2 * (n - 1))
