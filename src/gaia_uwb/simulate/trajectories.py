"""How the vehicle drives past the zone (speed, lanes, sway, stop, turn), and how it is recorded."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gaia_uwb._shared import Array, Bool, Float64
from gaia_uwb.simulate.chains import Column, two_state
from gaia_uwb.simulate.layouts import ZonePlan, road_to_local
from gaia_uwb.simulate.rows import PassSettings, SectionRows, each
from gaia_uwb.simulate.settings import DriveConfig
from gaia_uwb.simulate.streams import Stream

_SPEED_PERIOD_S = 17.0  # of traffic slowing down and picking up again
_COURSE_M = 0.1  # before and after a place, between which the course is that there
_BRAKING_S = 3.0  # to a stop, and back to speed
# Wavelengths of the wander in the lane: incommensurable, so that it does not repeat.
_SWAY_WAVELENGTH_M = np.array([47.0, 71.0, 113.0, 179.0])

PHASES = 1 + len(_SWAY_WAVELENGTH_M)  # random numbers that a drive takes


@dataclass(frozen=True)
class Drive:
    """A drive past the zone, known at every moment.

    Parameters
    ----------
    config
        Settings of the pass, or of E passes.
    plan
        The work zone.
    speed_phase_rad : () or (E, 1)
        Phase of the swing in speed; with settings of several passes, of each.
    sway_phase_rad : (4,) or (E, 1, 4)
        Phases of the wander in the lane.
    """

    config: PassSettings
    plan: ZonePlan
    speed_phase_rad: Float64[Array, "*rows"]
    sway_phase_rad: Float64[Array, "*rows 4"]

    def position_m(self, t_s: Float64[Array, "*shape"]) -> Float64[Array, "*shape 2"]:
        """Return the true east and north of the tag's antenna, in metres.

        Parameters
        ----------
        t_s
            Time of the trajectory's clock, in seconds; the drive starts at 0. With settings of E
            passes: (E, T).
        """
        return self._place_m(self._station_m(t_s))

    def course_rad(self, t_s: Float64[Array, "*shape"]) -> Float64[Array, "*shape"]:
        """Return the direction of travel, also where the vehicle stands.

        Parameters
        ----------
        t_s
            Like :meth:`position_m`.

        Returns
        -------
        array
            Counter-clockwise from east, in radians.
        """
        driven_m = self._station_m(t_s)
        way_m = self._place_m(driven_m + _COURSE_M) - self._place_m(driven_m - _COURSE_M)
        return np.asarray(np.arctan2(way_m[..., 1], way_m[..., 0]))

    def _place_m(self, driven_m: Float64[Array, "*shape"]) -> Float64[Array, "*shape 2"]:
        """Return east and north where the vehicle has driven so far."""
        drive = self.config.drive
        phase_rad = 2 * np.pi * driven_m[..., None] / _SWAY_WAVELENGTH_M + self.sway_phase_rad
        wave = np.sin(phase_rad).sum(axis=-1) * np.sqrt(2 / len(_SWAY_WAVELENGTH_M))
        along_m, open_m = driven_m, drive.lane_offset_m + drive.sway_m * wave
        if drive.turn_after_m is None:
            open_m = open_m + self.plan.lane_m(along_m)
        else:
            turn_m = self.plan.end_m + drive.turn_after_m
            # Half a circle that ends on the far lane of the other carriageway, then straight back.
            radius_m = self.config.road.lane_width_m + self.config.closure.median_m / 2
            over_m = np.maximum(driven_m - turn_m, 0.0)
            turned_rad = np.minimum(over_m / radius_m, np.pi)
            along_m = np.minimum(driven_m, turn_m) + radius_m * np.sin(turned_rad)
            along_m = along_m - np.maximum(over_m - np.pi * radius_m, 0.0)
            open_m = open_m + self.plan.lane_m(np.minimum(driven_m, turn_m))
            open_m = open_m + radius_m * (1 - np.cos(turned_rad))
        return road_to_local(self.config.road, along_m, open_m)

    def _station_m(self, t_s: Float64[Array, "*shape"]) -> Float64[Array, "*shape"]:
        """Return how far along its way the vehicle is, from the first cone."""
        return np.asarray(self.plan.end_m / 2 + self.config.drive.ahead_m + self._driven_m(t_s))

    def _driven_m(self, t_s: Float64[Array, "*shape"]) -> Float64[Array, "*shape"]:
        """Return how far the vehicle has driven since the middle of the drive."""
        drive, swing_rad_s = self.config.drive, 2 * np.pi / _SPEED_PERIOD_S
        since_s = t_s - drive.duration_s / 2
        if np.any(drive.stop_s):
            begin_s, lost_s = drive.duration_s / 4, drive.stop_s + _BRAKING_S
            stopping_s = since_s + lost_s - _lost_s(t_s - begin_s) + _lost_s(t_s - begin_s - lost_s)
            since_s = np.where(np.greater(drive.stop_s, 0), stopping_s, since_s)
        phase_rad = self.speed_phase_rad
        gained_s = (np.sin(swing_rad_s * since_s + phase_rad) - np.sin(phase_rad)) / swing_rad_s
        driven_m: Array = drive.speed_mps * (since_s + drive.speed_variation * gained_s)
        return driven_m


def _lost_s(since_s: Float64[Array, "*shape"]) -> Float64[Array, "*shape"]:
    """Return the time lost since a vehicle began to brake evenly to a standstill."""
    braking_s = np.clip(since_s, 0.0, _BRAKING_S)
    lost_s: Array = braking_s**2 / (2 * _BRAKING_S) + np.maximum(since_s - _BRAKING_S, 0.0)
    return lost_s


def plan_drive(config: PassSettings, plan: ZonePlan, draw: Float64[Array, "*rows 5"]) -> Drive:
    """Start a drive somewhere in its swing in speed and its wander in the lane.

    Parameters
    ----------
    config
        Settings of the pass, or of E passes.
    plan
        The work zone.
    draw : (5,) or (E, 1, 5)
        Independent numbers, uniform between 0 and 1.
    """
    phase_rad = 2 * np.pi * draw
    return Drive(config, plan, phase_rad[..., 0], phase_rad[..., 1:])


def record_positions(
    tag_m: Float64[Array, "E T 2"], settings: DriveConfig | SectionRows, streams: Sequence[Stream]
) -> tuple[Float64[Array, "E T 2"], Bool[Array, "E T"]]:
    """Return the recorded positions and whether the positioning worked, at evenly spaced times.

    Parameters
    ----------
    tag_m : (E, T, 2)
        True east and north of each pass's antenna ``settings.rate_hz`` times a second, in metres.
    settings
        Settings of the drives.
    streams
        The passes' sources of randomness.

    Returns
    -------
    position_m : (E, T, 2)
        East and north with their errors, in metres.
    known : (E, T)
        False during an outage; the first and the last sample are always there.
    """
    passes, steps, _ = tag_m.shape
    noise, walk = np.zeros((2, *tag_m.shape))
    bias, draw = np.zeros((passes, 1, 2)), np.ones((passes, steps))
    varied = settings.position_bias_m, settings.position_walk_m, settings.position_outage_per_s
    biased, walking, failing = (each(value, passes) for value in varied)
    for k, stream in enumerate(streams):
        rng = stream("positions")
        rng.standard_normal(out=noise[k])
        if biased[k]:
            rng.standard_normal(out=bias[k])
        if walking[k]:
            rng.standard_normal(out=walk[k])
        if failing[k]:
            rng.random(out=draw[k])
    position_m = tag_m + _per_axis(settings.position_sigma_m) * noise
    if biased.any():
        position_m += _per_axis(settings.position_bias_m) * bias
    if walking.any():
        step_m = settings.position_walk_m / np.sqrt(settings.rate_hz)
        position_m += _per_axis(step_m) * np.cumsum(walk, axis=1)
    known = np.ones((passes, steps), dtype=np.bool_)
    if failing.any():
        with np.errstate(divide="ignore"):
            good_s = np.divide(1, settings.position_outage_per_s)  # infinite without outages
        known = ~two_state(draw, good_s, settings.position_outage_s, 1 / settings.rate_hz)
        known[:, [0, -1]] = True
    return position_m, known


def _per_axis(value: Column) -> float | Float64[Array, "E 1 1"]:
    """Return a number as it is, and a column so that it goes with places (E, T, 2)."""
    return value[:, :, None] if isinstance(value, np.ndarray) else value
