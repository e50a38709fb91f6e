"""One simulated pass: as the log that a vehicle records, or on one timeline.

Results are rounded to 1e-6 (a micrometre), for the last bit of a sine is not the same on every
processor.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from pydantic import ValidationError

from gaia_uwb._shared import Array, ConfigError, Float64
from gaia_uwb.episode import Episode
from gaia_uwb.scene import RangeLog, Scene, Trajectory, Truth
from gaia_uwb.simulate.blocks import anchor_ids, simulate_blocks
from gaia_uwb.simulate.presets import PLACE
from gaia_uwb.simulate.ranging import received_power, simulate_rows
from gaia_uwb.simulate.rows import PassRows
from gaia_uwb.simulate.settings import DriveConfig, PassConfig
from gaia_uwb.simulate.setup import Setting, set_up
from gaia_uwb.simulate.streams import RowStreams, Source, Stream
from gaia_uwb.simulate.trajectories import record_positions

__all__ = ["Setting", "set_up", "simulate_episode", "simulate_pass", "simulate_zone"]

_PASSES = 1 << 32  # numbers of passes kept for every zone


def simulate_zone(
    config: PassConfig, seed: int, *, lanes_m: Sequence[float] = (0.0, 3.6), zone: int = 0
) -> list[Scene]:
    """Simulate several passes of one work zone: the same anchors, each drive with its own errors.

    Parameters
    ----------
    config
        Settings of the batch.
    seed
        Seed of the batch, at least 0.
    lanes_m
        For each pass, how far it keeps beside the lane of ``config.drive``, positive towards the
        open side, in metres.
    zone
        Number of the zone in its batch, at least 0; passes of different zones share nothing.

    Returns
    -------
    list of Scene
        One per lane, named after seed, zone and number, in one frame.

    Raises
    ------
    ConfigError
        Like :func:`simulate_pass`, or if a lane is impossible.

    Examples
    --------
    >>> from gaia_uwb.simulate import PRESETS
    >>> near, far = simulate_zone(PRESETS["straight"], seed=0)
    >>> bool((near.truth.anchor_m == far.truth.anchor_m).all()), near.name, far.name
    (True, 'sim-0-0-pass-0', 'sim-0-0-pass-1')
    """
    scenes = []
    width = len(str(max(len(lanes_m) - 1, 0)))
    for k, lane_m in enumerate(lanes_m):
        lane = config.drive.lane_offset_m + lane_m
        try:
            drive = DriveConfig.model_validate(config.drive.model_dump() | {"lane_offset_m": lane})
        except ValidationError as error:
            raise ConfigError(f"expected lanes within 20 m of the usual one, got {lane}") from error
        own = config.model_copy(update={"drive": drive})
        scene = simulate_pass(own, seed, episode=zone * _PASSES + k, zone=zone * _PASSES)
        scenes.append(replace(scene, name=f"sim-{seed}-{zone}-pass-{k:0{width}d}"))
    return scenes


def simulate_pass(
    config: PassConfig, seed: int, *, episode: int = 0, zone: int | None = None
) -> Scene:
    """Simulate one pass along a work zone, as a vehicle records it.

    Parameters
    ----------
    config
        Settings of the batch.
    seed
        Seed of the batch, at least 0.
    episode
        Number of the pass in its batch, at least 0.
    zone
        Number of the pass whose road and anchors it drives past; its own by default.

    Returns
    -------
    Scene
        With heights, received power, a made-up place on Earth and the truth of everything. An
        anchor that is never near enough is there, without readings.

    Raises
    ------
    ConfigError
        If no anchor gives a single reading; or like :func:`set_up`.
    """
    stream = Source(seed).stream(episode)
    setting = set_up(config, seed, episode, zone)
    ranging, n = setting.config.ranging, len(setting.anchor_m)
    t_s = _poll_times_s(setting.config, stream("polls"))
    true_range_m, cut = setting.see(setting.drive.position_m(t_s))
    streams = RowStreams([stream], setting.anchors)
    reports = simulate_rows(true_range_m, cut, 1 / ranging.rate_hz, ranging, streams)
    rssi_dbm, rssi_fp_dbm = received_power(true_range_m, reports.nlos, ranging, stream("power"))
    anchor, poll = np.nonzero(reports.answered)
    if not len(anchor):
        raise ConfigError(
            "the simulated pass has no readings: no anchor answers within max_range_m"
        )
    order = np.argsort(t_s[anchor, poll], kind="stable")
    rows = anchor[order], poll[order]
    return Scene(
        name=f"sim-{seed}-{episode}",
        trajectory=_record(setting, stream),
        ranges=RangeLog(
            t_s=t_s[rows] + ranging.clock_offset_s,
            anchor=rows[0],
            range_m=np.round(reports.range_m[rows], 6),
            rssi_dbm=np.round(rssi_dbm[rows], 6),
            rssi_fp_dbm=np.round(rssi_fp_dbm[rows], 6),
        ),
        anchor_ids=anchor_ids(n),
        anchor_up_m=setting.anchor_up_m,
        frame=PLACE,
        truth=Truth(
            anchor_m=setting.anchor_m,
            nlos=reports.nlos[rows],
            range_m=np.round(true_range_m[rows], 6),
            clock_offset_s=ranging.clock_offset_s,
            outlier=reports.outlier[rows],
            bias_m=np.round(reports.bias_m[rows], 6),
        ),
    )


def simulate_episode(config: PassConfig, seed: int, *, episode: int = 0) -> Episode:
    """Simulate one pass on one timeline: every anchor is polled at every step.

    Nothing is aligned or calibrated: a clock offset and a bias that the settings ask for are in
    the ranges. ``drive`` gives the timeline: ``rate_hz`` steps per second for ``duration_s``.

    Parameters
    ----------
    config
        Settings of the batch.
    seed
        Seed of the batch, at least 0.
    episode
        Number of the episode in its batch, at least 0.

    Returns
    -------
    Episode
        With heights, a made-up place on Earth and the truth of everything.

    Raises
    ------
    ConfigError
        Like :func:`set_up`.

    Examples
    --------
    >>> from gaia_uwb.simulate import PRESETS
    >>> simulate_episode(PRESETS["stress"], seed=0).n_steps
    64
    """
    (block,) = simulate_blocks(config, seed, [episode])
    (made,) = block.episodes()
    return made


def _poll_times_s(config: PassRows, rng: np.random.Generator) -> Float64[Array, "N P"]:
    """Draw when anchors are polled: in their own slot of every period, give or take the jitter."""
    ranging = config.ranging
    n_polls = int(config.drive.duration_s * ranging.rate_hz)
    draw = rng.random((config.closure.n_anchors, n_polls + 1))
    slot = ranging.jitter + (1 - 2 * ranging.jitter) * draw[:, :1]
    jitter = ranging.jitter * (2 * draw[:, 1:] - 1)
    return np.asarray((np.arange(n_polls) + slot + jitter) / ranging.rate_hz)


def _record(setting: Setting, stream: Stream) -> Trajectory:
    """Sample the drive of one pass as its positioning records it."""
    drive = setting.config.drive
    t_s = np.arange(int(drive.duration_s * drive.rate_hz) + 1) / drive.rate_hz
    position_m, known = record_positions(setting.drive.position_m(t_s[None]), drive, [stream])
    up_m = np.full(int(known.sum()), drive.antenna_up_m)
    return Trajectory(t_s[known[0]], np.round(position_m[known], 6), up_m)
