"""Simulated passes of a vehicle along a lane closure, with the truth of everything.

One seed gives one scene. The layout, the drive and every anchor draw from streams of their own, so
that one more anchor leaves the others' readings as they are, and episode k made alone is episode k
of a batch.

>>> from gaia_uwb.simulate import PRESETS, simulate_pass
>>> scene = simulate_pass(PRESETS["lane-closure"], seed=0)
>>> scene.n_anchors, len(scene.trajectory), scene.truth.clock_offset_s
(8, 481, 0.2)
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from gaia_uwb._typing import Array, Bool, Float64
from gaia_uwb.errors import ConfigError, SourceError
from gaia_uwb.scene import RangeLog, Scene, Truth
from gaia_uwb.simulate.layouts import place_anchors
from gaia_uwb.simulate.presets import DEFAULT_PRESET, PLACE, PRESETS, PassConfig
from gaia_uwb.simulate.ranging import Readings, simulate_readings
from gaia_uwb.simulate.trajectories import plan_drive, record_trajectory

__all__ = ["PRESETS", "PassConfig", "load", "simulate", "simulate_pass"]


def simulate_pass(config: PassConfig, seed: int, *, episode: int = 0) -> Scene:
    """Simulate one pass along a lane closure.

    Parameters
    ----------
    config
        Settings of the pass.
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
        If no anchor gives a single reading.
    """
    root = np.random.SeedSequence(entropy=seed, spawn_key=(episode,))
    layout, wander, record, *own = (
        np.random.Generator(np.random.PCG64(child))
        for child in root.spawn(3 + config.closure.n_anchors)
    )
    anchor_m, anchor_up_m = place_anchors(config, layout)
    drive = plan_drive(config, wander)
    per_anchor = [
        simulate_readings(drive, place_m, float(up_m), config.ranging, rng)
        for place_m, up_m, rng in zip(anchor_m, anchor_up_m, own, strict=True)
    ]
    offset_s = config.ranging.clock_offset_s
    ranges, nlos, true_range_m = _merge(per_anchor, offset_s)
    return Scene(
        name=f"sim-{seed}-{episode}",
        trajectory=record_trajectory(drive, record),
        ranges=ranges,
        anchor_ids=tuple(f"cone-{k + 1}" for k in range(config.closure.n_anchors)),
        anchor_up_m=anchor_up_m,
        frame=PLACE,
        truth=Truth(anchor_m=anchor_m, nlos=nlos, range_m=true_range_m, clock_offset_s=offset_s),
    )


def simulate(config: PassConfig, n: int, seed: int) -> Iterator[Scene]:
    """Simulate a batch of passes that differ in everything random, one at a time.

    Parameters
    ----------
    config
        Settings of every pass.
    n
        Number of passes.
    seed
        Seed of the batch, at least 0.

    Yields
    ------
    Scene
        Episode 0 to n - 1, each what :func:`simulate_pass` makes of it alone.

    Raises
    ------
    ConfigError
        If a pass has not a single reading.
    """
    return (simulate_pass(config, seed, episode=k) for k in range(n))


def load(part: str = "") -> list[Scene]:
    """Simulate the pass that a source's name asks for.

    Parameters
    ----------
    part
        ``PRESET/SEED``, ``PRESET`` (seed 0) or nothing (the default preset): what follows ``sim:``
        in a source's name.

    Raises
    ------
    SourceError
        If there is no such preset, or the seed is no whole number of at least 0.

    Examples
    --------
    >>> [scene.name for scene in load("straight/7")]
    ['sim:straight/7']
    """
    preset, _, seed = (part or DEFAULT_PRESET).partition("/")
    if preset not in PRESETS:
        raise SourceError(f"sim:{part}: expected one of {', '.join(PRESETS)}, got {preset!r}")
    if "/" in part and not (seed.isascii() and seed.isdigit()):
        raise SourceError(f"sim:{part}: expected a whole number as seed, got {seed!r}")
    scene = simulate_pass(PRESETS[preset], int(seed or 0))
    return [replace(scene, name=f"sim:{preset}/{int(seed or 0)}")]


def _merge(
    per_anchor: list[Readings], clock_offset_s: float
) -> tuple[RangeLog, Bool[Array, "R"], Float64[Array, "R"]]:
    """Bring the anchors' readings into one log in the radio's time; return its truth beside it."""
    anchor = np.repeat(np.arange(len(per_anchor)), [len(r.t_s) for r in per_anchor])
    if not len(anchor):
        raise ConfigError("the simulated pass has no reading: no anchor answers within max_range_m")
    t_s = np.concatenate([r.t_s for r in per_anchor])
    order = np.argsort(t_s, kind="stable")

    def column(name: str) -> Array:
        values: Array = np.concatenate([getattr(r, name) for r in per_anchor])
        return values[order]

    log = RangeLog(
        t_s=t_s[order] + clock_offset_s,
        anchor=anchor[order],
        range_m=column("range_m"),
        rssi_dbm=column("rssi_dbm"),
        rssi_fp_dbm=column("rssi_fp_dbm"),
    )
    return log, column("nlos"), column("true_range_m")
