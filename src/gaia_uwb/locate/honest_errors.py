"""What a linear covariance leaves out: the bend of a circle.

It takes no part in the decision on sides; it is in what is reported, and in the scenes that are
drawn.

Far from a short stretch of path an anchor's distance is known to centimetres and its bearing to
some degrees: the place lies on an arc about the stretch, not on the arc's tangent, which leaves the
circle by ``s^2 / 2 r`` after a length s. And ranges along a straight path tell the *square* of the
offset y from it: the linear error ``d sigma / y`` grows without bound where an anchor nears the
path's line and its mirror image, while the offset errs by no more than about ``sqrt(2 d sigma)``.
So linear errors are laid along these curves: first ``y -> sqrt(y^2 + 2 y e)``, down to the fold at
0 where the mirror image begins, then along the arc. Errors that are small compared with the offset
and the distance stay what they are.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gaia_uwb._shared import Array, Float64
from gaia_uwb.episode import Episode

_NODES = 7


def path_centres(episode: Episode) -> Float64[Array, "N 2"]:
    """Return the middle of the stretch of path from which each anchor was ranged.

    Parameters
    ----------
    episode
        The path and which ranges are usable.

    Returns
    -------
    (N, 2)
        East and north, in metres; the whole path's middle for an anchor without ranges.
    """
    origin_m = episode.position_m.mean(axis=0)
    local_m = episode.position_m - origin_m
    step, anchor = np.nonzero(episode.valid)
    count, *total_m = (
        np.bincount(anchor, weights, minlength=episode.n_anchors)
        for weights in (None, *local_m[step].T)
    )
    return np.asarray(np.stack(total_m, axis=1) / np.maximum(count, 1)[:, None] + origin_m)


@dataclass(frozen=True)
class Curves:
    """The curves along which places of N anchors err, instead of their tangents.

    Parameters
    ----------
    position_m, centre_m : (N, 2)
        The places, and the centres of their arcs.
    across : (N, 2)
        Unit vectors from each anchor's mirror image to it; 0 where there is none.
    fold_m : (N,)
        Distance from the line between both, where the two images meet.
    """

    position_m: Float64[Array, "N 2"]
    centre_m: Float64[Array, "N 2"]
    across: Float64[Array, "N 2"]
    fold_m: Float64[Array, "N"]

    @classmethod
    def of(
        cls,
        position_m: Float64[Array, "N 2"],
        mirror_m: Float64[Array, "N 2"],
        covariance_m2: Float64[Array, "N 2 2"],
        centre_m: Float64[Array, "N 2"],
    ) -> Curves:
        """Find the curves from places, their mirror images and linear covariances."""
        apart_m = position_m - mirror_m
        length_m = np.hypot(apart_m[:, 0], apart_m[:, 1])
        across = apart_m / np.maximum(length_m, 1e-9)[:, None]
        axes, radius_m = _polar_axes(position_m, centre_m)
        along, radial = across, axes[..., 0]
        sigma_m = np.sqrt(np.einsum("ni,nij,nj->n", along, covariance_m2, along))
        range_sigma_m = np.sqrt(np.einsum("ni,nij,nj->n", radial, covariance_m2, radial))
        # The error across is the range's, magnified by distance over offset; where it is smaller,
        # the path is bent, and no fold is near.
        fold_m = np.maximum(0.5 * length_m, radius_m * range_sigma_m / np.maximum(sigma_m, 1e-9))
        return cls(position_m, centre_m, across, np.maximum(fold_m, 1e-6))

    def lay(self, offset_m: Float64[Array, "S N 2"]) -> Float64[Array, "S N 2"]:
        """Return the places that linear errors of N places (S times, in metres) lead to."""
        linear_m = np.einsum("sni,ni->sn", offset_m, self.across)
        squared_m2 = self.fold_m * (self.fold_m + 2.0 * linear_m)
        folded_m = np.sqrt(np.maximum(squared_m2, 0.0)) - self.fold_m
        offset_m = offset_m + (folded_m - linear_m)[..., None] * self.across
        axes, radius_m = _polar_axes(self.position_m, self.centre_m)
        local = np.einsum("nji,snj->sni", axes, offset_m)
        angle = local[..., 1] / radius_m
        reach = radius_m + local[..., 0]
        turned = np.stack([reach * np.cos(angle), reach * np.sin(angle)], axis=-1)
        return np.asarray(self.centre_m + np.einsum("nij,snj->sni", axes, turned))

    def covariance_m2(self, linear_m2: Float64[Array, "N 2 2"]) -> Float64[Array, "N 2 2"]:
        """Return mean squared errors about the places, by a quadrature with 7 x 7 points."""
        node, weight = np.polynomial.hermite_e.hermegauss(_NODES)
        finite = np.isfinite(linear_m2).all(axis=(1, 2)) & np.isfinite(self.position_m).all(axis=1)
        known = np.asarray(finite)
        root = square_root(np.where(known[:, None, None], linear_m2, 0.0))
        pairs = np.stack(np.meshgrid(node, node), axis=-1).reshape(-1, 2)
        share = np.outer(weight, weight).ravel() / weight.sum() ** 2
        off_m = self.lay(np.einsum("nij,sj->sni", root, pairs)) - self.position_m
        out = np.einsum("s,sni,snj->nij", share, off_m, off_m)
        return np.where(known[:, None, None], out, linear_m2)


def _polar_axes(
    position_m: Float64[Array, "*rest 2"], centre_m: Float64[Array, "*rest 2"]
) -> tuple[Float64[Array, "*rest 2 2"], Float64[Array, "*rest"]]:
    """Return the directions along and across the radius as columns, and the radius."""
    radial = position_m - centre_m
    radius_m = np.maximum(np.hypot(radial[..., 0], radial[..., 1]), 1e-6)
    unit = radial / radius_m[..., None]
    unit = np.where((radial == 0.0).all(axis=-1, keepdims=True), [1.0, 0.0], unit)
    across = np.stack([-unit[..., 1], unit[..., 0]], axis=-1)
    return np.stack([unit, across], axis=-1), radius_m


def square_root(covariance: Float64[Array, "*rest n n"]) -> Float64[Array, "*rest n n"]:
    """Return symmetric square roots of covariance matrices.

    Parameters
    ----------
    covariance : (..., n, n)
        Symmetric, without negative eigenvalues beyond rounding, which are taken as 0.

    Examples
    --------
    >>> square_root(np.diag([4.0, 9.0])).tolist()
    [[2.0, 0.0], [0.0, 3.0]]
    """
    value, vector = np.linalg.eigh(covariance)
    half = vector * np.sqrt(np.maximum(value, 0.0))[..., None, :]
    return np.asarray(half @ np.swapaxes(vector, -1, -2))
