"""Stressors: nothing at the mildest setting, what they say at the others, truth untouched."""

from __future__ import annotations

import numpy as np
import pytest

from gaia_uwb._shared.errors import InputError
from gaia_uwb.episode import Episode
from gaia_uwb.evaluate.stressors import STRESSORS, Stressor, stress
from gaia_uwb.simulate import PRESETS, simulate_episodes

BY_NAME = {stressor.name: stressor for stressor in STRESSORS}


@pytest.fixture(scope="module")
def episodes() -> list[Episode]:
    return list(simulate_episodes(PRESETS["stress"], 6, seed=4))


@pytest.mark.parametrize("stressor", STRESSORS, ids=lambda s: s.name)
def test_the_mildest_setting_changes_nothing(episodes: list[Episode], stressor: Stressor) -> None:
    for before, after in zip(
        episodes, stress(episodes, stressor, stressor.settings[0], seed=0), strict=True
    ):
        np.testing.assert_allclose(after.range_m, before.range_m, atol=1e-9)
        np.testing.assert_array_equal(after.valid, before.valid)
        np.testing.assert_array_equal(after.position_m, before.position_m)


@pytest.mark.parametrize("stressor", STRESSORS, ids=lambda s: s.name)
def test_truth_stays_and_each_episode_is_what_it_is_alone(
    episodes: list[Episode], stressor: Stressor
) -> None:
    worst = stressor.settings[-1]
    many = stress(episodes, stressor, worst, seed=1)
    few = stress(episodes[:2], stressor, worst, seed=1)
    for before, after in zip(episodes, many, strict=True):
        assert after.truth is before.truth
        same_ranges = np.array_equal(after.range_m, before.range_m, equal_nan=True)
        same_path = np.array_equal(after.position_m, before.position_m)
        assert not (same_ranges and same_path)
    for one, other in zip(few, many, strict=False):
        np.testing.assert_array_equal(one.range_m, other.range_m)
        np.testing.assert_array_equal(one.position_m, other.position_m)


def errors(before: list[Episode], after: tuple[Episode, ...]) -> np.ndarray:
    return np.concatenate([
        (b.range_m - a.range_m)[a.valid] for a, b in zip(before, after, strict=True)
    ])  # fmt: skip


def test_noise_and_outliers_have_the_declared_size(episodes: list[Episode]) -> None:
    noise_m = errors(episodes, stress(episodes, BY_NAME["range-noise"], 2.0, seed=0))
    assert noise_m.std() == pytest.approx(2.0, rel=0.06)
    jump_m = np.abs(errors(episodes, stress(episodes, BY_NAME["outliers"], 0.2, seed=0)))
    assert np.mean(jump_m > 1e-9) == pytest.approx(0.2, abs=0.02)
    assert jump_m.max() <= 12.0


def test_nlos_bias_grows_only_without_line_of_sight(episodes: list[Episode]) -> None:
    for before, after in zip(
        episodes, stress(episodes, BY_NAME["nlos-bias"], 3.0, seed=0), strict=True
    ):
        truth = before.truth
        assert truth is not None
        assert truth.bias_m is not None
        grown_m = after.range_m - before.range_m
        np.testing.assert_allclose(grown_m[~truth.nlos], 0.0, atol=1e-12)
        np.testing.assert_allclose(grown_m[truth.nlos], 2.0 * truth.bias_m[truth.nlos], atol=1e-9)


def test_bias_has_to_be_known(episodes: list[Episode]) -> None:
    with pytest.raises(InputError, match="whose bias is known"):
        stress([episodes[0].without_truth()], BY_NAME["nlos-bias"], 2.0, seed=0)


def test_fewer_anchors_are_a_part_of_those_kept_before(episodes: list[Episode]) -> None:
    six = stress(episodes, BY_NAME["anchors"], 6.0, seed=0)
    four = stress(episodes, BY_NAME["anchors"], 4.0, seed=0)
    for more, less in zip(six, four, strict=True):
        assert more.valid.any(axis=0).sum() == 6
        assert less.valid.any(axis=0).sum() == 4
        assert not (less.valid.any(axis=0) & ~more.valid.any(axis=0)).any()


def test_a_late_clock_gives_the_ranges_of_before(episodes: list[Episode]) -> None:
    (late,) = stress(episodes[:1], BY_NAME["clock-offset"], 0.2, seed=0)
    np.testing.assert_allclose(late.range_m[2:], episodes[0].range_m[:-2], atol=1e-9)


def test_a_span_is_one_stretch_of_the_declared_length(episodes: list[Episode]) -> None:
    for before, after in zip(
        episodes, stress(episodes, BY_NAME["dropped-span"], 0.4, seed=0), strict=True
    ):
        for n in range(before.n_anchors):
            gone = np.flatnonzero(~after.valid[:, n])
            assert len(gone) == round(0.4 * 64)
            assert (np.diff(gone) == 1).all()
