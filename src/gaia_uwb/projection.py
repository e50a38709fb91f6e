"""WGS84 latitude, longitude and height <-> local east, north and up about a :class:`LocalFrame`.

The local frame is the topocentric one: a plane that touches the ellipsoid's normal at the frame's
origin, with no map projection's scale, so that distances in it are distances on site. The way back
is exact, not an approximation that grows with the distance.

>>> import numpy as np
>>> from gaia_uwb.projection import to_geodetic, to_local
>>> from gaia_uwb.scene import LocalFrame
>>> site = LocalFrame(lat_deg=37.5552, lon_deg=127.0452, alt_m=50.0)
>>> position_m, up_m = to_local(site, np.array([37.5553]), np.array([127.0452]))
>>> position_m.round(3) + 0.0
array([[ 0.   , 11.099]])
>>> lat_deg, lon_deg, alt_m = to_geodetic(site, position_m, up_m)
>>> lat_deg.round(9), lon_deg.round(9), alt_m.round(6)
(array([37.5553]), array([127.0452]), array([50.]))
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from gaia_uwb._shared import Array, Float64
from gaia_uwb.scene import LocalFrame


def to_local(
    frame: LocalFrame,
    lat_deg: Float64[Array, "R"],
    lon_deg: Float64[Array, "R"],
    alt_m: Float64[Array, "R"] | None = None,
) -> tuple[Float64[Array, "R 2"], Float64[Array, "R"]]:
    """Bring places on Earth into the local frame.

    Parameters
    ----------
    frame
        The local frame's origin.
    lat_deg, lon_deg : (R,)
        WGS84 latitude and longitude, in degrees.
    alt_m : (R,), optional
        Ellipsoidal height, in metres; ``None`` takes the origin's for all.

    Returns
    -------
    position_m : (R, 2)
        East and north of the origin, in metres.
    up_m : (R,)
        Height above the plane through the origin, in metres.
    """
    height_m = np.full_like(lat_deg, frame.alt_m) if alt_m is None else alt_m
    east_m, north_m, up_m = _pipeline(frame).transform(lon_deg, lat_deg, height_m)
    return np.stack([east_m, north_m], axis=1), np.asarray(up_m)


def to_geodetic(
    frame: LocalFrame,
    position_m: Float64[Array, "R 2"],
    up_m: Float64[Array, "R"] | None = None,
) -> tuple[Float64[Array, "R"], Float64[Array, "R"], Float64[Array, "R"]]:
    """Bring places in the local frame onto Earth.

    Parameters
    ----------
    frame
        The local frame's origin.
    position_m : (R, 2)
        East and north of the origin, in metres.
    up_m : (R,), optional
        Height above the plane through the origin, in metres; ``None`` takes all places to have the
        origin's ellipsoidal height.

    Returns
    -------
    lat_deg, lon_deg : (R,)
        WGS84 latitude and longitude, in degrees.
    alt_m : (R,)
        Ellipsoidal height, in metres.
    """
    pipeline = _pipeline(frame)
    east_m, north_m = position_m.T
    height_m = np.zeros_like(east_m) if up_m is None else up_m
    lon_deg, lat_deg, alt_m = pipeline.transform(east_m, north_m, height_m, direction="INVERSE")
    if up_m is None:
        # Earth falls away from the plane by 8 cm at 1 km and 8 m at 10 km; each round of this
        # correction shrinks what is left of it by the Earth's curvature, so two are plenty.
        for _ in range(2):
            height_m = height_m + (frame.alt_m - alt_m)
            lon_deg, lat_deg, alt_m = pipeline.transform(
                east_m, north_m, height_m, direction="INVERSE"
            )
    return np.asarray(lat_deg), np.asarray(lon_deg), np.asarray(alt_m)


@lru_cache(maxsize=16)
def _pipeline(frame: LocalFrame) -> Any:
    """Return PROJ's pipeline from (longitude, latitude, height) to (east, north, up)."""
    from pyproj import Transformer

    return Transformer.from_pipeline(
        "+proj=pipeline +step +proj=unitconvert +xy_in=deg +xy_out=rad "
        "+step +proj=cart +ellps=WGS84 +step +proj=topocentric +ellps=WGS84 "
        f"+lat_0={frame.lat_deg!r} +lon_0={frame.lon_deg!r} +h_0={frame.alt_m!r}"
    )
