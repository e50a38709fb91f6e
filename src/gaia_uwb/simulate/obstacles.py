"""What stands in the way: trucks, people and a barrier that cut lines of sight of a work zone.

Each is a box on the road. A ray crosses a box where it crosses one of the diagonals of its
footprint, and is cut if it is lower there than the box is high.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gaia_uwb._typing import Array, Bool, Float64
from gaia_uwb.simulate.chains import Stream
from gaia_uwb.simulate.layouts import ZonePlan, road_to_local
from gaia_uwb.simulate.settings import PassConfig

_TRUCK_M = (8.0, 2.5, 3.0)  # along the road, across it, up
_PERSON_M = (0.5, 0.5, 1.8)
_MOST_AT_ONCE = 2**20  # pairs of a ray and a diagonal, which bounds the memory
_BARRIER_WIDTH_M = 0.6
_BARRIER_PIECE_M = 20.0  # pieces this short follow a bend
_BARRIER_GAP_M = 0.5  # from the line of cones to the barrier's middle, towards the traffic
_OUTERMOST_M, _INNERMOST_M = 0.5, -2.0  # of an obstacle's flank from the line of cones


@dataclass(frozen=True)
class Obstacles:
    """The diagonals of the obstacles' footprints in the local frame.

    Parameters
    ----------
    start_m, end_m : (K, 2)
        Ends of the diagonals, east and north, in metres.
    up_m : (K,)
        Heights of the obstacles above the road, in metres.
    """

    start_m: Float64[Array, "K 2"]
    end_m: Float64[Array, "K 2"]
    up_m: Float64[Array, "K"]

    def cut(
        self,
        tag_m: Float64[Array, "M P 2"],
        tag_up_m: float,
        anchor_m: Float64[Array, "N 2"],
        anchor_up_m: Float64[Array, "N"],
    ) -> Bool[Array, "N P"]:
        """Tell which lines of sight are cut.

        Parameters
        ----------
        tag_m : (N, P, 2) or (1, P, 2)
            Places of the tag's antenna for each anchor, or for all.
        tag_up_m
            Its height, in metres.
        anchor_m : (N, 2)
            East and north of the anchors, in metres.
        anchor_up_m : (N,)
            Their heights, in metres.
        """
        n, p, k = len(anchor_m), tag_m.shape[1], len(self.up_m)
        if not k:
            return np.zeros((n, p), dtype=np.bool_)
        block = max(1, _MOST_AT_ONCE // (n * k))
        return np.concatenate(
            [
                self._cut(tag_m[:, start : start + block], tag_up_m, anchor_m, anchor_up_m)
                for start in range(0, p, block)
            ],
            axis=1,
        )

    def _cut(
        self,
        tag_m: Float64[Array, "M P 2"],
        tag_up_m: float,
        anchor_m: Float64[Array, "N 2"],
        anchor_up_m: Float64[Array, "N"],
    ) -> Bool[Array, "N P"]:
        side, gap = self.end_m - self.start_m, self.start_m - tag_m[:, :, None]
        ray = (anchor_m[:, None] - tag_m)[:, :, None]  # (N, P, 1, 2)
        cross = ray[..., 0] * side[:, 1] - ray[..., 1] * side[:, 0]  # (N, P, K)
        # How far along the ray, and along the diagonal, the two lines meet; both times cross.
        on_ray = gap[..., 0] * side[:, 1] - gap[..., 1] * side[:, 0]
        on_side = gap[..., 0] * ray[..., 1] - gap[..., 1] * ray[..., 0]
        sign = np.sign(cross)
        size = cross * sign
        on_ray, on_side = on_ray * sign, on_side * sign
        crosses = (on_ray > 0) & (on_ray < size) & (on_side > 0) & (on_side < size)
        rise_m = (anchor_up_m - tag_up_m)[:, None, None]
        below = on_ray * rise_m < (self.up_m - tag_up_m) * size
        return np.asarray((crosses & below).any(axis=-1))


_NOTHING = Obstacles(np.empty((0, 2)), np.empty((0, 2)), np.empty(0))


def place_obstacles(config: PassConfig, plan: ZonePlan, stream: Stream) -> Obstacles:
    """Put trucks and people somewhere in the work space, and the barrier before it.

    Parameters
    ----------
    config
        Settings of the pass.
    plan
        The work zone.
    stream
        Source of randomness.
    """
    closure = config.closure
    if not (closure.n_trucks or closure.n_crew or closure.barrier_up_m):
        return _NOTHING
    rng = stream("obstacles")
    boxes = [(*_TRUCK_M, *rng.random(2)) for _ in range(closure.n_trucks)]
    boxes += [(*_PERSON_M, *rng.random(2)) for _ in range(closure.n_crew)]
    size_m = np.array(boxes).reshape(-1, 5)
    along_m = plan.work_along_m[0] + closure.work_m * size_m[:, 3]
    flank_m = _INNERMOST_M + (_OUTERMOST_M - _INNERMOST_M) * size_m[:, 4]
    open_m = plan.edge_m(along_m) + flank_m - size_m[:, 1] / 2
    length_m, width_m, up_m = size_m[:, 0], size_m[:, 1], size_m[:, 2]
    if closure.barrier_up_m:
        n = max(1, round(closure.work_m / _BARRIER_PIECE_M))
        piece_m = closure.work_m / n
        middle_m = plan.work_along_m[0] + piece_m * (np.arange(n) + 0.5)
        along_m = np.append(along_m, middle_m)
        open_m = np.append(open_m, plan.edge_m(middle_m) + _BARRIER_GAP_M)
        length_m = np.append(length_m, np.full(n, piece_m))
        width_m = np.append(width_m, np.full(n, _BARRIER_WIDTH_M))
        up_m = np.append(up_m, np.full(n, closure.barrier_up_m))
    corner_m = {
        (a, b): road_to_local(config.road, along_m + a * length_m / 2, open_m + b * width_m / 2)
        for a in (-1, 1)
        for b in (-1, 1)
    }
    return Obstacles(
        start_m=np.concatenate([corner_m[-1, -1], corner_m[-1, 1]]),
        end_m=np.concatenate([corner_m[1, 1], corner_m[1, -1]]),
        up_m=np.concatenate([up_m, up_m]),
    )
