"""Inverses of many small covariances at once, compared with NumPy's."""

import numpy as np
import pytest

from gaia_uwb.locate._covariances import invert


def covariances(seed, count, size):
    """Return covariances whose variances differ by as much as those of cells do."""
    rng = np.random.default_rng(seed)
    root = rng.standard_normal((count, size, size))
    spread = 10.0 ** rng.uniform(-4.0, 2.0, (count, size))
    return root @ np.swapaxes(root, -1, -2) / size + spread[..., None] * np.eye(size)


@pytest.mark.parametrize("size", [1, 2, 3, 7, 30, 64, 65])
def test_inverses_and_determinants_are_numpys(size):
    given = covariances(size, 11, size)
    inverse, log_det = given.copy(), np.empty(11)
    invert(inverse, log_det, size)
    expected = np.linalg.inv(given)
    scale = np.abs(expected).max(axis=(1, 2), keepdims=True)
    assert inverse / scale == pytest.approx(expected / scale, abs=1e-11)
    assert (inverse == np.swapaxes(inverse, -1, -2)).all()
    assert log_det == pytest.approx(np.linalg.slogdet(given)[1], abs=1e-11)


def test_of_no_matrices_there_is_nothing_to_do():
    invert(np.empty((0, 4, 4)), np.empty(0), 4)


@pytest.mark.parametrize("wrong", [[[1.0, 2.0], [2.0, 1.0]], [[0.0, 0.0], [0.0, 1.0]], np.nan])
def test_what_is_no_covariance_is_refused(wrong):
    matrices = np.tile(np.eye(2), (3, 1, 1))
    matrices[1] = wrong
    with pytest.raises(ValueError, match="not positive definite"):
        invert(matrices, np.empty(3), 2)


@pytest.mark.parametrize("size", [-2, 0, 1, 3, 2**62])
def test_sizes_that_do_not_fit_are_refused(size):
    with pytest.raises(ValueError, match="do not fit"):
        invert(np.tile(np.eye(2), (3, 1, 1)), np.empty(3), size)
