"""What each part of a feed must hold, member by member: our own models, without the schemas.

They cover what the specifications require and all that GAIA writes; members that are not named here
are left to the official schemas. Rules between members are in ``rules.py``.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, FailFast, Field

from gaia_uwb.wzdx.dates import parse_date
from gaia_uwb.wzdx.words import (
    DeviceStatus,
    DeviceType,
    Direction,
    EventStatus,
    LaneStatus,
    LaneType,
    LocationMethod,
    MarkedLocationType,
    VehicleImpact,
    Verification,
    WorkZoneType,
)


def _is_date(text: str) -> str:
    parse_date(text)
    return text


class Part(BaseModel):
    """Base of all parts: strict types; unknown members are allowed, null is not."""

    model_config = ConfigDict(extra="ignore", strict=True, frozen=True)


Date = Annotated[str, AfterValidator(_is_date)]
Share = Annotated[float, Field(ge=0)]
Id = Annotated[str, Field(min_length=1)]
_Item = TypeVar("_Item")
# The first wrong item of a list is enough: a hostile feed may hold millions.
Some = Annotated[list[_Item], FailFast()]
Many = Annotated[list[_Item], FailFast(), Field(min_length=1)]


class DataSource(Part):
    """An entry of ``feed_info.data_sources``."""

    data_source_id: Id
    organization_name: str
    contact_name: str = Field(default="")
    contact_email: str = Field(default="")
    update_frequency: int = Field(default=1, ge=1)
    update_date: Date = Field(default="")


class FeedInfo(Part):
    """``feed_info`` of WZDx 4.2."""

    publisher: str
    version: str
    update_date: Date
    data_sources: Many[DataSource]
    contact_name: str = Field(default="")
    contact_email: str = Field(default="")
    update_frequency: int = Field(default=1, ge=1)
    license: Literal["https://creativecommons.org/publicdomain/zero/1.0/"] = Field(
        default="https://creativecommons.org/publicdomain/zero/1.0/"
    )


class CwzDataSource(DataSource):
    """An entry of ``feed_info.data_sources`` of CWZ 1.0, which requires more."""

    update_frequency: int = Field(ge=-1)
    update_date: Date


class CwzFeedInfo(FeedInfo):
    """``feed_info`` of CWZ 1.0, which requires more."""

    data_sources: Many[CwzDataSource]  # type: ignore[assignment]
    update_frequency: int = Field(ge=-1)
    license: Literal["https://creativecommons.org/publicdomain/zero/1.0/"]


class RelatedEvent(Part):
    """A reference to another road event."""

    type: Literal[
        "first-in-sequence",
        "next-in-sequence",
        "first-occurrence",
        "next-occurrence",
        "related-work-zone",
        "related-detour",
        "planned-moving-operation",
        "active-moving-operation",
    ]
    id: Id


class EventDetails(Part):
    """``core_details`` of a road event."""

    event_type: Literal["work-zone", "detour"]
    data_source_id: str
    road_names: Many[str]
    direction: Direction
    name: str = Field(default="")
    description: str = Field(default="")
    creation_date: Date = Field(default="")
    update_date: Date = Field(default="")
    related_road_events: Some[RelatedEvent] = Field(default=[])


class Lane(Part):
    """One lane of a road event."""

    order: Annotated[int, Field(ge=1)]
    status: LaneStatus
    type: LaneType


class RoadEvent(Part):
    """What a work zone and a detour have in common."""

    core_details: EventDetails
    start_date: Date
    end_date: Date
    is_start_date_verified: bool = Field(default=False)
    is_end_date_verified: bool = Field(default=False)
    start_date_accuracy: Verification = Field(default="estimated")
    end_date_accuracy: Verification = Field(default="estimated")
    event_status: EventStatus = Field(default="planned")


class WorkZone(RoadEvent):
    """``properties`` of a work zone."""

    vehicle_impact: VehicleImpact
    location_method: LocationMethod
    work_zone_type: WorkZoneType = Field(default="static")
    is_start_position_verified: bool = Field(default=False)
    is_end_position_verified: bool = Field(default=False)
    beginning_accuracy: Verification = Field(default="estimated")
    ending_accuracy: Verification = Field(default="estimated")
    reduced_speed_limit_kph: Share = Field(default=0)
    lanes: Some[Lane] = Field(default=[])


class DeviceDetails(Part):
    """``core_details`` of a field device."""

    device_type: DeviceType
    data_source_id: str
    device_status: DeviceStatus
    update_date: Date
    has_automatic_location: bool
    road_direction: Direction = Field(default="unknown")
    road_names: Many[str] = Field(default=[""])
    name: str = Field(default="")
    description: str = Field(default="")
    status_messages: Some[str] = Field(default=[])
    is_moving: bool = Field(default=False)
    road_event_ids: Some[str] = Field(default=[])


class MarkedLocation(Part):
    """What a location marker stands for."""

    type: MarkedLocationType
    road_event_id: str = Field(default="")


class Device(Part):
    """``properties`` of any field device."""

    core_details: DeviceDetails


class LocationMarker(Device):
    """``properties`` of a location marker."""

    marked_locations: Many[MarkedLocation]


class Feature(Part):
    """The shell of every feature; its content is checked separately."""

    id: Id
    type: Literal["Feature"]
    properties: dict[str, Any]
    geometry: dict[str, Any]


class Collection(Part):
    """The shell of every feed."""

    type: Literal["FeatureCollection"]
    features: Some[Any]
