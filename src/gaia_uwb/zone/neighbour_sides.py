"""On which sides of a path the cones of a zone stand, given that neighbours stand alike.

A work zone has no favourite side, and a zone in a mirror is as good a zone. So a layout cannot tell
on which side all cones stand: only their ranges can, which add up. What layouts do tell is that
neighbours along the path stand on one side more often than not, and that no two cones stand in one
place: two that the path passes at once stand on either side of it. As a model, the sides along the
path are a Markov chain. How often they change is unknown; three chains are tried and weighted by
how well they explain the ranges: a row on one side, rows that change sides, and sides that know
nothing of each other (two rows, with the path between them).

A chain needs no search: forward and backward sums give each cone's probability exactly.

Until November 2026 the places themselves were compared, as those of a cluster whose shape is
normally distributed. On a bend the straighter of a row and its mirror image
then seemed the likelier, with odds that grew with every cone, and a row beside it likelier than
two facing rows.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gaia_uwb._shared import Array, Float64, Int64
from gaia_uwb.locate import Hypotheses
from gaia_uwb.zone.path_sides import PathSides

_STAYS = np.array([0.995, 0.9, 0.5])  # probability that the next cone is on the same side
_SHARES = np.array([0.5, 0.2, 0.3])  # of zones for which that is so
_ROOM_M = 2.0  # no other cone of a row stands nearer than about that
_LEAST = 1e-3  # but where the two do stand so, it is not impossible


@dataclass(frozen=True)
class NeighbourSides:
    """Probabilities of combinations of sides of M cones.

    Parameters
    ----------
    order : (M,)
        The cones in the order in which the path passes them.
    log_own : (M, 2)
        In that order, log evidence of both places by each cone's ranges.
    log_pair : (C, M - 1, 2, 2)
        Log probability of two neighbours' places together, in each of C chains.
    log_share : (C,)
        Log probability of each chain before the ranges.
    """

    order: Int64[Array, "M"]
    log_own: Float64[Array, "M 2"]
    log_pair: Float64[Array, "C P 2 2"]
    log_share: Float64[Array, "C"]

    @classmethod
    def of(
        cls,
        hypotheses: Hypotheses,
        located: Int64[Array, "M"],
        path_m: Float64[Array, "T 2"],
    ) -> NeighbourSides:
        """Return what ranges and neighbours say.

        Parameters
        ----------
        hypotheses
            Both places of each anchor.
        located : (M,)
            Indices of the anchors; at least one.
        path_m : (T, 2)
            In the direction of travel, in metres.
        """
        path = PathSides(path_m)
        place_m, covariance_m2 = hypotheses.position_m[located], hypotheses.covariance_m2[located]
        order = path.order(place_m, np.zeros((1, len(located)), dtype=np.int64))[0]
        place_m, covariance_m2 = place_m[order], covariance_m2[order]
        left = path.left_probability(place_m, covariance_m2)
        one, other = left[:-1, :, None], left[1:, None, :]
        alike = one * other + (1.0 - one) * (1.0 - other)
        stays = _STAYS[:, None, None, None]
        together = np.log(stays * alike + (1.0 - stays) * (1.0 - alike))
        log_own = np.stack([np.zeros(len(located)), -hypotheses.log_odds[located]], axis=1)
        return cls(
            order, log_own[order], together + _log_room(place_m, covariance_m2), np.log(_SHARES)
        )

    def second(self) -> Float64[Array, "M"]:
        """Return each cone's probability of standing at its second place."""
        forward, backward = self._forward(), self._backward()
        log_both = forward + backward  # (C, M, 2)
        evidence = np.logaddexp.reduce(log_both[:, 0], axis=1) + self.log_share
        share = np.exp(evidence - np.logaddexp.reduce(evidence))
        log_sum = np.logaddexp.reduce(log_both, axis=2)
        out = np.empty(len(self.order))
        out[self.order] = share @ np.exp(log_both[..., 1] - log_sum)
        return out

    def log_weight(self, side: Int64[Array, "K M"]) -> Float64[Array, "K"]:
        """Return the log probability of combinations of sides.

        Parameters
        ----------
        side : (K, M)
            Which place each cone takes.
        """
        taken = side[:, self.order]
        own = self.log_own[np.arange(len(self.order)), taken].sum(axis=1)
        pair = np.arange(self.log_pair.shape[1])
        chain = self.log_pair[:, pair, taken[:, :-1], taken[:, 1:]].sum(axis=2)  # (C, K)
        together = np.logaddexp.reduce(chain + self.log_share[:, None], axis=0)
        return np.asarray(own + together - self._log_evidence())

    def drawn(self, count: int) -> Int64[Array, "K M"]:
        """Draw combinations, with a fixed seed."""
        rng = np.random.default_rng(0)
        forward = self._forward()
        evidence = np.logaddexp.reduce(forward[:, -1], axis=1) + self.log_share
        share = np.exp(evidence - np.logaddexp.reduce(evidence))
        chain = rng.choice(len(share), size=count, p=share)
        taken = np.zeros((count, len(self.order)), dtype=np.int64)
        log_next = np.zeros((count, 2))
        for k in range(len(self.order) - 1, -1, -1):
            if k + 1 < len(self.order):
                log_next = self.log_pair[chain, k, :, taken[:, k + 1]]
            log_place = forward[chain, k] + log_next
            second = np.exp(log_place[:, 1] - np.logaddexp.reduce(log_place, axis=1))
            taken[:, k] = rng.random(count) < second
        side = np.empty_like(taken)
        side[:, self.order] = taken
        return side

    def likeliest(self) -> Int64[Array, "C M"]:
        """Return the likeliest combination of each chain."""
        n_chains, n = len(self.log_share), len(self.order)
        best = np.repeat(self.log_own[None, 0], n_chains, axis=0)  # (C, 2)
        came = np.zeros((n_chains, n, 2), dtype=np.int64)
        for k in range(1, n):
            through = best[:, :, None] + self.log_pair[:, k - 1]
            came[:, k] = through.argmax(axis=1)
            best = through.max(axis=1) + self.log_own[k]
        side = np.empty((n_chains, n), dtype=np.int64)
        taken = best.argmax(axis=1)
        for k in range(n - 1, -1, -1):
            side[:, self.order[k]] = taken
            taken = came[np.arange(n_chains), k, taken]
        return side

    def _forward(self) -> Float64[Array, "C M 2"]:
        """Return the log evidence of each cone's places by it and by all cones before it."""
        out = np.empty((len(self.log_share), *self.log_own.shape))
        out[:, 0] = self.log_own[0]
        for k in range(1, len(self.order)):
            through = out[:, k - 1, :, None] + self.log_pair[:, k - 1]
            out[:, k] = np.logaddexp.reduce(through, axis=1) + self.log_own[k]
        return out

    def _backward(self) -> Float64[Array, "C M 2"]:
        """Return the log evidence of each cone's places by all cones after it."""
        out = np.zeros((len(self.log_share), *self.log_own.shape))
        for k in range(len(self.order) - 2, -1, -1):
            after = out[:, k + 1] + self.log_own[k + 1]
            out[:, k] = np.logaddexp.reduce(self.log_pair[:, k] + after[:, None], axis=2)
        return out

    def _log_evidence(self) -> float:
        last = np.logaddexp.reduce(self._forward()[:, -1], axis=1)
        return float(np.logaddexp.reduce(last + self.log_share))


def _log_room(
    place_m: Float64[Array, "M 2 2"], covariance_m2: Float64[Array, "M 2 2 2"]
) -> Float64[Array, "P 2 2"]:
    """Return how likely it is that neighbours stand as near to each other as their places are.

    That is ``1 - exp(-d^2 / (2 room^2))``, averaged over what the places' distance may be.
    """
    apart = place_m[1:, None, :] - place_m[:-1, :, None]
    spread_m2 = covariance_m2[1:, None, :] + covariance_m2[:-1, :, None] + _ROOM_M**2 * np.eye(2)
    solved = np.linalg.solve(spread_m2, apart[..., None])[..., 0]
    height = _ROOM_M**2 / np.sqrt(np.linalg.det(spread_m2))
    crowded = height * np.exp(-0.5 * (apart * solved).sum(axis=-1))
    return np.asarray(np.log1p(-np.minimum(crowded, 1.0 - _LEAST)))
