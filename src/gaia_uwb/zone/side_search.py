"""The search for the sides on which all anchors of a zone stand together.

Every combination of sides has an evidence: the likelihoods of the places it chooses, times how well
they form a zone (``layout_prior.py``), times what is known from elsewhere. All combinations of a
few open anchors are searched; with more, the best is climbed to by single flips from several
starts.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from gaia_uwb._shared import Array, Bool, Float64, Int64
from gaia_uwb.zone.layout_prior import joint_places

_SWEEPS = 50
# Part of the anchors' errors is common to all of them (the trajectory's, the clock's); in the
# outdoor data set about half of the residuals' variance is. So combinations of sides, which add up
# the anchors' evidence, count half, and only the other half of an anchor's covariance bears on
# where it stands among the others: what is common moves the zone as a whole.
SHARED_ERRORS = 0.5


def all_combinations(n: int, open_sides: Int64[Array, "M"]) -> Int64[Array, "K N"]:
    """Return all combinations of sides of n anchors in which only some sides are open.

    Parameters
    ----------
    n
        Number of anchors.
    open_sides : (M,)
        Indices of those that may stand on either side.

    Examples
    --------
    >>> all_combinations(3, np.array([0, 2])).tolist()
    [[0, 0, 0], [1, 0, 0], [0, 0, 1], [1, 0, 1]]
    """
    count = 1 << len(open_sides)
    bits = (np.arange(count)[:, None] >> np.arange(len(open_sides))) & 1
    combinations = np.zeros((count, n), dtype=np.int64)
    combinations[:, open_sides] = bits
    return combinations


class Search:
    """Looks at combinations of sides and remembers the evidence of each.

    Parameters
    ----------
    place_m, covariance_m2 : (N, 2, 2), (N, 2, 2, 2)
        Both places of each anchor and their covariances.
    log_odds : (N,)
        How much better each anchor's first place fits, as a log likelihood.
    known
        Log evidence of combinations (K, N) from elsewhere, which is added; (K,).
    """

    def __init__(
        self,
        place_m: Float64[Array, "N 2 2"],
        covariance_m2: Float64[Array, "N 2 2 2"],
        log_odds: Float64[Array, "N"],
        known: Callable[[Int64[Array, "_ _"]], Float64[Array, "_"]] | None = None,
    ) -> None:
        self._known = known
        self._place_m, self._covariance_m2, self._log_odds = place_m, covariance_m2, log_odds
        self._seen: dict[bytes, float] = {}

    def look_at(self, combinations: Int64[Array, "K N"]) -> Float64[Array, "K"]:
        """Return the log evidence of each combination, summed over shapes and sizes."""
        new = [k for k, c in enumerate(combinations) if c.tobytes() not in self._seen]
        for start in range(0, len(new), 64):
            part = combinations[new[start : start + 64]]
            rows = np.arange(part.shape[1])
            joint = joint_places(
                self._place_m[rows, part], (1.0 - SHARED_ERRORS) * self._covariance_m2[rows, part]
            )
            top = joint.log_evidence.max(axis=1)
            total = top + np.log(np.exp(joint.log_evidence - top[:, None]).sum(axis=1))
            total -= (part * self._log_odds).sum(axis=1)
            if self._known is not None:
                total += self._known(part)
            self._seen.update(zip((c.tobytes() for c in part), total.tolist(), strict=True))
        return np.array([self._seen[c.tobytes()] for c in combinations])

    def climb(self, open_sides: Int64[Array, "M"]) -> None:
        """Climb by single flips from each anchor's own side, and from all on one side."""
        n = len(self._log_odds)
        starts = np.zeros((3, n), dtype=np.int64)
        left = _left_of_first(self._place_m)
        starts[1, open_sides] = np.where(left[open_sides], 0, 1)
        starts[2, open_sides] = np.where(left[open_sides], 1, 0)
        flips = np.zeros((len(open_sides), n), dtype=np.int64)
        flips[np.arange(len(open_sides)), open_sides] = 1
        for start in starts:
            current, value = start, float(self.look_at(start[None])[0])
            for _ in range(_SWEEPS):
                neighbours = current ^ flips
                values = self.look_at(neighbours)
                if values.max() <= value:
                    break
                current, value = neighbours[values.argmax()], float(values.max())
            mirrored = current.copy()
            mirrored[open_sides] ^= 1
            self.look_at(mirrored[None])

    def result(self) -> tuple[int, Float64[Array, "K"], Int64[Array, "K N"]]:
        """Return the best combination's index, and all evidences and combinations seen."""
        combinations = np.stack([np.frombuffer(c, dtype=np.int64) for c in self._seen])
        evidence = np.array(list(self._seen.values()))
        return int(evidence.argmax()), evidence, combinations

    def places(self, sides: Int64[Array, "N"]) -> tuple[Array, Array]:
        """Return places and covariances under one combination, averaged over shapes and sizes."""
        rows = np.arange(len(sides))
        common = SHARED_ERRORS * self._covariance_m2[rows, sides]
        own = self._covariance_m2[rows, sides] - common
        joint = joint_places(self._place_m[rows, sides][None], own[None])
        weight = np.exp(joint.log_evidence[0] - joint.log_evidence[0].max())
        weight /= weight.sum()
        mean = np.einsum("l,lni->ni", weight, joint.place_m[0])
        off = joint.place_m[0] - mean
        between = np.einsum("l,lni,lnj->nij", weight, off, off)
        within = np.einsum("l,lnij->nij", weight, joint.covariance_m2[0])
        return mean, within + between + common


def _left_of_first(place_m: Float64[Array, "N 2 2"]) -> Bool[Array, "N"]:
    """Return whether each anchor's first hypothesis stands left of the path, up to a global swap.

    The two places of an anchor lie across the path; which of them is left follows from any one
    direction across it, so anchors can be compared without the path.
    """
    across = place_m[:, 0] - place_m[:, 1]
    reference = across[int(np.argmax((across**2).sum(axis=1)))]
    return np.asarray(across @ reference > 0)
