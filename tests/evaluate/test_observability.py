"""Geometry against angles and DOPs worked out by hand; sides that are called told are right."""

from __future__ import annotations

import numpy as np
import pytest

from drives_past import log_past
from gaia_uwb.episode import ClockOffset
from gaia_uwb.evaluate.observability import STRETCH_S, AnchorView, Observability, observe
from gaia_uwb.pipeline import reconstruct
from gaia_uwb.scene import RangeLog, Scene, Trajectory
from gaia_uwb.simulate import PRESETS, simulate_pass

CLOCK = ClockOffset(0.0, 0.5, False, "not significant")


def drive_past(
    path_m: np.ndarray, anchor_m: list[tuple[float, float]], duration_s: float, clock_s: float = 0.0
) -> Scene:
    """Return the log of a drive along a path at 10 Hz with small errors."""
    t_s = np.linspace(1.7e9, 1.7e9 + duration_s, len(path_m))
    read_s = np.repeat(t_s[:, None], len(anchor_m), axis=1)
    return log_past(t_s, path_m, np.array(anchor_m), read_s, late_s=clock_s, noise_m=0.02)


def line(length_m: float, n: int) -> np.ndarray:
    return np.column_stack([np.linspace(-length_m / 2, length_m / 2, n), np.zeros(n)])


def circle(n: int) -> np.ndarray:
    angle_rad = np.linspace(0, 2 * np.pi, n)
    return 20 * np.column_stack([np.cos(angle_rad), np.sin(angle_rad)])


def test_an_anchor_beside_a_straight_road() -> None:
    # 20 m to the side of a road of 40 m, in the middle: seen between -45 and 45 degrees.
    found = observe(drive_past(line(40.0, 400), [(0.0, 20.0)], 39.9)).anchors[0]
    assert found.nearest_m == pytest.approx(20.0, abs=0.1)
    assert found.view_deg == pytest.approx(90.0, abs=0.5)
    assert not found.side_told
    # The mean over the path of cos^2 is 1 - arctan(1) = 0.215 along it, 0.785 across; 10 stretches.
    assert found.dop == pytest.approx(np.sqrt((1 / 0.2146 + 1 / 0.7854) / 10), rel=0.05)


def test_an_anchor_that_is_driven_around_has_no_mirror_image() -> None:
    found = observe(drive_past(circle(400), [(3.0, 0.0)], 40.0)).anchors[0]
    assert found.view_deg > 355
    assert found.side_told
    # One range from each direction: DOP = 2 / sqrt(number of stretches).
    assert found.dop == pytest.approx(2 / np.sqrt(40 / STRETCH_S), rel=0.1)


def test_an_anchor_far_ahead_cannot_be_located() -> None:
    found = observe(drive_past(line(40.0, 400), [(0.0, 3.0), (400.0, 0.0)], 40.0))
    near, far = found.anchors
    assert near.dop < 2
    assert far.dop > 20
    assert next(found.notes()).startswith("cone-1: seen from too few directions (DOP above 5)")


def test_a_clock_offset_is_found_and_taken_out() -> None:
    path_m = circle(600) + np.column_stack([np.linspace(0, 30, 600), np.zeros(600)])
    scene = drive_past(path_m, [(3.0, 0.0), (10.0, 4.0), (20.0, 1.0)], 60.0, clock_s=0.3)
    found = observe(scene)
    assert found.clock.applied
    assert found.clock.offset_s == pytest.approx(0.3, abs=0.02)
    assert found.lines()[0].startswith("  clock offset: radio ahead by 0.3")
    assert found.lines()[0].endswith(" s (90 %), corrected")


def test_coverage_counts_the_seconds_of_the_drive() -> None:
    t_s = np.arange(0.0, 10.01, 0.1)
    angle_rad = t_s / 10 * 2 * np.pi
    path_m = 20 * np.column_stack([np.cos(angle_rad), np.sin(angle_rad)])
    at_s = np.array([0.1, 0.2, 0.3, 0.4, 2.1, 2.2, 5.5, 5.6, 99.0])
    anchor = np.array([0, 1, 2, 2, 0, 1, 0, 0, 1])
    log = RangeLog(at_s, anchor, np.full(9, 20.0))
    found = observe(Scene("drive", Trajectory(t_s, path_m), log, ("a", "b", "c")))
    assert (found.any_share, found.three_share) == (0.3, 0.1)


def test_anchors_without_enough_ranges_are_left_out() -> None:
    scene = drive_past(circle(400), [(3.0, 0.0)], 40.0)
    log = scene.ranges
    extra = RangeLog(
        np.append(log.t_s, log.t_s[-1]), np.append(log.anchor, 1), np.append(log.range_m, 3.0)
    )
    found = observe(Scene("drive", scene.trajectory, extra, ("a", "b")))
    assert [a.anchor_id for a in found.anchors] == ["a"]


def test_sides_that_are_told_are_right_and_a_straight_road_tells_none() -> None:
    told = 0
    for seed in range(12):
        scene = simulate_pass(PRESETS["lane-closure"], seed=seed)
        assert scene.truth is not None
        views = observe(scene).anchors
        assert [v.anchor_id for v in views] == list(scene.anchor_ids)
        if any(v.side_told for v in views):
            fixes = reconstruct(scene).anchors
            place_m = np.array([fix.position_m for fix in fixes])
            error_m = np.linalg.norm(place_m - scene.truth.anchor_m, axis=1)
            assert error_m[[v.side_told for v in views]].max() < 1.0
            told += sum(v.side_told for v in views)
        straight = observe(simulate_pass(PRESETS["straight"], seed=seed))
        assert not any(v.side_told for v in straight.anchors)
    assert told > 12


def test_words() -> None:
    views = [AnchorView(f"c{k}", 3.0, 150.0, 1.5, 0.0) for k in range(7)]
    found = Observability(CLOCK, 1.0, 0.9, (*views, AnchorView("d", 9.0, 3.0, np.inf, 50.0)))
    assert found.lines()[:2] == [
        "  clock offset: 0 s ± 0.823 s (90 %), not corrected: not significant",
        "  in range: at least one cone for 100% of the drive, at least three for 90%",
    ]
    assert found.lines()[3] == "  c0               3.0 m   150°     1.5   ambiguous"
    assert found.lines()[-2] == "  d                9.0 m     3°     >99   ambiguous"
    poor, note = found.notes()
    assert poor.startswith("d: seen from too few directions")
    seldom = Observability(CLOCK, 1.0, 0.1, found.anchors)
    assert list(seldom.notes()) == [
        poor,
        note,
        "three cones were in range at once for only 10% of the drive",
    ]
    assert note.startswith("c0, c1, c2, c3, c4 and 3 more: the ranges alone do not determine the")
