"""Cones range their neighbours, with the errors of the radios and by their clock."""

from __future__ import annotations

from typing import Any

import numpy as np

from gaia_uwb.scene import ConeRanges, Scene
from gaia_uwb.simulate import ClosureConfig, DriveConfig, PassConfig, RangingConfig, simulate_pass

EXACT: dict[str, Any] = {
    "sigma_m": 0.0, "sigma_per_m": 0.0, "los_s": None, "burst_per_s": 0.0, "dropout_share": 0.0,
    "outage_per_s": 0.0, "held_share": 0.0, "cone_neighbours": 3,
}  # fmt: skip


def ranged(seed: int = 1, n_trucks: int = 0, **ranging: Any) -> Scene:
    settings = RangingConfig(**{**EXACT, **ranging})
    drive = DriveConfig(duration_s=30.0)
    return simulate_pass(
        PassConfig(closure=ClosureConfig(n_trucks=n_trucks), drive=drive, ranging=settings), seed
    )


def true_m(scene: Scene) -> np.ndarray:
    assert scene.truth is not None
    assert scene.anchor_up_m is not None
    assert scene.cone_ranges is not None
    a, b = scene.cone_ranges.anchor_a, scene.cone_ranges.anchor_b
    place_m = np.column_stack([scene.truth.anchor_m, scene.anchor_up_m])
    return np.asarray(np.linalg.norm(place_m[a] - place_m[b], axis=1))


def rows(log: ConeRanges | None) -> ConeRanges:
    assert log is not None
    return log


def test_without_errors_ranges_are_distances_between_nearest_cones() -> None:
    scene = ranged(max_range_m=1000.0)
    log = rows(scene.cone_ranges)
    np.testing.assert_allclose(log.range_m, true_m(scene), atol=2e-6)
    assert scene.truth is not None
    apart_m = np.hypot(*(scene.truth.anchor_m[:, None] - scene.truth.anchor_m).transpose(2, 0, 1))
    nearest = np.argsort(apart_m, axis=1)[:, 1:4]
    pairs, counts = np.unique(np.stack([log.anchor_a, log.anchor_b]), axis=1, return_counts=True)
    wanted = {(min(a, b), max(a, b)) for a in range(8) for b in nearest[a].tolist()}
    assert {*zip(*pairs.tolist(), strict=True)} == wanted
    assert (counts == 15).all()  # every 2 s for 30 s


def test_ranges_have_the_bias_of_the_radios_and_their_clock() -> None:
    scene = ranged(max_range_m=1000.0, bias_m=0.3, clock_offset_s=7.0)
    log = rows(scene.cone_ranges)
    np.testing.assert_allclose(log.range_m - true_m(scene), 0.3, atol=2e-6)
    assert log.t_s is not None
    assert (np.diff(log.t_s) >= 0).all()
    assert 7.0 <= log.t_s[0] < log.t_s[-1] <= 37.0


def test_what_is_far_or_hidden_is_not_heard_or_longer() -> None:
    near = ranged(max_range_m=25.0)
    assert true_m(near).max() <= 25.0
    assert len(rows(near.cone_ranges)) < len(rows(ranged(max_range_m=1000.0).cone_ranges))
    assert ranged(cone_rate_hz=0.01).cone_ranges is None
    scene = ranged(4, 15, max_range_m=1000.0, nlos_bias_m=0.5)
    error_m = rows(scene.cone_ranges).range_m - true_m(scene)
    assert 0.02 < (error_m > 0.05).mean() < 0.98


def test_a_tags_readings_do_not_depend_on_the_cones() -> None:
    with_cones, without = ranged(sigma_m=0.1), ranged(sigma_m=0.1, cone_neighbours=0)
    assert without.cone_ranges is None
    np.testing.assert_array_equal(with_cones.ranges.range_m, without.ranges.range_m)
    error_m = rows(with_cones.cone_ranges).range_m - true_m(with_cones)
    assert 0.08 < np.std(error_m) < 0.12
