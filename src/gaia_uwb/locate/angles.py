"""Angles of arrival: which way a tag heard a cone, as evidence of its place and its side.

An angle says little of how far a cone is and much of the side of the path: that on which no range
of a straight drive can decide. It errs by the antennas' pattern (a bias, and a harmonic of the
angle itself), by noise, and wildly where a reflection was heard. What angles err by for a second or
so is alike, so that more angles in this time average out only noise.

The places that the ranges gave are the prior. All cones of a zone share what their ranges leave
open in common (clock, bias) and the bias of the angles; given these they are independent, so one
step solves small blocks by the Schur complement, as the estimator of ranges does.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from gaia_uwb._shared import Array, Bool, Float64, InputError, Int64
from gaia_uwb.episode import Episode, RangeReadings
from gaia_uwb.locate.hypotheses import Hypotheses
from gaia_uwb.scene import heading

PATTERN = 3
"""Unknowns of a tag's angles: bias, and cosine and sine of the angle, in radians."""
_PATTERN_RAD = np.radians(5.0)  # standard deviation of each of them
_SLOW_RAD = np.radians(3.0)  # of what is alike for a while
_WHILE_S = 1.0
_HALF_S = 0.25
_DEFAULT_RAD = np.radians(10.0)  # noise of an angle that states none
_DEGREES = 3.0  # of a Student-t distribution: reflections are common
_STEPS = 12
_LONGEST_STEP_M, _NEAREST_M = 3.0, 0.5


@dataclass(frozen=True)
class Angles:
    """The angles of one zone.

    Parameters
    ----------
    cone, tag : (R,)
        Indices of the cone, and of the tag of a drive.
    from_m, velocity_mps : (R, 2)
        Where the tag was, by the clock offset that the ranges gave, and how it moved.
    front_rad, azimuth_rad : (R,)
        Direction of the vehicle's front, counter-clockwise from east, and the angle from there.
    sigma_rad : (R,)
        Standard deviation, as large as it must be for angles to count as independent.
    """

    cone: Int64[Array, "R"]
    tag: Int64[Array, "R"]
    from_m: Float64[Array, "R 2"]
    velocity_mps: Float64[Array, "R 2"]
    front_rad: Float64[Array, "R"]
    azimuth_rad: Float64[Array, "R"]
    sigma_rad: Float64[Array, "R"]

    @classmethod
    def of(
        cls,
        episodes: Sequence[Episode],
        anchor_ids: Sequence[str],
        offset_s: Sequence[float],
    ) -> Angles | None:
        """Gather the angles of all drives; None where there are none.

        Parameters
        ----------
        episodes
            The drives past one zone.
        anchor_ids
            Its cones.
        offset_s
            The clock offset of each drive that the ranges gave, in seconds.
        """
        index = {name: n for n, name in enumerate(anchor_ids)}
        parts = []
        for k, episode in enumerate(episodes):
            readings = episode.own_times
            if readings is None or readings.azimuth_rad is None:
                continue
            own = np.array([index[name] for name in episode.anchor_ids], dtype=np.int64)
            with suppress(InputError):  # without a heading, angles say nothing
                parts.append(_of_drive(readings, readings.azimuth_rad, own, k, offset_s[k]))
        parts = [part for part in parts if len(part[0])]
        if not parts:
            return None
        return cls(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))

    def of_cones(self, own: Bool[Array, "N"]) -> Angles:
        """Return the angles of some cones, those of each cone together.

        Parameters
        ----------
        own : (N,)
            Which of all.
        """
        keep = np.flatnonzero(own[self.cone])
        keep = keep[np.argsort(self.cone[keep], kind="stable")]
        return Angles(
            self.cone[keep],
            self.tag[keep],
            self.from_m[keep],
            self.velocity_mps[keep],
            self.front_rad[keep],
            self.azimuth_rad[keep],
            self.sigma_rad[keep],
        )


def _of_drive(
    readings: RangeReadings,
    azimuth_rad: Float64[Array, "R"],
    own: Int64[Array, "n"],
    k: int,
    offset_s: float,
) -> tuple[Array, ...]:
    """Return the columns of :class:`Angles` of one drive."""
    heard = np.flatnonzero(np.isfinite(azimuth_rad))
    sigma_rad = np.full(len(heard), _DEFAULT_RAD)
    if readings.azimuth_sigma_rad is not None:
        stated = readings.azimuth_sigma_rad[heard]
        sigma_rad = np.where(np.isfinite(stated) & (stated > 0.0), stated, sigma_rad)
    path, t_s = readings.trajectory, readings.t_s[heard] - offset_s
    cone = own[readings.anchor[heard]]
    second = np.stack([cone, np.floor(t_s / _WHILE_S).astype(np.int64)])
    _, cell = np.unique(second, axis=1, return_inverse=True)
    together = np.bincount(cell)[cell] if len(cell) else cell
    return (
        cone,
        np.full(len(heard), k, dtype=np.int64),
        readings.position_at(t_s),
        (readings.position_at(t_s + _HALF_S) - readings.position_at(t_s - _HALF_S)) / (2 * _HALF_S),
        np.interp(t_s, path.t_s, np.unwrap(heading(path))),
        azimuth_rad[heard],
        np.sqrt(sigma_rad**2 + together * _SLOW_RAD**2),
    )


def with_angles(
    hypotheses: Hypotheses,
    angles: Angles,
    clocks_s: Float64[Array, "K S"],
    alike: float,
    *,
    front_back: bool = False,
) -> Hypotheses:
    """Return both places of every cone, by their ranges and the angles.

    Parameters
    ----------
    hypotheses
        By the ranges.
    angles
        The angles.
    clocks_s : (K, S)
        How the clock offset of each drive changes with what moves the places in ``shared_m``.
    alike
        Log odds of sides are divided by this, as those of ranges are.
    front_back
        Whether an angle cannot tell before from behind.
    """
    located = np.asarray(np.isfinite(hypotheses.position_m).all(axis=(1, 2)))
    if hypotheses.shared_m is None or not located[angles.cone].any():
        return hypotheses
    fit = _Fit(hypotheses, hypotheses.shared_m, angles.of_cones(located), clocks_s, front_back)
    for _ in range(_STEPS):
        fit.step()
    return fit.result(alike)


class _Fit:
    """Places by ranges and angles, in progress."""

    def __init__(
        self,
        hypotheses: Hypotheses,
        shared_m: Float64[Array, "N 2 2 S"],
        angles: Angles,
        clocks_s: Float64[Array, "K S"],
        front_back: bool,
    ) -> None:
        located = np.asarray(np.isfinite(hypotheses.position_m).all(axis=(1, 2)))
        self._front_back = front_back
        self._before, self._located, self._angles = hypotheses, located, angles
        count = np.bincount(angles.cone, minlength=len(located))
        last = np.cumsum(count)
        self._rows = [slice(*ends) for ends in zip(last - count, last, strict=True)]
        n, s = len(located), shared_m.shape[-1]
        # A later clock puts the tag back along its way.
        self._back_m = angles.velocity_mps[:, :, None] * clocks_s[angles.tag, None]
        n_tags = int(angles.tag.max()) + 1
        self._n_ranges = s
        self._shared = np.zeros(s + PATTERN * n_tags)
        self._prior = np.concatenate([np.ones(s), np.full(PATTERN * n_tags, _PATTERN_RAD**-2.0)])
        self._shared_m = np.where(located[:, None, None, None], shared_m, 0.0)
        common_m2 = self._shared_m @ np.swapaxes(self._shared_m, -1, -2)
        own_m2 = np.where(
            located[:, None, None, None], hypotheses.covariance_m2 - common_m2, np.eye(2)
        )
        self._own_m2 = own_m2 + 1e-6 * np.eye(2)
        self._precision = np.linalg.inv(self._own_m2)
        self._off_m = np.zeros((n, 2, 2))
        self._start_m = np.nan_to_num(hypotheses.position_m)
        odds = hypotheses.log_odds
        self._log_odds = odds.copy()
        self._weight = self._weights(odds)

    @staticmethod
    def _weights(odds: Float64[Array, "N"]) -> Float64[Array, "N 2"]:
        first = 1.0 / (1.0 + np.exp(-np.clip(odds, -50.0, 50.0)))
        return np.stack([first, 1.0 - first], axis=1)

    def _places_m(self) -> Float64[Array, "N 2 2"]:
        moved_m = self._shared_m @ self._shared[: self._n_ranges]
        return np.asarray(self._start_m + self._off_m + moved_m)

    def _linear(self, side: int) -> tuple[Array, Array, Array, Array]:
        """Return residuals, robust weights, losses and derivatives by a place and by all shared."""
        angles = self._angles
        back_m = self._back_m @ self._shared[: self._n_ranges]
        to_m = self._places_m()[angles.cone, side] - angles.from_m + back_m
        flat_m2 = np.maximum((to_m**2).sum(axis=1), _NEAREST_M**2)
        by_place = np.stack([-to_m[:, 1], to_m[:, 0]], axis=1) / flat_m2[:, None]
        seen_rad = np.arctan2(to_m[:, 1], to_m[:, 0]) - angles.front_rad
        waves = np.stack([np.ones(len(seen_rad)), np.cos(seen_rad), np.sin(seen_rad)], axis=1)
        column = self._n_ranges + PATTERN * angles.tag[:, None] + np.arange(PATTERN)
        expected_rad = seen_rad + (waves * self._shared[column]).sum(axis=1)
        left_rad = _turned(angles.azimuth_rad - expected_rad)
        if self._front_back:
            turned_rad = _turned(np.pi - angles.azimuth_rad - expected_rad)
            left_rad = np.where(np.abs(turned_rad) < np.abs(left_rad), turned_rad, left_rad)
        sigma_rad = angles.sigma_rad
        scaled2 = (left_rad / sigma_rad) ** 2
        weight = (_DEGREES + 1.0) / (_DEGREES + scaled2) / sigma_rad**2
        loss = 0.5 * (_DEGREES + 1.0) * np.log1p(scaled2 / _DEGREES)
        by_shared = np.zeros((len(left_rad), len(self._shared)))
        by_shared[:, : self._n_ranges] = np.einsum(
            "ci,cis->cs", by_place, self._shared_m[angles.cone, side] + self._back_m
        )
        np.put_along_axis(by_shared, column, waves, axis=1)
        return left_rad, weight, loss, np.concatenate([by_place, by_shared], axis=1)

    def step(self) -> None:
        """Take one step in all unknowns."""
        n = len(self._located)
        total = np.diag(self._prior)
        towards = -self._prior * self._shared
        loss = np.zeros((n, 2))
        blocks = []
        for side in (0, 1):
            left, weight, cost, by = self._linear(side)
            cone = self._angles.cone
            weighted = weight[:, None] * by
            whole = np.stack([weighted[rows].T @ by[rows] for rows in self._rows])
            pull = np.stack([left[rows] @ weighted[rows] for rows in self._rows])
            loss[:, side] += np.bincount(cone, cost, n)
            off = self._off_m[:, side]
            loss[:, side] += 0.5 * np.einsum("ni,nij,nj->n", off, self._precision[:, side], off)
            matrix = whole[:, :2, :2] + self._precision[:, side]
            gradient = pull[:, :2] - np.einsum("nij,nj->ni", self._precision[:, side], off)
            inverse = np.linalg.inv(matrix)
            loss[:, side] -= (
                0.5 * np.linalg.slogdet(inverse)[1]
                - 0.5 * np.linalg.slogdet(self._own_m2[:, side])[1]
            )
            through = inverse @ whole[:, :2, 2:]
            schur = whole[:, 2:, 2:] - np.swapaxes(whole[:, :2, 2:], 1, 2) @ through
            rest = pull[:, 2:] - np.einsum("nis,ni->ns", through, gradient)
            own = self._weight[:, side]
            total = total + np.einsum("n,nst->st", own, schur)
            towards = towards + own @ rest
            blocks.append((inverse, gradient, through))
        change = np.linalg.solve(total, towards)
        self._shared = self._shared + change
        for side, (inverse, gradient, through) in enumerate(blocks):
            step_m = np.einsum("nij,nj->ni", inverse, gradient) - through @ change
            length_m = np.maximum(np.hypot(*step_m.T), 1e-9)
            self._off_m[:, side] += step_m * np.minimum(1.0, _LONGEST_STEP_M / length_m)[:, None]
        self._log_odds = self._before.log_odds + loss[:, 1] - loss[:, 0]
        self._weight = self._weights(self._log_odds)
        self._blocks, self._total = blocks, total

    def result(self, alike: float) -> Hypotheses:
        """Return both places, the better-fitting first."""
        root = np.linalg.cholesky(np.linalg.inv(self._total))
        shared_m, covariance_m2 = [], []
        for side, (inverse, _, through) in enumerate(self._blocks):
            ranges_m = np.concatenate(
                [
                    self._shared_m[:, side],
                    np.zeros((len(through), 2, len(self._shared) - self._n_ranges)),
                ],
                axis=2,
            )
            moved_m = (ranges_m - through) @ root
            shared_m.append(moved_m)
            covariance_m2.append(inverse + moved_m @ np.swapaxes(moved_m, 1, 2))
        heard = np.bincount(self._angles.cone, minlength=len(self._located)) > 0
        before = self._before
        odds = before.log_odds + (self._log_odds - before.log_odds) / alike
        position_m = np.where(self._located[:, None, None], self._places_m(), np.nan)
        found = replace(
            before,
            position_m=position_m,
            covariance_m2=np.where(
                self._located[:, None, None, None], np.stack(covariance_m2, axis=1), np.nan
            ),
            log_odds=np.where(heard, odds, before.log_odds),
            shared_m=np.stack(shared_m, axis=1),
        )
        return found.better_first()


def _turned(angle_rad: Array) -> Array:
    """Return angles between -pi and pi."""
    return np.asarray((angle_rad + np.pi) % (2.0 * np.pi) - np.pi)
