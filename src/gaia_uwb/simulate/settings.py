"""Settings of a simulated pass: road, work zone, drive, radio, and what varies.

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
    """Side of the road on which the work zone lies; ``left`` mirrors everything except the road."""
    lane_width_m: float = Field(default=3.6, ge=2.4, le=5)
    speed_limit_mph: int = Field(default=25, ge=20, le=75, multiple_of=5)
    """Posted speed; it determines the length of the taper."""
    direction_rad: float = Field(default=0.5, ge=-7, le=7)
    """Direction of travel at the first cone, counter-clockwise from east; rotates the scene."""
    curvature_per_m: float = Field(default=-0.002, ge=-0.005, le=0.005)
    """Curvature, positive to the left; 0 is straight. A bend towards the closed lane keeps the open
    one outside the anchors' convex hull."""
    s_curve: bool = False
    """Whether the curvature changes its sign at ``inflection_m``."""
    inflection_m: float = Field(default=80.0, ge=-1000, le=1000)


class ClosureConfig(Settings):
    """The work zone and its cones."""

    kind: ZoneKind = "lane-closure"
    buffer_m: float = Field(default=47.0, ge=0, le=300)
    """Free space between taper and work space; about the stopping distance (155 ft at 25 mph)."""
    work_m: float = Field(default=60.0, ge=0, le=1000)
    downstream_taper_m: float = Field(default=15.0, ge=1, le=60)
    """Length of the taper at the end of a lane or shoulder closure."""
    shoulder_m: float = Field(default=3.0, ge=0.5, le=5)
    """Width of the shoulder next to the closed lane."""
    shift_m: float = Field(default=2.0, ge=0.5, le=5)
    """Distance by which a lane shift moves the lanes."""
    median_m: float = Field(default=8.0, ge=0, le=30)
    """Width of the median that traffic crosses in a crossover."""
    sign_spacing_m: float = Field(default=30.0, ge=10, le=1000)
    """Distance between the three signs of the advance warning (100 ft on a slow urban road)."""
    both_sides: bool = False
    """Whether every other cone stands across the driven lane, not on the edge of the zone."""
    n_anchors: int = Field(default=8, ge=1, le=1000)
    placement_sigma_m: float = Field(default=0.15, ge=0, le=1)
    """Standard deviation of a cone's placement by the crew, along and across the road."""
    antenna_up_m: float = Field(default=0.9, ge=0, le=3)
    """Height of the cones' antennas above the road."""
    antenna_up_sigma_m: float = Field(default=0.02, ge=0, le=0.5)
    n_trucks: int = Field(default=0, ge=0, le=20)
    """Trucks (8 m x 2.5 m, 3 m high) somewhere in the work space; they block lines of sight."""
    n_crew: int = Field(default=0, ge=0, le=50)
    """People (0.5 m wide, 1.8 m high) somewhere in the work space; they block lines of sight."""
    barrier_up_m: float = Field(default=0.0, ge=0, le=3)
    """Height of a barrier along the work space, between traffic and cones; 0 for none."""


class TagConfig(Settings):
    """Where a tag's antenna is from the vehicle's reference point, in the vehicle's frame."""

    forward_m: float = Field(default=0.0, ge=-50, le=50)
    left_m: float = Field(default=0.0, ge=-50, le=50)
    up_m: float = Field(default=0.0, ge=-50, le=50)


class DriveConfig(Settings):
    """How the vehicle drives past; halfway through the drive it is at the middle of the zone."""

    duration_s: float = Field(default=60.0, ge=1, le=3600)
    speed_mps: float = Field(default=6.0, ge=0, le=40)
    """Mean speed; at 0, the vehicle is parked next to the middle of the zone."""
    speed_variation: float = Field(default=0.3, ge=0, lt=1)
    """Share by which traffic changes the speed, down and up again. At constant speed, a clock
    offset looks like cones that are shifted along the road."""
    ahead_m: float = Field(default=0.0, ge=-1000, le=1000)
    """Distance of the vehicle beyond the middle of the zone halfway through the drive; negative if
    it is before the middle."""
    rate_hz: float = Field(default=8.0, ge=1, le=200)
    """Samples of the trajectory per second; also the steps of an episode's timeline."""
    lane_change: bool = True
    """Whether the vehicle merges before a closed lane and moves back after it; otherwise it stays
    in the open lane."""
    lane_change_m: float = Field(default=40.0, ge=5, le=300)
    """Length of a lane change along the road."""
    lane_change_gap_m: float = Field(default=20.0, ge=0, le=300)
    """Distance between a lane change and the closure."""
    lane_offset_m: float = Field(default=0.0, ge=-20, le=20)
    """Lateral distance from that lane, positive towards the open side: for a pass in another
    lane."""
    sway_m: float = Field(default=0.1, ge=0, le=1)
    """Root mean square of the lateral wander within the lane."""
    stop_s: float = Field(default=0.0, ge=0, le=600)
    """Duration of a stop a quarter of the way through; 0 for no stop."""
    turn_after_m: float | None = Field(default=None, ge=0, le=5000)
    """Distance beyond the end of the zone at which the vehicle turns round, to return on the other
    carriageway; none: no turn."""
    antenna_up_m: float = Field(default=1.6, ge=0, le=5)
    """Height of the tag's antenna above the road; of the reference point, if there are ``tags``."""
    tags: tuple[TagConfig, ...] = Field(default=(), strict=False)
    """The tags, as a log states their lever arms. None: one tag, whose path is recorded, without
    delay and pattern."""
    lever_sigma_m: float = Field(default=0.02, ge=0, le=1)
    """Standard deviation of what a true lever arm differs from the stated one by, forward and
    left."""
    crab_sigma_deg: float = Field(default=1.0, ge=0, le=20)
    """Standard deviation of the angle between the vehicle's front and its course."""
    position_sigma_m: float = Field(default=0.01, ge=0, le=5)
    """White noise of the recorded positions (RTK-GNSS: about 0.01 m)."""
    position_walk_m: float = Field(default=0.0, ge=0, le=5)
    """Random walk of the recorded positions: its growth within one second, for each coordinate."""
    position_bias_m: float = Field(default=0.0, ge=0, le=10)
    """Standard deviation of the constant error of each coordinate."""
    position_outage_per_s: float = Field(default=0.0, ge=0, le=1)
    """Number of positioning outages per second with good positions."""
    position_outage_s: float = Field(default=2.0, gt=0, le=600)
    """Mean duration of an outage. A log lacks the positions; an episode interpolates them."""


class RangingConfig(Settings):
    """How anchors are polled, and what goes wrong with their ranges.

    A reported range is the true slant range plus its bias (from distance, drift and lost line of
    sight), plus noise, plus the offset of a burst. Standard deviations apply to *reported* ranges.
    """

    rate_hz: float = Field(default=10.0, gt=0, le=100)
    """Polls of each anchor per second in a log; an episode has one poll at each step."""
    jitter: float = Field(default=0.05, ge=0, le=0.45)
    """Largest deviation of a poll from its regular time, as a share of the polling interval."""
    max_range_m: float = Field(default=60.0, gt=0, le=2000)
    """Anchors farther away do not answer."""
    soft_range_m: float = Field(default=0.0, ge=0, le=1000)
    """Length before ``max_range_m`` over which the share of answers falls from 1 to 0."""
    dropout_share: _Share = 0.08
    """Share of the polls that are lost independently of each other."""
    outage_per_s: float = Field(default=0.1, ge=0, le=10)
    """Number of outages of an anchor per second of service."""
    outage_s: float = Field(default=0.4, gt=0, le=600)
    """Mean duration of an outage."""
    held_share: _Share = 0.05
    """Share of the readings that repeat the previous one."""

    bias_m: float = Field(default=0.0, ge=-5, le=5)
    """Range bias at 10 m."""
    bias_per_decade_m: float = Field(default=0.0, ge=-5, le=5)
    """Growth of the range bias for every factor of ten in distance."""
    drift_sigma_m: float = Field(default=0.0, ge=0, le=5)
    """Standard deviation of the slow error that all anchors share."""
    drift_correlation_s: float = Field(default=8.0, gt=0, le=3600)
    """Time in which the correlation of this error falls to 1/e."""
    own_drift_sigma_m: float = Field(default=0.0, ge=0, le=5)
    """Standard deviation of the slow error that each anchor has on its own."""
    own_drift_correlation_s: float = Field(default=8.0, gt=0, le=3600)
    """Time in which the correlation of this error falls to 1/e."""
    sigma_m: float = Field(default=0.04, ge=0, le=5)
    """Standard deviation of the noise at distance 0."""
    sigma_per_m: float = Field(default=0.0008, ge=0, le=0.1)
    """Growth of this standard deviation per metre of distance."""
    tail_dof: float | None = Field(default=None, ge=2.1, le=100)
    """Degrees of freedom of Student's t with that standard deviation; none: Gaussian noise."""
    averaged: int = Field(default=1, ge=1, le=20)
    """Number of raw ranges that the radio averages for a report (a moving average), which makes its
    noise correlated. The resulting delay counts as part of the clock offset."""

    los_s: float | None = Field(default=8.5, gt=0, le=3600)
    """Mean duration of a stretch with line of sight; none: only obstacles block it."""
    nlos_s: float = Field(default=1.5, gt=0, le=3600)
    """Mean duration of a stretch without line of sight."""
    nlos_bias_m: float = Field(default=0.25, ge=0, le=20)
    """Mean excess of a range without line of sight; log-normal, never negative."""
    nlos_bias_sigma_m: float = Field(default=0.13, ge=0, le=20)
    """Standard deviation of this excess."""
    nlos_bias_correlation_s: float = Field(default=1.5, gt=0, le=3600)
    """Time in which the correlation of the logarithm of this excess falls to 1/e."""
    nlos_sigma_m: float = Field(default=0.0, ge=0, le=20)
    """Standard deviation of additional, independent noise without line of sight."""

    burst_per_s: float = Field(default=0.04, ge=0, le=10)
    """Number of bursts of an anchor per second; in a burst, a few readings in a row share one
    offset."""
    burst_lengths: tuple[float, ...] = Field(default=(0.0, 0.5, 0.5), strict=False, min_length=1)
    """Shares of the bursts that last 1, 2, 3 ... readings; they must add up to 1."""
    burst_negative_share: _Share = 0.8
    """Share of the bursts whose offset is negative."""
    burst_median_m: float = Field(default=4.0, gt=0, le=100)
    """Median size of the offset of a burst; log-normal."""
    burst_log_sigma: float = Field(default=0.7, ge=0, le=3)
    """Standard deviation of the logarithm of this size."""
    burst_max_m: float = Field(default=12.0, gt=0, le=1000)
    """Largest size of the offset of a burst."""

    clock_offset_s: float = Field(default=0.2, ge=-3600, le=3600)
    """Radio clock minus trajectory clock: how late the timestamps of the readings are."""
    vehicle_clock_sigma_s: float = Field(default=0.1, ge=0, le=3600)
    """Standard deviation between the clock offsets of vehicles that have a name."""
    vehicle_bias_sigma_m: float = Field(default=0.05, ge=0, le=5)
    """Standard deviation between the range biases of vehicles that have a name."""
    tag_delay_sigma_m: float = Field(default=0.05, ge=0, le=5)
    """Standard deviation of what all ranges of one of ``drive.tags`` are too long by."""
    tag_pattern_sigma_m: float = Field(default=0.03, ge=0, le=5)
    """Standard deviation of what they depend on the bearing by: of each of two harmonics."""
    azimuth_sigma_deg: float | None = Field(default=None, gt=0, le=180)
    """Standard deviation of the angles of arrival in a log; none: the radio gives no angles."""
    azimuth_bias_sigma_deg: float = Field(default=3.0, ge=0, le=180)
    """Standard deviation of what all angles of a tag are off by."""
    azimuth_wild_share: _Share = 0.05
    """Share of the angles that say nothing: they come from anywhere."""
    cone_neighbours: int = Field(default=0, ge=0, le=999)
    """Number of its nearest cones that each cone ranges; 0: cones range none."""
    cone_rate_hz: float = Field(default=0.5, gt=0, le=100)
    """Ranges of each pair of them per second."""
    rssi_at_1m_dbm: float = Field(default=-77.0, ge=-200, le=30)
    rssi_per_decade_db: float = Field(default=4.5, ge=0, le=60)
    """Loss of received power for every factor of ten in distance; 20 in free space, less in a
    receiver that saturates."""
    rssi_sigma_db: float = Field(default=1.5, ge=0, le=20)
    nlos_first_path_loss_db: float = Field(default=6.0, ge=0, le=60)
    """Additional loss of the first path without line of sight."""

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
    """One pass along one work zone: everything that a simulated scene depends on but its seed."""

    road: RoadConfig = RoadConfig()
    closure: ClosureConfig = ClosureConfig()
    drive: DriveConfig = DriveConfig()
    ranging: RangingConfig = RangingConfig()
    vary: dict[str, list[Choice]] = Field(default_factory=dict)
    """Settings that are drawn anew for every pass of a batch: maps ``section.setting`` to a span
    (two numbers, low and high) or to a list of choices."""
    split: Literal["all", "training", "test"] = "all"
    """Part of the layouts that ``vary`` can produce; ``training`` and ``test`` are disjoint."""

    @model_validator(mode="after")
    def _check(self) -> PassConfig:
        for key, values in self.vary.items():
            section, _, setting = key.partition(".")
            if section not in SECTIONS or setting not in SECTIONS[section].model_fields:
                raise ValueError(f"vary: unknown setting {key!r}")
            if not values:
                raise ValueError(f"vary: expected at least one choice for {key}")
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
