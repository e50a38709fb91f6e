r"""Blocks of drives added up, and the estimates that the sum gives.

A cone stands on one of two sides. As in the estimator, each side is a cone of its own whose
information is weighed by the side's probability w: then one linear system gives the estimates on
both sides, and its solution is the estimator's step. Unknowns are, in this order, bias and growth
of the radios (2), what each tag of each vehicle keeps (6 each), and five of each cone and side.

Of each drive the part that it has by itself, ``phi_k``, is taken out first (Schur's complement)::

    P = sum of w square + own^-1,    information -= cross P^-1 cross',    pull -= cross P^-1 g

Readings err alike in ways that no model holds, so what they say of all that is shared counts half
(``ALIKE`` in ``zone_fit.py``), less what noise of the path seems to say of clocks. Where D is what
they say of it and Q its prior, ``inv(D / 2 + Q) = 2 inv(D + 2 Q)``. So there is a second sum, with
priors twice as sure, and the covariance of the cones is

    2 (inverse of that system) - (inverse of what is known of each cone, given what is shared).

Weights change what is taken out. Where they change much, sums are formed anew.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from gaia_uwb._shared import Array, Bool, Float64, Int64
from gaia_uwb.locate import DRIVE, OWN, RADIOS, DriveBlock, KeptSizes

_UNLIKELY = 1e-3
_LEAST_WEIGHT = 1e-6  # of a side, so that it has estimates all the same


@dataclass(frozen=True)
class ZoneSums:
    """What all drives past a zone say of its N cones.

    Parameters
    ----------
    anchor_ids, vehicles
        Of the cones, and of all tags of all vehicles.
    weight : (N, 2)
        The probability of each side that the sums were formed with.
    reference_m : (N, 2, 2)
        Places from which places count, for numbers of few digits.
    information, honest, pull : (V, V), (V, V), (V,)
        The linear systems, for estimates and for their covariance, without the priors of cones and
        of what stays from drive to drive; V = 2 + 6 G + 10 N.
    own_matrix, own_pull : (N, 2, 5, 5), (N, 2, 5)
        What is known of each cone on each side, given what is shared.
    loss : (N, 2)
        What the drives say against each side.
    n_ranges, n_readings, count, outliers, squares : (N,), (N,), (N,), (N, 2), (N, 2)
        Readings, and how they err: see :class:`gaia_uwb.locate.DriveBlock`.
    centre_m, n_steps : (N, 2), (N,)
        Middle of the stretches of path from which each cone was ranged, and what they count.
    sizes
        What the residuals say of the sizes of errors.
    n_drives
        How many drives.
    """

    anchor_ids: tuple[str, ...]
    vehicles: tuple[str, ...]
    weight: Float64[Array, "N 2"]
    reference_m: Float64[Array, "N 2 2"]
    information: Float64[Array, "V V"]
    honest: Float64[Array, "V V"]
    pull: Float64[Array, "V"]
    own_matrix: Float64[Array, "N 2 5 5"]
    own_pull: Float64[Array, "N 2 5"]
    loss: Float64[Array, "N 2"]
    n_ranges: Int64[Array, "N"]
    n_readings: Int64[Array, "N"]
    count: Float64[Array, "N"]
    outliers: Float64[Array, "N 2"]
    squares: Float64[Array, "N 2"]
    centre_m: Float64[Array, "N 2"]
    n_steps: Float64[Array, "N"]
    sizes: KeptSizes
    n_drives: int = 0

    @classmethod
    def nothing(cls) -> ZoneSums:
        """Return the sums of no drives."""
        return cls(
            anchor_ids=(),
            vehicles=(),
            weight=np.zeros((0, 2)),
            reference_m=np.zeros((0, 2, 2)),
            information=np.zeros((RADIOS, RADIOS)),
            honest=np.zeros((RADIOS, RADIOS)),
            pull=np.zeros(RADIOS),
            own_matrix=np.zeros((0, 2, OWN, OWN)),
            own_pull=np.zeros((0, 2, OWN)),
            loss=np.zeros((0, 2)),
            n_ranges=np.zeros(0, dtype=np.int64),
            n_readings=np.zeros(0, dtype=np.int64),
            count=np.zeros(0),
            outliers=np.zeros((0, 2)),
            squares=np.zeros((0, 2)),
            centre_m=np.zeros((0, 2)),
            n_steps=np.zeros(0),
            sizes=KeptSizes.none(),
        )

    @classmethod
    def of(
        cls,
        blocks: Sequence[DriveBlock],
        weight: Mapping[str, Float64[Array, "2"]],
        reference_m: Mapping[str, Float64[Array, "2 2"]],
        since: Mapping[str, int] | None = None,
    ) -> ZoneSums:
        """Add up blocks from the first to the last, with these weights of the sides.

        Parameters
        ----------
        blocks
            Of all drives, in the order of the zone.
        weight, reference_m
            By cone, as in the class; cones that have none get those of the first block they are in.
        since
            By cone, the number of the first block that says something of where it stands now.
        """
        sums = cls.nothing()
        for number, block in enumerate(blocks):
            elsewhere = {name for name, first in (since or {}).items() if number < first}
            sums = sums.plus(block.without(elsewhere), weight, reference_m)
        return sums

    def plus(
        self,
        block: DriveBlock,
        weight: Mapping[str, Float64[Array, "2"]] | None = None,
        reference_m: Mapping[str, Float64[Array, "2 2"]] | None = None,
    ) -> ZoneSums:
        """Return the sums with one more drive.

        Parameters
        ----------
        block
            What the drive says.
        weight, reference_m
            Of cones that are new; by default those of the block.
        """
        sums = self.aged(block.drift_m2).extended(block.anchor_ids, block.vehicles)
        cone = sums.rows(block.anchor_ids)
        sums = sums._placed(block, cone, weight or {}, reference_m or {})
        weights = np.maximum(sums.weight[cone], _LEAST_WEIGHT)
        at = _at(block, sums.reference_m[cone])
        index = sums._unknowns(cone, block.vehicles)
        information, honest = sums.information.copy(), sums.honest.copy()
        pull = sums.pull.copy()
        matrix, gradient = _without_own(block, weights, at, sure=1.0)
        information[np.ix_(index, index)] += matrix
        pull[index] += gradient
        honest[np.ix_(index, index)] += _without_own(block, weights, at, sure=2.0)[0]
        own = np.einsum("nsij,nsj->nsi", block.matrix, at)
        n_steps = sums.n_steps.copy()
        n_steps[cone] += block.n_steps
        centre_m = sums.centre_m.copy()
        share = block.n_steps / np.maximum(n_steps[cone], 1e-9)
        centre_m[cone] += share[:, None] * (block.centre_m - centre_m[cone])
        return replace(
            sums,
            information=information,
            honest=honest,
            pull=pull,
            own_matrix=_plus(sums.own_matrix, cone, block.matrix),
            own_pull=_plus(sums.own_pull, cone, own + block.gradient),
            loss=_plus(sums.loss, cone, block.loss),
            n_ranges=_plus(sums.n_ranges, cone, block.n_ranges),
            n_readings=_plus(sums.n_readings, cone, block.n_readings),
            count=_plus(sums.count, cone, block.count),
            outliers=_plus(sums.outliers, cone, block.outliers),
            squares=_plus(sums.squares, cone, block.squares),
            centre_m=centre_m,
            n_steps=n_steps,
            sizes=sums.sizes + block.sizes,
            n_drives=sums.n_drives + 1,
        )

    @property
    def unlikely(self) -> Bool[Array, "N 2"]:
        """Sides on which a cone hardly stands: their places stay where they are."""
        return np.asarray(self.weight < _UNLIKELY)

    def aged(self, drift_m2: float) -> ZoneSums:
        """Return what the drives say after the cones have crept at random.

        With L the information and Q the covariance of the creep, it is ``(L^-1 + Q)^-1``, and the
        estimates stay.

        Parameters
        ----------
        drift_m2
            Variance of the creep along each axis.
        """
        if not drift_m2 or not len(self.anchor_ids):
            return self
        n = len(self.anchor_ids)
        first = RADIOS + DRIVE * len(self.vehicles)
        places = first + (OWN * np.arange(2 * n)[:, None] + np.arange(2)).ravel()
        weights = np.repeat(np.maximum(self.weight, _LEAST_WEIGHT).ravel(), 2)
        information, kept = _softened(self.information, places, weights / drift_m2)
        honest, _ = _softened(self.honest, places, weights / drift_m2)
        own = np.zeros((n, 2, OWN, OWN))
        own_pull = np.zeros((n, 2, OWN))
        each = np.full(2, 1.0 / drift_m2)
        for k, side in np.ndindex(n, 2):
            own[k, side], own_kept = _softened(self.own_matrix[k, side], np.arange(2), each)
            own_pull[k, side] = own_kept @ self.own_pull[k, side]
        return replace(
            self,
            information=information,
            honest=honest,
            pull=kept @ self.pull,
            own_matrix=own,
            own_pull=own_pull,
        )

    def rows(self, anchor_ids: Sequence[str]) -> Int64[Array, "n"]:
        """Return the numbers of these cones.

        Parameters
        ----------
        anchor_ids
            Their ids.
        """
        index = {name: n for n, name in enumerate(self.anchor_ids)}
        return np.array([index[name] for name in anchor_ids], dtype=np.int64)

    def tags(self, vehicles: Sequence[str]) -> Int64[Array, "P"]:
        """Return which unknowns are those of these tags.

        Parameters
        ----------
        vehicles
            Of each tag.
        """
        number = np.array([self.vehicles.index(name) for name in vehicles], dtype=np.int64)
        return (RADIOS + DRIVE * number[:, None] + np.arange(DRIVE)).ravel()

    def _unknowns(self, cone: Int64[Array, "n"], vehicles: Sequence[str]) -> Int64[Array, "v"]:
        """Return which unknowns a block is about: radios, its tags, its cones."""
        first = RADIOS + DRIVE * len(self.vehicles)
        cones = (first + 2 * OWN * cone[:, None] + np.arange(2 * OWN)).ravel()
        return np.concatenate([np.arange(RADIOS), self.tags(vehicles), cones])

    def _placed(
        self,
        block: DriveBlock,
        cone: Int64[Array, "n"],
        weight: Mapping[str, Float64[Array, "2"]],
        reference_m: Mapping[str, Float64[Array, "2 2"]],
    ) -> ZoneSums:
        """Return the same sums with weights and references of cones that are new in a block."""
        weights, references_m = self.weight.copy(), self.reference_m.copy()
        located = np.isfinite(block.point.own).all(axis=(1, 2))
        for n in np.flatnonzero(located & (self.n_ranges[cone] == 0)):
            name = block.anchor_ids[n]
            weights[cone[n]] = weight.get(name, block.point.weight[n])
            references_m[cone[n]] = reference_m.get(name, block.point.own[n, :, :2])
        return replace(self, weight=weights, reference_m=references_m)

    def extended(self, anchor_ids: Sequence[str], vehicles: Sequence[str]) -> ZoneSums:
        """Return the same sums with room for more cones and tags.

        Parameters
        ----------
        anchor_ids, vehicles
            Of the cones and the tags; those that are there already do not matter.
        """
        vehicles = tuple(dict.fromkeys((*self.vehicles, *vehicles)))
        new = [name for name in anchor_ids if name not in set(self.anchor_ids)]
        if not new and vehicles == self.vehicles:
            return self
        first, now = (RADIOS + DRIVE * len(each) for each in (self.vehicles, vehicles))
        old = np.arange(len(self.pull))
        kept = np.where(old < first, old, old - first + now)
        size = now + 2 * OWN * (len(self.anchor_ids) + len(new))
        information, honest = np.zeros((2, size, size))
        information[np.ix_(kept, kept)], honest[np.ix_(kept, kept)] = self.information, self.honest
        pull = np.zeros(size)
        pull[kept] = self.pull
        longer: dict[str, Any] = {}
        for name in _BY_CONE:
            before = getattr(self, name)
            fill = 0.5 if name == "weight" else 0
            after = np.full((len(new), *before.shape[1:]), fill, before.dtype)
            longer[name] = np.concatenate([before, after])
        return replace(
            self,
            anchor_ids=(*self.anchor_ids, *new),
            vehicles=vehicles,
            information=information,
            honest=honest,
            pull=pull,
            **longer,
        )


_BY_CONE = tuple(
    field.name
    for field in fields(ZoneSums)
    if field.name
    not in ("anchor_ids", "vehicles", "information", "honest", "pull", "sizes", "n_drives")
)


def _softened(
    information: Float64[Array, "V V"],
    unknowns: Int64[Array, "q"],
    precision: Float64[Array, "q"],
) -> tuple[Float64[Array, "V V"], Float64[Array, "V V"]]:
    """Return information after a random change of some unknowns, and what is left of its pull."""
    inner = information[np.ix_(unknowns, unknowns)] + np.diag(precision)
    through = np.linalg.solve(inner, information[unknowns])
    left = information - information[:, unknowns] @ through
    kept = np.eye(len(information))
    kept[:, unknowns] -= through.T
    return 0.5 * (left + left.T), kept


def _plus(values: Array, cone: Int64[Array, "n"], more: Array) -> Array:
    """Return values of all cones, with those of some cones added."""
    out = values.copy()
    out[cone] += more
    return out


def _at(block: DriveBlock, reference_m: Float64[Array, "n 2 2"]) -> Float64[Array, "n 2 5"]:
    """Return where a block was taken, counted from the reference."""
    at = block.point.own.copy()
    at[..., :2] -= reference_m
    return np.nan_to_num(at)


@dataclass(frozen=True)
class _Arrow:
    """The linear system of one drive: what it is about, and what it has by itself."""

    matrix: Float64[Array, "v v"]
    cross: Float64[Array, "v P"]
    square: Float64[Array, "P P"]
    gradient: Float64[Array, "v"]
    pull: Float64[Array, "P"]

    @classmethod
    def of(cls, block: DriveBlock, weights: Float64[Array, "n 2"], sure: float) -> _Arrow:
        """Weigh a block's sides; priors are ``sure`` times as precise as they are."""
        n, own_size = len(block.anchor_ids), len(block.prior.mean)
        size = RADIOS + own_size + 2 * OWN * n
        square = np.einsum("ns,nsij->ij", weights, block.square)
        pull = np.einsum("ns,nsi->i", weights, block.pull)
        precise = sure * np.linalg.inv(block.prior.own)
        off = precise @ (block.point.shared[RADIOS:] - block.prior.mean)
        matrix, cross = np.zeros((size, size)), np.zeros((size, own_size))
        radios, tags = slice(RADIOS), slice(RADIOS, RADIOS + own_size)
        matrix[radios, radios], matrix[tags, tags] = square[radios, radios], precise
        cross[radios], cross[tags] = square[radios, RADIOS:], -precise
        own = square[RADIOS:, RADIOS:] + precise
        if sure > 1.0:
            own = _less_speed_noise(own, block.speed_noise, precise)
        scaled = (weights[..., None, None] * block.cross).reshape(2 * OWN * n, -1)
        cones = slice(RADIOS + own_size, size)
        matrix[cones, radios], cross[cones] = scaled[:, radios], scaled[:, RADIOS:]
        matrix[radios, cones] = matrix[cones, radios].T
        place = RADIOS + own_size + OWN * np.arange(2 * n)[:, None] + np.arange(OWN)
        blocks = (weights[..., None, None] * block.matrix).reshape(2 * n, OWN, OWN)
        matrix[place[:, :, None], place[:, None]] = blocks
        own_gradient = (weights[..., None] * block.gradient).ravel()
        gradient = np.concatenate([pull[radios], off, own_gradient])
        return cls(matrix, cross, own, gradient, pull[RADIOS:] - off)


def _without_own(
    block: DriveBlock, weights: Float64[Array, "n 2"], at: Float64[Array, "n 2 5"], sure: float
) -> tuple[Float64[Array, "v v"], Float64[Array, "v"]]:
    """Return the linear system of one drive, with what it has by itself taken out."""
    arrow = _Arrow.of(block, weights, sure)
    through = np.linalg.solve(arrow.square, arrow.cross.T)
    matrix = arrow.matrix - arrow.cross @ through
    nothing_kept = np.zeros(len(block.prior.mean))
    point = np.concatenate([block.point.shared[:RADIOS], nothing_kept, at.ravel()])
    pull = arrow.gradient - arrow.cross @ np.linalg.solve(arrow.square, arrow.pull)
    return matrix, pull + matrix @ point


def own_part(
    block: DriveBlock,
    weights: Float64[Array, "n 2"],
    moved: Float64[Array, "v"],
) -> Float64[Array, "P"]:
    """Return what a drive has by itself once the estimates have moved from its block's point.

    Parameters
    ----------
    block
        Of the drive.
    weights : (n, 2)
        Of the sides.
    moved : (v,)
        By how much radios, what its tags keep (counted from 0), and its cones have moved.
    """
    arrow = _Arrow.of(block, np.maximum(weights, _LEAST_WEIGHT), 1.0)
    step = np.linalg.solve(arrow.square, arrow.pull - arrow.cross.T @ moved)
    return np.asarray(block.point.shared[RADIOS:] + step)


def _less_speed_noise(
    square: Float64[Array, "P P"], speed_noise: Float64[Array, "T"], prior: Float64[Array, "P P"]
) -> Float64[Array, "P P"]:
    """Return what is known of a drive, less what noise of the path seems to say of its clocks.

    What is left must not be less than the prior in any direction.
    """
    told = square - prior
    clock = DRIVE * np.arange(len(speed_noise))
    told[clock, clock] -= speed_noise
    unit = np.sqrt(np.diagonal(np.linalg.inv(prior)))
    value, vector = np.linalg.eigh(unit[:, None] * told * unit)
    left = (vector * np.maximum(value, 0.0)) @ vector.T
    return np.asarray(left / unit[:, None] / unit + prior)
