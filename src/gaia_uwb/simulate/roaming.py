"""Free scenes: any path past any group of anchors, for training where no road is known.

Work zones as engineers lay them out (``layouts.py``) are long and thin, and a vehicle keeps to its
lane. A model that has seen nothing else takes every group of anchors for such a zone. So part of
its training is this: a path from 0.5 to 35 m/s that is straight, bends, wanders or comes back, and
3 to 12 anchors in a rectangle, a line, a cluster, or on both sides of the path, up to 60 m away.
The ranging errors are those of ``ranging.py``, with settings that vary more than any one radio's.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gaia_uwb._shared import Array, Float64
from gaia_uwb.simulate.blocks import EpisodeBlock
from gaia_uwb.simulate.ranging import simulate_rows
from gaia_uwb.simulate.rows import PassRows, each
from gaia_uwb.simulate.settings import ClosureConfig, DriveConfig, PassConfig, RangingConfig
from gaia_uwb.simulate.streams import RowStreams, Source, Stream
from gaia_uwb.simulate.trajectories import record_positions
from gaia_uwb.simulate.variation import draw_settings

__all__ = ["ROAMING", "simulate_roaming"]

ROAMING = PassConfig(
    closure=ClosureConfig(n_anchors=4),
    drive=DriveConfig(),
    ranging=RangingConfig(clock_offset_s=0.0, max_range_m=300.0),
    vary={
        "closure.n_anchors": [3, 12],
        "closure.antenna_up_m": [0.3, 2.0],
        "drive.antenna_up_m": [0.8, 3.0],
        "drive.rate_hz": [5.0, 20.0],
        "drive.position_sigma_m": [0.005, 0.03],
        "ranging.bias_m": [-0.2, 0.4],
        "ranging.bias_per_decade_m": [-0.2, 0.4],
        "ranging.sigma_m": [0.02, 0.15],
        "ranging.drift_sigma_m": [0.0, 0.08],
        "ranging.drift_correlation_s": [1.0, 10.0],
        "ranging.own_drift_sigma_m": [0.0, 0.1],
        "ranging.los_s": [1.0, 60.0],
        "ranging.nlos_s": [0.3, 6.0],
        "ranging.nlos_bias_m": [0.02, 1.0],
        "ranging.nlos_bias_sigma_m": [0.02, 0.5],
        "ranging.burst_per_s": [0.0, 0.2],
        "ranging.burst_negative_share": [0.0, 1.0],
        "ranging.dropout_share": [0.0, 0.3],
    },
)
"""What varies of radio and drive; paths and places of anchors have no settings."""

_SPEED_MPS = (0.5, 35.0)
_ACCELERATION_MPS2 = 2.0  # across the path, at most
_LEAST_RADIUS_M = 1.0
_OFFSET_M = (0.3, 40.0)  # of the anchors' middle from the path
_LENGTH_M, _WIDTH_M = (1.5, 80.0), (0.5, 15.0)  # of a group of anchors


def simulate_roaming(
    seed: int, episodes: Sequence[int], n_steps: int, *, averaged: int = 1
) -> EpisodeBlock:
    """Simulate some free scenes at once, straight on their timelines.

    Parameters
    ----------
    seed
        Seed of the batch, at least 0.
    episodes
        Their numbers in the batch, at least 0; each is what it is alone.
    n_steps
        Steps of each, at least 2.
    averaged
        How many raw ranges the radio averages for a report.

    Returns
    -------
    EpisodeBlock
        With the truth of everything.

    Examples
    --------
    >>> block = simulate_roaming(0, [0, 1, 2], 64)
    >>> [(episode.n_steps, episode.n_anchors) for episode in block.episodes()]
    [(64, 3), (64, 11), (64, 11)]
    """
    source = Source(seed)
    streams = [source.stream(episode) for episode in episodes]
    drawn, paths_m, anchors_m, scatter = [], [], [], []
    for stream in streams:
        rng = stream("zone")
        settings = draw_settings(ROAMING, rng)
        rate_hz, n = float(settings["drive.rate_hz"]), int(settings["closure.n_anchors"])
        path_m, heading_rad = _path(rng, n_steps, 1 / rate_hz)
        drawn.append(settings)
        paths_m.append(path_m)
        anchors_m.append(_anchors(rng, path_m, heading_rad, n))
        scatter.append(rng.standard_normal(n))
    ranging = ROAMING.ranging.model_copy(update={"averaged": averaged})
    config = ROAMING.model_copy(update={"ranging": ranging})
    return _block(PassRows.of(config, drawn), seed, tuple(episodes), streams,
                  np.stack(paths_m), anchors_m, scatter)  # fmt: skip


def _block(
    config: PassRows,
    seed: int,
    numbers: tuple[int, ...],
    streams: Sequence[Stream],
    path_m: Float64[Array, "E T 2"],
    anchors_m: Sequence[Float64[Array, "_ 2"]],
    scatter: Sequence[Float64[Array, "_"]],
) -> EpisodeBlock:
    """Let the radios range along the paths."""
    counts = [len(places) for places in anchors_m]
    passes = np.repeat(np.arange(len(counts)), counts)
    n_steps, n_passes = path_m.shape[1], len(counts)
    anchor_m = np.round(np.concatenate(anchors_m), 6)
    up_m = each(config.closure.antenna_up_m, n_passes)[passes]
    anchor_up_m = np.round(up_m + 0.2 * np.concatenate(scatter), 6)
    tag_up_m = np.broadcast_to(
        each(config.drive.antenna_up_m, n_passes)[:, None], (n_passes, n_steps)
    )
    gap_m = np.linalg.norm(path_m[passes] - anchor_m[:, None], axis=-1)
    true_range_m = np.hypot(gap_m, tag_up_m[passes] - anchor_up_m[:, None])
    rows = config.at(passes)
    cut = np.zeros(true_range_m.shape, dtype=np.bool_)
    reports = simulate_rows(
        true_range_m, cut, 1 / rows.drive.rate_hz, rows.ranging, RowStreams(streams, counts)
    )
    position_m, _ = record_positions(path_m, config.drive, streams)
    rate_hz = np.broadcast_to(config.drive.rate_hz, (n_passes, 1))
    return EpisodeBlock(
        seed=seed,
        numbers=numbers,
        anchors=tuple(counts),
        t_s=np.arange(n_steps) / rate_hz,
        position_m=np.round(position_m, 6),
        tag_up_m=tag_up_m,
        anchor_m=anchor_m,
        anchor_up_m=anchor_up_m,
        range_m=np.round(np.where(reports.answered, reports.range_m, np.nan), 6),
        valid=reports.answered,
        true_range_m=np.round(true_range_m, 6),
        nlos=reports.nlos,
        outlier=reports.outlier,
        bias_m=np.round(reports.bias_m, 6),
    )


def _path(
    rng: np.random.Generator, n_steps: int, step_s: float
) -> tuple[Float64[Array, "T 2"], Float64[Array, "T"]]:
    """Draw a path: places in metres and headings in radians."""
    speed_mps = _log_uniform(rng, *_SPEED_MPS)
    time_s = step_s * np.arange(n_steps)
    swing = (
        0.3 * rng.random() * np.sin(2 * np.pi * (time_s / rng.uniform(5.0, 30.0) + rng.random()))
    )
    driven_m = np.concatenate([[0.0], np.cumsum(speed_mps * (1 + swing[:-1]) * step_s)])
    length_m = max(float(driven_m[-1]), 1.0)
    largest_per_m = min(1 / _LEAST_RADIUS_M, _ACCELERATION_MPS2 / speed_mps**2)
    kind = rng.random()
    if kind < 0.3:  # straight
        largest_per_m = 0.0
    elif kind < 0.65:  # a bend of a road
        largest_per_m = min(largest_per_m, _log_uniform(rng, 3e-4, 1e-2))
    wavelength_m = np.exp(rng.uniform(np.log(4.0), np.log(4 * length_m + 20.0), 3))
    at_m = np.linspace(0.0, length_m, 257)
    phase = 2 * np.pi * (at_m[:, None] / wavelength_m + rng.random(3))
    curvature_per_m = largest_per_m * np.sin(phase) @ rng.dirichlet(np.ones(3))
    per_step_m = at_m[1]
    turned_rad = np.concatenate([[0.0], np.cumsum(curvature_per_m[:-1]) * per_step_m])
    heading_rad = rng.uniform(-np.pi, np.pi) + turned_rad
    corner_m = np.stack([np.cos(heading_rad), np.sin(heading_rad)], axis=-1) * per_step_m
    corner_m = np.concatenate([np.zeros((1, 2)), np.cumsum(corner_m[:-1], axis=0)])
    if speed_mps < 3.0 and rng.random() < 0.2:  # out and back
        turn_m = rng.uniform(0.3, 0.7) * length_m
        driven_m = np.where(driven_m > turn_m, 2 * turn_m - driven_m, driven_m)
    driven_m = np.clip(driven_m, 0.0, length_m)
    place_m = np.stack([np.interp(driven_m, at_m, corner_m[:, k]) for k in (0, 1)], axis=-1)
    ahead_rad = np.interp(driven_m, at_m, heading_rad)
    most_m, period_m = rng.uniform(0.0, 0.2), rng.uniform(3.0 + speed_mps, 150.0)
    sway_m = most_m * _wave(driven_m, period_m, rng.random())
    across = np.stack([-np.sin(ahead_rad), np.cos(ahead_rad)], axis=-1)
    return place_m + sway_m[:, None] * across, ahead_rad


def _anchors(
    rng: np.random.Generator,
    path_m: Float64[Array, "T 2"],
    heading_rad: Float64[Array, "T"],
    n: int,
) -> Float64[Array, "N 2"]:
    """Draw the anchors of a scene near its path."""
    step = int(rng.integers(len(path_m)))
    length_m = _log_uniform(rng, *_LENGTH_M)
    width_m = min(length_m, _log_uniform(rng, *_WIDTH_M))
    across_m = _log_uniform(rng, *_OFFSET_M) * rng.choice([-1.0, 1.0])
    kind = rng.choice(["rectangle", "line", "cluster", "both-sides"], p=[0.45, 0.2, 0.2, 0.15])
    if kind == "rectangle":
        local_m = _on_rectangle(rng, n, length_m, width_m)
    elif kind == "line":
        local_m = np.stack(
            [np.linspace(-0.5, 0.5, n) * length_m, 0.2 * rng.standard_normal(n)], axis=-1
        )
        local_m[:, 0] += 0.02 * length_m * rng.standard_normal(n)
    elif kind == "cluster":
        local_m = 0.3 * rng.standard_normal((n, 2)) * [length_m, width_m]
    else:
        local_m = np.stack([(rng.random(n) - 0.5) * length_m, np.zeros(n)], axis=-1)
        side = rng.choice([-1.0, 1.0], n)
        local_m[:, 1] = side * (abs(across_m) + 0.3 * rng.standard_normal(n))
        across_m = 0.0
    turn_rad = heading_rad[step] + (rng.uniform(-np.pi, np.pi) if rng.random() < 0.5 else 0.0)
    middle_m = path_m[step] + across_m * np.array(
        [-np.sin(heading_rad[step]), np.cos(heading_rad[step])]
    )
    cos, sin = np.cos(turn_rad), np.sin(turn_rad)
    return np.asarray(middle_m + local_m @ np.array([[cos, sin], [-sin, cos]]))


def _on_rectangle(
    rng: np.random.Generator, n: int, length_m: float, width_m: float
) -> Float64[Array, "N 2"]:
    """Draw places on a rectangle's edge, first about its corners."""
    corner = np.array([[-0.5, -0.5], [-0.5, 0.5], [0.5, 0.5], [0.5, -0.5]])
    edge = rng.integers(4, size=n)
    share = rng.random((n, 1))
    places = (1 - share) * corner[edge] + share * corner[(edge + 1) % 4]
    places[: min(n, 4)] = corner[: min(n, 4)]
    return np.asarray(
        places * [length_m, width_m] + rng.uniform(0.02, 0.3) * rng.standard_normal((n, 2))
    )


def _wave(x: Float64[Array, "T"], length: float, phase: float) -> Float64[Array, "T"]:
    """Return a sine of a wavelength; its phase is a share of a turn."""
    return np.asarray(np.sin(2 * np.pi * (x / length + phase)))


def _log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))
