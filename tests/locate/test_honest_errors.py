import numpy as np
import pytest

from gaia_uwb.episode import Episode, RangeCalibration
from gaia_uwb.locate.honest_errors import Curves, own_inflation, path_centres, square_root

PATH_M = np.stack([np.linspace(-30.0, 30.0, 400), np.full(400, -4.0)], axis=1)
CONES_M = np.array([[0.0, 3.0], [8.0, 5.0]])


def make_episode(error_m, sigma_m=0.05):
    """Return ranges to two cones with errors (T, 2)."""
    true_m = np.linalg.norm(PATH_M[:, None] - CONES_M, axis=2)
    return Episode(
        "pass", ("a", "b"), np.arange(400) * 0.1, PATH_M, true_m + error_m, true_m > 0,
        calibration=RangeCalibration(np.zeros(2), np.zeros((2, 2)), sigma_m, 1.0),
    )  # fmt: skip


def inflation_of(episode, position_m=CONES_M[:, None]):
    return own_inflation(episode, position_m, np.zeros(2), 4.0)


def test_an_anchor_whose_ranges_err_for_long_is_inflated() -> None:
    rng = np.random.default_rng(3)
    error_m = 0.05 * rng.standard_normal((400, 2))
    assert inflation_of(make_episode(error_m)) == pytest.approx(1.0, abs=0.8)
    error_m[100:160, 1] += 0.3
    usual, worse = inflation_of(make_episode(error_m))
    assert usual < 2.0
    assert worse > 10.0


def test_a_single_outlier_counts_little_and_gaps_do_not_matter() -> None:
    error_m = 0.05 * np.random.default_rng(4).standard_normal((400, 2))
    before = inflation_of(make_episode(error_m))
    error_m[200] = 30.0
    assert inflation_of(make_episode(error_m)) == pytest.approx(before, abs=0.3)
    error_m[50:90, 0] = np.nan
    episode = make_episode(np.nan_to_num(error_m))
    valid = np.isfinite(error_m)
    gapped = Episode(
        "pass", ("a", "b"), episode.t_s, PATH_M, np.where(valid, episode.range_m, np.nan), valid,
        calibration=episode.calibration,
    )  # fmt: skip
    assert np.isfinite(inflation_of(gapped)).all()


def test_the_better_of_two_places_counts() -> None:
    error_m = 0.05 * np.random.default_rng(5).standard_normal((400, 2))
    both_m = np.stack([CONES_M + np.array([0.0, 4.0]), CONES_M], axis=1)
    assert np.array_equal(
        inflation_of(make_episode(error_m), both_m), inflation_of(make_episode(error_m))
    )


def test_nothing_to_compare_with_is_no_inflation() -> None:
    episode = make_episode(np.ones((400, 2)))
    bare = Episode("pass", ("a", "b"), episode.t_s, PATH_M, episode.range_m, episode.valid)
    assert inflation_of(bare).tolist() == [1.0, 1.0]


def curves_of(place_m, mirror_m, covariance_m2, centre_m=(0.0, 0.0)):
    return Curves.of(*(np.array([each], dtype=float) for each in
                       (place_m, mirror_m, covariance_m2, centre_m)))  # fmt: skip


def test_small_errors_stay_what_they_are() -> None:
    covariance_m2 = np.array([[0.01, 0.002], [0.002, 0.02]])
    curves = curves_of([20.0, 10.0], [20.0, -10.0], covariance_m2)
    assert curves.covariance_m2(covariance_m2[None])[0] == pytest.approx(covariance_m2, rel=0.01)
    offset_m = np.array([[[0.01, -0.02]]])
    assert curves.lay(offset_m)[0, 0] == pytest.approx([20.01, 9.98], abs=1e-4)


def test_a_place_far_off_errs_along_its_arc() -> None:
    # To the side of a short path: 60 m off, known to 10 cm, its bearing to 10 degrees.
    covariance_m2 = np.diag([10.0**2, 0.1**2])
    curves = curves_of([0.0, 60.0], [0.0, -60.0], covariance_m2)
    laid_m = curves.lay(np.array([[[15.0, 0.0]], [[-15.0, 0.05]]]))[:, 0]
    assert np.hypot(*laid_m.T) == pytest.approx([60.0, 60.05], abs=0.01)
    honest_m2 = curves.covariance_m2(covariance_m2[None])[0]
    sag_m = 10.0**2 / (2 * 60.0)
    assert honest_m2[1, 1] == pytest.approx(3 * sag_m**2, rel=0.2)


def test_near_its_own_mirror_image_the_offset_errs_less_than_its_slope_says() -> None:
    # Ahead of a straight path, 30 m away: an offset of 0.2 m is told by the square of distances.
    distance_m, offset_m, sigma_m = 30.0, 0.2, 0.05
    slope = distance_m / offset_m
    covariance_m2 = np.diag([sigma_m**2, (slope * sigma_m) ** 2])
    curves = curves_of([distance_m, offset_m], [distance_m, -offset_m], covariance_m2)
    rng = np.random.default_rng(0)
    range_m = np.hypot(distance_m, offset_m) + sigma_m * rng.standard_normal(4000)
    seen_m = np.sqrt(np.maximum(range_m**2 - distance_m**2, 0.0)) - offset_m
    laid_m = curves.lay((slope * sigma_m * rng.standard_normal((4000, 1, 1))) * [0.0, 1.0])[:, 0, 1]
    quantiles = (0.1, 0.5, 0.9)
    assert np.quantile(laid_m - offset_m, quantiles) == pytest.approx(
        np.quantile(seen_m, quantiles), rel=0.2, abs=0.15
    )
    assert curves.covariance_m2(covariance_m2[None])[0, 1, 1] < (slope * sigma_m) ** 2 / 10


def test_one_place_twice_has_no_fold() -> None:
    covariance_m2 = 0.04 * np.eye(2)
    curves = curves_of([20.0, 10.0], [20.0, 10.0 - 1e-3], covariance_m2)
    assert curves.covariance_m2(covariance_m2[None])[0] == pytest.approx(
        covariance_m2, rel=0.05, abs=1e-4
    )


def test_unlocated_anchors_stay_unknown() -> None:
    nowhere = np.full(2, np.nan)
    curves = curves_of(nowhere, nowhere, np.full((2, 2), np.nan))
    assert np.isnan(curves.covariance_m2(np.full((1, 2, 2), np.nan))).all()


def test_path_centres_are_of_the_ranged_stretch() -> None:
    episode = make_episode(np.zeros((400, 2)))
    valid = episode.valid.copy()
    valid[100:, 0] = False
    part = Episode("pass", ("a", "b"), episode.t_s, PATH_M,
                   np.where(valid, episode.range_m, np.nan), valid)  # fmt: skip
    centre_m = path_centres(part)
    assert centre_m[0] == pytest.approx(PATH_M[:100].mean(axis=0))
    assert centre_m[1] == pytest.approx(PATH_M.mean(axis=0))


def test_square_roots_multiply_to_the_matrix() -> None:
    factor = np.random.default_rng(1).standard_normal((5, 3, 3))
    matrix = factor @ np.swapaxes(factor, -1, -2)
    root = square_root(matrix)
    assert root @ root == pytest.approx(matrix)
    assert np.array_equal(square_root(np.zeros((2, 2))), np.zeros((2, 2)))
