"""The reconstruction as GeoJSON (RFC 7946), for a GIS or a traffic-management centre.

Features, in drawing order; the property ``role`` tells them apart:

=====================  ==============  ==========================================================
role                   geometry        what it is
=====================  ==============  ==========================================================
``path``               LineString      the path of the tag's antenna, thinned; one per pass
``hull-outer``         (M)Polygon      with 90 % probability nothing of the hull is outside
``hull``               Polygon         the paper's boundary: convex hull of all located cones
``hull-inner``         (M)Polygon      with 90 % probability all of it is in the hull
``outline``            Polygon         the outline that visits every located cone
``closed-area-outer``  (M)Polygon      with 90 % probability nothing that is closed is outside
``closed-area``        (M)Polygon      the ground that is closed to traffic
``open-strip``         (M)Polygon      behind an edge of unknown width: for drawing, no area
``closed-area-inner``  (M)Polygon      with 90 % probability all of it is closed
``edge-band``          (M)Polygon      holds the edge with 90 % probability, place by place
``edge``               (M)LineString   what traffic must not cross, in the direction of travel, in
                                       pieces between gaps
``taper``              LineString      where an edge leads into the road, or out of it
``gap``                LineString      between two cones that are farther apart than usual
``ellipse``            Polygon         a cone's 90 % confidence ellipse; with ``mirror`` true, that
                                       about the other place of an ambiguous cone
``mirror``             Point           the other place of an ambiguous cone
``cone``               Point           a located cone, with its status and uncertainty
=====================  ==============  ==========================================================

What is empty or unknown is left out. ``(M)`` means Multi in front where there are several pieces.
``uncertainty.py`` defines the regions of the hull, ``roadside`` all that is along the road.

Coordinates are WGS84 longitude and latitude with nine decimals (0.1 mm), exterior rings run
counter-clockwise, holes clockwise. Lines and polygons across the 180th meridian are cut there into
a MultiLineString or a MultiPolygon, and the collection's ``bbox`` then runs from a west above 0 to
an east below 0. Where the scene's place on Earth is unknown, no valid coordinates
exist: they are then east and north in metres, and the member ``gaia.coordinates`` says so.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from gaia_uwb._shared import Array, Float64
from gaia_uwb.episode import Episode
from gaia_uwb.estimate import AnchorFix, BoundaryStatus
from gaia_uwb.outputs.antimeridian import bounding_box, cut_at_antimeridian
from gaia_uwb.outputs.road_features import Lines, Polygons, road_features
from gaia_uwb.projection import to_geodetic
from gaia_uwb.reconstruction import Reconstruction
from gaia_uwb.roadside import RoadBoundary
from gaia_uwb.scene import LocalFrame

Json: TypeAlias = dict[str, object]

ELLIPSE_PROBABILITY = 0.9
_LARGEST_ELLIPSE_M = 1000.0  # a larger one says "unknown" and would only hide the rest
_ELLIPSE_POINTS = 36
_PATH_POINTS = 1000

WGS84 = "WGS84 longitude/latitude in degrees"
LOCAL = "local east/north metres, not WGS84"
HULL_NOTE = "the paper's boundary: the convex hull of all located cones"


@dataclass(frozen=True)
class Ellipse:
    """A confidence ellipse about an estimated position.

    Parameters
    ----------
    semi_major_m, semi_minor_m
        Its semi-axes, in metres.
    azimuth_deg
        Direction of the major axis, in degrees clockwise from north, in [0, 180).
    """

    semi_major_m: float
    semi_minor_m: float
    azimuth_deg: float

    def outline_m(self, centre_m: Float64[Array, "2"]) -> Float64[Array, "K 2"]:
        """Return points on the ellipse about ``centre_m``, counter-clockwise, in metres."""
        angle = np.arange(_ELLIPSE_POINTS) * (2.0 * np.pi / _ELLIPSE_POINTS)
        azimuth = np.radians(self.azimuth_deg)
        major_m = self.semi_major_m * np.array([np.sin(azimuth), np.cos(azimuth)])
        minor_m = self.semi_minor_m * np.array([-np.cos(azimuth), np.sin(azimuth)])
        circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        return np.asarray(centre_m + circle @ np.stack([major_m, minor_m]))


def confidence_ellipse(
    covariance_m2: Float64[Array, "2 2"], probability: float = ELLIPSE_PROBABILITY
) -> Ellipse | None:
    """Return the ellipse that covers a normally distributed place with ``probability``.

    Parameters
    ----------
    covariance_m2 : (2, 2)
        Covariance of (east, north), in square metres.
    probability
        Above 0 and below 1.

    Returns
    -------
    Ellipse or None
        None where the covariance is not finite, or the ellipse is larger than a kilometre and so
        says nothing.

    Examples
    --------
    >>> import numpy as np
    >>> from gaia_uwb.outputs import confidence_ellipse
    >>> ellipse = confidence_ellipse(np.diag([0.04, 0.01]))
    >>> round(ellipse.semi_major_m, 3), round(ellipse.semi_minor_m, 3), ellipse.azimuth_deg
    (0.429, 0.215, 90.0)
    """
    if not np.isfinite(covariance_m2).all():
        return None
    variances_m2, axes = np.linalg.eigh(covariance_m2)
    # The chi-square quantile with two degrees of freedom, in closed form.
    quantile = -2.0 * np.log1p(-probability)
    semi_minor_m, semi_major_m = np.sqrt(quantile * np.maximum(variances_m2, 0.0))
    if semi_major_m > _LARGEST_ELLIPSE_M:
        return None
    east, north = axes[:, 1]
    azimuth_deg = float(np.degrees(np.arctan2(east, north))) % 180.0
    return Ellipse(float(semi_major_m), float(semi_minor_m), azimuth_deg)


def lon_lat(frame: LocalFrame | None, position_m: Float64[Array, "K 2"]) -> Float64[Array, "K 2"]:
    """Return WGS84 longitude and latitude of places in the local frame.

    Parameters
    ----------
    frame
        Where the local frame lies on Earth; None where that is unknown.
    position_m : (K, 2)
        East and north, in metres.

    Returns
    -------
    (K, 2)
        Longitude and latitude, in degrees; NaN without a frame or without a place.
    """
    places = np.full(position_m.shape, np.nan)
    known = np.isfinite(position_m).all(axis=1)
    if frame is not None and known.any():
        lat_deg, lon_deg, _ = to_geodetic(frame, position_m[known])
        places[known] = np.stack([lon_deg, lat_deg], axis=1)
    return places


def boundary_geojson(reconstruction: Reconstruction, *, local: bool = False) -> Json:
    """Return the reconstruction as a GeoJSON FeatureCollection.

    Parameters
    ----------
    reconstruction
        What to describe.
    local
        Write east and north in metres even if there is a geographic reference; a plain map draws
        these.

    Returns
    -------
    dict
        Strict JSON values only.
    """
    frame = None if local else reconstruction.episode.frame
    writer = _Writer(frame)
    features: list[dict[str, Any]] = [
        *(writer.path(episode) for episode, _ in reconstruction.passes),
        *writer.hull(reconstruction),
        *writer.road(reconstruction.road_boundary),
        *writer.anchors(reconstruction.anchors),
    ]
    box: Json = {}
    if frame is not None:
        shapes = [cut_at_antimeridian(feature["geometry"]) for feature in features]
        features = [f | {"geometry": s} for f, s in zip(features, shapes, strict=True)]
        box = {"bbox": bounding_box(shapes)}
    return {
        "type": "FeatureCollection",
        **box,
        "gaia": {
            "coordinates": LOCAL if frame is None else WGS84,
            "scene": reconstruction.name,
            "status": reconstruction.status.value,
        },
        "features": features,
    }


@dataclass(frozen=True)
class _Writer:
    """Makes features; knows whether coordinates are degrees or metres."""

    frame: LocalFrame | None

    def path(self, episode: Episode) -> Json:
        line = self._coordinates(_thin(episode.position_m))
        return _feature("path", "LineString", line, {"pass": episode.name})

    def hull(self, reconstruction: Reconstruction) -> Iterator[Json]:
        """Yield the hull with its regions, unless they are unknown or empty, and the outline."""
        boundary, found = reconstruction.boundary, reconstruction.boundary_uncertainty
        if found is not None and found.outer.polygons:
            sure: Json = {"probability": found.probability, "area_m2": found.outer.area_m2}
            yield self._areas("hull-outer", found.outer.polygons, sure)
        if boundary.status is BoundaryStatus.OK:
            properties: Json = {"area_m2": boundary.area_m2, "note": HULL_NOTE}
            yield self._polygon("hull", boundary.hull_m, properties)
        if found is not None and found.inner.polygons:
            sure = {"probability": found.probability, "area_m2": found.inner.area_m2}
            yield self._areas("hull-inner", found.inner.polygons, sure)
        if boundary.status is BoundaryStatus.OK:
            ids = reconstruction.episode.anchor_ids
            visited = [ids[index] for index in boundary.outline_index]
            yield self._polygon("outline", boundary.outline_m, {"anchor_ids": visited})

    def road(self, boundary: RoadBoundary | None) -> Iterator[Json]:
        """Yield what a driver sees of the zones."""
        for found in () if boundary is None else road_features(boundary):
            if found.lines_m:
                yield self._lines(found.role, found.lines_m, found.properties)
            else:
                yield self._areas(found.role, found.polygons_m, found.properties)

    def anchors(self, anchors: Sequence[AnchorFix]) -> Iterator[Json]:
        """Yield all ellipses, then all mirror places, then all cones, so that cones lie on top."""
        located = [anchor for anchor in anchors if anchor.status.has_position]
        ellipses = [confidence_ellipse(anchor.covariance_m2) for anchor in located]
        for anchor, ellipse in zip(located, ellipses, strict=True):
            if ellipse is not None:
                outline_m = ellipse.outline_m(anchor.position_m)
                yield self._polygon("ellipse", outline_m, _described(anchor, ellipse))
        undecided = [anchor for anchor in located if anchor.side_is_open]
        for anchor in undecided:
            ellipse = confidence_ellipse(anchor.mirror_covariance_m2)
            if ellipse is not None:
                outline_m = ellipse.outline_m(anchor.mirror_position_m)
                described = _described(anchor, ellipse, mirror=True) | {"mirror": True}
                yield self._polygon("ellipse", outline_m, described)
        for anchor in undecided:
            yield self._point(
                "mirror",
                anchor.mirror_position_m,
                {"id": anchor.anchor_id, "mirror_probability": anchor.mirror_probability},
            )
        for anchor, ellipse in zip(located, ellipses, strict=True):
            yield self._point("cone", anchor.position_m, _described(anchor, ellipse))

    def _point(self, role: str, position_m: Float64[Array, "2"], properties: Json) -> Json:
        return _feature(role, "Point", self._coordinates(position_m[None])[0], properties)

    def _polygon(self, role: str, ring_m: Float64[Array, "K 2"], properties: Json) -> Json:
        east, north = (ring_m - ring_m[0]).T
        twice_area = np.sum(east * np.roll(north, -1) - np.roll(east, -1) * north)
        ring_m = ring_m if twice_area >= 0 else ring_m[::-1]
        return _feature(role, "Polygon", [self._ring(ring_m)], properties)

    def _areas(self, role: str, polygons_m: Polygons, properties: Json) -> Json:
        pieces = [[self._ring(ring_m) for ring_m in rings_m] for rings_m in polygons_m]
        if len(pieces) == 1:
            return _feature(role, "Polygon", pieces[0], properties)
        return _feature(role, "MultiPolygon", pieces, properties)

    def _lines(self, role: str, lines_m: Lines, properties: Json) -> Json:
        pieces = [self._coordinates(line_m) for line_m in lines_m]
        if len(pieces) == 1:
            return _feature(role, "LineString", pieces[0], properties)
        return _feature(role, "MultiLineString", pieces, properties)

    def _ring(self, ring_m: Float64[Array, "K 2"]) -> list[list[float]]:
        return self._coordinates(np.concatenate([ring_m, ring_m[:1]]))

    def _coordinates(self, position_m: Float64[Array, "K 2"]) -> list[list[float]]:
        places = position_m if self.frame is None else lon_lat(self.frame, position_m)
        coordinates: list[list[float]] = places.round(4 if self.frame is None else 9).tolist()
        return coordinates


def _feature(role: str, geometry: str, coordinates: object, properties: Json) -> Json:
    return {
        "type": "Feature",
        "geometry": {"type": geometry, "coordinates": coordinates},
        "properties": {"role": role, **properties},
    }


def _described(anchor: AnchorFix, ellipse: Ellipse | None, *, mirror: bool = False) -> Json:
    """Return what is known of a cone; GIS attribute tables want it flat."""
    covariance_m2 = anchor.mirror_covariance_m2 if mirror else anchor.covariance_m2
    sigma_m = np.sqrt(np.maximum(np.diag(covariance_m2), 0.0))
    east_m, north_m = (float(s) if np.isfinite(s) else None for s in sigma_m)
    alone = anchor.mirror_probability_by_ranges
    return {
        "id": anchor.anchor_id,
        "status": anchor.status.value,
        "n_ranges": anchor.n_ranges,
        "mirror_probability": anchor.mirror_probability,
        "mirror_probability_by_ranges": alone if np.isfinite(alone) else None,
        "side_source": None if anchor.side_source is None else anchor.side_source.value,
        "sigma_east_m": east_m,
        "sigma_north_m": north_m,
        "ellipse_probability": ELLIPSE_PROBABILITY,
        "ellipse_semi_major_m": None if ellipse is None else ellipse.semi_major_m,
        "ellipse_semi_minor_m": None if ellipse is None else ellipse.semi_minor_m,
        "ellipse_azimuth_deg": None if ellipse is None else ellipse.azimuth_deg,
    }


def _thin(position_m: Float64[Array, "T 2"]) -> Float64[Array, "K 2"]:
    """Keep the ends of the path and about a thousand points, evenly spaced along it."""
    travelled_m = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(position_m, axis=0).T))])
    spacing_m = travelled_m[-1] / _PATH_POINTS
    if spacing_m == 0.0:  # parked: a LineString still needs two positions
        return position_m[[0, -1]]
    _, kept = np.unique(np.floor(travelled_m / spacing_m), return_index=True)
    return np.asarray(position_m[np.union1d(kept, [len(position_m) - 1])])
