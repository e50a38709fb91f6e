"""The solver's inner loop, compiled from _solver.c; used by multilateration.py only."""

from gaia_uwb._shared.arrays import Array

WIDTH: int

def solve(
    position: Array,
    tag_up: Array,
    range_m: Array,
    sigma: Array,
    anchor_up: Array,
    bias_sigma: Array,
    out: Array,
    episodes: int,
    anchors: int,
    steps: int,
    dof: float,
    scale_floor: float,
    fixed_scale: float,
    tolerance: float,
    max_iterations: int,
    max_lag: int,
    min_ranges: int,
    /,
) -> None: ...
