"""How the vehicle drives past the closure: speed, lane changes, sway in the lane."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gaia_uwb._typing import Array, Float64
from gaia_uwb.scene import Trajectory
from gaia_uwb.simulate.layouts import corners_along_m, road_to_local
from gaia_uwb.simulate.presets import PassConfig

_SPEED_PERIOD_S = 17.0  # of traffic slowing down and picking up again
# Wavelengths of the wander in the lane: incommensurable, so that it does not repeat.
_SWAY_WAVELENGTH_M = np.array([47.0, 71.0, 113.0, 179.0])


@dataclass(frozen=True)
class Drive:
    """A drive past the closure, known at every moment.

    Parameters
    ----------
    config
        Settings of the pass.
    speed_phase_rad
        Phase of the swing in speed.
    sway_phase_rad : (4,)
        Phases of the wander in the lane.
    """

    config: PassConfig
    speed_phase_rad: float
    sway_phase_rad: Float64[Array, "4"]

    def position_m(self, t_s: Float64[Array, "T"]) -> Float64[Array, "T 2"]:
        """Return the true east and north of the tag's antenna, in metres.

        Parameters
        ----------
        t_s : (T,)
            Time of the trajectory's clock, in seconds; the drive starts at 0.
        """
        drive, road = self.config.drive, self.config.road
        end_m = corners_along_m(self.config)[-1]
        along_m = end_m / 2 + self._driven_m(t_s - drive.duration_s / 2)
        in_open_lane = np.ones_like(along_m)
        if drive.lane_change:
            length_m, gap_m = drive.lane_change_m, drive.lane_change_gap_m
            merge = _smooth_step((along_m + gap_m + length_m) / length_m)
            move_back = _smooth_step((along_m - end_m - gap_m) / length_m)
            in_open_lane = merge - move_back
        wave_rad = 2 * np.pi * along_m[:, None] / _SWAY_WAVELENGTH_M + self.sway_phase_rad
        sway_m = drive.sway_m * np.sqrt(2 / len(_SWAY_WAVELENGTH_M)) * np.sin(wave_rad).sum(axis=1)
        return road_to_local(road, along_m, road.lane_width_m * (in_open_lane - 0.5) + sway_m)

    def _driven_m(self, since_s: Float64[Array, "T"]) -> Float64[Array, "T"]:
        """Integrate the swinging speed from the middle of the drive."""
        drive, swing_rad_s = self.config.drive, 2 * np.pi / _SPEED_PERIOD_S
        phase_rad = self.speed_phase_rad
        gained_s = (np.sin(swing_rad_s * since_s + phase_rad) - np.sin(phase_rad)) / swing_rad_s
        driven_m: Array = drive.speed_mps * (since_s + drive.speed_variation * gained_s)
        return driven_m


def plan_drive(config: PassConfig, rng: np.random.Generator) -> Drive:
    """Draw the swing in speed and the wander in the lane.

    Parameters
    ----------
    config
        Settings of the pass.
    rng
        Source of the phases.
    """
    speed_phase_rad = float(rng.uniform(0, 2 * np.pi))
    return Drive(config, speed_phase_rad, rng.uniform(0, 2 * np.pi, len(_SWAY_WAVELENGTH_M)))


def record_trajectory(drive: Drive, rng: np.random.Generator) -> Trajectory:
    """Sample a drive as its positioning records it: at a steady rate, with a little noise.

    Parameters
    ----------
    drive
        The drive.
    rng
        Source of the noise.
    """
    settings = drive.config.drive
    t_s = np.arange(int(settings.duration_s * settings.rate_hz) + 1) / settings.rate_hz
    noise_m = settings.position_sigma_m * rng.standard_normal((len(t_s), 2))
    return Trajectory(
        t_s=t_s,
        position_m=drive.position_m(t_s) + noise_m,
        up_m=np.full(len(t_s), settings.antenna_up_m),
    )


def _smooth_step(x: Float64[Array, "T"]) -> Float64[Array, "T"]:
    """Return the minimum-jerk step from 0 (x <= 0) to 1 (x >= 1)."""
    x = np.clip(x, 0.0, 1.0)
    step: Array = x**3 * (10 + x * (6 * x - 15))
    return step
