"""A pass is one Scene: reproducible, resolvable, with the truth of everything."""

from __future__ import annotations

from itertools import islice

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.optimize import least_squares

from alike import assert_same
from gaia_uwb._shared.arrays import Array, Float64
from gaia_uwb._shared.errors import ConfigError, SourceError
from gaia_uwb.scene import Scene
from gaia_uwb.simulate import PRESETS, PassConfig, simulate, simulate_pass
from gaia_uwb.simulate.settings import ClosureConfig, DriveConfig, RangingConfig, RoadConfig
from gaia_uwb.simulate.source import load

DEFAULT = PRESETS["lane-closure"]


def slant_m(scene: Scene, offset_s: float) -> Float64[Array, "R"]:
    """Return the slant range of each reading with the stamps moved back by an offset."""
    path, truth = scene.trajectory, scene.truth
    assert truth is not None
    assert path.up_m is not None
    assert scene.anchor_up_m is not None
    t_s = scene.ranges.t_s - offset_s
    tag_m = np.column_stack([np.interp(t_s, path.t_s, path.position_m[:, k]) for k in (0, 1)])
    gap_m = tag_m - truth.anchor_m[scene.ranges.anchor]
    up_gap_m = path.up_m[0] - scene.anchor_up_m[scene.ranges.anchor]
    return np.sqrt((gap_m**2).sum(axis=1) + up_gap_m**2)


def test_default_pass_is_a_realistic_log() -> None:
    scene = simulate_pass(DEFAULT, seed=0)
    truth = scene.truth
    assert truth is not None
    assert scene.n_anchors == 8
    assert scene.trajectory.t_s[-1] == 60
    assert scene.frame is not None
    assert np.bincount(scene.ranges.anchor, minlength=8).min() > 80
    error = scene.ranges.range_m - truth.range_m
    assert np.median(np.abs(error)) < 0.15
    assert (np.abs(error) > 1).any()
    assert truth.nlos is not None
    assert 0.05 < truth.nlos.mean() < 0.4


@pytest.mark.parametrize("offset_s", [-0.7, 0.0, 0.25])
def test_a_reading_stamped_t_belongs_to_the_path_at_t_minus_the_offset(offset_s: float) -> None:
    config = PassConfig(
        drive=DriveConfig(position_sigma_m=0.0), ranging=RangingConfig(clock_offset_s=offset_s)
    )
    scene = simulate_pass(config, seed=1)
    assert scene.truth is not None
    assert scene.truth.clock_offset_s == offset_s
    np.testing.assert_allclose(slant_m(scene, offset_s), scene.truth.range_m, atol=2e-3)
    if offset_s:  # the wrong sign is seen at once
        wrong = np.abs(slant_m(scene, -offset_s) - scene.truth.range_m)
        assert np.median(wrong) > 8 * abs(offset_s)


@pytest.mark.parametrize("closed_lane", ["right", "left"])
@pytest.mark.parametrize("direction_rad", [-2.0, 0.0, 3.0])
def test_anchors_stand_on_the_closed_side_of_the_path(
    closed_lane: str, direction_rad: float
) -> None:
    road = RoadConfig.model_validate({"closed_lane": closed_lane, "direction_rad": direction_rad})
    scene = simulate_pass(PassConfig(road=road), seed=2)
    assert scene.truth is not None
    path_m = scene.trajectory.position_m
    for place_m in scene.truth.anchor_m:
        nearest = int(np.argmin(np.hypot(*(path_m - place_m).T)))
        ahead, towards = path_m[nearest + 3] - path_m[nearest - 3], place_m - path_m[nearest]
        left = ahead[0] * towards[1] - ahead[1] * towards[0] > 0
        assert left == (closed_lane == "left")


def mirror_misfit(config: PassConfig, scene: Scene, anchor: int) -> float:
    """Return how much worse (in log-likelihood) the best place on the wrong side fits."""
    truth, ranges, path = scene.truth, scene.ranges, scene.trajectory
    assert truth is not None
    assert truth.nlos is not None
    assert truth.range_m is not None
    assert path.up_m is not None
    assert scene.anchor_up_m is not None
    use = (ranges.anchor == anchor) & ~truth.nlos
    t_s, range_m = ranges.t_s[use] - config.ranging.clock_offset_s, truth.range_m[use]
    tag_m = np.column_stack([np.interp(t_s, path.t_s, path.position_m[:, k]) for k in (0, 1)])
    sigma_m = config.ranging.sigma_m + config.ranging.sigma_per_m * range_m
    up_gap_m = path.up_m[0] - scene.anchor_up_m[anchor]
    nearest = int(np.argmin(range_m))
    ahead = tag_m[nearest + 3] - tag_m[nearest - 3]
    ahead /= np.hypot(*ahead)
    normal = np.array([-ahead[1], ahead[0]])
    beyond_m = float((tag_m[nearest] - truth.anchor_m[anchor]) @ normal)

    def misfit(step: Float64[Array, "2"]) -> Float64[Array, "K"]:
        # The exponential keeps the place beyond the path, seen from the anchor.
        aside_m = np.sign(beyond_m) * np.exp(step[1])
        gap_m = tag_m - (tag_m[nearest] + step[0] * ahead + aside_m * normal)
        return (np.sqrt((gap_m**2).sum(axis=1) + up_gap_m**2) - range_m) / sigma_m

    return float(least_squares(misfit, [0.0, np.log(abs(beyond_m))]).cost)


def test_the_default_pass_resolves_the_sides_and_the_straight_one_leaves_them_open() -> None:
    default, straight = (
        np.array([
            [mirror_misfit(config, scene, k) for k in range(scene.n_anchors)]
            for scene in (simulate_pass(config, seed) for seed in range(3))
        ])
        for config in (DEFAULT, PRESETS["straight"])
    )  # fmt: skip
    assert default[0].min() > 5  # odds of 150 to 1 for each anchor of the embedded default
    assert np.quantile(default, 0.1) > 5  # elsewhere a long stretch of NLOS may hide a side
    assert np.median(straight) < 3


def test_same_seed_same_scene_and_other_seed_other_scene() -> None:
    assert_same(simulate_pass(DEFAULT, 7), simulate_pass(DEFAULT, 7))
    one, other = simulate_pass(DEFAULT, 7), simulate_pass(DEFAULT, 8)
    assert one.truth is not None
    assert other.truth is not None
    assert not np.array_equal(one.truth.anchor_m, other.truth.anchor_m)
    assert not np.array_equal(one.trajectory.position_m, other.trajectory.position_m)
    assert not np.array_equal(one.ranges.range_m[:50], other.ranges.range_m[:50])


def test_episode_alone_equals_episode_of_a_batch() -> None:
    batch = list(simulate(DEFAULT, 4, seed=3))
    assert len({scene.name for scene in batch}) == 4
    for k, scene in enumerate(batch):
        assert_same(scene, simulate_pass(DEFAULT, 3, episode=k))
    assert_same(batch[2], next(islice(simulate(DEFAULT, 100, seed=3), 2, None)))
    assert not np.array_equal(batch[0].trajectory.position_m, batch[1].trajectory.position_m)


@given(n=st.integers(1, 9), seed=st.integers(0, 2**40))
@settings(max_examples=10, deadline=None)
def test_one_more_anchor_leaves_the_others_as_they_are(n: int, seed: int) -> None:
    few, more = (
        simulate_pass(PassConfig(closure=ClosureConfig(n_anchors=m)), seed) for m in (n, n + 1)
    )
    np.testing.assert_array_equal(few.trajectory.position_m, more.trajectory.position_m)
    old = more.ranges.anchor < n
    for key in ("t_s", "anchor", "range_m", "rssi_dbm", "rssi_fp_dbm"):
        np.testing.assert_array_equal(vars(few.ranges)[key], vars(more.ranges)[key][old])
    assert few.truth is not None
    assert more.truth is not None
    assert more.truth.nlos is not None
    np.testing.assert_array_equal(few.truth.nlos, more.truth.nlos[old])
    np.testing.assert_array_equal(few.truth.anchor_m, more.truth.anchor_m[:n])


def test_a_pass_without_any_reading_is_a_config_error() -> None:
    config = PassConfig(ranging=RangingConfig(max_range_m=0.5))
    with pytest.raises(ConfigError, match="no reading"):
        simulate_pass(config, 0)
    with pytest.raises(ConfigError, match="no reading"):
        next(simulate(config, 1, 0))


def test_parked_pass_keeps_anchors_that_never_answer() -> None:
    scene = simulate_pass(PRESETS["parked"], 0)
    assert scene.n_anchors == 8
    assert 0 < len(np.unique(scene.ranges.anchor)) < 8
    assert np.ptp(scene.trajectory.position_m, axis=0).max() < 0.1


@pytest.mark.parametrize(
    ("part", "preset", "seed"),
    [
        ("", "lane-closure", 0),
        ("parked", "parked", 0),
        ("straight/12", "straight", 12),
        ("straight/12/1", "straight", 12),
    ],
)
def test_load_resolves_preset_and_seed(part: str, preset: str, seed: int) -> None:
    (scene,) = load(part)
    assert scene.name == f"sim:{preset}/{seed}"
    np.testing.assert_array_equal(
        scene.ranges.range_m, simulate_pass(PRESETS[preset], seed).ranges.range_m
    )


def test_load_gives_several_passes() -> None:
    scenes = load("straight/3/2")
    assert [scene.name for scene in scenes] == ["sim:straight/3/0", "sim:straight/3/1"]
    for k, scene in enumerate(scenes):
        np.testing.assert_array_equal(
            scene.ranges.range_m,
            simulate_pass(PRESETS["straight"], 3, episode=k).ranges.range_m,
        )


@pytest.mark.parametrize(
    "part", ["roundabout", "Parked", "/3", "lane-closure/1/2/3", "straight/1/0", "straight/1/"]
)
def test_load_names_the_presets_or_the_bad_seed(part: str) -> None:
    with pytest.raises(
        SourceError, match=r"lane-closure, straight, two-tags|whole number|at least one"
    ):
        load(part)


@pytest.mark.parametrize("seed", ["", "-1", "1.5", "x", "\N{SUPERSCRIPT TWO}"])
def test_load_refuses_a_seed_that_is_no_whole_number(seed: str) -> None:
    with pytest.raises(SourceError, match="whole number"):
        load(f"straight/{seed}")
