"""What is given before the first poll of a pass: its zone, its anchors, its obstacles, its drive.

Each anchor is a row, and the anchors of the passes that are made at once stand one after another,
so that one call computes all of them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from gaia_uwb._shared import Array, Bool, Float64, Int64
from gaia_uwb.simulate.layouts import ZonePlan, place_anchors, plan_zone
from gaia_uwb.simulate.obstacles import Obstacles, place_obstacles
from gaia_uwb.simulate.rows import PassRows, each
from gaia_uwb.simulate.settings import Choice, PassConfig
from gaia_uwb.simulate.streams import Source, Stream
from gaia_uwb.simulate.trajectories import PHASES, Drive, plan_drive
from gaia_uwb.simulate.variation import draw_settings


class ZoneDraw(NamedTuple):
    """What is drawn first for a pass.

    Parameters
    ----------
    settings
        Values of the settings that vary.
    phases : (5,)
        Numbers between 0 and 1 for the drive.
    scatter : (N, 3)
        Standard normal numbers for the places of the anchors.
    """

    settings: Mapping[str, Choice]
    phases: Float64[Array, "5"]
    scatter: Float64[Array, "N 3"]


@dataclass(frozen=True)
class Setting:
    """What is given before the first poll of some passes: zones, their anchors, the drives.

    Parameters
    ----------
    config
        Settings of the E passes.
    plan
        Their work zones in road coordinates.
    anchors
        Their numbers of anchors.
    anchor_m : (N, 2)
        East and north of the anchors, pass after pass, in metres.
    anchor_up_m : (N,)
        Their heights above the road, in metres.
    obstacles
        What may cut a line of sight.
    drive
        The drives.
    """

    config: PassRows
    plan: ZonePlan
    anchors: tuple[int, ...]
    anchor_m: Float64[Array, "N 2"]
    anchor_up_m: Float64[Array, "N"]
    obstacles: Obstacles
    drive: Drive

    @property
    def passes(self) -> Int64[Array, "N"]:
        """Which of the passes each anchor belongs to."""
        return np.repeat(np.arange(len(self.anchors)), self.anchors)

    def see(
        self, tag_m: Float64[Array, "N P 2"], above_m: float = 0.0
    ) -> tuple[Float64[Array, "N P"], Bool[Array, "N P"]]:
        """Return the slant ranges from these places, and which lines of sight obstacles cut.

        Parameters
        ----------
        tag_m : (N, P, 2)
            Places of the tag's antenna for each anchor: east and north, in metres.
        above_m
            How far it is above ``drive.antenna_up_m``, in metres.
        """
        up_m = each(self.config.drive.antenna_up_m, len(self.anchors))[self.passes, None] + above_m
        gap_m = tag_m - self.anchor_m[:, None]
        up_gap_m = up_m - self.anchor_up_m[:, None]
        range_m = np.sqrt(gap_m[..., 0] ** 2 + gap_m[..., 1] ** 2 + up_gap_m**2)
        cut = self.obstacles.cut(tag_m, up_m, self.anchor_m, self.anchor_up_m, self.anchors)
        return range_m, cut


def draw_zone(config: PassConfig, stream: Stream) -> ZoneDraw:
    """Draw what a batch varies, the drive and the places of the anchors of one pass.

    Parameters
    ----------
    config
        Settings of the batch.
    stream
        Source of randomness of the pass.

    Raises
    ------
    ConfigError
        If no layout is in the part that ``config.split`` asks for.
    """
    rng = stream("zone")
    settings = draw_settings(config, rng)
    n = int(settings.get("closure.n_anchors", config.closure.n_anchors))
    # The anchors come last: one more of them changes nothing else.
    return ZoneDraw(settings, rng.random(PHASES), rng.standard_normal((n, 3)))


def lay_out(config: PassRows, draws: Sequence[ZoneDraw], streams: Sequence[Stream]) -> Setting:
    """Lay out the zones, their anchors and the drives of some passes.

    Parameters
    ----------
    config
        Settings of the passes.
    draws
        What was drawn for each of them.
    streams
        Their sources of randomness.
    """
    plan = plan_zone(config)
    anchors = [len(draw.scatter) for draw in draws]
    number = np.concatenate([np.arange(n) for n in anchors])
    scatter = np.concatenate([draw.scatter for draw in draws])
    rows = config.at(np.repeat(np.arange(len(anchors)), anchors))
    anchor_m, anchor_up_m = place_anchors(rows, number, scatter)
    return Setting(
        config=config,
        plan=plan,
        anchors=tuple(anchors),
        anchor_m=np.round(anchor_m, 6),
        anchor_up_m=np.round(anchor_up_m, 6),
        obstacles=place_obstacles(config, streams),
        drive=plan_drive(config, plan, np.stack([draw.phases for draw in draws])[:, None]),
    )


def set_up(config: PassConfig, seed: int, episode: int, zone: int | None = None) -> Setting:
    """Draw the work zone, its anchors and the drive of a pass.

    Parameters
    ----------
    config, seed, episode, zone
        Like :func:`~gaia_uwb.simulate.simulate_pass`.

    Raises
    ------
    ConfigError
        If the seed or the episode's number is not in 0 ... 2^64 - 1, or no layout is in the part
        that ``config.split`` asks for.
    """
    stream = Source(seed).stream(episode)
    draw = draw_zone(config, stream)
    if zone is not None:
        draw = _past(draw, draw_zone(config, Source(seed).stream(zone)))
    return lay_out(PassRows.of(config, [draw.settings]), [draw], [stream])


def _past(draw: ZoneDraw, zone: ZoneDraw) -> ZoneDraw:
    """Return the drive and the radio of one draw, past the road and the anchors of another."""
    of_zone = ("road.", "closure.")
    own = {key: value for key, value in draw.settings.items() if not key.startswith(of_zone)}
    given = {key: value for key, value in zone.settings.items() if key.startswith(of_zone)}
    return ZoneDraw(own | given, draw.phases, zone.scatter)
