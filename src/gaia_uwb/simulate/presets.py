"""Settings of a simulated pass, and the named presets made of them.

Along-road lengths are counted from the first cone of the merging taper. Where a default imitates a
measurement, it is the outdoor UWB data set's: polls at 10 Hz, a clock 0.2 s late, bursts that are
nearly all negative, a received power that hardly falls with distance.

>>> from gaia_uwb.simulate.presets import PRESETS
>>> sorted(PRESETS)
['lane-closure', 'parked', 'straight']
"""

from __future__ import annotations

from types import MappingProxyType
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from gaia_uwb.scene import LocalFrame

PLACE = LocalFrame(lat_deg=42.0, lon_deg=-93.5, alt_m=270.0)
"""Origin of every simulated scene: a made-up place, a round coordinate among the fields of Iowa."""

_Share = Annotated[float, Field(ge=0, lt=1)]


class _Settings(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


class RoadConfig(_Settings):
    """The road: two lanes of one direction, one of them closed."""

    closed_lane: Literal["right", "left"] = "right"
    """Which lane is closed; the anchors stand on this side of the path."""
    lane_width_m: float = Field(default=3.6, ge=2.4, le=5)
    speed_limit_mph: int = Field(default=25, ge=20, le=75, multiple_of=5)
    """Posted speed: it sets the taper's length."""
    direction_rad: float = Field(default=0.5, ge=-7, le=7)
    """Direction of travel at the taper's start, counter-clockwise from east: turns the scene."""
    curvature_per_m: float = Field(default=-0.002, ge=-0.005, le=0.005)
    """Constant curvature, positive to the left; 0 is straight. A bend towards the closed lane keeps
    the open one outside the anchors' convex hull."""


class ClosureConfig(_Settings):
    """What stands on the closed lane: merging taper, buffer, work, downstream taper."""

    buffer_m: float = Field(default=47.0, ge=0, le=300)
    """Free space between taper and work; about the stopping distance (155 ft at 25 mph)."""
    work_m: float = Field(default=60.0, ge=0, le=1000)
    downstream_taper_m: float = Field(default=15.0, ge=1, le=60)
    n_anchors: int = Field(default=8, ge=1, le=1000)
    placement_sigma_m: float = Field(default=0.15, ge=0, le=1)
    """How far off its mark a crew sets a cone, along and across the road."""
    antenna_up_m: float = Field(default=0.9, ge=0, le=3)
    """Height of the cones' antennas above the road."""
    antenna_up_sigma_m: float = Field(default=0.02, ge=0, le=0.5)


class DriveConfig(_Settings):
    """How the vehicle drives past; it is at the middle of the closure halfway through."""

    duration_s: float = Field(default=60.0, ge=1, le=3600)
    speed_mps: float = Field(default=6.0, ge=0, le=40)
    """Mean speed; 0 is a vehicle parked beside the middle of the closure."""
    speed_variation: float = Field(default=0.3, ge=0, lt=1)
    """Share of the speed by which traffic slows it down and lets it go. At constant speed a clock
    offset looks like anchors moved along the road."""
    rate_hz: float = Field(default=8.0, ge=1, le=200)
    """Samples of the trajectory per second."""
    lane_change: bool = True
    """Merge before the taper and move back behind the closure, or keep to the open lane."""
    lane_change_m: float = Field(default=40.0, ge=5, le=300)
    """Length of road that a lane change takes."""
    lane_change_gap_m: float = Field(default=20.0, ge=0, le=300)
    """Road between a lane change and the closure."""
    sway_m: float = Field(default=0.1, ge=0, le=1)
    """Root mean square of the wander within the lane."""
    position_sigma_m: float = Field(default=0.01, ge=0, le=1)
    """Noise of the recorded positions (RTK-GNSS: about 0.01 m)."""
    antenna_up_m: float = Field(default=1.6, ge=0, le=5)
    """Height of the tag's antenna above the road."""


class RangingConfig(_Settings):
    """How anchors are polled and what goes wrong with their ranges."""

    rate_hz: float = Field(default=10.0, gt=0, le=100)
    """Polls of each anchor per second."""
    max_range_m: float = Field(default=60.0, gt=0, le=1000)
    """Anchors farther away do not answer."""
    sigma_m: float = Field(default=0.04, ge=0, le=1)
    """Standard deviation of the Gaussian noise at no distance ..."""
    sigma_per_m: float = Field(default=0.0008, ge=0, le=0.1)
    """... and its growth per metre of distance."""
    nlos_share: _Share = 0.15
    """Share of the time without line of sight."""
    nlos_duration_s: float = Field(default=1.5, gt=0, le=600)
    """Mean duration of a stretch without line of sight; at least one poll."""
    nlos_bias_m: float = Field(default=0.25, ge=0, le=20)
    """Mean of the excess range without line of sight; log-normal, never negative."""
    burst_rate: _Share = 0.004
    """Probability that a burst (2 or 3 readings with one constant offset) starts at a reading."""
    burst_min_m: float = Field(default=1.0, ge=0, le=1000)
    burst_max_m: float = Field(default=12.0, ge=0, le=1000)
    """A burst's offset lies between the two in size and has either sign."""
    burst_negative_share: float = Field(default=0.8, ge=0, le=1)
    dropout_share: _Share = 0.12
    """Share of the polls that get no answer."""
    dropout_duration_s: float = Field(default=0.15, gt=0, le=600)
    """Mean duration of a dropout; at least one poll."""
    held_share: _Share = 0.05
    """Share of the readings that repeat the one before."""
    clock_offset_s: float = Field(default=0.2, ge=-3600, le=3600)
    """Radio clock minus trajectory clock: how late the readings' stamps are."""
    rssi_at_1m_dbm: float = Field(default=-77.0, ge=-200, le=30)
    rssi_per_decade_db: float = Field(default=4.5, ge=0, le=60)
    """Loss of received power for each tenfold distance; 20 in free space, less in a receiver
    that saturates."""
    rssi_sigma_db: float = Field(default=1.5, ge=0, le=20)
    nlos_first_path_loss_db: float = Field(default=6.0, ge=0, le=60)
    """How much weaker the first path is without line of sight."""

    @model_validator(mode="after")
    def _check(self) -> RangingConfig:
        if self.burst_min_m > self.burst_max_m:
            raise ValueError(
                "expected burst_min_m <= burst_max_m, "
                f"got {self.burst_min_m:g} and {self.burst_max_m:g}"
            )
        for name in ("nlos", "dropout"):
            share = getattr(self, f"{name}_share")
            polls = max(1.0, self.rate_hz * getattr(self, f"{name}_duration_s"))
            if share > polls / (1 + polls):
                raise ValueError(
                    f"{name}_share {share:g} is too much for its short duration: "
                    f"stretches of {polls:g} polls reach {polls / (1 + polls):g}"
                )
        return self


class PassConfig(_Settings):
    """One pass along one closure: everything that a simulated scene depends on besides its seed."""

    road: RoadConfig = RoadConfig()
    closure: ClosureConfig = ClosureConfig()
    drive: DriveConfig = DriveConfig()
    ranging: RangingConfig = RangingConfig()


DEFAULT_PRESET = "lane-closure"

PRESETS = MappingProxyType(
    {
        DEFAULT_PRESET: PassConfig(),
        # A path this straight lets the mirror image of every anchor fit as well as the anchor.
        "straight": PassConfig(
            road=RoadConfig(curvature_per_m=0.0),
            drive=DriveConfig(lane_change=False, sway_m=0.03),
        ),
        "parked": PassConfig(drive=DriveConfig(speed_mps=0.0, lane_change=False)),
    }
)
"""Named settings: ``sim:NAME`` on the command line."""
