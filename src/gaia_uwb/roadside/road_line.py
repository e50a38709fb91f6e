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

_CHUNK = 1 << 21  # distances worked on at a time


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
        flat_m = place_m.reshape(-1, 2)
        size = max(1, _CHUNK // len(self.vertex_m))
        parts = [self._locate(flat_m[k : k + size]) for k in range(0, len(flat_m), size)]
        return np.concatenate(parts or [flat_m]).reshape(place_m.shape)

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

    def _locate(self, place_m: Float64[Array, "P 2"]) -> Float64[Array, "P 2"]:
        along, left = self._directions()
        length_m = np.diff(self.station_m)
        off_m = place_m[:, None] - self.vertex_m[:-1]  # (P, E, 2)
        at_m = np.einsum("pei,ei->pe", off_m, along)
        low_m, high_m = np.zeros_like(length_m), length_m.copy()
        low_m[0], high_m[-1] = -np.inf, np.inf
        within_m = np.clip(at_m, low_m, high_m)
        beside_m = np.einsum("pei,ei->pe", off_m, left)
        row = np.argmin(beside_m**2 + (at_m - within_m) ** 2, axis=1)
        each = np.arange(len(place_m))
        apart_m = np.hypot(beside_m[each, row], (at_m - within_m)[each, row])
        offset_m = np.copysign(apart_m, beside_m[each, row])
        return np.stack([self.station_m[row] + within_m[each, row], offset_m], axis=1)


@dataclass(frozen=True)
class DrivenPath:
    """One run of a drive along the road line, without turning back.

    Parameters
    ----------
    name
        Name of the pass that it is from.
    along
        1 if it was driven in the direction of the line, -1 against it.
    place_m : (P, 2)
        East and north in the order of the line, in metres; points where the vehicle hardly moved on
        are left out.
    station_m, offset_m : (P,)
        The same on the line, in metres.
    """

    name: str
    along: int
    place_m: Float64[Array, "P 2"]
    station_m: Float64[Array, "P"]
    offset_m: Float64[Array, "P"]
