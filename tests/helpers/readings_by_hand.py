"""What readings say near a guess, written out plainly, and small sets of readings to try it on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from gaia_uwb.locate.evidence import Evidence, Motion
from gaia_uwb.locate.range_model import Averages, Guess

Numbers = NDArray[np.float64]
Indices = NDArray[np.int64]


def of_cones(t_s: Numbers, range_m: Numbers, cone: Indices) -> Evidence:
    """Return readings of one drive, sorted by cone, each in a cell of its own."""
    row, n = np.arange(len(t_s)), int(cone.max()) + 1
    zeros = np.zeros(n, np.int64)
    return Evidence(
        cones=np.arange(n), drives=(), t_s=t_s, range_m=range_m, up_m=np.zeros(len(t_s)),
        cone=cone, drive=np.zeros(len(t_s), np.int64), cell=row,
        block_cone=np.arange(n), block_drive=zeros, cell_block=cone,
    )  # fmt: skip


def by_hand(evidence: Evidence, motion: Motion, guess: Guess) -> Averages:
    """Do what a ``RangeModel`` does, reading by reading."""
    n, n_cells = len(evidence.cones), len(evidence.cell_block)
    information, mean = np.zeros((2, n_cells)), np.ones((2, n_cells, 14))
    tallies, nearest = np.zeros((5, 2, n)), np.full((2, n), -1)
    block = evidence.cell_block[evidence.cell]
    for side in (0, 1):
        flat_m, values = _geometry(evidence, motion, guess.own[side, block], guess.errors[block])
        left_m = values[:, -1] - guess.slow_m[side, evidence.cell]
        for k, errors in enumerate(guess.errors):
            rows = np.flatnonzero(block == k)
            rows = rows[np.argsort(evidence.t_s[rows], kind="stable")]
            variance_m2 = guess.variance_m2[side, evidence.cell[rows]]
            chain = _Chain(evidence.t_s[rows], left_m[rows], variance_m2, errors)
            square = (left_m[rows] ** 2 + variance_m2) / errors[2] ** 2
            weight = (1 - chain.hidden) * 5 / (4 + square)
            worth = weight / errors[2] ** 2 * (1 - chain.alike) / (1 + chain.alike)
            told = [chain.loss, chain.hidden.sum(), (weight * square).sum(), *chain.pairs()]
            tallies[:, side, evidence.block_cone[k]] += told
            for cell in np.unique(evidence.cell[rows]):
                own = evidence.cell[rows] == cell
                information[side, cell] = max(worth[own].sum(), 1e-2)
                sums = worth[own] @ values[rows[own]]
                varying = [i for i in range(14) if i not in {2, 5, 8}]
                mean[side, cell, varying] = sums[varying] / information[side, cell]
        for cone in np.unique(evidence.cone):
            rows = np.flatnonzero(evidence.cone == cone)
            nearest[side, cone] = rows[flat_m[rows].argmin()]
    loss, hidden, square, *pairs = tallies
    return Averages(information, mean, loss, hidden, square, np.stack(pairs, axis=-1), nearest)


def _geometry(
    evidence: Evidence, motion: Motion, own: Numbers, errors: Numbers
) -> tuple[Numbers, Numbers]:
    """Return horizontal distances, and 13 derivatives and the residual of every reading."""
    off_m = own[:, :2] - motion.position_m
    flat_m = np.hypot(*off_m.T)
    distance_m = np.hypot(flat_m, motion.gap_m) + 1e-9  # finite where the tag is at the place
    bearing, course = (np.arctan2(*xy.T[::-1]) for xy in (off_m, motion.velocity_mps))
    moving = np.hypot(*motion.velocity_mps.T) > 0.2
    turned = [moving * f(i * (bearing - course)) for i in (1, 2) for f in (np.cos, np.sin)]
    towards = off_m / distance_m[:, None]
    closing_mps = (towards * motion.velocity_mps).sum(axis=1)
    decades = np.log10(np.maximum(distance_m, 0.5) / 10)
    one, cosine, sine = np.ones(len(off_m)), np.cos(bearing), np.sin(bearing)
    columns = [*towards.T, one, cosine, sine, one, decades, closing_mps, one, *turned]
    size_m = [*own[:, 2:].T, errors[:, 0], errors[:, 1], *errors[:, 5:].T]
    linear = [columns[i] for i in (2, 3, 4, 5, 6, 9, 10, 11, 12)]
    model_m = distance_m + sum(s * c for s, c in zip(size_m, linear, strict=True))
    return flat_m, np.stack([*columns, evidence.range_m - model_m], axis=1)


@dataclass
class _Chain:
    """The readings of a block in the order of time: a product of 2 x 2 matrices."""

    t_s: Numbers
    left_m: Numbers
    variance_m2: Numbers
    errors: Numbers

    def __post_init__(self) -> None:
        _, _, noise_m, alike, share = self.errors[:5]
        self.wide_m = np.sqrt(noise_m**2 + self.variance_m2)
        self.after_s = np.diff(self.t_s, prepend=-np.inf)
        self.alike = np.minimum(alike ** (self.after_s / 0.1), 0.98)
        self.before_m = np.concatenate([[0.0], self.left_m[:-1]])
        same = np.exp(-self.after_s / 1.5)
        size_m = np.abs(self.left_m)
        new = (0.9 * np.exp(-size_m) + 0.1 * np.exp(-size_m / 50) / 50) * np.where(
            self.left_m > 0, 0.9, 0.1
        )
        drifted_m = np.sqrt(2 * self.wide_m**2 + 2 * 0.2**2 * (1 - same))
        like = student.pdf(self.left_m - self.before_m, 4, scale=drifted_m)
        visible = student.pdf(self.left_m, 4, scale=self.wide_m)
        own_m = self.left_m - self.alike * self.before_m
        again = student.pdf(own_m, 4, scale=self.wide_m * np.sqrt(1 - self.alike**2))
        anew = (1 - same) * np.array([(1 - share) * visible, share * new])  # (2, R)
        kept = same * np.array([again, (share > 0) * (0.7 * like + 0.3 * new)])
        # What leads from visible or hidden, in rows, to visible or hidden, in columns.
        steps = [np.diag(kept[:, r]) + anew[:, r] for r in range(len(self.t_s))]
        forward, backward, self.loss = [np.array([1.0, 0.0])], [np.ones(2)], 0.0
        for step in steps:
            ahead = forward[-1] @ step
            self.loss -= float(np.log(ahead.sum()))
            forward.append(ahead / ahead.sum())
        for step in steps[:0:-1]:
            back = step @ backward[-1]
            backward.append(back / back.sum())
        both = np.array(forward[1:]) * np.array(backward[::-1])
        self.hidden = both[:, 1] / both.sum(axis=1)

    def pairs(self) -> tuple[float, float]:
        """Return the sums of products and of mean squares of visible neighbours."""
        seen = 1 - self.hidden
        both = seen * np.concatenate([[0.0], seen[:-1]]) * (self.after_s < 0.3)
        now, before = self.left_m / self.wide_m, self.before_m / self.wide_m
        far2 = (now**2 + before**2 - 2 * self.alike * now * before) / (1 - self.alike**2)
        both *= 6 / (4 + far2)
        return float((both * now * before).sum()), float((both * (now**2 + before**2) / 2).sum())
