"""The zones along a road, from drives past their cones and the cones' possible places."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from gaia_uwb._shared import Array, ConfigError, Float64
from gaia_uwb.config import BoundaryConfig
from gaia_uwb.projection import to_local
from gaia_uwb.roadside.closed_areas import Width, closed_area, driven_ground, open_strip
from gaia_uwb.roadside.drove_through import drove_through
from gaia_uwb.roadside.edges import lane_width, make_edge
from gaia_uwb.roadside.forms import facing, forms, split_zones, two_rows_form
from gaia_uwb.roadside.road_boundary import (
    RoadBoundary,
    RoadSide,
    WidthSource,
    WorkZone,
    ZoneForm,
)
from gaia_uwb.roadside.road_line import DrivenPath, RoadLine
from gaia_uwb.roadside.runs import Drive, beside, cut_at_turns, road_line, smooth
from gaia_uwb.roadside.zone_cones import ZoneCones, rows_of
from gaia_uwb.scene import LocalFrame

if TYPE_CHECKING:
    from shapely import Geometry

_NOTHING_STATED = BoundaryConfig()
_SPEED_EVERY_M = 10.0


def find_zones(
    drives: Sequence[Drive],
    anchor_ids: Sequence[str],
    place_m: Float64[Array, "N 2"],
    scene_m: Float64[Array, "S M 2"],
    config: BoundaryConfig = _NOTHING_STATED,
    frame: LocalFrame | None = None,
) -> RoadBoundary | None:
    """Return the zones along the road, with their edges and closed areas.

    Parameters
    ----------
    drives
        All that passed the cones.
    anchor_ids
        Of all N cones.
    place_m : (N, 2)
        Their estimated places, in metres; NaN for a cone that was not located.
    scene_m : (S, M, 2)
        Possible places of the M located cones, in their order, in metres: equally likely scenes.
    config
        What is known of the boundary.
    frame
        Where the local frame is on the Earth; needed for a road's edge.

    Returns
    -------
    RoadBoundary or None
        None without any located cone, or where no vehicle moved by 10 m.

    Raises
    ------
    ConfigError
        If a road's edge is given, but not where the local frame is on the Earth.

    Examples
    --------
    >>> import numpy as np
    >>> east_m = np.linspace(-50.0, 150.0, 201)
    >>> drive = Drive("a", np.arange(201.0), np.stack([east_m, 0 * east_m], axis=1))
    >>> cones_m = np.stack([10.0 * np.arange(10), np.full(10, -3.0)], axis=1)
    >>> found = find_zones([drive], [f"c{k}" for k in range(10)], cones_m, cones_m[None])
    >>> zone = found.zones[0]
    >>> zone.form.value, zone.edges[0].side.value, round(zone.edges[0].free.least_m, 2)
    ('one-row', 'right', 3.0)
    """
    located = np.flatnonzero(np.isfinite(place_m).all(axis=1))
    whole = [run for drive in drives if (run := smooth(drive)) is not None]
    runs = [part for run in whole for part in cut_at_turns(run)]
    line = road_line(runs, place_m[located]) if len(located) else None
    if line is None:
        return None
    paths = beside(line, runs)
    driven = driven_ground([run.place_m for run in whole])
    unlocated = tuple(name for k, name in enumerate(anchor_ids) if k not in set(located.tolist()))
    estimate = line.locate(place_m[located])
    scenes = line.locate_scenes(scene_m)
    width = _width(config, frame)
    zones = []
    for rows in split_zones(estimate[:, 0]):
        cones = ZoneCones(
            tuple(anchor_ids[k] for k in located[rows]), place_m[located[rows]],
            *estimate[rows].T, *np.moveaxis(scenes[:, rows], 2, 0),
        )  # fmt: skip
        zones.append(_zone(line, paths, driven, cones, unlocated, config, width))
    return RoadBoundary(line, paths, tuple(zones), unlocated)


def _zone(
    line: RoadLine,
    paths: Sequence[DrivenPath],
    driven: Geometry,
    cones: ZoneCones,
    unlocated: tuple[str, ...],
    config: BoundaryConfig,
    width: Width | None,
) -> WorkZone:
    form, probability = _form(cones, config)
    rows = rows_of(cones, form)
    start, end = cones.zone_end(first=True), cones.zone_end(first=False)
    speed_mps = _speed_mps(paths, start.station_m, end.station_m)
    edges = tuple(make_edge(line, paths, each.near, speed_mps, unlocated) for each in rows)
    encloses = form in (ZoneForm.WORKS_BETWEEN, ZoneForm.AREA)
    closed = None
    if encloses or width is not None:
        closed = closed_area(line, driven, rows, None if encloses else width)
    lane = None
    if len(rows) == 2:
        sides = {each.near.side: each.near for each in rows}
        lane = lane_width(line, sides[RoadSide.LEFT], sides[RoadSide.RIGHT])
    return WorkZone(
        form=form,
        form_probability=probability,
        cones=cones.ids,
        start=start,
        end=end,
        length_m=end.station_m - start.station_m,
        edges=edges,
        closed=closed,
        open_strip=None if closed else open_strip(line, driven, rows, config.lane_width_m),
        lane=lane,
        speed_mps=speed_mps,
        drove_through=drove_through(cones, rows, paths),
    )


def _form(cones: ZoneCones, config: BoundaryConfig) -> tuple[ZoneForm, dict[ZoneForm, float]]:
    """Return the form by the estimated places, or as stated, and the probability of each."""
    is_facing = facing(cones.station_m, np.abs(cones.offset_m))
    if_two_rows = two_rows_form(cones.station_m, np.abs(cones.offset_m), is_facing)
    here = forms(cones.station_m[None], cones.offset_m[None], if_two_rows)[0]
    here = here if config.form is None else ZoneForm(config.form)
    found = forms(cones.scene_station_m, cones.scene_offset_m, if_two_rows)
    return here, {form: found.count(form) / len(found) for form in ZoneForm}


def _speed_mps(paths: Sequence[DrivenPath], start_m: float, end_m: float) -> float:
    """Return the median speed along a zone, over stretches of the same length."""
    edges_m = np.arange(start_m, max(end_m, start_m + _SPEED_EVERY_M) + 1e-6, _SPEED_EVERY_M)
    speeds_mps = []
    for path in paths:
        t_s = np.interp(edges_m, path.station_m, path.t_s, left=np.nan, right=np.nan)
        took_s = np.abs(np.diff(t_s))
        speeds_mps.append(np.diff(edges_m)[took_s > 0] / took_s[took_s > 0])
    known = np.concatenate(speeds_mps) if speeds_mps else np.zeros(0)
    return float(np.median(known)) if len(known) else math.nan


def _width(config: BoundaryConfig, frame: LocalFrame | None) -> Width | None:
    """Return what was stated of a row's width."""
    if config.closed_width_m is not None:
        return Width(WidthSource.CLOSED_WIDTH, config.closed_width_m)
    if config.closed_lanes is not None:
        width_m = config.closed_lanes * config.lane_width_m
        return Width(WidthSource.CLOSED_LANES, width_m)
    edge_m = road_edge(config, frame)
    return None if edge_m is None else Width(WidthSource.ROAD_EDGE, math.nan, edge_m)


def road_edge(config: BoundaryConfig, frame: LocalFrame | None) -> Float64[Array, "E 2"] | None:
    """Return the stated edge of the road in the local frame, in metres; None if none was stated.

    Parameters
    ----------
    config
        ``road_edge`` is used.
    frame
        Where the local frame is on the Earth.

    Raises
    ------
    ConfigError
        If an edge is stated, but not where the local frame is.
    """
    if not config.road_edge:
        return None
    if frame is None:
        problem = "a road's edge needs to know where the local frame is on the Earth"
        raise ConfigError(f"boundary.road_edge: {problem}")
    lon, lat = np.array(config.road_edge).T
    return to_local(frame, lat, lon)[0]
