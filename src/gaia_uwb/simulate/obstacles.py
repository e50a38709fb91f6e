"""What stands in the way: trucks, people and a barrier that cut lines of sight of a work zone.

Each is a box on the road. A ray crosses a box where it crosses one of the diagonals of its
footprint, and is cut if it is lower there than the box is high.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gaia_uwb._shared import Array, Bool, Float64, Int64
from gaia_uwb.simulate.layouts import plan_zone, road_to_local
from gaia_uwb.simulate.rows import PassRows, each
from gaia_uwb.simulate.streams import Stream

_TRUCK_M = (8.0, 2.5, 3.0)  # along the road, across it, up
_PERSON_M = (0.5, 0.5, 1.8)
_MOST_AT_ONCE = 2**20  # pairs of a ray and a diagonal, which bounds the memory
_BARRIER_WIDTH_M = 0.6
_BARRIER_PIECE_M = 20.0  # pieces this short follow a bend
_BARRIER_GAP_M = 0.5  # from the line of cones to the barrier's middle, towards the traffic
_OUTERMOST_M, _INNERMOST_M = 0.5, -2.0  # of an obstacle's flank from the line of cones


@dataclass(frozen=True)
class Obstacles:
    """The diagonals of the obstacles' footprints in the local frame, pass after pass.

    Parameters
    ----------
    start_m, end_m : (K, 2)
        Ends of the diagonals, east and north, in metres.
    up_m : (K,)
        Heights of the obstacles above the road, in metres.
    counts
        How many of the diagonals each pass has.
    """

    start_m: Float64[Array, "K 2"]
    end_m: Float64[Array, "K 2"]
    up_m: Float64[Array, "K"]
    counts: tuple[int, ...]

    def cut(
        self,
        tag_m: Float64[Array, "N P 2"],
        tag_up_m: Float64[Array, "N 1"],
        anchor_m: Float64[Array, "N 2"],
        anchor_up_m: Float64[Array, "N"],
        anchors: Sequence[int],
    ) -> Bool[Array, "N P"]:
        """Tell which lines of sight are cut.

        Parameters
        ----------
        tag_m : (N, P, 2)
            Places of the tag's antenna for each anchor: east and north, in metres.
        tag_up_m : (N, 1)
            Its height, in metres.
        anchor_m : (N, 2)
            East and north of the anchors, pass after pass, in metres.
        anchor_up_m : (N,)
            Their heights, in metres.
        anchors
            How many anchors each pass has.
        """
        cut = np.zeros(tag_m.shape[:2], dtype=np.bool_)
        stop, last = 0, 0
        for n, k in zip(anchors, self.counts, strict=True):
            start, stop, first, last = stop, stop + n, last, last + k
            block = max(1, _MOST_AT_ONCE // max(1, n * k))
            for p in range(0, tag_m.shape[1] if k else 0, block):
                rows, steps = slice(start, stop), slice(p, p + block)
                rise_m = (anchor_up_m[rows, None] - tag_up_m[rows], tag_up_m[rows])
                cut[rows, steps] = self._cut(
                    slice(first, last), tag_m[rows, steps], anchor_m[rows], rise_m
                )
        return cut

    def _cut(
        self,
        own: slice,
        tag_m: Float64[Array, "n p 2"],
        anchor_m: Float64[Array, "n 2"],
        rise_m: tuple[Float64[Array, "n 1"], Float64[Array, "n 1"]],
    ) -> Bool[Array, "n p"]:
        """Tell which lines of sight of one pass its own diagonals cut.

        The lines rise by the first part of ``rise_m`` and start at the second. The arrays' axes are
        diagonal, anchor and place.
        """
        tag_m = np.ascontiguousarray(np.moveaxis(tag_m, -1, 0))  # east, north
        start_m = self.start_m[own].T[:, :, None, None]
        side_m = self.end_m[own].T[:, :, None, None] - start_m
        gap_m = start_m - tag_m[:, None]  # (2, k, n, p)
        ray_m = anchor_m.T[:, :, None] - tag_m  # (2, n, p)
        cross = ray_m[0] * side_m[1] - ray_m[1] * side_m[0]
        # How far along the ray, and along the diagonal, the two lines meet; both times cross.
        on_ray = gap_m[0] * side_m[1] - gap_m[1] * side_m[0]
        on_side = gap_m[0] * ray_m[1] - gap_m[1] * ray_m[0]
        sign = np.sign(cross)
        size = cross * sign
        on_ray, on_side = on_ray * sign, on_side * sign
        crosses = (on_ray > 0) & (on_ray < size) & (on_side > 0) & (on_side < size)
        below = on_ray * rise_m[0] < (self.up_m[own, None, None] - rise_m[1]) * size
        return np.asarray((crosses & below).any(axis=0))


def place_obstacles(config: PassRows, streams: Sequence[Stream]) -> Obstacles:
    """Put trucks and people somewhere in the work space, and the barrier before it.

    Parameters
    ----------
    config
        Settings of the passes.
    streams
        Their sources of randomness.
    """
    closure, passes = config.closure, len(streams)
    trucks, crew = each(closure.n_trucks, passes), each(closure.n_crew, passes)
    pieces = np.rint(each(closure.work_m, passes) / _BARRIER_PIECE_M).astype(np.int64)
    pieces = np.where(each(closure.barrier_up_m, passes) > 0, np.maximum(pieces, 1), 0)
    counts = trucks + crew + pieces
    if not counts.any():
        return Obstacles(np.empty((0, 2)), np.empty((0, 2)), np.empty(0), (0,) * passes)
    # One row for each box: first the trucks of a pass, then its people, then the barrier's pieces.
    owner = np.repeat(np.arange(passes), counts)
    number = np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)
    draw = np.zeros((len(owner), 2))
    for k in np.flatnonzero(trucks + crew).tolist():
        rng = streams[k]("obstacles")
        mobile = np.flatnonzero(owner == k)[: trucks[k] + crew[k]]
        draw[mobile] = rng.random((len(mobile), 2))
    rows = config.at(owner)
    along_m, open_m, size_m = _boxes(rows, number, trucks[owner], (trucks + crew)[owner], draw)
    corner_m = {
        (a, b): road_to_local(
            rows.road, along_m + a * size_m[:, :1] / 2, open_m + b * size_m[:, 1:2] / 2
        )[:, 0]
        for a in (-1, 1)
        for b in (-1, 1)
    }
    order = np.argsort(np.tile(owner, 2), kind="stable")
    return Obstacles(
        start_m=np.concatenate([corner_m[-1, -1], corner_m[-1, 1]])[order],
        end_m=np.concatenate([corner_m[1, 1], corner_m[1, -1]])[order],
        up_m=np.tile(size_m[:, 2], 2)[order],
        counts=tuple((2 * counts).tolist()),
    )


def _boxes(
    config: PassRows,
    number: Int64[Array, "K"],
    trucks: Int64[Array, "K"],
    mobile: Int64[Array, "K"],
    draw: Float64[Array, "K 2"],
) -> tuple[Float64[Array, "K 1"], Float64[Array, "K 1"], Float64[Array, "K 3"]]:
    """Return the boxes' middles in road coordinates, and their sizes along, across and up.

    A box is a truck if its number in its pass is below ``trucks``, a person if it is below
    ``mobile``, else a piece of the barrier.
    """
    closure, plan = config.closure, plan_zone(config)
    work_from_m, work_m = plan.work_along_m[..., 0], closure.work_m
    is_piece = (number >= mobile)[:, None]
    size_m = np.where((number < trucks)[:, None], _TRUCK_M, _PERSON_M)
    pieces = np.maximum(np.rint(work_m / _BARRIER_PIECE_M), 1)
    piece_m = work_m / pieces
    barrier_m = np.broadcast_arrays(
        piece_m, _BARRIER_WIDTH_M, closure.barrier_up_m, number[:, None]
    )
    size_m = np.where(is_piece, np.concatenate(barrier_m[:3], axis=1), size_m)
    piece = (number - mobile)[:, None] + 0.5
    along_m = work_from_m + np.where(is_piece, piece_m * piece, work_m * draw[:, :1])
    flank_m = _INNERMOST_M + (_OUTERMOST_M - _INNERMOST_M) * draw[:, 1:]
    flank_m = np.where(is_piece, _BARRIER_GAP_M, flank_m)
    half_m = np.where(is_piece, 0.0, size_m[:, 1:2] / 2)
    return along_m, plan.edge_m(along_m) + flank_m - half_m, size_m
