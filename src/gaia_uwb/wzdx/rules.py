"""Rules between the members of a feature, which no JSON schema can express."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from gaia_uwb._shared import shown
from gaia_uwb.wzdx.dates import is_in_utc, parse_date
from gaia_uwb.wzdx.places import Step, heading_deg
from gaia_uwb.wzdx.problems import Problem, json_path
from gaia_uwb.wzdx.words import DEPRECATED, ONLY_CWZ_DEVICES, ONLY_WZDX_MARKERS, Profile

_HEADINGS_DEG = {"northbound": 0.0, "eastbound": 90.0, "southbound": 180.0, "westbound": 270.0}
_FAR_OFF_DEG = 135.0  # signed directions differ from a road's own by up to a right angle and more
_EITHER = (
    ("is_start_date_verified", "start_date_accuracy"),
    ("is_end_date_verified", "end_date_accuracy"),
    ("is_start_position_verified", "beginning_accuracy"),
    ("is_end_position_verified", "ending_accuracy"),
)


def check_event(
    properties: dict[str, Any], place: Sequence[Step], profile: Profile
) -> Iterator[Problem]:
    """Yield what is wrong with the ``properties`` of a road event that its model accepts.

    Parameters
    ----------
    properties
        What the model accepted.
    place
        Its place in the document.
    profile
        The specification that the feed follows.
    """
    details = properties["core_details"]
    is_zone = details["event_type"] == "work-zone"
    for name, old in _EITHER if is_zone else _EITHER[:2]:
        if name not in properties and (old not in properties or profile == "cwz-1.0"):
            yield Problem(json_path(*place, name), "required")
    if parse_date(properties["start_date"]) >= parse_date(properties["end_date"]):
        yield Problem(json_path(*place, "end_date"), "expected a date after start_date")
    if profile == "cwz-1.0":
        for name in DEPRECATED:
            if name in properties:
                yield Problem(json_path(*place, name), "CWZ 1.0 has no such member")
    created, updated = details.get("creation_date"), details.get("update_date")
    if created and updated and parse_date(created) > parse_date(updated):
        path = json_path(*place, "core_details", "creation_date")
        yield Problem(path, "is after update_date", is_error=False)
    lanes = properties.get("lanes", [])
    yield from _check_lanes(lanes, [*place, "lanes"])
    if is_zone:
        yield from _check_impact(properties["vehicle_impact"], lanes, place)


def check_device(
    properties: dict[str, Any], place: Sequence[Step], profile: Profile
) -> Iterator[Problem]:
    """Yield what is wrong with the ``properties`` of a device that its model accepts.

    Parameters
    ----------
    properties, place, profile
        Like :func:`check_event`.
    """
    kind = properties["core_details"]["device_type"]
    if profile != "cwz-1.0" and kind in ONLY_CWZ_DEVICES:
        path = json_path(*place, "core_details", "device_type")
        yield Problem(path, f"WZDx 4.2 has no {kind}")
    markers = properties.get("marked_locations", []) if kind == "location-marker" else []
    for k, marker in enumerate(markers):
        if profile == "cwz-1.0" and marker["type"] in ONLY_WZDX_MARKERS:
            path = json_path(*place, "marked_locations", k, "type")
            yield Problem(path, f"CWZ 1.0 has no {marker['type']}")


def check_offsets(document: dict[str, Any]) -> Iterator[Problem]:
    """Yield a warning where dates have an offset from UTC; all are meant to end in Z."""
    found = _with_offset(document, [])
    first = next(found, None)
    if first is not None:
        path, text = first
        more = sum(1 for _ in found)
        others = f"; {more} more like it" if more else ""
        said = f"{shown(text)} has an offset, but dates are in UTC and end in Z{others}"
        yield Problem(path, said, is_error=False)


def check_heading(feature: dict[str, Any], place: Sequence[Step]) -> Iterator[Problem]:
    """Yield a warning where a sound line runs against the direction that is given for it."""
    direction = feature["properties"]["core_details"]["direction"]
    if feature["geometry"]["type"] != "LineString" or direction not in _HEADINGS_DEG:
        return
    runs_deg = heading_deg(feature["geometry"]["coordinates"])
    off_deg = abs((runs_deg - _HEADINGS_DEG[direction] + 180.0) % 360.0 - 180.0)
    if off_deg > _FAR_OFF_DEG:
        text = f"runs towards {runs_deg:.0f} degrees, but the direction is {direction}"
        path = json_path(*place, "geometry", "coordinates")
        yield Problem(path, f"{text}: positions go from upstream to downstream", is_error=False)


def _with_offset(node: Any, place: list[Step]) -> Iterator[tuple[str, str]]:
    items: Iterable[tuple[Step, Any]] = ()
    if isinstance(node, dict):
        items = node.items()
    elif isinstance(node, list):
        items = enumerate(node)
    for step, value in items:
        if isinstance(value, (dict, list)):
            yield from _with_offset(value, [*place, step])
        elif isinstance(value, str) and str(step).endswith("_date") and not is_in_utc(value):
            yield json_path(*place, step), value


def _check_lanes(lanes: list[dict[str, Any]], place: Sequence[Step]) -> Iterator[Problem]:
    orders = sorted(lane["order"] for lane in lanes)
    if orders != list(range(1, len(orders) + 1)):
        text = f"expected every lane once, with the orders 1 to {len(orders)}"
        # Several lanes may share an order in older feeds; a gap leaves a lane out.
        yield Problem(json_path(*place), text, is_error=False)


def _check_impact(
    impact: str, lanes: list[dict[str, Any]], place: Sequence[Step]
) -> Iterator[Problem]:
    """Compare an event's impact with its lanes; a shoulder may be closed while all are open."""
    contradiction = "closed" if impact.startswith("all-lanes-open") else "open"
    if not impact.startswith("all-lanes-"):
        return
    for k, lane in enumerate(lanes):
        if lane["type"] == "general" and lane["status"] == contradiction:
            text = f"{contradiction}, but vehicle_impact is {impact}"
            yield Problem(json_path(*place, "lanes", k, "status"), text, is_error=False)
