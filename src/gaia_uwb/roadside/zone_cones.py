"""The cones of one zone on the road: by estimate, and in every possible scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gaia_uwb._shared import Array, Bool, Float64, Int64
from gaia_uwb.roadside.forms import facing, has_two_rows
from gaia_uwb.roadside.road_boundary import RoadSide, ZoneEnd, ZoneForm
from gaia_uwb.roadside.road_line import DrivenPath

PROBABILITY = 0.9
"""Of all bands, bounds and regions."""

_GRID_M, _MOST_STATIONS = 2.0, 120  # between stations at which edges are told


@dataclass(frozen=True)
class ZoneCones:
    """The cones of one zone, in the order of the road.

    Parameters
    ----------
    ids : tuple of M str
        Of the cones.
    place_m : (M, 2)
        Estimated places: east and north, in metres.
    station_m, offset_m : (M,)
        The same on the road, in metres; stations do not decrease.
    scene_station_m, scene_offset_m : (S, M)
        In S equally likely scenes, in metres.
    """

    ids: tuple[str, ...]
    place_m: Float64[Array, "M 2"]
    station_m: Float64[Array, "M"]
    offset_m: Float64[Array, "M"]
    scene_station_m: Float64[Array, "S M"]
    scene_offset_m: Float64[Array, "S M"]

    def end(self, row: int) -> ZoneEnd:
        """Return a cone as an end of something.

        Parameters
        ----------
        row
            Of the cone.
        """
        off_m = np.abs(self.scene_station_m[:, row] - self.station_m[row])
        within_m = float(np.quantile(off_m, PROBABILITY))
        return ZoneEnd(self.ids[row], float(self.station_m[row]), self.place_m[row], within_m)

    def zone_end(self, *, first: bool) -> ZoneEnd:
        """Return the first or the last cone; in a scene another one may be the first.

        Parameters
        ----------
        first
            Which of both.
        """
        row = 0 if first else len(self.ids) - 1
        extreme_m = (np.min if first else np.max)(self.scene_station_m, axis=1)
        within_m = float(np.quantile(np.abs(extreme_m - self.station_m[row]), PROBABILITY))
        return ZoneEnd(self.ids[row], float(self.station_m[row]), self.place_m[row], within_m)


@dataclass(frozen=True)
class SideCones:
    """The cones on one side of the road that make an edge, or the far side of a closed area.

    Parameters
    ----------
    cones
        Of the zone.
    side
        Of the driven path.
    rows : (K,)
        The cones on this side, in the order of the road.
    scene_rows : (M,)
        Which cones belong to it in the scenes in which they stand on this side.
    """

    cones: ZoneCones
    side: RoadSide
    rows: Int64[Array, "K"]
    scene_rows: Bool[Array, "M"]

    @cached_property
    def grid_m(self) -> Float64[Array, "G"]:
        """The stations at which lines through these cones are told, in metres."""
        station_m = self.cones.station_m[self.rows]
        n = int(np.clip(np.ptp(station_m) / _GRID_M, 1, _MOST_STATIONS))
        return np.union1d(station_m, np.linspace(station_m[0], station_m[-1], n + 1))

    def line_m(self, grid_m: Float64[Array, "G"]) -> Float64[Array, "G"]:
        """Return the offsets of the line through the estimated places; level beyond its ends.

        Parameters
        ----------
        grid_m : (G,)
            Stations, in metres.
        """
        at_m, offset_m = self.cones.station_m[self.rows], self.cones.offset_m[self.rows]
        return np.asarray(np.interp(grid_m, at_m, offset_m))

    def counted(self, offset_m: Float64[Array, "S M"]) -> Bool[Array, "S M"]:
        """Return which cones make the line in each scene.

        Parameters
        ----------
        offset_m : (S, M)
            Of all cones of the zone, in metres.
        """
        return np.asarray(self.scene_rows & self.side.holds(offset_m))

    def scene_lines_m(self, grid_m: Float64[Array, "G"]) -> Float64[Array, "S G"]:
        """Return the offsets of the line in every scene; NaN in a scene without any of its cones.

        Parameters
        ----------
        grid_m : (G,)
            Stations, in metres.
        """
        station_m, offset_m = self.cones.scene_station_m, self.cones.scene_offset_m
        return lines_through(station_m, offset_m, self.counted(offset_m), grid_m)


def lines_through(
    station_m: Float64[Array, "S M"],
    offset_m: Float64[Array, "S M"],
    counted: Bool[Array, "S M"],
    grid_m: Float64[Array, "G"],
) -> Float64[Array, "S G"]:
    """Return the offsets of lines through cones, level beyond their ends; NaN without any cone.

    Parameters
    ----------
    station_m, offset_m : (S, M)
        Of all cones in S scenes, in metres.
    counted : (S, M)
        Through which of them each line goes, in the order of the road.
    grid_m : (G,)
        Stations, in metres.
    """
    order = np.argsort(station_m, axis=1, kind="stable")
    station_m, offset_m, counted = (
        np.take_along_axis(each, order, axis=1) for each in (station_m, offset_m, counted)
    )
    lines_m = np.full((len(station_m), len(grid_m)), np.nan)
    for k, row in enumerate(counted):
        if row.any():
            lines_m[k] = np.interp(grid_m, station_m[k, row], offset_m[k, row])
    return lines_m


@dataclass(frozen=True)
class Rows:
    """The cones of a zone on one side: those that face traffic, and those behind them.

    Parameters
    ----------
    near
        The edge.
    behind : (M,)
        Which of the zone's cones stand behind it.
    """

    near: SideCones
    behind: Bool[Array, "M"]


def rows_of(cones: ZoneCones, form: ZoneForm) -> tuple[Rows, ...]:
    """Return the rows on each side of the path that the form has.

    Parameters
    ----------
    cones
        Of the zone.
    form
        With all forms but ``lane-between``, only the side with most cones has rows.
    """
    is_left = RoadSide.LEFT.holds(cones.offset_m)
    sides = [RoadSide.LEFT, RoadSide.RIGHT] if 2 * is_left.sum() >= len(is_left) else [
        RoadSide.RIGHT, RoadSide.LEFT
    ]  # fmt: skip
    if form is not ZoneForm.LANE_BETWEEN:
        sides = sides[:1]
    return tuple(
        _rows(cones, side, form)
        for side in sides
        if (is_left if side is RoadSide.LEFT else ~is_left).any()
    )


def _rows(cones: ZoneCones, side: RoadSide, form: ZoneForm) -> Rows:
    rows = np.flatnonzero(side.holds(cones.offset_m))
    station_m, distance_m = cones.station_m[rows], np.abs(cones.offset_m[rows])
    is_near = np.ones(len(rows), dtype=np.bool_)
    if form in (ZoneForm.WORKS_BETWEEN, ZoneForm.AREA) or (
        form is ZoneForm.LANE_BETWEEN and has_two_rows(station_m, distance_m)
    ):
        is_near = facing(station_m, distance_m)
    behind = np.zeros(len(cones.ids), dtype=np.bool_)
    behind[rows[~is_near]] = True
    return Rows(SideCones(cones, side, rows[is_near], ~behind), behind)


def least_beside_m(
    paths: Sequence[DrivenPath],
    station_m: Float64[Array, "*shape"],
    offset_m: Float64[Array, "*shape"],
) -> Float64[Array, "*shape"]:
    """Return how far beside the nearest driven path places are, in metres.

    Parameters
    ----------
    paths
        All runs on this road.
    station_m, offset_m : (...)
        On the road, in metres.
    """
    nearest_m = np.abs(offset_m)  # the line is one of the paths, and goes on beyond its ends
    for path in paths:
        nearest_m = np.fmin(nearest_m, np.abs(offset_m - path.offset_at(station_m)))
    return np.asarray(nearest_m)
