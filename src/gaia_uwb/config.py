"""Every setting of GAIA: small, strict, frozen models with units in their names.

All defaults live here and nowhere else; they run without any file. Precedence: these defaults,
then a YAML file, then the command line. An unknown key or an impossible value is an error.

>>> from gaia_uwb.config import PipelineConfig
>>> PipelineConfig().alignment.max_gap_s
'auto'
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import (
    BaseModel,
    ConfigDict,
    Discriminator,
    Field,
    Tag,
    ValidationError,
    model_validator,
)

from gaia_uwb._shared import ConfigError, printable, read_yaml, shortened, shown

LONGEST_NAME = 400
"""Longest name of a scene in a file, in characters; all results and messages repeat it."""

_MOST_PROBLEMS = 5
_NUMBER = "a number"  # tells which of two types a value was read as; no part of a setting's name


def _auto_or_number(value: Any) -> str:
    return "auto" if value == "auto" else _NUMBER


AutoSeconds = Annotated[
    Annotated[Literal["auto"], Tag("auto")] | Annotated[float, Field(gt=0, le=60), Tag(_NUMBER)],
    Discriminator(_auto_or_number),
]
"""``auto``, or a number of seconds above 0 and of at most 60."""


class Settings(BaseModel):
    """Base of all settings: unknown keys, lossy types, NaN and infinity are errors; values stay."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


class Known(Settings):
    """A number that is known to some certainty."""

    value: float
    """The number, in the unit that the name of the setting ends in."""
    sigma: float = Field(gt=0)
    """Its standard deviation, in the same unit."""


class AlignmentConfig(Settings):
    """How ranges and trajectory are brought onto one timeline (``timeline.py``)."""

    clock_offset: Literal["auto", "off"] = "auto"
    """Whether to estimate the offset between the two clocks, or trust both as they are."""
    max_clock_offset_s: float = Field(default=2.0, ge=0.1, le=60)
    """Largest clock offset that is searched, in either direction."""
    clock_offset_sigma_s: float = Field(default=0.5, gt=0, le=60)
    """Prior standard deviation of the clock offset, about 0."""
    drive_offset_sigma_s: float = Field(default=0.005, ge=0, le=60)
    """Standard deviation between the clock offsets of several drives past one zone: little, if one
    vehicle drove them all; as much as ``clock_offset_sigma_s`` for vehicles of different makes."""
    error_correlation_s: float = Field(default=8.0, gt=0, le=600)
    """Errors of ranges further apart than this are treated as independent."""
    gate: bool = True
    """Whether to remove spikes (short bursts far from their neighbours)."""
    max_gap_s: AutoSeconds = "auto"
    """Longest gap between two readings of an anchor that is interpolated (``linear``); with
    ``nearest``, a reading is used up to half of this before and after it. ``auto``: three times
    the anchor's own usual interval between readings, but at least 1 s and at most 8 s."""
    max_pose_gap_s: float = Field(default=1.5, gt=0, le=60)
    """Longest gap between two samples of the trajectory that is interpolated."""
    resample: Literal["linear", "nearest"] = "linear"
    """How ranges are resampled onto the timeline."""


class CalibrationConfig(Settings):
    """How the radios' range bias is estimated from a whole log (``calibration.py``)."""

    range_bias: Literal["auto", "off"] = "auto"
    """Whether to estimate and subtract the bias that all anchors share, or use ranges as they
    are."""
    bias_sigma_m: float = Field(default=0.2, ge=0, le=10)
    """Prior standard deviation, about 0, of the bias at 10 m."""
    bias_slope_sigma_m: float = Field(default=0.25, ge=0, le=10)
    """Prior standard deviation, about 0, of the bias's growth per factor of ten in range."""


class SolverConfig(Settings):
    """How anchors are located from their ranges (``zone_places.py``)."""

    kind: Literal["robust", "wls"] = "robust"
    """``robust``: GAIA's own solver, without labels. ``wls``: the paper's weighted least
    squares."""
    min_ranges: int = Field(default=4, ge=3, le=1_000_000)
    """An anchor with fewer usable ranges is not located."""
    student_t_dof: float = Field(default=4.0, ge=1.0, le=100.0)
    """Calibration only: degrees of freedom of the Student-t distribution that models the errors'
    tails. The robust solver estimates how many readings are outliers."""
    error_correlation_s: float = Field(default=8.0, gt=0, le=600)
    """Calibration and ``wls`` only: errors of ranges further apart than this are treated as
    independent. The robust solver models slow errors by place, not by time."""
    anchor_bias_sigma_m: float = Field(default=0.05, ge=0, le=10)
    """Calibration only: prior standard deviation of an anchor's own range bias, in addition to the
    shared one (antenna delay). The robust solver estimates it."""
    position_floor_m: float = Field(default=0.025, ge=0, le=10)
    """Standard deviation that no number of ranges reduces (antenna phase centres, survey)."""
    azimuth_front_back: bool = False
    """Whether an angle of arrival may as well have come from the mirror direction, before instead
    of behind the vehicle: two antennas beside each other cannot tell."""
    ill_conditioned_above_m: float = Field(default=2.0, gt=0, le=1e6)
    """An anchor whose standard deviation in the worst direction exceeds this is flagged."""


class SidesConfig(Settings):
    """How the sides of a scene's anchors are decided jointly (``sides.py``)."""

    joint: bool = True
    """Whether to decide jointly; otherwise each anchor takes the side that fits its own ranges
    better."""
    ambiguous_above: float = Field(default=0.1, gt=0, lt=0.5)
    """An anchor whose mirror position has more than this probability is called ambiguous."""


class KnownAnchor(Settings):
    """A surveyed cone: its position in the local frame or in WGS84."""

    anchor_id: str
    east_m: float | None = None
    north_m: float | None = None
    lat_deg: float | None = Field(default=None, ge=-90, le=90)
    lon_deg: float | None = Field(default=None, ge=-180, le=180)
    sigma_m: float = Field(default=0.1, gt=0, le=100)
    """Standard deviation of each coordinate, including the disagreement between frames."""

    @model_validator(mode="after")
    def _check(self) -> KnownAnchor:
        local = [self.east_m is not None, self.north_m is not None]
        earth = [self.lat_deg is not None, self.lon_deg is not None]
        if not (all(local) and not any(earth)) and not (all(earth) and not any(local)):
            raise ValueError("expected either east_m and north_m, or lat_deg and lon_deg")
        return self


class PriorConfig(Settings):
    """What is known of the zone before the drive (``known_facts.py``); nothing by default."""

    side: Literal["left", "right"] | None = None
    """All cones are on this side of the path, in the direction of travel."""
    closure: (
        Literal[
            "lane-closure", "shoulder-closure", "lane-shift", "mobile-operation", "median-crossover"
        ]
        | None
    ) = None
    """Type of closure: all but the last one imply that the cones are all on one side, left or
    right."""
    spacing_m: float | None = Field(default=None, gt=0, le=1000)
    """Distance between consecutive cones."""
    spacing_sigma_m: float = Field(default=0.5, gt=0, le=100)
    """Standard deviation of that distance."""
    known_anchors: tuple[KnownAnchor, ...] = Field(default=(), strict=False)
    """Surveyed cones."""
    statement_error: float = Field(default=0.02, gt=0, lt=0.5)
    """Probability that a statement is wrong: as a whole, and for a single cone or pair."""

    @model_validator(mode="after")
    def _check(self) -> PriorConfig:
        ids = [known.anchor_id for known in self.known_anchors]
        if len(set(ids)) < len(ids):
            raise ValueError(f"known anchors: ids must be unique, got {ids}")
        return self

    @property
    def says_nothing(self) -> bool:
        """Whether nothing is known beforehand."""
        return not (self.side or self.closure or self.spacing_m or self.known_anchors)


LonLat = Annotated[tuple[float, float], Field(strict=False)]
"""Longitude and latitude, in degrees."""


class BoundaryConfig(Settings):
    """What is known of the boundary that a driver sees (``roadside``); nothing by default."""

    form: Literal["one-row", "lane-between", "works-between", "area"] | None = None
    """How the cones of every zone stand, as seen from the road; else it is found."""
    closed_width_m: float | None = Field(default=None, gt=0, le=100)
    """How far a zone of one row reaches from its edge away from traffic."""
    closed_lanes: int | None = Field(default=None, ge=1, le=10)
    """The same in lanes."""
    lane_width_m: float = Field(default=3.6, ge=2, le=6)
    """Width of one lane."""
    road_edge: tuple[LonLat, ...] = Field(default=(), strict=False)
    """The same as a line along the road's edge: longitude and latitude of its points, in degrees,
    as in GeoJSON."""

    @model_validator(mode="after")
    def _check(self) -> BoundaryConfig:
        stated = [self.closed_width_m is not None, self.closed_lanes is not None, self.road_edge]
        if sum(map(bool, stated)) > 1:
            raise ValueError("expected one of closed_width_m, closed_lanes and road_edge")
        if self.road_edge and len(set(self.road_edge)) < 2:
            raise ValueError("road_edge: expected at least two points that differ")
        for lon, lat in self.road_edge:
            if not (-180 <= lon <= 180 and -90 <= lat <= 90):
                raise ValueError(f"road_edge: expected longitude, latitude, got {lon:g}, {lat:g}")
        return self


class TagPrior(Settings):
    """What is known of a tag on a vehicle."""

    delay_m: Known | None = None
    """By how much its ranges are too long, more than those of the vehicle as a whole."""
    lever_sigma_m: float | None = Field(default=None, gt=0, le=10)
    """Standard deviation of its lever arm, forward and left; by default that of a tape measure."""


class VehiclePrior(Settings):
    """What is known of a vehicle before the drive (``common_prior.py``); nothing by default."""

    clock_offset_s: Known | None = None
    """Radio clock minus trajectory clock."""
    range_bias_m: Known | None = None
    """Measured minus true ranges, at 10 m."""
    tags: dict[str, TagPrior] = Field(default_factory=dict)
    """Tag's id -> what is known of it."""


class PipelineConfig(Settings):
    """Everything that a reconstruction depends on besides the log."""

    denoiser: str = "gaia-set"
    """Name of the denoiser (``gaia_uwb.denoisers``)."""
    alignment: AlignmentConfig = AlignmentConfig()
    calibration: CalibrationConfig = CalibrationConfig()
    solver: SolverConfig = SolverConfig()
    sides: SidesConfig = SidesConfig()
    prior: PriorConfig = PriorConfig()
    boundary: BoundaryConfig = BoundaryConfig()
    vehicles: dict[str, VehiclePrior] = Field(default_factory=dict)
    """Vehicle's name -> what is known of it; under ``""`` of logs that name no vehicle."""

    @model_validator(mode="after")
    def _check(self) -> PipelineConfig:
        if not (self.sides.joint or self.prior.says_nothing):
            raise ValueError("prior knowledge of a zone requires sides.joint")
        return self


class ChangesConfig(Settings):
    """What a kept zone takes for a change of its cones (``kept/changes.py``)."""

    moved_m: float = Field(default=0.5, gt=0, le=100)
    """A drive that puts a cone nearer to its place than this agrees with it."""
    moved_sigma: float = Field(default=5.0, ge=2, le=10)
    """The level of the test for moved cones, as a one-sided normal quantile."""
    silent_odds: float = Field(default=1000.0, ge=10, le=1e6)
    """A cone is silent when drives that never heard it are this many times likelier if it is."""
    silent_cones: Literal["keep", "drop"] = "keep"
    """Whether silent cones stay in the boundary: a flat battery looks like a cone that is gone."""
    gone_after_s: float = Field(default=86_400.0, gt=0, le=1e9)
    """A cone that has been silent for longer than this is gone, and leaves the boundary."""
    drift_m_per_day: float = Field(default=0.02, ge=0, le=10)
    """Standard deviation of a cone's random walk in a day: how fast evidence ages."""


def load_config(path: Path) -> PipelineConfig:
    """Read settings from a YAML file; what it omits keeps its default.

    Parameters
    ----------
    path
        A YAML file that mirrors :class:`PipelineConfig`; an empty one gives the defaults.

    Returns
    -------
    PipelineConfig
        All settings.

    Raises
    ------
    ConfigError
        If the file cannot be read, is not YAML, or has a duplicate key, an unknown key or an
        impossible value.
    """
    try:
        content = read_yaml(path)
    except ValueError as error:
        raise ConfigError(f"{path}: cannot read settings: {error}") from error
    return make_config({} if content is None else content, source=str(path))


def make_config(content: Any, *, source: str = "settings") -> PipelineConfig:
    """Build settings from plain values, with every problem in one line.

    Parameters
    ----------
    content
        A mapping that mirrors :class:`PipelineConfig`.
    source
        What to call it in an error's message.

    Returns
    -------
    PipelineConfig
        All settings.

    Raises
    ------
    ConfigError
        If ``content`` is not a mapping, or has an unknown key or an impossible value.

    Examples
    --------
    >>> make_config({"alignment": {"max_gap_s": 0.5}}).alignment.max_gap_s
    0.5
    >>> make_config({"denoisr": "raw"})
    Traceback (most recent call last):
        ...
    gaia_uwb.ConfigError: settings: denoisr: unknown key
    """
    try:
        return PipelineConfig.model_validate(content)
    except ValidationError as error:
        raise ConfigError(f"{source}: {settings_problems(error)}") from error


def settings_problems(error: ValidationError) -> str:
    """Say in one line what pydantic found wrong with settings; of many problems the first few.

    Parameters
    ----------
    error
        What came of building any :class:`Settings`.
    """
    problems = [_problem(details) for details in error.errors()]
    more = [f"and {len(problems) - _MOST_PROBLEMS} more"] if len(problems) > _MOST_PROBLEMS else []
    return "; ".join([*problems[:_MOST_PROBLEMS], *more])


def _problem(details: Mapping[str, Any]) -> str:
    """Say in words what is wrong with one setting; a rule between settings has no location."""
    keys = [str(key) for key in details["loc"] if key != _NUMBER]
    place = shortened(printable(".".join(keys) or "top level"))
    if details["type"] == "extra_forbidden":
        return f"{place}: unknown key"
    if details["type"] == "missing":
        return f"{place}: required"
    message = shortened(printable(str(details["msg"]).removeprefix("Value error, ")))
    if details["type"] == "value_error" and not details["loc"]:
        return message
    message = message[:1].lower() + message[1:]
    return f"{place}: {message}, got {shown(details['input'])}"


def dump_config(config: BaseModel) -> str:
    """Return settings as YAML text that :func:`load_config` reads back.

    Parameters
    ----------
    config
        Any settings.

    Returns
    -------
    str
        Every setting, including those that keep their default.

    Examples
    --------
    >>> print(dump_config(SidesConfig()), end="")
    joint: true
    ambiguous_above: 0.1
    """
    import yaml

    return yaml.safe_dump(config.model_dump(mode="json"), sort_keys=False)
