"""From ranges to both places of every anchor, with honest errors.

Ranges that err alike count as fewer: the likelihood is divided by the errors' correlation in time
before it meets a prior or compares two hypotheses. Two hypotheses are compared with the correlation
of the anchor's own residuals where that is more than the whole log's: a denoiser makes neighbours
alike, and one stretch without line of sight must not decide on the side. What slow errors amount to
(their variance times their correlation) is a property of the log and comes from its calibration
(``calibration.py``): a short window cannot tell slow errors from the anchor's place, and no
smoothing makes them smaller.

The covariance adds four things that are independent of each other: the sandwich of the anchor's
own ranges, what the calibrated range bias may still be off, what the clock offset may still be
off, and a floor that no number of ranges improves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gaia_uwb._shared import Array, Bool, Float64, Int64
from gaia_uwb.config import SolverConfig
from gaia_uwb.denoised import DenoisedRanges
from gaia_uwb.episode import Episode
from gaia_uwb.locate.honest_errors import Curves, own_inflation, path_centres, square_root
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


@dataclass(frozen=True)
class RangeErrors:
    """What each anchor's better hypothesis leaves of its ranges.

    Parameters
    ----------
    scale : (N,)
        Their standard deviation as a multiple of ``sigma_m``; NaN where nothing was located.
    steps_worth_one : (N,)
        How many ranges are worth one independent range of that standard deviation, at least 1.
    """

    scale: Float64[Array, "N"]
    steps_worth_one: Float64[Array, "N"]


@dataclass(frozen=True)
class Hypotheses:
    """Both places of each anchor of one episode, the better-fitting first.

    Parameters
    ----------
    position_m : (N, 2, 2)
        Anchor, hypothesis, (east, north); NaN where an anchor has too few ranges.
    covariance_m2 : (N, 2, 2, 2)
        Covariance of each place.
    log_odds : (N,)
        How much better the first fits, as a difference of log likelihoods after allowing for
        correlated errors; at least 0.
    own_bias_m : (N,)
        Range bias of each anchor in addition to what the calibration removed (measured minus true).
    n_ranges : (N,)
        Usable ranges.
    converged : (N,)
        Whether both refinements converged.
    shared_m : (N, 2, 2, 3), optional
        The part of the errors that is one and the same for all anchors: by how much each place
        moves with one standard deviation of each of three independent things (two of the
        calibrated range bias, one of the clock). ``shared_m @ shared_m^T`` is in
        ``covariance_m2``.
    inflation : (N,), optional
        How many times larger than ``covariance_m2`` says each anchor's squared error is, for what
        is peculiar to this anchor (``honest_errors.py``).
    centre_m : (N, 2), optional
        The middle of the stretch of path from which each anchor was ranged.
    errors
        What the ranges of one pass leave; ``None`` where several passes were fused.
    """

    position_m: Float64[Array, "N 2 2"]
    covariance_m2: Float64[Array, "N 2 2 2"]
    log_odds: Float64[Array, "N"]
    own_bias_m: Float64[Array, "N"]
    n_ranges: Int64[Array, "N"]
    converged: Bool[Array, "N"]
    shared_m: Float64[Array, "N 2 2 3"] | None = None
    inflation: Float64[Array, "N"] | None = None
    centre_m: Float64[Array, "N 2"] | None = None
    errors: RangeErrors | None = None

    def factor(self) -> Float64[Array, "N 1 1"]:
        """Return ``inflation``, or 1 where it is unknown, to multiply covariances with."""
        known = np.ones(len(self.log_odds)) if self.inflation is None else self.inflation
        return known[:, None, None]

    def curves(self, side: Int64[Array, "N"]) -> Curves | None:
        """Return along what curves the places on the given sides err; None where unknown."""
        if self.centre_m is None:
            return None
        rows = np.arange(len(side))
        covariance_m2 = self.covariance_m2[rows, side] * self.factor()
        place_m, mirror_m = self.position_m[rows, side], self.position_m[rows, 1 - side]
        return Curves.of(place_m, mirror_m, covariance_m2, self.centre_m)

    def honest_covariance(
        self, covariance_m2: Float64[Array, "N 2 2"], side: Int64[Array, "N"]
    ) -> Float64[Array, "N 2 2"]:
        """Return what is reported of places with linear covariances (``honest_errors.py``)."""
        covariance_m2 = covariance_m2 * self.factor()
        curves = self.curves(side)
        return covariance_m2 if curves is None else curves.covariance_m2(covariance_m2)


def locate(
    episodes: Sequence[Episode],
    ranges: Sequence[DenoisedRanges],
    config: SolverConfig = SolverConfig(),
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
        Settings of the solver.
    nlos
        NLOS labels for the paper's weights (``wls`` only); without them all weights are 1.

    Returns
    -------
    list of Hypotheses
        One per episode, in their order; each is what the episode alone would give.

    Raises
    ------
    ValueError
        If the numbers of episodes, ranges and labels differ, or labels are given to ``robust``.
    """
    if len(ranges) != len(episodes) or (nlos is not None and len(nlos) != len(episodes)):
        raise ValueError("expected as many denoised ranges and labels as episodes")
    if nlos is not None and config.kind == "robust":
        raise ValueError("the robust solver takes no NLOS labels")
    found: dict[int, Hypotheses] = {}
    groups: dict[tuple[int, int, int], list[int]] = {}
    for k, episode in enumerate(episodes):
        lag = correlation_lag(episode, config.error_correlation_s)
        groups.setdefault((episode.n_steps, episode.n_anchors, lag), []).append(k)
    for (_, _, lag), members in groups.items():
        labels = None if nlos is None else [nlos[k] for k in members]
        batch = [episodes[k] for k in members]
        solved = _locate_batch(batch, [ranges[k] for k in members], labels, lag, config)
        found.update(
            (k, _with_own_errors(episodes[k], places, config))
            for k, places in zip(members, solved, strict=True)
        )
    return [found[k] for k in range(len(episodes))]


def _locate_batch(
    episodes: list[Episode],
    ranges: list[DenoisedRanges],
    nlos: list[Bool[Array, "T N"]] | None,
    lag: int,
    config: SolverConfig,
) -> list[Hypotheses]:
    robust = config.kind == "robust"
    options = SolverOptions(
        dof=config.student_t_dof if robust else 0.0, max_lag=lag, min_ranges=config.min_ranges
    )
    sigma = [r.sigma_m for r in ranges] if robust else _paper_sigma(ranges, nlos)
    correlation = np.array(
        [1.0 if e.calibration is None else e.calibration.correlation for e in episodes]
    )
    # The likelihood takes correlated ranges for independent ones; a prior that is as much stronger
    # keeps the balance between the two.
    bias_sigma_m = (config.anchor_bias_sigma_m if robust else 0.0) / np.sqrt(correlation)
    parts = []
    for chunk in chunks(episodes, [r.range_m for r in ranges], sigma):
        solutions = chunk.solve(options, bias_sigma_m)
        worth = _steps_worth_one(episodes, chunk, solutions)
        sides = [
            _covariance(episodes, chunk, solutions, side, bias_sigma_m, worth[..., side], config)
            for side in (0, 1)
        ]
        stacked = (np.stack(part, axis=2) for part in zip(*sides, strict=True))
        parts.append(_Part(solutions, *stacked))
    return [_hypotheses(parts, b, float(correlation[b])) for b in range(len(episodes))]


def _with_own_errors(episode: Episode, found: Hypotheses, config: SolverConfig) -> Hypotheses:
    """Add what the linear covariance leaves out."""
    inflation = own_inflation(
        episode, found.position_m, found.own_bias_m, config.error_correlation_s
    )
    return replace(found, inflation=inflation, centre_m=path_centres(episode))


@dataclass(frozen=True)
class _Part:
    solutions: Solutions
    covariance_m2: Float64[Array, "B n 2 2 2"]
    shared_m: Float64[Array, "B n 2 2 3"]
    steps_worth_one: Float64[Array, "B n 2"]


def _steps_worth_one(
    episodes: list[Episode], chunk: Chunk, solutions: Solutions
) -> Float64[Array, "B n 2"]:
    """Return how many ranges are worth one independent range of the noise that the solver saw."""
    worth = np.ones(solutions.scale.shape)
    known = np.isfinite(chunk.sigma_m)
    sigma_m = np.where(known, chunk.sigma_m, 0.0).sum(axis=-1) / np.maximum(known.sum(axis=-1), 1)
    for b, episode in enumerate(episodes):
        if episode.calibration is not None:
            noise_m = np.nan_to_num(solutions.scale[b] * sigma_m[b][:, None], nan=np.inf)
            ratio = episode.calibration.sigma_m / np.maximum(noise_m, 1e-9)
            worth[b] = episode.calibration.correlation * np.maximum(ratio, 1.0) ** 2
    return worth


def _paper_sigma(
    ranges: list[DenoisedRanges], nlos: list[Bool[Array, "T N"]] | None
) -> list[Float64[Array, "T N"]]:
    """Return the standard deviations that stand for the paper's weights 1 and 0.2."""
    sigma = [np.where(r.valid, 1.0, np.nan) for r in ranges]
    if nlos is not None:
        for one, label in zip(sigma, nlos, strict=True):
            one[label] /= np.sqrt(_NLOS_WEIGHT)
    return sigma


def _covariance(
    episodes: list[Episode],
    chunk: Chunk,
    solutions: Solutions,
    side: int,
    bias_sigma_m: Float64[Array, "B"],
    worth: Float64[Array, "B n"],
    config: SolverConfig,
) -> tuple[Float64[Array, "B n 2 2"], Float64[Array, "B n 2 3"], Float64[Array, "B n"]]:
    """Return one hypothesis's honest covariance, its shared part and how many ranges count as one.

    See the module's text; the second is how the place moves with what all anchors share.
    """
    precision = np.zeros_like(bias_sigma_m)
    np.divide(1.0, bias_sigma_m**2, out=precision, where=bias_sigma_m > 0)
    sides = np.full(solutions.n_ranges.shape, side)
    dof = config.student_t_dof if config.kind == "robust" else 0.0
    sums = normal_sums(chunk, solutions, sides, dof)
    inverse = np.linalg.inv(with_prior(sums.jj, precision))
    long_run = np.nan_to_num(solutions.long_run[:, :, side])
    inflation = np.einsum("bnij,bnji->bn", inverse[..., :2, :2], long_run[..., :2, :2]) / 2.0
    # A short window's own long-run variance comes out low; what the log knows is a floor.
    short = np.maximum(worth / np.maximum(inflation, 1e-12), 1.0)
    long_run = long_run * short[..., None, None]
    long_run[..., 2, 2] += precision[:, None] * worth
    total = (inverse @ long_run @ inverse)[..., :2, :2]
    moved = inverse @ sums.jx  # how the place moves with the shared bias and the clock offset
    shared, clock = moved[..., :2, :2], moved[..., :2, 2]
    unsure = np.stack(
        [np.zeros((2, 2)) if e.calibration is None else e.calibration.covariance for e in episodes]
    )
    sigma_s = np.array([0.0 if e.clock is None else e.clock.sigma_s for e in episodes])
    total = total + shared @ unsure[:, None] @ np.swapaxes(shared, -1, -2)
    total += clock[..., :, None] * clock[..., None, :] * sigma_s[:, None, None, None] ** 2
    total += config.position_floor_m**2 * np.eye(2)
    total[~np.isfinite(solutions.position_m[:, :, side, 0])] = np.nan
    factors = [
        shared @ square_root(unsure)[:, None],
        clock[..., None] * sigma_s[:, None, None, None],
    ]
    total = 0.5 * (total + np.swapaxes(total, -1, -2))
    return total, np.concatenate(factors, axis=-1), np.fmax(inflation * short, 1.0)


def _hypotheses(parts: list[_Part], b: int, correlation: float) -> Hypotheses:
    """Collect one episode's anchors from the chunks, the better-fitting hypothesis first."""
    fit = np.concatenate([p.solutions.negative_log_likelihood[b] for p in parts])
    first = np.argmin(np.nan_to_num(fit, nan=np.inf), axis=1)
    order = np.stack([first, 1 - first], axis=1)
    rows = np.arange(len(fit))[:, None]
    odds = fit[rows[:, 0], order[:, 1]] - fit[rows[:, 0], order[:, 0]]
    position = np.concatenate([p.solutions.position_m[b] for p in parts])
    covariance = np.concatenate([p.covariance_m2[b] for p in parts])
    shared = np.concatenate([p.shared_m[b] for p in parts])
    bias = np.concatenate([p.solutions.bias_m[b] for p in parts])
    alike = np.concatenate([p.solutions.correlation[b] for p in parts])[rows[:, 0], first]
    worth = np.concatenate([p.steps_worth_one[b] for p in parts])[rows[:, 0], first]
    scale = np.concatenate([p.solutions.scale[b] for p in parts])[rows[:, 0], first]
    return Hypotheses(
        position_m=position[rows, order],
        covariance_m2=covariance[rows, order],
        log_odds=np.nan_to_num(odds / np.fmax(alike, correlation), nan=0.0),
        own_bias_m=np.nan_to_num(bias[rows[:, 0], first], nan=0.0),
        n_ranges=np.concatenate([p.solutions.n_ranges[b] for p in parts]),
        converged=np.concatenate([p.solutions.converged[b].all(axis=1) for p in parts]),
        shared_m=shared[rows, order],
        errors=RangeErrors(scale, np.fmax(worth, np.fmax(alike, correlation))),
    )
