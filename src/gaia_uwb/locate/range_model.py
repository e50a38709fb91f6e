"""What single readings say of a zone near a guess: residuals, derivatives and robust weights.

The noise is Student-t; which readings had no line of sight is told by ``line_of_sight.py``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import log

import numpy as np

from gaia_uwb._shared import Array, Float64
from gaia_uwb.locate.evidence import PARKED_MPS, Motion
from gaia_uwb.locate.line_of_sight import DEGREES, SightChains

N_DERIVATIVES = 10
"""By east and north, by cosine and sine of a cone's pattern, by the growth of the range bias, by
the clock offset, and by the four of the tag's pattern. All other derivatives are 1."""
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
    noise_m, alike : (R,)
        Noise, and the correlation of that of readings 0.1 s apart.
    hidden_share : (R,)
        Share of readings without line of sight.
    slow_m, variance_m2 : (R,)
        Slow errors, and how uncertain these are.
    """

    own: Float64[Array, "5 R"]
    bias_m: Float64[Array, "R"]
    growth_m: Float64[Array, "R"]
    pattern_m: Sequence[Float64[Array, "R"]]
    noise_m: Float64[Array, "R"]
    alike: Float64[Array, "R"]
    hidden_share: Float64[Array, "R"]
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
    flat_m : (R,)
        Horizontal distance from the tag to the guess.
    information : (R,)
        Inverse variance of what a reading adds, less where it probably had no line of sight.
    loss : (R,)
        Negative log likelihood.
    hidden : (R,)
        Probability of no line of sight.
    square : (R,)
        Weighted squared residual, over the noise's variance.
    products, squares : (R,)
        Of neighbouring readings, over the noise's variance; see ``line_of_sight.Sight``.
    """

    derivatives: list[Float64[Array, "R"]]
    residual_m: Float64[Array, "R"]
    flat_m: Float64[Array, "R"]
    information: Float64[Array, "R"]
    loss: Float64[Array, "R"]
    hidden: Float64[Array, "R"]
    square: Float64[Array, "R"]
    products: Float64[Array, "R"]
    squares: Float64[Array, "R"]


def linearise(
    motion: Motion, range_m: Float64[Array, "R"], chains: SightChains, guess: Guess
) -> Linear:
    """Return what readings say near a guess.

    Parameters
    ----------
    motion
        Of the tag, at each reading.
    range_m : (R,)
        What was measured.
    chains
        Which readings follow each other.
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
    wide_m = np.sqrt(noise_m2 + guess.variance_m2)  # else what is not known yet seems hidden
    sight = chains.solve(left_m, wide_m, guess.hidden_share, guess.alike)
    weight = sight.visible * ((DEGREES + 1.0) / (DEGREES + square))
    return Linear(
        derivatives=[*towards, cosine, sine, decades, closing_mps, *turned],
        residual_m=residual_m,
        flat_m=flat_m,
        information=weight * sight.information / noise_m2,
        loss=sight.loss,
        hidden=1.0 - sight.visible,
        square=weight * square,
        products=sight.products,
        squares=sight.squares,
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
