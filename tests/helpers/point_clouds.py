"""Points of the plane for tests of geometry: random clouds, small grids, and the same far away."""

from __future__ import annotations

import numpy as np
from hypothesis import settings, strategies as st
from hypothesis.extra.numpy import arrays

from gaia_uwb.evaluate.rigid_alignment import rotation_matrix

SQUARE = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]])


UTM = np.array([691_000.0, 5_334_000.0])


EAST = np.array([1.0, 0.0])


NOWHERE = np.full((1, 2), np.nan)


quick = settings(max_examples=40, deadline=None)


angles = st.floats(-3.0, 3.0)


def clouds(least: int = 3, most: int = 12) -> st.SearchStrategy[np.ndarray]:
    """Points of a work zone: on a centimetre grid, so that ties and lines do occur."""
    return arrays(
        np.int64, st.tuples(st.integers(least, most), st.just(2)), elements=st.integers(-999, 999)
    ).map(lambda grid: grid / 100.0)


def small_grids(most: int = 9) -> st.SearchStrategy[np.ndarray]:
    """Points on a 5 x 5 grid: full of duplicates, lines and touching edges."""
    return arrays(
        np.int64, st.tuples(st.integers(1, most), st.just(2)), elements=st.integers(0, 4)
    ).map(lambda grid: grid.astype(float))


def moved(points: np.ndarray, angle_rad: float, shift: np.ndarray = UTM) -> np.ndarray:
    return points @ rotation_matrix(angle_rad).T + shift
