"""On which side of a path places lie, and in which order it passes them.

>>> path_m = np.stack([np.linspace(0.0, 50.0, 101), np.zeros(101)], axis=1)
>>> PathSides(path_m).are_left(np.array([[10.0, 3.0], [20.0, -3.0]]))
array([ True, False])
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gaia_uwb._shared import Array, Bool, Float64, Int64

_CHUNK = 1 << 22  # distances worked on at a time
_STRETCH = 50  # parts of a path that have a direction: not one noisy step


@dataclass(frozen=True)
class PathSides:
    """The sides of one path.

    Parameters
    ----------
    path_m : (T, 2)
        In the direction of travel, in metres.
    """

    path_m: Float64[Array, "T 2"]

    def are_left(self, place_m: Float64[Array, "M 2"]) -> Bool[Array, "M"]:
        """Return whether places are left of the nearest stretch of path.

        Parameters
        ----------
        place_m : (M, 2)
            East and north, in metres.
        """
        exact = np.zeros((len(place_m), 1, 2, 2))
        return np.asarray(self.left_probability(place_m[:, None], exact)[:, 0] > 0.5)

    def left_probability(
        self, place_m: Float64[Array, "M H 2"], covariance_m2: Float64[Array, "M H 2 2"]
    ) -> Float64[Array, "M H"]:
        """Return the probability that places are left of the nearest stretch of path.

        Parameters
        ----------
        place_m, covariance_m2 : (M, H, 2), (M, H, 2, 2)
            H places of each of M anchors, in metres, and how sure they are.
        """
        step = self._nearest(place_m)
        reach = max(len(self.path_m) // _STRETCH, 1)
        first = np.maximum(step - reach, 0)
        last = np.minimum(step + reach, len(self.path_m) - 1)
        heading = self.path_m[last] - self.path_m[first]
        length_m = np.maximum(np.hypot(heading[..., 0], heading[..., 1]), 1e-9)
        leftward = np.stack([-heading[..., 1], heading[..., 0]], axis=-1) / length_m[..., None]
        offset_m = ((place_m - self.path_m[step]) * leftward).sum(axis=-1)
        variance_m2 = np.einsum("mhi,mhij,mhj->mh", leftward, covariance_m2, leftward)
        scaled = offset_m / np.sqrt(np.maximum(np.nan_to_num(variance_m2, nan=1e12), 1e-6))
        # The logistic curve that is nearest to the normal distribution's.
        return np.asarray(1.0 / (1.0 + np.exp(-1.702 * np.clip(scaled, -30.0, 30.0))))

    def order(
        self, place_m: Float64[Array, "M 2 2"], side: Int64[Array, "K M"]
    ) -> Int64[Array, "K M"]:
        """Return the anchors in the order in which the vehicle passes them.

        Parameters
        ----------
        place_m : (M, 2, 2)
            Both places of each anchor, in metres.
        side : (K, M)
            Which of them each takes, in each of K combinations.
        """
        step = self._nearest(place_m)[np.arange(side.shape[1]), side]
        return np.argsort(step, axis=1, kind="stable")

    def _nearest(self, place_m: Float64[Array, "M H 2"]) -> Int64[Array, "M H"]:
        """Return the step of the path that is nearest to each place."""
        flat = place_m.reshape(-1, 2)
        size = max(1, _CHUNK // len(self.path_m))
        nearest = [
            ((flat[start : start + size, None] - self.path_m) ** 2).sum(axis=2).argmin(axis=1)
            for start in range(0, len(flat), size)
        ]
        return np.concatenate(nearest).reshape(place_m.shape[:2])
