"""A simulated day at one zone, and the truth of what changed."""

from __future__ import annotations

import numpy as np
import pytest

from gaia_uwb import ConfigError
from gaia_uwb.simulate import LATE_VEHICLE, LYING_VEHICLE, PRESETS, simulate_day, simulate_zone


@pytest.fixture(scope="module")
def day():
    return simulate_day(PRESETS["lane-closure"], seed=2, n_drives=24)


def readings(scene, name):
    own = scene.ranges.anchor == scene.anchor_ids.index(name)
    return scene.ranges.range_m[own], scene.truth.range_m[own]


def test_drives_follow_each_other_and_changes_lie_between_them(day):
    ends_s = [scene.ranges.t_s[-1] for scene in day.scenes]
    assert (np.diff(ends_s) > 500.0).all()
    assert sorted(change.kind for change in day.changes) == ["added", "moved", "removed"]
    assert len({change.anchor_id for change in day.changes}) == 3
    for change in day.changes:
        before, after = day.scenes[change.drive - 1], day.scenes[change.drive]
        assert before.ranges.t_s[-1] < change.at_s < after.ranges.t_s[0]


def test_cones_are_heard_where_and_when_they_are_there(day):
    for change in day.changes:
        heard = [len(readings(scene, change.anchor_id)[0]) > 0 for scene in day.scenes]
        there = [k >= change.drive for k in range(len(day.scenes))]
        expected = {"added": there, "removed": [not each for each in there], "moved": [True] * 24}
        assert heard == expected[change.kind]


def test_a_moved_cone_is_a_metre_away_and_keeps_its_errors(day):
    (moved,) = [change for change in day.changes if change.kind == "moved"]
    before, after = (day.scenes[moved.drive + k].truth.anchor_m for k in (-1, 0))
    n = day.scenes[0].anchor_ids.index(moved.anchor_id)
    assert np.hypot(*(after[n] - before[n])) == pytest.approx(1.0)
    np.testing.assert_array_equal(after[n], moved.place_m)
    drives = [k for k in range(moved.drive, 24) if day.scenes[k].vehicle == "vehicle-1"]
    range_m, true_m = readings(day.scenes[drives[0]], moved.anchor_id)
    assert abs(np.median(range_m - true_m)) < 0.4
    assert np.std(range_m - true_m) > 0.02


def test_one_vehicle_has_another_clock_and_one_is_elsewhere(day):
    offset_s = {}
    for scene in day.scenes:
        offset_s.setdefault(scene.vehicle, set()).add(round(scene.truth.clock_offset_s, 6))
    assert all(len(each) == 1 for each in offset_s.values())
    assert {LATE_VEHICLE, LYING_VEHICLE} < set(offset_s)
    at_m = {}
    for scene in day.scenes:
        middle_m = np.median(scene.trajectory.position_m, axis=0)
        at_m.setdefault(scene.vehicle == LYING_VEHICLE, []).append(middle_m)
    assert len(at_m[True]) == 2


def test_the_same_seed_gives_the_same_day(day):
    again = simulate_day(PRESETS["lane-closure"], seed=2, n_drives=24)
    assert [c.drive for c in again.changes] == [c.drive for c in day.changes]
    for one, other in zip(day.scenes, again.scenes, strict=True):
        np.testing.assert_array_equal(one.ranges.range_m, other.ranges.range_m)


def test_before_the_first_change_drives_are_those_of_the_zone(day):
    first = min(change.drive for change in day.changes)
    lanes_m = [0.0, 3.6]
    plain = simulate_zone(
        PRESETS["lane-closure"], seed=2, lanes_m=lanes_m, vehicles=["vehicle-1", "vehicle-2"]
    )
    added = {change.anchor_id for change in day.changes if change.kind == "added"}
    assert first > 2
    for name in set(plain[0].anchor_ids) - added:
        np.testing.assert_allclose(readings(plain[0], name)[0], readings(day.scenes[0], name)[0])


def test_a_day_whose_moved_cone_loses_readings_is_whole():
    found = simulate_day(PRESETS["lane-closure"], seed=500)
    lengths = {(len(s.ranges), len(s.truth.range_m), len(s.truth.nlos)) for s in found.scenes}
    assert all(len(set(each)) == 1 for each in lengths)


def test_a_day_needs_drives(day):
    with pytest.raises(ConfigError, match="at least 20 drives"):
        simulate_day(PRESETS["lane-closure"], seed=2, n_drives=10)
