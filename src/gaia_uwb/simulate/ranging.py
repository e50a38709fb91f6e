"""What the radio reports of the anchors: polls, answers, and ranges with their errors.

The errors come in the order in which they arise: a bias of distance, drift and lost line of sight;
noise that grows with distance; bursts of a few polls that share a spike's offset; polls that get no
answer; answers that repeat the one before.

Every random number belongs to one anchor and comes in the order of the anchors, so that one more
anchor leaves the others' readings as they are.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from gaia_uwb._shared import Array, Bool, Float64, Int64
from gaia_uwb.episode import bias_basis
from gaia_uwb.simulate.chains import Column, at_steps, correlated, two_state
from gaia_uwb.simulate.rows import SectionRows, at
from gaia_uwb.simulate.settings import RangingConfig
from gaia_uwb.simulate.streams import RowStreams, Stream

RangingSettings: TypeAlias = RangingConfig | SectionRows
"""Settings of the ranging: of all rows, or of each."""


@dataclass(frozen=True)
class Reports:
    """What became of every poll, with its truth.

    Parameters
    ----------
    answered : (N, P)
        True where a reading was reported; elsewhere the other arrays mean nothing.
    range_m : (N, P)
        Reported slant ranges, in metres.
    nlos : (N, P)
        True where there was no line of sight.
    bias_m : (N, P)
        The part of the error that is neither noise nor a burst's offset, in metres.
    outlier : (N, P)
        True where a burst's offset is in the reported range.
    """

    answered: Bool[Array, "N P"]
    range_m: Float64[Array, "N P"]
    nlos: Bool[Array, "N P"]
    bias_m: Float64[Array, "N P"]
    outlier: Bool[Array, "N P"]


def simulate_reports(
    true_range_m: Float64[Array, "N P"],
    cut: Bool[Array, "N P"],
    step_s: float,
    settings: RangingConfig,
    stream: Stream,
) -> Reports:
    """Simulate what the radio reports of one pass's polls at (about) even times.

    Parameters
    ----------
    true_range_m : (N, P)
        True slant range at each poll of each anchor, in metres.
    cut : (N, P)
        True where an obstacle cuts the line of sight.
    step_s
        Time between two polls of an anchor, in seconds.
    settings
        Settings of the ranging.
    stream
        Source of randomness.
    """
    streams = RowStreams([stream], [len(true_range_m)])
    return simulate_rows(true_range_m, cut, step_s, settings, streams)


def simulate_rows(
    true_range_m: Float64[Array, "N P"],
    cut: Bool[Array, "N P"],
    step_s: Column,
    settings: RangingSettings,
    streams: RowStreams,
) -> Reports:
    """Simulate what the radio reports of the anchors of several passes.

    Parameters
    ----------
    true_range_m, cut, step_s
        Like :func:`simulate_reports`.
    settings
        Settings of the ranging, of all rows or of each; ``averaged`` is the same for all.
    streams
        Sources of randomness of the rows.
    """
    p = true_range_m.shape[1]
    spread = settings.averaged - 1  # raw ranges before the first report that count in it
    draw = streams.uniform("ranging-uniform", 5, p)
    normal = streams.normal("ranging-normal", 5, p + spread)
    nlos = cut if settings.los_s is None else cut | two_state(
        draw[:, 0], settings.los_s, settings.nlos_s, step_s
    )  # fmt: skip
    bias_m = _bias_m(true_range_m, nlos, normal[:, 1:3, spread:], step_s, settings)
    if np.any(settings.drift_sigma_m):
        common = streams.common_normal("drift", p)
        bias_m += settings.drift_sigma_m * correlated(common, settings.drift_correlation_s, step_s)
    noise = _noise(normal[:, 0], settings, streams)
    error_m = bias_m + (settings.sigma_m + settings.sigma_per_m * true_range_m) * noise
    if np.any(settings.nlos_sigma_m):
        error_m += nlos * (settings.nlos_sigma_m * normal[:, 3, spread:])
    offset_m = _burst_m(draw[:, 4], normal[:, 4, spread:], step_s, settings)
    answered = _answered(true_range_m, draw[:, 1:3], step_s, settings)
    source = _held(answered, draw[:, 3] < settings.held_share)
    return Reports(
        answered=answered,
        range_m=at_steps(true_range_m + error_m + offset_m, source),
        nlos=nlos,
        bias_m=bias_m,
        outlier=at_steps(offset_m != 0, source),
    )


def received_power(
    true_range_m: Float64[Array, "N P"],
    nlos: Bool[Array, "N P"],
    settings: RangingSettings,
    rng: np.random.Generator,
) -> tuple[Float64[Array, "N P"], Float64[Array, "N P"]]:
    """Draw the received power and that of the first path, which is never stronger, in dBm.

    Parameters
    ----------
    true_range_m : (N, P)
        True slant ranges, in metres.
    nlos : (N, P)
        True where there is no line of sight.
    settings
        Settings of the ranging.
    rng
        Source of the fading.
    """
    n, p = true_range_m.shape
    loss_db = settings.rssi_per_decade_db * np.log10(np.maximum(true_range_m, 1.0))
    fading_db = settings.rssi_sigma_db * rng.standard_normal((n, 2, p))
    rssi_dbm = settings.rssi_at_1m_dbm - loss_db + fading_db[:, 0]
    first_path_loss_db = np.abs(fading_db[:, 1]) + settings.nlos_first_path_loss_db * nlos
    return rssi_dbm, rssi_dbm - first_path_loss_db


def _bias_m(
    true_range_m: Float64[Array, "N P"],
    nlos: Bool[Array, "N P"],
    normal: Float64[Array, "N 2 P"],
    step_s: Column,
    settings: RangingSettings,
) -> Float64[Array, "N P"]:
    """Return the bias of distance, the anchors' own drift and the excess of lost line of sight."""
    if np.any(settings.bias_m) or np.any(settings.bias_per_decade_m):
        basis = bias_basis(true_range_m)
        bias_m = settings.bias_m + settings.bias_per_decade_m * basis[..., 1]
    else:
        bias_m = np.zeros(true_range_m.shape)
    if np.any(settings.own_drift_sigma_m):
        bias_m += settings.own_drift_sigma_m * correlated(
            normal[:, 0], settings.own_drift_correlation_s, step_s
        )
    if np.any(settings.nlos_bias_m):
        mean_m, correlation_s = settings.nlos_bias_m, settings.nlos_bias_correlation_s
        spread = settings.nlos_bias_sigma_m / np.where(np.greater(mean_m, 0), mean_m, 1.0)
        variance = np.log1p(spread**2)  # of the logarithm
        log = np.sqrt(variance) * correlated(normal[:, 1], correlation_s, step_s) - variance / 2
        bias_m += nlos * (mean_m * np.exp(log))
    return bias_m


def _noise(
    normal: Float64[Array, "N Q"], settings: RangingSettings, streams: RowStreams
) -> Float64[Array, "N P"]:
    """Return noise of variance 1 with the declared tails, averaged like the radio averages."""
    noise = normal
    dof = settings.tail_dof
    if dof is not None:
        order = np.broadcast_to(dof / 2, (len(normal), 1))
        chi2 = 2 * streams.gamma("tails", order, normal.shape[1])
        noise = normal * np.sqrt((dof - 2) / chi2)
    count = settings.averaged
    if count == 1:
        return noise
    p = normal.shape[1] - count + 1
    total = noise[:, :p].copy()
    for k in range(1, count):
        total += noise[:, k : k + p]
    return np.asarray(total / np.sqrt(count))


def _burst_m(
    draw: Float64[Array, "N P"],
    normal: Float64[Array, "N P"],
    step_s: Column,
    settings: RangingSettings,
) -> Float64[Array, "N P"]:
    """Return the offsets of bursts, 0 outside them; where two overlap, the later one counts."""
    starts = np.minimum(1.0, settings.burst_per_s * step_s)
    anchor, start = np.nonzero(draw < starts)
    # A number drawn below a limit is, divided by the limit, a new number between 0 and 1.
    share = draw[anchor, start] / at(starts, anchor)
    negative_share = at(settings.burst_negative_share, anchor)
    negative = share < negative_share
    part = np.where(negative, negative_share, 1 - negative_share)
    share = np.where(negative, share, share - negative_share) / part
    longest = np.cumsum(settings.burst_lengths)[:-1]
    length = 1 + np.searchsorted(longest, share, side="right")
    log = at(settings.burst_log_sigma, anchor) * normal[anchor, start]
    size_m = at(settings.burst_median_m, anchor) * np.exp(log)
    size_m = np.minimum(size_m, at(settings.burst_max_m, anchor))
    burst_m = np.where(negative, -size_m, size_m)
    offset_m = np.zeros(normal.shape)
    for later in range(len(settings.burst_lengths) - 1, -1, -1):
        on = (length > later) & (start + later < normal.shape[1])
        offset_m[anchor[on], start[on] + later] = burst_m[on]
    return offset_m


def _answered(
    true_range_m: Float64[Array, "N P"],
    draw: Float64[Array, "N 2 P"],
    step_s: Column,
    settings: RangingSettings,
) -> Bool[Array, "N P"]:
    """Return which polls are answered: within range, not lost, and not in an outage."""
    share = 1 - settings.dropout_share
    limit_m, soft_m = settings.max_range_m, settings.soft_range_m
    answered = (draw[:, 0] < share) & (true_range_m <= limit_m)
    if np.any(soft_m):
        length_m = np.where(np.greater(soft_m, 0), soft_m, 1.0)
        near = np.equal(soft_m, 0) | (draw[:, 0] < share * (limit_m - true_range_m) / length_m)
        answered &= near
    if np.any(settings.outage_per_s):
        with np.errstate(divide="ignore"):
            service_s = np.divide(1, settings.outage_per_s)  # infinite without outages
        answered &= ~two_state(draw[:, 1], service_s, settings.outage_s, step_s)
    return answered


def _held(answered: Bool[Array, "N P"], held: Bool[Array, "N P"]) -> Int64[Array, "N P"]:
    """Return the poll whose range each reading reports: a held one repeats the reading before."""
    step = np.arange(answered.shape[1])
    fresh = np.maximum.accumulate(np.where(answered & ~held, step, -1), axis=1)
    return np.where(fresh < 0, step, fresh)
