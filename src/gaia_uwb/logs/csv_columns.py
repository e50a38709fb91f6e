"""Which column of a table is what, and in which unit, as ``gaia.yaml`` says it."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from gaia_uwb.config import Settings
from gaia_uwb.logs._logs import MAX_ANCHORS

_Name = Annotated[str, Field(min_length=1)]


class Column(Settings):
    """A column and its unit."""

    column: _Name | None = None
    """Its name in the file."""
    columns: Annotated[list[_Name], Field(min_length=2, max_length=2)] | None = None
    """Instead: names of the columns of date and time (``t_s`` only)."""
    scale: float = Field(default=1.0, ge=-1e12, le=1e12)
    """Our unit (seconds, metres, degrees, dBm) per unit of the file; below 0 only for heights, in a
    file that counts down, and for roll and pitch the other way round."""
    iso: bool = False
    """Dates and times instead of numbers (``t_s`` only)."""
    clockwise: bool = False
    """The angles increase clockwise (``azimuth_deg`` only)."""

    @model_validator(mode="after")
    def _possible(self) -> Column:
        if (self.column is None) is (self.columns is None):
            raise ValueError("give column, or columns: [date, time]")
        if self.columns is not None and not self.iso:
            raise ValueError("two columns hold a date and a time: add iso: true")
        if abs(self.scale) < 1e-12:
            raise ValueError("a scale of 0 leaves nothing")
        return self

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns in the file."""
        return (self.column,) if self.column is not None else tuple(self.columns or ())


Given = _Name | Column
"""A column by its name, or with its unit."""
_SIGNED = ("alt_m", "up_m", "down_m", "roll_deg", "pitch_deg")


def _check_scales(columns: Settings) -> None:
    """Refuse what only some columns can be: the other way round, or dates."""
    for name in type(columns).model_fields:
        given = getattr(columns, name)
        for each in given.values() if isinstance(given, dict) else [given]:
            if not isinstance(each, Column):
                continue
            if each.scale < 0 and name not in _SIGNED:
                raise ValueError(f"{name}: a scale below 0 is for heights, roll and pitch only")
            if each.iso and name != "t_s":
                raise ValueError(f"{name}: iso is for t_s only")
            if each.clockwise and name != "azimuth_deg":
                raise ValueError(f"{name}: clockwise is for azimuth_deg only")


class TrajectoryColumns(Settings):
    """Where a table keeps the trajectory: on Earth, or on site."""

    t_s: Given = "t_s"
    lat: Given | None = None
    lon: Given | None = None
    alt_m: Given | None = None
    east_m: Given | None = None
    north_m: Given | None = None
    up_m: Given | None = None
    down_m: Given | None = None
    """Instead of ``up_m``: metres below the origin, as in north, east, down."""
    heading_deg: Given | None = None
    """Where the vehicle's front points, clockwise from north."""
    roll_deg: Given | None = None
    """Its attitude as in REP 103: above 0 where the left side is up."""
    pitch_deg: Given | None = None
    """Its attitude as in REP 103: above 0 where the nose is down."""

    @model_validator(mode="after")
    def _one_kind_of_place(self) -> TrajectoryColumns:
        _check_scales(self)
        earth = self.lat is not None and self.lon is not None
        site = self.east_m is not None and self.north_m is not None
        some = {name for name in ("lat", "lon", "alt_m") if getattr(self, name) is not None}
        local = ("east_m", "north_m", "up_m", "down_m")
        other = {name for name in local if getattr(self, name) is not None}
        if earth is site or (some and other) or {"up_m", "down_m"} <= other:
            raise ValueError(
                "give either lat and lon [and alt_m], or east_m and north_m [and up_m or down_m]"
            )
        return self


class RangeColumns(Settings):
    """Where a table keeps the ranges: one per row, or one column per anchor."""

    t_s: Given = "t_s"
    anchor_id: _Name | None = None
    range_m: Given | None = None
    rssi_dbm: Given | None = None
    rssi_fp_dbm: Given | None = None
    tag_id: _Name | None = None
    """The tag that took the range, of several."""
    azimuth_deg: Given | None = None
    """Angle of arrival: counter-clockwise from the vehicle's front."""
    azimuth_sigma_deg: Given | None = None
    """Its standard deviation."""
    anchors: dict[_Name, Given] | None = None
    """Anchor -> its column of ranges."""

    @model_validator(mode="after")
    def _one_layout(self) -> RangeColumns:
        _check_scales(self)
        angles = (self.azimuth_deg, self.azimuth_sigma_deg)
        per_row = (self.anchor_id, self.range_m, self.rssi_dbm, self.rssi_fp_dbm, *angles)
        if self.anchors is None and (self.anchor_id is None or self.range_m is None):
            raise ValueError("give anchor_id and range_m, or anchors")
        if self.anchors is not None and any(each is not None for each in per_row):
            raise ValueError("give anchor_id and range_m, or anchors, not both")
        if self.anchors is not None and not 0 < len(self.anchors) <= MAX_ANCHORS:
            raise ValueError("anchors must name at least one column")
        if self.azimuth_sigma_deg is not None and self.azimuth_deg is None:
            raise ValueError("azimuth_sigma_deg needs azimuth_deg beside it")
        return self


class ConeColumns(Settings):
    """Where a table keeps ranges between cones, one per row."""

    anchor_a: _Name
    anchor_b: _Name
    range_m: Given
    t_s: Given | None = None

    @model_validator(mode="after")
    def _possible(self) -> ConeColumns:
        _check_scales(self)
        return self
