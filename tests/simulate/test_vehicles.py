"""Several tags, angles of arrival and vehicles with names: what is measured and what is true."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from gaia_uwb._shared import Array
from gaia_uwb._shared.errors import ConfigError
from gaia_uwb.scene import Scene, Tag, tag_scenes
from gaia_uwb.simulate import (
    PRESETS,
    DriveConfig,
    PassConfig,
    RangingConfig,
    RoadConfig,
    TagConfig,
    simulate_pass,
    simulate_zone,
)
from gaia_uwb.simulate.source import load

EXACT: dict[str, Any] = {
    "sigma_m": 0.0, "sigma_per_m": 0.0, "los_s": None, "burst_per_s": 0.0, "dropout_share": 0.0,
    "outage_per_s": 0.0, "held_share": 0.0, "max_range_m": 1000.0, "clock_offset_s": 0.0,
    "tag_delay_sigma_m": 0.0, "tag_pattern_sigma_m": 0.0, "azimuth_bias_sigma_deg": 0.0,
    "azimuth_wild_share": 0.0,
}  # fmt: skip
LEVERS = (TagConfig(forward_m=1.0, left_m=0.8), TagConfig(left_m=-0.8, up_m=0.4))


def drive(**settings: Any) -> DriveConfig:
    exact = {"position_sigma_m": 0.0, "lever_sigma_m": 0.0, "crab_sigma_deg": 0.0, "rate_hz": 20.0}
    return DriveConfig(**{**exact, "tags": LEVERS, **settings})


def seen(one: Scene) -> tuple[Array, Array]:
    """Return slant range and bearing of each reading's anchor from where the log has the antenna.

    The second is from the course of the vehicle.
    """
    assert one.truth is not None
    assert one.anchor_up_m is not None
    path, log = one.trajectory, one.ranges
    assert path.up_m is not None
    t_s = log.t_s - one.truth.clock_offset_s
    at_m = np.stack([np.interp(t_s, path.t_s, axis) for axis in (*path.position_m.T, path.up_m)])
    course_rad = np.unwrap(np.arctan2(*np.gradient(path.position_m, axis=0).T[::-1]))
    east_m, north_m = one.truth.anchor_m[log.anchor].T - at_m[:2]
    bearing_rad = np.arctan2(north_m, east_m) - np.interp(t_s, path.t_s, course_rad)
    up_m = one.anchor_up_m[log.anchor] - at_m[2]
    return np.sqrt(east_m**2 + north_m**2 + up_m**2), bearing_rad


def test_without_errors_ranges_and_angles_are_those_of_the_stated_antennas() -> None:
    ranging = RangingConfig(**EXACT, azimuth_sigma_deg=1e-9)
    scene = simulate_pass(PassConfig(drive=drive(), ranging=ranging), 3)
    assert scene.tags == (Tag("tag-1", 1.0, 0.8), Tag("tag-2", 0.0, -0.8, 0.4))
    for one in tag_scenes(scene):
        range_m, bearing_rad = seen(one)
        assert one.truth is not None
        assert one.ranges.azimuth_rad is not None
        np.testing.assert_allclose(one.ranges.range_m, range_m, atol=0.02)
        np.testing.assert_array_equal(one.truth.range_m, one.ranges.range_m)
        off_rad = np.angle(np.exp(1j * (one.ranges.azimuth_rad - bearing_rad)))
        far = range_m > 8.0  # a near cone's bearing turns with every millimetre
        assert np.abs(off_rad[far]).max() < 0.03
        assert np.ptp(one.ranges.azimuth_rad) > 2.5  # cones ahead, beside and behind


def test_a_parked_vehicle_has_antennas_where_its_course_would_put_them() -> None:
    parked = PassConfig(
        road=RoadConfig(curvature_per_m=0.0, direction_rad=0.0),
        drive=drive(speed_mps=0.0, lane_change=False, sway_m=0.0),
        ranging=RangingConfig(**EXACT),
    )
    scene = simulate_pass(parked, 1)
    assert scene.truth is not None
    assert scene.truth.range_m is not None
    assert scene.anchor_up_m is not None
    for k, lever_m in enumerate(([1.0, 0.8], [0.0, -0.8])):
        own = scene.ranges.tag == k
        anchor = scene.ranges.anchor[own]
        gap_m = scene.truth.anchor_m[anchor] - (scene.trajectory.position_m[0] + lever_m)
        up_m = scene.anchor_up_m[anchor] - 1.6 - 0.4 * k
        np.testing.assert_allclose(
            scene.ranges.range_m[own], np.hypot(np.hypot(*gap_m.T), up_m), atol=2e-6
        )


def test_one_more_tag_leaves_the_readings_of_those_before_it() -> None:
    ranging = RangingConfig(azimuth_sigma_deg=10.0)
    one, two = (
        tag_scenes(simulate_pass(PassConfig(drive=drive(tags=tags), ranging=ranging), 4))
        for tags in (LEVERS[:1], LEVERS)
    )
    assert len(two) == 2
    for name in ("t_s", "range_m", "azimuth_rad"):
        values = getattr(one[0].ranges, name)
        np.testing.assert_array_equal(values, getattr(two[0].ranges, name))
        assert len(values) != len(getattr(two[1].ranges, name)) or not np.array_equal(
            values, getattr(two[1].ranges, name)
        )


def test_what_a_log_states_of_its_tags_is_not_quite_true() -> None:
    exact = {**EXACT, "tag_delay_sigma_m": 0.05, "tag_pattern_sigma_m": 0.03}
    config = PassConfig(drive=drive(), ranging=RangingConfig(**exact))
    delay_m = []
    for seed in range(30):
        for one in tag_scenes(simulate_pass(config, seed)):
            assert one.truth is not None
            assert one.truth.range_m is not None
            error_m = one.ranges.range_m - one.truth.range_m
            np.testing.assert_allclose(error_m, one.truth.bias_m, atol=2e-6)
            _, bearing_rad = seen(one)
            waves = [f(k * bearing_rad) for k in (1, 2) for f in (np.cos, np.sin)]
            basis = np.stack([np.ones(len(error_m)), *waves], axis=1)
            found_m = np.linalg.lstsq(basis, error_m)[0]
            assert np.std(error_m - basis @ found_m) < 0.003
            delay_m.append(found_m[0])
    assert 0.03 < np.std(delay_m) < 0.07
    held = RangingConfig(**{**exact, "held_share": 0.2})
    for one in tag_scenes(simulate_pass(PassConfig(drive=drive(), ranging=held), 1)):
        range_m = one.ranges.range_m[one.ranges.anchor == 0]
        assert 0.15 < (np.diff(range_m) == 0).mean() < 0.25
    apart = drive(lever_sigma_m=0.3, crab_sigma_deg=5.0)
    moved = simulate_pass(PassConfig(drive=apart, ranging=RangingConfig(**EXACT)), 3)
    worst_m = [np.abs(one.ranges.range_m - seen(one)[0]).max() for one in tag_scenes(moved)]
    assert min(worst_m) > 0.1


def test_angles_have_a_bias_noise_and_a_share_that_says_nothing() -> None:
    errors = {**EXACT, "azimuth_bias_sigma_deg": 20.0, "azimuth_wild_share": 0.1}
    ranging = RangingConfig(**errors, azimuth_sigma_deg=4.0)
    scene = simulate_pass(PassConfig(drive=drive(tags=()), ranging=ranging), 2)
    assert scene.ranges.azimuth_rad is not None
    assert scene.ranges.azimuth_sigma_rad is not None
    assert not scene.tags
    np.testing.assert_allclose(scene.ranges.azimuth_sigma_rad, np.radians(4.0))
    assert np.abs(scene.ranges.azimuth_rad).max() <= np.pi + 1e-6
    _, bearing_rad = seen(scene)
    off_rad = np.angle(np.exp(1j * (scene.ranges.azimuth_rad - bearing_rad)))
    middle_rad = np.median(off_rad)
    assert abs(middle_rad) > 0.02
    near = np.abs(np.angle(np.exp(1j * (off_rad - middle_rad)))) < np.radians(16.0)
    assert 0.07 < 1 - near.mean() < 0.12
    np.testing.assert_allclose(np.std(off_rad[near]), np.radians(4.0), rtol=0.1)


def test_vehicles_of_one_name_share_clock_bias_and_tags() -> None:
    config = PassConfig(
        drive=drive(lever_sigma_m=0.2),
        ranging=RangingConfig(**{**EXACT, "tag_delay_sigma_m": 0.05}, vehicle_bias_sigma_m=0.3),
    )
    names = ("van-7", "van-9", "van-7")
    scenes = simulate_zone(config, 5, lanes_m=(0.0, 0.0, 3.6), vehicles=names)
    assert [scene.vehicle for scene in scenes] == list(names)
    elsewhere = simulate_zone(config, 5, lanes_m=(0.0,), zone=3, vehicles=("van-7",))[0]
    seven, nine, again = scenes
    clocks_s, biases_m = [], []
    for scene in (seven, nine, again, elsewhere):
        assert scene.truth is not None
        assert scene.truth.bias_m is not None
        clocks_s.append(scene.truth.clock_offset_s)
        assert scene.ranges.tag is not None
        biases_m.append([np.median(scene.truth.bias_m[scene.ranges.tag == k]) for k in (0, 1)])
    assert clocks_s[0] == clocks_s[2] == clocks_s[3] != clocks_s[1]
    np.testing.assert_allclose(biases_m[0], biases_m[2], atol=1e-6)
    np.testing.assert_allclose(biases_m[0], biases_m[3], atol=1e-6)
    assert np.abs(np.subtract(biases_m[0], biases_m[1])).min() > 0.01
    with pytest.raises(ConfigError, match="a vehicle for each of 2 lanes, got 1"):
        simulate_zone(config, 5, vehicles=("van-7",))


def test_a_vehicle_without_a_name_has_the_clock_of_the_settings() -> None:
    for scene in simulate_zone(PRESETS["two-tags"], 5):
        assert scene.vehicle == ""
        assert scene.truth is not None
        assert scene.truth.clock_offset_s == 0.2


def test_a_source_names_the_kinds_of_evidence() -> None:
    (two,), (angles,), (cones,) = (
        load(f"{name}/3") for name in ("two-tags", "angles", "cone-ranges")
    )
    assert [tag.left_m for tag in two.tags] == [0.8, -0.8]
    assert two.ranges.tag is not None
    assert np.bincount(two.ranges.tag).min() > 1000
    assert angles.ranges.azimuth_rad is not None
    assert np.isfinite(angles.ranges.azimuth_rad).all()
    assert cones.cone_ranges is not None
    assert len(cones.cone_ranges) > 100
