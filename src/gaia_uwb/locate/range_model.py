"""What single readings say of a zone near a guess: residuals, derivatives and robust weights.

White noise is Student-t with 4 degrees of freedom; among it are readings without line of sight,
which are too long.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import log

import numpy as np

from gaia_uwb._shared import Array, Float64
from gaia_uwb.locate.evidence import PARKED_MPS, Motion

N_DERIVATIVES = 10
"""By east and north, by cosine and sine of a cone's pattern, by the growth of the range bias, by
the clock offset, and by the four of the tag's pattern. All other derivatives are 1."""
_DOF = 4.0  # of the white noise's Student-t distribution
_PEAK = 0.375  # of its density
# Scales of what readings without line of sight are too long by, and how common they are; the
# second is for readings that are not of this cone at all.
_OUTLIERS = ((1.0, 0.9), (50.0, 0.1))
_TOO_SHORT = 0.1  # share of the outliers that are too short instead
_NEAREST_M = 0.5  # below this a range bias does not grow any more


@dataclass(frozen=True)
class Guess:
    """What is thought, by now, of all that some readings depend on.

    Parameters
    ----------
    own : (5, R)
        East, north, delay, and cosine and sine of the pattern of each reading's cone.
    bias_m, growth_m : (R,)
        Range bias at 10 m, the tag's included, and its growth.
    pattern_m : sequence of (R,)
        Of the tag.
    noise_m, outlier_share : (R,)
        White noise and share of outliers.
    slow_m, variance_m2 : (R,)
        Slow errors, and how uncertain these are.
    """

    own: Float64[Array, "5 R"]
    bias_m: Float64[Array, "R"]
    growth_m: Float64[Array, "R"]
    pattern_m: Sequence[Float64[Array, "R"]]
    noise_m: Float64[Array, "R"]
    outlier_share: Float64[Array, "R"]
    slow_m: Float64[Array, "R"]
    variance_m2: Float64[Array, "R"]


@dataclass(frozen=True)
class Linear:
    """What readings say near a guess.

    Parameters
    ----------
    derivatives : list of (R,)
        Of the range by what is unknown; see :data:`N_DERIVATIVES`.
    residual_m : (R,)
        Measured range less the guess's, slow errors not counted.
    information : (R,)
        Inverse variance of a reading, less where it is probably an outlier.
    loss : (R,)
        Negative log likelihood.
    outlier : (R,)
        Probability of being an outlier.
    square : (R,)
        Weighted squared residual, over the noise's variance.
    """

    derivatives: list[Float64[Array, "R"]]
    residual_m: Float64[Array, "R"]
    information: Float64[Array, "R"]
    loss: Float64[Array, "R"]
    outlier: Float64[Array, "R"]
    square: Float64[Array, "R"]


def linearise(motion: Motion, range_m: Float64[Array, "R"], guess: Guess) -> Linear:
    """Return what readings say near a guess.

    Parameters
    ----------
    motion
        Of the tag, at each reading.
    range_m : (R,)
        What was measured.
    guess
        Where to linearise.
    """
    velocity_mps = motion.velocity_mps
    place_m, delay_m, harmonic_m = guess.own[:2], guess.own[2], guess.own[3:]
    east_m = place_m[0] - motion.position_m[:, 0]
    north_m = place_m[1] - motion.position_m[:, 1]
    flat_m2 = east_m**2 + north_m**2
    flat_m = np.sqrt(flat_m2) + 1e-9
    distance_m = np.sqrt(flat_m2 + motion.gap_m**2) + 1e-9
    decades = np.log(np.maximum(distance_m, _NEAREST_M) / 10.0) / log(10.0)
    cosine, sine = east_m / flat_m, north_m / flat_m
    turned = _harmonics(velocity_mps, cosine, sine)
    towards = east_m / distance_m, north_m / distance_m
    closing_mps = towards[0] * velocity_mps[:, 0] + towards[1] * velocity_mps[:, 1]
    residual_m = range_m - distance_m - delay_m - guess.bias_m - guess.growth_m * decades
    residual_m -= harmonic_m[0] * cosine + harmonic_m[1] * sine
    for size_m, harmonic in zip(guess.pattern_m, turned, strict=True):
        residual_m -= size_m * harmonic
    left_m, noise_m2 = residual_m - guess.slow_m, guess.noise_m**2
    square = (left_m**2 + guess.variance_m2) / noise_m2
    inlier, loss = _mixture(left_m, guess.noise_m, guess.outlier_share)
    weight = inlier * ((_DOF + 1.0) / (_DOF + square))
    return Linear(
        derivatives=[*towards, cosine, sine, decades, closing_mps, *turned],
        residual_m=residual_m,
        information=weight / noise_m2,
        loss=loss,
        outlier=1.0 - inlier,
        square=weight * square,
    )


def _harmonics(
    velocity_mps: Float64[Array, "R 2"], cosine: Float64[Array, "R"], sine: Float64[Array, "R"]
) -> tuple[Float64[Array, "R"], ...]:
    """Return cosine and sine of the bearing from the course, and of twice that; 0 while parked."""
    speed_mps = np.sqrt(velocity_mps[:, 0] ** 2 + velocity_mps[:, 1] ** 2)
    moving = speed_mps > PARKED_MPS
    ahead, left = np.where(moving, velocity_mps.T / np.maximum(speed_mps, PARKED_MPS), 0.0)
    cos, sin = cosine * ahead + sine * left, sine * ahead - cosine * left
    return cos, sin, cos**2 - sin**2, 2.0 * cos * sin


def _mixture(
    left_m: Float64[Array, "R"], noise_m: Float64[Array, "R"], share: Float64[Array, "R"]
) -> tuple[Float64[Array, "R"], Float64[Array, "R"]]:
    """Return the probability of each residual's being no outlier, and its negative log density."""
    wide = 1.0 + (left_m / noise_m) ** 2 / _DOF
    inside = (1.0 - share) * _PEAK / (noise_m * wide**2 * np.sqrt(wide))  # to the power of 5/2
    size_m = np.abs(left_m)
    outside = np.zeros_like(left_m)
    for scale_m, part in _OUTLIERS:
        outside += part / scale_m * np.exp(size_m / -scale_m)
    outside *= share * np.where(left_m > 0.0, 1.0 - _TOO_SHORT, _TOO_SHORT)
    total = np.maximum(inside + outside, 1e-300)
    return inside / total, -np.log(total)
