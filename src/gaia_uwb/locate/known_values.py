"""What is known of a vehicle beside what its drives say: a value that contradicts is told.

A fit draws a known value and what the ranges say of it together. Taken apart again, they are two
estimates, and they contradict each other where they differ by more than :data:`MOST_PULL` standard
deviations of their difference. That is the pull of particle physics,
``|posterior - prior| / sqrt(prior variance - posterior variance)``.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gaia_uwb._shared import Array, Float64
from gaia_uwb.config import PipelineConfig, VehiclePrior
from gaia_uwb.episode import DriveErrors, Episode
from gaia_uwb.estimate import Reason, ReasonKind
from gaia_uwb.locate.common_prior import known_clock, known_of, known_tag, shared_prior
from gaia_uwb.locate.slow_errors import DRIVE, RADIOS
from gaia_uwb.locate.zone_places import find_places

MOST_PULL = 4.0
"""Standard deviations by which a log may differ from what is known of its vehicle."""

_BIAS, _CLOCK, _DELAY, _AHEAD, _LEFT = 0, 2, 3, 4, 5  # in DriveErrors
_TOLD = 1e-6  # of the prior's variance that a log takes away, at least, where it tells anything
_RESTS = 0.03  # standard deviations within which a fit has come to rest


@dataclass(frozen=True)
class Said:
    """What the ranges say of one number, without what was known before.

    Parameters
    ----------
    value, sigma
        The number and its standard deviation; that is infinite where they say nothing.
    pull
        How many standard deviations it is from what was known, a fit's own unrest counted.
    """

    value: float
    sigma: float
    pull: float


def said_of(mean: float, variance: float, prior_mean: float, prior_variance: float) -> Said:
    """Take what was known before out of an estimate.

    Parameters
    ----------
    mean, variance
        The estimate that comes of both.
    prior_mean, prior_variance
        What was known before.

    Examples
    --------
    >>> said_of(1.0, 0.75, 0.0, 1.0)
    Said(value=4.0, sigma=1.7320508075688772, pull=1.99...)
    """
    told = prior_variance - variance
    if told <= _TOLD * prior_variance:
        return Said(prior_mean, np.inf, 0.0)
    value = prior_mean + (mean - prior_mean) * prior_variance / told
    sigma = float(np.sqrt(variance * prior_variance / told))
    pull = abs(mean - prior_mean) / np.sqrt(told + _RESTS**2 * variance)
    return Said(float(value), sigma, float(pull))


def contradicted_values(
    episodes: Sequence[Episode], errors: Sequence[DriveErrors], config: PipelineConfig
) -> Iterator[Reason]:
    """Say where drives contradict what is known of their vehicles; of each value the worst case.

    Parameters
    ----------
    episodes
        All drives past a zone, or the tags of drives, as they were given to ``find_places``.
    errors
        What it found of each.
    config
        ``vehicles`` holds what is known.

    Yields
    ------
    Reason
        With both values and their standard deviations.
    """
    if not config.vehicles:
        return
    known = _blocks(episodes, config)
    one_vehicle = len({episode.vehicle for episode in episodes}) == 1
    worst: dict[tuple[str, str], tuple[float, int, _Value]] = {}
    for k, episode in enumerate(episodes):
        for value in _known_values(episode, config, one_vehicle):
            key, pull = (episode.vehicle, value.name), value.said(errors[k], known[k]).pull
            if pull > max(MOST_PULL, worst.get(key, (0.0,))[0]):
                worst[key] = pull, k, value
    if not worst:
        return
    # A fit that had to believe what is wrong does not say well what would be right.
    wrong = [(episodes[k].vehicle, value.setting) for _, k, value in worst.values()]
    free = _without(wrong, config)
    usual = _blocks(episodes, free)
    found = find_places([episodes], free)[0].errors
    for pull, k, value in worst.values():
        said = replace(value.said(found[k], usual[k]), pull=pull)
        yield value.reason(episodes[k], said, *value.of(*known[k]))


def _without(
    wrong: Sequence[tuple[str, tuple[str, ...]]], config: PipelineConfig
) -> PipelineConfig:
    """Return settings that do not know some values of some vehicles."""
    content = {name: known.model_dump() for name, known in config.vehicles.items()}
    for vehicle, (*above, last) in wrong:
        known = content[vehicle]
        for key in above:
            known = known[key]
        known[last] = None
    vehicles = {name: VehiclePrior.model_validate(known) for name, known in content.items()}
    return config.model_copy(update={"vehicles": vehicles})


def _blocks(
    episodes: Sequence[Episode], config: PipelineConfig
) -> list[tuple[Float64[Array, "8"], Float64[Array, "8 8"]]]:
    """Return mean and covariance of each drive's errors before its readings."""
    mean, precision = shared_prior(episodes, config)
    covariance = np.linalg.inv(precision)
    columns = [
        np.concatenate([np.arange(RADIOS), RADIOS + DRIVE * k + np.arange(DRIVE)])
        for k in range(len(episodes))
    ]
    return [(mean[own], covariance[np.ix_(own, own)]) for own in columns]


@dataclass(frozen=True)
class _Value:
    """A known number as a sum of entries of :class:`DriveErrors`, and how people see it.

    ``setting`` is where it stands in a :class:`~gaia_uwb.config.VehiclePrior`.
    """

    name: str
    setting: tuple[str, ...]
    entries: tuple[int, ...]
    unit: str = "m"
    sign: float = 1.0
    zero: float = 0.0

    def of(
        self, mean: Float64[Array, "8"], covariance: Float64[Array, "8 8"]
    ) -> tuple[float, float]:
        """Return mean and variance."""
        entries = list(self.entries)
        return float(mean[entries].sum()), float(covariance[np.ix_(entries, entries)].sum())

    def said(
        self, found: DriveErrors, before: tuple[Float64[Array, "8"], Float64[Array, "8 8"]]
    ) -> Said:
        """Return what the ranges say."""
        return said_of(*self.of(found.mean, found.covariance), *self.of(*before))

    def reason(self, episode: Episode, said: Said, known: float, variance: float) -> Reason:
        """Return the contradiction in words."""
        whose = f"vehicle {episode.vehicle}" if episode.vehicle else "the vehicle"
        known, value = (self.zero + self.sign * number for number in (known, said.value))
        sigma = float(np.sqrt(variance))
        text = (
            f"{self.name}: {known:+.3f} ± {sigma:.3f} {self.unit} is known of {whose}, but these "
            f"ranges say {value:+.3f} ± {said.sigma:.3f} {self.unit}: is it this vehicle, and is "
            "nothing changed on it?"
        )
        numbers = {
            "known": known,
            "known_sigma": sigma,
            "said": value,
            "said_sigma": said.sigma,
            "pull": said.pull,
        }
        return Reason(ReasonKind.VEHICLE, text, passes=(episode.name,), numbers=numbers)


def _known_values(episode: Episode, config: PipelineConfig, one_vehicle: bool) -> Iterator[_Value]:
    """Yield what is known of a drive's vehicle.

    Where others are in the zone, too, a bias is told from theirs only with that of the tag.
    """
    applied_s = 0.0 if episode.clock is None else episode.clock.applied_s
    if known_clock(episode, config) is not None and config.alignment.clock_offset == "auto":
        yield _Value("clock offset", ("clock_offset_s",), (_CLOCK,), "s", zero=applied_s)
    tag_id, tag = known_tag(episode, config)
    of_tag = f" of tag {tag_id}" if tag_id else ""
    if config.calibration.range_bias == "auto":
        if known_of(episode, config).range_bias_m is not None:
            name = "range bias" if one_vehicle else f"range bias{of_tag}"
            yield _Value(name, ("range_bias_m",), (_BIAS,) if one_vehicle else (_BIAS, _DELAY))
        if tag.delay_m is not None and one_vehicle:
            yield _Value(f"delay{of_tag}", ("tags", tag_id, "delay_m"), (_DELAY,))
    if tag.lever_sigma_m is not None and episode.tag is not None:
        # What the antenna is from its lever arm shortens the ranges in that direction.
        place, setting = episode.tag, ("tags", tag_id, "lever_sigma_m")
        yield _Value(f"forward_m{of_tag}", setting, (_AHEAD,), sign=-1.0, zero=place.forward_m)
        yield _Value(f"left_m{of_tag}", setting, (_LEFT,), sign=-1.0, zero=place.left_m)
