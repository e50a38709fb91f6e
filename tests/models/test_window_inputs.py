from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, strategies as st

from gaia_uwb._shared.errors import InputError
from gaia_uwb.models.domain import Normalisation
from gaia_uwb.models.window_inputs import blend, make_window_inputs, window_starts, window_targets
from tiny_models import make_run

NORMALISATION = Normalisation(origin_east_m=3.0, origin_north_m=-4.0, scale_m=12.5)


def test_features_turn_back_into_the_episode() -> None:
    run = make_run(0, n_steps=20, missing=0.3)
    features = make_window_inputs([run], 5, NORMALISATION)
    assert [part.dtype for part in features] == [np.float32] * 4
    np.testing.assert_allclose(features.position[0] * 12.5 + [3.0, -4.0], run.position_m, atol=1e-5)
    valid = features.mask[0, :, :3] == 1
    np.testing.assert_array_equal(valid, run.valid)
    np.testing.assert_allclose(
        features.distance[0, :, :3][valid] * 12.5, run.range_m[run.valid], atol=1e-5
    )
    np.testing.assert_allclose(features.height_gap[0, :, :3] * 12.5, 1.0, atol=1e-6)


def test_missing_ranges_and_channels_without_an_anchor_are_zero() -> None:
    runs = [make_run(0, n_anchors=2, missing=0.4), make_run(1, n_anchors=4, missing=0.4)]
    features = make_window_inputs(runs, 5, NORMALISATION)
    assert (features.distance[features.mask == 0] == 0).all()
    assert (features.distance[features.mask == 1] > 0).all()
    for values in (features.mask, features.distance, features.height_gap):
        assert not values[0, :, 2:].any()
        assert not values[1, :, 4:].any()


def test_unknown_heights_are_level() -> None:
    run = make_run(0)
    unknown = replace(run, anchor_up_m=np.array([1.0, np.nan, 0.5]))
    gap = make_window_inputs([unknown], 3, NORMALISATION).height_gap[0, 0] * 12.5
    np.testing.assert_allclose(gap, [1.0, 0.0, 1.5], atol=1e-6)
    assert not make_window_inputs([replace(run, tag_up_m=None)], 3, NORMALISATION).height_gap.any()


def test_targets_are_the_truth_in_the_networks_channels() -> None:
    run = make_run(2)
    targets = window_targets([run], 4, NORMALISATION)
    assert run.truth is not None
    np.testing.assert_allclose(targets.range_m[0, :, :3], run.truth.range_m, atol=1e-5)
    np.testing.assert_array_equal(targets.nlos[0, :, :3], run.truth.nlos)
    np.testing.assert_allclose(
        targets.anchor[0, :3] * 12.5 + [3.0, -4.0], run.truth.anchor_m, atol=1e-5
    )
    assert not any(part[:, ..., 3:].any() for part in (targets.range_m, targets.nlos))


def test_what_a_network_cannot_take_is_refused_in_one_line() -> None:
    with pytest.raises(InputError) as caught:
        make_window_inputs([make_run(7)], 2, NORMALISATION)
    assert str(caught.value) == "run-7: the model has channels for 2 cones, this log has 3"
    with pytest.raises(InputError, match=r"run-7: expected true ranges to train on, got none"):
        window_targets([make_run(7).without_truth()], 3, NORMALISATION)


@given(n_steps=st.integers(1, 400), length=st.integers(1, 80))
def test_windows_cover_all_steps_and_overlap(n_steps: int, length: int) -> None:
    starts = window_starts(n_steps, length)
    size = min(length, n_steps)
    assert starts[0] == 0
    assert starts[-1] + size == n_steps
    gaps = np.diff(starts)
    assert (gaps >= 1).all()
    assert (gaps <= max(1, length // 2)).all()


@given(n_steps=st.integers(1, 150), length=st.integers(1, 40), seed=st.integers(0, 9))
def test_a_series_cut_into_windows_blends_back_into_itself(
    n_steps: int, length: int, seed: int
) -> None:
    series = np.random.default_rng(seed).normal(size=(n_steps, 2))
    starts, size = window_starts(n_steps, length), min(length, n_steps)
    windows = np.stack([series[start : start + size] for start in starts])
    np.testing.assert_allclose(blend(windows, starts, n_steps), series, atol=1e-12)


@pytest.mark.parametrize("n_steps", [96, 97, 128, 150, 200, 1000])
def test_windows_that_disagree_blend_without_a_seam(n_steps: int) -> None:
    starts = window_starts(n_steps, 64)
    level = np.arange(len(starts)) % 2
    windows = np.broadcast_to(level[:, None, None], (len(starts), 64, 1)).astype(float)
    blended = blend(windows, starts, n_steps)
    assert (blended >= 0).all() and (blended <= 1).all()
    assert np.abs(np.diff(blended, axis=0)).max() < 2 / 32
