from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest

from gaia_uwb.boundary import short_tour


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
