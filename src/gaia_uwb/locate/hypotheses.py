"""Both places of every anchor: what locating hands to the decision on sides."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gaia_uwb._shared import Array, Bool, Float64, Int64
from gaia_uwb.locate.honest_errors import Curves


@dataclass(frozen=True)
class Hypotheses:
    """Both places of each anchor of one zone, the better-fitting first.

    Parameters
    ----------
    position_m : (N, 2, 2)
        Anchor, hypothesis, (east, north); NaN where an anchor has too few ranges.
    covariance_m2 : (N, 2, 2, 2)
        Covariance of each place.
    log_odds : (N,)
        How much better the first fits, as a difference of log evidences; at least 0.
    own_bias_m : (N,)
        Range bias of each anchor in addition to the one that all share (measured minus true).
    n_ranges : (N,)
        Usable ranges.
    converged : (N,)
        Whether the search for the places did.
    fits : (N,)
        Whether the ranges err like those of working radios, if the anchor stands there.
    shared_m : (N, 2, 2, S), optional
        The part of the errors that is one and the same for all anchors: by how much each place
        moves with one standard deviation of each of S independent things (clock offsets, range
        bias, patterns of tags). ``shared_m @ shared_m^T`` is in ``covariance_m2``.
    centre_m : (N, 2), optional
        The middle of the stretch of path from which each anchor was ranged.
    """

    position_m: Float64[Array, "N 2 2"]
    covariance_m2: Float64[Array, "N 2 2 2"]
    log_odds: Float64[Array, "N"]
    own_bias_m: Float64[Array, "N"]
    n_ranges: Int64[Array, "N"]
    converged: Bool[Array, "N"]
    fits: Bool[Array, "N"]
    shared_m: Float64[Array, "N 2 2 S"] | None = None
    centre_m: Float64[Array, "N 2"] | None = None

    def better_first(self) -> Hypotheses:
        """Return the same with the better-fitting place first, where ``log_odds`` is below 0."""
        order = np.where((self.log_odds < 0.0)[:, None], [1, 0], [0, 1])
        rows = np.arange(len(order))[:, None]
        return replace(
            self,
            position_m=self.position_m[rows, order],
            covariance_m2=self.covariance_m2[rows, order],
            log_odds=np.abs(self.log_odds),
            shared_m=None if self.shared_m is None else self.shared_m[rows, order],
        )

    def honest_covariance(
        self, covariance_m2: Float64[Array, "N 2 2"], side: Int64[Array, "N"]
    ) -> Float64[Array, "N 2 2"]:
        """Return what is reported of places with linear covariances (``honest_errors.py``).

        Parameters
        ----------
        covariance_m2 : (N, 2, 2)
            Linear covariances of the places on these sides.
        side : (N,)
            Which place of each anchor.
        """
        if self.centre_m is None:
            return covariance_m2
        rows = np.arange(len(side))
        place_m, mirror_m = self.position_m[rows, side], self.position_m[rows, 1 - side]
        own_m2 = self.covariance_m2[rows, side]
        return Curves.of(place_m, mirror_m, own_m2, self.centre_m).covariance_m2(covariance_m2)
