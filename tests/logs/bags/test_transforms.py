from __future__ import annotations

import numpy as np
import pytest

from gaia_uwb.logs.bags.transforms import Link, Transforms

NO_TURN = (0.0, 0.0, 0.0, 1.0)
QUARTER = (0.0, 0.0, 0.5**0.5, 0.5**0.5)  # to the left about the upright axis


def tree(*links: tuple[str, str, list[tuple[float, ...]]]) -> Transforms:
    transforms = Transforms()
    for parent, child, rows in links:
        for number, row in enumerate(rows, 1):
            transforms.add(number, Link(parent, child), row)
    return transforms


def drive(n: int = 11, step_s: float = 0.1, turn: tuple[float, ...] = NO_TURN) -> list:  # type: ignore[type-arg]
    return [(k * step_s, float(k), 0.0, 0.0, *turn) for k in range(n)]


def test_one_moving_link_is_the_trajectory() -> None:
    transforms = tree(
        ("/map", "base", drive()), ("base", "laser", [(0.0, 1.0, 0.0, 0.0, *NO_TURN)])
    )
    assert transforms.guess() == Link("map", "base")
    path = transforms.path(Link("map", "base"))
    assert path is not None
    np.testing.assert_allclose(path[0], [[k / 10, k, 0, 0] for k in range(11)])
    assert path[1].tolist() == list(range(1, 12))


def test_a_fixed_link_is_turned_with_what_carries_it() -> None:
    transforms = tree(
        ("map", "base", drive(turn=QUARTER)), ("base", "tag", [(0.0, 2.0, 0.0, 1.0, *NO_TURN)])
    )
    path = transforms.path(Link("map", "tag"))
    assert path is not None
    np.testing.assert_allclose(path[0][:, 1:], [[k, 2, 1] for k in range(11)], atol=1e-12)


def test_moving_links_are_joined_at_the_times_of_the_faster_one() -> None:
    slow = [(t, 10 * t, 5.0, 0.0, *NO_TURN) for t in (0.0, 0.5, 1.0)]
    transforms = tree(("map", "odom", slow), ("odom", "base", drive(16)))
    assert transforms.guess() == Link("map", "base")
    path = transforms.path(Link("map", "base"))
    assert path is not None
    assert len(path[0]) == 11  # the slow link ends at 1 s
    np.testing.assert_allclose(path[0][:, 1:3], [[2 * k, 5] for k in range(11)], atol=1e-12)


@pytest.mark.parametrize(
    "links",
    [
        [("map", "base", drive()), ("map", "other", drive())],
        [("map", "base", [(0.0, 0.0, 0.0, 0.0, *NO_TURN)] * 9)],
        [],
    ],
)
def test_what_moves_in_what_is_not_guessed_where_it_is_unclear(links: list) -> None:  # type: ignore[type-arg]
    assert tree(*links).guess() is None


def test_the_map_seen_from_the_vehicle_is_turned_round() -> None:
    # At the time k the vehicle is at (2, k), looking to the left; so the map is at (-k, 2).
    rows = [(0.1 * k, -float(k), 2.0, 0.0, 0.0, 0.0, -(0.5**0.5), 0.5**0.5) for k in range(9)]
    transforms = tree(("base", "map", rows), ("base", "tag", [(0.0, 1.0, 0.0, 0.0, *NO_TURN)]))
    assert transforms.guess() == Link("map", "base")
    for child, ahead in (("base", 0), ("tag", 1)):
        path = transforms.path(Link("map", child))
        assert path is not None
        np.testing.assert_allclose(path[0][:, 1:3], [[2, k + ahead] for k in range(9)], atol=1e-12)


def test_no_chain_no_path() -> None:
    transforms = tree(("map", "base", drive()), ("base", "map", drive()))
    for parent, child in (("base", "laser"), ("world", "base"), ("map", "map")):
        assert transforms.path(Link(parent, child)) is None
    assert transforms.path(Link("/map", "/base")) is not None


def test_a_half_turn_between_two_transforms_and_lost_order_do_no_harm() -> None:
    rows = [(0.0, 0.0, 0.0, 0.0, *NO_TURN), (1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0)]
    transforms = tree(
        ("map", "base", rows[::-1]), ("base", "tag", [(9.0, 1.0, 0.0, 0.0, *NO_TURN)])
    )
    path = transforms.path(Link("map", "tag"))
    assert path is not None
    np.testing.assert_allclose(path[0][:, 1], [1.0, 2.0])
    assert path[1].tolist() == [2, 1]


def test_too_many_frames_are_refused() -> None:
    transforms = Transforms()
    with pytest.raises(ValueError, match="more than 1,000 pairs of frames"):
        for k in range(1002):
            transforms.add(1, Link("map", str(k)), drive(1)[0])
