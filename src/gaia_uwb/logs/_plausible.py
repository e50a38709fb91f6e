"""Is it in seconds, metres and degrees, and of one drive? Refuse tables that cannot be."""

from __future__ import annotations

import numpy as np

from gaia_uwb._shared import Array, Float64, InputError, counted
from gaia_uwb.logs._table import Table
from gaia_uwb.scene import LocalFrame

MAX_STEP_S = 10.0
"""A trajectory whose median step is longer cannot carry ranges; one in milliseconds looks so."""

MAX_DISTANCE_M = 50_000.0
"""Further from the local frame's origin than this, a place is an error, not a drive."""

ATTITUDE = ("heading_deg", "roll_deg", "pitch_deg")
"""Columns of a trajectory: the compass heading, and roll and pitch as in REP 103."""

ARRIVAL = ("azimuth_deg", "azimuth_sigma_deg")
"""Columns of ranges: the angle of arrival, counter-clockwise from forward, and its deviation."""

_LEAST_STEP_S = 1e-9
_FULL_TURN_DEG = 360.0
_ABSURD_M = 1e9  # a radio's garbage, like 2^32 millimetres, is below: that is a spike
_EARTH_M = 2.1e7  # half of its girth: grids like UTM count in metres from far away
_MILLIMETRES_ABOVE_M = 1_000.0  # UWB reaches 500 m at best
_HOUR_S, _DAY_S = 3600.0, 86_400.0
_MOST_HOURS = 14.0  # time zones go from -12 to +14
_NEAR_S = 300.0  # clocks that are a whole hour apart agree otherwise
_SLOW_S = 1.0  # radios answer more often
_GPS_EPOCH_S, _LEAP_SECONDS = 315_964_800.0, 18.0
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


def check_angles(table: Table) -> None:
    """Refuse directions and attitudes that are no angles in degrees; an unknown one is not wrong.

    Raises
    ------
    InputError
        If an angle is outside [-360, 360], or a standard deviation of one is not above 0.
    """
    for name in (*ATTITUDE, *ARRIVAL):
        wrong = np.abs(table[name]) > _FULL_TURN_DEG if name in table else np.False_
        if wrong.any():
            index = int(np.argmax(wrong))
            problem = f"expected degrees between -360 and 360, got {table[name][index]:g}"
            raise table.error(problem, index=index, column=name)
    sigma_deg = table.get("azimuth_sigma_deg")
    if sigma_deg is not None and (sigma_deg <= 0).any():
        index = int(np.argmax(sigma_deg <= 0))
        problem = f"expected a number above 0, got {sigma_deg[index]:g}"
        raise table.error(problem, index=index, column="azimuth_sigma_deg")
    if sigma_deg is not None and "azimuth_deg" not in table:
        raise table.error("needs azimuth_deg beside it", column="azimuth_sigma_deg")


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
    first_s, last_s = trajectory["t_s"][[0, -1]].tolist()
    t_s = ranges["t_s"]
    start_s, end_s = float(t_s.min()), float(t_s.max())
    unit = _time_unit(end_s - start_s, last_s - first_s)
    if unit and (end_s - start_s) / len(np.unique(t_s)) > _SLOW_S:
        problem = (
            f"expected seconds: the ranges span {end_s - start_s:.0f}, the trajectory "
            f"{last_s - first_s:.1f} s; are these {unit}?"
        )
        raise ranges.error(problem, column="t_s")
    if end_s < first_s or start_s > last_s:
        raise InputError(
            f"the times do not overlap: the ranges span {start_s:.3f} to {end_s:.3f} s, "
            f"the trajectory {first_s:.3f} to {last_s:.3f} s"
            f"{gap_hint((start_s, end_s), (first_s, last_s))}",
            source=ranges.path,
            column="t_s",
        )
    extent_m = float(np.hypot(*np.ptp(position_m, axis=0)))
    check_metres(ranges, f" on a path {extent_m:.0f} m wide")


def check_metres(ranges: Table, where: str = "") -> None:
    """Refuse ranges that are not in metres.

    Parameters
    ----------
    ranges
        With ``range_m``.
    where
        What to say of the site.

    Raises
    ------
    InputError
        If half of them are longer than 1,000 m, or one is beyond all reason.
    """
    length_m = np.abs(ranges["range_m"])
    if length_m.max() > _ABSURD_M:
        index = int(np.argmax(length_m))
        problem = f"expected metres, got {ranges['range_m'][index]:g}"
        raise ranges.error(problem, index=index, column="range_m")
    median_m = float(np.median(length_m))
    if median_m > _MILLIMETRES_ABOVE_M:
        problem = (
            f"expected metres, got a median of {median_m:g}{where}: "
            "this looks like millimetres or centimetres"
        )
        raise ranges.error(problem, column="range_m")


def _time_unit(ranges_s: float, trajectory_s: float) -> str:
    """Return the unit of the ranges' times if their span tells that it is another than seconds."""
    for factor, unit in ((1e3, "milliseconds"), (1e6, "microseconds"), (1e9, "nanoseconds")):
        if 0.3 * factor < ranges_s / max(trajectory_s, _LEAST_STEP_S) < 3.0 * factor:
            return unit
    return ""


def gap_hint(ranges_s: tuple[float, float], trajectory_s: tuple[float, float]) -> str:
    """Return what may be the reason why two spans of time do not meet; empty if nothing is known.

    Examples
    --------
    >>> gap_hint((7200.0, 7260.0), (3590.0, 3662.0))
    '; the ranges are 1 h ahead: is utc_offset_h: 1 missing in stamps (gaia.yaml)?'
    """
    apart_s = 0.5 * (sum(ranges_s) - sum(trajectory_s))
    slack_s = 0.5 * (ranges_s[1] - ranges_s[0] + trajectory_s[1] - trajectory_s[0])
    known = (
        (_GPS_EPOCH_S - _LEAP_SECONDS, "count from 1970 and from GPS time's start in 1980"),
        (_GPS_EPOCH_S, "count from 1970 and from 1980"),
    )
    for distance_s, words in known:
        if abs(abs(apart_s) - distance_s) <= slack_s:
            return f"; the two {words}: bring them to one"
    early = min(ranges_s[0], trajectory_s[0])
    if early < _DAY_S * 366 < max(ranges_s[0], trajectory_s[0]):
        return "; one counts from its own start and the other from 1970: bring them to one clock"
    days = round(apart_s / _DAY_S)
    if days and abs(apart_s - days * _DAY_S) <= slack_s:
        way = "ahead" if days > 0 else "behind"
        return f"; the ranges are {counted(abs(days), 'day')} {way}: is a date wrong?"
    hours = round(2.0 * apart_s / _HOUR_S) / 2.0
    near_s = min(slack_s, _NEAR_S)
    if 0 < abs(hours) <= _MOST_HOURS and abs(apart_s - hours * _HOUR_S) <= near_s:
        way = "ahead" if hours > 0 else "behind"
        return (
            f"; the ranges are {abs(hours):g} h {way}: is utc_offset_h: {hours:g} missing in "
            "stamps (gaia.yaml)?"
        )
    if abs(abs(apart_s) - _LEAP_SECONDS) <= min(slack_s, 1.0):
        return "; that may be the 18 leap seconds between GPS time and UTC"
    return ""
