import numpy as np
import pytest

from gaia_uwb.episode import Episode, bias_basis
from gaia_uwb.solver import batch
from gaia_uwb.solver.batch import (
    at_side,
    better_side,
    chunks,
    correlation_lag,
    normal_sums,
    with_prior,
)
from gaia_uwb.solver.multilateration import SolverOptions


def make_episode(n_steps=60, n_anchors=5, seed=0, heights=True):
    rng = np.random.default_rng(seed)
    t_s = 0.1 * np.arange(n_steps)
    path = np.stack([4.0 * t_s, 3.0 * np.sin(t_s)], axis=1)
    anchors = np.stack([rng.uniform(0, 24, n_anchors), rng.uniform(5, 12, n_anchors)], axis=1)
    anchor_up_m = rng.uniform(0.5, 1.5, n_anchors)
    anchor_up_m[0] = np.nan
    gap = np.nan_to_num(2.0 - anchor_up_m) if heights else np.zeros(n_anchors)
    range_m = np.sqrt(((path[:, None] - anchors) ** 2).sum(axis=2) + gap**2)
    range_m += 0.1 * rng.standard_normal(range_m.shape)
    range_m[rng.random(range_m.shape) < 0.1] = np.nan
    return Episode(
        "pass", tuple(f"cone-{n}" for n in range(n_anchors)), t_s, path, range_m,
        np.isfinite(range_m), tag_up_m=np.full(n_steps, 2.0) if heights else None,
        anchor_up_m=anchor_up_m if heights else None,
    )  # fmt: skip


def sigma_of(episode):
    return np.where(episode.valid, 0.1, np.nan)


def test_chunks_of_any_size_hold_every_anchor_once(monkeypatch):
    episodes = [make_episode(seed=1), make_episode(seed=2)]
    arguments = (episodes, [e.range_m for e in episodes], [sigma_of(e) for e in episodes])
    (whole,) = chunks(*arguments)
    monkeypatch.setattr(batch, "_CHUNK", 2 * 60 * 2)
    parts = list(chunks(*arguments))
    assert [p.range_m.shape for p in parts] == [(2, 2, 60), (2, 2, 60), (2, 1, 60)]
    for name in ("range_m", "sigma_m", "anchor_up_m"):
        joined = np.concatenate([getattr(p, name) for p in parts], axis=1)
        assert np.array_equal(joined, getattr(whole, name), equal_nan=True)
    assert np.array_equal(whole.range_m[1, 3], episodes[1].range_m[:, 3], equal_nan=True)


def test_steps_before_and_after_all_ranges_are_left_out_and_change_nothing():
    episode = make_episode()
    silent = np.full_like(episode.range_m, np.nan)
    silent[20:45] = episode.range_m[20:45]
    found = []
    for each, range_m in ((episode, silent), (episode.window(20, 45), silent[20:45])):
        sigma_m = np.where(np.isfinite(range_m), 0.1, np.nan)
        (chunk,) = chunks([each], [range_m], [sigma_m])
        assert chunk.range_m.shape == (1, 5, 25)
        assert np.array_equal(chunk.position_m[0], episode.position_m[20:45])
        found.append(chunk.solve(SolverOptions(), np.zeros(1)).position_m)
    assert np.array_equal(*found)
    nothing = np.full_like(silent, np.nan)
    (chunk,) = chunks([episode], [nothing], [nothing])
    assert chunk.range_m.shape == (1, 5, 60)


def test_velocity_is_that_of_the_path():
    episode = make_episode()
    (chunk,) = chunks([episode], [episode.range_m], [sigma_of(episode)])
    expected = np.stack([np.full(60, 4.0), 3.0 * np.cos(episode.t_s)], axis=1)
    assert np.abs(chunk.velocity_mps[0] - expected)[1:-1].max() < 0.02
    one = episode.window(3, 4)
    (chunk,) = chunks([one], [one.range_m], [sigma_of(one)])
    assert np.array_equal(chunk.velocity_mps, np.zeros((1, 1, 2)))


def test_a_shared_bias_is_taken_off_before_solving():
    episode = make_episode(heights=False)
    bias = np.array([[0.4, 0.2]])
    biased = episode.range_m + bias_basis(episode.range_m) @ bias[0]
    (clean,) = chunks([episode], [episode.range_m], [sigma_of(episode)])
    (shifted,) = chunks([episode], [biased], [sigma_of(episode)])
    assert np.array_equal(clean.corrected(None), clean.range_m, equal_nan=True)
    # The bias belongs to the measured range, which is a little longer than the true one.
    assert np.nanmax(np.abs(shifted.corrected(bias) - clean.range_m)) < 0.02


def test_correlation_lag_counts_steps_up_to_a_quarter_of_the_episode():
    episode = make_episode(n_steps=100)
    assert correlation_lag(episode, 1.0) == 10
    assert correlation_lag(episode, 100.0) == 25
    assert correlation_lag(episode, 0.001) == 1
    assert correlation_lag(episode.window(0, 1), 1.0) == 1


def test_the_better_side_has_the_smaller_cost_and_at_side_picks_it():
    episode = make_episode()
    (chunk,) = chunks([episode], [episode.range_m], [sigma_of(episode)])
    chunk.range_m[0, 2] = np.nan
    solutions = chunk.solve(SolverOptions(), np.zeros(1))
    side = better_side(solutions)
    fit = solutions.negative_log_likelihood
    assert side[0, 2] == 0
    assert np.isnan(at_side(fit, side)[0, 2])
    located = [0, 1, 3, 4]
    assert np.array_equal(at_side(fit, side)[0, located], fit.min(axis=2)[0, located])
    assert np.array_equal(
        at_side(solutions.position_m, side)[0, 3], solutions.position_m[0, 3, side[0, 3]]
    )


@pytest.mark.parametrize("dof", [0.0, 4.0])
def test_normal_sums_are_the_solvers_information_and_a_vanishing_gradient(dof):
    episode = make_episode()
    (chunk,) = chunks([episode], [episode.range_m], [sigma_of(episode)])
    solutions = chunk.solve(SolverOptions(dof=dof, tolerance=1e-4), np.full(1, 0.2))
    side = better_side(solutions)
    sums = normal_sums(chunk, solutions, side, dof)
    information = at_side(solutions.information, side)
    information[..., 2, 2] -= 25.0
    assert np.allclose(sums.jj, information, rtol=1e-6)
    pull = sums.jr.copy()
    pull[..., 2] += 25.0 * at_side(solutions.bias_m, side)
    scaled = np.linalg.solve(np.linalg.cholesky(sums.jj), pull[..., None])
    assert np.abs(scaled).max() < 1e-3


def test_normal_sums_have_the_derivatives_by_bias_and_clock():
    episode = make_episode(heights=False)
    (chunk,) = chunks([episode], [episode.range_m], [sigma_of(episode)])
    solutions = chunk.solve(SolverOptions(dof=0.0), np.zeros(1))
    side = better_side(solutions)
    sums = normal_sums(chunk, solutions, side, 0.0)
    place = at_side(solutions.position_m, side)[0]
    use = episode.valid.T
    later = chunk.position_m[0] + 1e-6 * chunk.velocity_mps[0]
    slant = np.linalg.norm(place[:, None] - chunk.position_m[0], axis=2)
    # A range stamped late belongs to an earlier place of the tag.
    rate = -(np.linalg.norm(place[:, None] - later, axis=2) - slant) / 1e-6
    weight = use / (0.1 * at_side(solutions.scale, side)[0][:, None]) ** 2
    basis = np.nan_to_num(bias_basis(chunk.range_m[0]))
    assert np.allclose(sums.xx[0, :, 2, 2], (weight * rate**2).sum(axis=1), rtol=1e-5)
    assert np.allclose(sums.xx[0, :, 0, 1], (weight * basis[..., 1]).sum(axis=1), rtol=1e-9)
    assert np.allclose(sums.jx[0, :, 2, 2], (weight * rate).sum(axis=1), rtol=1e-4, atol=1e-2)
    residual = np.where(use, slant - chunk.range_m[0], 0.0)
    assert np.allclose(sums.xr[0, :, 0], (weight * residual).sum(axis=1), rtol=1e-9)


def test_with_prior_adds_it_or_holds_the_bias_and_survives_a_degenerate_anchor():
    jj = np.tile(np.array([[4.0, 1.0, 1.0], [1.0, 3.0, 1.0], [1.0, 1.0, 2.0]]), (2, 2, 1, 1))
    jj[1, 1] = 0.0
    out = with_prior(jj, np.array([5.0, 0.0]))
    assert out[0, 0, 2, 2] == 7.0
    inverse = np.linalg.inv(out)
    assert np.allclose(inverse[1, 0, :2, :2], np.linalg.inv(jj[1, 0, :2, :2]), rtol=1e-6)
    assert inverse[1, 0, 2, 2] < 1e-20
    assert np.isfinite(inverse).all()
    assert jj[0, 0, 2, 2] == 2.0
