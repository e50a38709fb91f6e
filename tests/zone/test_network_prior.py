"""What a network knows of zones fills only what the ranges leave open."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gaia_uwb.denoised import ZonePosterior
from gaia_uwb.estimate import ReasonKind
from gaia_uwb.locate import Hypotheses
from gaia_uwb.zone.network_prior import _RANGES_DECIDE, dispose

BY_HAND_M2 = 0.3**2  # cones are put down by hand: no network knows a place better


def by_ranges(place_m, covariance_m2, log_odds=0.0, shared_m=None) -> Hypotheses:
    """Return one cone left of a path along x, and its mirror image, by its ranges."""
    pair_m = np.array([[place_m, np.multiply(place_m, [1.0, -1.0])]])
    return Hypotheses(
        position_m=pair_m,
        covariance_m2=np.tile(covariance_m2, (1, 2, 1, 1)).astype(float),
        log_odds=np.array([log_odds]),
        own_bias_m=np.zeros(1),
        n_ranges=np.array([50]),
        converged=np.array([True]),
        fits=np.array([True]),
        shared_m=None if shared_m is None else np.tile(shared_m, (1, 2, 1, 1)).astype(float),
    )


def by_network(place_m, covariance_m2, left=0.5) -> ZonePosterior:
    """Return the same cone by a network: its places, and the probability of the left one."""
    return ZonePosterior(
        place_m=np.array([[place_m, np.multiply(place_m, [1.0, -1.0])]]),
        covariance_m2=np.tile(covariance_m2, (1, 2, 1, 1)).astype(float),
        scene_probability=np.array([0.5, 0.5]),
        left_probability=np.full((2, 1), left),
        located=np.array([True]),
    )


def test_a_network_fills_only_the_direction_in_which_it_is_surer() -> None:
    ranges = by_ranges([0.0, 5.0], np.diag([1.0, 0.01]))
    network = by_network([0.8, 5.2], np.diag([0.04, 0.04]))
    found = dispose(network, ranges)
    assert not found.contradicted.any()
    # Along the path the network's place and its uncertainty, across it those of the ranges.
    assert found.zone.place_m[0, 0] == pytest.approx([0.8, 5.0])
    assert found.zone.place_m[0, 1] == pytest.approx([0.8, -5.0])
    for covariance_m2 in found.zone.covariance_m2[0]:
        assert covariance_m2 == pytest.approx(np.diag([0.04 + BY_HAND_M2, 0.01]))


@pytest.mark.parametrize("turn_rad", [0.4, 1.3])
def test_the_direction_need_not_be_an_axis(turn_rad: float) -> None:
    turn = np.array([[np.cos(turn_rad), -np.sin(turn_rad)], [np.sin(turn_rad), np.cos(turn_rad)]])
    place_m = np.array([3.0, 5.0])
    ranges = by_ranges(place_m, turn @ np.diag([4.0, 0.01]) @ turn.T)
    found = dispose(by_network(place_m + turn @ [1.0, 0.2], 0.16 * np.eye(2)), ranges).zone
    assert found.place_m[0, 0] == pytest.approx(place_m + turn @ [1.0, 0.0])
    expected_m2 = turn @ np.diag([0.16 + BY_HAND_M2, 0.01]) @ turn.T
    assert found.covariance_m2[0, 0] == pytest.approx(expected_m2)


@pytest.mark.parametrize("network_m2", [1e-6, 0.5])
def test_ranges_that_are_surer_stay_as_they_are(network_m2: float) -> None:
    ranges = by_ranges([0.0, 5.0], 0.05 * np.eye(2))
    found = dispose(by_network([0.4, 5.3], network_m2 * np.eye(2)), ranges).zone
    assert found.place_m == pytest.approx(ranges.position_m)
    assert found.covariance_m2 == pytest.approx(ranges.covariance_m2)


def test_a_network_that_contradicts_the_ranges_is_dropped_and_flagged() -> None:
    ranges = by_ranges([0.0, 5.0], np.diag([1.0, 0.01]))
    sigma_m = np.sqrt(1.0 + 0.04 + BY_HAND_M2)
    for off, contradicts in ((3.6, False), (3.8, True)):  # 99.9 % of two coordinates: 3.71
        found = dispose(by_network([off * sigma_m, 5.0], 0.04 * np.eye(2), left=0.9), ranges)
        assert found.contradicted.tolist() == [contradicts]
        expected_m = [0.0 if contradicts else off * sigma_m, 5.0]
        assert found.zone.place_m[0, 0] == pytest.approx(expected_m)
        assert found.zone.left_probability == pytest.approx(0.5 if contradicts else 0.9)
        expected_m2 = 1.0 if contradicts else 0.04 + BY_HAND_M2
        assert found.zone.covariance_m2[0, 0, 0, 0] == pytest.approx(expected_m2)


def test_of_two_places_only_the_one_that_is_contradicted_stays_by_the_ranges() -> None:
    ranges = by_ranges([0.0, 5.0], np.eye(2))
    network = by_network([0.8, 5.0], 0.04 * np.eye(2))
    place_m = network.place_m.copy()
    place_m[0, 1] = [20.0, -5.0]
    found = dispose(replace(network, place_m=place_m), ranges)
    assert not found.contradicted.any()
    assert found.zone.place_m[0, 0] == pytest.approx([0.8, 5.0])
    assert found.zone.place_m[0, 1] == pytest.approx([0.0, -5.0])


def test_what_all_cones_share_stays_as_uncertain_as_it_is() -> None:
    shared_m = np.array([[2.0, 0.0], [0.0, 0.0]])  # a clock offset moves all of them along the path
    ranges = by_ranges([0.0, 5.0], np.eye(2) + shared_m @ shared_m.T, shared_m=shared_m)
    found = dispose(by_network([0.5, 5.1], 1e-4 * np.eye(2)), ranges).zone
    expected_m2 = (BY_HAND_M2 + 1e-4) * np.eye(2) + shared_m @ shared_m.T
    assert found.covariance_m2[0, 0] == pytest.approx(expected_m2)


@pytest.mark.parametrize("first_is_left", [True, False])
@pytest.mark.parametrize("left", [0.1, 0.8])
def test_a_network_has_used_the_ranges_so_their_odds_do_not_count_again(
    left: float, first_is_left: bool
) -> None:
    north_m = 5.0 if first_is_left else -5.0
    network = by_network([0.0, 5.0], np.eye(2), left)
    for log_odds, decides in ((0.9 * _RANGES_DECIDE, False), (1.1 * _RANGES_DECIDE, True)):
        found = dispose(network, by_ranges([0.0, north_m], np.eye(2), log_odds)).zone
        assert found.place_m[0, 0, 1] == pytest.approx(5.0)  # left stays left
        ratio = log_odds if first_is_left else -log_odds
        expected = 1.0 / (1.0 + np.exp(-ratio)) if decides else left
        assert found.left_probability == pytest.approx(expected)


@pytest.mark.parametrize("left", [0.0, 1.0])
def test_no_network_is_so_sure_of_a_side_that_ranges_cannot_tell_otherwise(left: float) -> None:
    ranges = by_ranges([0.0, -5.0 if left else 5.0], np.eye(2), log_odds=40.0)
    found = dispose(by_network([0.0, 5.0], np.eye(2), left), ranges).zone
    assert np.all(found.left_probability < 1e-3 if left else found.left_probability > 1.0 - 1e-3)


def test_a_cone_that_either_has_not_located_stays_with_the_network() -> None:
    nowhere = by_ranges([np.nan, np.nan], np.full((2, 2), np.nan))
    network = by_network([0.0, 5.0], 0.04 * np.eye(2), left=0.8)
    found = dispose(network, nowhere)
    assert not found.contradicted.any()
    assert found.zone.place_m == pytest.approx(network.place_m)
    assert found.zone.covariance_m2 == pytest.approx(network.covariance_m2)
    assert found.zone.left_probability == pytest.approx(network.left_probability)
    unknown = dispose(replace(network, located=np.array([False])), by_ranges([9, 9], np.eye(2)))
    assert unknown.zone.place_m == pytest.approx(network.place_m)


@pytest.mark.parametrize("first_is_left", [True, False])
def test_what_the_ranges_alone_say_of_a_side_is_kept(first_is_left: bool) -> None:
    ranges = by_ranges([0.0, 5.0 if first_is_left else -5.0], np.eye(2), log_odds=1.5)
    found = dispose(by_network([0.0, 5.0], np.eye(2), 0.999), ranges)
    right = 1.0 / (1.0 + np.exp(1.5 if first_is_left else -1.5))
    assert found.by_ranges.right_probability == pytest.approx([right])
    assert found.zone.left_probability == pytest.approx(0.999)
    nowhere = by_ranges([np.nan, np.nan], np.full((2, 2), np.nan))
    unknown = dispose(by_network([0.0, 5.0], np.eye(2)), nowhere)
    assert np.isnan(unknown.by_ranges.right_probability).all()


def test_contradictions_are_said_and_nothing_else() -> None:
    sure = by_ranges([0.0, 5.0], 0.01 * np.eye(2), log_odds=20.0)
    agrees = dispose(by_network([0.1, 5.0], np.eye(2), left=0.5), sure)
    assert agrees.reasons(["a"]) == ()
    elsewhere = dispose(by_network([9.0, 5.0], 0.01 * np.eye(2), left=0.5), sure)
    (reason,) = elsewhere.reasons(["a"])
    assert (reason.kind, reason.cones) == (ReasonKind.UNLIKE_ZONES, ("a",))
    assert str(reason).startswith("a: the ranges contradict the position that the network expects")
    for left, is_told in ((0.002, False), (0.0005, True)):
        other = dispose(by_network([0.1, 5.0], np.eye(2), left), sure)
        assert other.side_contradicted.tolist() == [is_told]
        assert len(other.reasons(["a"])) == is_told
    open_side = dispose(
        by_network([0.1, 5.0], np.eye(2), 0.0005), replace(sure, log_odds=np.ones(1))
    )
    assert not open_side.side_contradicted.any()
