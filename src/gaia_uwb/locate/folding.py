r"""What one drive says of the cones of a zone, in numbers that add up over drives.

The model is that of ``zone_fit.py``. Unknown are ``a_n`` of each cone (place, delay, pattern; one
set for each side), what all drives share (bias and growth ``theta``, and ``u_v`` of each tag of
each vehicle), and ``phi_k`` of each drive: ``phi_k = mean_k + u_v + own_k``
(``lasting_errors.py``). Given ``a``, ``theta`` and ``u``, drives are independent, slow errors and
``phi_k`` included::

    -log p(a, theta, u | all) = prior(a, theta, u) + sum over k of n_k(a, theta, u),
    n_k = min over phi_k of (-log p(readings of k | a, theta, phi_k) + prior(phi_k | u))

Near a point, ``n_k`` is a parabola, whose coefficients are a drive's block: they are the sums over
the drive's readings that the estimator forms in each of its steps anyway. Before ``phi_k`` is taken
out, a block has one small matrix for each cone and side, and one for what the drive shares. Taking
``phi_k`` out couples the cones that the drive heard, all of them: that is done where blocks are
added up (``gaia_uwb.kept``).

What is exact: at one and the same point, the sum of blocks is the estimator's own linear system for
all drives, and its solution is the estimator's step. What is not: each block is taken at the
estimate of its time, so its parabola is followed for as far as the estimate has moved since; sizes
of errors are those of its time. What a drive says of sides is no parabola: it is the estimator's
own loss of both places, with earlier drives as its prior, less what these said. Such losses add up.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gaia_uwb._shared import Array, Bool, Float64, Int64
from gaia_uwb.config import PipelineConfig
from gaia_uwb.episode import DriveErrors, Episode, ErrorSizes
from gaia_uwb.locate.error_sizes import KeptSizes
from gaia_uwb.locate.evidence import gather
from gaia_uwb.locate.fusion import for_certain
from gaia_uwb.locate.honest_errors import path_centres
from gaia_uwb.locate.kept_prior import KeptPrior
from gaia_uwb.locate.lasting_errors import DrivePrior
from gaia_uwb.locate.passes import all_anchors
from gaia_uwb.locate.slow_errors import DRIVE, OWN, RADIOS, Sums
from gaia_uwb.locate.zone_fit import Estimator, Layout, SharedPrior, SizesPrior
from gaia_uwb.locate.zone_places import STILL, Paths, Starts, find_places, heard_of, readings_of

_MOST_EXTRA = 12  # steps beyond the usual ones, for drives that still move
_RULED_OUT = 12.0  # log odds against a place
_FAR_M = 0.4  # from where all drives put a cone: one that may have moved
_ANYWHERE_M = 1e3  # prior standard deviation of a place


@dataclass(frozen=True)
class Point:
    """Estimates at which a drive's readings are looked at.

    Parameters
    ----------
    own : (n, 2, 5)
        Of the cones that the drive heard: east, north, delay and pattern on each side; NaN for
        those that are not located, of which the readings do not count.
    shared : (S,)
        Bias, growth, and what each tag of the drive has by itself; S = 2 + 6 T.
    weight : (n, 2)
        Probability of each side.
    sizes
        Of the errors.
    """

    own: Float64[Array, "n 2 5"]
    shared: Float64[Array, "S"]
    weight: Float64[Array, "n 2"]
    sizes: ErrorSizes


@dataclass(frozen=True)
class KnownBefore:
    """What a zone knows of the cones and the errors of a drive before that.

    Parameters
    ----------
    is_known : (n,)
        Whether earlier drives have located the cone; the rows of others mean nothing.
    mean, precision, loss : (n, 2, 5), (n, 2, 5, 5), (n, 2)
        As in :class:`gaia_uwb.locate.kept_prior.KeptPrior`.
    given_shared : (n, 2, 5, 5)
        Precision where what is shared were known; for new cones that of their prior.
    shared_mean, shared_covariance : (S,), (S, S)
        Of bias, growth, and what each tag of the drive has by itself.
    sizes, size_sums
        Sizes of the zone's errors, and what they are known from.
    """

    is_known: Bool[Array, "n"]
    mean: Float64[Array, "n 2 5"]
    precision: Float64[Array, "n 2 5 5"]
    loss: Float64[Array, "n 2"]
    given_shared: Float64[Array, "n 2 5 5"]
    shared_mean: Float64[Array, "S"]
    shared_covariance: Float64[Array, "S S"]
    sizes: ErrorSizes
    size_sums: KeptSizes


@dataclass(frozen=True)
class DriveBlock:
    """What one drive with T tags says of n cones near a point.

    Parameters
    ----------
    anchor_ids
        The cones.
    vehicles
        Of each tag, the name of all that has its clock and pattern.
    point
        Where it was taken.
    matrix, gradient, cross : (n, 2, 5, 5), (n, 2, 5), (n, 2, 5, S)
        Of each cone's own unknowns, for both sides; the last with what the drive shares.
    square, pull : (n, 2, S, S), (n, 2, S)
        Of what the drive shares, as each cone tells it.
    loss : (n, 2)
        What the drive says against each side.
    speed_noise : (T,)
        What noise of the path seems to say of the clock offset.
    prior
        What was known of the drive.
    n_ranges, n_readings : (n,)
        Readings that the estimator could use, and those that are reported.
    count : (n,)
        Those that it used: it thins out many.
    outliers, squares : (n, 2)
        How many of them are outliers; the others' squared residuals over the noise's.
    centre_m, n_steps : (n, 2), (n,)
        Middle of the stretch of path from which the cone was ranged, and what it counts.
    sizes
        What the residuals say of the sizes of errors.
    drift_m2
        Variance of the cones' random walk, along each axis, since the drive before.
    """

    anchor_ids: tuple[str, ...]
    vehicles: tuple[str, ...]
    point: Point
    matrix: Float64[Array, "n 2 5 5"]
    gradient: Float64[Array, "n 2 5"]
    cross: Float64[Array, "n 2 5 S"]
    square: Float64[Array, "n 2 S S"]
    pull: Float64[Array, "n 2 S"]
    loss: Float64[Array, "n 2"]
    speed_noise: Float64[Array, "T"]
    prior: DrivePrior
    n_ranges: Int64[Array, "n"]
    n_readings: Int64[Array, "n"]
    count: Float64[Array, "n"]
    outliers: Float64[Array, "n 2"]
    squares: Float64[Array, "n 2"]
    centre_m: Float64[Array, "n 2"]
    n_steps: Float64[Array, "n"]
    sizes: KeptSizes
    drift_m2: float = 0.0

    def without(self, cones: Collection[str]) -> DriveBlock:
        """Return what the drive says of other cones.

        Parameters
        ----------
        cones
            Whose readings do not count.
        """
        there = np.array([name not in cones for name in self.anchor_ids])
        if there.all():
            return self
        changed: dict[str, Any] = {}
        for name in _BY_CONE:
            values = getattr(self, name)
            row = there.reshape(-1, *[1] * (values.ndim - 1))
            changed[name] = np.where(row, values, np.zeros_like(values))
        own = np.where(there[:, None, None], self.point.own, np.nan)
        return replace(self, point=replace(self.point, own=own), **changed)


_BY_CONE = (
    "matrix", "gradient", "cross", "square", "pull", "loss", "n_ranges", "n_readings", "count",
    "outliers", "squares", "n_steps",
)  # fmt: skip


class DriveReadings:
    """The readings of one drive, ready for the estimator.

    Parameters
    ----------
    episodes
        Prepared, of each of its tags, in the zone's frame.
    prior
        What is known of the drive before it.
    vehicles
        Of each tag, the name of all that has its clock and pattern.
    config
        ``solver`` is used.
    """

    def __init__(
        self,
        episodes: Sequence[Episode],
        prior: DrivePrior,
        vehicles: Sequence[str],
        config: PipelineConfig,
    ) -> None:
        self.episodes, self.prior, self.vehicles = episodes, prior, tuple(vehicles)
        self.anchor_ids = all_anchors(episodes)
        self._config = config
        index = {name: n for n, name in enumerate(self.anchor_ids)}
        paths, heard, noise_mps = Paths(), [], []
        for episode in episodes:
            readings = readings_of(episode)
            path, noise = paths.smoothed(readings.trajectory)
            noise_mps.append(noise)
            heard.append(heard_of(episode, replace(readings, trajectory=path), index))
        n, t = len(self.anchor_ids), len(episodes)
        self.n_ranges = np.zeros(n, dtype=np.int64)
        for each in heard:
            np.add.at(self.n_ranges, each.cone[each.readings.anchor], 1)
        self._evidence = list(gather(heard, n, prior.mean[::DRIVE]))
        none = np.zeros(t, dtype=np.int64)
        self._layout = Layout(np.zeros(n, dtype=np.int64), none, np.arange(t), np.array(noise_mps))
        self._least_noise_m = np.array([max(each.least_noise_m for each in episodes)])

    def fit(self, known: KnownBefore) -> tuple[Point, Float64[Array, "n 2"]]:
        """Fit this drive alone, with what earlier ones know as its prior.

        Parameters
        ----------
        known
            Before this drive.

        Returns
        -------
        Point, (n, 2)
            The estimates, and what the drive says against each side.
        """
        mean, precision = known.mean.copy(), known.precision.copy()
        new = ~known.is_known
        mean[new] = 0.0
        precision[new] = own_prior(known.sizes)
        loss = np.where(new[:, None], 0.0, known.loss)
        shared = SharedPrior(known.shared_mean[None], np.linalg.inv(known.shared_covariance)[None])
        errors = SizesPrior([known.sizes], np.zeros(1, dtype=np.bool_), self._least_noise_m)
        kept = KeptPrior(mean, precision, loss, known.size_sums)
        estimator = Estimator(self._evidence, self._layout, shared, errors, kept)
        start = known.shared_mean.copy()
        for k, episode in enumerate(self.episodes):
            if episode.errors is not None:  # the drive alone knows its clock better than others
                start[RADIOS + DRIVE * k] = episode.errors.mean[RADIOS]
        estimator.start(mean, start[None])
        missing = np.zeros(len(new), dtype=np.bool_)
        if new.any():
            hint_m = np.full((len(new), 2), np.nan)
            starts = Starts(self._evidence, hint_m, self._config.solver.min_ranges)
            sought_m = starts.both_sides(estimator)[new]
            mean[new, :, :2] = np.nan_to_num(sought_m)
            missing[new] = ~np.isfinite(sought_m).all(axis=(1, 2))
            estimator.start(mean, start[None])
        estimator.finer()
        fit = estimator.refine()
        for _ in range(_MOST_EXTRA):
            best = fit.loss.argmin(axis=1)
            if (fit.step[np.arange(len(best)), best] <= STILL).all():
                break
            fit = estimator.refine(1)
        weight = np.exp(fit.loss.min(axis=1, keepdims=True) - fit.loss)
        weight /= weight.sum(axis=1, keepdims=True)
        own = np.where(missing[:, None, None], np.nan, fit.own)
        point = Point(own, fit.shared[0], weight, fit.sizes[0])
        said = fit.loss - loss + 0.5 * np.linalg.slogdet(estimator.own_covariance)[1]
        return point, said - said.min(axis=1, keepdims=True)

    def block(
        self, point: Point, given_shared: Float64[Array, "n 2 5 5"], loss: Float64[Array, "n 2"]
    ) -> DriveBlock:
        """Return what the drive says near a point.

        Parameters
        ----------
        point
            Where to look.
        given_shared : (n, 2, 5, 5)
            Precision of the cones' own unknowns without this drive, where what is shared is known.
        loss : (n, 2)
            What the drive says against each side.
        """
        some = SharedPrior(point.shared[None], np.eye(len(point.shared))[None])
        errors = SizesPrior([point.sizes], np.ones(1, dtype=np.bool_), self._least_noise_m)
        estimator = Estimator(self._evidence, self._layout, some, errors)
        located = np.asarray(np.isfinite(point.own).all(axis=(1, 2)))
        estimator.start(np.nan_to_num(point.own), point.shared[None])
        sums = _of_some(estimator.settle(point.weight * located[:, None]), located)
        inverse = np.linalg.inv(given_shared + sums.matrix)
        return DriveBlock(
            anchor_ids=self.anchor_ids,
            vehicles=self.vehicles,
            point=point,
            matrix=sums.matrix,
            gradient=sums.gradient,
            cross=sums.cross,
            square=sums.shared,
            pull=sums.shared_gradient,
            loss=loss * located[:, None],
            speed_noise=estimator.speed_noise(),
            prior=self.prior,
            n_ranges=self.n_ranges * located,
            n_readings=self._by_cone([each.n_readings[:, None] for each in self.episodes])[:, 0],
            count=sums.count[:, 0],
            outliers=sums.outliers,
            squares=sums.squares,
            centre_m=self._centres(),
            n_steps=self._n_steps() * located,
            sizes=estimator.size_sums(sums, inverse),
        )

    def own_places(
        self, errors: Sequence[DriveErrors], near_m: Float64[Array, "n 2"]
    ) -> tuple[Float64[Array, "n 2"], Float64[Array, "n 2 2"]]:
        """Return where this drive alone puts each cone, given the errors that it shares.

        Parameters
        ----------
        errors
            Of each tag.
        near_m : (n, 2)
            Where all drives put the cones: that place counts unless this drive rules it out.

        Returns
        -------
        place_m, covariance_m2 : (n, 2), (n, 2, 2)
            NaN for cones that it does not locate.
        """
        given = [
            replace(episode, run_errors=for_certain(each))
            for episode, each in zip(self.episodes, errors, strict=True)
        ]
        hints = dict(zip(self.anchor_ids, near_m, strict=True))
        hints = {name: place_m for name, place_m in hints.items() if np.isfinite(place_m).all()}
        found = find_places([given], self._config, near=[hints] if hints else None)[0].hypotheses
        side = np.zeros(len(near_m), dtype=np.int64)
        known = np.isfinite(found.position_m).all(axis=(1, 2)) & np.isfinite(near_m).all(axis=1)
        for k in np.flatnonzero(known & (found.log_odds <= _RULED_OUT)):
            off_m = found.position_m[k] - near_m[k]
            far = (off_m * np.linalg.solve(found.covariance_m2[k], off_m[..., None])[..., 0]).sum(1)
            side[k] = far.argmin()
        rows = np.arange(len(side))
        place_m, spread_m2 = found.position_m[rows, side], found.covariance_m2[rows, side]
        far_m = np.where(known, np.hypot(*(place_m - near_m).T), 0.0)
        if (far_m > _FAR_M).any():  # sought near the old place, a cone that moved may not be found
            free = find_places([given], self._config)[0].hypotheses
            off_m = np.hypot(*np.moveaxis(free.position_m - near_m[:, None], -1, 0))
            side = np.where(free.log_odds > _RULED_OUT, 0, np.nan_to_num(off_m).argmin(axis=1))
            far = (far_m > _FAR_M)[:, None]
            place_m = np.where(far, free.position_m[rows, side], place_m)
            spread_m2 = np.where(far[..., None], free.covariance_m2[rows, side], spread_m2)
        return place_m, spread_m2

    def _n_steps(self) -> Float64[Array, "n"]:
        return self._by_cone([1.0 * each.valid.sum(axis=0)[:, None] for each in self.episodes])[
            :, 0
        ]

    def _centres(self) -> Float64[Array, "n 2"]:
        parts = [each.valid.sum(axis=0)[:, None] * path_centres(each) for each in self.episodes]
        return self._by_cone(parts) / np.maximum(self._n_steps(), 1e-9)[:, None]

    def _by_cone(self, parts: Sequence[Array]) -> Array:
        """Return the sums over the tags of something that each of them has by its own cones."""
        index = {name: n for n, name in enumerate(self.anchor_ids)}
        total = np.zeros((len(index), parts[0].shape[1]), dtype=parts[0].dtype)
        for episode, part in zip(self.episodes, parts, strict=True):
            total[[index[name] for name in episode.anchor_ids]] += part
        return total


def own_prior(sizes: ErrorSizes) -> Float64[Array, "5 5"]:
    """Return the prior precision of the unknowns of a cone that nothing is known of.

    Parameters
    ----------
    sizes
        ``delay_m`` and ``pattern_m`` are used.
    """
    sigma_m = np.array([_ANYWHERE_M] * 2 + [sizes.delay_m] + [sizes.pattern_m] * (OWN - 3))
    return np.diag(sigma_m**-2.0)


def _of_some(sums: Sums, cones: Bool[Array, "n"]) -> Sums:
    """Return what the readings of some cones say."""
    return Sums(
        **{
            name: np.where(cones.reshape(-1, *[1] * (values.ndim - 1)), values, 0.0)
            for name, values in vars(sums).items()
        }
    )
