"""Tapers: where an edge leads traffic sideways, and how long the manual wants that to be.

>>> [round(merging_taper_m(3.66, speed_mph / 2.2369)) for speed_mph in (25, 40, 45, 65)]
[38, 98, 165, 238]
"""

from __future__ import annotations

import math

import numpy as np

from gaia_uwb._shared import Array, Float64
from gaia_uwb.roadside.road_boundary import Taper
from gaia_uwb.roadside.zone_cones import SideCones

_LEAST_WIDTH_M = 1.0  # an edge that moves by less has no taper
_MOST_BENDS = 40  # places of a bend that are tried at each end
_METRES_PER_FOOT = 0.3048
_MPS_PER_MPH = 0.44704
_SLOW_MPH = 42.5  # the manual says how long up to 40 mph and from 45 mph


def merging_taper_m(width_m: float, speed_mps: float) -> float:
    """Return the length L of a merging taper that the manual asks for.

    L = W S² / 60 up to 40 mph, and L = W S from 45 mph, with L and W in feet and S in miles per
    hour. A shifting taper is to be half as long, a taper on a shoulder a third.

    Parameters
    ----------
    width_m
        By which the taper moves traffic, in metres.
    speed_mps
        In metres per second; NaN gives NaN.

    References
    ----------
    Manual on Uniform Traffic Control Devices, part 6, tables of tapers.
    """
    speed_mph = speed_mps / _MPS_PER_MPH
    per_width = speed_mph**2 / 60.0 if speed_mph <= _SLOW_MPH else speed_mph
    return width_m / _METRES_PER_FOOT * per_width * _METRES_PER_FOOT


def find_tapers(row: SideCones, speed_mps: float) -> tuple[Taper, ...]:
    """Return the tapers of an edge: one that leads in, one that leads out, or none.

    The edge is taken as three straight parts, of which the middle one runs along the path: least
    squares over all pairs of cones at which it may bend.

    Parameters
    ----------
    row
        The cones of the edge.
    speed_mps
        Driven along the zone; NaN if unknown.
    """
    at_m = row.cones.station_m[row.rows]
    from_path_m = np.abs(row.cones.offset_m[row.rows])
    if len(at_m) < 3:
        return ()
    bend_in, bend_out, wide_in_m, wide_out_m = _fit(at_m, from_path_m)
    found = []
    if wide_in_m >= _LEAST_WIDTH_M:
        found.append(_taper(row, slice(0, bend_in + 1), wide_in_m, speed_mps))
    if wide_out_m >= _LEAST_WIDTH_M:
        found.append(_taper(row, slice(bend_out, len(at_m)), wide_out_m, math.nan))
    return tuple(found)


def _taper(row: SideCones, part: slice, width_m: float, speed_mps: float) -> Taper:
    rows = row.rows[part]
    start, end = row.cones.end(int(rows[0])), row.cones.end(int(rows[-1]))
    return Taper(
        is_upstream=part.start == 0,
        start=start,
        end=end,
        place_m=row.cones.place_m[rows],
        length_m=end.station_m - start.station_m,
        width_m=width_m,
        asked_m=merging_taper_m(width_m, speed_mps),
    )


def _fit(
    at_m: Float64[Array, "K"], from_path_m: Float64[Array, "K"]
) -> tuple[int, int, float, float]:
    """Return at which cones an edge bends, and how far it leads away from the path at each end.

    Bends at the first and the last cone mean that there is no taper.
    """
    n = len(at_m)
    tried = np.unique(np.linspace(0, n - 1, min(n, _MOST_BENDS)).round().astype(int))
    first, last = (
        each[tried[:, None] <= tried] for each in np.meshgrid(tried, tried, indexing="ij")
    )
    rises_in = np.maximum(at_m[first][:, None] - at_m, 0.0)  # (pairs, K)
    rises_out = np.maximum(at_m - at_m[last][:, None], 0.0)
    scale_m = max(float(np.ptp(at_m)), 1e-9)
    basis = np.stack([np.ones_like(rises_in), rises_in / scale_m, rises_out / scale_m], axis=2)
    normal = np.einsum("pki,pkj->pij", basis, basis) + 1e-9 * np.eye(3)
    target = np.einsum("pki,k->pi", basis, from_path_m)
    solved = np.linalg.solve(normal, target[..., None])[..., 0]
    error_m2 = ((np.einsum("pki,pi->pk", basis, solved) - from_path_m) ** 2).sum(axis=1)
    best = int(np.argmin(error_m2))
    _, slope_in, slope_out = solved[best]
    a, b = int(first[best]), int(last[best])
    in_m = float(slope_in * (at_m[a] - at_m[0]) / scale_m)
    out_m = float(slope_out * (at_m[-1] - at_m[b]) / scale_m)
    return a, b, in_m, out_m
