"""What is known, before any range, of what the cones of a zone have in common.

That is the range bias of the radios and its growth with distance, and for each drive (each tag of
each drive, where a vehicle has several): its clock offset, what the tag adds to the bias, and the
tag's pattern on its vehicle.

A lever arm that is a little wrong, or a heading that is, moves the antenna in the vehicle's frame.
To the ranges that is the first harmonic of the tag's pattern, so both are part of its prior. A
wrong heading moves the tags of one vehicle against each other.

What is known of a vehicle (``PipelineConfig.vehicles``) stands in for what is usual. From drive to
drive, clocks and tags differ a little all the same.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from gaia_uwb._shared import Array, Float64
from gaia_uwb.config import Known, PipelineConfig, TagPrior, VehiclePrior
from gaia_uwb.episode import DriveErrors, Episode
from gaia_uwb.locate.slow_errors import DRIVE, RADIOS
from gaia_uwb.scene import Scene

TAG_BIAS_M = 0.1
"""Standard deviation of what a tag adds to the range bias of the radios."""
PATTERN_M = 0.05
"""Standard deviation of each harmonic of a tag's pattern."""
_DRIVE_BIAS_M = 0.02  # and by how much that differs from drive to drive
_SAME = 0.5  # share of a pattern's variance that is the same in all drives of a vehicle
_LEVER_M = 0.02  # of a lever arm: measured with a tape
_HEADING_RAD, _COURSE_RAD = np.radians(1.0), np.radians(2.0)  # of a measured heading, of a course
_HELD = 1e-6  # of what is known for certain
_SAME_CLOCK_S = 1e-4  # between tags that share a clock


def shared_prior(
    episodes: Sequence[Episode], config: PipelineConfig
) -> tuple[Float64[Array, "S"], Float64[Array, "S S"]]:
    """Return mean and precision of what the cones of a zone have in common.

    Parameters
    ----------
    episodes
        All drives past the zone, or the tags of drives; a window knows what its run found.
    config
        ``alignment``, ``calibration`` and ``vehicles`` hold the priors.

    Returns
    -------
    mean, precision : (S,), (S, S)
        Bias and growth in metres; of each of K episodes the clock offset in seconds that is left,
        and in metres the bias of its tag and four parts of its pattern; S = 2 + 6 K.
    """
    k = len(episodes)
    known = [each.run_errors for each in episodes if each.run_errors is not None]
    if len(known) == k:
        return _of_runs(known)
    size = RADIOS + DRIVE * k
    mean, variance = np.zeros(size), np.zeros((size, size))
    clock = RADIOS + DRIVE * np.arange(k)
    if config.calibration.range_bias == "auto":
        variance[1, 1] = config.calibration.bias_slope_sigma_m**2
        biases = [0, *(clock + 1).tolist()]
        mean[biases], variance[np.ix_(biases, biases)] = _biases(episodes, config)
    if config.alignment.clock_offset == "auto":
        mean[clock] = [_left_s(episode, config) for episode in episodes]
        variance[np.ix_(clock, clock)] = _clocks_s2(episodes, config)
    alike = _SAME * _pairs(episodes, _same_mounting) + (1.0 - _SAME) * np.eye(k)
    for i in range(2, DRIVE):
        variance[np.ix_(clock + i, clock + i)] = PATTERN_M**2 * alike
    first = (clock[:, None] + np.array([2, 3])).ravel()  # harmonics: an antenna's place
    variance[np.ix_(first, first)] += _places_m2(episodes, config)
    variance[np.diag_indices(size)] += _HELD**2
    return mean, np.linalg.inv(variance)


def _of_runs(known: Sequence[DriveErrors]) -> tuple[Float64[Array, "S"], Float64[Array, "S S"]]:
    """Return what the runs found: bias and growth as the first did."""
    size = RADIOS + DRIVE * len(known)
    mean, variance = np.zeros(size), np.zeros((size, size))
    for n, errors in enumerate(known):
        rest = RADIOS + DRIVE * n + np.arange(DRIVE)
        own = np.concatenate([np.arange(RADIOS), rest]) if n == 0 else rest
        of = np.arange(len(errors.mean))[-len(own) :]
        mean[own] = errors.mean[of]
        variance[np.ix_(own, own)] = errors.covariance[np.ix_(of, of)]
    return mean, np.linalg.inv(variance)


def known_of(episode: Episode | Scene, config: PipelineConfig) -> VehiclePrior:
    """Return what is known of the vehicle that drove.

    Parameters
    ----------
    episode
        Its ``vehicle`` counts.
    config
        ``vehicles`` is used.
    """
    return config.vehicles.get(episode.vehicle, VehiclePrior())


def known_tag(episode: Episode, config: PipelineConfig) -> tuple[str, TagPrior]:
    """Return the id of the tag of an episode, and what is known of it.

    Parameters
    ----------
    episode
        Its ``vehicle`` and ``tag`` count. A tag without a name is the only one of its vehicle.
    config
        ``vehicles`` is used.
    """
    tags = known_of(episode, config).tags
    if episode.tag is not None:
        return episode.tag.tag_id, tags.get(episode.tag.tag_id, TagPrior())
    return next(iter(tags.items())) if len(tags) == 1 else ("", TagPrior())


def known_clock(episode: Episode | Scene, config: PipelineConfig) -> Known | None:
    """Return what is known of the clock offset of a drive before it.

    Parameters
    ----------
    episode
        Its ``vehicle`` counts; a tag with a clock of its own is not known.
    config
        ``vehicles``, and ``alignment.drive_offset_sigma_s``, by which drives differ.

    Examples
    --------
    >>> from gaia_uwb.config import make_config
    >>> from gaia_uwb.simulate import PRESETS, simulate_pass
    >>> from gaia_uwb.alignment import align
    >>> drive = align(simulate_pass(PRESETS["lane-closure"], seed=0))
    >>> known = {"clock_offset_s": {"value": 0.2, "sigma": 0.012}}
    >>> known_clock(drive, make_config({"vehicles": {"": known}}))
    Known(value=0.2, sigma=0.013)
    """
    known = known_of(episode, config).clock_offset_s
    if known is None or _has_own_clock(episode):
        return None
    spread_s = config.alignment.drive_offset_sigma_s
    return Known(value=known.value, sigma=float(np.hypot(known.sigma, spread_s)))


def _biases(
    episodes: Sequence[Episode], config: PipelineConfig
) -> tuple[Float64[Array, "B"], Float64[Array, "B B"]]:
    """Return mean and covariance of the radios' bias, and of what each tag adds to it.

    The radios' bias is that of the first episode's vehicle. Vehicles of which none is known share
    one. What sets another vehicle apart is in the biases of its tags.
    """
    k = len(episodes)
    usual = Known(value=0.0, sigma=max(config.calibration.bias_sigma_m, _HELD))
    sources = [e.vehicle if known_of(e, config).range_bias_m else None for e in episodes]
    names = list(dict.fromkeys(sources))
    known = [
        usual if name is None else config.vehicles[name].range_bias_m or usual for name in names
    ]
    of_source = np.zeros((1 + k, len(names)))
    of_source[1:] = [[float(source == name) for name in names] for source in sources]
    of_source[1:, 0] -= 1.0
    of_source[0, 0] = 1.0
    mean = of_source @ [each.value for each in known]
    variance = (of_source * [each.sigma**2 for each in known]) @ of_source.T
    same_tag = _pairs(episodes, _same_tag)
    usual_m2 = TAG_BIAS_M**2 if k > 1 else 0.0
    again_m2 = _DRIVE_BIAS_M**2 if same_tag.sum() > k else 0.0
    for n, episode in enumerate(episodes):
        delay = known_tag(episode, config)[1].delay_m
        mean[1 + n] += 0.0 if delay is None else delay.value
        variance[1 + n, 1:] += same_tag[n] * (usual_m2 if delay is None else delay.sigma**2)
        variance[1 + n, 1 + n] += again_m2 if delay is None else _DRIVE_BIAS_M**2
    return mean, variance


def _left_s(episode: Episode, config: PipelineConfig) -> float:
    """Return the clock offset that is expected beyond what was applied already, an estimate."""
    known = known_clock(episode, config)
    applied_s = 0.0 if episode.clock is None else episode.clock.applied_s
    return (0.0 if known is None else known.value) - applied_s


def _clocks_s2(episodes: Sequence[Episode], config: PipelineConfig) -> Float64[Array, "K K"]:
    """Return the covariance of the clock offsets."""
    k, alignment = len(episodes), config.alignment
    total_s2, differ_s2 = np.zeros(k), np.zeros(k)
    for n, episode in enumerate(episodes):
        offset = known_of(episode, config).clock_offset_s
        is_known = offset is not None and not _has_own_clock(episode)
        usual_s = alignment.clock_offset_sigma_s
        total_s2[n] = offset.sigma**2 if offset is not None and is_known else usual_s**2
        differ_s2[n] = alignment.drive_offset_sigma_s**2 if k > 1 or is_known else 0.0
    same = _pairs(episodes, _same_radios) * total_s2 + _pairs(episodes, _same_drive) * differ_s2
    return np.asarray(same + _SAME_CLOCK_S**2 * np.eye(k))


def _places_m2(episodes: Sequence[Episode], config: PipelineConfig) -> Float64[Array, "M M"]:
    """Return how the first harmonics vary with lever arms and headings that are a little wrong."""
    k = len(episodes)
    turned_m = np.zeros((k, 2))
    lever_m = np.zeros(k)
    for n, episode in enumerate(episodes):
        turned_m[n] = heading_sigma_m(episode)
        known_m = known_tag(episode, config)[1].lever_sigma_m
        usual_m = _LEVER_M if turned_m[n].any() else 0.0
        lever_m[n] = usual_m if known_m is None else known_m
    together = np.kron(_pairs(episodes, _one_vehicle_at_once), np.ones((2, 2)))
    levers = np.kron(_pairs(episodes, _same_tag) * np.outer(lever_m, lever_m), np.eye(2))
    return np.asarray(together * np.outer(turned_m.ravel(), turned_m.ravel()) + levers)


def heading_sigma_m(episode: Episode) -> Float64[Array, "2"]:
    """Return by how much a wrong heading moves a tag's antenna, forward and left, in metres.

    Parameters
    ----------
    episode
        Of one tag; its lever arm, and whether the heading was measured, count.

    Returns
    -------
    (2,)
        For one standard deviation of the heading; with signs: the tags of a vehicle turn together.
    """
    if episode.tag is None or episode.own_times is None:
        return np.zeros(2)
    measured = episode.own_times.trajectory.heading_rad is not None
    sigma_rad = _HEADING_RAD if measured else _COURSE_RAD
    return np.asarray(sigma_rad * np.array([episode.tag.left_m, -episode.tag.forward_m]))


def _pairs(
    episodes: Sequence[Episode], alike: Callable[[Episode, Episode], bool]
) -> Float64[Array, "K K"]:
    """Return 1 for each pair of episodes that is alike in a way, and 0 for the others."""
    return np.array([[float(a is b or alike(a, b)) for b in episodes] for a in episodes])


def _same_radios(one: Episode, other: Episode) -> bool:
    return one.vehicle == other.vehicle and not _has_own_clock(one) and not _has_own_clock(other)


def _one_vehicle_at_once(one: Episode, other: Episode) -> bool:
    return bool(one.drive) and one.drive == other.drive


def _same_drive(one: Episode, other: Episode) -> bool:
    return _one_vehicle_at_once(one, other) and _same_radios(one, other)


def _same_mounting(one: Episode, other: Episode) -> bool:
    tags = [None if each.tag is None else each.tag.tag_id for each in (one, other)]
    return one.vehicle == other.vehicle and tags[0] == tags[1]


def _same_tag(one: Episode, other: Episode) -> bool:
    return _same_mounting(one, other) and one.tag is not None


def _has_own_clock(episode: Episode | Scene) -> bool:
    if isinstance(episode, Scene):
        return len(episode.tags) == 1 and episode.tags[0].own_clock
    return episode.tag is not None and episode.tag.own_clock
