from math import log, pi

import numpy as np
import pytest
from scipy.special import multigammaln

from gaia_uwb.zone import layout_prior
from gaia_uwb.zone.layout_prior import SHARED_ERRORS, joint_places, place_jointly

PRIOR = [(dof, size) for dof in layout_prior._SHAPES for size in layout_prior._SIZES_M]


def price(place, dof, size_m):
    """Return minus the log of the integrated prior of (..., n, 2), by the module's formula."""
    n = place.shape[-2]
    centred = place - place.mean(axis=-2, keepdims=True)
    scatter = np.swapaxes(centred, -1, -2) @ centred
    strength = 0.5 * (dof + n - 1.0)
    log_z = (
        dof * log(dof * size_m**2) + multigammaln(strength, 2) - multigammaln(dof / 2.0, 2)
        - (n - 1.0) * log(pi)
    )  # fmt: skip
    return strength * np.linalg.slogdet(dof * size_m**2 * np.eye(2) + scatter)[1] - log_z


def misfit(place, measured, covariance):
    off = (place - measured)[..., None]
    return 0.5 * float((off * np.linalg.solve(covariance, off)).sum())


def make_anchors(n, seed=0):
    rng = np.random.default_rng(seed)
    root = rng.normal(0.0, 0.4, (n, 2, 2)) + 0.3 * np.eye(2)
    return rng.normal(0.0, 3.0, (n, 2)), root @ np.swapaxes(root, 1, 2) + 0.01 * np.eye(2)


@pytest.mark.parametrize("n", [2, 4, 9])
def test_places_are_the_minimum_of_misfit_and_price(n):
    measured, covariance = make_anchors(n)
    found = joint_places(measured[None], covariance[None])
    for k, (dof, size_m) in enumerate(PRIOR):

        def cost(place, dof=dof, size_m=size_m):
            return misfit(place, measured, covariance) + price(place, dof, size_m)

        place = found.place_m[0, k]
        step = 1e-4
        for i, j in np.ndindex(n, 2):
            nudge = np.zeros((n, 2))
            nudge[i, j] = step
            slope = (cost(place + nudge) - cost(place - nudge)) / (2 * step)
            # in units of the anchor's standard error
            assert abs(slope) * np.sqrt(found.covariance_m2[0, k, i, j, j]) < 0.02


@pytest.mark.parametrize("n", [2, 3])
def test_evidence_agrees_with_numerical_integration(n):
    measured, covariance = make_anchors(n, seed=1)
    covariance *= 0.05
    found = joint_places(measured[None], covariance[None])
    # Importance sampling from the anchors' own likelihoods, whose height is left out.
    rng = np.random.default_rng(2)
    root = np.linalg.cholesky(covariance)
    places = measured + (root @ rng.standard_normal((4000, n, 2, 1)))[..., 0]
    height = 0.5 * np.linalg.slogdet(covariance)[1].sum()
    for k, (dof, size_m) in enumerate(PRIOR):
        log_prior = -price(places, dof, size_m)
        expected = height + log(np.exp(log_prior - log_prior.max()).mean()) + log_prior.max()
        assert found.log_evidence[0, k] == pytest.approx(expected, abs=0.1)


@pytest.mark.parametrize(("dof", "size_m"), PRIOR)
def test_the_price_weighs_all_shapes_and_sizes_alike(dof, size_m):
    """Two anchors' distance has the same total under each: N, as the centre may be anywhere."""
    radius = size_m * np.geomspace(1e-4, 1e5, 4000)
    pair = np.zeros((4000, 2, 2))
    pair[:, 1, 0] = radius
    density = 2.0 * pi * radius * np.exp(-price(pair, dof, size_m))
    total = 0.5 * float(((density[1:] + density[:-1]) * np.diff(radius)).sum())
    assert total == pytest.approx(2.0, abs=0.02)


def test_combinations_do_not_meet():
    one, other = make_anchors(5, seed=3), make_anchors(5, seed=4)
    together = joint_places(np.stack([one[0], other[0]]), np.stack([one[1], other[1]]))
    for k, (place, covariance) in enumerate((one, other)):
        alone = joint_places(place[None], covariance[None])
        assert np.allclose(together.place_m[k], alone.place_m[0], atol=1e-3)
        assert np.allclose(together.log_evidence[k], alone.log_evidence[0], atol=1e-3)


def test_the_prior_moves_and_turns_with_the_zone():
    place, covariance = make_anchors(6, seed=5)
    turn = np.array([[0.6, -0.8], [0.8, 0.6]])
    here = joint_places(place[None], covariance[None])
    there = joint_places(
        (place @ turn.T + [500.0, -200.0])[None], (turn @ covariance @ turn.T)[None]
    )
    assert np.allclose(there.place_m, here.place_m @ turn.T + [500.0, -200.0], atol=1e-3)
    assert np.allclose(there.log_evidence, here.log_evidence, atol=1e-3)


def test_unsure_anchors_are_drawn_to_the_others_and_sure_ones_stay():
    place = np.array([[0.0, 0.0], [1.0, 0.5], [2.0, 0.0], [1.0, 30.0]])
    covariance = np.tile(1e-4 * np.eye(2), (4, 1, 1))
    sure = joint_places(place[None], covariance[None])
    assert np.abs(sure.place_m - place).max() < 0.02
    covariance[3] = 400.0 * np.eye(2)
    unsure = joint_places(place[None], covariance[None])
    best = unsure.log_evidence[0].argmax()
    assert np.linalg.norm(unsure.place_m[0, best, 3] - [1.0, 0.2]) < 5.0
    assert np.linalg.eigvalsh(unsure.covariance_m2[0, best, 3])[1] < 100.0


def test_a_place_is_as_unsure_as_all_shapes_of_the_zone_together() -> None:
    """Draw a shape by its evidence, a place by its own errors, and what is common to all."""
    rng = np.random.default_rng(5)
    true_m = np.array([[0.0, 4.0], [4.0, 4.2], [9.0, 3.8], [13.0, 4.0]])
    covariance_m2 = np.tile(np.diag([0.3, 6.0]), (4, 1, 1))  # unsure across the path
    place_m = true_m + rng.standard_normal((4, 2)) * np.sqrt([0.3, 6.0])
    found_m, found_m2 = place_jointly(place_m, covariance_m2)
    joint = joint_places(place_m[None], (1.0 - SHARED_ERRORS) * covariance_m2[None])
    weight = np.exp(joint.log_evidence[0] - joint.log_evidence[0].max())
    shape = rng.choice(len(weight), size=100_000, p=weight / weight.sum())
    for k in range(4):
        common_m = rng.multivariate_normal([0, 0], SHARED_ERRORS * covariance_m2[k], len(shape))
        root = np.linalg.cholesky(joint.covariance_m2[0, :, k])[shape]
        noise_m = (root @ rng.standard_normal((len(shape), 2, 1)))[..., 0]
        drawn_m = joint.place_m[0, shape, k] + noise_m + common_m
        assert drawn_m.mean(axis=0) == pytest.approx(found_m[k], abs=0.05)
        assert np.cov(drawn_m.T) == pytest.approx(found_m2[k], rel=0.03, abs=0.03)
        apart_m = np.ptp(joint.place_m[0, :, k], axis=0).max()
        assert apart_m > 0.5  # the shapes do not agree, so their spread counts
