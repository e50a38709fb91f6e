"""A line along the road: places on it have a station, and an offset from it.

>>> import numpy as np
>>> from gaia_uwb.roadside import RoadLine
>>> line = RoadLine.through(np.array([[0.0, 0.0], [100.0, 0.0]]))
>>> line.locate(np.array([[30.0, 4.0], [120.0, -2.0]])).tolist()
[[30.0, 4.0], [120.0, -2.0]]
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gaia_uwb._shared import Array, Float64


@dataclass(frozen=True)
class RoadLine:
    """A smooth line along the road, in the direction of travel.

    Parameters
    ----------
    vertex_m : (V, 2)
        East and north of its vertices, in metres; at least two.
    station_m : (V,)
        Distance of each from the first one along the line, in metres; increasing.
    """

    vertex_m: Float64[Array, "V 2"]
    station_m: Float64[Array, "V"]

    @classmethod
    def through(cls, vertex_m: Float64[Array, "V 2"]) -> RoadLine:
        """Return the line through vertices, with stations from 0.

        Parameters
        ----------
        vertex_m : (V, 2)
            East and north, in metres, no two in a row in one place.
        """
        step_m = np.hypot(*np.diff(vertex_m, axis=0).T)
        return cls(vertex_m, np.concatenate([[0.0], np.cumsum(step_m)]))

    @property
    def length_m(self) -> float:
        """Length of the line, in metres."""
        return float(self.station_m[-1])

    def locate(self, place_m: Float64[Array, "*shape 2"]) -> Float64[Array, "*shape 2"]:
        """Return station and offset of places.

        Parameters
        ----------
        place_m : (..., 2)
            East and north, in metres.

        Returns
        -------
        (..., 2)
            Station and offset of the nearest place on the line, in metres; offsets are positive to
            the left. Beyond its ends the line goes on straight.
        """
        from shapely import LineString, line_locate_point, points

        station_m = np.asarray(line_locate_point(LineString(self.vertex_m), points(place_m)))
        row = np.clip(
            np.searchsorted(self.station_m, station_m, side="right") - 1, 0, len(self.vertex_m) - 2
        )
        along, left = self._directions()
        off_m = place_m - self.vertex_m[row]
        ahead_m = (off_m * along[row]).sum(axis=-1)
        beside_m = (off_m * left[row]).sum(axis=-1)
        before = (row == 0) & (ahead_m < 0)
        beyond = (row == len(self.vertex_m) - 2) & (station_m >= self.length_m)
        on_end = before | beyond
        # At a vertex the nearest place is the vertex itself, however far aside.
        apart_m = np.hypot(beside_m, ahead_m - (station_m - self.station_m[row]))
        return np.stack(
            [
                np.where(on_end, self.station_m[row] + ahead_m, station_m),
                np.where(on_end, beside_m, np.copysign(apart_m, beside_m)),
            ],
            axis=-1,
        )

    def locate_scenes(self, place_m: Float64[Array, "S M 2"]) -> Float64[Array, "S M 2"]:
        """Return station and offset of many possible places of each cone, as :meth:`locate` does.

        Only the part of the line near a cone is searched for its places.

        Parameters
        ----------
        place_m : (S, M, 2)
            Of M cones in S scenes: east and north, in metres.
        """
        found = np.empty_like(place_m)
        for k in range(place_m.shape[1]):
            near, from_m = self._near(place_m[:, k])
            found[:, k] = near.locate(place_m[:, k])
            found[:, k, 0] += from_m
        return found

    def _near(self, place_m: Float64[Array, "S 2"]) -> tuple[RoadLine, float]:
        """Return the part of the line that holds what is nearest to places, and its station."""
        middle_m = 0.5 * (place_m.min(axis=0) + place_m.max(axis=0))
        reach_m = np.hypot(*(place_m - middle_m).T).max()
        along, _ = self._directions()
        off_m = middle_m - self.vertex_m[:-1]
        ahead_m = np.clip((off_m * along).sum(axis=1), 0.0, np.diff(self.station_m))
        away_m = np.hypot(*(off_m - ahead_m[:, None] * along).T)
        # The segment nearest to a place is at most so far from the middle of all.
        rows = np.flatnonzero(away_m <= away_m.min() + 2.0 * reach_m + 1e-6)
        first, last = max(int(rows[0]) - 1, 0), min(int(rows[-1]) + 2, len(self.vertex_m) - 1)
        part = slice(first, last + 1)
        from_m = float(self.station_m[first])
        return RoadLine(self.vertex_m[part], self.station_m[part] - from_m), from_m

    def place(
        self, station_m: Float64[Array, "*shape"], offset_m: Float64[Array, "*shape"]
    ) -> Float64[Array, "*shape 2"]:
        """Return the places at stations and offsets.

        Parameters
        ----------
        station_m, offset_m : (...)
            In metres; stations may lie beyond the line's ends.

        Returns
        -------
        (..., 2)
            East and north, in metres.
        """
        row = np.searchsorted(self.station_m, station_m, side="right") - 1
        row = np.clip(row, 0, len(self.vertex_m) - 2)
        along, left = self._directions()
        beyond_m = np.asarray(station_m - self.station_m[row])[..., None]
        return np.asarray(
            self.vertex_m[row] + beyond_m * along[row] + np.asarray(offset_m)[..., None] * left[row]
        )

    def _directions(self) -> tuple[Float64[Array, "E 2"], Float64[Array, "E 2"]]:
        step_m = np.diff(self.vertex_m, axis=0)
        along = step_m / np.hypot(*step_m.T)[:, None]
        return along, np.stack([-along[:, 1], along[:, 0]], axis=1)


@dataclass(frozen=True)
class DrivenPath:
    """One run of a drive along the road line, without turning back.

    Parameters
    ----------
    name
        Name of the pass that it is from.
    along
        1 if it was driven in the direction of the line, -1 against it.
    t_s : (P,)
        When, in seconds; decreasing where it was driven against the line.
    place_m : (P, 2)
        East and north in the order of the line, in metres; smoothed.
    station_m, offset_m : (P,)
        The same on the line, in metres; stations increase.
    """

    name: str
    along: int
    t_s: Float64[Array, "P"]
    place_m: Float64[Array, "P 2"]
    station_m: Float64[Array, "P"]
    offset_m: Float64[Array, "P"]

    def offset_at(self, station_m: Float64[Array, "*shape"]) -> Float64[Array, "*shape"]:
        """Return where it ran across the road; NaN where it did not run.

        Parameters
        ----------
        station_m : (...)
            Along the line, in metres.
        """
        offset_m = np.interp(station_m, self.station_m, self.offset_m, left=np.nan, right=np.nan)
        return np.asarray(offset_m)
