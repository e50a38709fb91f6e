"""How large the errors of a zone's ranges are: estimated from residuals, drawn to what radios have.

It is restricted maximum likelihood: residuals are counted less what was fitted to them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gaia_uwb._shared import Array, Float64, Int64
from gaia_uwb.episode import ErrorSizes
from gaia_uwb.locate.slow_errors import SCALES_M

LEAST_NOISE_M, _MOST_NOISE_M = 0.003, 3.0
"""Least and largest white noise."""
_MOST_ALIKE, _PAIRS_WORTH = 0.95, 20.0  # correlation of the noise; pairs for none
_OUTLIERS = (0.002, 0.4)  # least and largest share of outliers
# What radios have: sizes in metres, and for how many degrees of freedom that counts.
_FIELD_M, _FIELD_WORTH = 0.015, 3.0
_DELAY_M, _DELAY_WORTH = 0.03, 4.0
_PATTERN_M, _PATTERN_WORTH = 0.03, 16.0

RADIO_SIZES = ErrorSizes(
    noise_m=0.1,
    alike=0.0,
    outlier_share=0.05,
    field_m=np.full(len(SCALES_M), _FIELD_M),
    delay_m=_DELAY_M,
    pattern_m=_PATTERN_M,
)
"""Errors of a radio that nothing is known of."""


@dataclass(frozen=True)
class SizeSums:
    """What residuals say of the sizes of errors, in numbers that add up over drives; by zone.

    Parameters
    ----------
    count, inliers, outliers : (...)
        Readings, and how many of them are none and are outliers.
    squares_m2 : (...)
        Sum of the squared residuals of those that are none.
    products, pair_squares : (...)
        Of neighbouring residuals, over the noise's variance.
    freedom, field_m2 : (..., L)
        Independent slow errors of each length, and the sum of their squares.
    """

    count: Float64[Array, "*zones"]
    inliers: Float64[Array, "*zones"]
    outliers: Float64[Array, "*zones"]
    squares_m2: Float64[Array, "*zones"]
    products: Float64[Array, "*zones"]
    pair_squares: Float64[Array, "*zones"]
    freedom: Float64[Array, "*zones L"]
    field_m2: Float64[Array, "*zones L"]

    @classmethod
    def none(cls) -> SizeSums:
        """Return what no residuals say."""
        return cls(*(np.zeros(()) for _ in range(6)), *np.zeros((2, len(SCALES_M))))

    def __add__(self, other: SizeSums) -> SizeSums:
        pairs = zip(vars(self).values(), vars(other).values(), strict=True)
        return SizeSums(*(np.asarray(mine + theirs) for mine, theirs in pairs))


@dataclass(frozen=True)
class KeptSizes:
    """What earlier drives say of the sizes of errors, when these may have become smaller since.

    What residuals show of slow errors is reckoned with their sizes. Where these were thought to be
    larger than they are, residuals show, per squared size, about what they show now.

    Parameters
    ----------
    told
        With the sizes of the time.
    freedom_per_m2, field_per_m2 : (L,)
        Its last two numbers over the squared size, and the last one over that again.
    """

    told: SizeSums
    freedom_per_m2: Float64[Array, "L"]
    field_per_m2: Float64[Array, "L"]

    @classmethod
    def none(cls) -> KeptSizes:
        """Return what no drives say."""
        return cls(SizeSums.none(), *np.zeros((2, len(SCALES_M))))

    @classmethod
    def of(cls, told: SizeSums, field_m: Float64[Array, "L"]) -> KeptSizes:
        """Return what the residuals of one drive say.

        Parameters
        ----------
        told
            With these sizes.
        field_m : (L,)
            Of the slow errors, in metres.
        """
        return cls(told, told.freedom / field_m**2, told.field_m2 / field_m**4)

    def __add__(self, other: KeptSizes) -> KeptSizes:
        return KeptSizes(
            self.told + other.told,
            self.freedom_per_m2 + other.freedom_per_m2,
            self.field_per_m2 + other.field_per_m2,
        )

    def now(self, field_m: Float64[Array, "L"]) -> SizeSums:
        """Return what the drives say if slow errors are as small as that.

        Parameters
        ----------
        field_m : (L,)
            In metres; where they are larger than they were thought to be, nothing changes.
        """
        then_m2 = self.told.freedom / np.maximum(self.freedom_per_m2, 1e-300)
        size_m2 = np.minimum(field_m**2, then_m2)
        return replace(
            self.told,
            freedom=self.freedom_per_m2 * size_m2,
            field_m2=self.field_per_m2 * size_m2**2,
        )


def sizes_of_errors(
    told: SizeSums, least_noise_m: Float64[Array, "*zones"]
) -> dict[str, Float64[Array, "*zones *rest"]]:
    """Return the sizes of the errors that drives have, drawn towards what radios have.

    Parameters
    ----------
    told
        What residuals say.
    least_noise_m : (...)
        Least white noise, in metres.
    """
    noise2 = told.squares_m2 / np.maximum(told.inliers, 1e-9)
    alike = told.products / (told.pair_squares + _PAIRS_WORTH)
    share = told.outliers / np.maximum(told.count, 1.0)
    field2 = (told.field_m2 + _FIELD_WORTH * _FIELD_M**2) / (told.freedom + _FIELD_WORTH)
    found = {
        "noise_m": np.clip(
            np.sqrt(noise2), np.maximum(least_noise_m, LEAST_NOISE_M), _MOST_NOISE_M
        ),
        "alike": np.clip(alike, 0.0, _MOST_ALIKE),
        "outlier_share": np.clip(share, *_OUTLIERS),
        "field_m": np.sqrt(field2),
    }
    return {name: np.asarray(values) for name, values in found.items()}


def sizes_of_cones(
    delay_m2: Float64[Array, "*zones"],
    pattern_m2: Float64[Array, "*zones"],
    n_cones: Int64[Array, "*zones"],
) -> dict[str, Float64[Array, "*zones"]]:
    """Return the sizes of the errors that cones have, drawn towards what radios have.

    Parameters
    ----------
    delay_m2, pattern_m2 : (...)
        Sums of the cones' mean squared delays, and of both parts of their patterns.
    n_cones : (...)
        How many cones.
    """
    delay2 = delay_m2 + _DELAY_WORTH * _DELAY_M**2
    pattern2 = pattern_m2 + _PATTERN_WORTH * _PATTERN_M**2
    return {
        "delay_m": np.asarray(np.sqrt(delay2 / (n_cones + _DELAY_WORTH))),
        "pattern_m": np.asarray(np.sqrt(pattern2 / (2 * n_cones + _PATTERN_WORTH))),
    }
