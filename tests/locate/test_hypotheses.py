from dataclasses import replace

import numpy as np
import pytest

from gaia_uwb.locate.honest_errors import Curves
from two_places import make_hypotheses


def test_without_a_path_what_is_reported_is_the_linear_covariance() -> None:
    found, _ = make_hypotheses(3)
    linear_m2 = found.covariance_m2[:, 0]
    assert found.honest_covariance(linear_m2, np.zeros(3, dtype=int)) is linear_m2


@pytest.mark.parametrize("side", [[0, 1, 0], [1, 0, 1]])
def test_what_is_reported_follows_the_curves_of_the_chosen_places(side) -> None:
    found, _ = make_hypotheses(3, sigma_m=1.0)
    centre_m = np.array([[0.0, 0.0], [4.0, 0.0], [60.0, 0.0]])
    side, rows = np.array(side), np.arange(3)
    linear_m2 = np.tile(np.diag([0.3, 0.9]), (3, 1, 1))
    honest_m2 = replace(found, centre_m=centre_m).honest_covariance(linear_m2, side)
    curves = Curves.of(
        found.position_m[rows, side],
        found.position_m[rows, 1 - side],
        found.covariance_m2[rows, side],
        centre_m,
    )
    assert np.array_equal(honest_m2, curves.covariance_m2(linear_m2))
    # Right above its stretch of path a place errs along a narrow arc: the bend counts.
    assert np.abs(honest_m2[0] - linear_m2[0]).max() > 0.02
