from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares

from alike import assert_same
from gaia_uwb.config import SolverConfig
from gaia_uwb.denoised import DenoisedRanges
from gaia_uwb.episode import ClockOffset, Episode, RangeCalibration
from gaia_uwb.locate.paper_solver import locate
from gaia_uwb.solver import batch

SIGMA_M = 0.1
PURE = SolverConfig(kind="wls", position_floor_m=0.0)
INSIDE_90 = 4.605  # chi-square of 2 degrees of freedom


def make_episode(n_steps=300, n_anchors=6, seed=0, noise=None):
    """Return an episode with its true places: a winding pass at 4 m/s."""
    rng = np.random.default_rng(seed)
    t_s = 0.1 * np.arange(n_steps)
    path = np.stack([4.0 * t_s, 5.0 * np.sin(0.4 * t_s)], axis=1)
    anchors = np.stack(
        [
            rng.uniform(0, path[-1, 0], n_anchors),
            rng.choice([-1, 1], n_anchors) * rng.uniform(7, 15, n_anchors),
        ],
        axis=1,
    )
    noise = rng.standard_normal((n_steps, n_anchors)) if noise is None else noise
    true_m = np.linalg.norm(path[:, None] - anchors, axis=2)
    range_m = true_m + SIGMA_M * noise
    ids = tuple(f"cone-{n}" for n in range(n_anchors))
    return Episode("pass", ids, t_s, path, range_m, np.isfinite(range_m)), anchors


def raw(episode, sigma_m=SIGMA_M):
    sigma = np.where(episode.valid, sigma_m, np.nan)
    return DenoisedRanges(episode.range_m, sigma, episode.valid)


def locate_one(episode, config=SolverConfig(kind="wls"), **changes):
    return locate([episode], [raw(episode)], config, **changes)[0]


def coverage(found, anchors):
    """Return the share of anchors inside the 90 % ellipse of the nearer hypothesis."""
    off = found.position_m - anchors[:, None]
    side = (off**2).sum(axis=2).argmin(axis=1)
    rows = np.arange(len(anchors))
    off, covariance = off[rows, side], found.covariance_m2[rows, side]
    distance2 = (off * np.linalg.solve(covariance, off[..., None])[..., 0]).sum(axis=1)
    return float((distance2 < INSIDE_90).mean())


def test_ellipses_cover_with_white_noise():
    episode, anchors = make_episode(n_anchors=600, seed=1)
    # A little low: an anchor's own long-run variance over 75 lags is itself uncertain.
    assert 0.76 < coverage(locate_one(episode, PURE), anchors) < 0.96


def test_the_covariance_adds_what_the_clock_the_bias_and_the_floor_leave_open():
    episode, _ = make_episode(seed=6)
    plain = locate_one(episode, PURE).covariance_m2

    def added(config=PURE, **changes):
        return locate_one(replace(episode, **changes), config).covariance_m2 - plain

    floor = added(SolverConfig(kind="wls", position_floor_m=0.5))
    assert np.allclose(floor, 0.25 * np.eye(2), atol=1e-9)
    # A clock offset of 0.1 s at 4 m/s moves every anchor by 0.4 m along the path at most.
    clock = added(clock=ClockOffset(0.0, 0.1, False, "cannot be told from 0"))
    assert np.linalg.eigvalsh(clock)[..., 0].min() > -1e-9
    assert 0.1 < np.sqrt(np.median(clock[:, 0, 0, 0])) < 0.5
    known = RangeCalibration(np.zeros(2), np.diag([0.04, 0.01]), 1e-6, 1.0)
    shared_m = locate_one(
        replace(episode, calibration=known, clock=ClockOffset(0.0, 0.1, False, "untold")), PURE
    ).shared_m
    alike = shared_m @ np.swapaxes(shared_m, -1, -2)
    assert np.allclose(alike, added(calibration=known) + clock, rtol=0.02, atol=1e-6)
    bias = added(calibration=known)
    assert np.linalg.eigvalsh(bias)[..., 0].min() > -1e-9
    assert bias[..., 0, 0].max() > 1e-3


def test_a_batch_gives_what_each_episode_alone_gives_to_the_last_bit():
    one, _ = make_episode(seed=7)
    other, _ = make_episode(seed=8, n_anchors=3)
    range_m = one.range_m.copy()
    range_m[:, 1] = np.nan
    holed = replace(one, range_m=range_m, valid=np.isfinite(range_m))
    calibrated = replace(one, calibration=RangeCalibration(np.zeros(2), np.eye(2), 0.2, 3.0))
    episodes = [one, other, holed, calibrated, *one.windows(64), *other.windows(64)]
    together = locate(episodes, [raw(e) for e in episodes])
    for episode, found in zip(episodes, together, strict=True):
        assert_same(found, locate_one(episode))


def test_chunks_do_not_change_the_result(monkeypatch):
    episode, _ = make_episode(seed=9)
    whole = locate_one(episode)
    monkeypatch.setattr(batch, "_CHUNK", 2 * episode.n_steps)
    assert_same(whole, locate_one(episode))


def test_the_better_hypothesis_comes_first_with_its_odds():
    episode, anchors = make_episode(seed=10)
    found = locate_one(episode)
    assert np.all(found.log_odds >= 0.0)
    assert found.converged.all()
    assert np.linalg.norm(found.position_m[:, 0] - anchors, axis=1).max() < 0.3


def test_an_anchor_with_too_few_ranges_stays_its_own_problem():
    episode, _ = make_episode(seed=11)
    range_m = episode.range_m.copy()
    range_m[3:, 2] = np.nan
    found = locate_one(replace(episode, range_m=range_m, valid=np.isfinite(range_m)))
    whole = locate_one(episode)
    assert np.isnan(found.position_m[2]).all()
    assert np.isnan(found.covariance_m2[2]).all()
    assert (found.log_odds[2], found.own_bias_m[2], found.n_ranges[2]) == (0.0, 0.0, 3)
    others = [0, 1, 3, 4, 5]
    assert np.array_equal(found.position_m[others], whole.position_m[others])


@pytest.mark.parametrize("labelled", [False, True])
def test_wls_is_the_papers_weighted_least_squares(labelled):
    episode, anchors = make_episode(seed=12)
    rng = np.random.default_rng(13)
    nlos = rng.random(episode.range_m.shape) < 0.4
    range_m = episode.range_m + np.where(nlos, rng.uniform(0.0, 2.0, nlos.shape), 0.0)
    episode = replace(episode, range_m=range_m)
    found = locate_one(episode, nlos=[nlos] if labelled else None)
    for n in range(episode.n_anchors):
        weight = np.where(nlos[:, n] & labelled, 0.2, 1.0)

        def residuals(x, w=weight, d=range_m[:, n]):
            return np.sqrt(w) * (np.linalg.norm(episode.position_m - x, axis=1) - d)

        expected = least_squares(residuals, anchors[n], xtol=1e-12).x
        assert np.abs(found.position_m[n, 0] - expected).max() < 1e-4
    assert np.all(found.own_bias_m == 0.0)


def test_what_does_not_fit_is_refused():
    episode, _ = make_episode(n_steps=20, n_anchors=2)
    nlos = np.zeros((20, 2), dtype=bool)
    with pytest.raises(ValueError, match="as many denoised ranges"):
        locate([episode], [])
    with pytest.raises(ValueError, match="as many denoised ranges"):
        locate([episode], [raw(episode)], nlos=[nlos, nlos])


def test_no_episodes_give_no_hypotheses():
    assert locate([], []) == []


def test_errors_that_are_alike_decide_less_on_the_side():
    # The same noise, once new at every step and once held for a second: the latter is worth less.
    fresh = np.random.default_rng(3).standard_normal((300, 6))
    held = np.repeat(fresh[::10], 10, axis=0)
    odds = [locate_one(make_episode(noise=noise)[0]).log_odds for noise in (fresh, held)]
    assert np.median(odds[1]) < 0.4 * np.median(odds[0])
