"""The paper's solver ``wls``: weighted least squares, every anchor by itself.

Ranges are weighted by their true labels, 1 with and 0.2 without line of sight, or all alike. It is
here for the paper's tables; GAIA locates with ``zone_places.py``.

The covariance adds three things that are independent of each other: the sandwich of the anchor's
own ranges, whose neighbours err alike; what the calibrated range bias and the clock offset may
still be off; and a floor that no number of ranges improves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gaia_uwb._shared import Array, Bool, Float64
from gaia_uwb.config import SolverConfig
from gaia_uwb.denoised import DenoisedRanges
from gaia_uwb.episode import Episode
from gaia_uwb.locate.honest_errors import path_centres, square_root
from gaia_uwb.locate.hypotheses import Hypotheses
from gaia_uwb.solver import (
    Chunk,
    Solutions,
    SolverOptions,
    chunks,
    correlation_lag,
    normal_sums,
    with_prior,
)

_NLOS_WEIGHT = 0.2  # the paper's omega for ranges without line of sight


def locate(
    episodes: Sequence[Episode],
    ranges: Sequence[DenoisedRanges],
    config: SolverConfig = SolverConfig(kind="wls"),
    *,
    nlos: Sequence[Bool[Array, "_ _"]] | None = None,
) -> list[Hypotheses]:
    """Locate every anchor of every episode; episodes of one shape are solved together.

    Parameters
    ----------
    episodes
        Paths and heights.
    ranges
        What a denoiser made of each episode.
    config
        ``min_ranges``, ``error_correlation_s`` and ``position_floor_m``.
    nlos
        True NLOS labels for the paper's weights; without them all weights are 1.

    Returns
    -------
    list of Hypotheses
        One per episode, in their order; each is what the episode alone would give.

    Raises
    ------
    ValueError
        If the numbers of episodes, ranges and labels differ.

    Examples
    --------
    >>> t_s = np.arange(100) * 0.1
    >>> path_m = np.stack([4.0 * t_s, 3.0 * np.sin(t_s)], axis=1)
    >>> range_m = np.linalg.norm(path_m - [20.0, 9.0], axis=1)[:, None]
    >>> valid = np.ones((100, 1), dtype=bool)
    >>> episode = Episode("pass", ("cone",), t_s, path_m, range_m, valid)
    >>> ranges = DenoisedRanges(range_m, np.full((100, 1), 0.1), valid)
    >>> locate([episode], [ranges])[0].position_m[0, 0].round(3).tolist()
    [20.0, 9.0]
    """
    if len(ranges) != len(episodes) or (nlos is not None and len(nlos) != len(episodes)):
        raise ValueError("expected as many denoised ranges and labels as episodes")
    found: dict[int, Hypotheses] = {}
    groups: dict[tuple[int, int, int], list[int]] = {}
    for k, episode in enumerate(episodes):
        lag = correlation_lag(episode, config.error_correlation_s)
        groups.setdefault((episode.n_steps, episode.n_anchors, lag), []).append(k)
    for (_, _, lag), members in groups.items():
        labels = None if nlos is None else [nlos[k] for k in members]
        batch = [episodes[k] for k in members]
        solved = _locate_batch(batch, [ranges[k] for k in members], labels, lag, config)
        found.update(zip(members, solved, strict=True))
    return [found[k] for k in range(len(episodes))]


def _locate_batch(
    episodes: list[Episode],
    ranges: list[DenoisedRanges],
    nlos: list[Bool[Array, "T N"]] | None,
    lag: int,
    config: SolverConfig,
) -> list[Hypotheses]:
    options = SolverOptions(dof=0.0, max_lag=lag, min_ranges=config.min_ranges)
    unsure = _unsure(episodes)
    parts = []
    for chunk in chunks(episodes, [r.range_m for r in ranges], _paper_sigma(ranges, nlos)):
        solutions = chunk.solve(options, np.zeros(len(episodes)))
        sides = [_errors(chunk, solutions, side, unsure, config) for side in (0, 1)]
        covariance_m2, shared_m = (np.stack(part, axis=2) for part in zip(*sides, strict=True))
        parts.append(_Part(solutions, covariance_m2, shared_m))
    return [_hypotheses(episode, parts, b) for b, episode in enumerate(episodes)]


@dataclass(frozen=True)
class _Part:
    solutions: Solutions
    covariance_m2: Float64[Array, "B n 2 2 2"]
    shared_m: Float64[Array, "B n 2 2 3"]


def _paper_sigma(
    ranges: list[DenoisedRanges], nlos: list[Bool[Array, "T N"]] | None
) -> list[Float64[Array, "T N"]]:
    """Return the standard deviations that stand for the paper's weights 1 and 0.2."""
    sigma = [np.where(r.valid, 1.0, np.nan) for r in ranges]
    if nlos is not None:
        for one, label in zip(sigma, nlos, strict=True):
            one[label] /= np.sqrt(_NLOS_WEIGHT)
    return sigma


def _unsure(episodes: list[Episode]) -> Float64[Array, "B 3 3"]:
    """Return the covariances of what all anchors share: range bias, its growth, clock offset."""
    out = np.zeros((len(episodes), 3, 3))
    for b, episode in enumerate(episodes):
        if episode.calibration is not None:
            out[b, :2, :2] = episode.calibration.covariance
        if episode.clock is not None:
            out[b, 2, 2] = episode.clock.sigma_s**2
    return out


def _errors(
    chunk: Chunk,
    solutions: Solutions,
    side: int,
    unsure: Float64[Array, "B 3 3"],
    config: SolverConfig,
) -> tuple[Float64[Array, "B n 2 2"], Float64[Array, "B n 2 3"]]:
    """Return the covariance of one hypothesis of each anchor, and the part of it that is shared."""
    sums = normal_sums(chunk, solutions, np.full(solutions.n_ranges.shape, side), 0.0)
    inverse = np.linalg.inv(with_prior(sums.jj, np.zeros(len(unsure))))[..., :2, :2]
    long_run = np.nan_to_num(solutions.long_run[:, :, side, :2, :2])
    alike = np.einsum("bnij,bnji->bn", inverse, long_run) / 2.0
    # A short window's own long-run variance comes out low: no errors are better than white noise.
    long_run = long_run * np.maximum(1.0 / np.maximum(alike, 1e-12), 1.0)[..., None, None]
    shared_m = inverse @ sums.jx[..., :2, :] @ square_root(unsure)[:, None]
    total = inverse @ long_run @ inverse + shared_m @ np.swapaxes(shared_m, -1, -2)
    total += config.position_floor_m**2 * np.eye(2)
    total[~np.isfinite(solutions.position_m[:, :, side, 0])] = np.nan
    return 0.5 * (total + np.swapaxes(total, -1, -2)), shared_m


def _hypotheses(episode: Episode, parts: list[_Part], b: int) -> Hypotheses:
    """Collect one episode's anchors from the chunks, the better-fitting hypothesis first."""
    fit = np.concatenate([p.solutions.negative_log_likelihood[b] for p in parts])
    first = np.argmin(np.nan_to_num(fit, nan=np.inf), axis=1)
    order = np.stack([first, 1 - first], axis=1)
    rows = np.arange(len(fit))[:, None]
    odds = fit[rows[:, 0], order[:, 1]] - fit[rows[:, 0], order[:, 0]]
    alike = np.concatenate([p.solutions.correlation[b] for p in parts])[rows[:, 0], first]
    return Hypotheses(
        position_m=np.concatenate([p.solutions.position_m[b] for p in parts])[rows, order],
        covariance_m2=np.concatenate([p.covariance_m2[b] for p in parts])[rows, order],
        log_odds=np.nan_to_num(odds / alike, nan=0.0),  # ranges that err alike count as fewer
        own_bias_m=np.zeros(len(fit)),
        n_ranges=np.concatenate([p.solutions.n_ranges[b] for p in parts]),
        converged=np.concatenate([p.solutions.converged[b].all(axis=1) for p in parts]),
        fits=np.ones(len(fit), dtype=np.bool_),
        shared_m=np.concatenate([p.shared_m[b] for p in parts])[rows, order],
        centre_m=path_centres(episode),
    )
