"""One anchor in several passes, against what theory says."""

import numpy as np
import pytest

from drives_past import CONES_M, IDS, PURE, located, make_pass, place_error_m
from gaia_uwb.config import CalibrationConfig, SolverConfig
from gaia_uwb.locate.fusion import fuse
from gaia_uwb.locate.joint_fit import JointFit, hear


def fused(episodes, config=PURE):
    return fuse([located(episode, config) for episode in episodes], config).hypotheses


def across_sigma_m(found):
    return np.sqrt(found.covariance_m2[:, 0, 1, 1])


def along_sigma_m(found):
    return np.sqrt(found.covariance_m2[:, 0, 0, 0])


def with_solver(**changes):
    return PURE.model_copy(update={"solver": PURE.solver.model_copy(update=changes)})


def test_two_straight_lanes_resolve_every_side():
    near, far = make_pass(0.0), make_pass(3.6, seed=1)
    alone = located(near).hypotheses
    assert alone.log_odds.max() < 8.0  # nothing but noise decides
    mirror_m = CONES_M * [1.0, -1.0]
    both_m = np.stack([CONES_M, mirror_m], axis=1)
    either = np.linalg.norm(alone.position_m[:, :, None] - both_m[:, None], axis=-1)
    assert either.min(axis=2).max() < 0.3
    together = fused([near, far])
    assert place_error_m(together).max() < 0.1
    assert together.log_odds.min() > 100.0


def test_the_same_lane_again_resolves_nothing():
    together = fused([make_pass(0.0, seed=seed) for seed in range(6)])
    error_m = np.minimum(place_error_m(together), place_error_m(together, CONES_M * [1.0, -1.0]))
    assert error_m.max() < 0.1
    assert together.log_odds.max() < 8.0
    apart = together.position_m[:, 0] - together.position_m[:, 1]
    assert np.abs(apart[:, 1]).min() > 5.0


def test_independent_errors_add_their_information():
    episodes = [make_pass(0.0), make_pass(3.6, seed=1), make_pass(-3.0, seed=2, sigma_m=0.02)]
    expected = 0.0
    for episode in episodes:
        own = located(episode).hypotheses
        side = np.linalg.norm(own.position_m - CONES_M[:, None], axis=2).argmin(axis=1)
        expected = expected + np.linalg.inv(own.covariance_m2[np.arange(5), side])
    found = fused(episodes).covariance_m2[:, 0]
    larger = np.sqrt(np.linalg.det(found) / np.linalg.det(np.linalg.inv(expected)))
    # Never more certain than all information allows; ranges count as at most one each.
    assert larger.min() > 0.9
    assert larger.max() < 1.8


def test_an_anchors_own_bias_is_not_averaged_away():
    biased = with_solver(anchor_bias_sigma_m=0.05)
    lanes = [(0.5 * k - 2.0, k) for k in range(8)]
    one = np.array([50.0, 20.0])[None]  # far on one side, so that a bias looks like a move

    def sigma_m(n, config):
        episodes = [make_pass(lane, one, ("a",), seed=k) for lane, k in lanes[:n]]
        return across_sigma_m(fused(episodes, config))[0]

    assert sigma_m(8, PURE) < 0.65 * sigma_m(2, PURE)
    assert sigma_m(8, biased) > 0.03


def test_a_bias_that_only_the_prior_knows_is_common_to_all_passes():
    config = PURE.model_copy(
        update={"calibration": CalibrationConfig(bias_sigma_m=0.2, bias_slope_sigma_m=0.0)}
    )

    def sigma_m(n, bias_sigma_m):
        far_m = CONES_M + np.array([60.0, 40.0])  # a bias looks like a move
        episodes = [make_pass(0.3 * k, far_m, seed=k, bias_sigma_m=bias_sigma_m) for k in range(n)]
        covariance_m2 = fused(episodes, config).covariance_m2[:, 0]
        return np.sqrt(np.linalg.eigvalsh(covariance_m2)[:, 1]).mean()

    assert sigma_m(8, 0.05) < 0.65 * sigma_m(2, 0.05)
    assert sigma_m(8, 0.1999) > 0.9 * sigma_m(2, 0.1999)


@pytest.mark.parametrize("what", ["bias_sigma_m", "clock_sigma_s"])
def test_what_an_anchors_own_ranges_told_of_bias_and_clock_counts_once(what):
    """Alone, an anchor has only priors beside its ranges, however sure the calibration was."""
    config = PURE.model_copy(
        update={"calibration": CalibrationConfig(bias_sigma_m=0.2, bias_slope_sigma_m=0.0)}
    )
    far_m = np.array([[50.0, 20.0]])

    def sigma_m(others_m, sigma):
        cones_m = np.concatenate([far_m, others_m])
        ids = IDS[: len(cones_m)]
        episodes = [make_pass(lane, cones_m, ids, **{what: sigma}) for lane in (0.0, 3.6)]
        covariance_m2 = fused(episodes, config).covariance_m2[0, 0]
        return np.sqrt(np.linalg.eigvalsh(covariance_m2)[1])

    nobody_m = np.zeros((0, 2))
    sure, unsure = (sigma_m(nobody_m, sigma) for sigma in (0.02, 0.19))
    assert sure == pytest.approx(unsure, rel=0.02)
    assert sigma_m(CONES_M[:3], 0.02) < 0.6 * sure  # what others told does count


def test_a_pass_whose_clock_is_unknown_hardly_counts_along_the_road():
    good = make_pass(0.0, clock_sigma_s=0.005)
    late = make_pass(3.6, seed=1, late_s=0.4, clock_sigma_s=0.5)
    together = fused([good, late])
    assert place_error_m(together).max() < 0.15
    own = located(good).hypotheses
    assert (along_sigma_m(together) > 0.8 * along_sigma_m(own)).all()
    believed = make_pass(3.6, seed=1, late_s=0.4, clock_sigma_s=0.005)
    assert place_error_m(fused([good, believed])).max() > 0.25


def test_gross_outliers_of_one_pass_do_no_harm():
    near, far = make_pass(0.0), make_pass(3.6, seed=1)
    wild_m = far.range_m.copy()
    wild_m[::4] += 5.0
    wild = make_pass(3.6, seed=1)
    object.__setattr__(wild, "range_m", wild_m)
    assert place_error_m(fused([near, wild])).max() < 0.12


def test_least_squares_fuse_too():
    config = PURE.model_copy(update={"solver": SolverConfig(kind="wls")})
    together = fused([make_pass(0.0), make_pass(3.6, seed=1)], config)
    assert place_error_m(together).max() < 0.1
    assert together.log_odds.min() > 20.0


@pytest.mark.parametrize("kind", ["robust", "wls"])
def test_the_gradient_is_that_of_the_likelihood(kind):
    config = with_solver(kind=kind, anchor_bias_sigma_m=0.05)
    passes = [
        located(make_pass(lane, seed=k, clock_sigma_s=0.05, bias_sigma_m=0.1), config)
        for k, lane in enumerate((0.0, 3.6, -2.0))
    ]
    fit = JointFit([hear(each, "c", config) for each in passes], config)
    rng = np.random.default_rng(4)
    state = np.concatenate([CONES_M[2] + 0.1, 0.02 * rng.standard_normal(10)])
    _, gradient, hessian = fit._evaluate(state)
    numeric = np.empty_like(state)
    for k in range(len(state)):
        step = np.zeros_like(state)
        step[k] = 1e-6
        numeric[k] = (fit._evaluate(state + step)[0] - fit._evaluate(state - step)[0]) / 2e-6
    assert gradient == pytest.approx(numeric, rel=1e-5, abs=1e-3)
    assert np.linalg.eigvalsh(hessian).min() > 0
