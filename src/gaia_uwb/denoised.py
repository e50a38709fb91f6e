"""What a denoiser gives: cleaned ranges and, if it knows work zones, the places of all anchors.

The places are a mixture of two scene hypotheses, "left" and "right", given each of which the
anchors choose one of their two places independently. So that the sides of all anchors are open, but
not which of them stand together, is one statement and not many.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from gaia_uwb._shared import Array, Bool, Float64, InputError, check_finite, check_shape, freeze


@dataclass(frozen=True)
class ZonePosterior:
    """Places of N anchors, and the joint probability of their sides.

    Parameters
    ----------
    place_m : (N, 2, 2)
        Anchor, place (left of the path, right of it), (east, north) in metres.
    covariance_m2 : (N, 2, 2, 2)
        Covariance of each place, given that the anchor stands there.
    scene_probability : (2,)
        Of the two scene hypotheses; they add up to 1.
    left_probability : (2, N)
        Under each hypothesis, of each anchor's standing at its left place.
    located : (N,)
        False where an anchor has no range: its places mean nothing.

    Raises
    ------
    InputError
        If shapes disagree, a number is not finite, or a probability is none.
    """

    place_m: Float64[Array, "N 2 2"]
    covariance_m2: Float64[Array, "N 2 2 2"]
    scene_probability: Float64[Array, "2"]
    left_probability: Float64[Array, "2 N"]
    located: Bool[Array, "N"]

    def __post_init__(self) -> None:
        n = len(self.place_m)
        shapes = {
            "place_m": (n, 2, 2),
            "covariance_m2": (n, 2, 2, 2),
            "scene_probability": (2,),
            "left_probability": (2, n),
        }
        for name, shape in shapes.items():
            array = freeze(self, name, getattr(self, name), np.float64)
            check_shape(name, array, shape)
            check_finite(name, array)
        check_shape("located", freeze(self, "located", self.located, np.bool_), (n,))
        for name in ("scene_probability", "left_probability"):
            array = getattr(self, name)
            if array.size and not (array.min() >= 0.0 and array.max() <= 1.0):
                raise InputError(f"expected probabilities, got {array}", column=name)
        if abs(self.scene_probability.sum() - 1.0) > 1e-9:
            raise InputError(
                f"expected probabilities that add up to 1, got {self.scene_probability}",
                column="scene_probability",
            )


@dataclass(frozen=True)
class DenoisedRanges:
    """What a denoiser makes of an Episode: a range, its standard deviation and its validity.

    Parameters
    ----------
    range_m : (T, N)
        Denoised slant ranges, in metres; NaN where not valid.
    sigma_m : (T, N)
        Standard deviation of each range, in metres, above 0; NaN where not valid.
    valid : (T, N)
        True where the range may be used.
    zone
        Where the anchors stand, from a denoiser that says so.

    Raises
    ------
    InputError
        If shapes disagree, a valid range is not finite or its sigma not above 0, or a range that
        is not valid is not NaN.
    """

    range_m: Float64[Array, "T N"]
    sigma_m: Float64[Array, "T N"]
    valid: Bool[Array, "T N"]
    zone: ZonePosterior | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        range_m = freeze(self, "range_m", self.range_m, np.float64)
        sigma_m = freeze(self, "sigma_m", self.sigma_m, np.float64)
        valid = freeze(self, "valid", self.valid, np.bool_)
        check_shape("sigma_m", sigma_m, range_m.shape)
        check_shape("valid", valid, range_m.shape)
        if not (np.isfinite(range_m) & np.isfinite(sigma_m) & (sigma_m > 0))[valid].all():
            problem = "expected finite ranges and positive sigmas where valid"
            raise InputError(problem, column="range_m")
        if not (np.isnan(range_m) & np.isnan(sigma_m) | valid).all():
            raise InputError("expected NaN where not valid", column="range_m")
