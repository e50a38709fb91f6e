"""Score what a driver sees of a zone: its edge, its ends, its form and the ground that is closed.

The true edges are those that :func:`gaia_uwb.roadside.find_zones` finds at the true places of the
cones. They are compared every metre along the road, but not in gaps of either edge, on the side of
the path on which the true edge runs. A metric that has nothing to count is absent.

=========================== ==== =================================================================
name                        unit what, and what its ``n`` counts
=========================== ==== =================================================================
edge_error_mean             m    mean distance across the road to the true edge; metres of edge
edge_error_95               m    95 % of these distances are not larger; metres of edge
edge_error_worst            m    the largest; metres of edge
edge_found_share                 true edge that has an edge beside it on its side; metres of edge
edge_band_coverage_90            true edge inside the 90 % band; metres of edge
zone_start_error            m    mean distance along the road to the true start; zones
zone_end_error              m    the same of the end; zones
zone_ends_coverage_90            the 90 % interval holds the true start, or end; starts and ends
free_width_error            m    mean error of the least width beside the path; edges
zone_form_right                  zones that have the true form; zones
path_in_closed_area         m    driven path inside closed areas; 1
path_in_inner_region        m    driven path inside their inner regions; 1
closed_area_iou                  closed areas against the true ones; 1
inner_region_right               nothing of the inner region is open in truth; closed areas
outer_region_right               nothing that is closed in truth is outside; closed areas
=========================== ==== =================================================================

The regions' borders are polylines: what lies within 0.05 m of a border is not counted.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from gaia_uwb._shared import Array, Bool, Float64, InputError
from gaia_uwb.episode import Episode
from gaia_uwb.evaluate.metrics import Metric
from gaia_uwb.reconstruction import Reconstruction
from gaia_uwb.roadside import Drive, Edge, RoadBoundary, RoadLine, WorkZone, find_zones
from gaia_uwb.zone import Region

if TYPE_CHECKING:
    from shapely import Geometry

_STEP_M = 1.0
_BORDER_M = 0.05


def score_road(result: Reconstruction, episode: Episode) -> dict[str, Metric]:
    """Score the edges, the ends and the closed areas of a result.

    Parameters
    ----------
    result
        What was found, without truth.
    episode
        With the truth of the anchors, in their order.

    Returns
    -------
    dict
        The metrics of the module's table by name, without those that have nothing to count; empty
        where there is no zone.

    Raises
    ------
    InputError
        If the episode has no truth.
    """
    if episode.truth is None:
        raise InputError("expected an episode with its truth, got none", source=episode.name)
    true_m = episode.truth.anchor_m
    found = result.road_boundary
    drives = [Drive(each.name, each.t_s, each.position_m) for each, _ in result.passes]
    ids = [anchor.anchor_id for anchor in result.anchors]
    setting = result.config.boundary
    true = find_zones(drives, ids, true_m, true_m[None], setting, result.episode.frame)
    if found is None or true is None:
        return {}
    return compare(found, true, [drive.position_m for drive in drives])


def compare(
    found: RoadBoundary, true: RoadBoundary, paths_m: Sequence[Float64[Array, "_ 2"]]
) -> dict[str, Metric]:
    """Score zones against the true ones.

    Parameters
    ----------
    found, true
        The zones; each may have a line of its own.
    paths_m : sequence of (T, 2)
        The drives, in metres.
    """
    scores = [
        *_edge_scores(found, true),
        *_zone_scores(found, true),
        *_path_scores(found, paths_m),
        *_area_scores(found, true),
    ]
    return {score.name: score for score in scores}


@dataclass(frozen=True)
class _OnRoad:
    """An edge on a line: offsets every metre between its ends, NaN in its gaps."""

    side: int
    station_m: Float64[Array, "K"]
    offset_m: Float64[Array, "K"]
    is_gap: Bool[Array, "K"]

    @classmethod
    def of(cls, edge: Edge, line: RoadLine) -> _OnRoad:
        at_m = line.locate(np.concatenate(edge.lines))
        order = np.argsort(at_m[:, 0], kind="stable")
        station_m, offset_m = at_m[order].T
        even_m = np.arange(station_m[0], station_m[-1] + 1e-9, _STEP_M)
        gaps_m = [np.sort(line.locate(gap.place_m)[:, 0]) for gap in edge.gaps]
        is_gap = np.zeros(len(even_m), dtype=np.bool_)
        for first_m, last_m in gaps_m:
            is_gap |= (even_m > first_m) & (even_m < last_m)
        side = int(np.sign(np.median(offset_m)))
        return cls(side, even_m, np.interp(even_m, station_m, offset_m), is_gap)


def _edge_scores(found: RoadBoundary, true: RoadBoundary) -> Iterator[Metric]:
    edges = [edge for zone in found.zones for edge in zone.edges]
    placed = [_OnRoad.of(edge, found.line) for edge in edges]
    error_m, covered, n_true = [], [], 0
    for zone in true.zones:
        for true_edge in zone.edges:
            there = _OnRoad.of(true_edge, found.line)
            at_m, offset_m = there.station_m[~there.is_gap], there.offset_m[~there.is_gap]
            n_true += len(at_m)
            for edge, here in zip(edges, placed, strict=True):
                if here.side != there.side:
                    continue
                inside = (at_m >= here.station_m[0]) & (at_m <= here.station_m[-1])
                inside[inside] &= np.interp(at_m[inside], here.station_m, here.is_gap) == 0
                own_m = np.interp(at_m[inside], here.station_m, here.offset_m)
                error_m.append(np.abs(own_m - offset_m[inside]))
                covered.append(_in_band(edge, at_m[inside], offset_m[inside]))
    errors_m = np.concatenate(error_m) if error_m else np.zeros(0)
    if n_true:
        yield Metric("edge_found_share", len(errors_m) / n_true, "", n_true)
    if len(errors_m):
        n = len(errors_m)
        yield Metric("edge_error_mean", float(errors_m.mean()), "m", n)
        yield Metric("edge_error_95", float(np.quantile(errors_m, 0.95)), "m", n)
        yield Metric("edge_error_worst", float(errors_m.max()), "m", n)
        yield Metric("edge_band_coverage_90", float(np.concatenate(covered).mean()), "", n)


def _in_band(
    edge: Edge, at_m: Float64[Array, "K"], offset_m: Float64[Array, "K"]
) -> Bool[Array, "K"]:
    band = edge.band
    near_m, far_m = (np.interp(at_m, band.station_m, side) for side in (band.near_m, band.far_m))
    low_m, high_m = np.minimum(near_m, far_m), np.maximum(near_m, far_m)
    return np.asarray((low_m <= offset_m) & (offset_m <= high_m))


def _zone_scores(found: RoadBoundary, true: RoadBoundary) -> Iterator[Metric]:
    pairs = [(_same(zone, found), zone) for zone in true.zones]
    if not pairs:
        return
    ends = [[(a.start, b.start), (a.end, b.end)] for a, b in pairs]
    off_m = np.array(
        [
            [abs(found.line.locate(true_end.place_m)[0] - own.station_m) for own, true_end in each]
            for each in ends
        ]
    )
    within_m = np.array([[own.within_m for own, _ in each] for each in ends])
    start_m, end_m = off_m.mean(axis=0)
    yield Metric("zone_start_error", float(start_m), "m", len(pairs))
    yield Metric("zone_end_error", float(end_m), "m", len(pairs))
    yield Metric("zone_ends_coverage_90", float((off_m <= within_m).mean()), "", off_m.size)
    free_m = [
        abs(edge.free.least_m - true_edge.free.least_m)
        for here, there in pairs
        for edge in here.edges
        for true_edge in there.edges
        if edge.side is true_edge.side
    ]
    if free_m:
        yield Metric("free_width_error", float(np.mean(free_m)), "m", len(free_m))
    right = [here.form is there.form for here, there in pairs]
    right += [False] * (len(found.zones) - len(pairs))  # more zones than there are
    yield Metric("zone_form_right", float(np.mean(right)), "", len(right))


def _same(true_zone: WorkZone, found: RoadBoundary) -> WorkZone:
    """Return the found zone with most of a true zone's cones."""
    return max(found.zones, key=lambda zone: len({*zone.cones} & {*true_zone.cones}))


def _path_scores(found: RoadBoundary, paths_m: Sequence[Float64[Array, "_ 2"]]) -> Iterator[Metric]:
    from shapely import MultiLineString

    closed = [zone.closed for zone in found.zones if zone.closed is not None]
    if not closed:
        return
    paths = MultiLineString([path_m for path_m in paths_m if len(path_m) > 1])
    for name, regions in (
        ("path_in_closed_area", [area.region for area in closed]),
        ("path_in_inner_region", [area.inner for area in closed]),
    ):
        yield Metric(name, float(paths.intersection(_ground(regions)).length), "m", 1)


def _area_scores(found: RoadBoundary, true: RoadBoundary) -> Iterator[Metric]:
    here = [zone.closed for zone in found.zones if zone.closed is not None]
    there = [zone.closed for zone in true.zones if zone.closed is not None]
    if not here and not there:
        return
    own, actual = (_ground([area.region for area in areas]) for areas in (here, there))
    both_m2 = own.intersection(actual).area
    yield Metric("closed_area_iou", both_m2 / (own.area + actual.area - both_m2), "", 1)
    inner = [_inside(_ground([area.inner]), actual) for area in here]
    if inner:
        yield Metric("inner_region_right", float(np.mean(inner)), "", len(inner))
    outer = _ground([area.outer for area in here])
    if there:
        out = [_inside(_ground([area.region]), outer) for area in there]
        yield Metric("outer_region_right", float(np.mean(out)), "", len(out))


def _inside(ground: Geometry, of: Geometry) -> bool:
    """Whether ground lies inside other ground, but for what is near the border."""
    return bool(ground.difference(of.buffer(_BORDER_M)).is_empty)


def _ground(regions: Sequence[Region]) -> Geometry:
    from shapely import Polygon, union_all

    return union_all([Polygon(p[0], p[1:]) for region in regions for p in region.polygons])
