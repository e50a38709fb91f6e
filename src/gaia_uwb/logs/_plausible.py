"""Is it in seconds, metres and degrees, and of one drive? Refuse tables that cannot be."""

from __future__ import annotations

import numpy as np

from gaia_uwb._shared import Array, Float64, InputError
from gaia_uwb.logs._table import Table
from gaia_uwb.scene import LocalFrame

MAX_STEP_S = 10.0
"""A trajectory whose median step is longer cannot carry ranges; one in milliseconds looks so."""

MAX_DISTANCE_M = 50_000.0
"""Further from the local frame's origin than this, a place is an error, not a drive."""

_LEAST_STEP_S = 1e-9
_ABSURD_M = 1e9  # a radio's garbage, like 2^32 millimetres, is below: that is a spike
_EARTH_M = 2.1e7  # half of its girth: grids like UTM count in metres from far away
_MILLIMETRES_ABOVE_M = 1_000.0  # UWB reaches 500 m at best
_EPOCH_UNITS = ((1e17, "nanoseconds"), (1e14, "microseconds"), (1e11, "milliseconds"))


def check_seconds(table: Table) -> None:
    """Refuse times since 1970 in milliseconds, microseconds or nanoseconds.

    Raises
    ------
    InputError
        If a time lies beyond the year 5100.
    """
    for limit, unit in _EPOCH_UNITS:
        index = int(np.argmax(np.abs(table["t_s"])))
        t_s = float(table["t_s"][index])
        if abs(t_s) >= limit:
            problem = f"expected seconds, got {t_s:.6g}, which looks like {unit} since 1970"
            raise table.error(problem, index=index, column="t_s")


def check_timeline(trajectory: Table) -> None:
    """Refuse a trajectory that does not go forward in time in steps of seconds.

    Raises
    ------
    InputError
        If there are fewer than 2 samples, time stands still or goes back, or the median step is
        longer than :data:`MAX_STEP_S`.
    """
    t_s = trajectory["t_s"]
    if len(t_s) < 2:
        raise trajectory.error(f"expected at least 2 samples, got {len(t_s)}", column="t_s")
    step_s = np.diff(t_s)
    stands = step_s <= _LEAST_STEP_S
    if stands.any():
        k = int(np.argmax(stands))
        problem = f"expected increasing time, got {t_s[k + 1]:.6f} s after {t_s[k]:.6f} s"
        raise trajectory.error(problem, index=k + 1, column="t_s")
    if np.median(step_s) >= MAX_STEP_S:
        problem = f"expected seconds, got a step of {np.median(step_s):g}: is it in milliseconds?"
        raise trajectory.error(problem, column="t_s")


def check_geodetic(table: Table) -> None:
    """Refuse impossible latitudes, longitudes and heights.

    Raises
    ------
    InputError
        If a latitude is outside [-90, 90], a longitude outside [-180, 180], or a height further
        than 100 km from the ellipsoid.
    """
    for name, bound in (("lat", 90.0), ("lon", 180.0), ("alt_m", 1e5)):
        wrong = np.abs(table[name]) > bound if name in table else np.False_  # unknown is not wrong
        if wrong.any():
            index = int(np.argmax(wrong))
            value, lon_deg = float(table[name][index]), float(table["lon"][index])
            swapped = name == "lat" and abs(value) <= 180 and abs(lon_deg) <= 90
            hint = "; are lat and lon swapped?" if swapped else ""
            problem = f"expected a number between -{bound:g} and {bound:g}, got {value:g}{hint}"
            raise table.error(problem, index=index, column=name)


def check_near(
    table: Table, position_m: Float64[Array, "R 2"], frame: LocalFrame, *, column: str
) -> None:
    """Refuse places that are far from the local frame's origin.

    Raises
    ------
    InputError
        If a place is further than :data:`MAX_DISTANCE_M` from it.
    """
    distance_m = np.hypot(*position_m.T)
    far = distance_m > MAX_DISTANCE_M
    if far.any():
        index = int(np.argmax(far))
        problem = (
            f"expected a position near the origin at lat {frame.lat_deg:g}, lon {frame.lon_deg:g}, "
            f"got one {distance_m[index] / 1000:,.0f} km away"
        )
        raise table.error(problem, index=index, column=column)


def check_site(table: Table) -> None:
    """Refuse local places that cannot be metres on one site; an unknown place is not wrong.

    Raises
    ------
    InputError
        If a coordinate is larger than any on Earth, a horizontal one further than
        :data:`MAX_DISTANCE_M` from the middle one, or a height further than 100 km from 0.
    """
    for name, bound in (("east_m", _EARTH_M), ("north_m", _EARTH_M), ("up_m", 1e5)):
        values = table.get(name)
        if values is None or not np.isfinite(values).any():
            continue
        wrong = np.abs(values) > bound
        if wrong.any():
            index = int(np.argmax(wrong))
            problem = f"expected metres between -{bound:g} and {bound:g}, got {values[index]:g}"
            raise table.error(problem, index=index, column=name)
        away_m = np.abs(values - np.nanmedian(values))
        if name != "up_m" and np.nanmax(away_m) > MAX_DISTANCE_M:
            index = int(np.nanargmax(away_m))
            problem = (
                f"expected a position near the others, got one {away_m[index] / 1000:,.0f} km away"
            )
            raise table.error(problem, index=index, column=name)


def check_one_drive(ranges: Table, trajectory: Table, position_m: Float64[Array, "T 2"]) -> None:
    """Refuse ranges that do not belong to the trajectory, or are not in metres.

    Raises
    ------
    InputError
        If their times do not overlap, half of the ranges are longer than 1,000 m, or one is beyond
        all reason.
    """
    first_s, last_s = trajectory["t_s"][[0, -1]]
    t_s = ranges["t_s"]
    if t_s.max() < first_s or t_s.min() > last_s:
        raise InputError(
            f"the times do not overlap: the ranges span {t_s.min():.3f} to {t_s.max():.3f} s, "
            f"the trajectory {first_s:.3f} to {last_s:.3f} s",
            source=ranges.path,
            column="t_s",
        )
    length_m = np.abs(ranges["range_m"])
    if length_m.max() > _ABSURD_M:
        index = int(np.argmax(length_m))
        problem = f"expected metres, got {ranges['range_m'][index]:g}"
        raise ranges.error(problem, index=index, column="range_m")
    median_m = float(np.median(length_m))
    if median_m > _MILLIMETRES_ABOVE_M:
        extent_m = float(np.hypot(*np.ptp(position_m, axis=0)))
        problem = (
            f"expected metres, got a median of {median_m:g} on a path {extent_m:.0f} m wide: "
            "this looks like millimetres or centimetres"
        )
        raise ranges.error(problem, column="range_m")
