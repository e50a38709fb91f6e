"""Neighbours stand alike, and no layout has a favourite side."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gaia_uwb.locate import Hypotheses
from gaia_uwb.zone.neighbour_sides import NeighbourSides
from two_places import PATH_M, make_hypotheses


def all_sides(n: int) -> np.ndarray:
    return (np.arange(2**n)[:, None] >> np.arange(n)) & 1


def known(found: Hypotheses, path_m: np.ndarray = PATH_M) -> NeighbourSides:
    return NeighbourSides.of(found, np.arange(len(found.log_odds)), path_m)


@pytest.mark.parametrize("n", [1, 2, 7])
def test_each_cone_has_the_share_of_all_combinations(n: int) -> None:
    chains = known(make_hypotheses(n, seed=n)[0])
    sides = all_sides(n)
    weight = np.exp(chains.log_weight(sides))
    assert weight.sum() == pytest.approx(1.0)
    assert chains.second() == pytest.approx(weight @ sides)
    best = chains.likeliest()
    assert chains.log_weight(best).max() == pytest.approx(np.log(weight.max()))


def test_draws_are_as_frequent_as_combinations_are_probable() -> None:
    chains = known(make_hypotheses(4, seed=2, odds=0.3)[0])
    drawn = chains.drawn(20_000)
    counts = np.bincount(drawn @ (1 << np.arange(4)), minlength=16) / len(drawn)
    assert counts == pytest.approx(np.exp(chains.log_weight(all_sides(4))), abs=0.01)


@pytest.mark.parametrize("radius_m", [np.inf, 300.0])
def test_a_zone_and_its_mirror_image_are_as_likely_on_any_bend(radius_m: float) -> None:
    """The straighter of the two would be taken for a row, and the bent one for a mirror image."""
    along_m = np.arange(-20.0, 320.0)
    angle = along_m / radius_m
    chord = along_m * np.sinc(angle / 2 / np.pi)
    path_m = chord[:, None] * np.stack([np.cos(angle / 2), np.sin(angle / 2)], axis=1)
    left = np.stack([-np.sin(angle), np.cos(angle)], axis=1)
    station = np.arange(20, 320, 25)
    offset_m = np.linspace(2.0, 6.0, len(station))[:, None] * left[station]
    place_m = path_m[station][:, None] + np.stack([offset_m, -offset_m], axis=1)
    found, _ = make_hypotheses(len(station))
    found = replace(found, position_m=place_m, log_odds=np.zeros(len(station)))
    chains = known(found, path_m)
    assert chains.second() == pytest.approx(0.5, abs=1e-3)
    one_side = chains.log_weight(np.repeat([[0], [1]], len(station), axis=1))
    assert np.exp(one_side).sum() > 0.5  # of 4,096 combinations


def test_the_ranges_of_all_cones_of_a_row_add_up() -> None:
    found, _ = make_hypotheses(12)
    found.position_m[:, 0, 1] = np.abs(found.position_m[:, 0, 1])
    found.position_m[:, 1] = found.position_m[:, 0] * [1.0, -1.0]
    found.position_m[..., 0] *= 3.0  # farther apart than cones need room
    found.log_odds[:] = 0.5
    assert 1.0 / (1.0 + np.exp(0.5)) > 0.37
    assert known(found).second().max() < 0.1


def test_two_cones_that_are_passed_at_once_stand_on_either_side() -> None:
    found, _ = make_hypotheses(6, sigma_m=0.1)
    station_m = np.array([0.0, 0.3, 15.0, 15.2, 30.0, 30.4])
    found.position_m[:, :, 0] = station_m[:, None]
    found.position_m[:, :, 1] = [3.0, -3.0]
    found.log_odds[:] = 0.0
    weight = np.exp(known(found).log_weight(all_sides(6)))
    facing = (all_sides(6)[:, ::2] != all_sides(6)[:, 1::2]).all(axis=1)
    assert weight[facing].sum() > 0.9
    # Which of each two stands left, nothing tells.
    assert weight[facing] == pytest.approx(weight.max(), rel=0.35)


def test_a_place_whose_side_is_unknown_says_nothing_of_its_neighbours() -> None:
    found, _ = make_hypotheses(3, sigma_m=0.1)
    found.position_m[:] = [[[0.0, 3.0], [0.0, -3.0]]]
    found.position_m[:, :, 0] = np.array([0.0, 20.0, 40.0])[:, None]
    found.position_m[1] = [[20.0, 0.1], [20.0, 0.3]]  # both left of the path, by a hair
    found.covariance_m2[1] = 25.0 * np.eye(2)
    found.log_odds[:] = 0.0
    assert known(found).second()[[0, 2]] == pytest.approx(0.5, abs=0.05)
