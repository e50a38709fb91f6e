"""One simulated pass: as the log that a vehicle records, or on one timeline.

Every kind of random number of a pass has a source of its own: a Philox generator whose key is the
seed and the number of the episode, and whose counter starts at the kind's number. So one seed gives
the same passes everywhere, alone or in a batch. Results are rounded to 1e-6 (a micrometre), for the
last bit of a sine is not the same on every processor.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from gaia_uwb._typing import Array, Bool, Float64
from gaia_uwb.episode import Episode, EpisodeTruth
from gaia_uwb.errors import ConfigError
from gaia_uwb.scene import RangeLog, Scene, Trajectory, Truth
from gaia_uwb.simulate.chains import Stream
from gaia_uwb.simulate.layouts import ZonePlan, place_anchors, plan_zone
from gaia_uwb.simulate.obstacles import Obstacles, place_obstacles
from gaia_uwb.simulate.presets import PLACE
from gaia_uwb.simulate.ranging import received_power, simulate_reports
from gaia_uwb.simulate.settings import PassConfig
from gaia_uwb.simulate.trajectories import Drive, plan_drive, record_positions
from gaia_uwb.simulate.variation import draw_config

_STREAMS = (
    "zone", "obstacles", "positions", "polls",
    "ranging-uniform", "ranging-normal", "drift", "tails", "power",
)  # fmt: skip
_STREAM_NUMBER = {name: number for number, name in enumerate(_STREAMS)}
_SEEDS = 2**64


@dataclass(frozen=True)
class Setting:
    """What is given before the first poll of a pass: the zone, its anchors, the drive.

    Parameters
    ----------
    config
        Settings of this pass; nothing varies in them.
    plan
        The work zone in road coordinates.
    anchor_m : (N, 2)
        East and north of the anchors, in metres.
    anchor_up_m : (N,)
        Their heights above the road, in metres.
    obstacles
        What may cut a line of sight.
    drive
        The drive.
    """

    config: PassConfig
    plan: ZonePlan
    anchor_m: Float64[Array, "N 2"]
    anchor_up_m: Float64[Array, "N"]
    obstacles: Obstacles
    drive: Drive

    def see(
        self, tag_m: Float64[Array, "M P 2"]
    ) -> tuple[Float64[Array, "N P"], Bool[Array, "N P"]]:
        """Return the slant ranges from these places, and which lines of sight obstacles cut.

        Parameters
        ----------
        tag_m : (N, P, 2) or (1, P, 2)
            Places of the tag's antenna for each anchor, or for all: east and north, in metres.
        """
        up_m = self.config.drive.antenna_up_m
        gap_m = tag_m - self.anchor_m[:, None]
        up_gap_m = up_m - self.anchor_up_m[:, None]
        range_m = np.sqrt(gap_m[..., 0] ** 2 + gap_m[..., 1] ** 2 + up_gap_m**2)
        return range_m, self.obstacles.cut(tag_m, up_m, self.anchor_m, self.anchor_up_m)


def set_up(config: PassConfig, seed: int, episode: int) -> Setting:
    """Draw the work zone, its anchors and the drive of a pass.

    Parameters
    ----------
    config, seed, episode
        Like :func:`simulate_pass`.

    Raises
    ------
    ConfigError
        If the seed or the episode's number is not in 0 ... 2^64 - 1, or no layout is in the part
        that ``config.split`` asks for.
    """
    stream = _streams(seed, episode)
    zone = stream("zone")
    config = draw_config(config, zone)
    plan = plan_zone(config)
    drive = plan_drive(config, plan, zone)
    # The anchors come last: one more of them changes nothing else.
    anchor_m, anchor_up_m = place_anchors(config, plan, zone)
    return Setting(
        config=config,
        plan=plan,
        anchor_m=np.round(anchor_m, 6),
        anchor_up_m=np.round(anchor_up_m, 6),
        obstacles=place_obstacles(config, plan, stream),
        drive=drive,
    )


def simulate_pass(config: PassConfig, seed: int, *, episode: int = 0) -> Scene:
    """Simulate one pass along a work zone, as a vehicle records it.

    Parameters
    ----------
    config
        Settings of the batch.
    seed
        Seed of the batch, at least 0.
    episode
        Number of the pass in its batch, at least 0.

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
    stream = _streams(seed, episode)
    setting = set_up(config, seed, episode)
    config = setting.config
    ranging, n = config.ranging, config.closure.n_anchors
    t_s = _poll_times_s(config, stream("polls"))
    true_range_m, cut = setting.see(setting.drive.position_m(t_s))
    reports = simulate_reports(true_range_m, cut, 1 / ranging.rate_hz, ranging, stream)
    rssi_dbm, rssi_fp_dbm = received_power(true_range_m, reports.nlos, ranging, stream("power"))
    anchor, poll = np.nonzero(reports.answered)
    if not len(anchor):
        raise ConfigError("the simulated pass has no reading: no anchor answers within max_range_m")
    order = np.argsort(t_s[anchor, poll], kind="stable")
    rows = anchor[order], poll[order]
    return Scene(
        name=f"sim-{seed}-{episode}",
        trajectory=_record(setting, stream("positions")),
        ranges=RangeLog(
            t_s=t_s[rows] + ranging.clock_offset_s,
            anchor=rows[0],
            range_m=np.round(reports.range_m[rows], 6),
            rssi_dbm=np.round(rssi_dbm[rows], 6),
            rssi_fp_dbm=np.round(rssi_fp_dbm[rows], 6),
        ),
        anchor_ids=_anchor_ids(n),
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
    >>> from gaia_uwb.simulate.presets import PRESETS
    >>> simulate_episode(PRESETS["stress"], seed=0).n_steps
    64
    """
    stream = _streams(seed, episode)
    setting = set_up(config, seed, episode)
    drive, ranging = setting.config.drive, setting.config.ranging
    t_s = np.arange(max(1, round(drive.duration_s * drive.rate_hz))) / drive.rate_hz
    tag_m = setting.drive.position_m(t_s)
    true_range_m, cut = setting.see(tag_m[None])
    measured_m = true_range_m
    if ranging.clock_offset_s:
        late_m = setting.drive.position_m(t_s - ranging.clock_offset_s)
        measured_m, cut = setting.see(late_m[None])
    reports = simulate_reports(measured_m, cut, 1 / drive.rate_hz, ranging, stream)
    position_m, known = record_positions(tag_m, drive, stream("positions"))
    if not known.all():
        position_m = np.column_stack([
            np.interp(t_s, t_s[known], position_m[known, axis]) for axis in (0, 1)
        ])  # fmt: skip
    range_m = np.where(reports.answered, reports.range_m, np.nan)
    return Episode(
        name=f"sim-{seed}-{episode}",
        anchor_ids=_anchor_ids(len(setting.anchor_m)),
        t_s=t_s,
        position_m=np.round(position_m, 6),
        range_m=np.round(range_m.T, 6),
        valid=reports.answered.T,
        tag_up_m=np.full(len(t_s), drive.antenna_up_m),
        anchor_up_m=setting.anchor_up_m,
        frame=PLACE,
        truth=EpisodeTruth(
            anchor_m=setting.anchor_m,
            range_m=np.round(true_range_m.T, 6),
            nlos=reports.nlos.T,
            outlier=reports.outlier.T,
            bias_m=np.round(reports.bias_m.T, 6),
        ),
    )


def _streams(seed: int, episode: int) -> Stream:
    """Return what gives the source of randomness of each name."""
    if not (0 <= seed < _SEEDS and 0 <= episode < _SEEDS):
        raise ConfigError(f"expected a seed and an episode below 2^64, got {seed} and {episode}")
    key = np.array([seed, episode], dtype=np.uint64)

    def stream(name: str) -> np.random.Generator:
        counter = np.array([0, 0, 0, _STREAM_NUMBER[name]], dtype=np.uint64)
        return np.random.Generator(np.random.Philox(key=key, counter=counter))

    return stream


def _poll_times_s(config: PassConfig, rng: np.random.Generator) -> Float64[Array, "N P"]:
    """Draw when anchors are polled: in their own slot of every period, give or take the jitter."""
    ranging = config.ranging
    n_polls = int(config.drive.duration_s * ranging.rate_hz)
    draw = rng.random((config.closure.n_anchors, n_polls + 1))
    slot = ranging.jitter + (1 - 2 * ranging.jitter) * draw[:, :1]
    jitter = ranging.jitter * (2 * draw[:, 1:] - 1)
    return np.asarray((np.arange(n_polls) + slot + jitter) / ranging.rate_hz)


def _record(setting: Setting, rng: np.random.Generator) -> Trajectory:
    """Sample the drive as its positioning records it."""
    drive = setting.config.drive
    t_s = np.arange(int(drive.duration_s * drive.rate_hz) + 1) / drive.rate_hz
    position_m, known = record_positions(setting.drive.position_m(t_s), drive, rng)
    up_m = np.full(int(known.sum()), drive.antenna_up_m)
    return Trajectory(t_s[known], np.round(position_m[known], 6), up_m)


@lru_cache(maxsize=1024)
def _anchor_ids(n: int) -> tuple[str, ...]:
    return tuple(f"cone-{k + 1}" for k in range(n))
