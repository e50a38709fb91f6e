import numpy as np
import pytest

from gaia_uwb.episode import Episode
from gaia_uwb.locate.honest_errors import Curves, path_centres, square_root

PATH_M = np.stack([np.linspace(-30.0, 30.0, 400), np.full(400, -4.0)], axis=1)


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
    valid = np.ones((400, 2), dtype=bool)
    valid[100:, 0] = False
    t_s, range_m = 0.1 * np.arange(400), np.where(valid, 9.0, np.nan)
    centre_m = path_centres(Episode("pass", ("a", "b"), t_s, PATH_M, range_m, valid))
    assert centre_m[0] == pytest.approx(PATH_M[:100].mean(axis=0))
    assert centre_m[1] == pytest.approx(PATH_M.mean(axis=0))


def test_square_roots_multiply_to_the_matrix() -> None:
    factor = np.random.default_rng(1).standard_normal((5, 3, 3))
    matrix = factor @ np.swapaxes(factor, -1, -2)
    root = square_root(matrix)
    assert root @ root == pytest.approx(matrix)
    assert np.array_equal(square_root(np.zeros((2, 2))), np.zeros((2, 2)))
