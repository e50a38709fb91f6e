"""Places of all cones from the readings of all drives: the estimator, started and read out.

Places are sought from both sides of the path by the solver of single cones, first with the clocks
and the range bias that are assumed, then with those that the first fit found.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gaia_uwb._shared import Array, Bool, Float64, Int64
from gaia_uwb.config import PipelineConfig
from gaia_uwb.episode import ClockOffset, DriveErrors, Episode, ErrorSizes, RangeReadings
from gaia_uwb.locate.angles import Angles, with_angles
from gaia_uwb.locate.common_prior import known_clock, shared_prior
from gaia_uwb.locate.cone_ranges import HardlyHeard, Ties, with_cone_ranges
from gaia_uwb.locate.error_sizes import RADIO_SIZES
from gaia_uwb.locate.evidence import VELOCITY_OVER_S, Evidence, Heard, Motion, gather
from gaia_uwb.locate.honest_errors import path_centres
from gaia_uwb.locate.hypotheses import Hypotheses
from gaia_uwb.locate.passes import all_anchors
from gaia_uwb.locate.path_noise import smooth_path, speed_noise_mps
from gaia_uwb.locate.slow_errors import DRIVE, RADIOS
from gaia_uwb.locate.zone_fit import (
    ALIKE,
    Estimator,
    Layout,
    SharedPrior,
    SizesPrior,
    ZoneFit,
)
from gaia_uwb.scene import Trajectory
from gaia_uwb.solver import SolverOptions, solve

CLOCK_UNKNOWN = "the drive is too straight and too steady to determine it"
"""What is said of a clock offset that a drive does not tell."""
CLOCK_KNOWN = "known of the vehicle"
"""The same where it was known before."""

_SIGMA_M = 0.1  # only a unit for the first solver: the scale of the errors is estimated
_MOST_EXTRA = 24  # steps beyond the usual ones, for zones that still move
_SIGNIFICANT = 2.0  # standard deviations that a clock offset is worth correcting
_UNKNOWN = 0.5  # of the clock's prior: a drive that leaves more than that does not determine it
_MOST_M = 0.6  # white noise, and slow errors, of radios that work on a known path
_MOST_OUTLIERS, _MOST_NOISE = 0.5, 3.0  # of a cone that stands where it was located
_MOST_DELAY_M = 0.3
_ROUGH_SHARE, _ROUGH_M = 0.1, 0.15  # of outliers; noise or slow errors in metres
STILL = 0.1
"""Converged where the last step was shorter than this, in standard deviations."""


@dataclass(frozen=True)
class ZonePlaces:
    """What the readings of one zone say.

    Parameters
    ----------
    anchor_ids
        All cones of the zone.
    hypotheses
        Both places of each, the better-fitting first.
    errors
        What was found of each drive.
    outliers, noise : (N,)
        Of each cone's readings: the share of outliers, and the others' mean square as a multiple
        of what the noise of the log says.
    contradictions
        Pairs of cones whose own ranges contradict the others, with the measured and the expected
        distance in metres.
    shared_covariance : (S, S), optional
        Covariance of what the cones have in common, of all drives together: bias, growth, and the
        last six numbers of each one's ``errors``; S = 2 + 6 K.
    own : (N, 2, 5), optional
        Of each cone: east, north, delay and pattern, the better-fitting side first.
    """

    anchor_ids: tuple[str, ...]
    hypotheses: Hypotheses
    errors: tuple[DriveErrors, ...]
    outliers: Float64[Array, "N"]
    noise: Float64[Array, "N"]
    contradictions: tuple[tuple[str, str, float, float], ...] = ()
    shared_covariance: Float64[Array, "S S"] | None = None
    own: Float64[Array, "N 2 5"] | None = None

    @property
    def rough(self) -> bool:
        """Whether the ranges err in ways that the estimator's model of radios does not stand for.

        Then stretches without line of sight are the rule, and its covariances are too small.
        """
        sizes = self.errors[0].sizes
        slow_m = float(np.sqrt((sizes.field_m**2).sum()))
        return bool(sizes.outlier_share > _ROUGH_SHARE or max(sizes.noise_m, slow_m) > _ROUGH_M)

    def unexplained(self) -> tuple[str, ...]:
        """Return the cones whose ranges no place explains as those of working radios."""
        return tuple(
            name
            for name, fits in zip(self.anchor_ids, self.hypotheses.fits, strict=True)
            if not fits
        )


def find_places(
    zones: Sequence[Sequence[Episode]],
    config: PipelineConfig = PipelineConfig(),
    *,
    near: Sequence[Mapping[str, Float64[Array, "2"]]] | None = None,
) -> list[ZonePlaces]:
    """Locate the cones of zones, each from all drives past it.

    Parameters
    ----------
    zones
        The drives past each zone, in one frame. Windows of a run know what the run found.
    config
        ``solver``, and the priors of ``alignment`` and ``calibration``.
    near
        Of each zone, places by cone: one of a cone's two places is sought near it, and the other is
        the better of those that the cone's ranges alone give.

    Returns
    -------
    list of ZonePlaces
        One per zone; each is what the zone alone would give.
    """
    found: dict[int, ZonePlaces] = {}
    groups: dict[tuple[int, bool], list[int]] = {}
    for z, episodes in enumerate(zones):
        is_near = near is not None and len(near[z]) > 0
        groups.setdefault((len(episodes), is_near), []).append(z)
    for members in groups.values():
        batch = [zones[z] for z in members]
        hints = [{} if near is None else near[z] for z in members]
        found.update(zip(members, _fit_batch(batch, config, hints), strict=True))
    return [found[z] for z in range(len(zones))]


def _fit_batch(
    zones: list[Sequence[Episode]],
    config: PipelineConfig,
    near: list[Mapping[str, Float64[Array, "2"]]],
) -> list[ZonePlaces]:
    """Fit zones that have the same number of drives."""
    ids = [all_anchors(episodes) for episodes in zones]
    first = np.cumsum([0] + [len(each) for each in ids])
    n_drives = len(zones[0])
    heard, noise_mps, paths = [], [], Paths()
    for z, episodes in enumerate(zones):
        index = {name: int(first[z]) + n for n, name in enumerate(ids[z])}
        for episode in episodes:
            readings = readings_of(episode)
            path, noise = paths.smoothed(readings.trajectory)
            noise_mps.append(noise)
            heard.append(heard_of(episode, replace(readings, trajectory=path), index))
    cone_zone = np.repeat(np.arange(len(zones)), np.diff(first))
    drive_zone = np.repeat(np.arange(len(zones)), n_drives)
    priors = [shared_prior(episodes, config) for episodes in zones]
    prior = SharedPrior(*map(np.stack, zip(*priors, strict=True)))
    known = [episodes[0].run_errors for episodes in zones]
    evidence = list(
        gather(
            heard,
            int(first[-1]),
            _clocks(prior.mean, drive_zone, n_drives),
            config.solver.min_ranges,
        )
    )
    layout = Layout(
        cone_zone, drive_zone, np.tile(np.arange(n_drives), len(zones)), np.array(noise_mps)
    )
    errors = SizesPrior(
        [RADIO_SIZES if each is None else each.sizes for each in known],
        np.array([each is not None for each in known]),
        np.array([max(e.least_noise_m for e in episodes) for episodes in zones]),
    )
    estimator = Estimator(evidence, layout, prior, errors)
    hint_m = np.full((int(first[-1]), 2), np.nan)
    for z, hints in enumerate(near):
        for n, name in enumerate(ids[z]):
            hint_m[first[z] + n] = hints.get(name, np.nan)
    starts = Starts(evidence, hint_m, config.solver.min_ranges)
    start_m = starts.both_sides(estimator)
    located = np.asarray(np.isfinite(start_m).all(axis=(1, 2)))
    estimator.place(np.nan_to_num(start_m))
    if not starts.are_near:
        estimator.rough()
        estimator.place(np.nan_to_num(starts.both_sides(estimator)))
        estimator.rough(again=True)
    estimator.finer()
    fit = estimator.refine()
    for _ in range(_MOST_EXTRA):
        moving = located & (_best(fit.step, fit.loss) > STILL)
        moving = np.bincount(cone_zone, moving, minlength=len(zones)) > 0
        if not moving.any():
            break
        before = estimator.state()
        again = estimator.refine(1)
        estimator.restart(before, ~moving)
        fit = again.where(moving, cone_zone, fit)
    count = _counted(heard, int(first[-1]))
    return [
        _places(zones[z], ids[z], fit.of(z, own), located[own], count[own], config)
        for z, own in enumerate(map(slice, first[:-1], first[1:]))
    ]


def _best(values: Float64[Array, "N 2"], loss: Float64[Array, "N 2"]) -> Float64[Array, "N"]:
    return np.asarray(values[np.arange(len(loss)), loss.argmin(axis=1)])


def readings_of(episode: Episode) -> RangeReadings:
    """Return an episode's readings at their own times, or its steps where there are none.

    Parameters
    ----------
    episode
        A run or a window of it.
    """
    if episode.own_times is not None:
        return episode.own_times
    step, anchor = np.nonzero(episode.valid)
    range_m = episode.range_m[step, anchor]
    if episode.calibration is not None:
        range_m = range_m + episode.calibration.bias_m(range_m)
    t_s, position_m, up_m = episode.t_s, episode.position_m, episode.tag_up_m
    if len(t_s) == 1:  # a path has two ends
        t_s, position_m = np.append(t_s, t_s + 1.0), np.repeat(position_m, 2, axis=0)
        up_m = None if up_m is None else np.repeat(up_m, 2)
    return RangeReadings(
        t_s=episode.t_s[step],
        anchor=anchor,
        range_m=range_m,
        trajectory=Trajectory(t_s, position_m, up_m),
    )


class Paths:
    """Smoothed paths; windows of one run have the same."""

    def __init__(self) -> None:
        self._known: dict[int, tuple[Trajectory, Trajectory, float]] = {}

    def smoothed(self, path: Trajectory) -> tuple[Trajectory, float]:
        """Return a path without its noise, and what is left of that in its speed."""
        if id(path) not in self._known:
            noise_mps = speed_noise_mps(path, VELOCITY_OVER_S)
            self._known[id(path)] = path, smooth_path(path), noise_mps
        return self._known[id(path)][1:]


def heard_of(episode: Episode, readings: RangeReadings, index: Mapping[str, int]) -> Heard:
    """Return what a drive heard, with the number of each cone in its zone.

    Parameters
    ----------
    episode
        Its anchors and their heights count.
    readings
        Its readings, with the path that is to be used.
    index
        Number of each cone, by id.
    """
    n = episode.n_anchors
    return Heard(
        readings,
        np.array([index[name] for name in episode.anchor_ids], dtype=np.int64),
        np.full(n, np.nan) if episode.anchor_up_m is None else episode.anchor_up_m,
    )


def _counted(heard: Sequence[Heard], n_cones: int) -> Int64[Array, "N"]:
    count = np.zeros(n_cones, dtype=np.int64)
    for each in heard:
        np.add.at(count, each.cone[each.readings.anchor], 1)
    return count


def _clocks(
    mean: Float64[Array, "Z S"], drive_zone: Int64[Array, "D"], n_drives: int
) -> Float64[Array, "D"]:
    slot = np.tile(np.arange(n_drives), len(mean))
    return np.asarray(mean[drive_zone, RADIOS + DRIVE * slot])


@dataclass(frozen=True)
class Starts:
    """Where to seek cones: on both sides of the path, and near places that are known already.

    Parameters
    ----------
    evidence
        All readings.
    near_m : (N, 2)
        Places that replace the worse of both sides; NaN where there is none.
    min_ranges
        A cone with fewer readings is not located.
    """

    evidence: Sequence[Evidence]
    near_m: Float64[Array, "N 2"]
    min_ranges: int

    @property
    def are_near(self) -> bool:
        """Whether places are known already, so that no step may lead far away from them."""
        return bool(np.isfinite(self.near_m).any())

    def both_sides(self, estimator: Estimator) -> Float64[Array, "N 2 2"]:
        """Locate every cone by itself, with the clocks and the bias found by now."""
        offset_s = estimator.offset_s
        out = np.full((len(self.near_m), 2, 2), np.nan)
        loss = np.zeros((len(self.near_m), 2))
        options = SolverOptions(tolerance=1e-3, min_ranges=self.min_ranges)
        for each in self.evidence:
            if not len(each.cone):
                continue
            motion = each.motion(offset_s)
            range_m = each.range_m - estimator.bias_m(each.cones[each.cone], each.range_m)
            count = np.bincount(each.cone, minlength=len(each.cones))
            slot = np.arange(int(count.max()))
            there = slot < count[:, None]
            first = np.cumsum(count) - count
            row = np.argsort(each.cone, kind="stable")[np.where(there, first[:, None] + slot, 0)]
            solved = solve(
                motion.position_m[row],
                np.where(there, range_m[row], np.nan)[:, None],
                _SIGMA_M,
                height_m=(motion.gap_m[row], np.zeros((len(count), 1))),
                options=options,
            )
            out[each.cones] = _on_both_sides(solved.position_m[:, 0], each, motion)
            loss[each.cones] = np.nan_to_num(solved.negative_log_likelihood[:, 0])
        known = np.isfinite(self.near_m[:, 0]) & np.isfinite(out[:, 0, 0])
        out[known, loss[known].argmax(axis=1)] = self.near_m[known]
        return out


def _on_both_sides(
    position_m: Float64[Array, "n 2 2"], evidence: Evidence, motion: Motion
) -> Float64[Array, "n 2 2"]:
    """Put the second place of a cone in the mirror where both are on one side of the path."""
    first_m = position_m[evidence.cone, 0]
    flat_m = np.hypot(*(first_m - motion.position_m).T)
    near = evidence.nearest(np.nan_to_num(flat_m))
    cone = evidence.cone[near]
    across = motion.across()[near, None]
    off_m = ((position_m[cone] - motion.position_m[near, None]) * across).sum(axis=-1)
    mirrored_m = position_m[cone, 0] - 2.0 * off_m[:, :1] * across[:, 0]
    same = off_m.prod(axis=1) > 0.0
    out = position_m.copy()
    out[cone[same], 1] = mirrored_m[same]
    return out


def _places(
    episodes: Sequence[Episode],
    ids: tuple[str, ...],
    fit: ZoneFit,
    located: Bool[Array, "n"],
    count: Int64[Array, "n"],
    config: PipelineConfig,
) -> ZonePlaces:
    """Return what the fit says of one zone."""
    floor_m2 = config.solver.position_floor_m**2 * np.eye(2)
    covariance_m2 = fit.covariance + floor_m2
    covariance_m2[~located] = np.nan
    hypotheses = Hypotheses(
        position_m=np.where(located[:, None, None], fit.own[..., :2], np.nan),
        covariance_m2=covariance_m2,
        log_odds=np.where(located, np.ptp(fit.loss, axis=1) / ALIKE, 0.0),
        own_bias_m=np.where(located, fit.own[:, 0, 2], 0.0),
        n_ranges=count,
        converged=~located | (fit.step[:, 0] < STILL),
        fits=~located | fits(fit.sizes[0], fit.outliers[:, 0], fit.noise[:, 0], fit.own[:, 0, 2]),
        shared_m=fit.shared_m,
        centre_m=_centres(episodes, ids),
    )
    errors = tuple(_drive_errors(fit, k) for k in range(len(episodes)))
    clocks = RADIOS + DRIVE * np.arange(len(episodes))
    angles = Angles.of(episodes, ids, [each.mean[RADIOS] for each in errors])
    if angles is not None:
        # Places move against what is shared: see ``ZoneFit.shared_m``.
        clocks_s = -np.linalg.cholesky(fit.shared_covariance[0])[clocks]
        both = config.solver.azimuth_front_back
        hypotheses = with_angles(hypotheses, angles, clocks_s, ALIKE, front_back=both)
    ties = Ties.of(episodes, ids)
    contradictions: list[tuple[int, int, float, float]] = []
    if ties is not None:
        hardly = _hardly_heard(episodes, ids, located, errors)
        hypotheses, contradictions = with_cone_ranges(hypotheses, ties, hardly, ALIKE)
    return ZonePlaces(
        ids,
        hypotheses,
        errors,
        fit.outliers[:, 0],
        fit.noise[:, 0],
        tuple((ids[a], ids[b], measured, expected) for a, b, measured, expected in contradictions),
        fit.shared_covariance[0],
        fit.own,
    )


def _hardly_heard(
    episodes: Sequence[Episode],
    ids: tuple[str, ...],
    located: Bool[Array, "n"],
    errors: Sequence[DriveErrors],
) -> HardlyHeard:
    """Return what the drives measured of cones that these ranges do not locate."""
    index = {name: n for n, name in enumerate(ids)}
    parts = []
    for episode, found in zip(episodes, errors, strict=True):
        readings = readings_of(episode)
        own = np.array([index[name] for name in episode.anchor_ids], dtype=np.int64)
        readings = readings.rows(~located[own[readings.anchor]])
        path, at_s = readings.trajectory, readings.t_s - found.mean[RADIOS]
        higher_m = np.zeros(len(at_s))
        if path.up_m is not None and episode.anchor_up_m is not None:
            tag_m = np.interp(at_s, path.t_s, path.up_m)
            higher_m = np.nan_to_num(tag_m - episode.anchor_up_m[readings.anchor], nan=0.0)
        bias, growth, _, tag_bias = found.mean[: RADIOS + 2]
        decades = np.log10(np.maximum(readings.range_m, 0.5) / 10.0)
        range_m = readings.range_m - bias - tag_bias - growth * decades
        flat_m = np.sqrt(np.maximum(range_m**2 - higher_m**2, 0.01))
        parts.append((own[readings.anchor], readings.position_at(at_s), flat_m))
    return HardlyHeard(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


def fits(
    sizes: ErrorSizes,
    outliers: Float64[Array, "n"],
    noise: Float64[Array, "n"],
    delay_m: Float64[Array, "n"],
) -> Bool[Array, "n"]:
    """Return whether ranges err like those of working radios, if the cones stand there.

    Parameters
    ----------
    sizes
        Of the errors of the zone's ranges.
    outliers, noise : (n,)
        Of each cone's readings: the share of outliers, and the others' mean square as a multiple
        of what the noise says.
    delay_m : (n,)
        Of each cone.
    """
    slow_m = float(np.sqrt((sizes.field_m**2).sum()))
    if max(sizes.noise_m, slow_m) > _MOST_M:
        return np.zeros(len(delay_m), dtype=np.bool_)
    like_others = (outliers < _MOST_OUTLIERS) & (noise < _MOST_NOISE)
    return np.asarray(like_others & (np.abs(delay_m) < _MOST_DELAY_M))


def _drive_errors(fit: ZoneFit, k: int) -> DriveErrors:
    column = np.concatenate([np.arange(RADIOS), RADIOS + DRIVE * k + np.arange(DRIVE)])
    return DriveErrors(
        mean=fit.shared[0, column],
        covariance=fit.shared_covariance[0][np.ix_(column, column)],
        sizes=fit.sizes[0],
    )


def _centres(episodes: Sequence[Episode], ids: tuple[str, ...]) -> Float64[Array, "N 2"]:
    """Return the middle of the stretches of path from which each cone was ranged."""
    index = {name: n for n, name in enumerate(ids)}
    total, weight = np.zeros((len(ids), 2)), np.zeros(len(ids))
    for episode in episodes:
        own = np.array([index[name] for name in episode.anchor_ids])
        count = episode.valid.sum(axis=0) + 1e-9
        total[own] += count[:, None] * path_centres(episode)
        weight[own] += count
    return np.asarray(total / weight[:, None])


def with_run_errors(episode: Episode, places: ZonePlaces, config: PipelineConfig) -> Episode:
    """Return a whole run with what its readings say of its errors and its clock.

    Parameters
    ----------
    episode
        A whole run.
    places
        What was found of it alone.
    config
        As in :func:`with_clock`.

    Returns
    -------
    Episode
        With ``errors`` set, and the clock offset that was found together with the cones' positions.
        The ranges are not shifted.
    """
    errors = places.errors[0]
    found = with_clock(episode, errors, config)
    mean = errors.mean.copy()
    if found.clock is not None and episode.clock is not None:
        mean[RADIOS] -= found.clock.applied_s - episode.clock.applied_s
    return replace(found, errors=replace(errors, mean=mean))


def with_clock(episode: Episode, errors: DriveErrors, config: PipelineConfig) -> Episode:
    """Return an episode with the clock offset that was found together with the cones' positions.

    Parameters
    ----------
    episode
        A run; its ranges are not shifted.
    errors
        What was found of its errors.
    config
        Whether the clock was to be estimated, and the offset's prior.
    """
    clock, alignment = episode.clock, config.alignment
    if clock is None or alignment.clock_offset == "off":
        return episode
    known = known_clock(episode, config)
    prior_s = alignment.clock_offset_sigma_s if known is None else known.sigma
    left_s, sigma_s = float(errors.mean[RADIOS]), float(errors.covariance[RADIOS, RADIOS] ** 0.5)
    reason = "estimated together with the cones' positions"
    if sigma_s > _UNKNOWN * prior_s:
        reason = CLOCK_UNKNOWN if known is None else CLOCK_KNOWN
    if abs(left_s) < _SIGNIFICANT * sigma_s:  # the ranges stay where they are
        return replace(episode, clock=ClockOffset(clock.offset_s, sigma_s, clock.applied, reason))
    offset_s = clock.applied_s + left_s
    return replace(episode, clock=ClockOffset(offset_s, sigma_s, True, reason))
