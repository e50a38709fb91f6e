"""The zones along a road as strict JSON, for ``report.json``: all that ``roadside`` found of them.

Members are named like the attributes of :mod:`gaia_uwb.roadside`, where they are described. What is
unknown is None, lengths are in metres, and places are east and north.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from enum import Enum

import numpy as np

from gaia_uwb.roadside import DrivenPath, Edge, RoadBoundary, RoadLine, Taper
from gaia_uwb.zone import Region

_DECIMALS = 4  # of metres


def road_report(boundary: RoadBoundary | None) -> object:
    """Return the zones along a road as strict JSON values; None where they are unknown.

    Parameters
    ----------
    boundary
        The zones.

    Examples
    --------
    >>> import numpy as np
    >>> from gaia_uwb.roadside import RoadBoundary, RoadLine
    >>> line = RoadLine.through(np.array([[0.0, 0.0], [100.0, 0.0]]))
    >>> road_report(RoadBoundary(line, (), (), ("7",)))["unlocated"]
    ['7']
    """
    return _plain(boundary)


def _plain(value: object) -> object:
    """Return a value as JSON has it."""
    found = value
    match value:
        case Enum():
            found = value.value
        case RoadLine():
            found = {"vertex_m": _plain(value.vertex_m), "length_m": value.length_m}
        case DrivenPath():  # its places are in clean-ranges.parquet and boundary.geojson
            ends_m = value.station_m[[0, -1]]
            found = {"name": value.name, "along": value.along, "station_m": _plain(ends_m)}
        case Region():
            found = {"area_m2": value.area_m2, "polygons_m": _plain(value.polygons)}
        case Edge():
            pieces = [[rows.start, rows.stop] for rows in value.pieces]
            found = {**_members(value), "pieces": pieces}
        case Taper():
            found = {**_members(value), "is_long_enough": value.is_long_enough}
        case np.ndarray():
            found = _numbers(value.round(_DECIMALS).tolist())
        case Mapping():
            found = {str(_plain(key)): _plain(each) for key, each in value.items()}
        case tuple() | list():
            found = [_plain(each) for each in value]
        case float():
            found = value if np.isfinite(value) else None
        case _ if is_dataclass(value):
            found = _members(value)
    return found


def _members(value: object) -> dict[str, object]:
    names = [each.name for each in fields(value)] if is_dataclass(value) else []
    return {name: _plain(getattr(value, name)) for name in names}


def _numbers(values: object) -> object:
    if isinstance(values, list):
        return [_numbers(each) for each in values]
    return _plain(values)
