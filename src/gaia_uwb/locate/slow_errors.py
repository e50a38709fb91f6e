"""The slow errors of each cone in each drive, and what its readings say once they are averaged out.

Slow errors are a Gaussian random field over the places of the tag. A block (one cone in one drive)
has up to 64 cells, each with the robust mean of its readings; their errors have the covariance
``V = sum of size_l^2 exp(-distance / l) + noise``, with correlation lengths l from 1 to 64 m, each
with a size that the log tells. So errors that belong to a place do not average out, however long
the vehicle stays there.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from gaia_uwb._shared import Array, Bool, Float64, Int64
from gaia_uwb.locate._covariances import invert
from gaia_uwb.locate.evidence import Evidence, Motion
from gaia_uwb.locate.range_model import Guess, RangeModel

OWN = 5
"""Unknowns of a cone: east, north, delay, and the cosine and sine of its pattern."""
RADIOS = 2
"""Unknowns of the radios: range bias at 10 m, and its growth."""
DRIVE = 6
"""Unknowns of a drive: clock offset, bias of its tag, and four of its tag's pattern."""
_COLUMNS = OWN + RADIOS + DRIVE
SCALES_M = (1.0, 4.0, 16.0, 64.0)
"""Correlation lengths of the slow errors."""
_GROUP = 128  # blocks worked on together


@dataclass
class Sums:
    """What all readings say, added up: normal equations, losses and the sizes of residuals.

    Parameters
    ----------
    matrix, gradient, cross : (N, 2, 5, 5), (N, 2, 5), (N, 2, 5, S)
        Of each cone's own unknowns, for both sides; the last with what is shared.
    shared, shared_gradient : (N, 2, S, S), (N, 2, S)
        Of what is shared.
    loss : (N, 2)
        Negative log likelihood.
    count, outliers, squares : (N, 2)
        Readings; how many of them are outliers; the others' squared residuals over the noise's.
    pairs : (N, 2, 2)
        Products, and squares, of neighbouring residuals.
    freedom, spent : (N, 2, L), (N, 2, L, 5, 5)
        How many independent slow errors the readings show, and what the cone's own unknowns take
        of them.
    """

    matrix: Float64[Array, "N 2 5 5"]
    gradient: Float64[Array, "N 2 5"]
    cross: Float64[Array, "N 2 5 S"]
    shared: Float64[Array, "N 2 S S"]
    shared_gradient: Float64[Array, "N 2 S"]
    loss: Float64[Array, "N 2"]
    count: Float64[Array, "N 2"]
    outliers: Float64[Array, "N 2"]
    squares: Float64[Array, "N 2"]
    pairs: Float64[Array, "N 2 2"]
    freedom: Float64[Array, "N 2 L"]
    spent: Float64[Array, "N 2 L 5 5"]

    @classmethod
    def zeros(cls, n_cones: int, n_shared: int) -> Sums:
        """Return sums of nothing."""
        n, s = n_cones, n_shared
        return cls(
            matrix=np.zeros((n, 2, OWN, OWN)),
            gradient=np.zeros((n, 2, OWN)),
            cross=np.zeros((n, 2, OWN, s)),
            shared=np.zeros((n, 2, s, s)),
            shared_gradient=np.zeros((n, 2, s)),
            loss=np.zeros((n, 2)),
            count=np.zeros((n, 2)),
            outliers=np.zeros((n, 2)),
            squares=np.zeros((n, 2)),
            pairs=np.zeros((n, 2, 2)),
            freedom=np.zeros((n, 2, len(SCALES_M))),
            spent=np.zeros((n, 2, len(SCALES_M), OWN, OWN)),
        )


@dataclass
class _Group:
    """Blocks of about the same number of cells, padded to the largest of them."""

    block: Int64[Array, "b"]
    cell: Int64[Array, "b M"]
    there: Bool[Array, "b M"]
    kernel: Float64[Array, "b L M M"]


@dataclass(frozen=True)
class _Solved:
    """What one step needs to know of the blocks of a group once the step's length is known."""

    group: _Group
    column: Int64[Array, "b 8"]
    mean: Float64[Array, "2 b M 14"]
    solved: Float64[Array, "2 b M 14"]
    noise_m2: Float64[Array, "2 b M"]
    left_m2: Float64[Array, "2 b M"]
    field2: Float64[Array, "b L"]
    inverse: Float64[Array, "2 b M M"]


class SlowErrors:
    """The slow errors of a group of cones, as far as they are known by now.

    Parameters
    ----------
    evidence
        The cones' readings in cells.
    offset_s : (D,)
        Clock offsets under which the cells' places are taken.
    """

    def __init__(self, evidence: Evidence, offset_s: Float64[Array, "D"]) -> None:
        self.evidence = evidence
        n_cells = len(evidence.cell_block)
        self._n_readings = np.bincount(evidence.cone, minlength=len(evidence.cones))
        self._model = RangeModel(evidence)
        position_m = evidence.motion(offset_s).position_m
        count = np.bincount(evidence.cell, minlength=n_cells)
        self._middle_m = np.stack(
            [np.bincount(evidence.cell, x, minlength=n_cells) / count for x in position_m.T], axis=1
        )
        self._groups = list(self._grouped())
        self.forget()

    def _grouped(self) -> Iterator[_Group]:
        """Yield groups of blocks with their kernels."""
        evidence = self.evidence
        cells = np.bincount(evidence.cell_block, minlength=len(evidence.block_cone))
        first = np.cumsum(cells) - cells
        order = np.argsort(cells, kind="stable")
        for start in range(0, len(order), _GROUP):
            block = order[start : start + _GROUP]
            slot = np.arange(max(int(cells[block].max()), 1))
            there = slot < cells[block, None]
            cell = np.where(there, first[block, None] + slot, 0)
            place_m = self._middle_m[cell]
            apart_m = np.hypot(*np.moveaxis(place_m[:, :, None] - place_m[:, None], -1, 0))
            kernel = np.exp(-apart_m[:, None] / np.array(SCALES_M)[:, None, None])
            both = there[:, None, :, None] & there[:, None, None]
            yield _Group(block, cell, there, np.where(both, kernel, 0.0))

    def forget(self) -> None:
        """Start with no slow errors."""
        n_cells, n_blocks = len(self.evidence.cell_block), len(self.evidence.block_cone)
        self._slow_m = np.zeros((2, n_cells))
        self._variance_m2 = np.zeros((2, n_cells))
        self._cost = np.zeros((2, n_blocks))
        self._solved: list[_Solved] = []
        self._pulls: list[Float64[Array, "2 b M"]] = []

    def state(self) -> tuple[Array, ...]:
        """Return the slow errors as they are by now."""
        return self._slow_m.copy(), self._variance_m2.copy(), self._cost.copy()

    def restart(self, state: tuple[Array, ...], cones: Bool[Array, "N"]) -> None:
        """Put the slow errors of some cones back to what they were.

        Parameters
        ----------
        state
            What they were.
        cones : (N,)
            Which of all cones.
        """
        blocks = cones[self.evidence.cones[self.evidence.block_cone]]
        cells = blocks[self.evidence.cell_block]
        now = (self._slow_m, self._variance_m2, self._cost)
        for values, before, own in zip(now, state, (cells, cells, blocks), strict=True):
            values[:, own] = before[:, own]

    def linearise(
        self,
        own: Float64[Array, "n 2 5"],
        shared: Float64[Array, "n S"],
        offset_s: Float64[Array, "D"],
        drive_slot: Int64[Array, "D"],
        noise_m: Float64[Array, "n"],
        alike: Float64[Array, "n"],
        hidden_share: Float64[Array, "n"],
    ) -> None:
        """Average the readings of every cell, robustly, and their derivatives.

        Parameters
        ----------
        own : (n, 2, 5)
            Unknowns of the cones on both sides.
        shared : (n, S)
            What is shared in each cone's zone.
        offset_s, drive_slot : (D,)
            Clock offset of each drive, and its number in its zone.
        noise_m, alike, hidden_share : (n,)
            Noise, its correlation, and the share of readings without line of sight, in each cone's
            zone.
        """
        evidence, motion = self.evidence, self.evidence.motion(offset_s)
        cone = evidence.block_cone
        slot = RADIOS + DRIVE * drive_slot[evidence.block_drive]
        bias_m, growth_m = shared[cone, 0] + shared[cone, slot + 1], shared[cone, 1]
        pattern_m = shared[cone[:, None], slot[:, None] + np.arange(2, DRIVE)]
        sizes = [x[cone] for x in (noise_m, alike, hidden_share)]
        guess = Guess(
            own=np.swapaxes(own[cone], 0, 1),
            errors=np.column_stack([bias_m, growth_m, *sizes, pattern_m]),
            slow_m=self._slow_m,
            variance_m2=self._variance_m2,
        )
        self._found = self._model.average(motion, guess)
        self._look_across(motion, self._found.nearest)

    def _look_across(self, motion: Motion, nearest: Int64[Array, "2 n"]) -> None:
        """Keep where the tag came nearest to each place, and what is across the path there."""
        known = nearest.T >= 0
        rows = nearest.T[known]
        there = Motion(motion.position_m[rows], motion.velocity_mps[rows], motion.gap_m[rows])
        self.nearest_m, self.across = np.zeros((2, *known.shape, 2))
        self.nearest_m[known], self.across[known] = there.position_m, there.across()

    def add_to(
        self, sums: Sums, field_m: Float64[Array, "n L"], drive_slot: Int64[Array, "D"]
    ) -> None:
        """Add what the cells say, once their slow errors are averaged out.

        Parameters
        ----------
        sums
            Where to add it.
        field_m : (n, L)
            Size of the slow errors of each length in each cone's zone.
        drive_slot : (D,)
            Number of each drive in its zone.
        """
        evidence, found = self.evidence, self._found
        cones = evidence.cones
        self._solved = []
        sums.loss[cones] += found.loss.T
        sums.count[cones] += self._n_readings[:, None]
        sums.outliers[cones] += found.hidden.T
        sums.squares[cones] += found.square.T
        sums.pairs[cones] += np.swapaxes(found.pairs, 0, 1)
        for group in self._groups:
            local = evidence.block_cone[group.block]
            cone = cones[local]
            field2 = field_m[local] ** 2
            slot = RADIOS + DRIVE * drive_slot[evidence.block_drive[group.block]]
            column = np.concatenate(
                [np.tile(np.arange(RADIOS), (len(slot), 1)), slot[:, None] + np.arange(DRIVE)],
                axis=1,
            )
            noise = np.where(group.there, 1.0 / found.information[:, group.cell], 1.0)
            mean = found.mean[:, group.cell] * group.there[..., None]
            slow = np.einsum("bl,blij->bij", field2, group.kernel)
            inverse, log_det = _inverse(slow, noise)
            solved = inverse @ mean
            matrix = np.swapaxes(mean, -1, -2) @ solved  # (2, b, 14, 14)
            spread = noise - noise**2 * np.diagonal(inverse, axis1=-2, axis2=-1)
            self._solved.append(
                _Solved(group, column, mean, solved, noise, spread, field2, inverse)
            )
            log_det -= np.log(noise).sum(axis=-1)
            own, rest = slice(OWN), slice(OWN, _COLUMNS)
            for side in (0, 1):
                one = matrix[side]
                at = (cone, np.full(len(cone), side))
                np.add.at(sums.loss, at, 0.5 * log_det[side] + self._cost[side, group.block])
                np.add.at(sums.matrix, at, one[:, own, own])
                np.add.at(sums.gradient, at, one[:, own, -1])
                rows = np.arange(OWN)[None, :, None]
                np.add.at(
                    sums.cross,
                    (cone[:, None, None], at[1][:, None, None], rows, column[:, None]),
                    one[:, own, rest],
                )
                across = (cone[:, None, None], at[1][:, None, None])
                np.add.at(
                    sums.shared, (*across, column[:, :, None], column[:, None]), one[:, rest, rest]
                )
                np.add.at(
                    sums.shared_gradient, (cone[:, None], at[1][:, None], column), one[:, rest, -1]
                )

    def follow(self, own_change: Float64[Array, "n 2 5"], change: Float64[Array, "n S"]) -> None:
        """Estimate the slow errors that are left after a step.

        Parameters
        ----------
        own_change, change : (n, 2, 5), (n, S)
            The step in each cone's own unknowns, and in what its zone shares.
        """
        self._pulls = []
        for each in self._solved:
            local, block = self.evidence.block_cone[each.group.block], each.group.block
            rest = np.take_along_axis(change[local], each.column, axis=1)
            step = np.empty((2, len(block), _COLUMNS, 1))
            step[..., :OWN, 0] = np.swapaxes(own_change[local], 0, 1)
            step[..., OWN:, 0] = rest
            pull = each.solved[..., -1] - (each.solved[..., :-1] @ step)[..., 0]  # (2, b, M)
            left_m = each.mean[..., -1] - (each.mean[..., :-1] @ step)[..., 0]
            slow_m = left_m - each.noise_m2 * pull
            cells = each.group.cell[each.group.there]
            self._slow_m[:, cells] = slow_m[:, each.group.there]
            self._variance_m2[:, cells] = each.left_m2[:, each.group.there]
            self._cost[:, block] = 0.5 * (pull * slow_m).sum(axis=-1)
            self._pulls.append(pull)

    def weight_by_drive(
        self, side: Float64[Array, "n 2"], field_m: Float64[Array, "n L"], n_drives: int
    ) -> Float64[Array, "D"]:
        """Return how much each drive's readings weigh, slow errors counted.

        Parameters
        ----------
        side : (n, 2)
            Probability of each cone's sides.
        field_m : (n, L)
            Size of the slow errors of each length in each cone's zone.
        n_drives
            Number of all drives.
        """
        evidence = self.evidence
        cone = evidence.block_cone[evidence.cell_block]
        slow_m2 = (field_m**2).sum(axis=1)[cone]
        weight = (side[cone].T / (1.0 / self._found.information + slow_m2)).sum(axis=0)
        drive = evidence.block_drive[evidence.cell_block]
        return np.bincount(drive, weight, n_drives).astype(np.float64)  # of nothing: whole numbers

    def add_freedom(self, sums: Sums) -> None:
        """Add how many independent slow errors of each length the readings show.

        Parameters
        ----------
        sums
            Where to add it.
        """
        for each in self._solved:
            cone = self.evidence.cones[self.evidence.block_cone[each.group.block]]
            b, length, m, _ = each.group.kernel.shape
            kernel = each.group.kernel.reshape(b, length, m * m)
            used = each.solved[..., :OWN]
            for side in (0, 1):
                flat = each.inverse[side].reshape(b, m * m, 1)
                freedom = (kernel @ flat)[..., 0] * each.field2
                through = each.group.kernel @ used[side][:, None]
                spent = np.swapaxes(used[side], -1, -2)[:, None] @ through
                at = (cone, np.full(len(cone), side))
                np.add.at(sums.freedom, at, freedom)
                np.add.at(sums.spent, at, spent * each.field2[..., None, None])

    def explained(self) -> Float64[Array, "n 2 L"]:
        """Return the squared slow errors of each cone and length, by their covariance."""
        total = np.zeros((len(self.evidence.cones), 2, len(SCALES_M)))
        for each, pull in zip(self._solved, self._pulls, strict=True):
            cone = self.evidence.block_cone[each.group.block]
            for side in (0, 1):
                own = pull[side][:, None, :, None]  # (b, 1, M, 1)
                explained = (np.swapaxes(own, -1, -2) @ (each.group.kernel @ own))[..., 0, 0]
                np.add.at(total[:, side], cone, explained * each.field2)
        return total


def _inverse(
    slow: Float64[Array, "b M M"], noise_m2: Float64[Array, "2 b M"]
) -> tuple[Float64[Array, "2 b M M"], Float64[Array, "2 b"]]:
    """Return the inverse of the covariance of both on each side, and its log determinant."""
    total = np.repeat(slow[None], 2, axis=0)
    size = slow.shape[-1]
    own = np.arange(size)
    total[..., own, own] += noise_m2
    log_det = np.empty(noise_m2.shape[:2])
    invert(total, log_det, size)
    return total, log_det
