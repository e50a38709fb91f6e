"""The inner loop of short tours, compiled from _tour.c; used by tour.py only."""

from gaia_uwb._shared.arrays import Array

def short_tour(points_m: Array, gap: Array, tour: Array, started: int, /) -> None: ...
