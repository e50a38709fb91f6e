"""Logs and episodes are of one pass: what is measured, what is true, what a seed decides."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from gaia_uwb._shared.errors import ConfigError
from gaia_uwb.episode import Episode
from gaia_uwb.simulate import (
    PRESETS,
    PassConfig,
    simulate_episode,
    simulate_pass,
    simulate_zone,
)
from gaia_uwb.simulate.settings import DriveConfig, RangingConfig, RoadConfig

EXACT: Mapping[str, Any] = {
    "sigma_m": 0.0, "sigma_per_m": 0.0, "los_s": None, "burst_per_s": 0.0, "dropout_share": 0.0,
    "outage_per_s": 0.0, "held_share": 0.0, "max_range_m": 1000.0, "clock_offset_s": 0.0,
}  # fmt: skip


STEADY = DriveConfig(position_sigma_m=0.0)


def exact(drive: DriveConfig = STEADY, **ranging: Any) -> PassConfig:
    return PassConfig(drive=drive, ranging=RangingConfig(**{**EXACT, **ranging}))


def slant_m(episode: Episode) -> np.ndarray:
    assert episode.truth is not None
    gap_m = episode.position_m[:, None] - episode.truth.anchor_m
    return np.sqrt((gap_m**2).sum(axis=-1) + episode.height_gap_m() ** 2)


def test_without_errors_an_episode_is_geometry() -> None:
    episode = simulate_episode(exact(), 3)
    assert episode.valid.all()
    assert episode.truth is not None
    np.testing.assert_allclose(episode.range_m, slant_m(episode), atol=2e-6)
    np.testing.assert_array_equal(episode.range_m, episode.truth.range_m)
    assert episode.n_steps == 480
    np.testing.assert_allclose(np.diff(episode.t_s), 1 / 8)


def test_log_and_episode_tell_the_same_pass() -> None:
    config = PRESETS["wild"]
    scene, episode = (make(config, 5, episode=2) for make in (simulate_pass, simulate_episode))
    assert scene.truth is not None
    assert episode.truth is not None
    assert scene.name == episode.name
    np.testing.assert_array_equal(scene.truth.anchor_m, episode.truth.anchor_m)
    np.testing.assert_array_equal(scene.anchor_up_m, episode.anchor_up_m)
    np.testing.assert_allclose(scene.trajectory.position_m[:64], episode.position_m, atol=0.1)


@pytest.mark.parametrize("name", sorted(PRESETS.keys() - {"two-tags", "angles", "cone-ranges"}))
def test_measured_is_true_plus_bias_plus_noise(name: str) -> None:
    ranging = PRESETS[name].ranging.model_copy(
        update={"sigma_m": 0.0, "sigma_per_m": 0.0, "held_share": 0.0, "clock_offset_s": 0.0,
                "nlos_sigma_m": 0.0}
    )  # fmt: skip
    vary = {k: v for k, v in PRESETS[name].vary.items() if k != "ranging.sigma_m"}
    config = PRESETS[name].model_copy(update={"ranging": ranging, "vary": vary})
    for k in range(3):
        episode = simulate_episode(config, 1, episode=k)
        truth = episode.truth
        assert truth is not None
        assert truth.bias_m is not None
        assert truth.outlier is not None
        rest_m = (episode.range_m - truth.range_m - truth.bias_m)[episode.valid]
        spike = truth.outlier[episode.valid]
        np.testing.assert_allclose(rest_m[~spike], 0, atol=3e-6)
        assert (np.abs(rest_m[spike]) > 0.05).all()


def test_a_clock_offset_leaves_late_ranges_in_an_episode() -> None:
    late = simulate_episode(exact(clock_offset_s=0.5), 2)
    sharp = simulate_episode(exact(), 2)
    assert late.truth is not None
    np.testing.assert_allclose(late.range_m[4:], sharp.range_m[:-4], atol=2e-6)
    np.testing.assert_array_equal(late.truth.range_m, sharp.range_m)


def test_an_outage_is_missing_in_a_log_and_bridged_in_an_episode() -> None:
    drive = DriveConfig(position_sigma_m=0.0, position_outage_per_s=0.2, position_outage_s=1.0)
    scene, episode = simulate_pass(exact(drive), 4), simulate_episode(exact(drive), 4)
    full = simulate_episode(exact(), 4)
    assert len(scene.trajectory) < 470
    assert np.diff(scene.trajectory.t_s).max() > 0.5
    off_m = np.hypot(*(episode.position_m - full.position_m).T)
    assert 1e-3 < off_m.max() < 2  # bridged straight
    np.testing.assert_array_equal(episode.range_m, full.range_m)


def test_polls_keep_their_rate_irregularly_within_the_drive() -> None:
    scene = simulate_pass(exact(), 0)
    for n in range(8):
        t_s = scene.ranges.t_s[scene.ranges.anchor == n]
        step_s = np.diff(t_s)
        assert len(t_s) == 600
        assert t_s[0] >= 0
        assert t_s[-1] <= 60
        assert 0.09 - 1e-9 <= step_s.min() < step_s.max() <= 0.11 + 1e-9
        assert len(np.unique(step_s.round(6))) > 300


@given(n=st.integers(1, 15), seed=st.integers(0, 2**64 - 1))
@settings(max_examples=10, deadline=None)
def test_one_more_anchor_leaves_the_others_of_an_episode_as_they_are(n: int, seed: int) -> None:
    base = PRESETS["stress"].model_copy(update={"vary": {}})
    few, more = (
        simulate_episode(
            base.model_copy(update={"closure": base.closure.model_copy(update={"n_anchors": m})}),
            seed,
        )
        for m in (n, n + 1)
    )
    np.testing.assert_array_equal(few.position_m, more.position_m)
    np.testing.assert_array_equal(few.range_m, more.range_m[:, :n])


@pytest.mark.parametrize(("seed", "episode"), [(-1, 0), (2**64, 0), (0, -1), (0, 2**64)])
def test_a_seed_out_of_range_is_a_config_error(seed: int, episode: int) -> None:
    with pytest.raises(ConfigError, match="below 2"):
        simulate_episode(PRESETS["stress"], seed, episode=episode)
    with pytest.raises(ConfigError, match="below 2"):
        simulate_pass(PRESETS["stress"], seed, episode=episode)


@pytest.mark.parametrize(
    ("preset", "digest"),
    [
        ("stress", "e6e73de2b6ddc10a"),
        ("wild", "393dee19b4a2c9a9"),
        ("lane-closure", "f6d71ce388f30df7"),
    ],
)
def test_a_seed_gives_these_very_numbers_on_every_machine(preset: str, digest: str) -> None:
    episode = simulate_episode(PRESETS[preset], 1, episode=10**12)
    truth = episode.truth
    assert truth is not None
    assert truth.bias_m is not None
    parts = (episode.position_m, np.nan_to_num(episode.range_m), truth.anchor_m, truth.bias_m)
    # Zeros of either sign are the same number.
    content = b"".join((part + 0.0).tobytes() for part in parts)
    assert hashlib.sha256(content).hexdigest()[:16] == digest


def test_wild_scenes_come_in_every_direction_and_mirrored() -> None:
    lefts, headings = [], []
    for k in range(60):
        episode = simulate_episode(PRESETS["wild"], 0, episode=k)
        assert episode.truth is not None
        ahead = episode.position_m[-1] - episode.position_m[0]
        headings.append(np.arctan2(ahead[1], ahead[0]))
        towards = episode.truth.anchor_m[0] - episode.position_m.mean(axis=0)
        lefts.append(ahead[0] * towards[1] - ahead[1] * towards[0] > 0)
    assert np.histogram(headings, bins=4, range=(-np.pi, np.pi))[0].min() > 5
    assert 0.25 < np.mean(lefts) < 0.75


def test_stress_is_about_a_fifth_in_sight() -> None:
    nlos = []
    for k in range(100):
        truth = simulate_episode(PRESETS["stress"], 0, episode=k).truth
        assert truth is not None
        nlos.append(truth.nlos.mean())
    assert 0.195 < 1 - np.mean(nlos) < 0.235


def test_passes_of_one_zone_share_the_anchors_and_nothing_else():
    config = PRESETS["wild"]
    one, other, third = simulate_zone(config, seed=5, lanes_m=(0.0, 0.0, 3.0), zone=4)
    for scene in (other, third):
        assert np.array_equal(scene.truth.anchor_m, one.truth.anchor_m)
        assert np.array_equal(scene.anchor_up_m, one.anchor_up_m)
        assert scene.anchor_ids == one.anchor_ids
    assert not np.array_equal(one.ranges.range_m[:50], other.ranges.range_m[:50])
    assert not np.array_equal(one.trajectory.position_m, other.trajectory.position_m)
    elsewhere = simulate_zone(config, seed=5, lanes_m=(0.0,), zone=5)[0]
    assert not np.array_equal(elsewhere.truth.anchor_m[:2], one.truth.anchor_m[:2])


def test_a_lane_is_as_far_beside_the_usual_one_as_asked():
    drive = DriveConfig(lane_change=False, sway_m=0.0, position_sigma_m=0.0)
    config = PassConfig(road=RoadConfig(curvature_per_m=0.0, direction_rad=0.0), drive=drive)
    near, far = simulate_zone(config, seed=0, lanes_m=(0.0, 3.5))
    north_m = [scene.trajectory.position_m[:, 1] for scene in (near, far)]
    assert np.allclose(north_m[1] - north_m[0], 3.5, atol=1e-5)
    with pytest.raises(ConfigError, match="within 20 m of the usual one, got 30"):
        simulate_zone(config, seed=0, lanes_m=(30.0,))
