"""What can be done to a test's episodes to see what methods stand: the paper's robustness study.

"Robustness to Stressors": the work zone, the drive and the models stay as they are, and only what
is observed gets worse. The paper's four stressors, and three more: noise of the positions (its
future work), an offset of the clocks, and spans of time without ranges.

A stressor may use the truth to make data worse (the NLOS bias does); no method sees it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gaia_uwb._shared import Array, Bool, Float64, InputError
from gaia_uwb.episode import Episode

_OUTLIER_M = (3.0, 12.0)  # least and largest size of an added outlier


@dataclass(frozen=True)
class Stressor:
    """A way of making data worse.

    Parameters
    ----------
    name
        Its name in results.
    title
        What a setting means, with its unit, for people.
    settings
        From none at all to the most severe.
    apply
        Makes an episode worse: ``apply(episode, setting, rng)``.
    extra
        Whether it is ours and not the paper's.
    """

    name: str
    title: str
    settings: tuple[float, ...]
    apply: Callable[[Episode, float, np.random.Generator], Episode]
    extra: bool = False


def stress(
    episodes: Sequence[Episode], stressor: Stressor, setting: float, seed: int
) -> tuple[Episode, ...]:
    """Make episodes worse; each gets random numbers of its own.

    Parameters
    ----------
    episodes
        Any, with their truth.
    stressor
        What to do.
    setting
        How much of it.
    seed
        Of the random numbers. A setting has the same ones as a milder one, so that what grows is
        the stress and not the luck.
    """
    kind = [stressor.name == known.name for known in STRESSORS].index(True)
    return tuple(
        stressor.apply(episode, setting, np.random.default_rng([seed, kind, k]))
        for k, episode in enumerate(episodes)
    )


def add_range_noise(episode: Episode, sigma_m: float, rng: np.random.Generator) -> Episode:
    """Add white noise to the ranges.

    Parameters
    ----------
    episode
        Any.
    sigma_m
        Standard deviation, in metres.
    rng
        Source of the noise.
    """
    noise_m = sigma_m * rng.standard_normal(episode.range_m.shape)
    return _with_ranges(episode, episode.range_m + noise_m)


def add_outliers(episode: Episode, rate: float, rng: np.random.Generator) -> Episode:
    """Add an offset of 3 to 12 m, of either sign, to a share of the ranges.

    Parameters
    ----------
    episode
        Any.
    rate
        Probability of a range to become an outlier.
    rng
        Source of randomness.
    """
    shape = episode.range_m.shape
    hit = rng.random(shape) < rate
    size_m = rng.uniform(*_OUTLIER_M, shape) * rng.choice([-1.0, 1.0], shape)
    return _with_ranges(episode, episode.range_m + hit * size_m)


def scale_nlos_bias(episode: Episode, scale: float, rng: np.random.Generator) -> Episode:
    """Make the systematic error of ranges without line of sight larger.

    Parameters
    ----------
    episode
        With its truth, including the bias.
    scale
        1 leaves it as it is.
    rng
        Not used.

    Raises
    ------
    InputError
        If the bias is not known.
    """
    del rng
    truth = episode.truth
    if truth is None or truth.bias_m is None:
        raise InputError("expected an episode whose bias is known", source=episode.name)
    excess_m = (scale - 1.0) * truth.nlos * truth.bias_m
    return _with_ranges(episode, episode.range_m + excess_m)


def keep_anchors(episode: Episode, count: float, rng: np.random.Generator) -> Episode:
    """Silence all but some anchors, drawn at random; they keep their place in the arrays.

    Parameters
    ----------
    episode
        Any.
    count
        How many are kept.
    rng
        Source of the choice.
    """
    order = rng.permutation(episode.n_anchors)
    kept = np.zeros(episode.n_anchors, dtype=np.bool_)
    kept[order[: int(count)]] = True
    return _with_valid(episode, episode.valid & kept)


def add_position_noise(episode: Episode, sigma_m: float, rng: np.random.Generator) -> Episode:
    """Add white noise to both coordinates of the positions.

    Parameters
    ----------
    episode
        Any.
    sigma_m
        Standard deviation, in metres.
    rng
        Source of the noise.
    """
    noise_m = sigma_m * rng.standard_normal(episode.position_m.shape)
    return replace(episode, position_m=episode.position_m + noise_m)


def shift_clock(episode: Episode, offset_s: float, rng: np.random.Generator) -> Episode:
    """Let the ranges lag behind the positions; before the first one, the first one counts.

    Parameters
    ----------
    episode
        Any.
    offset_s
        How late a range is, in seconds.
    rng
        Not used.
    """
    del rng
    range_m = np.full(episode.range_m.shape, np.nan)
    for n in range(episode.n_anchors):
        own = episode.valid[:, n]
        if own.any():
            late_s = episode.t_s[own] - offset_s
            range_m[own, n] = np.interp(late_s, episode.t_s[own], episode.range_m[own, n])
    return _with_ranges(episode, range_m)


def drop_span(episode: Episode, share: float, rng: np.random.Generator) -> Episode:
    """Take the ranges of one stretch of time away, of each anchor another.

    Parameters
    ----------
    episode
        Any.
    share
        Length of the stretch, as a share of the episode.
    rng
        Source of where it begins.
    """
    steps = np.arange(episode.n_steps)[:, None]
    length = round(share * episode.n_steps)
    start = np.floor(rng.random(episode.n_anchors) * (episode.n_steps - length + 1))
    return _with_valid(episode, episode.valid & ((steps < start) | (steps >= start + length)))


def _with_ranges(episode: Episode, range_m: Float64[Array, "T N"]) -> Episode:
    return replace(episode, range_m=np.where(episode.valid, range_m, np.nan))


def _with_valid(episode: Episode, valid: Bool[Array, "T N"]) -> Episode:
    return replace(episode, range_m=np.where(valid, episode.range_m, np.nan), valid=valid)


STRESSORS = (
    Stressor("range-noise", "added range noise (m)", (0.0, 1.0, 2.0, 3.0, 4.0), add_range_noise),
    Stressor("outliers", "added outlier rate", (0.0, 0.05, 0.1, 0.15, 0.2), add_outliers),
    Stressor("nlos-bias", "NLOS bias, times", (1.0, 2.0, 3.0, 4.0, 5.0), scale_nlos_bias),
    Stressor("anchors", "anchors kept", (12.0, 10.0, 8.0, 6.0, 4.0), keep_anchors),
    Stressor(
        "position-noise",
        "noise of the positions (m)",
        (0.0, 0.1, 0.2, 0.5, 1.0),
        add_position_noise,
        extra=True,
    ),
    Stressor(
        "clock-offset", "clock offset (s)", (0.0, 0.1, 0.2, 0.3, 0.4), shift_clock, extra=True
    ),
    Stressor(
        "dropped-span",
        "share of the time without ranges",
        (0.0, 0.2, 0.4, 0.6, 0.8),
        drop_span,
        extra=True,
    ),
)
"""All stressors, the paper's four first, each with its settings in the order of their severity."""
