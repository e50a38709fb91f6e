"""The search over many open anchors, and the places that it leaves."""

from __future__ import annotations

import numpy as np
import pytest

from gaia_uwb.zone.layout_prior import joint_places
from gaia_uwb.zone.side_search import SHARED_ERRORS, Search, all_combinations


def diagonal_row(n: int, seed: int, sigma_m: float = 0.3) -> tuple[np.ndarray, np.ndarray]:
    """Return both places of cones in one line across a straight path, and their covariances."""
    rng = np.random.default_rng(seed)
    true_m = np.stack([4.0 * np.arange(n), np.linspace(-6.0, 6.2, n)], axis=1)
    place_m = true_m + sigma_m * rng.standard_normal((n, 2))
    pair_m = np.stack([place_m, place_m * [1.0, -1.0]], axis=1)
    return pair_m, np.tile(sigma_m**2 * np.eye(2), (n, 2, 1, 1))


def mirror_probability(search: Search) -> np.ndarray:
    best, evidence, combinations = search.result()
    weight = np.exp(evidence - evidence[best])
    other = combinations != combinations[best]
    return np.asarray((weight[:, None] * other).sum(axis=0) / weight.sum())


@pytest.mark.parametrize("n", [9, 14])
@pytest.mark.parametrize("seed", range(3))
def test_a_zone_and_its_mirror_image_are_as_likely_on_a_straight_path(n: int, seed: int) -> None:
    # The line crosses the path, so that a climb from all cones on one side does not reach it.
    search = Search(*diagonal_row(n, seed), log_odds=np.zeros(n))
    search.climb(np.arange(n))
    best, evidence, combinations = search.result()
    mirrored = (combinations == 1 - combinations[best]).all(axis=1)
    assert evidence[mirrored] == pytest.approx(evidence[best])
    assert mirror_probability(search).min() > 0.2  # not looked at, it would be next to none


def test_a_climb_finds_what_all_combinations_have_best() -> None:
    for seed in range(4):
        places = diagonal_row(9, seed, sigma_m=0.5)
        log_odds = np.abs(np.random.default_rng(seed).standard_normal(9))
        climbed, complete = Search(*places, log_odds), Search(*places, log_odds)
        climbed.climb(np.arange(9))
        complete.look_at(all_combinations(9, np.arange(9)))
        (k, found, _), (j, every, _) = climbed.result(), complete.result()
        assert found[k] == pytest.approx(every[j])
        assert len(found) < 0.5 * len(every)


def test_a_place_is_as_unsure_as_all_shapes_of_the_zone_together() -> None:
    """Draw a shape by its evidence, a place by its own errors, and what is common to all."""
    rng = np.random.default_rng(5)
    true_m = np.array([[0.0, 4.0], [4.0, 4.2], [9.0, 3.8], [13.0, 4.0]])
    covariance_m2 = np.tile(np.diag([0.3, 6.0]), (4, 2, 1, 1))  # unsure across the path
    place_m = true_m + rng.standard_normal((4, 2)) * np.sqrt([0.3, 6.0])
    pair_m = np.stack([place_m, place_m * [1.0, -1.0]], axis=1)
    found_m, found_m2 = Search(pair_m, covariance_m2, np.zeros(4)).places(np.zeros(4, dtype=int))
    own_m2 = (1.0 - SHARED_ERRORS) * covariance_m2[:, 0]
    joint = joint_places(place_m[None], own_m2[None])
    weight = np.exp(joint.log_evidence[0] - joint.log_evidence[0].max())
    shape = rng.choice(len(weight), size=100_000, p=weight / weight.sum())
    for k in range(4):
        common_m = rng.multivariate_normal([0, 0], SHARED_ERRORS * covariance_m2[k, 0], len(shape))
        root = np.linalg.cholesky(joint.covariance_m2[0, :, k])[shape]
        noise_m = (root @ rng.standard_normal((len(shape), 2, 1)))[..., 0]
        drawn_m = joint.place_m[0, shape, k] + noise_m + common_m
        assert drawn_m.mean(axis=0) == pytest.approx(found_m[k], abs=0.05)
        assert np.cov(drawn_m.T) == pytest.approx(found_m2[k], rel=0.03, abs=0.03)
        apart_m = np.ptp(joint.place_m[0, :, k], axis=0).max()
        assert apart_m > 0.5  # the shapes do not agree, so their spread counts
