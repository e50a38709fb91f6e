"""What the drives of a vehicle say of it: clock offset, range bias, delays, and lever arms.

Every drive is located by itself, from nothing but its own ranges, past any cones. What it says of a
number is its estimate with what was known before taken out again; drives are then averaged, each
with its precision, and what was known before counts once. Where drives scatter more than they say,
the standard error grows by as much.

A lever arm that is wrong is the first harmonic of the tag's pattern (``common_prior.py``). So it is
moved by that, and the drive is located anew, until it rests. Where the antenna seems to be, by its
ranges, is what comes out: a part of its pattern that looks like a shift is a shift here. The
heading mostly is the course, and a wrong heading moves all antennas of a vehicle. That stays in
their standard errors.

>>> from gaia_uwb.api import read
>>> calibrated = calibrate_vehicle([read("sim:lane-closure")], name="van 7")
>>> calibrated.vehicle.clock_offset_s is None, calibrated.unknown
(False, ())
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gaia_uwb._shared import Array, Float64, InputError
from gaia_uwb.alignment import align
from gaia_uwb.config import Known, PipelineConfig, TagPrior, VehiclePrior
from gaia_uwb.episode import ClockOffset, Episode
from gaia_uwb.locate import (
    DRIVE,
    PATTERN_M,
    RADIOS,
    TAG_BIAS_M,
    Said,
    ZonePlaces,
    find_places,
    heading_sigma_m,
    said_of,
    same_drive,
    shared_prior,
)
from gaia_uwb.logs import Vehicle, VehicleTag
from gaia_uwb.scene import Scene, Tag, tag_scenes

CLOCK, BIAS = "clock_offset_s", "range_bias_m"
DELAY, AHEAD, LEFT = "delay_m", "forward_m", "left_m"

_LEVER_M = 0.02  # of a lever arm that is given: measured with a tape
_UNKNOWN_LEVER_M = 2.0  # of one that is not
_HELD_M2 = 1e-9  # variance of a bias that is held, since there is one tag only
_RESTS_M, _MOST_FITS = 0.005, 6  # of a lever arm that moves with what is found
_DETERMINED = 0.5  # of what was known before: a standard error above that says little


@dataclass(frozen=True)
class Calibration:
    """What drives say of a vehicle.

    Parameters
    ----------
    vehicle
        What they determine, and of the rest what was known before.
    found
        Name of each number that was sought -> value and standard error.
    unknown
        The names of those that the drives do not tell.
    n_drives
        How many drives.
    """

    vehicle: Vehicle
    found: Mapping[str, Known]
    unknown: tuple[str, ...]
    n_drives: int


def calibrate_vehicle(
    scenes: Sequence[Scene],
    known: Vehicle | None = None,
    *,
    name: str | None = None,
    levers_unknown: bool = False,
    config: PipelineConfig = PipelineConfig(),
    progress: Callable[[int], None] = lambda done: None,
) -> Calibration:
    """Estimate what stays the same from drive to drive of a vehicle.

    Parameters
    ----------
    scenes
        Its drives, with any cones; their truth is not used.
    known
        The vehicle as far as it is known. Its lever arms count as measured; of the rest, what the
        drives do not tell stays.
    name
        What to call the vehicle; by default as it was called, or as its first drive.
    levers_unknown
        Whether lever arms are no more than a guess, within 2 m.
    config
        How drives are located.
    progress
        Called with the number of drives that are done.

    Raises
    ------
    InputError
        If a drive cannot be located, is there twice, or there is none.
    """
    if not scenes:
        raise InputError("expected at least one drive, got none")
    for n, scene in enumerate(scenes):
        twin = next((each for each in scenes[:n] if same_drive(each, scene)), None)
        if twin is not None:
            raise InputError(f"is the same drive as {twin.name}", source=scene.name)
    drives = []
    for scene in scenes:
        drives.append(_located(scene, known, levers_unknown, config))
        progress(len(drives))
    tags = {tag.tag_id: tag for scene in reversed(scenes) for tag in scene.tags}
    sigmas = {tag_id: _lever_sigma_m(tag_id, known, levers_unknown) for tag_id in tags}
    before = _before(drives, tags, sigmas, config)
    start = Vehicle(name=name or scenes[0].name) if known is None else known
    start = start if name is None else start.model_copy(update={"name": name})
    if levers_unknown:  # what the drives do not tell must not pass for measured
        start = start.model_copy(update={"tags": {}})
    elif tags:
        given = {tag_id: _given(tag, start.tags.get(tag_id)) for tag_id, tag in tags.items()}
        start = start.model_copy(update={"tags": {**start.tags, **given}})
    return combine(start, drives, before, tags)


def combine(
    start: Vehicle,
    drives: Sequence[Mapping[str, Known]],
    before: Mapping[str, Known],
    tags: Mapping[str, Tag] | None = None,
) -> Calibration:
    """Average what drives say, and put what is determined in the place of what was known.

    Parameters
    ----------
    start
        The vehicle as far as it is known.
    drives
        What each drive says, by name of the number.
    before
        What is usual of each number.
    tags
        Those whose lever arms are sought; of others, no more than the delay is.
    """
    found = {name: average([d[name] for d in drives if name in d], usual)
             for name, usual in before.items()}  # fmt: skip
    unknown = {
        name for name, usual in before.items() if found[name].sigma > _DETERMINED * usual.sigma
    }
    # Both numbers of a lever arm are determined, or the arm is not.
    for tag_id in tags or {}:
        arm = {_of_tag(tag_id, AHEAD), _of_tag(tag_id, LEFT)}
        unknown |= arm & before.keys() if arm & unknown else set()
    told = {name: _rounded(value) for name, value in found.items() if name not in unknown}
    vehicle = start.model_copy(
        update={each: told[each] for each in (CLOCK, BIAS) if each in told}
        | {"tags": _with_found(start.tags, told, tags or {})}
    )
    return Calibration(vehicle, found, tuple(n for n in before if n in unknown), len(drives))


def average(values: Sequence[Known], usual: Known) -> Known:
    """Return the mean of estimates and of what is usual, each with its precision.

    Parameters
    ----------
    values
        Estimates that are independent.
    usual
        What is known without them.

    Returns
    -------
    Known
        With a standard error that is larger where the estimates scatter more than they say.

    Examples
    --------
    >>> average([Known(value=0.0, sigma=0.1), Known(value=1.0, sigma=0.1)], Known(value=0, sigma=9))
    Known(value=0.498..., sigma=0.499...)
    """
    if not values:
        return usual
    value, sigma = (
        np.array([getattr(each, part) for each in values]) for part in ("value", "sigma")
    )
    weight = sigma**-2.0
    mean = float(weight @ value / weight.sum())
    scatter = float(weight @ (value - mean) ** 2) / max(len(values) - 1, 1)
    weights = np.array([weight.sum() / max(scatter, 1.0), usual.sigma**-2.0])
    return Known(
        value=float(weights @ [mean, usual.value] / weights.sum()),
        sigma=float(weights.sum() ** -0.5),
    )


def drive_values(
    episodes: Sequence[Episode], config: PipelineConfig, places: ZonePlaces | None = None
) -> dict[str, Known]:
    """Return what drives of one vehicle that were located together say of it, but lever arms.

    Parameters
    ----------
    episodes
        With ``errors``: the tags of a drive, or passes of a zone. They count as one drive.
    config
        What was known before: its priors are taken out again.
    places
        What was found of these episodes, if of no others. It has the biases of tags together: they
        differ by much less than each of them is uncertain.
    """
    values: dict[str, Known] = {}
    shared = [e for e in episodes if e.tag is None or not e.tag.own_clock]
    if shared and shared[0].errors is not None and config.alignment.clock_offset == "auto":
        first, errors = shared[0], shared[0].errors
        applied_s = 0.0 if first.clock is None else first.clock.applied_s
        usual_s2 = config.alignment.clock_offset_sigma_s**2
        said = said_of(applied_s + errors.mean[2], errors.covariance[2, 2], 0.0, usual_s2)
        _add(values, CLOCK, said.value, said.sigma)
    biases = _biases(episodes, config)
    if not biases:
        return values
    value_m, sigma_m = np.array(list(biases.values())).T
    # Cones' own delays are the same for all tags, so that errors of the mean do not average out.
    bias_m, bias_sigma_m = float(value_m.mean()), float(sigma_m.mean())
    share = np.eye(len(biases)) - 1.0 / len(biases)
    covariance_m2 = np.diag(sigma_m**2)
    together = None if places is None else _biases_together(episodes, config, places)
    if together is not None and len(value_m) == len(episodes):
        value_m, covariance_m2 = together
        bias_m, bias_sigma_m = float(value_m.mean()), float(np.sqrt(covariance_m2.mean()))
    _add(values, BIAS, bias_m, bias_sigma_m)
    delays_m, sigmas_m = share @ value_m, np.sqrt(np.diag(share @ covariance_m2 @ share))
    for tag_id, delay_m, own_m in zip(biases, delays_m, sigmas_m, strict=True):
        if tag_id:
            _add(values, _of_tag(tag_id, DELAY), float(delay_m), float(own_m))
    return values


def usual_values(
    names: Sequence[str], config: PipelineConfig = PipelineConfig()
) -> dict[str, Known]:
    """Return what is usual of numbers of any vehicle; lever arms are not among them.

    Parameters
    ----------
    names
        Of the numbers.
    config
        ``alignment`` and ``calibration`` count.
    """
    sigmas = {CLOCK: config.alignment.clock_offset_sigma_s, BIAS: config.calibration.bias_sigma_m}
    return {name: Known(value=0.0, sigma=sigmas.get(name, TAG_BIAS_M)) for name in names}


def tag_of_value(name: str) -> tuple[str, str]:
    """Return the tag that a number is of, empty for none, and what it is.

    Parameters
    ----------
    name
        As in :class:`Calibration`.

    Examples
    --------
    >>> tag_of_value("tags.1.delay_m"), tag_of_value("range_bias_m")
    (('1', 'delay_m'), ('', 'range_bias_m'))
    """
    above, _, what = name.rpartition(".")
    return above.removeprefix("tags."), what


def _rounded(known: Known) -> Known:
    """Return a number as it is written: to tenths of millimetres and of milliseconds."""
    return Known(value=round(known.value, 4), sigma=max(round(known.sigma, 4), 1e-4))


def _of_tag(tag_id: str, what: str) -> str:
    return f"tags.{tag_id}.{what}"


def _add(values: dict[str, Known], name: str, value: float, sigma: float) -> None:
    if np.isfinite(sigma) and sigma > 0.0:
        values[name] = Known(value=value, sigma=sigma)


def _biases(episodes: Sequence[Episode], config: PipelineConfig) -> dict[str, tuple[float, float]]:
    """Return range bias and standard deviation by tag; nothing where one of them is not known."""
    found: dict[str, list[Said]] = {}
    both = [0, 3]  # of the radios, and what the tag adds
    for episode in episodes:
        errors = episode.errors
        if errors is None or config.calibration.range_bias == "off":
            return {}
        prior_m2 = config.calibration.bias_sigma_m**2
        prior_m2 += TAG_BIAS_M**2 if errors.covariance[3, 3] > _HELD_M2 else 0.0
        mean, variance = errors.mean[both].sum(), errors.covariance[np.ix_(both, both)].sum()
        said = said_of(float(mean), float(variance), 0.0, prior_m2)
        if not np.isfinite(said.sigma):
            return {}
        found.setdefault("" if episode.tag is None else episode.tag.tag_id, []).append(said)
    return {
        tag_id: (float(np.mean([x.value for x in said])), float(np.mean([x.sigma for x in said])))
        for tag_id, said in found.items()
    }


def _biases_together(
    episodes: Sequence[Episode], config: PipelineConfig, places: ZonePlaces
) -> tuple[Float64[Array, "K"], Float64[Array, "K K"]] | None:
    """Return range biases and their covariance, without what was known of them before."""
    if places.shared_covariance is None:
        return None
    usual, precision = shared_prior(episodes, config)
    pick = np.zeros((len(episodes), len(usual)))
    pick[:, 0] = 1.0
    tag = np.arange(len(episodes))
    pick[tag, RADIOS + 1 + DRIVE * tag] = 1.0  # of each drive's own, after the clock
    mean_m = np.array([errors.mean[[0, 3]].sum() for errors in places.errors])
    after = np.linalg.inv(pick @ places.shared_covariance @ pick.T)
    before = np.linalg.inv(pick @ np.linalg.inv(precision) @ pick.T)
    told = after - before
    if np.linalg.eigvalsh(told)[0] <= 0.0:
        return None
    covariance_m2 = np.linalg.inv(told)
    return covariance_m2 @ (after @ mean_m - before @ (pick @ usual)), covariance_m2


def _located(
    scene: Scene, known: Vehicle | None, levers_unknown: bool, config: PipelineConfig
) -> dict[str, Known]:
    """Return what one drive says, moving the lever arms of its tags to where the antennas are."""
    scene = scene.without_truth()
    sigmas = {tag.tag_id: _lever_sigma_m(tag.tag_id, known, levers_unknown) for tag in scene.tags}
    tags = {name: TagPrior(lever_sigma_m=sigma_m) for name, sigma_m in sigmas.items()}
    config = config.model_copy(update={"vehicles": {scene.vehicle: VehiclePrior(tags=tags)}})
    clock: ClockOffset | None = None
    for _ in range(_MOST_FITS):
        episodes = []
        for one in tag_scenes(scene):
            own_clock = bool(one.tags) and one.tags[0].own_clock
            episodes.append(align(one, config.alignment, clock=None if own_clock else clock))
            if clock is None and not own_clock:  # the first look at it, for all
                clock = episodes[-1].clock
        places = find_places([episodes], config)[0]
        if len(episodes) < 2:
            break
        moves_m = {
            e.tag.tag_id: -errors.mean[4:6]
            for e, errors in zip(episodes, places.errors, strict=True)
            if e.tag is not None
        }
        if max(np.abs(move_m).max() for move_m in moves_m.values()) < _RESTS_M:
            break
        scene = replace(scene, tags=tuple(_moved(tag, moves_m) for tag in scene.tags))
    located = [replace(e, errors=x) for e, x in zip(episodes, places.errors, strict=True)]
    values = drive_values(located, config, places)
    if len(episodes) > 1:
        for episode in located:
            values |= _lever_arm(episode, sigmas)
    return values


def _moved(tag: Tag, moves_m: Mapping[str, Float64[Array, "2"]]) -> Tag:
    if tag.tag_id not in moves_m:
        return tag
    ahead_m, left_m = moves_m[tag.tag_id].tolist()
    return replace(tag, forward_m=tag.forward_m + ahead_m, left_m=tag.left_m + left_m)


def _lever_arm(episode: Episode, sigmas: Mapping[str, float]) -> dict[str, Known]:
    """Return where a drive says that an antenna is."""
    tag, errors = episode.tag, episode.errors
    values: dict[str, Known] = {}
    if tag is None or errors is None:
        return values
    heading_m = np.abs(heading_sigma_m(episode))
    for part, (what, given_m) in enumerate(((AHEAD, tag.forward_m), (LEFT, tag.left_m))):
        prior_m2 = sigmas[tag.tag_id] ** 2 + PATTERN_M**2 + heading_m[part] ** 2
        found = float(errors.mean[4 + part]), float(errors.covariance[4 + part, 4 + part])
        said = said_of(*found, 0.0, float(prior_m2))
        # What a cone is nearer in a direction, the antenna is further that way.
        sigma_m = float(np.hypot(said.sigma, heading_m[part]))
        _add(values, _of_tag(tag.tag_id, what), given_m - said.value, sigma_m)
    return values


def _lever_sigma_m(tag_id: str, known: Vehicle | None, levers_unknown: bool) -> float:
    if levers_unknown:
        return _UNKNOWN_LEVER_M
    tag = None if known is None else known.tags.get(tag_id)
    return _LEVER_M if tag is None or tag.lever_sigma_m is None else tag.lever_sigma_m


def _before(
    drives: Sequence[Mapping[str, Known]],
    tags: Mapping[str, Tag],
    sigmas: Mapping[str, float],
    config: PipelineConfig,
) -> dict[str, Known]:
    """Return what was known of each number that is sought, before the drives."""
    names = [CLOCK, BIAS]
    names += [_of_tag(tag_id, DELAY) for tag_id in tags] if len(tags) > 1 else []
    before = usual_values(names, config)
    if any(AHEAD in name for drive in drives for name in drive):
        for tag_id, tag in tags.items():
            sigma_m = float(np.hypot(sigmas[tag_id], PATTERN_M))
            for what, given_m in ((AHEAD, tag.forward_m), (LEFT, tag.left_m)):
                before[_of_tag(tag_id, what)] = Known(value=given_m, sigma=sigma_m)
    return before


def _given(tag: Tag, known: VehicleTag | None) -> VehicleTag:
    """Return a tag as a log gives it, with what else is known of it."""
    place = {name: getattr(tag, name) for name in ("forward_m", "left_m", "up_m", "own_clock")}
    return (VehicleTag() if known is None else known).model_copy(update=place)


def _with_found(
    known: Mapping[str, VehicleTag], told: Mapping[str, Known], tags: Mapping[str, Tag]
) -> dict[str, VehicleTag]:
    """Return the tags of a vehicle with what was found of them."""
    found = dict(known)
    for tag_id, tag in tags.items():
        ahead, left = (told.get(_of_tag(tag_id, what)) for what in (AHEAD, LEFT))
        if ahead is not None and left is not None:
            arm = {
                "forward_m": round(ahead.value, 4),
                "left_m": round(left.value, 4),
                "lever_sigma_m": round(max(ahead.sigma, left.sigma), 4),
            }
            found[tag_id] = _given(tag, found.get(tag_id)).model_copy(update=arm)
    for name, value in told.items():
        tag_id, what = tag_of_value(name)
        if what == DELAY and tag_id in found:
            found[tag_id] = found[tag_id].model_copy(update={"delay_m": value})
    return found
