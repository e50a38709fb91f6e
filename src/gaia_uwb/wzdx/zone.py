"""The work zones of a log as a road user meets them: cones and lines, in the order of travel.

It comes from a reconstruction, or from the files that one has left. Without a position on Earth, or
without two cones along the path, there is no zone that a feed could describe.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gaia_uwb._shared import Array, Float64, InputError, shown, some_of
from gaia_uwb.estimate import AnchorFix, AnchorStatus, Reason, ReasonKind
from gaia_uwb.projection import to_local
from gaia_uwb.reconstruction import Reconstruction, ReconstructionStatus
from gaia_uwb.scene import LocalFrame
from gaia_uwb.wzdx.parts import FeedPart, RoadZone, make_parts, read_road_zones, road_zones
from gaia_uwb.wzdx.strict_json import read_json
from gaia_uwb.wzdx.travel import passed_at, thinned

_ALONG = 0.5  # of the zone's extent: a drive along it has a longer way
_FARTHEST_M, _LARGEST_M2 = 1e7, 1e100  # a poor fix may be far off, but not farther
_LONGEST_TEXT = 1000


@dataclass(frozen=True)
class FeedZone:
    """The reconstructed work zones of a log, with a place on Earth.

    Parameters
    ----------
    name
        The scene's name.
    frame
        Ties the local frame to WGS84.
    parts
        The work zones along the road, in the order in which the vehicle passed them; at least one.
    hull_m : (H, 2)
        Convex hull of the cones, counter-clockwise, not closed, in metres.
    unlocated
        Ids of the cones that could not be located.
    reliable
        Whether the reconstruction's status is ``ok`` and the drive leads along the zone.
    doubts
        Reasons, in words, to doubt all positions.
    reasons
        All reasons why the zone is unreliable.
    stated
        What was stated about the zone and not measured, in words.
    """

    name: str
    frame: LocalFrame
    parts: tuple[FeedPart, ...]
    hull_m: Float64[Array, "H 2"]
    unlocated: tuple[str, ...]
    reliable: bool
    doubts: tuple[str, ...]
    reasons: tuple[str, ...]
    stated: tuple[str, ...]

    @property
    def cones(self) -> tuple[AnchorFix, ...]:
        """The cones of all zones, in the order in which the vehicle passed them."""
        return tuple(cone for part in self.parts for cone in part.cones)


@dataclass(frozen=True)
class _Result:
    """What a reconstruction, or the files that it left, say; without reasons it is reliable."""

    name: str
    anchors: tuple[AnchorFix, ...]
    hull_m: Float64[Array, "H 2"]
    reasons: tuple[Reason, ...] | None
    stated: tuple[str, ...]
    zones: tuple[RoadZone, ...]


def zone_of(reconstruction: Reconstruction) -> FeedZone:
    """Return the work zones that a reconstruction found.

    Raises
    ------
    InputError
        If the log has no place on Earth, fewer than two cones were located, or the drive did not
        pass along them.
    """
    episode = reconstruction.episode
    good = reconstruction.status is ReconstructionStatus.OK
    result = _Result(
        name=reconstruction.name,
        anchors=reconstruction.anchors,
        hull_m=reconstruction.boundary.hull_m,
        reasons=None if good else reconstruction.reasons,
        stated=reconstruction.stated,
        zones=road_zones(reconstruction.road_boundary),
    )
    return _make_zone(result, episode.frame, episode.position_m)


def read_zone(folder: Path) -> FeedZone:
    """Return the work zone whose results ``gaia reconstruct`` has written.

    Parameters
    ----------
    folder
        Holds ``report.json`` and ``boundary.geojson``, which gives the path.

    Raises
    ------
    InputError
        If a file cannot be read or is not what was written; else like :func:`zone_of`.
    """
    report = read_json(folder / "report.json")
    try:
        frame = None if report["frame"] is None else LocalFrame(**report["frame"])
        anchors = [_read_fix(row) for row in report["anchors"]]
        hull_m = np.array(report["boundary"]["hull_m"], dtype=np.float64).reshape(-1, 2)
        _check_sizes(anchors, hull_m)
        reasons = None if report["status"] == "ok" else tuple(map(_read_reason, report["reasons"]))
        stated = tuple(map(_text, report["stated"]))
        name = _text(report["scene"])
        zones = read_road_zones(report.get("road_boundary"))
    except (KeyError, TypeError, ValueError, OverflowError, InputError) as error:
        what = f"{type(error).__name__}: {error}"
        raise InputError(f"not a report of this version ({what})", source=folder) from error
    if frame is None:
        raise _without_place(name)
    path_m = _read_path(folder / "boundary.geojson", name, frame)
    result = _Result(name, tuple(anchors), hull_m, reasons, stated, zones)
    return _make_zone(result, frame, path_m)


def _read_fix(row: Mapping[str, Any]) -> AnchorFix:
    def pair(*names: str) -> Float64[Array, "2"]:
        return np.array([np.nan if row[n] is None else row[n] for n in names], dtype=np.float64)

    covariance = row["covariance_m2"]
    return AnchorFix(
        anchor_id=_text(row["id"]),
        position_m=pair("east_m", "north_m"),
        covariance_m2=np.full((2, 2), np.nan)
        if covariance is None
        else np.array(covariance, dtype=np.float64),
        mirror_position_m=pair("mirror_east_m", "mirror_north_m"),
        mirror_probability=float(row["mirror_probability"]),
        status=AnchorStatus(row["status"]),
        n_ranges=int(row["n_ranges"]),
        side_is_open=bool(row["side_is_open"]),
    )


def _read_reason(row: Mapping[str, Any]) -> Reason:
    return Reason(ReasonKind(_text(row["kind"])), _text(row["text"]))


def _text(value: object) -> str:
    if not isinstance(value, str) or len(value) > _LONGEST_TEXT:
        expected = f"expected text of at most {_LONGEST_TEXT} characters"
        raise ValueError(f"{expected}, got {shown(value)}")
    return value


def _check_sizes(anchors: Sequence[AnchorFix], hull_m: Float64[Array, "H 2"]) -> None:
    """Refuse places that cannot be on one site, and covariances too large to compute with."""
    places_m = [hull_m, *(np.stack([fix.position_m, fix.mirror_position_m]) for fix in anchors)]
    if not np.isfinite(hull_m).all() or any((np.abs(m) > _FARTHEST_M).any() for m in places_m):
        raise ValueError(f"expected positions within {_FARTHEST_M:g} m")
    if any((np.abs(fix.covariance_m2) > _LARGEST_M2).any() for fix in anchors):
        raise ValueError(f"expected covariances of at most {_LARGEST_M2:g} m²")


def _read_path(file: Path, name: str, frame: LocalFrame) -> Float64[Array, "T 2"]:
    """Return the path in metres, the first pass's, from the GeoJSON next to a report."""
    content = read_json(file)
    try:
        if content["gaia"]["scene"] != name:
            raise InputError(f"expected the scene {shown(name)} of report.json", source=file)
        path, *_ = [
            feature["geometry"]
            for feature in content["features"]
            if feature["properties"]["role"] == "path"
        ]
        line = path["coordinates"]
        if path["type"] == "MultiLineString":  # cut at the 180th meridian, where pieces meet
            line = [*line[0], *(position for piece in line[1:] for position in piece[1:])]
        lon_deg, lat_deg = _pairs(line).T
    except (KeyError, IndexError, TypeError, ValueError, OverflowError) as error:
        raise InputError("expected a feature with the role 'path'", source=file) from error
    position_m, _ = to_local(frame, lat_deg, lon_deg)
    if not np.isfinite(position_m).all():
        raise InputError("expected a path in WGS84 longitude and latitude", source=file)
    return position_m


def _without_place(name: str) -> InputError:
    return InputError(
        "its position on Earth is unknown, but a feed needs longitude and latitude: give the log's "
        "trajectory as lat and lon, or the frame's origin",
        source=name,
    )


def _pairs(line: object) -> Float64[Array, "T 2"]:
    degrees = np.array(line, dtype=np.float64)
    if degrees.ndim != 2 or degrees.shape[1] != 2 or len(degrees) < 2:
        raise ValueError(f"expected pairs of numbers, got {degrees.shape}")
    return degrees


def _make_zone(
    result: _Result, frame: LocalFrame | None, path_m: Float64[Array, "T 2"]
) -> FeedZone:
    """Put cones and lines into the order of travel."""
    name, anchors, reasons = result.name, result.anchors, result.reasons
    if frame is None:
        raise _without_place(name)
    located = [anchor for anchor in anchors if anchor.status.has_position]
    if len(located) < 2:
        problem = f"a work zone's line needs at least two located cones, got {len(located)}"
        raise InputError(problem, source=name)
    path_m = thinned(path_m)
    at_m = passed_at(path_m, np.array([anchor.position_m for anchor in located]))
    parts = make_parts(path_m, located, at_m, result.zones)
    if not parts:
        problem = "the drive does not pass along the cones, so the zone has no start and end"
        raise InputError(problem, source=name)
    doubts = () if reasons is None else _doubts(reasons)
    across = tuple(words for part in parts for words in _across(part))
    alone = tuple(_alone(located, parts))
    return FeedZone(
        name=name,
        frame=frame,
        parts=parts,
        hull_m=result.hull_m,
        unlocated=tuple(anchor.anchor_id for anchor in anchors if not anchor.status.has_position),
        reliable=reasons is None and not across,
        doubts=(*doubts, *across),
        reasons=(*map(str, reasons or ()), *across, *alone),
        stated=result.stated,
    )


def _alone(located: Sequence[AnchorFix], parts: Sequence[FeedPart]) -> Iterator[str]:
    """Say in words which cones are in no zone that a line can describe."""
    in_zones = {cone.anchor_id for part in parts for cone in part.cones}
    lost = [cone.anchor_id for cone in located if cone.anchor_id not in in_zones]
    if lost:
        yield f"in no work zone with two cones, and left out: {some_of(lost)}"


def _across(part: FeedPart) -> Iterator[str]:
    """Say in words if a drive leads past the zone's side or ends in it, not along it."""
    position_m, line_m = np.array([cone.position_m for cone in part.cones]), part.line_m
    apart_m = float(max(np.hypot(*(position_m - one_m).T).max() for one_m in position_m))
    length_m = float(np.hypot(*np.diff(line_m, axis=0).T).sum())
    if length_m < _ALONG * apart_m:
        yield (
            f"the drive passes all cones within {length_m:.1f} m of its path, although they are "
            f"up to {apart_m:.1f} m apart, so their order along the road is unknown"
        )


def _doubts(reasons: Sequence[Reason]) -> tuple[str, ...]:
    if not reasons:
        return ("the reconstruction is marked unreliable",)
    return tuple(reason.text for reason in reasons if reason.kind.concerns_all_places)
