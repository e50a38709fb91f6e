"""What is known of a drive before it, in two parts: its vehicle's, which stays, and its own.

The prior of several drives (``common_prior.py``) has clocks, biases and patterns of tags that are
alike where a vehicle is the same. That is exactly ``phi_k = mean_k + u_v + own_k`` with one ``u_v``
for all drives of a tag and an independent ``own_k`` for each of them. Both covariances are read off
the prior of a drive and a copy of it: what the two have in common is ``u_v``'s.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gaia_uwb._shared import Array, Float64
from gaia_uwb.config import PipelineConfig
from gaia_uwb.episode import Episode
from gaia_uwb.locate.common_prior import shared_prior
from gaia_uwb.locate.slow_errors import DRIVE, RADIOS

_LEAST = 1e-12  # variance of what is known for certain, in square metres and seconds


@dataclass(frozen=True)
class DrivePrior:
    """What is known of a drive with T tags before it, and how much of it is the drive's own.

    Parameters
    ----------
    mean : (6 T,)
        Of what each tag has by itself: clock offset that is left, bias and pattern.
    own : (6 T, 6 T)
        Covariance of that part of it which no other drive has.
    """

    mean: Float64[Array, "P"]
    own: Float64[Array, "P P"]


def vehicle_of(episode: Episode) -> str:
    """Return a name for all that has the clock, the tag and its pattern of this episode.

    Parameters
    ----------
    episode
        Of one tag.
    """
    return f"{episode.vehicle}\n{'' if episode.tag is None else episode.tag.tag_id}"


def drive_prior(episodes: Sequence[Episode], first: Episode, config: PipelineConfig) -> DrivePrior:
    """Return what is known of a drive before it.

    Parameters
    ----------
    episodes
        Of each of its tags.
    first
        Of the first tag of the zone: biases count from its vehicle's.
    config
        As in :func:`shared_prior`.
    """
    t = len(episodes)
    several = [_copy(first, 0), *episodes, *(_copy(each, 1) for each in episodes)]
    mean, precision = shared_prior(several, config)
    variance = np.linalg.inv(precision)
    mine = RADIOS + DRIVE + np.arange(DRIVE * t)
    again = mine + DRIVE * t
    own = variance[np.ix_(mine, mine)] - variance[np.ix_(mine, again)]
    return DrivePrior(mean[mine], 0.5 * (own + own.T) + _LEAST * np.eye(len(own)))


def lasting_prior(
    vehicles: Sequence[Episode], config: PipelineConfig
) -> tuple[Float64[Array, "2"], Float64[Array, "V V"]]:
    """Return what is known before any drive of what stays from drive to drive.

    Parameters
    ----------
    vehicles
        One episode for each tag of each vehicle, that of the zone's first drive first.
    config
        As in :func:`shared_prior`.

    Returns
    -------
    mean, precision : (2,), (V, V)
        Mean of bias and growth of the radios; precision of these and of what each of G tags keeps,
        which is 0 in the mean; V = 2 + 6 G.
    """
    size = DRIVE * len(vehicles)
    several = [*vehicles, *(_copy(each, 1) for each in vehicles)]
    mean, precision = shared_prior(several, config)
    found = np.linalg.inv(precision)
    radios, one = np.arange(RADIOS), RADIOS + np.arange(size)
    variance = np.zeros((RADIOS + size, RADIOS + size))
    variance[:RADIOS, :RADIOS] = found[:RADIOS, :RADIOS]
    variance[RADIOS:, :RADIOS] = found[np.ix_(one + size, radios)]
    variance[:RADIOS, RADIOS:] = variance[RADIOS:, :RADIOS].T
    together = found[np.ix_(one, one + size)]
    variance[RADIOS:, RADIOS:] = 0.5 * (together + together.T) + _LEAST * np.eye(size)
    return mean[:RADIOS], np.linalg.inv(variance)


def _copy(episode: Episode, number: int) -> Episode:
    """Return the same of another drive."""
    drive = f"{episode.drive}\n{number}" if episode.drive else ""
    return replace(episode, name=f"{episode.name}\n{number}", drive=drive)
