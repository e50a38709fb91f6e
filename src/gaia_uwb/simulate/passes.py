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
from gaia_uwb.scene import RangeLog, Scene, Tag, Trajectory, Truth
from gaia_uwb.simulate.blocks import anchor_ids, simulate_blocks
from gaia_uwb.simulate.cone_ranges import simulate_cone_ranges
from gaia_uwb.simulate.presets import PLACE
from gaia_uwb.simulate.ranging import received_power, simulate_rows
from gaia_uwb.simulate.rows import PassRows, SectionRows
from gaia_uwb.simulate.settings import DriveConfig, PassConfig
from gaia_uwb.simulate.setup import Setting, set_up
from gaia_uwb.simulate.streams import RowStreams, Source, Stream
from gaia_uwb.simulate.trajectories import record_positions
from gaia_uwb.simulate.vehicles import MountedTag, draw_vehicle

__all__ = ["Setting", "set_up", "simulate_episode", "simulate_pass", "simulate_zone"]

_PASSES = 1 << 32  # numbers of passes kept for every zone
_MEASURED = ("t_s", "anchor", "range_m", "rssi_dbm", "rssi_fp_dbm", "azimuth_rad")
_KNOWN = ("nlos", "outlier", "bias_m")


def simulate_zone(
    config: PassConfig,
    seed: int,
    *,
    lanes_m: Sequence[float] = (0.0, 3.6),
    zone: int = 0,
    vehicles: Sequence[str] | None = None,
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
        Number of the zone in its batch, at least 0; passes of different zones share nothing, but
        for vehicles of the same name.
    vehicles
        For each pass, the name of the vehicle that drives it; those of the same name share their
        clock and radios. None: the passes share what the settings say.

    Returns
    -------
    list of Scene
        One per lane, named after seed, zone and number, in one frame.

    Raises
    ------
    ConfigError
        Like :func:`simulate_pass`, or if a lane is impossible, or has no vehicle where others have.

    Examples
    --------
    >>> from gaia_uwb.simulate import PRESETS
    >>> near, far = simulate_zone(PRESETS["straight"], seed=0)
    >>> bool((near.truth.anchor_m == far.truth.anchor_m).all()), near.name, far.name
    (True, 'sim-0-0-pass-0', 'sim-0-0-pass-1')
    """
    names = [""] * len(lanes_m) if vehicles is None else list(vehicles)
    if len(names) != len(lanes_m):
        raise ConfigError(f"expected a vehicle for each of {len(lanes_m)} lanes, got {len(names)}")
    scenes = []
    width = len(str(max(len(lanes_m) - 1, 0)))
    for k, (lane_m, vehicle) in enumerate(zip(lanes_m, names, strict=True)):
        lane = config.drive.lane_offset_m + lane_m
        try:
            drive = DriveConfig.model_validate(config.drive.model_dump() | {"lane_offset_m": lane})
        except ValidationError as error:
            raise ConfigError(f"expected lanes within 20 m of the usual one, got {lane}") from error
        own = config.model_copy(update={"drive": drive})
        scene = simulate_pass(
            own, seed, episode=zone * _PASSES + k, zone=zone * _PASSES, vehicle=vehicle
        )
        scenes.append(replace(scene, name=f"sim-{seed}-{zone}-pass-{k:0{width}d}"))
    return scenes


def simulate_pass(
    config: PassConfig, seed: int, *, episode: int = 0, zone: int | None = None, vehicle: str = ""
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
    vehicle
        Who drives: passes of one seed by a vehicle of one name share its clock offset, its range
        bias and its tags. Empty: a vehicle of its own.

    Returns
    -------
    Scene
        With heights, received power, a made-up place on Earth and the truth of everything; with
        ``tags``, angles and ranges between cones, where the settings ask for them. An
        anchor that is never near enough is there, without readings.

    Raises
    ------
    ConfigError
        If no anchor gives a single reading; or like :func:`set_up`.
    """
    source = Source(seed)
    setting = set_up(config, seed, episode, zone)
    driver = draw_vehicle(setting.config, source, episode, vehicle)
    ranging = driver.ranging(setting.config.ranging)
    parts = [
        _readings(setting, ranging, tag, source.stream(episode, radio=k))
        for k, tag in enumerate(driver.tags)
    ]
    columns = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    if not len(columns["anchor"]):
        raise ConfigError(
            "the simulated pass has no readings: no anchor answers within max_range_m"
        )
    tag = np.repeat(np.arange(len(parts)), [len(part["anchor"]) for part in parts])
    order = np.argsort(columns["t_s"], kind="stable")
    log, truth = (
        {name: columns[name][order] for name in names if name in columns}
        for names in (_MEASURED, _KNOWN)
    )
    angles = ranging.azimuth_sigma_deg
    return Scene(
        name=f"sim-{seed}-{episode}",
        trajectory=_record(setting, source.stream(episode)),
        ranges=RangeLog(
            **log,
            tag=tag[order] if config.drive.tags else None,
            azimuth_sigma_rad=angles and np.full(len(order), np.radians(angles)),
        ),
        anchor_ids=anchor_ids(len(setting.anchor_m)),
        anchor_up_m=setting.anchor_up_m,
        frame=PLACE,
        truth=Truth(
            anchor_m=setting.anchor_m,
            clock_offset_s=ranging.clock_offset_s,
            range_m=columns["true_range_m"][order],
            **truth,
        ),
        tags=tuple(
            Tag(f"tag-{k + 1}", tag.forward_m, tag.left_m, tag.up_m)
            for k, tag in enumerate(config.drive.tags)
        ),
        cone_ranges=simulate_cone_ranges(setting, ranging, source, episode),
        vehicle=vehicle,
    )


def _readings(
    setting: Setting, ranging: SectionRows, tag: MountedTag, stream: Stream
) -> dict[str, Array]:
    """Return one tag's readings and their truth, anchor after anchor, each as a column."""
    t_s = _poll_times_s(setting.config, stream("polls"))
    antenna_m, heading_rad = tag.antenna_m(setting.drive, t_s)
    true_range_m, cut = setting.see(antenna_m, tag.up_m)
    streams = RowStreams([stream], setting.anchors)
    east_m, north_m = np.moveaxis(setting.anchor_m[:, None] - antenna_m, -1, 0)
    bearing_rad = np.arctan2(north_m, east_m) - heading_rad
    own_bias_m = tag.bias_m(bearing_rad)
    # A held reading repeats the bias of the one before, too.
    seen_m = true_range_m + own_bias_m
    reports = simulate_rows(seen_m, cut, 1 / ranging.rate_hz, ranging, streams)
    rssi_dbm, rssi_fp_dbm = received_power(true_range_m, reports.nlos, ranging, stream("power"))
    columns = {
        "t_s": t_s + ranging.clock_offset_s,
        "range_m": np.round(reports.range_m, 6),
        "rssi_dbm": np.round(rssi_dbm, 6),
        "rssi_fp_dbm": np.round(rssi_fp_dbm, 6),
        "nlos": reports.nlos,
        "outlier": reports.outlier,
        "bias_m": np.round(reports.bias_m + own_bias_m, 6),
        "true_range_m": np.round(true_range_m, 6),
    }
    if ranging.azimuth_sigma_deg is not None:
        columns["azimuth_rad"] = np.round(tag.azimuth_rad(bearing_rad, ranging, stream), 6)
    anchor, poll = np.nonzero(reports.answered)
    return {"anchor": anchor, **{name: each[anchor, poll] for name, each in columns.items()}}


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
