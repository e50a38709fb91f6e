"""The best rotation and shift undo a move, and never mirror."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, strategies as st

from gaia_uwb._shared.errors import InputError
from gaia_uwb.evaluate.rigid_alignment import rigid_align
from point_clouds import EAST, NOWHERE, SQUARE, UTM, angles, clouds, moved, quick


class TestRigidAlignment:
    @quick
    @given(clouds(2), angles)
    def test_undoes_a_move(self, points: np.ndarray, angle_rad: float) -> None:
        assume(np.ptp(points, axis=0).max() > 0.1)
        alignment = rigid_align(points + UTM, moved(points, angle_rad))
        np.testing.assert_allclose(alignment.points_m, moved(points, angle_rad), atol=1e-6)
        assert alignment.rotation_rad == pytest.approx(angle_rad, abs=1e-6)
        again = moved(points + UTM, alignment.rotation_rad, alignment.translation_m)
        np.testing.assert_allclose(again, alignment.points_m, atol=1e-6)

    @quick
    @given(clouds(5, 5), clouds(5, 5), st.floats(-1e-2, 1e-2), st.floats(-0.1, 0.1))
    def test_no_other_move_fits_better(
        self, points: np.ndarray, true_m: np.ndarray, turn_rad: float, shift_m: float
    ) -> None:
        best = rigid_align(points, true_m)
        shifted_m = best.translation_m + shift_m * EAST
        other = moved(points, best.rotation_rad + turn_rad, shifted_m)
        best_m2 = ((best.points_m - true_m) ** 2).sum()
        assert best_m2 <= ((other - true_m) ** 2).sum() + 1e-9

    def test_never_mirrors(self) -> None:
        triangle = np.array([[0.0, 0.0], [4.0, 0.0], [0.0, 3.0]])
        aligned = rigid_align(triangle * [1.0, -1.0], triangle).points_m
        assert np.hypot(*(aligned - triangle).T).max() > 1.0

    def test_of_one_place_only_shifts(self) -> None:
        alignment = rigid_align(np.zeros((2, 2)), np.ones((2, 2)))
        assert alignment.rotation_rad == 0.0
        np.testing.assert_array_equal(alignment.points_m, np.ones((2, 2)))

    def test_refuses_nothing_and_what_is_not_finite(self) -> None:
        with pytest.raises(InputError, match="at least one point"):
            rigid_align(np.zeros((0, 2)), np.zeros((0, 2)))
        with pytest.raises(InputError, match=r"true_m: expected shape \(4, 2\), got \(3, 2\)"):
            rigid_align(SQUARE, SQUARE[:3])
        with pytest.raises(InputError, match=r"estimated_m: .*NaN"):
            rigid_align(NOWHERE, np.zeros((1, 2)))
        with pytest.raises(InputError, match=r"true_m: .*NaN"):
            rigid_align(np.zeros((1, 2)), NOWHERE)
