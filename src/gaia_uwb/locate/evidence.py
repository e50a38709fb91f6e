"""The readings of all drives past one zone as the estimator sees them: flat, in cells of place.

Neighbouring readings err alike, because what makes them err (walls, antennas, the body of the
vehicle) belongs to where the vehicle is. So the readings of one cone in one drive are gathered in
cells: readings taken close to each other, compared with the cone's distance, and in about the same
direction of travel. A cell's readings share one slow error and have white noise on top of it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np

from gaia_uwb._shared import Array, Bool, Float64, Int64
from gaia_uwb.episode import RangeReadings

MOST_CELLS = 64
"""Cells of one cone in one drive; where the path is longer, they are larger."""
_MOST_READINGS = 1500  # of one cone in one drive; the slow errors bound what more could add
_CELL = 0.2  # size of a cell as a share of the cone's distance
_NEAREST_M = 0.75  # nearer cones have cells as if at this distance
_LARGEST_M = 1.0  # and as the shortest of slow errors
_GROWTH = 1.3  # of cells, until there are few enough
VELOCITY_OVER_S = 0.5
"""Time between the positions from which a velocity is taken."""
PARKED_MPS = 0.2  # below this the direction of travel is unknown
_CHUNK_ROWS = 400_000  # readings worked on at a time
Rows: TypeAlias = Array | slice


@dataclass(frozen=True)
class Motion:
    """Where the tag was at the times of some readings, and how it moved.

    Parameters
    ----------
    position_m, velocity_mps : (R, 2)
        East and north.
    gap_m : (R,)
        Height of the tag's antenna above the cone's; 0 where unknown.
    """

    position_m: Float64[Array, "R 2"]
    velocity_mps: Float64[Array, "R 2"]
    gap_m: Float64[Array, "R"]

    @property
    def moving(self) -> Bool[Array, "R"]:
        """Whether the direction of travel is known."""
        return np.asarray(np.hypot(*self.velocity_mps.T) > PARKED_MPS)

    def course_rad(self) -> Float64[Array, "R"]:
        """Return the direction of travel, counter-clockwise from east."""
        return np.asarray(np.arctan2(self.velocity_mps[:, 1], self.velocity_mps[:, 0]))

    def across(self) -> Float64[Array, "R 2"]:
        """Return the unit vector to the left of the path; 0 where the tag stands."""
        course_rad = self.course_rad()
        left = np.stack([-np.sin(course_rad), np.cos(course_rad)], axis=1)
        return np.asarray(self.moving[:, None] * left)


@dataclass(frozen=True)
class Evidence:
    """The readings of a group of n cones, sorted by block (cone and drive) and cell.

    Parameters
    ----------
    cones : (n,)
        Indices of the cones among all.
    drives
        The readings and paths of all drives.
    t_s, range_m : (R,)
        Time in the path's clock, and measured range.
    cone, drive, cell : (R,)
        Which of the n cones, which drive, and which of the group's C cells.
    up_m : (R,)
        Height of the cone; NaN where unknown.
    block_cone, block_drive : (B,)
        Cone (of the n) and drive of each block.
    cell_block : (C,)
        Block of each cell.
    """

    cones: Int64[Array, "n"]
    drives: Sequence[RangeReadings]
    t_s: Float64[Array, "R"]
    range_m: Float64[Array, "R"]
    up_m: Float64[Array, "R"]
    cone: Int64[Array, "R"]
    drive: Int64[Array, "R"]
    cell: Int64[Array, "R"]
    block_cone: Int64[Array, "B"]
    block_drive: Int64[Array, "B"]
    cell_block: Int64[Array, "C"]

    def nearest(self, distance_m: Float64[Array, "R"]) -> Int64[Array, "c"]:
        """Return which reading of each cone that has any was taken nearest to it.

        Parameters
        ----------
        distance_m : (R,)
            From the tag to the cone, or to where it may stand.
        """
        first = np.flatnonzero(np.diff(self.cone, prepend=-1))
        least_m = np.minimum.reduceat(distance_m, first) if len(first) else distance_m
        count = np.diff(np.append(first, len(self.cone)))
        found = np.flatnonzero(distance_m <= np.repeat(least_m, count))
        return found[np.diff(self.cone[found], prepend=-1) > 0]

    def motion(self, offset_s: Float64[Array, "D"]) -> Motion:
        """Return where the tag was at the readings' times, given the drives' clock offsets.

        Parameters
        ----------
        offset_s : (D,)
            A reading stamped t belongs to the path at ``t - offset_s``.
        """
        return _motion(self.drives, self._rows, self.t_s, self.up_m, offset_s)

    @cached_property
    def _rows(self) -> list[tuple[int, Rows]]:
        order = np.argsort(self.t_s, kind="stable")  # places in the order of time are found faster
        return [(drive, order[rows]) for drive, rows in _rows_by_drive(self.drive[order])]


@dataclass(frozen=True)
class Heard:
    """What one drive heard of the cones of its zone.

    Parameters
    ----------
    readings
        The readings and the path.
    cone : (n,)
        Index among all cones of each anchor of the drive.
    up_m : (n,)
        Height of each in the drive's log; NaN where unknown.
    """

    readings: RangeReadings
    cone: Int64[Array, "n"]
    up_m: Float64[Array, "n"]


def gather(
    heard: Sequence[Heard],
    n_cones: int,
    offset_s: Float64[Array, "D"],
    min_ranges: int = 1,
) -> Iterator[Evidence]:
    """Yield the evidence of all cones, as many of them at a time as memory allows.

    Parameters
    ----------
    heard
        What each drive heard.
    n_cones
        Number of all cones.
    offset_s : (D,)
        The clock offsets under which cells are laid out.
    min_ranges
        Cones with fewer readings say nothing, and theirs are left out.
    """
    drives = [each.readings for each in heard]
    kept = [_thinned(each.anchor) for each in drives]
    own = [each.readings.anchor[rows] for each, rows in zip(heard, kept, strict=True)]
    cone = np.concatenate([each.cone[a] for each, a in zip(heard, own, strict=True)])
    drive = np.repeat(np.arange(len(heard)), [len(rows) for rows in kept])
    columns = {
        name: np.concatenate([getattr(d, name)[rows] for d, rows in zip(drives, kept, strict=True)])
        for name in ("t_s", "range_m")
    }
    columns["up_m"] = np.concatenate([each.up_m[a] for each, a in zip(heard, own, strict=True)])
    order = np.lexsort((drive, cone))
    enough = np.bincount(cone, minlength=n_cones) >= min_ranges
    order = order[enough[cone[order]]]
    stop = np.searchsorted(cone[order], np.arange(n_cones), side="right")
    first = 0
    while first < n_cones:
        start = int(stop[first - 1]) if first else 0
        last = max(first + 1, int(np.searchsorted(stop, start + _CHUNK_ROWS, side="right")))
        rows = order[start : stop[last - 1]]
        part = {name: values[rows] for name, values in columns.items()}
        cones = np.arange(first, last)
        yield _in_cells(cones, drives, cone[rows] - first, drive[rows], part, offset_s)
        first = last


def _thinned(anchor: Int64[Array, "R"]) -> Int64[Array, "r"]:
    """Return evenly chosen readings of each cone, at most so many."""
    order = np.argsort(anchor, kind="stable")
    count = np.bincount(anchor)
    own = anchor[order]
    number = np.arange(len(order)) - (np.cumsum(count) - count)[own]
    total = np.maximum(count[own], 1)
    kept = np.minimum(total, _MOST_READINGS)
    # Number i is kept where i * kept / total passes an integer.
    keep = (number * kept) // total != ((number - 1) * kept) // total
    return np.sort(order[keep])


def _in_cells(
    cones: Int64[Array, "n"],
    drives: Sequence[RangeReadings],
    cone: Int64[Array, "R"],
    drive: Int64[Array, "R"],
    columns: Mapping[str, Float64[Array, "R"]],
    offset_s: Float64[Array, "D"],
) -> Evidence:
    """Gather the readings of some cones in cells."""
    motion = _motion(drives, _rows_by_drive(drive), columns["t_s"], columns["up_m"], offset_s)
    code, block = np.unique(cone * len(drives) + drive, return_inverse=True)
    growth = np.ones(len(code))
    octave = np.floor(np.log2(np.maximum(columns["range_m"], _NEAREST_M)))
    speed_mps = np.hypot(motion.velocity_mps[:, 0], motion.velocity_mps[:, 1])
    course = np.arctan2(motion.velocity_mps[:, 1], motion.velocity_mps[:, 0])
    quarter = np.floor(course / (np.pi / 2) + 0.5) % 4
    quarter = np.where(speed_mps > PARKED_MPS, quarter, 4)
    alike = _combined(_combined(block, quarter), octave)
    while True:
        size_m = growth[block] * np.minimum(_CELL * 2.0**octave, _LARGEST_M)
        east, north = np.floor(motion.position_m / size_m[:, None]).T
        tile = _combined(east, north)
        order = np.lexsort((tile, alike))
        new = np.ones(len(order), dtype=np.bool_)
        new[1:] = (np.diff(alike[order]) != 0.0) | (np.diff(tile[order]) != 0.0)
        cell_block = block[order[new]]
        too_many = np.bincount(cell_block, minlength=len(code)) > MOST_CELLS
        if not too_many.any():
            break
        growth[too_many] *= _GROWTH
    return Evidence(
        cones=cones,
        drives=drives,
        t_s=columns["t_s"][order],
        range_m=columns["range_m"][order],
        up_m=columns["up_m"][order],
        cone=cone[order],
        drive=drive[order],
        cell=np.cumsum(new) - 1,
        block_cone=code // len(drives),
        block_drive=code % len(drives),
        cell_block=cell_block,
    )


def _combined(first: Array, second: Array) -> Float64[Array, "R"]:
    """Return a number for each pair of whole numbers, in the order of the pairs."""
    least, most = second.min(initial=0.0), second.max(initial=0.0)
    return np.asarray(first * (most - least + 1.0) + (second - least))


def _rows_by_drive(drive: Int64[Array, "R"]) -> list[tuple[int, Rows]]:
    """Return each drive with its readings."""
    if len(drive) and (drive == drive[0]).all():
        return [(int(drive[0]), slice(None))]
    order = np.argsort(drive, kind="stable")
    parts = np.split(order, np.flatnonzero(np.diff(drive[order])) + 1)
    return [(int(drive[rows[0]]), rows) for rows in parts if len(rows)]


def _motion(
    drives: Sequence[RangeReadings],
    rows_by_drive: Sequence[tuple[int, Rows]],
    t_s: Float64[Array, "R"],
    up_m: Float64[Array, "R"],
    offset_s: Float64[Array, "D"],
) -> Motion:
    # East and north as one complex number, which is put in its place faster than two.
    position, velocity = np.empty((2, len(t_s)), dtype=np.complex128)
    gap_m = np.zeros(len(t_s))
    half_s = VELOCITY_OVER_S / 2
    for k, rows in rows_by_drive:
        path = drives[k].trajectory
        at_s = t_s[rows] - offset_s[k]
        here_m, ahead_m, behind_m = (
            drives[k].position_at(at_s + by_s).view(np.complex128)[:, 0]
            for by_s in (0.0, half_s, -half_s)
        )
        position[rows] = here_m
        velocity[rows] = (ahead_m - behind_m) / VELOCITY_OVER_S
        if path.up_m is not None:
            tag_m = np.interp(at_s, path.t_s, path.up_m)
            gap_m[rows] = np.nan_to_num(tag_m - up_m[rows], nan=0.0)
    position_m, velocity_mps = (x.view(np.float64).reshape(-1, 2) for x in (position, velocity))
    return Motion(position_m, velocity_mps, gap_m)
