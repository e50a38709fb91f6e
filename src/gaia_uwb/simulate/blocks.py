"""Episodes that are made at once: one set of arrays, of which each episode has its rows.

Each anchor is a row, and the episodes stand one after another, so that one call computes all of
them. Results are rounded to 1e-6 (a micrometre), for the last bit of a sine is not the same on
every processor.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from gaia_uwb._shared import Array, Bool, ConfigError, Float64
from gaia_uwb.episode import Episode, EpisodeTruth
from gaia_uwb.simulate.presets import PLACE
from gaia_uwb.simulate.ranging import simulate_rows
from gaia_uwb.simulate.rows import PassRows, each
from gaia_uwb.simulate.settings import PassConfig
from gaia_uwb.simulate.setup import Setting, draw_zone, lay_out
from gaia_uwb.simulate.streams import RowStreams, Source, Stream
from gaia_uwb.simulate.trajectories import record_positions


@dataclass(frozen=True)
class EpisodeBlock:
    """Episodes that were made at once, with one number of steps T; their anchors are rows.

    Parameters
    ----------
    seed, numbers
        Seed of the batch, and the numbers of the E episodes in it.
    anchors
        Their numbers of anchors.
    t_s : (E, T)
        Times of the steps, in seconds.
    position_m : (E, T, 2)
        Recorded east and north of the tag's antenna, in metres.
    tag_up_m : (E, T)
        Height of the tag's antenna, in metres.
    anchor_m : (N, 2)
        East and north of the anchors, episode after episode, in metres.
    anchor_up_m : (N,)
        Their heights, in metres.
    range_m : (N, T)
        Measured slant ranges, in metres; NaN where not valid.
    valid : (N, T)
        True where there is a range.
    true_range_m, nlos, outlier, bias_m : (N, T)
        The truth, like that of an :class:`~gaia_uwb.episode.EpisodeTruth`.
    """

    seed: int
    numbers: tuple[int, ...]
    anchors: tuple[int, ...]
    t_s: Float64[Array, "E T"]
    position_m: Float64[Array, "E T 2"]
    tag_up_m: Float64[Array, "E T"]
    anchor_m: Float64[Array, "N 2"]
    anchor_up_m: Float64[Array, "N"]
    range_m: Float64[Array, "N T"]
    valid: Bool[Array, "N T"]
    true_range_m: Float64[Array, "N T"]
    nlos: Bool[Array, "N T"]
    outlier: Bool[Array, "N T"]
    bias_m: Float64[Array, "N T"]

    def episodes(self) -> Iterator[Episode]:
        """Return the episodes, one at a time; each has its own memory."""
        stop = 0
        for k, (number, n) in enumerate(zip(self.numbers, self.anchors, strict=True)):
            start, stop = stop, stop + n
            own = slice(start, stop)
            yield Episode(
                name=f"sim-{self.seed}-{number}",
                anchor_ids=anchor_ids(n),
                t_s=_constant(self.t_s[k]),
                position_m=_constant(self.position_m[k]),
                range_m=_constant(self.range_m[own].T),
                valid=_constant(self.valid[own].T),
                tag_up_m=_constant(self.tag_up_m[k]),
                anchor_up_m=_constant(self.anchor_up_m[own]),
                frame=PLACE,
                truth=EpisodeTruth(
                    anchor_m=_constant(self.anchor_m[own]),
                    range_m=_constant(self.true_range_m[own].T),
                    nlos=_constant(self.nlos[own].T),
                    outlier=_constant(self.outlier[own].T),
                    bias_m=_constant(self.bias_m[own].T),
                ),
            )


def simulate_blocks(config: PassConfig, seed: int, episodes: Sequence[int]) -> list[EpisodeBlock]:
    """Simulate some episodes at once.

    Parameters
    ----------
    config
        Settings of the batch.
    seed
        Seed of the batch, at least 0.
    episodes
        Their numbers in the batch, at least 0.

    Returns
    -------
    list of EpisodeBlock
        The episodes, grouped by what must be the same for all that are computed at once: the number
        of steps and that of averaged ranges. Where neither varies, it is one block.

    Raises
    ------
    ConfigError
        Like :func:`set_up`, or if the settings ask for what an episode does not hold: several tags,
        angles, ranges among cones.
    """
    if config.drive.tags or config.ranging.azimuth_sigma_deg or config.ranging.cone_neighbours:
        problem = "an episode holds no tags, angles of arrival or ranges between cones: make logs"
        raise ConfigError(problem)
    source = Source(seed)
    streams = [source.stream(episode) for episode in episodes]
    draws = [draw_zone(config, stream) for stream in streams]
    rows = PassRows.of(config, [draw.settings for draw in draws])
    steps = np.maximum(1, np.rint(rows.drive.duration_s * rows.drive.rate_hz)).astype(np.int64)
    shapes = np.column_stack([each(it, len(draws)) for it in (steps, rows.ranging.averaged)])
    blocks = []
    for shape in np.unique(shapes, axis=0):
        own = np.flatnonzero((shapes == shape).all(axis=1))
        own_streams, numbers = [streams[k] for k in own], tuple(episodes[int(k)] for k in own)
        setting = lay_out(rows.at(own), [draws[k] for k in own], own_streams)
        blocks.append(_simulate_block(setting, own_streams, int(shape[0]), seed, numbers))
    return blocks


def _simulate_block(
    setting: Setting, streams: Sequence[Stream], n_steps: int, seed: int, numbers: tuple[int, ...]
) -> EpisodeBlock:
    """Simulate episodes of one number of steps."""
    passes, n_passes = setting.passes, len(numbers)
    drive, per_anchor = setting.config.drive, setting.config.at(passes)
    clock_offset_s = setting.config.ranging.clock_offset_s
    t_s = np.broadcast_to(np.arange(n_steps) / drive.rate_hz, (n_passes, n_steps))
    tag_m = setting.drive.position_m(t_s)
    true_range_m, cut = setting.see(tag_m[passes])
    measured_m = true_range_m
    if np.any(clock_offset_s):
        late_m = setting.drive.position_m(t_s - clock_offset_s)
        measured_m, cut = setting.see(late_m[passes])
    step_s = 1 / per_anchor.drive.rate_hz
    row_streams = RowStreams(streams, setting.anchors)
    reports = simulate_rows(measured_m, cut, step_s, per_anchor.ranging, row_streams)
    position_m, known = record_positions(tag_m, drive, streams)
    for k in np.flatnonzero(~known.all(axis=1)):
        for axis in (0, 1):
            recorded_m = position_m[k, known[k], axis]
            position_m[k, :, axis] = np.interp(t_s[k], t_s[k, known[k]], recorded_m)
    return EpisodeBlock(
        seed=seed,
        numbers=numbers,
        anchors=setting.anchors,
        t_s=t_s,
        position_m=np.round(position_m, 6),
        tag_up_m=np.broadcast_to(drive.antenna_up_m, t_s.shape).astype(np.float64),
        anchor_m=setting.anchor_m,
        anchor_up_m=setting.anchor_up_m,
        range_m=np.round(np.where(reports.answered, reports.range_m, np.nan), 6),
        valid=reports.answered,
        true_range_m=np.round(true_range_m, 6),
        nlos=reports.nlos,
        outlier=reports.outlier,
        bias_m=np.round(reports.bias_m, 6),
    )


def _constant(values: Array) -> Array:
    """Return a read-only copy."""
    copy = values.copy()
    copy.flags.writeable = False
    return copy


@lru_cache(maxsize=1024)
def anchor_ids(n: int) -> tuple[str, ...]:
    """Return the names of the first n anchors of a pass."""
    return tuple(f"cone-{k + 1}" for k in range(n))
