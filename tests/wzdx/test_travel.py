"""The order of travel, on drives that turn, repeat and stop."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, strategies as st

from gaia_uwb.wzdx.travel import passed_at, stretch, thinned

CONES_M = np.array([[10.0, 5.0], [40.0, -5.0], [25.0, 5.0]])


def drive(*corners_m: tuple[float, float], wobble_m: float = 0.0) -> np.ndarray:
    """Return a path through these corners, sampled every half metre or so."""
    corners = np.array(corners_m, dtype=np.float64)
    legs = []
    for start, end in pairwise(corners):
        n = max(2, int(np.hypot(*(end - start)) * 2))
        legs.append(start + np.linspace(0.0, 1.0, n)[:, None] * (end - start))
    path_m = np.concatenate(legs)
    return np.asarray(path_m + wobble_m * np.random.default_rng(3).standard_normal(path_m.shape))


def test_along_a_straight_road() -> None:
    assert passed_at(drive((0, 0), (60, 0)), CONES_M) == pytest.approx([10, 40, 25], abs=1e-9)


@pytest.mark.parametrize("wobble_m", [0.0, 0.02])
def test_there_and_back_is_the_way_there(wobble_m: float) -> None:
    path_m = drive((-20, 0), (60, 0), (60, 3), (-20, 3), wobble_m=wobble_m)
    assert np.argsort(passed_at(path_m, CONES_M)).tolist() == [0, 2, 1]


def test_cones_on_both_sides_of_two_passes_stay_in_one_pass() -> None:
    # The cones on the left are nearer on the way back; the order still is one of travel.
    path_m = drive((-20, 0), (60, 0), (60, 4), (-20, 4))
    at_m = passed_at(path_m, CONES_M)
    assert np.ptp(at_m) == pytest.approx(30.0, abs=0.1)


def test_of_two_passes_the_nearer_one_counts() -> None:
    cones_m = np.array([[10.0, 8.0], [40.0, 8.0]])
    path_m = drive((-20, 0), (60, 0), (60, 4), (-20, 4))
    assert np.argsort(passed_at(path_m, cones_m)).tolist() == [1, 0]


def test_around_a_corner() -> None:
    path_m = drive((0, 0), (50, 0), (50, 50))
    at_m = passed_at(path_m, np.array([[45.0, 30.0], [30.0, -4.0], [54.0, 10.0]]))
    assert at_m == pytest.approx([80, 30, 60], abs=1e-6)


def test_cones_before_the_start_and_after_the_end_are_at_the_ends() -> None:
    at_m = passed_at(drive((0, 0), (60, 0)), np.array([[-9.0, 2.0], [30.0, 2.0], [70.0, 2.0]]))
    assert at_m == pytest.approx([0, 30, 60], abs=1e-9)


def test_a_stop_changes_nothing() -> None:
    stopped = drive((0, 0), (25, 0), (25, 0), (60, 0))
    at_m = passed_at(stopped, CONES_M)
    assert at_m == pytest.approx([10, 40, 25], abs=1e-9)
    assert stretch(stopped, 10.0, 40.0) == pytest.approx(np.array([[10.0, 0.0], [40.0, 0.0]]))


def test_jitter_at_a_stop_is_no_passing() -> None:
    standing_m = [25.0, 0.0] + 0.3 * np.random.default_rng(1).standard_normal((500, 2))
    path_m = thinned(np.concatenate([drive((0, 0), (25, 0)), standing_m, drive((25, 0), (60, 0))]))
    at_m = passed_at(path_m, CONES_M)
    assert np.argsort(at_m).tolist() == [0, 2, 1]
    line_m = stretch(path_m, at_m.min(), at_m.max())
    assert line_m[[0, -1]] == pytest.approx(np.array([[10.0, 0.0], [40.0, 0.0]]), abs=1e-6)


def test_thinning_keeps_the_ends() -> None:
    path_m = drive((0, 0), (60, 0))
    assert thinned(path_m) == pytest.approx(path_m)
    standing_m = np.zeros((5, 2))
    assert thinned(standing_m) == pytest.approx(standing_m[:2])


@given(st.floats(0, 30), st.floats(0, 30))
def test_stretch_follows_the_path(a: float, b: float) -> None:
    path_m = drive((0, 0), (15, 0), (15, 15))
    line_m = stretch(path_m, min(a, b), max(a, b))
    length_m = np.hypot(*np.diff(line_m, axis=0).T).sum() if len(line_m) > 1 else 0.0
    assert length_m == pytest.approx(abs(a - b), abs=0.06)
