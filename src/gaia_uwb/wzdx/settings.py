"""What a feed says and no log knows: who publishes it, which road, from when to when.

>>> from gaia_uwb.wzdx import make_feed_config
>>> config = make_feed_config({
...     "publisher": "Test DOT", "data_source": {"organization_name": "Test DOT"},
...     "road_names": ["I-80"], "direction": "westbound",
...     "start_date": "2026-11-22T09:00:00Z", "end_date": "2026-11-22T17:00:00Z"})
>>> config.profile, config.vehicle_impact
('wzdx-4.2', 'unknown')
"""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field, ValidationError, model_validator

from gaia_uwb._shared import ConfigError, read_yaml
from gaia_uwb.config import Settings, settings_problems
from gaia_uwb.wzdx.dates import EXPECTED, in_utc, parse_date
from gaia_uwb.wzdx.words import (
    Direction,
    EventStatus,
    LaneStatus,
    LaneType,
    Profile,
    VehicleImpact,
    WorkZoneType,
)


def _as_date(value: object) -> object:
    """Read a text as a date; YAML has read an unquoted one already."""
    if isinstance(value, str):
        return parse_date(value)
    if not isinstance(value, datetime):
        raise ValueError(EXPECTED)  # noqa: TRY004, pydantic reports ValueError only
    return value


Text = Annotated[str, Field(pattern=r"\S", max_length=2000)]
Email = Annotated[str, Field(pattern=r"^[^@\s]+@[^@\s]+$", max_length=300)]
UtcDate = Annotated[datetime, BeforeValidator(_as_date), AfterValidator(in_utc)]


class DataSourceConfig(Settings):
    """Where the data come from; one entry of ``feed_info.data_sources``."""

    organization_name: Text
    """Who is responsible for the data."""
    data_source_id: Text | None = None
    """Its id; by default derived from the organisation's name."""
    contact_name: Text | None = None
    contact_email: Email | None = None
    update_frequency_s: int | None = Field(default=None, ge=-1, le=10**9)
    """Seconds between updates; CWZ requires it."""


class LaneConfig(Settings):
    """One lane of the road; a feed that names lanes names all of them."""

    order: int = Field(ge=1, le=50)
    """Counted from the left in the direction of traffic, from 1."""
    status: LaneStatus
    type: LaneType = "general"


class FeedConfig(Settings):
    """Everything in the two feeds that is not in the log."""

    profile: Profile = "wzdx-4.2"
    """Which specification the feeds follow."""
    publisher: Text
    """Who publishes the feeds."""
    data_source: DataSourceConfig
    road_names: Annotated[list[Text], Field(min_length=1, max_length=50)]
    """Publicly known names of the road, the most important one first."""
    direction: Direction
    """Direction of the road's traffic, as signed."""
    start_date: UtcDate
    end_date: UtcDate
    start_date_verified: bool = False
    """Whether somebody has confirmed that work has started."""
    end_date_verified: bool = False
    """Whether somebody has confirmed that work has ended."""
    vehicle_impact: VehicleImpact = "unknown"
    """What is closed; a log of ranges cannot show it."""
    lanes: list[LaneConfig] = Field(default_factory=list, max_length=50)
    """All lanes of the road, each once; by default none are named."""
    work_zone_type: WorkZoneType = "static"
    start_position: Literal["auto", "verified", "estimated"] = "auto"
    """``auto``: verified if the zone's start is known well, see ``verified_below_m``."""
    end_position: Literal["auto", "verified", "estimated"] = "auto"
    verified_below_m: float = Field(default=1.0, gt=0, le=100)
    """``auto`` calls an end verified if it is known to this along the road, at either side, with
    90 % probability; where that is unknown, if the 95 % radius of its cone is below this."""
    against_traffic: bool = False
    """The log was driven against the traffic of this work zone, on the other carriageway."""
    zone: Text | None = None
    """Name of the work zone, from which ids are derived; by default the log's name. The same name
    keeps the ids of event and cones from one drive to the next."""
    event_id: Text | None = None
    """Id of the road event; by default derived."""
    device_ids: dict[str, Text] = Field(default_factory=dict)
    """Device id of each cone (cone: id); the others are derived."""
    name: Text | None = None
    """A human-readable name of the work zone."""
    description: Text | None = None
    """A short human-readable text; what is uncertain about the positions is added to it."""
    creation_date: UtcDate | None = None
    reduced_speed_limit_kph: float | None = Field(default=None, ge=0, le=300)
    has_automatic_location: bool = False
    """Value for all cones; taken literally, it means "from an onboard GPS"."""
    mark_ends: bool = True
    """Mark the first and last cone as the zone's start and end."""
    deprecated_members: bool = False
    """WZDx only: also write ``beginning_accuracy`` and similar members, for old readers."""
    event_status: EventStatus | None = None
    """WZDx only, and deprecated there."""
    project_id: Text | None = None
    """CWZ only."""
    extension: bool = False
    """Add a member ``gaia`` with covariances, edges, closed area and hull."""
    update_frequency_s: int | None = Field(default=None, ge=-1, le=10**9)
    """Seconds between updates of the feeds; CWZ requires it."""
    license: Literal["CC0-1.0"] | None = None
    """The only licence that feeds may have; CWZ requires it."""
    contact_name: Text | None = None
    contact_email: Email | None = None

    @model_validator(mode="after")
    def _check_together(self) -> FeedConfig:
        if not self.start_date < self.end_date:
            raise ValueError("end_date: expected a date after start_date")
        if len(set(self.device_ids.values())) < len(self.device_ids):
            raise ValueError("device_ids: ids must be unique")
        orders = sorted(lane.order for lane in self.lanes)
        if orders != list(range(1, len(orders) + 1)):
            raise ValueError(f"lanes: expected every lane once, with the orders 1 to {len(orders)}")
        if self.profile == "cwz-1.0":
            self._check_cwz()
        else:
            self._check_wzdx()
        return self

    def _check_cwz(self) -> None:
        required = {
            "update_frequency_s": self.update_frequency_s,
            "data_source.update_frequency_s": self.data_source.update_frequency_s,
            "license": self.license,
        }
        missing = [name for name, value in required.items() if value is None]
        if missing:
            raise ValueError(f"CWZ 1.0 requires {', '.join(missing)}")
        if self.event_status is not None or self.deprecated_members:
            raise ValueError("CWZ 1.0 has neither event_status nor deprecated_members")

    def _check_wzdx(self) -> None:
        for seconds in (self.update_frequency_s, self.data_source.update_frequency_s):
            if seconds is not None and seconds < 1:
                raise ValueError("update_frequency_s: WZDx 4.2 expects at least 1")
        if self.project_id is not None:
            raise ValueError("project_id: only CWZ 1.0 has it")


def load_feed_config(path: Path, changes: Mapping[str, object] | None = None) -> FeedConfig:
    """Read settings from a YAML file.

    Parameters
    ----------
    path
        A YAML file that mirrors :class:`FeedConfig`.
    changes
        Top-level settings that override the file's.

    Raises
    ------
    ConfigError
        If the file cannot be read, is not YAML, holds a key twice, an unknown key or an impossible
        value.
    """
    try:
        content = read_yaml(path)
    except ValueError as error:
        raise ConfigError(f"{path}: cannot read settings: {error}") from error
    if isinstance(content, dict) and changes:
        content = content | dict(changes)
    return make_feed_config({} if content is None else content, source=str(path))


def make_feed_config(content: Any, *, source: str = "feed settings") -> FeedConfig:
    """Build settings from plain values, with every problem in one line.

    Parameters
    ----------
    content
        A mapping that mirrors :class:`FeedConfig`; dates are texts or ``datetime`` with time zone.
    source
        What to call it in an error's message.

    Raises
    ------
    ConfigError
        If ``content`` is not a mapping, holds an unknown key or an impossible value, or one is
        missing.
    """
    try:
        return FeedConfig.model_validate(content)
    except ValidationError as error:
        raise ConfigError(f"{source}: {settings_problems(error)}") from error
