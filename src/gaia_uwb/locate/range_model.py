r"""What readings say of a zone near a guess: robust means of derivatives and residuals by cell.

A reading is visible or hidden. Visible ones err by Student-t noise of four degrees of freedom;
hidden ones are too long by something like a metre, rarely too short, or not of this cone at all.

A truck that drives past between vehicle and cone hides the cone for a second or two, so hidden
readings come in stretches. Were each taken by itself, twelve of them in a row would seem twelve
times as unlikely as they are, and a cone that was hidden just when the vehicle passed it would be
put too far from the path, with certainty. So each cone has a hidden Markov chain in each drive:
from one reading to the next, ``dt`` later, the state stays with probability ``exp(-dt / 1.5 s)``,
and is else drawn anew.

A reading whose noise is like that of the one before adds less than one whose noise is its own.

All of it is done reading by reading in ``_readings.c``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gaia_uwb._shared import Array, Float64, Int64
from gaia_uwb.locate._readings import average_readings
from gaia_uwb.locate.evidence import Evidence, Motion


@dataclass(frozen=True)
class Guess:
    """What is thought, by now, of all that readings depend on.

    Parameters
    ----------
    own : (2, B, 5)
        East, north, delay, and cosine and sine of the pattern of each block's cone, on both sides.
    errors : (B, 9)
        Range bias at 10 m, the tag's included; its growth; noise; correlation of the noise of
        readings that are 0.1 s apart, below 1; share of hidden readings where nothing is known of
        those before; and the four of the tag's pattern.
    slow_m, variance_m2 : (2, C)
        Slow error of each cell on both sides, and how uncertain it is.
    """

    own: Float64[Array, "2 B 5"]
    errors: Float64[Array, "B 9"]
    slow_m: Float64[Array, "2 C"]
    variance_m2: Float64[Array, "2 C"]


@dataclass(frozen=True)
class Averages:
    """What readings say near a guess, on both sides.

    Parameters
    ----------
    information : (2, C)
        Of each cell, per square metre: inverse variances of its readings, less where they probably
        were hidden, where they lie far off, and where their noise is like that of the one before.
    mean : (2, C, 14)
        Means weighted by it. Derivatives of the range by the cone's east, north, delay, and cosine
        and sine of its pattern; by range bias and its growth; by clock offset, bias of the tag and
        the four of its pattern; then measured range less the guess's, slow errors not counted.
    loss, hidden, square : (2, n)
        Of each cone: negative log likelihood; how many readings were hidden; the others' weighted
        squared residuals, over the noise's variance.
    pairs : (2, n, 2)
        Of neighbouring visible readings: products of both residuals, and means of their squares,
        over the noise's variance.
    nearest : (2, n)
        Which reading was taken nearest to each cone's place; -1 where there is none.
    """

    information: Float64[Array, "2 C"]
    mean: Float64[Array, "2 C 14"]
    loss: Float64[Array, "2 n"]
    hidden: Float64[Array, "2 n"]
    square: Float64[Array, "2 n"]
    pairs: Float64[Array, "2 n 2"]
    nearest: Int64[Array, "2 n"]


class RangeModel:
    """The readings of some cones, and which of them follow each other.

    Parameters
    ----------
    evidence
        The readings, by block and cell.

    Examples
    --------
    A tag stands still 10 m from a cone, and one of three readings is 2 m too long:

    >>> none, zeros = np.zeros(1, dtype=np.int64), np.zeros(3, dtype=np.int64)
    >>> evidence = Evidence(
    ...     cones=none, drives=(), t_s=np.array([0.0, 5.0, 10.0]), range_m=np.array([10.0, 12, 10]),
    ...     up_m=np.zeros(3), cone=zeros, drive=zeros, cell=zeros,
    ...     block_cone=none, block_drive=none, cell_block=none,
    ... )
    >>> motion = Motion(np.zeros((3, 2)), np.zeros((3, 2)), np.zeros(3))
    >>> own = np.tile([10.0, 0.0, 0.0, 0.0, 0.0], (2, 1, 1))
    >>> errors = np.array([[0.0, 0.0, 0.05, 0.0, 0.1, 0.0, 0.0, 0.0, 0.0]])
    >>> guess = Guess(own, errors, np.zeros((2, 1)), np.zeros((2, 1)))
    >>> found = RangeModel(evidence).average(motion, guess)
    >>> print(f"{found.hidden[0, 0]:.1f} hidden, the others {found.mean[0, 0, -1]:.2f} m off")
    1.0 hidden, the others 0.00 m off
    """

    def __init__(self, evidence: Evidence) -> None:
        n_cells, n_blocks = len(evidence.cell_block), len(evidence.block_cone)
        self._first_row = np.searchsorted(evidence.cell, np.arange(n_cells + 1))
        self._first_cell = np.searchsorted(evidence.cell_block, np.arange(n_blocks + 1))
        self._block_cone = np.ascontiguousarray(evidence.block_cone, dtype=np.int64)
        self._n_cones = len(evidence.cones)
        self._range_m = np.ascontiguousarray(evidence.range_m)
        block = evidence.cell_block[evidence.cell]
        order = np.lexsort((evidence.t_s, block))
        self._order = order - self._first_row[self._first_cell][block]
        self._after_s = np.diff(evidence.t_s[order], prepend=0.0)

    def average(self, motion: Motion, guess: Guess) -> Averages:
        """Return what readings say near a guess.

        Parameters
        ----------
        motion
            Of the tag, at each reading.
        guess
            Where to look.
        """
        n_cells = len(self._first_row) - 1
        information, mean = np.empty((2, n_cells)), np.empty((2, n_cells, 14))
        tallies = np.zeros((2, self._n_cones, 5))
        nearest = np.full((2, self._n_cones), -1, dtype=np.int64)
        average_readings(
            np.ascontiguousarray(motion.position_m),
            np.ascontiguousarray(motion.velocity_mps),
            np.ascontiguousarray(motion.gap_m),
            self._range_m,
            self._order,
            self._after_s,
            self._first_row,
            self._first_cell,
            self._block_cone,
            np.ascontiguousarray(guess.own),
            np.ascontiguousarray(guess.errors),
            np.ascontiguousarray(guess.slow_m),
            np.ascontiguousarray(guess.variance_m2),
            information,
            mean,
            tallies,
            nearest,
        )
        loss, hidden, square, *pairs = np.moveaxis(tallies, -1, 0)
        return Averages(information, mean, loss, hidden, square, np.stack(pairs, axis=-1), nearest)
