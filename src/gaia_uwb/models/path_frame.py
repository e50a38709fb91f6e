"""The path's own frame: where nothing of a scene's place, direction or handedness is left.

The origin is the mean of the path; x runs along its principal axis, in the direction of travel, and
y to the left. Whatever is computed in this frame moves and turns with the scene. A mirrored scene
has the same frame with y negated, so anything that treats left and right alike mirrors with it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gaia_uwb._shared import Array, Float64

_LARGEST_BEND_PER_M = 0.02  # of the parabola; beyond, a path is no road to be continued
_RIDGE = np.array([1e-4, 1e-3, 1e-3])  # a path that stands still has no slope and no bend


@dataclass(frozen=True)
class PathFrame:
    """The frames of B paths.

    Parameters
    ----------
    origin_m : (B, 2)
        Mean of each path, east and north in metres.
    axes : (B, 2, 2)
        Rows: the unit vectors along the path and to its left.
    """

    origin_m: Float64[Array, "B 2"]
    axes: Float64[Array, "B 2 2"]

    @classmethod
    def of(cls, position_m: Float64[Array, "B T 2"]) -> PathFrame:
        """Return the frames of paths.

        Parameters
        ----------
        position_m : (B, T, 2)
            East and north in metres.

        Examples
        --------
        >>> north = np.stack([np.zeros(5), np.arange(5.0)], axis=-1)[None]
        >>> frame = PathFrame.of(north)
        >>> frame.enter(np.array([[[-1.0, 2.0]]])).round(6) + 0.0  # to the left of the middle
        array([[[0., 1.]]])
        """
        origin_m = position_m.mean(axis=1)
        off_m = position_m - origin_m[:, None]
        scatter = np.einsum("bti,btj->bij", off_m, off_m)
        angle_rad = 0.5 * np.arctan2(2 * scatter[:, 0, 1], scatter[:, 0, 0] - scatter[:, 1, 1])
        along = np.stack([np.cos(angle_rad), np.sin(angle_rad)], axis=-1)
        ahead_m = ((position_m[:, -1] - position_m[:, 0]) * along).sum(axis=-1)
        along *= np.where(ahead_m < 0, -1.0, 1.0)[:, None]
        left = np.stack([-along[:, 1], along[:, 0]], axis=-1)
        return cls(origin_m, np.stack([along, left], axis=1))

    def enter(self, place_m: Float64[Array, "B K 2"]) -> Float64[Array, "B K 2"]:
        """Return places (east, north) as (along, left), in metres."""
        return np.asarray(np.einsum("bij,bkj->bki", self.axes, place_m - self.origin_m[:, None]))

    def leave(self, place_m: Float64[Array, "B K 2"]) -> Float64[Array, "B K 2"]:
        """Return places (along, left) as (east, north), in metres."""
        turned_m = np.einsum("bji,bkj->bki", self.axes, place_m)
        return np.asarray(turned_m + self.origin_m[:, None])

    def turn_covariance(
        self, covariance_m2: Float64[Array, "B K 2 2"]
    ) -> Float64[Array, "B K 2 2"]:
        """Return covariances of (along, left) as those of (east, north)."""
        return np.asarray(np.einsum("bji,bkjl,blm->bkim", self.axes, covariance_m2, self.axes))


def road_parabola(path_m: Float64[Array, "B T 2"]) -> Float64[Array, "B 3"]:
    """Fit ``left = c0 + c1 along + c2 along^2`` to paths in their own frames.

    It continues the road beyond what was driven: anchors stand along it, not along a chord.

    Parameters
    ----------
    path_m : (B, T, 2)
        Along and left, in metres.

    Examples
    --------
    >>> along_m = np.linspace(-50, 50, 101)
    >>> path_m = np.stack([along_m, 0.001 * along_m**2], axis=-1)[None]
    >>> float(road_parabola(path_m)[0, 2].round(4))
    0.001
    """
    along_m, left_m = path_m[..., 0], path_m[..., 1]
    scale_m = np.maximum(np.abs(along_m).max(axis=1, keepdims=True), 1.0)
    share = along_m / scale_m
    basis = np.stack([np.ones_like(share), share, share**2], axis=-1)  # (B, T, 3)
    normal = np.einsum("bti,btj->bij", basis, basis) / along_m.shape[1] + np.diag(_RIDGE)
    right = np.einsum("bti,bt->bi", basis, left_m) / along_m.shape[1]
    found = np.linalg.solve(normal, right[..., None])[..., 0]
    found /= np.concatenate([np.ones_like(scale_m), scale_m, scale_m**2], axis=1)
    found[:, 2] = np.clip(found[:, 2], -_LARGEST_BEND_PER_M, _LARGEST_BEND_PER_M)
    return np.asarray(found)
