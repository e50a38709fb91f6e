"""How the places that single drives give a cone scatter, in sums that a drive is added to.

The sum over K drives of the squared distances, in standard errors, from their own places to their
mean tells how much larger errors are than each drive thinks (``gaia_uwb.locate.fusion``). With
``p`` a place and ``L`` its inverse covariance it is ``sum p'Lp - (sum Lp)' (sum L)^-1 (sum Lp)``.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from gaia_uwb._shared import Array, Float64, Int64
from gaia_uwb.locate import Disagreement, Scatter


@dataclass(frozen=True)
class OwnPlaces:
    """Where one drive alone puts n cones.

    Parameters
    ----------
    anchor_ids
        The cones.
    place_m, covariance_m2 : (n, 2, 2), (n, 2, 2, 2)
        Given each side of the zone; NaN for those that it does not locate.
    """

    anchor_ids: tuple[str, ...]
    place_m: Float64[Array, "n 2 2"]
    covariance_m2: Float64[Array, "n 2 2 2"]


@dataclass(frozen=True)
class ScatterSums:
    """The scatter of the places of N cones, given each side.

    Parameters
    ----------
    anchor_ids
        The cones.
    reference_m : (N, 2, 2)
        From which places count.
    precision, pull, square, count : (N, 2, 2, 2), (N, 2, 2), (N, 2), (N,)
        The sums.
    """

    anchor_ids: tuple[str, ...]
    reference_m: Float64[Array, "N 2 2"]
    precision: Float64[Array, "N 2 2 2"]
    pull: Float64[Array, "N 2 2"]
    square: Float64[Array, "N 2"]
    count: Int64[Array, "N"]

    @classmethod
    def nothing(cls) -> ScatterSums:
        """Return the sums of no drives."""
        return cls(
            (),
            np.zeros((0, 2, 2)),
            np.zeros((0, 2, 2, 2)),
            np.zeros((0, 2, 2)),
            np.zeros((0, 2)),
            np.zeros(0, dtype=np.int64),
        )

    def plus(self, own: OwnPlaces) -> ScatterSums:
        """Return the sums with one more drive.

        Parameters
        ----------
        own
            Where it puts the cones.
        """
        known = np.asarray(np.isfinite(own.place_m).all(axis=(1, 2)))
        names = [name for name, there in zip(own.anchor_ids, known, strict=True) if there]
        place_m = own.place_m[known]
        new = [n for n, name in enumerate(names) if name not in set(self.anchor_ids)]
        ids = (*self.anchor_ids, *(names[n] for n in new))
        reference_m = np.concatenate([self.reference_m, place_m[new]])
        index = {name: n for n, name in enumerate(ids)}
        cone = np.array([index[name] for name in names], dtype=np.int64)
        precision = np.linalg.inv(own.covariance_m2[known])
        off_m = place_m - reference_m[cone]
        pull = np.einsum("nsij,nsj->nsi", precision, off_m)

        def added(before: Array, more: Array) -> Array:
            out = np.zeros((len(ids), *before.shape[1:]), dtype=before.dtype)
            out[: len(before)] = before
            out[cone] += more
            return out

        return ScatterSums(
            ids,
            reference_m,
            added(self.precision, precision),
            added(self.pull, pull),
            added(self.square, (off_m * pull).sum(axis=-1)),
            added(self.count, np.ones(len(cone), dtype=np.int64)),
        )

    def without(self, cones: Collection[str]) -> ScatterSums:
        """Return the sums of other cones.

        Parameters
        ----------
        cones
            Which to forget.
        """
        kept = np.array([name not in cones for name in self.anchor_ids], dtype=np.bool_)
        names = tuple(name for name in self.anchor_ids if name not in cones)
        arrays = (self.reference_m, self.precision, self.pull, self.square, self.count)
        return ScatterSums(names, *(each[kept] for each in arrays))

    def of(self, anchor_ids: Sequence[str], side: Int64[Array, "n"]) -> list[Scatter | None]:
        """Return the scatter of each cone; None where fewer than two drives located it.

        Parameters
        ----------
        anchor_ids
            The cones.
        side : (n,)
            On which side each stands.
        """
        mean = np.linalg.solve(self.precision, self.pull[..., None])[..., 0]
        misfit = np.maximum(self.square - (mean * self.pull).sum(axis=-1), 0.0)
        index = {name: n for n, name in enumerate(self.anchor_ids)}
        found: list[Scatter | None] = []
        for name, s in zip(anchor_ids, side.tolist(), strict=True):
            n = index.get(name, -1)
            if n < 0 or self.count[n] < 2:
                found.append(None)
                continue
            degrees = 2 * (int(self.count[n]) - 1)
            found.append(Scatter(float(misfit[n, s]), degrees, Disagreement(name, "", 0.0)))
        return found
