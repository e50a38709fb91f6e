"""Closed forms agree with the general routines."""

from __future__ import annotations

import numpy as np
import pytest

from gaia_uwb._shared.symmetric import Symmetric


def some(seed: int, *shape: int) -> np.ndarray:
    root = np.random.default_rng(seed).standard_normal((*shape, 2, 2))
    return root @ np.swapaxes(root, -1, -2) + 1e-3 * np.eye(2)


def test_closed_forms_are_those_of_linear_algebra() -> None:
    a, b = some(0, 5, 3), some(1, 5, 1)
    first, second = Symmetric.of(a), Symmetric.of(b)
    np.testing.assert_array_equal(first.matrix(), a)
    np.testing.assert_allclose(first.inverse().matrix(), np.linalg.inv(a), rtol=1e-9)
    np.testing.assert_allclose(first.determinant(), np.linalg.det(a), rtol=1e-9)
    np.testing.assert_allclose((first + second).matrix(), a + b)
    np.testing.assert_allclose(first.around(second).matrix(), a @ b @ a, atol=1e-12)
    np.testing.assert_allclose(first.sum(axis=1).matrix(), a.sum(axis=1))
    np.testing.assert_allclose(first.scaled(2.5).matrix(), 2.5 * a)
    x, y = np.random.default_rng(2).standard_normal((2, 5, 3))
    vector = np.stack([x, y], axis=-1)[..., None]
    np.testing.assert_allclose(np.stack(first.times(x, y), axis=-1), (a @ vector)[..., 0])
    square = np.swapaxes(vector, -1, -2) @ a @ vector
    np.testing.assert_allclose(first.square(x, y), square[..., 0, 0], rtol=1e-9)


@pytest.mark.parametrize("ratio", [1e3, 1e6])
def test_long_ellipses_are_inverted_well(ratio: float) -> None:
    turn = np.array([[0.6, -0.8], [0.8, 0.6]])
    long = turn @ np.diag([ratio, 1.0]) @ turn.T
    product = Symmetric.of(long[None]).inverse().matrix()[0] @ long
    np.testing.assert_allclose(product, np.eye(2), atol=1e-9 * ratio)
