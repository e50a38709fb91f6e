"""Inverses of many small covariances, compiled from _covariances.c; used by slow_errors.py only."""

from gaia_uwb._shared.arrays import Array

def invert(matrices: Array, log_determinants: Array, size: int, /) -> None: ...
