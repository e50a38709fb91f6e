"""Residuals are what the places leave unexplained, heights and biases included."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from factories import SQUARE_M, make_fix, make_reconstruction, make_unlocated
from gaia_uwb.evaluate.residuals import range_residual_m


def test_residual_of_an_exact_range_is_minus_the_bias() -> None:
    reconstruction = make_reconstruction()
    away_m = reconstruction.episode.position_m[:, None] - SQUARE_M
    exact_m = np.where(reconstruction.episode.valid, np.hypot(*away_m.transpose(2, 0, 1)), np.nan)
    episode = replace(reconstruction.episode, range_m=exact_m)
    residual_m = range_residual_m(episode, reconstruction.anchors)
    assert np.array_equal(np.isfinite(residual_m), episode.valid)
    assert residual_m[episode.valid] == pytest.approx(-0.05)


def test_heights_lengthen_what_is_expected() -> None:
    reconstruction = make_reconstruction()
    episode = replace(
        reconstruction.episode,
        tag_up_m=np.full(200, 2.0),
        anchor_up_m=np.array([0.5, np.nan, 0.5, 0.5]),
    )
    level_m = range_residual_m(reconstruction.episode, reconstruction.anchors)
    raised_m = range_residual_m(episode, reconstruction.anchors)
    use = reconstruction.episode.valid[:, 0]
    assert (raised_m[use, 0] < level_m[use, 0]).all()
    nearest = np.argmin(np.hypot(*episode.position_m.T))
    expected_m = level_m[nearest, 0] + 4.0 - np.hypot(4.0, 1.5)
    assert raised_m[nearest, 0] == pytest.approx(expected_m, abs=0.01)
    assert raised_m[:, 1] == pytest.approx(level_m[:, 1])  # unknown height: taken as horizontal


def test_unlocated_anchor_has_none() -> None:
    reconstruction = make_reconstruction(changed={2: make_unlocated("cone-2")})
    residual_m = range_residual_m(reconstruction.episode, reconstruction.anchors)
    assert np.isnan(residual_m[:, 2]).all()
    assert np.isfinite(residual_m[100, [0, 1, 3]]).all()


def test_bias_that_was_not_estimated_counts_as_none() -> None:
    fix = make_fix("cone-0", SQUARE_M[0], range_bias_m=np.nan)
    without = make_reconstruction(changed={0: fix})
    zero = make_reconstruction(changed={0: make_fix("cone-0", SQUARE_M[0], range_bias_m=0.0)})
    first, second = (range_residual_m(r.episode, r.anchors)[:, 0] for r in (without, zero))
    assert np.array_equal(first, second, equal_nan=True)
