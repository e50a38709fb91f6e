"""Options that say what is known of the boundary that a driver sees."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from gaia_uwb.config import PipelineConfig


class Form(StrEnum):
    """How the cones of a zone stand, as the command line names it."""

    ONE_ROW = "one-row"
    LANE_BETWEEN = "lane-between"
    WORKS_BETWEEN = "works-between"
    AREA = "area"


_MOST_BYTES = 10_000_000  # of a file with the line of a road's edge

FormOption = Annotated[
    Form | None,
    typer.Option("--form", help="Known: how the cones of every zone stand, seen from the road."),
]
ClosedWidthOption = Annotated[
    float | None,
    typer.Option(
        "--closed-width",
        metavar="METRES",
        help="Known: how far a row of cones closes the road, from its edge away from traffic.",
    ),
]
ClosedLanesOption = Annotated[
    int | None,
    typer.Option("--closed-lanes", metavar="N", help="Known: the same in lanes."),
]
LaneWidthOption = Annotated[
    float | None,
    typer.Option("--lane-width", metavar="METRES", help="Width of one lane. Default: 3.6."),
]
RoadEdgeOption = Annotated[
    Path | None,
    typer.Option(
        "--road-edge",
        metavar="FILE",
        help="Known: the same as a line along the road's edge, in a GeoJSON file.",
    ),
]


def with_boundary(
    settings: PipelineConfig,
    form: Form | None,
    closed_width_m: float | None,
    closed_lanes: int | None,
    lane_width_m: float | None,
    road_edge: Path | None,
) -> PipelineConfig:
    """Return settings with what the command line says about the boundary.

    Parameters
    ----------
    settings
        What they are without it.
    form, closed_width_m, closed_lanes, lane_width_m, road_edge
        The options; None leaves what the settings say. Of closed width, closed lanes and road's
        edge, one that is given takes the place of another in the settings.

    Raises
    ------
    ConfigError
        If an option is malformed, or more than one says how wide the closed part is.
    InputError
        If the file of a road's edge cannot be read, or holds no line.
    """
    from gaia_uwb._shared import ConfigError
    from gaia_uwb.config import make_config

    if sum(each is not None for each in (closed_width_m, closed_lanes, road_edge)) > 1:
        raise ConfigError("expected one of --closed-width, --closed-lanes and --road-edge")
    widths = {
        "closed_width_m": closed_width_m,
        "closed_lanes": closed_lanes,
        "road_edge": None if road_edge is None else read_line(road_edge),
    }
    said: dict[str, Any] = {
        "form": None if form is None else form.value,
        "lane_width_m": lane_width_m,
    } | widths
    said = {name: value for name, value in said.items() if value is not None}
    if not said:
        return settings
    content = settings.model_dump(mode="json")
    if said.keys() & widths.keys():
        content["boundary"] = {
            name: value for name, value in content["boundary"].items() if name not in widths
        }
    content["boundary"] |= said
    return make_config(content, source="options")


def read_line(path: Path) -> list[Any]:
    """Return longitude and latitude of the points of the only line in a GeoJSON file, unchecked.

    Parameters
    ----------
    path
        Of a LineString, or of a Feature or FeatureCollection with a single one.

    Raises
    ------
    InputError
        If the file cannot be read, or does not hold one line.
    """
    import json

    from gaia_uwb._shared import InputError

    try:
        if path.exists() and not path.is_file():
            raise InputError("is not a regular file", source=path)
        if path.stat().st_size > _MOST_BYTES:
            raise InputError("is too large for the line of a road's edge", source=path)
        content = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror or error}", source=path) from error
    except (ValueError, RecursionError) as error:
        raise InputError(f"is not GeoJSON: {error}", source=path) from error
    lines = list(_lines(content))
    if len(lines) != 1:
        problem = f"expected GeoJSON with one LineString, got {len(lines) or 'none'}"
        raise InputError(problem, source=path)
    if not lines[0]:
        raise InputError("the LineString has no points", source=path)
    return [point[:2] if isinstance(point, list) else point for point in lines[0]]


def _lines(content: Any) -> list[Any]:
    """Return the coordinates of the lines in a GeoJSON object."""
    if not isinstance(content, dict):
        return []
    if content.get("type") == "FeatureCollection":
        features = content.get("features")
        features = features if isinstance(features, list) else []
        return [line for each in features for line in _lines(each)]
    if content.get("type") == "Feature":
        return _lines(content.get("geometry"))
    if content.get("type") == "LineString" and isinstance(content.get("coordinates"), list):
        return [content["coordinates"]]
    return []
