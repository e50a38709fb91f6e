"""Many symmetric 2 x 2 matrices at once, in closed form.

A general routine for small matrices spends nearly all of its time on overhead; with one
array for each of the three numbers, an operation on thousands of them is a few array operations.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from gaia_uwb._shared.arrays import Array, Float64


@dataclass(frozen=True, slots=True)
class Symmetric:
    """Symmetric 2 x 2 matrices; the arrays broadcast against each other like numbers.

    Parameters
    ----------
    xx, xy, yy
        Their elements, each of any shape S.

    Examples
    --------
    >>> matrices = Symmetric.of(np.array([[[4.0, 1.0], [1.0, 0.5]]]))
    >>> x, y = matrices.inverse().times(5.0, 2.0)
    >>> x.tolist(), y.tolist()
    ([0.5], [3.0])
    """

    xx: Float64[Array, "..."]
    xy: Float64[Array, "..."]
    yy: Float64[Array, "..."]

    @classmethod
    def of(cls, matrix: Float64[Array, "*_ 2 2"]) -> Symmetric:
        """Take matrices apart.

        Parameters
        ----------
        matrix : (*S, 2, 2)
            Symmetric.
        """
        parts = (matrix[..., 0, 0], matrix[..., 0, 1], matrix[..., 1, 1])
        return cls(*(np.array(part) for part in parts))

    def matrix(self) -> Float64[Array, "*_ 2 2"]:
        """Return them as an array (*S, 2, 2)."""
        rows = np.broadcast_arrays(self.xx, self.xy, self.xy, self.yy)
        return np.stack(rows, axis=-1).reshape(*rows[0].shape, 2, 2)

    def __add__(self, other: Symmetric) -> Symmetric:
        return Symmetric(self.xx + other.xx, self.xy + other.xy, self.yy + other.yy)

    def __getitem__(self, key: Any) -> Symmetric:
        return Symmetric(self.xx[key], self.xy[key], self.yy[key])

    def scaled(self, factor: Float64[Array, "..."] | float) -> Symmetric:
        """Return each of them times a number."""
        return Symmetric(factor * self.xx, factor * self.xy, factor * self.yy)

    def determinant(self) -> Float64[Array, "..."]:
        """Return their determinants."""
        return np.asarray(self.xx * self.yy - self.xy * self.xy)

    def inverse(self) -> Symmetric:
        """Return their inverses."""
        factor = 1.0 / self.determinant()
        return Symmetric(factor * self.yy, -factor * self.xy, factor * self.xx)

    def times(
        self, x: Float64[Array, "..."] | float, y: Float64[Array, "..."] | float
    ) -> tuple[Float64[Array, "..."], Float64[Array, "..."]]:
        """Return them times vectors, given and returned as one array for each coordinate."""
        return self.xx * x + self.xy * y, self.xy * x + self.yy * y

    def square(
        self, x: Float64[Array, "..."] | float, y: Float64[Array, "..."] | float
    ) -> Float64[Array, "..."]:
        """Return the quadratic forms v^T M v of vectors."""
        return self.xx * x * x + 2.0 * self.xy * x * y + self.yy * y * y

    def around(self, inner: Symmetric) -> Symmetric:
        """Return A B A, with these as A and others as B."""
        top = inner.times(self.xx, self.xy)  # B times A's columns
        bottom = inner.times(self.xy, self.yy)
        return Symmetric(
            self.xx * top[0] + self.xy * top[1],
            self.xx * bottom[0] + self.xy * bottom[1],
            self.xy * bottom[0] + self.yy * bottom[1],
        )

    def sum(self, axis: int) -> Symmetric:
        """Return sums along an axis of their shape."""
        return Symmetric(self.xx.sum(axis), self.xy.sum(axis), self.yy.sum(axis))
