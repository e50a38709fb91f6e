import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.optimize import least_squares

from alike import assert_same
from gaia_uwb.solver.multilateration import Solutions, SolverOptions, solve

GAUSSIAN = SolverOptions(dof=0.0)
SIGMA_M = 0.1


def bent_path(steps=64, length_m=60.0, bend_m=8.0):
    s = np.linspace(-0.5, 0.5, steps)
    return np.stack([length_m * s, bend_m * np.sin(5.0 * s)], axis=-1)


def distances(path, anchors):
    """Return (N, T) horizontal distances."""
    return np.linalg.norm(path - anchors[:, None], axis=-1)


def solve_one_path(path, ranges, sigma_m=SIGMA_M, **changes):
    return solve(path[None], ranges[None], sigma_m, **changes)


def best_places(found):
    side = found.negative_log_likelihood.argmin(axis=-1)
    return np.take_along_axis(found.position_m, side[..., None, None], axis=2)[:, :, 0]


def noisy(rng, n=40):
    path = bent_path()
    anchors = np.stack([rng.uniform(-25, 25, n), rng.choice([-1, 1], n) * rng.uniform(3, 15, n)], 1)
    return path, anchors, distances(path, anchors) + SIGMA_M * rng.standard_normal((n, 64))


@settings(max_examples=60, deadline=None)
@given(
    st.integers(0, 2**32 - 1),
    st.integers(5, 80),
    st.floats(1.0, 500.0),
    st.sampled_from([0.0, 4.0]),
    st.sampled_from([0.0, 0.05]),
)
def test_noise_free_ranges_give_the_anchor(seed, steps, size_m, dof, bias_sigma_m):
    rng = np.random.default_rng(seed)
    path = size_m * rng.uniform(-1.0, 1.0, (steps, 2))
    anchors = size_m * rng.uniform(-2.0, 2.0, (3, 2))
    found = solve_one_path(
        path, distances(path, anchors), options=SolverOptions(dof=dof), bias_sigma_m=bias_sigma_m
    )
    assert np.abs(best_places(found)[0] - anchors).max() < 1e-3 * size_m + 1e-3
    assert found.scale.min() >= 0.05


def test_a_gaussian_cost_is_never_above_the_best_of_twelve_scipy_starts():
    rng = np.random.default_rng(1)
    path, _, ranges = noisy(rng, 20)
    found = best_places(solve_one_path(path, ranges, options=GAUSSIAN))[0]
    ours = ((distances(path, found) - ranges) ** 2).sum(axis=1)
    for n, measured in enumerate(ranges):
        best = min(
            2.0 * least_squares(
                lambda x, d=measured: np.linalg.norm(path - x, axis=1) - d, start, method="lm"
            ).cost
            for start in rng.uniform(-30.0, 30.0, (12, 2))
        )  # fmt: skip
        assert ours[n] <= best * (1.0 + 1e-4)


@pytest.mark.parametrize("dof", [0.0, 4.0])
def test_a_straight_path_gives_the_exact_mirror_pair(dof):
    path = np.stack([np.linspace(-20.0, 20.0, 64), np.zeros(64)], axis=1)
    noise = SIGMA_M * np.random.default_rng(2).standard_normal(64)
    found = solve_one_path(
        path, distances(path, np.array([[3.0, 7.0]])) + noise, options=SolverOptions(dof=dof)
    )
    first, second = found.position_m[0, 0]
    assert np.abs(first - second * [1.0, -1.0]).max() < 0.002
    assert abs(first[0] - 3.0) < 0.2
    assert abs(abs(first[1]) - 7.0) < 0.2
    assert np.ptp(found.negative_log_likelihood) < 1e-3


def test_a_batch_gives_what_each_problem_alone_gives_to_the_last_bit():
    rng = np.random.default_rng(3)
    path, _, ranges = noisy(rng, 9)
    paths = np.stack([path, path[::-1] * 3.0, np.zeros_like(path)])  # the last one is parked
    ranges = np.stack([ranges, ranges[::-1] * 2.0, ranges])
    ranges[0, 1] = np.nan
    ranges[0, 2, ::2] = np.nan
    ranges[0, 3] = 1e300
    ranges[1, 4] = -5.0
    ranges[1, 5] = 0.0
    ranges[2, 6, :3] = np.inf
    sigma_m = rng.uniform(0.05, 0.2, ranges.shape)
    sigma_m[0, 7] = 0.0
    sigma_m[0, 8, :30] = np.nan
    together = solve(paths, ranges, sigma_m, bias_sigma_m=0.05)
    for b in range(3):
        for n in range(9):
            part = np.s_[b : b + 1, n : n + 1]
            alone = solve(paths[b : b + 1], ranges[part], sigma_m[part], bias_sigma_m=0.05)
            for name in Solutions.__dataclass_fields__:
                assert np.array_equal(getattr(together, name)[part], getattr(alone, name),
                                      equal_nan=True), (b, n, name)  # fmt: skip
    assert together.n_ranges[0, [1, 2, 3, 7, 8]].tolist() == [0, 32, 0, 0, 34]
    assert np.isfinite(together.position_m[0, [0, 2, 4, 5, 6, 8]]).all()


def test_permuted_anchors_give_permuted_solutions():
    rng = np.random.default_rng(4)
    path, _, ranges = noisy(rng, 12)
    order = rng.permutation(12)
    found, permuted = solve_one_path(path, ranges), solve_one_path(path, ranges[order])
    for name in Solutions.__dataclass_fields__:
        assert np.array_equal(getattr(found, name)[:, order], getattr(permuted, name))


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(-np.pi, np.pi), st.booleans(),
       st.sampled_from([0.0, 1e3, 5e6]))  # fmt: skip
def test_solutions_move_with_the_frame(seed, angle, reflect, far_m):
    rng = np.random.default_rng(seed)
    path, _, ranges = noisy(rng, 6)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    turn = turn @ np.diag([1.0, -1.0 if reflect else 1.0])
    shift = far_m * rng.uniform(-1.0, 1.0, 2)
    exact = {"bias_sigma_m": 0.05, "options": SolverOptions(tolerance=1e-4)}
    here = solve_one_path(path, ranges, **exact)
    there = solve_one_path(path @ turn.T + shift, ranges, **exact)
    moved = best_places(here)[0] @ turn.T + shift
    assert np.abs(best_places(there)[0] - moved).max() < 1e-5
    best = here.negative_log_likelihood.min(axis=-1)
    assert np.allclose(best, there.negative_log_likelihood.min(axis=-1), atol=1e-3)


def test_heights_are_taken_off_slant_ranges_and_an_unknown_one_is_not():
    path = bent_path()
    anchors = np.array([[5.0, 9.0], [-8.0, -6.0], [0.0, 12.0]])
    tag_m = 1.5 + 0.2 * np.sin(np.arange(64) / 5.0)
    heights_m = np.array([4.0, -2.0, np.nan])
    gap = np.nan_to_num(tag_m - heights_m[:, None])
    slant = np.sqrt(distances(path, anchors) ** 2 + gap**2)
    found = solve_one_path(path, slant, height_m=(tag_m[None], heights_m[None]))
    assert np.abs(best_places(found)[0] - anchors).max() < 1e-4
    flat = solve_one_path(path, slant)
    assert np.abs(best_places(flat)[0] - anchors)[:2].max() > 0.05


@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize(("dof", "share"), [(4.0, 0.1), (1.0, 0.3)])
def test_outliers_of_either_sign_hardly_matter(sign, dof, share):
    rng = np.random.default_rng(5)
    path, anchors, ranges = noisy(rng, 100)
    outlier = rng.random(ranges.shape) < share
    ranges = ranges + np.where(outlier, sign * rng.uniform(1.0, 15.0, ranges.shape), 0.0)
    found = solve_one_path(path, ranges, options=SolverOptions(dof=dof))
    error = np.linalg.norm(best_places(found)[0] - anchors, axis=1)
    assert np.median(error) < 0.05
    assert np.quantile(error, 0.95) < 0.2


def negative_log_likelihood(x, path, measured, dof, scale, bias_sigma_m):
    u2 = ((np.linalg.norm(path - x[:2], axis=1) + x[2] - measured) / (scale * SIGMA_M)) ** 2
    fit = 0.5 * u2 if dof == 0 else 0.5 * (dof + 1.0) * np.log1p(u2 / dof)
    return len(measured) * np.log(scale) + fit.sum() + 0.5 * (x[2] / bias_sigma_m) ** 2


def finite_differences(cost, x, step=1e-4):
    unit = step * np.eye(3)
    gradient = np.array([cost(x + e) - cost(x - e) for e in unit]) / (2 * step)
    hessian = np.array([
        [cost(x + e + f) - cost(x + e - f) - cost(x - e + f) + cost(x - e - f) for f in unit]
        for e in unit
    ]) / (4 * step**2)  # fmt: skip
    return gradient, hessian


@pytest.mark.parametrize("dof", [0.0, 4.0])
def test_a_solution_is_a_minimum_of_the_likelihood_that_it_reports(dof):
    path, _, ranges = noisy(np.random.default_rng(6), 10)
    found = solve_one_path(
        path, ranges, bias_sigma_m=0.1, options=SolverOptions(dof=dof, tolerance=1e-5)
    )
    for n in range(10):
        k = int(found.negative_log_likelihood[0, n].argmin())
        x = np.append(found.position_m[0, n, k], found.bias_m[0, n, k])
        scale = found.scale[0, n, k]

        def cost(y, d=ranges[n], s=scale):
            return negative_log_likelihood(y, path, d, dof, s, 0.1)

        assert abs(found.negative_log_likelihood[0, n, k] - cost(x)) < 1e-6
        gradient, hessian = finite_differences(cost, x)
        information = found.information[0, n, k]
        assert np.sqrt(gradient @ np.linalg.solve(information, gradient)) < 1e-3
        assert cost(x) <= min(negative_log_likelihood(x, path, ranges[n], dof, s, 0.1)
                              for s in scale * np.array([0.97, 1.03]))  # fmt: skip
        if dof == 0:  # Gauss-Newton's matrix leaves out the curvature of the ranges
            assert np.abs(hessian / information - 1.0)[[0, 1, 2], [0, 1, 2]].max() < 0.05


def test_the_long_run_variance_is_neweys_and_wests():
    path, _, ranges = noisy(np.random.default_rng(7), 3)
    lags = 5
    options = SolverOptions(dof=4.0, max_lag=lags)
    found = solve_one_path(path, ranges, bias_sigma_m=0.1, options=options)
    for n, k in np.ndindex(3, 2):
        off = found.position_m[0, n, k] - path
        slant = np.linalg.norm(off, axis=1)
        residual = slant + found.bias_m[0, n, k] - ranges[n]
        sigma = found.scale[0, n, k] * SIGMA_M
        weight = 5.0 / (4.0 + (residual / sigma) ** 2) / sigma**2
        jacobian = np.column_stack([off / slant[:, None], np.ones(64)])
        score = (weight * residual)[:, None] * jacobian
        expected = score.T @ score
        for lag in range(1, lags + 1):
            product = score[lag:].T @ score[:-lag]
            expected += (1.0 - lag / (lags + 1.0)) * (product + product.T)
        assert np.allclose(found.long_run[0, n, k], expected, rtol=1e-6, atol=1e-6 * expected.max())
        inflation = expected[2, 2] / (score[:, 2] ** 2).sum()
        assert found.correlation[0, n, k] == pytest.approx(max(inflation, 1.0), rel=1e-6)
        information = 5.0 / 7.0 * jacobian.T @ (weight[:, None] * jacobian)
        information[2, 2] += 100.0
        assert np.allclose(found.information[0, n, k], information, rtol=1e-6)


def test_a_bias_is_found_where_the_drive_tells_it_and_stays_0_where_it_cannot():
    rng = np.random.default_rng(8)
    circle = 10.0 * np.stack([np.cos(np.arange(64) / 10), np.sin(np.arange(64) / 10)], axis=1)
    measured = distances(circle, np.array([[2.0, 1.0]])) + 0.3
    measured += 0.02 * rng.standard_normal(measured.shape)
    told = solve_one_path(circle, measured, 0.02, bias_sigma_m=1.0)
    assert told.bias_m[0, 0] == pytest.approx(0.3, abs=0.02)
    far = np.stack([np.linspace(0.0, 5.0, 64), 200.0 + np.zeros(64)], axis=1)
    untold = solve_one_path(far, distances(far, np.zeros((1, 2))) + 0.3, bias_sigma_m=0.05)
    assert np.abs(untold.bias_m).max() < 0.01
    assert np.all(solve_one_path(circle, measured).bias_m == 0.0)


def test_a_fixed_scale_is_kept_and_a_small_one_is_bounded():
    path, _, ranges = noisy(np.random.default_rng(9), 4)
    fixed = solve_one_path(path, ranges, options=SolverOptions(fixed_scale=2.0))
    assert np.all(fixed.scale == 2.0)
    floor = solve_one_path(path, ranges, 10.0, options=SolverOptions(scale_floor=0.5))
    assert np.all(floor.scale == 0.5)


def test_the_estimated_scale_is_that_of_the_errors():
    path, anchors, _ = noisy(np.random.default_rng(10), 60)
    errors = np.random.default_rng(11).standard_t(4.0, (60, 64))
    found = solve_one_path(path, distances(path, anchors) + 0.2 * errors)
    best = np.take_along_axis(
        found.scale, found.negative_log_likelihood.argmin(axis=-1)[..., None], axis=-1
    )
    assert np.median(best) == pytest.approx(2.0, rel=0.07)


@pytest.mark.parametrize("shape", ["parked", "one place twice", "out and back"])
def test_degenerate_paths_give_finite_places_that_fit(shape):
    path = {
        "parked": np.full((64, 2), 7.0),
        "one place twice": np.repeat([[0.0, 0.0], [10.0, 0.0]], 32, axis=0),
        "out and back": np.stack([10.0 * np.sin(np.arange(64) / 9.0), np.zeros(64)], axis=1),
    }[shape]
    ranges = distances(path, np.array([[4.0, 5.0]]))
    found = solve_one_path(path, ranges)
    assert np.isfinite(found.position_m).all()
    for place in found.position_m[0, 0]:
        assert np.abs(distances(path, place[None]) - ranges).max() < 1e-3


def test_too_few_ranges_leave_nan_and_the_count():
    path, _, ranges = noisy(np.random.default_rng(12), 2)
    ranges[0, 3:] = np.nan
    found = solve_one_path(path, ranges)
    assert found.n_ranges[0].tolist() == [3, 64]
    assert np.isnan(found.position_m[0, 0]).all()
    assert not found.converged[0, 0].any()


def test_nan_positions_and_heights_cost_only_their_own_steps():
    path, _, ranges = noisy(np.random.default_rng(13), 3)
    path[:5] = np.nan
    tag_m = np.zeros((1, 64))
    tag_m[0, 60:] = np.nan
    found = solve_one_path(path, ranges, height_m=(tag_m, np.zeros((1, 3))))
    assert found.n_ranges[0].tolist() == [55, 55, 55]
    kept = solve_one_path(path[5:60], ranges[:, 5:60])
    assert_same(found, kept)


def test_few_iterations_are_said_not_to_converge():
    path, _, ranges = noisy(np.random.default_rng(14), 5)
    found = solve_one_path(path, ranges, options=SolverOptions(max_iterations=1, tolerance=1e-9))
    assert not found.converged.any()
    assert np.all(found.iterations == 1.0)


@pytest.mark.parametrize(("episodes", "anchors", "steps"), [(0, 3, 5), (2, 0, 5), (2, 3, 0)])
def test_nothing_to_solve_is_no_error(episodes, anchors, steps):
    found = solve(np.zeros((episodes, steps, 2)), np.zeros((episodes, anchors, steps)), 0.1)
    assert found.position_m.shape == (episodes, anchors, 2, 2)
    assert np.all(found.n_ranges == 0)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"position_m": np.zeros((1, 7, 2))}, "position_m of shape"),
        ({"height_m": (np.zeros((1, 7)), np.zeros((1, 2)))}, "tag's height_m"),
        ({"height_m": (np.zeros((1, 8)), np.zeros((1, 3)))}, "anchors' height_m"),
        ({"options": SolverOptions(min_ranges=2)}, "min_ranges of at least 3"),
        ({"options": SolverOptions(max_lag=-1)}, "settings do not fit"),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_refused(changes, message):
    arguments = {"position_m": np.zeros((1, 8, 2)), "range_m": np.ones((1, 2, 8)), "sigma_m": 0.1}
    # jaxtyping would find disagreeing shapes first, so the plain function is called.
    plain = getattr(solve, "__wrapped__", solve)
    with pytest.raises(ValueError, match=message):
        plain(**(arguments | changes))
