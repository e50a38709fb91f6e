"""What a linear covariance leaves out: errors peculiar to one anchor, and the bend of a circle.

Two things make an anchor's place less sure than the covariance of ``hypotheses.py`` says. Neither
takes part in the decision on sides; both are in what is reported, and in the scenes that are drawn.

*Inflation.* The calibration knows how the whole log's ranges err: their variance, times the number
of ranges in a row that err alike. One anchor may be worse: someone parked a truck before it. Its
own residuals tell. They are clipped at three of their robust standard deviations, as an estimator
that withstands outliers sees them, and their long-run variance (Newey and West, 1987) is set
against the log's. An anchor never counts as better than its log: a few ranges cannot show that.

*Curves.* Far from a short stretch of path an anchor's distance is known to centimetres and its
bearing to some degrees: the place lies on an arc about the stretch, not on the arc's tangent, which
leaves the circle by ``s^2 / 2 r`` after a length s. And ranges along a straight path tell the
*square* of the offset y from it: the linear error ``d sigma / y`` grows without bound where an
anchor nears the path's line and its mirror image, while the offset errs by no more than about
``sqrt(2 d sigma)``. So linear errors are laid along these curves: first
``y -> sqrt(y^2 + 2 y e)``, down to the fold at 0 where the mirror image begins, then along the arc.
Errors that are small compared with the offset and the distance stay what they are.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gaia_uwb._shared import Array, Float64
from gaia_uwb.episode import Episode
from gaia_uwb.solver import correlation_lag

_CLIP_SIGMA = 3.0
_NODES = 7
_CHUNK = 1 << 20  # residuals worked on at a time


def own_inflation(
    episode: Episode,
    position_m: Float64[Array, "N H 2"],
    own_bias_m: Float64[Array, "N"],
    correlation_s: float,
) -> Float64[Array, "N"]:
    """Return how many times larger each anchor's error variance is than the whole log's.

    Of several places the one that explains the ranges best counts: what the others leave is their
    own misfit.

    Parameters
    ----------
    episode
        The measured ranges and what the log's calibration says of them; without a calibration
        there is nothing to compare with.
    position_m : (N, H, 2)
        Places of each anchor that are possible, in metres.
    own_bias_m : (N,)
        Each anchor's own range bias, in metres.
    correlation_s
        Errors further apart than this are independent, in seconds.

    Returns
    -------
    (N,)
        At least 1; 1 where nothing is known.
    """
    inflation = np.ones(episode.n_anchors)
    found = episode.calibration
    if found is None or found.sigma_m <= 0.0:
        return inflation
    lag = correlation_lag(episode, correlation_s) + 1
    known = found.sigma_m**2 * found.correlation
    size = max(1, _CHUNK // (episode.n_steps * position_m.shape[1]))
    for start in range(0, episode.n_anchors, size):
        part = slice(start, start + size)
        residual_m = _residuals(episode, part, position_m[part]) + own_bias_m[part, None, None]
        inflation[part] = np.fmax(_long_run(residual_m, lag).min(axis=1) / known, 1.0)
    return inflation


def _residuals(
    episode: Episode, part: slice, position_m: Float64[Array, "n H 2"]
) -> Float64[Array, "n H T"]:
    """Return predicted minus measured ranges; NaN where none was measured."""
    delta_m = position_m[:, :, None] - episode.position_m
    gap_m = np.zeros((len(position_m), 1, episode.n_steps))
    if episode.tag_up_m is not None and episode.anchor_up_m is not None:
        gap_m[:, 0] = np.nan_to_num(episode.tag_up_m - episode.anchor_up_m[part, None], nan=0.0)
    slant_m = np.sqrt((delta_m**2).sum(axis=-1) + gap_m**2)
    measured_m = np.where(episode.valid[:, part], episode.range_m[:, part], np.nan)
    return np.asarray(slant_m - measured_m.T[:, None])


def _long_run(residual_m: Float64[Array, "n H T"], lag: int) -> Float64[Array, "n H"]:
    """Return the long-run variance of clipped residuals; Bartlett's weights, by moving sums."""
    n = np.isfinite(residual_m).sum(axis=-1)
    usable = n >= 2
    safe_m = np.where(usable[..., None], residual_m, 0.0)
    centred_m = safe_m - np.nanmedian(safe_m, axis=-1, keepdims=True)
    sigma_m = 1.4826 * np.nanmedian(np.abs(centred_m), axis=-1, keepdims=True)
    bound_m = _CLIP_SIGMA * np.maximum(sigma_m, 1e-3)
    clipped_m = np.nan_to_num(np.clip(centred_m, -bound_m, bound_m))
    padding = [(0, 0)] * (residual_m.ndim - 1) + [(lag + 1, lag)]
    sums = np.cumsum(np.pad(clipped_m, padding), axis=-1)
    window = sums[..., lag:] - sums[..., :-lag]
    return np.asarray((window**2).sum(axis=-1) / (lag * np.maximum(n, 1)))


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
    count = episode.valid.sum(axis=0)[:, None]
    return np.asarray(episode.valid.T @ local_m / np.maximum(count, 1) + origin_m)


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
