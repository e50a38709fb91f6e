"""What a driver sees of a zone as features in metres: edges, bands, gaps, tapers, areas.

``geojson.py`` turns them into GeoJSON and lists their roles. All edges of all zones are features of
their own; the property ``zone`` counts zones from 1, in the direction of travel.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from gaia_uwb._shared import Array, Float64
from gaia_uwb.roadside import Edge, Gap, RoadBoundary, Taper, WorkZone
from gaia_uwb.zone import PROBABILITY, Region

Lines = tuple[Float64[Array, "_ 2"], ...]
Polygons = tuple[tuple[Float64[Array, "_ 2"], ...], ...]


@dataclass(frozen=True)
class RoadFeature:
    """Lines or areas on the ground, with flat properties as GIS attribute tables want them.

    Parameters
    ----------
    role
        What it is.
    lines_m, polygons_m
        One of them is empty; polygons like those of a :class:`gaia_uwb.zone.Region`. In metres.
    properties
        Numbers, texts and lists of texts; None where something is unknown.
    """

    role: str
    lines_m: Lines
    polygons_m: Polygons
    properties: dict[str, object]


def road_features(boundary: RoadBoundary) -> Iterator[RoadFeature]:
    """Yield the features of all zones in drawing order: areas first, then bands, then lines.

    Parameters
    ----------
    boundary
        The zones.

    Examples
    --------
    >>> import numpy as np
    >>> from gaia_uwb.roadside import RoadBoundary, RoadLine
    >>> line = RoadLine.through(np.array([[0.0, 0.0], [100.0, 0.0]]))
    >>> list(road_features(RoadBoundary(line, (), (), ())))
    []
    """
    layers: tuple[Callable[[WorkZone], Iterator[RoadFeature]], ...] = (
        _outer, _closed, _inner, _bands, _edges, _tapers, _gaps,
    )  # fmt: skip
    for layer in layers:
        for number, zone in enumerate(boundary.zones, start=1):
            for found in layer(zone):
                if found.lines_m or found.polygons_m:
                    properties = {"zone": number, **found.properties}
                    yield RoadFeature(found.role, found.lines_m, found.polygons_m, properties)


def _outer(zone: WorkZone) -> Iterator[RoadFeature]:
    if zone.closed is not None:
        yield _region("closed-area-outer", zone.closed.outer)


def _inner(zone: WorkZone) -> Iterator[RoadFeature]:
    if zone.closed is not None:
        yield _region("closed-area-inner", zone.closed.inner)


def _region(role: str, region: Region) -> RoadFeature:
    properties: dict[str, object] = {"probability": PROBABILITY, "area_m2": region.area_m2}
    return RoadFeature(role, (), region.polygons, properties)


def _closed(zone: WorkZone) -> Iterator[RoadFeature]:
    closed, strip = zone.closed, zone.open_strip
    if closed is not None:
        yield RoadFeature("closed-area", (), closed.region.polygons, {
            **_form(zone),
            "area_m2": closed.region.area_m2,
            "width_source": closed.width_source.value,
            "width_m": _known(closed.width_m),
        })  # fmt: skip
    if strip is not None:
        note = "for drawing only: nothing tells its width, so no area is claimed"
        yield RoadFeature("open-strip", (), strip.polygons, {**_form(zone), "note": note})


def _bands(zone: WorkZone) -> Iterator[RoadFeature]:
    for edge in zone.edges:
        polygons_m = tuple((ring_m,) for ring_m in edge.band.rings)
        properties: dict[str, object] = {"side": edge.side.value, "probability": PROBABILITY}
        yield RoadFeature("edge-band", (), polygons_m, properties)


def _edges(zone: WorkZone) -> Iterator[RoadFeature]:
    for edge in zone.edges:
        # A piece of one cone is no line; the cone itself is a feature.
        lines_m = tuple(line_m for line_m in edge.lines if len(line_m) > 1)
        yield RoadFeature("edge", lines_m, (), {**_edge(edge), **_form(zone), **_along(zone)})


def _edge(edge: Edge) -> dict[str, object]:
    return {
        "side": edge.side.value,
        "side_probability": edge.side_probability,
        "anchor_ids": list(edge.cones),
        "from_station_m": float(edge.station_m[0]),
        "to_station_m": float(edge.station_m[-1]),
        "nearest_beside_m": float(edge.beside_m.min()),
        "farthest_beside_m": float(edge.beside_m.max()),
        "free_m": _known(edge.free.least_m),
        "free_at_least_m": _known(edge.free.at_least_m),
        "free_station_m": _known(edge.free.station_m),
        "n_gaps": len(edge.gaps),
    }


def _form(zone: WorkZone) -> dict[str, object]:
    return {"form": zone.form.value, "form_probability": float(zone.form_probability[zone.form])}


def _along(zone: WorkZone) -> dict[str, object]:
    return {
        "zone_length_m": zone.length_m,
        "start_cone": zone.start.cone,
        "start_within_m": _known(zone.start.within_m),
        "end_cone": zone.end.cone,
        "end_within_m": _known(zone.end.within_m),
        "speed_mps": _known(zone.speed_mps),
    }


def _tapers(zone: WorkZone) -> Iterator[RoadFeature]:
    for edge in zone.edges:
        for taper in edge.tapers:
            yield RoadFeature("taper", (taper.place_m,), (), _taper(edge, taper))


def _taper(edge: Edge, taper: Taper) -> dict[str, object]:
    return {
        "side": edge.side.value,
        "leads": "in" if taper.is_upstream else "out",
        "from_cone": taper.start.cone,
        "to_cone": taper.end.cone,
        "length_m": taper.length_m,
        "width_m": taper.width_m,
        "asked_length_m": _known(taper.asked_m),
        "is_long_enough": taper.is_long_enough,
    }


def _gaps(zone: WorkZone) -> Iterator[RoadFeature]:
    for edge in zone.edges:
        for gap in edge.gaps:
            yield RoadFeature("gap", (gap.place_m,), (), _gap(edge, gap))


def _gap(edge: Edge, gap: Gap) -> dict[str, object]:
    return {
        "side": edge.side.value,
        "from_cone": gap.from_cone,
        "to_cone": gap.to_cone,
        "length_m": gap.length_m,
        "usual_m": gap.usual_m,
        "unlocated_ids": list(gap.unlocated),
    }


def _known(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
