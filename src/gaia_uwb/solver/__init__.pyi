from .batch import (
    Chunk as Chunk,
    at_side as at_side,
    better_side as better_side,
    chunks as chunks,
    correlation_lag as correlation_lag,
    normal_sums as normal_sums,
    velocity as velocity,
    with_prior as with_prior,
)
from .multilateration import (
    Solutions as Solutions,
    SolverOptions as SolverOptions,
    fisher_share as fisher_share,
    solve as solve,
)
