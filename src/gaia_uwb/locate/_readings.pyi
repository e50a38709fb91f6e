"""The estimator's inner loop, compiled from _readings.c; used by range_model.py only."""

from gaia_uwb._shared.arrays import Array

def average_readings(
    position_m: Array,
    velocity_mps: Array,
    gap_m: Array,
    range_m: Array,
    order: Array,
    after_s: Array,
    first_row: Array,
    first_cell: Array,
    block_cone: Array,
    own: Array,
    errors: Array,
    slow_m: Array,
    variance_m2: Array,
    information: Array,
    mean: Array,
    tallies: Array,
    nearest: Array,
    /,
) -> None: ...
