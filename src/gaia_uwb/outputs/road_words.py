"""What a driver sees of a zone in plain words, for the report, the map and the terminal.

Stations are distances along the road, from where the drive begins that passes the zone. "Your
path" is that of the antenna, or of the point from which a vehicle's lever arms count.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

from gaia_uwb._shared import metres, percent, some_of
from gaia_uwb.estimate import BoundaryStatus
from gaia_uwb.reconstruction import Reconstruction, ReconstructionStatus
from gaia_uwb.roadside import (
    ClosedArea,
    Edge,
    Gap,
    RoadBoundary,
    Taper,
    WidthSource,
    WorkZone,
    ZoneForm,
)
from gaia_uwb.zone import PROBABILITY

Name = Callable[[str], str]

_WIDTHS = {
    WidthSource.CONES: "by the cones",
    WidthSource.CLOSED_WIDTH: "as wide as stated",
    WidthSource.CLOSED_LANES: "as wide as the lanes that were stated",
    WidthSource.ROAD_EDGE: "up to the road's edge that was given",
}
_NO_WIDTH = "state --closed-width, --closed-lanes or --road-edge to get an area"
_NOT_BEHIND = "the road's edge that was given does not run behind the cones along the zone"
_LEAST_SHARE = 0.01  # a less likely form is not worth a sentence


def hull_leads(boundary: RoadBoundary | None) -> bool:
    """Return whether the convex hull is the zone, or there is nothing else.

    Parameters
    ----------
    boundary
        The zones along the road; None where they are unknown.
    """
    return boundary is None or boundary.hull_is_zone


def summary_words(reconstruction: Reconstruction) -> str:
    """Return the zone's edge, or where the hull is the zone its area, in a sentence or two.

    Parameters
    ----------
    reconstruction
        What to tell.

    Examples
    --------
    >>> from gaia_uwb.pipeline import reconstruct
    >>> from gaia_uwb.simulate import PRESETS, simulate_pass
    >>> words = summary_words(reconstruct(simulate_pass(PRESETS["lane-closure"], seed=0)))
    >>> words.startswith("The edge runs 1.6 to 2.1 m right of your path ")
    True
    """
    road = reconstruction.road_boundary
    if road is None or hull_leads(road):
        good = reconstruction.status is ReconstructionStatus.OK
        zone = "The work zone" if good else "The zone as computed"
        return {
            BoundaryStatus.OK: f"{zone} covers {square_metres(reconstruction.boundary.area_m2)}.",
            BoundaryStatus.TOO_FEW_ANCHORS: "That is too few for a boundary.",
            BoundaryStatus.COLLINEAR: "They are on one line, so they enclose no area.",
        }[reconstruction.boundary.status]
    stated = _width_is_stated(reconstruction)
    told = [
        f"{edges_words(zone)} {_area_in_short(zone, width_is_stated=stated)}" for zone in road.zones
    ]
    if len(told) == 1:
        return told[0]
    numbered = (f"Zone {number}: {words}" for number, words in enumerate(told, start=1))
    return f"There are {len(told)} work zones. {' '.join(numbered)}"


def edge_words(edge: Edge) -> str:
    """Return where an edge runs, and what is free beside it, without a full stop.

    Parameters
    ----------
    edge
        What to tell.
    """
    beside_m = edge.beside_m[_outside_tapers(edge)]
    near, far = (f"{value_m:.1f}" for value_m in (beside_m.min(), beside_m.max()))
    across = f"{near} m" if near == far else f"{near} to {far} m"
    along = f"from {edge.station_m[0]:,.0f} to {edge.station_m[-1]:,.0f} m"
    sure = edge.side_probability >= 1.0 - _LEAST_SHARE
    side = edge.side.value if sure else f"{edge.side.value} ({percent(edge.side_probability)})"
    return (
        f"runs {across} {side} of your path {along}; the lane beside it is at least "
        f"{max(edge.free.at_least_m, 0.0):.1f} m free (90 %)"
    )


def edges_words(zone: WorkZone) -> str:
    """Return where a zone's edges run, a sentence each.

    Parameters
    ----------
    zone
        What to tell.
    """
    if len(zone.edges) == 1:
        return f"The edge {edge_words(zone.edges[0])}."
    return " ".join(f"The {edge.side.value} edge {edge_words(edge)}." for edge in zone.edges)


def zone_words(reconstruction: Reconstruction, name: Name) -> Iterator[str]:
    """Yield what is known of each zone, beside what the summary tells, a sentence or two at a time.

    Parameters
    ----------
    reconstruction
        What to tell; without a road there is nothing.
    name
        Makes the id of a cone harmless.
    """
    road = reconstruction.road_boundary
    zones = () if road is None else road.zones
    form_is_stated = reconstruction.config.boundary.form is not None
    width = _width_is_stated(reconstruction)
    for number, zone in enumerate(zones, start=1):
        which = f"Zone {number}: " if len(zones) > 1 else ""
        for words in _zone(zone, name, form_is_stated=form_is_stated, width_is_stated=width):
            yield which + words


def closed_regions(closed: ClosedArea) -> str:
    """Return what is closed for sure, and within what all of it lies, in a sentence.

    Parameters
    ----------
    closed
        The closed area of a zone.
    """
    sure = percent(PROBABILITY)
    inner = (
        f"A region of {square_metres(closed.inner.area_m2)} is closed with {sure} confidence"
        if closed.inner.area_m2 > 0.0
        else f"No area can be called closed with {sure} confidence"
    )
    outer = square_metres(closed.outer.area_m2)
    return f"{inner}; all that is closed lies within a region of {outer} with {sure} confidence."


def square_metres(area_m2: float) -> str:
    """Return an area as people read it.

    Parameters
    ----------
    area_m2
        In square metres.

    Examples
    --------
    >>> square_metres(12.34), square_metres(1234.5)
    ('12.3 m²', '1,234 m²')
    """
    return f"{area_m2:,.{1 if area_m2 < 100 else 0}f} m²"


def _zone(
    zone: WorkZone, name: Name, *, form_is_stated: bool, width_is_stated: bool
) -> Iterator[str]:
    if zone.form is ZoneForm.AREA:  # the summary tells its area
        yield edges_words(zone)
    if zone.lane is not None:
        yield (
            f"The lane between the edges is {metres(zone.lane.least_m)} wide at its narrowest, at "
            f"{zone.lane.station_m:,.0f} m, and at least {metres(zone.lane.at_least_m)} (90 %)."
        )
    yield _form(zone, is_stated=form_is_stated)
    on_edges = {cone for edge in zone.edges for cone in edge.cones}
    beside = [cone for cone in zone.cones if cone not in on_edges]
    if form_is_stated and zone.form in (ZoneForm.ONE_ROW, ZoneForm.LANE_BETWEEN) and beside:
        yield f"As a zone of this form, it has no place for {some_of([*map(name, beside)])}."
    start, end = (
        f"{name(place.cone)}, at {place.station_m:,.0f} m (± {metres(place.within_m)}, 90 %)"
        for place in (zone.start, zone.end)
    )
    yield f"The first cone is {start}; the last one is {end}: {metres(zone.length_m)} in all."
    for edge in zone.edges:
        which = f"On the {edge.side.value}: " if len(zone.edges) > 1 else ""
        for taper in edge.tapers:
            yield which + _taper(taper, zone.speed_mps, name)
        for gap in edge.gaps:
            yield which + _gap(gap, name)
    if zone.closed is None and width_is_stated:
        yield f"No area is claimed: {_NOT_BEHIND}. The strip that is drawn there is one lane wide."
    elif zone.closed is None:
        yield (
            "Nothing tells how far the zone reaches behind its edge, so no area is claimed. The "
            "strip that is drawn there is one lane wide."
        )
    else:
        source = _WIDTHS[zone.closed.width_source]
        area = square_metres(zone.closed.region.area_m2)
        yield f"Closed to traffic: {area}, {source}, without what was driven over."
    passed = zone.drove_through
    if passed is not None:
        between = some_of([name(cone) for cone in passed.cones])
        yield (
            f"The vehicle drove through the zone ({percent(passed.probability)} probability), "
            f"from {passed.from_station_m:,.0f} to {passed.to_station_m:,.0f} m, past {between}."
        )


def _width_is_stated(reconstruction: Reconstruction) -> bool:
    stated = reconstruction.config.boundary
    return bool(stated.closed_width_m or stated.closed_lanes or stated.road_edge)


def _area_in_short(zone: WorkZone, *, width_is_stated: bool) -> str:
    if zone.closed is None:
        them = "it" if len(zone.edges) == 1 else "them"
        why = _NOT_BEHIND if width_is_stated else _NO_WIDTH
        return f"Behind {them} is an open strip: {why}."
    return f"{square_metres(zone.closed.region.area_m2)} are closed to traffic."


def _outside_tapers(edge: Edge) -> slice:
    """Return the rows of the cones between the tapers, the innermost of a taper included."""
    first, last = 0, len(edge.cones) - 1
    for taper in edge.tapers:
        if taper.is_upstream:
            first = edge.cones.index(taper.end.cone)
        else:
            last = edge.cones.index(taper.start.cone)
    return slice(first, max(first, last) + 1)


def _form(zone: WorkZone, *, is_stated: bool) -> str:
    shares = sorted(zone.form_probability.items(), key=lambda each: -each[1])
    likeliest, share = shares[0]
    if is_stated:
        doubt = f"; by the places of the cones it is rather {likeliest.message} ({percent(share)})"
        refuted = zone.form_probability[zone.form] < 0.5 and likeliest is not zone.form
        return f"Form of the zone: {zone.form.message}, as stated{doubt if refuted else ''}."
    others = [f"{form.message} ({percent(share)})" for form, share in shares
              if form is not zone.form and share >= _LEAST_SHARE]  # fmt: skip
    doubt = f"; or {' or '.join(others)}" if others else ""
    own = percent(zone.form_probability[zone.form])
    return f"Form of the zone: {zone.form.message} ({own} probability){doubt}."


def _taper(taper: Taper, speed_mps: float, name: Name) -> str:
    way = "into the road" if taper.is_upstream else "out of the road"
    words = (
        f"A taper leads {metres(taper.width_m)} {way} over {metres(taper.length_m)}, from "
        f"{name(taper.start.cone)} to {name(taper.end.cone)}"
    )
    if taper.is_long_enough is None:
        return f"{words}."
    verdict = "it is long enough" if taper.is_long_enough else "it is too short"
    return (
        f"{words}; at the {3.6 * speed_mps:.0f} km/h that were driven, the manual (MUTCD) asks "
        f"for {metres(taper.asked_m)}: {verdict}."
    )


def _gap(gap: Gap, name: Name) -> str:
    missing = ""
    if gap.unlocated:
        lost = some_of([name(cone) for cone in gap.unlocated])
        missing = f". A cone without a position to go by may stand in it ({lost})"
    return (
        f"Between {name(gap.from_cone)} and {name(gap.to_cone)} is a gap of "
        f"{metres(gap.length_m)}, such as an opening for access; cones usually stand "
        f"{metres(gap.usual_m)} apart{missing}."
    )
