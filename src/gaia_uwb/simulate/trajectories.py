"""How the vehicle drives past the zone (speed, lanes, sway, stop, turn), and how it is recorded."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gaia_uwb._typing import Array, Bool, Float64
from gaia_uwb.simulate.chains import two_state
from gaia_uwb.simulate.layouts import ZonePlan, road_to_local
from gaia_uwb.simulate.settings import DriveConfig, PassConfig

_SPEED_PERIOD_S = 17.0  # of traffic slowing down and picking up again
_BRAKING_S = 3.0  # to a stop, and back to speed
# Wavelengths of the wander in the lane: incommensurable, so that it does not repeat.
_SWAY_WAVELENGTH_M = np.array([47.0, 71.0, 113.0, 179.0])


@dataclass(frozen=True)
class Drive:
    """A drive past the zone, known at every moment.

    Parameters
    ----------
    config
        Settings of the pass.
    plan
        The work zone.
    speed_phase_rad
        Phase of the swing in speed.
    sway_phase_rad : (4,)
        Phases of the wander in the lane.
    """

    config: PassConfig
    plan: ZonePlan
    speed_phase_rad: float
    sway_phase_rad: Float64[Array, "4"]

    def position_m(self, t_s: Float64[Array, "*shape"]) -> Float64[Array, "*shape 2"]:
        """Return the true east and north of the tag's antenna, in metres.

        Parameters
        ----------
        t_s
            Time of the trajectory's clock, in seconds; the drive starts at 0.
        """
        drive = self.config.drive
        driven_m = self.plan.end_m / 2 + drive.ahead_m + self._driven_m(t_s)
        phase_rad = 2 * np.pi * driven_m[..., None] / _SWAY_WAVELENGTH_M + self.sway_phase_rad
        wave = np.sin(phase_rad).sum(axis=-1) * np.sqrt(2 / len(_SWAY_WAVELENGTH_M))
        along_m, open_m = driven_m, drive.sway_m * wave
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

    def _driven_m(self, t_s: Float64[Array, "*shape"]) -> Float64[Array, "*shape"]:
        """Return how far the vehicle has driven since the middle of the drive."""
        drive, swing_rad_s = self.config.drive, 2 * np.pi / _SPEED_PERIOD_S
        since_s = t_s - drive.duration_s / 2
        if drive.stop_s:
            begin_s, lost_s = drive.duration_s / 4, drive.stop_s + _BRAKING_S
            since_s = since_s + lost_s - _lost_s(t_s - begin_s) + _lost_s(t_s - begin_s - lost_s)
        phase_rad = self.speed_phase_rad
        gained_s = (np.sin(swing_rad_s * since_s + phase_rad) - np.sin(phase_rad)) / swing_rad_s
        driven_m: Array = drive.speed_mps * (since_s + drive.speed_variation * gained_s)
        return driven_m


def _lost_s(since_s: Float64[Array, "*shape"]) -> Float64[Array, "*shape"]:
    """Return the time lost since a vehicle began to brake evenly to a standstill."""
    braking_s = np.clip(since_s, 0.0, _BRAKING_S)
    lost_s: Array = braking_s**2 / (2 * _BRAKING_S) + np.maximum(since_s - _BRAKING_S, 0.0)
    return lost_s


def plan_drive(config: PassConfig, plan: ZonePlan, rng: np.random.Generator) -> Drive:
    """Draw the swing in speed and the wander in the lane.

    Parameters
    ----------
    config
        Settings of the pass.
    plan
        The work zone.
    rng
        Source of the phases.
    """
    phase_rad = 2 * np.pi * rng.random(1 + len(_SWAY_WAVELENGTH_M))
    return Drive(config, plan, float(phase_rad[0]), phase_rad[1:])


def record_positions(
    tag_m: Float64[Array, "T 2"], settings: DriveConfig, rng: np.random.Generator
) -> tuple[Float64[Array, "T 2"], Bool[Array, "T"]]:
    """Return the recorded positions and whether the positioning worked, at evenly spaced times.

    Parameters
    ----------
    tag_m : (T, 2)
        True east and north of the tag's antenna ``settings.rate_hz`` times a second, in metres.
    settings
        Settings of the drive.
    rng
        Source of the errors.

    Returns
    -------
    position_m : (T, 2)
        East and north with their errors, in metres.
    known : (T,)
        False during an outage; the first and the last sample are always there.
    """
    position_m = tag_m + settings.position_sigma_m * rng.standard_normal(tag_m.shape)
    if settings.position_bias_m:
        position_m += settings.position_bias_m * rng.standard_normal(2)
    if settings.position_walk_m:
        step_m = settings.position_walk_m / np.sqrt(settings.rate_hz)
        position_m += step_m * np.cumsum(rng.standard_normal(position_m.shape), axis=0)
    known = np.ones(len(tag_m), dtype=np.bool_)
    if settings.position_outage_per_s:
        per_s, outage_s = settings.position_outage_per_s, settings.position_outage_s
        draw = rng.random((1, len(tag_m)))
        known = ~two_state(draw, 1 / per_s, outage_s, 1 / settings.rate_hz)[0]
        known[[0, -1]] = True
    return position_m, known
