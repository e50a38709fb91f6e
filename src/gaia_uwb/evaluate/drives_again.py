"""A drive simulated once more, with errors as large as the estimator found them, on any path.

Cones stand where they were located. Everything that a reading depends on in the estimator's model
(``locate/zone_fit.py``) is drawn from the sizes that were estimated from the log itself, so that
what another drive would give follows from the model that locates the cones, and from nothing else.

Readings come when they came, of the cones of which they came: on a path a lane away, about the
same cones answer.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gaia_uwb._shared import Array, Float64, Int64
from gaia_uwb.episode import DriveErrors, Episode, ErrorSizes, RangeReadings
from gaia_uwb.locate import PATTERN_M, SCALES_M, TAG_BIAS_M, smooth_path
from gaia_uwb.scene import Tag, Trajectory

_MOST_CELLS = 800  # of the path, between which slow errors are interpolated
_NOISE_STEP_S, _MOST_STEPS = 0.02, 20_000
_STEADY_S = 2.0  # before and after: noise that is left would be motion that tells the clock


@dataclass(frozen=True)
class Drive:
    """When a tag reads which cone, and on which path.

    Parameters
    ----------
    like
        The pass whose clock and radios it has.
    path
        Of the tag's antenna, without noise.
    t_s : (R,)
        Times of the readings.
    anchor : (R,)
        Which of the cones each is of.
    name
        Of the pass.
    tag, drive
        As an :class:`~gaia_uwb.episode.Episode` has them.
    is_new_tag
        Whether its radio is another one.
    """

    like: Episode
    path: Trajectory
    t_s: Float64[Array, "R"]
    anchor: Int64[Array, "R"]
    name: str
    tag: Tag | None = None
    drive: str = ""
    is_new_tag: bool = False

    @classmethod
    def of(cls, episode: Episode, readings: RangeReadings) -> Drive:
        """Return a pass as it was driven.

        Parameters
        ----------
        episode
            The pass.
        readings
            Those of them that are to come again.
        """
        return cls(
            episode,
            smooth_path(readings.trajectory, _STEADY_S),
            readings.t_s,
            readings.anchor,
            episode.name,
            episode.tag,
            episode.drive,
        )


@dataclass(frozen=True)
class Cones:
    """The cones, and what of their errors stays the same from drive to drive.

    Parameters
    ----------
    ids
        Their names.
    place_m : (N, 2)
        Where they are taken to stand, in metres.
    up_m : (N,), optional
        Their heights, in metres; NaN where unknown.
    delay_m, pattern_m : (N,), (N, 2)
        What their ranges err by, always, and with the direction.
    """

    ids: tuple[str, ...]
    place_m: Float64[Array, "N 2"]
    up_m: Float64[Array, "N"] | None
    delay_m: Float64[Array, "N"]
    pattern_m: Float64[Array, "N 2"]

    @classmethod
    def draw(
        cls,
        ids: Sequence[str],
        place_m: Float64[Array, "N 2"],
        up_m: Float64[Array, "N"] | None,
        sizes: ErrorSizes,
        rng: np.random.Generator,
    ) -> Cones:
        """Draw cones whose errors are as large as ``sizes`` says."""
        own = rng.normal(size=(len(ids), 3))
        delay_m, pattern_m = sizes.delay_m * own[:, 0], sizes.pattern_m * own[:, 1:]
        return cls(tuple(ids), place_m, up_m, delay_m, pattern_m)


def driven(drive: Drive, cones: Cones, rng: np.random.Generator) -> Episode:
    """Return the pass that a drive gives.

    Parameters
    ----------
    drive
        Of a pass with ``errors``: it is one of a reconstruction.
    cones
        Past which it leads.
    rng
        Of all that is drawn anew.

    Raises
    ------
    ValueError
        If nothing is known of the pass's errors.
    """
    errors = drive.like.errors
    if errors is None:
        raise ValueError("nothing is known of the errors of this pass")
    seen = rng.random(len(drive.t_s)) >= errors.sizes.outlier_share  # the rest tells nothing
    t_s, anchor = drive.t_s[seen], drive.anchor[seen]
    at = RangeReadings(t_s, anchor, np.zeros(len(t_s)), drive.path)
    position_m = at.position_at(t_s - errors.mean[2])
    off_m = cones.place_m[anchor] - position_m
    rise_m = _rise_m(drive.path, t_s, anchor, cones.up_m)
    true_m = np.hypot(np.hypot(*off_m.T), rise_m)
    bearing = np.arctan2(*off_m.T[::-1])
    course = np.interp(t_s, drive.path.t_s, _course_rad(drive.path))
    error_m = _radio_m(errors, true_m, bearing - course, rng, is_new=drive.is_new_tag)
    waves = np.column_stack([np.cos(bearing), np.sin(bearing)])
    error_m += cones.delay_m[anchor] + (cones.pattern_m[anchor] * waves).sum(axis=1)
    error_m += _slow_m(drive.path, t_s, anchor, len(cones.ids), errors.sizes, rng)
    error_m += _noise_m(t_s, anchor, len(cones.ids), errors.sizes, rng)
    noise_m = _path_noise_m(drive.like) * rng.normal(size=drive.path.position_m.shape)
    recorded = replace(drive.path, position_m=drive.path.position_m + noise_m)
    return _episode(drive, cones, replace(at, range_m=true_m + error_m, trajectory=recorded))


def _path_noise_m(like: Episode) -> float:
    """Return the noise of recorded positions; of what the smoothing leaves there is none."""
    if like.own_times is None:
        return 0.0
    path = like.own_times.trajectory
    return path.position_noise_m if smooth_path(path) is not path else 0.0


def _radio_m(
    errors: DriveErrors,
    true_m: Float64[Array, "R"],
    ahead: Float64[Array, "R"],
    rng: np.random.Generator,
    *,
    is_new: bool,
) -> Float64[Array, "R"]:
    """Return what ranges err by that all cones have in common; ``ahead`` is from the course."""
    bias_m, growth_m, _, tag_m, *pattern_m = errors.mean.tolist()
    if is_new:
        tag_m, *pattern_m = rng.normal(size=5) * [TAG_BIAS_M, *[PATTERN_M] * 4]
    waves = [np.cos(ahead), np.sin(ahead), np.cos(2 * ahead), np.sin(2 * ahead)]
    decades = np.log10(np.maximum(true_m, 0.5) / 10.0)
    return np.asarray(bias_m + tag_m + growth_m * decades + np.array(pattern_m) @ waves)


def _rise_m(
    path: Trajectory,
    t_s: Float64[Array, "R"],
    anchor: Int64[Array, "R"],
    up_m: Float64[Array, "N"] | None,
) -> Float64[Array, "R"]:
    if path.up_m is None or up_m is None:
        return np.zeros(len(t_s))
    return np.nan_to_num(np.interp(t_s, path.t_s, path.up_m) - up_m[anchor], nan=0.0)


def _course_rad(path: Trajectory) -> Float64[Array, "T"]:
    step_m = np.gradient(path.position_m, axis=0)
    return np.unwrap(np.arctan2(step_m[:, 1], step_m[:, 0]))


def _slow_m(
    path: Trajectory,
    t_s: Float64[Array, "R"],
    anchor: Int64[Array, "R"],
    n_cones: int,
    sizes: ErrorSizes,
    rng: np.random.Generator,
) -> Float64[Array, "R"]:
    """Draw slow errors: a Gaussian field of several lengths along the path, for every cone."""
    driven_m = np.append(0.0, np.cumsum(np.hypot(*np.diff(path.position_m, axis=0).T)))
    at_m = np.interp(t_s, path.t_s, driven_m)
    cell_m = max(1.0, float(np.ptp(at_m)) / _MOST_CELLS) if len(at_m) else 1.0
    middle_m = np.arange(at_m.min(initial=0.0), at_m.max(initial=0.0) + 2.0 * cell_m, cell_m)
    apart_m = np.abs(middle_m[:, None] - middle_m)
    kernel = 1e-9 * np.eye(len(middle_m))
    for size_m, scale_m in zip(sizes.field_m.tolist(), SCALES_M, strict=True):
        kernel += size_m**2 * np.exp(-apart_m / scale_m)
    field_m = np.linalg.cholesky(kernel) @ rng.normal(size=(len(middle_m), n_cones))
    cell = (at_m - middle_m[0]) / cell_m
    low = np.clip(cell.astype(np.int64), 0, len(middle_m) - 2)
    share = cell - low
    return np.asarray((1.0 - share) * field_m[low, anchor] + share * field_m[low + 1, anchor])


def _noise_m(
    t_s: Float64[Array, "R"],
    anchor: Int64[Array, "R"],
    n_cones: int,
    sizes: ErrorSizes,
    rng: np.random.Generator,
) -> Float64[Array, "R"]:
    """Draw noise that is like that of the reading before, as far as the log's is."""
    white = rng.normal(size=len(t_s))
    if not len(t_s) or sizes.alike <= 0.0:
        return np.asarray(sizes.noise_m * white)
    step_s = max(_NOISE_STEP_S, float(np.ptp(t_s)) / _MOST_STEPS)
    stays = sizes.alike ** (step_s / 0.1)
    steps = rng.normal(size=(int(np.ptp(t_s) / step_s) + 2, n_cones))
    for k in range(1, len(steps)):
        steps[k] = stays * steps[k - 1] + np.sqrt(1.0 - stays**2) * steps[k]
    step = np.round((t_s - t_s.min()) / step_s).astype(np.int64)
    return np.asarray(sizes.noise_m * steps[step, anchor])


def _episode(drive: Drive, cones: Cones, readings: RangeReadings) -> Episode:
    """Return a pass on the timeline of the one that it is like."""
    like, path = drive.like, readings.trajectory
    n_steps, n_cones = len(like.t_s), len(cones.ids)
    step = np.clip(np.searchsorted(like.t_s, readings.t_s), 0, n_steps - 1)
    range_m = np.full((n_steps, n_cones), np.nan)
    range_m[step, readings.anchor] = readings.range_m
    east_m, north_m = (np.interp(like.t_s, path.t_s, axis) for axis in path.position_m.T)
    return Episode(
        name=drive.name,
        anchor_ids=cones.ids,
        t_s=like.t_s,
        position_m=np.stack([east_m, north_m], axis=1),
        range_m=range_m,
        valid=np.isfinite(range_m),
        tag_up_m=None if path.up_m is None else np.interp(like.t_s, path.t_s, path.up_m),
        anchor_up_m=cones.up_m,
        frame=like.frame,
        clock=like.clock,
        own_times=readings,
        tag=drive.tag,
        drive=drive.drive,
        vehicle=like.vehicle,
    )
