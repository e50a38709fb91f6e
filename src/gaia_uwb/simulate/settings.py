"""Settings of a simulated pass: the road, the work zone, the drive, the radio, what varies.

Lengths along the road are counted from the first cone. Every setting has one value;
:attr:`PassConfig.vary` names those that differ from one pass of a batch to the next.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from gaia_uwb.config import Settings

_Share = Annotated[float, Field(ge=0, le=1)]

ZoneKind = Literal[
    "lane-closure", "shoulder-closure", "lane-shift", "median-crossover", "mobile-operation"
]
"""The kinds of work zone (MUTCD part 6) that ``layouts.py`` lays out."""

Choice = bool | int | float | str


class RoadConfig(Settings):
    """The road: two lanes of one direction."""

    closed_lane: Literal["right", "left"] = "right"
    """Side of the road on which the work zone lies; ``left`` mirrors all but the road itself."""
    lane_width_m: float = Field(default=3.6, ge=2.4, le=5)
    speed_limit_mph: int = Field(default=25, ge=20, le=75, multiple_of=5)
    """Posted speed: it sets the taper's length."""
    direction_rad: float = Field(default=0.5, ge=-7, le=7)
    """Direction of travel at the first cone, counter-clockwise from east: turns the scene."""
    curvature_per_m: float = Field(default=-0.002, ge=-0.005, le=0.005)
    """Curvature, positive to the left; 0 is straight. A bend towards the closed lane keeps the open
    one outside the anchors' convex hull."""
    s_curve: bool = False
    """Let the curvature change its sign at ``inflection_m``."""
    inflection_m: float = Field(default=80.0, ge=-1000, le=1000)


class ClosureConfig(Settings):
    """The work zone, and the cones with anchors on it."""

    kind: ZoneKind = "lane-closure"
    buffer_m: float = Field(default=47.0, ge=0, le=300)
    """Free space between taper and work; about the stopping distance (155 ft at 25 mph)."""
    work_m: float = Field(default=60.0, ge=0, le=1000)
    downstream_taper_m: float = Field(default=15.0, ge=1, le=60)
    """Length of the taper that ends a closure of a lane or shoulder."""
    shoulder_m: float = Field(default=3.0, ge=0.5, le=5)
    """Width of the shoulder beside the closed lane."""
    shift_m: float = Field(default=2.0, ge=0.5, le=5)
    """How far a lane shift moves the lanes."""
    median_m: float = Field(default=8.0, ge=0, le=30)
    """Width of the median that a crossover crosses."""
    sign_spacing_m: float = Field(default=30.0, ge=10, le=1000)
    """Distance between the three signs of the advance warning (100 ft on a slow urban road)."""
    both_sides: bool = False
    """Every other anchor stands across the lane that is driven, not all on the zone's edge."""
    n_anchors: int = Field(default=8, ge=1, le=1000)
    placement_sigma_m: float = Field(default=0.15, ge=0, le=1)
    """How far off its mark a crew sets a cone, along and across the road."""
    antenna_up_m: float = Field(default=0.9, ge=0, le=3)
    """Height of the cones' antennas above the road."""
    antenna_up_sigma_m: float = Field(default=0.02, ge=0, le=0.5)
    n_trucks: int = Field(default=0, ge=0, le=20)
    """Work trucks (8 m x 2.5 m, 3 m high) somewhere in the work space; they cut lines of sight."""
    n_crew: int = Field(default=0, ge=0, le=50)
    """People (0.5 m wide, 1.8 m high) somewhere in the work space; they cut lines of sight."""
    barrier_up_m: float = Field(default=0.0, ge=0, le=3)
    """Height of a barrier along the work space, between traffic and cones; 0 is none."""


class DriveConfig(Settings):
    """How the vehicle drives past; it is at the middle of the zone halfway through."""

    duration_s: float = Field(default=60.0, ge=1, le=3600)
    speed_mps: float = Field(default=6.0, ge=0, le=40)
    """Mean speed; 0 is a vehicle parked beside the middle of the zone."""
    speed_variation: float = Field(default=0.3, ge=0, lt=1)
    """Share of the speed by which traffic slows it down and lets it go. At constant speed a clock
    offset looks like anchors moved along the road."""
    ahead_m: float = Field(default=0.0, ge=-1000, le=1000)
    """How far behind the zone's middle the vehicle is halfway through (before it if negative)."""
    rate_hz: float = Field(default=8.0, ge=1, le=200)
    """Samples of the trajectory per second; steps of an episode's timeline."""
    lane_change: bool = True
    """Merge before a closed lane and move back behind it, or keep to the open lane."""
    lane_change_m: float = Field(default=40.0, ge=5, le=300)
    """Length of road that a lane change takes."""
    lane_change_gap_m: float = Field(default=20.0, ge=0, le=300)
    """Road between a lane change and the closure."""
    lane_offset_m: float = Field(default=0.0, ge=-20, le=20)
    """How far beside that lane it keeps, positive towards the open side: another pass, another
    lane."""
    sway_m: float = Field(default=0.1, ge=0, le=1)
    """Root mean square of the wander within the lane."""
    stop_s: float = Field(default=0.0, ge=0, le=600)
    """How long the vehicle stands still a quarter of the way through; 0 is no stop."""
    turn_after_m: float | None = Field(default=None, ge=0, le=5000)
    """Turn round this far behind the zone's end and come back on the other carriageway."""
    antenna_up_m: float = Field(default=1.6, ge=0, le=5)
    """Height of the tag's antenna above the road."""
    position_sigma_m: float = Field(default=0.01, ge=0, le=5)
    """White noise of the recorded positions (RTK-GNSS: about 0.01 m)."""
    position_walk_m: float = Field(default=0.0, ge=0, le=5)
    """Random walk of the recorded positions: growth in a second, of each coordinate."""
    position_bias_m: float = Field(default=0.0, ge=0, le=10)
    """Standard deviation of a constant error of each coordinate."""
    position_outage_per_s: float = Field(default=0.0, ge=0, le=1)
    """Outages of the positioning per second of good positions."""
    position_outage_s: float = Field(default=2.0, gt=0, le=600)
    """Mean duration of an outage; a log lacks its positions, an episode interpolates them."""


class RangingConfig(Settings):
    """How anchors are polled, and what goes wrong with their ranges.

    A reported range is the true slant range, plus its bias (of distance, drift and lost line of
    sight), plus noise, plus a burst's offset. Standard deviations are those of *reported* ranges.
    """

    rate_hz: float = Field(default=10.0, gt=0, le=100)
    """Polls of each anchor per second in a log; an episode has one at each step."""
    jitter: float = Field(default=0.05, ge=0, le=0.45)
    """How far a poll is off its regular time, at most, as a share of the time between two."""
    max_range_m: float = Field(default=60.0, gt=0, le=2000)
    """Anchors farther away do not answer."""
    soft_range_m: float = Field(default=0.0, ge=0, le=1000)
    """Length before ``max_range_m`` over which the share of answers falls from 1 to 0."""
    dropout_share: _Share = 0.08
    """Share of the polls that are lost, each on its own."""
    outage_per_s: float = Field(default=0.1, ge=0, le=10)
    """Outages of an anchor per second of service."""
    outage_s: float = Field(default=0.4, gt=0, le=600)
    """Mean duration of an outage."""
    held_share: _Share = 0.05
    """Share of the readings that repeat the one before."""

    bias_m: float = Field(default=0.0, ge=-5, le=5)
    """Bias at 10 m ..."""
    bias_per_decade_m: float = Field(default=0.0, ge=-5, le=5)
    """... and its growth with every factor of ten in distance."""
    drift_sigma_m: float = Field(default=0.0, ge=0, le=5)
    """Slow error that all anchors share: its standard deviation ..."""
    drift_correlation_s: float = Field(default=8.0, gt=0, le=3600)
    """... and the time in which its correlation falls to 1/e."""
    own_drift_sigma_m: float = Field(default=0.0, ge=0, le=5)
    """Slow error of each anchor by itself: its standard deviation ..."""
    own_drift_correlation_s: float = Field(default=8.0, gt=0, le=3600)
    """... and the time in which its correlation falls to 1/e."""
    sigma_m: float = Field(default=0.04, ge=0, le=5)
    """Standard deviation of the noise at no distance ..."""
    sigma_per_m: float = Field(default=0.0008, ge=0, le=0.1)
    """... and its growth per metre of distance."""
    tail_dof: float | None = Field(default=None, ge=2.1, le=100)
    """Degrees of freedom of Student's t with that standard deviation; none is Gaussian noise."""
    averaged: int = Field(default=1, ge=1, le=20)
    """How many raw ranges the radio averages for a report (a moving average): makes its noise
    correlated. The delay that comes with it counts as part of the clock offset."""

    los_s: float | None = Field(default=8.5, gt=0, le=3600)
    """Mean duration of a stretch with line of sight; none: only obstacles take it away."""
    nlos_s: float = Field(default=1.5, gt=0, le=3600)
    """Mean duration of a stretch without line of sight."""
    nlos_bias_m: float = Field(default=0.25, ge=0, le=20)
    """Mean excess of a range without line of sight; log-normal, never negative ..."""
    nlos_bias_sigma_m: float = Field(default=0.13, ge=0, le=20)
    """... its standard deviation ..."""
    nlos_bias_correlation_s: float = Field(default=1.5, gt=0, le=3600)
    """... and the time in which the correlation of its logarithm falls to 1/e."""
    nlos_sigma_m: float = Field(default=0.0, ge=0, le=20)
    """Additional noise without line of sight, independent of the other."""

    burst_per_s: float = Field(default=0.04, ge=0, le=10)
    """Bursts of an anchor per second: a few readings in a row share one offset."""
    burst_lengths: tuple[float, ...] = Field(default=(0.0, 0.5, 0.5), strict=False, min_length=1)
    """Shares of the bursts that last 1, 2, 3 ... readings; they add up to 1."""
    burst_negative_share: _Share = 0.8
    burst_median_m: float = Field(default=4.0, gt=0, le=100)
    """Median size of a burst's offset; log-normal ..."""
    burst_log_sigma: float = Field(default=0.7, ge=0, le=3)
    """... with this standard deviation of its logarithm ..."""
    burst_max_m: float = Field(default=12.0, gt=0, le=1000)
    """... and never larger than this."""

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
        if min(self.burst_lengths) < 0 or abs(sum(self.burst_lengths) - 1) > 1e-6:
            raise ValueError(
                f"expected burst_lengths of at least 0 that add up to 1, got {self.burst_lengths}"
            )
        return self

    @property
    def nlos_share(self) -> float:
        """Share of the time that the Markov chain spends without line of sight."""
        return 0.0 if self.los_s is None else self.nlos_s / (self.los_s + self.nlos_s)


SECTIONS: dict[str, type[Settings]] = {
    "road": RoadConfig,
    "closure": ClosureConfig,
    "drive": DriveConfig,
    "ranging": RangingConfig,
}
"""The sections of :class:`PassConfig`, by name."""


class PassConfig(Settings):
    """One pass along one work zone: all that a simulated scene depends on besides its seed."""

    road: RoadConfig = RoadConfig()
    closure: ClosureConfig = ClosureConfig()
    drive: DriveConfig = DriveConfig()
    ranging: RangingConfig = RangingConfig()
    vary: dict[str, list[Choice]] = Field(default_factory=dict)
    """Settings that every pass of a batch draws anew: ``section.setting`` to a span (two numbers,
    low and high) or to a list to choose from."""
    split: Literal["all", "training", "test"] = "all"
    """Which of the layouts that ``vary`` can give: none is in both of the two parts."""

    @model_validator(mode="after")
    def _check(self) -> PassConfig:
        for key, values in self.vary.items():
            section, _, setting = key.partition(".")
            if section not in SECTIONS or setting not in SECTIONS[section].model_fields:
                raise ValueError(f"vary: there is no setting {key!r}")
            if not values:
                raise ValueError(f"vary: expected something to choose from for {key}")
            if is_span(values) and values[0] > values[1]:  # type: ignore[operator]  # numbers
                raise ValueError(f"vary: expected low <= high for {key}, got {values}")
            # Where both ends of a span are possible, what lies between them is, too.
            content = getattr(self, section).model_dump()
            for value in values:
                SECTIONS[section].model_validate(content | {setting: value})
        return self


def is_span(values: list[Choice]) -> bool:
    """Tell whether varied values are the two ends of a span, not a list to choose from."""
    return len(values) == 2 and {type(values[0]), type(values[1])} <= {int, float}
