"""A repeated drive differs from the real one in its errors only."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gaia_uwb._shared.errors import InputError
from gaia_uwb.scene import Scene
from gaia_uwb.simulate import PRESETS, simulate_pass
from gaia_uwb.simulate.reality.replay import replay
from gaia_uwb.simulate.settings import DriveConfig, PassConfig, RangingConfig

EXACT = RangingConfig(
    sigma_m=0.0, sigma_per_m=0.0, nlos_bias_m=0.0, burst_per_s=0.0, held_share=0.0
)


@pytest.fixture(scope="module")
def drive() -> Scene:
    config = PassConfig(drive=DriveConfig(position_sigma_m=0.0, rate_hz=50.0, duration_s=30.0))
    return simulate_pass(config, seed=4)


def test_only_the_ranges_change(drive: Scene) -> None:
    again = replay(drive, RangingConfig(), seed=1)
    np.testing.assert_array_equal(again.ranges.t_s, drive.ranges.t_s)
    np.testing.assert_array_equal(again.ranges.anchor, drive.ranges.anchor)
    np.testing.assert_array_equal(again.truth.nlos, drive.truth.nlos)
    assert again.trajectory is drive.trajectory
    assert again.truth.clock_offset_s == drive.truth.clock_offset_s
    assert np.abs(again.ranges.range_m - drive.ranges.range_m).max() > 0.05


def test_without_errors_the_ranges_are_true(drive: Scene) -> None:
    again = replay(drive, EXACT, seed=1)
    np.testing.assert_allclose(again.ranges.range_m, drive.truth.range_m, atol=2e-3)


def test_excess_comes_with_the_logs_labels_not_with_the_chain(drive: Scene) -> None:
    settings = EXACT.model_copy(update={"nlos_bias_m": 0.5, "nlos_bias_sigma_m": 0.0})
    label = drive.ranges.t_s < 15.0
    again = replay(replace(drive, truth=replace(drive.truth, nlos=label)), settings, seed=1)
    excess_m = again.ranges.range_m - drive.truth.range_m
    steady = np.abs(drive.ranges.t_s - 15.0) > 1.0  # apart from the change itself
    np.testing.assert_allclose(excess_m[steady], 0.5 * label[steady], atol=5e-3)


def test_no_label_is_line_of_sight(drive: Scene) -> None:
    settings = EXACT.model_copy(update={"nlos_bias_m": 0.5})
    unlabelled = replace(drive, truth=replace(drive.truth, nlos=None))
    again = replay(unlabelled, settings, seed=1)
    np.testing.assert_allclose(again.ranges.range_m, drive.truth.range_m, atol=2e-3)


def test_all_readings_are_kept_whatever_the_model_loses(drive: Scene) -> None:
    settings = EXACT.model_copy(
        update={"dropout_share": 0.9, "outage_per_s": 1.0, "max_range_m": 1.0}
    )
    again = replay(drive, settings, seed=1)
    np.testing.assert_allclose(again.ranges.range_m, drive.truth.range_m, atol=2e-3)


def test_seed_and_name_give_the_ranges(drive: Scene) -> None:
    first, same, other, renamed = (
        replay(scene, RangingConfig(), seed).ranges.range_m
        for scene, seed in (
            (drive, 1), (drive, 1), (drive, 2), (replace(drive, name="another"), 1),
        )
    )  # fmt: skip
    np.testing.assert_array_equal(first, same)
    assert (first != other).mean() > 0.9
    assert (first != renamed).mean() > 0.9


def test_a_survey_is_needed() -> None:
    scene = simulate_pass(PRESETS["parked"], seed=0).without_truth()
    with pytest.raises(InputError, match="expected surveyed anchors"):
        replay(scene, EXACT, seed=0)
