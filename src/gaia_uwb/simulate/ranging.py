"""What the radio reports of an anchor: polls, answers, and ranges with their errors.

The errors come in the order in which they arise: line of sight lost for a while (a two-state Markov
chain) adds a slowly varying, positive excess; noise grows with distance; some polls get no answer;
of the answers that come, a few in a row share a spike's offset, and some repeat the one before.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gaia_uwb._typing import Array, Bool, Float64
from gaia_uwb.simulate.presets import RangingConfig
from gaia_uwb.simulate.trajectories import Drive

_POLL_JITTER = 0.05  # in polls: the radio's schedule is not exact
_NLOS_BIAS_LOG_SIGMA = (
    0.5  # spread of the log-normal excess: a mean of 0.25 m varies from 0.1 to 0.5 m
)


@dataclass(frozen=True)
class Readings:
    """The readings of one anchor with their truth, in the order of time.

    Parameters
    ----------
    t_s : (R,)
        True time of each reading in the trajectory's clock, in seconds.
    range_m, true_range_m : (R,)
        Measured and true slant ranges, in metres.
    nlos : (R,)
        True where there was no line of sight.
    rssi_dbm, rssi_fp_dbm : (R,)
        Received power, and that of the first path, in dBm.
    """

    t_s: Float64[Array, "R"]
    range_m: Float64[Array, "R"]
    true_range_m: Float64[Array, "R"]
    nlos: Bool[Array, "R"]
    rssi_dbm: Float64[Array, "R"]
    rssi_fp_dbm: Float64[Array, "R"]


def simulate_readings(
    drive: Drive,
    anchor_m: Float64[Array, "2"],
    anchor_up_m: float,
    settings: RangingConfig,
    rng: np.random.Generator,
) -> Readings:
    """Simulate all readings of one anchor during a drive.

    Parameters
    ----------
    drive
        The drive.
    anchor_m : (2,)
        East and north of the anchor, in metres.
    anchor_up_m
        Height of the anchor's antenna, in metres.
    settings
        Settings of the ranging.
    rng
        The anchor's own source of randomness.

    Returns
    -------
    Readings
        Possibly none, where the anchor is never near enough.
    """
    t_s = _poll_times_s(drive.config.drive.duration_s, settings.rate_hz, rng)
    true_range_m = np.hypot(
        np.hypot(*(drive.position_m(t_s) - anchor_m).T),
        drive.config.drive.antenna_up_m - anchor_up_m,
    )
    nlos = _stretches(
        len(t_s), settings.nlos_share, settings.nlos_duration_s * settings.rate_hz, rng
    )
    range_m = true_range_m + np.where(nlos, _nlos_bias_m(len(t_s), settings, rng), 0.0)
    range_m += rng.standard_normal(len(t_s)) * (
        settings.sigma_m + settings.sigma_per_m * true_range_m
    )
    rssi_dbm, rssi_fp_dbm = _received_power(true_range_m, nlos, settings, rng)
    silent = _stretches(
        len(t_s), settings.dropout_share, settings.dropout_duration_s * settings.rate_hz, rng
    )
    answered = ~silent & (true_range_m <= settings.max_range_m)
    return Readings(
        t_s=t_s[answered],
        range_m=_repeat_some(_add_bursts(range_m[answered], settings, rng), settings, rng),
        true_range_m=true_range_m[answered],
        nlos=nlos[answered],
        rssi_dbm=rssi_dbm[answered],
        rssi_fp_dbm=rssi_fp_dbm[answered],
    )


def _poll_times_s(
    duration_s: float, rate_hz: float, rng: np.random.Generator
) -> Float64[Array, "n"]:
    """Draw when an anchor is polled: in its own slot of every period, give or take the jitter."""
    n = int(duration_s * rate_hz)
    slot = rng.uniform(_POLL_JITTER, 1 - _POLL_JITTER)
    jitter = rng.uniform(-_POLL_JITTER, _POLL_JITTER, n)
    return (np.arange(n) + slot + jitter) / rate_hz


def _stretches(
    n: int, share: float, mean_length: float, rng: np.random.Generator
) -> Bool[Array, "n"]:
    """Draw a two-state Markov chain that is on for a share of the steps, in stretches."""
    leave = 1 / max(1.0, mean_length)
    enter = leave * share / (1 - share)  # balances what leaves, so the share holds from the start
    draw = rng.random(n + 1)
    on = np.empty(n, dtype=bool)
    state = draw[0] < share
    for k in range(n):
        on[k] = state
        state = draw[k + 1] >= leave if state else draw[k + 1] < enter
    return on


def _nlos_bias_m(n: int, settings: RangingConfig, rng: np.random.Generator) -> Float64[Array, "n"]:
    """Draw a positive excess range that varies as slowly as the line of sight comes and goes."""
    keep = np.exp(-1 / (settings.rate_hz * settings.nlos_duration_s))
    step = rng.standard_normal(n)
    log_excess = step.copy()
    for k in range(1, n):  # autoregressive, of unit variance from the first step
        log_excess[k] = keep * log_excess[k - 1] + np.sqrt(1 - keep**2) * step[k]
    sigma = _NLOS_BIAS_LOG_SIGMA
    return settings.nlos_bias_m * np.exp(sigma * log_excess - sigma**2 / 2)  # of that mean


def _received_power(
    true_range_m: Float64[Array, "R"],
    nlos: Bool[Array, "R"],
    settings: RangingConfig,
    rng: np.random.Generator,
) -> tuple[Float64[Array, "R"], Float64[Array, "R"]]:
    """Draw the received power and that of the first path, which is never stronger, in dBm."""
    loss_db = settings.rssi_per_decade_db * np.log10(np.maximum(true_range_m, 1.0))
    fading_db = settings.rssi_sigma_db * rng.standard_normal((2, len(true_range_m)))
    rssi_dbm = settings.rssi_at_1m_dbm - loss_db + fading_db[0]
    first_path_loss_db = np.abs(fading_db[1]) + settings.nlos_first_path_loss_db * nlos
    return rssi_dbm, rssi_dbm - first_path_loss_db


def _add_bursts(
    range_m: Float64[Array, "R"], settings: RangingConfig, rng: np.random.Generator
) -> Float64[Array, "R"]:
    """Add constant offsets to some runs of 2 or 3 readings; two bursts never touch."""
    range_m = range_m.copy()
    free_from = 0
    for start in np.flatnonzero(rng.random(len(range_m)) < settings.burst_rate).tolist():
        length = int(rng.integers(2, 4))
        offset_m = rng.uniform(settings.burst_min_m, settings.burst_max_m)
        if rng.random() < settings.burst_negative_share:
            offset_m = -offset_m
        if start >= free_from:
            range_m[start : start + length] += offset_m
            free_from = start + length + 1
    return range_m


def _repeat_some(
    range_m: Float64[Array, "R"], settings: RangingConfig, rng: np.random.Generator
) -> Float64[Array, "R"]:
    """Let some readings hold the range of the one before."""
    held = rng.random(len(range_m)) < settings.held_share
    held[:1] = False
    return range_m[np.maximum.accumulate(np.where(held, 0, np.arange(len(range_m))))]
