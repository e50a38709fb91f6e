"""From a Scene to an Episode: exact where it can be, silent where it must be."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from drives_past import read_log
from gaia_uwb._shared.errors import InputError
from gaia_uwb.alignment.timeline import _max_gap_s, align
from gaia_uwb.config import AlignmentConfig
from gaia_uwb.episode import ClockOffset, Episode, ReadingCounts
from gaia_uwb.scene import RangeLog, Scene, Trajectory, Truth
from gaia_uwb.simulate import PRESETS, simulate_pass

CONES_M = np.array([[0.0, 4.0], [12.0, 5.0], [25.0, 4.5]])
CONES_UP_M = np.array([0.9, 0.9, 0.4])
SPEED_MPS = 20.0
TRUSTED = AlignmentConfig(clock_offset="off")
SIMULATED = simulate_pass(PRESETS["lane-closure"], seed=2)


def position_m(t_s: np.ndarray) -> np.ndarray:
    """Drive straight past the cones; at 0 s beside the first."""
    return np.stack([SPEED_MPS * t_s, 0.02 * SPEED_MPS * t_s], axis=-1)


def true_range_m(t_s: np.ndarray) -> np.ndarray:
    """Return the slant ranges to the cones, one column each."""
    delta_m = position_m(t_s)[:, None] - CONES_M
    return np.sqrt((delta_m**2).sum(axis=-1) + (1.6 - CONES_UP_M) ** 2)


def drive_past(
    *,
    path_hz: float = 8.0,
    range_hz: float = 10.0,
    offset_s: float = 0.0,
    read: tuple[float, float] = (-4.0, 4.0),
) -> Scene:
    """Make a log without noise: path from -4 s to 4 s, all cones read together."""
    path_s = np.arange(round(8 * path_hz) + 1) / path_hz - 4.0
    at_s = np.arange(read[0], read[1], 1.0 / range_hz) + 0.013
    stamps_s = np.repeat(at_s[:, None], 3, axis=1) + offset_s
    return Scene(
        name="pass",
        trajectory=Trajectory(path_s, position_m(path_s), np.full(len(path_s), 1.6)),
        ranges=read_log(stamps_s, true_range_m(at_s)),
        anchor_ids=("a", "b", "c"),
        anchor_up_m=CONES_UP_M,
    )


def only(scene: Scene, keep: np.ndarray) -> Scene:
    log = scene.ranges
    return replace(scene, ranges=RangeLog(log.t_s[keep], log.anchor[keep], log.range_m[keep]))


def without(scene: Scene, start_s: float, stop_s: float, anchor: int | None = None) -> Scene:
    """Leave out readings between two times, both exclusive; of one anchor or of all."""
    log = scene.ranges
    hit = (log.t_s > start_s) & (log.t_s < stop_s)
    return only(scene, ~hit if anchor is None else ~(hit & (log.anchor == anchor)))


def test_a_noise_free_pass_at_speed_comes_back_to_the_millimetre() -> None:
    episode = align(drive_past(), TRUSTED)
    assert episode.anchor_ids == ("a", "b", "c")
    assert episode.valid[1:-1].all()
    np.testing.assert_allclose(
        episode.range_m[episode.valid], true_range_m(episode.t_s)[episode.valid], atol=1e-3
    )


def test_a_gap_at_the_closest_approach_is_bridged_along_the_path() -> None:
    scene = without(drive_past(), -0.45, 0.40, anchor=0)
    gap_s = np.diff(scene.ranges.t_s[scene.ranges.anchor == 0]).max()
    assert gap_s == pytest.approx(0.9)
    episode = align(scene, TRUSTED)
    inside = np.abs(episode.t_s) < 0.4
    np.testing.assert_allclose(
        episode.range_m[inside], true_range_m(episode.t_s[inside]), atol=1e-3
    )
    # A straight line across the gap is off by metres: that is what the pose is for.
    ends_m = true_range_m(np.array([-0.487, 0.413]))[:, 0]
    assert (ends_m.mean() - true_range_m(np.zeros(1))[0, 0]) > 4.0


@pytest.mark.parametrize(("max_gap_s", "bridged"), [(0.9, True), (0.89, False)])
@pytest.mark.parametrize("epoch_s", [0.0, 1.73e9])
def test_the_longest_gap_that_is_bridged(max_gap_s: float, bridged: bool, epoch_s: float) -> None:
    scene = without(drive_past(), -0.45, 0.40, anchor=0)
    later = replace(
        scene,
        trajectory=replace(scene.trajectory, t_s=scene.trajectory.t_s + epoch_s),
        ranges=replace(scene.ranges, t_s=scene.ranges.t_s + epoch_s),
    )
    episode = align(later, TRUSTED.model_copy(update={"max_gap_s": max_gap_s}))
    inside = np.abs(episode.t_s - epoch_s) < 0.4
    assert inside.sum() >= 6
    assert (episode.valid[inside, 0] == bridged).all()
    assert episode.valid[inside, 1:].all()


def test_the_offset_is_found_and_taken_out() -> None:
    episode = align(SIMULATED)
    assert episode.clock.applied
    error_m = (episode.range_m - episode.truth.range_m)[episode.valid & ~episode.truth.nlos]
    assert abs(np.median(error_m)) < 0.03
    late = align(SIMULATED, TRUSTED)
    late_m = (late.range_m - late.truth.range_m)[late.valid & ~late.truth.nlos]
    assert np.median(np.abs(error_m)) < 0.2 * np.median(np.abs(late_m))


@pytest.mark.parametrize("offset_s", [0.25, -0.5])
def test_stamps_are_shifted_by_the_offset_that_is_applied(
    offset_s: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    plain = align(drive_past(), TRUSTED)
    known = ClockOffset(offset_s, 0.0, True, "known")
    monkeypatch.setattr("gaia_uwb.alignment.timeline.estimate_clock_offset", lambda *_: known)
    shifted = align(drive_past(offset_s=offset_s))
    np.testing.assert_allclose(shifted.range_m, plain.range_m, atol=1e-6)
    assert shifted.clock is known


def test_steps_in_an_outage_are_absent_and_readings_in_it_unusable() -> None:
    path = SIMULATED.trajectory
    there = (path.t_s <= 25.0) | (path.t_s >= 35.0)
    broken = Trajectory(path.t_s[there], path.position_m[there], path.up_m[there])
    scene = replace(SIMULATED, trajectory=broken)
    episode = align(scene)
    assert not ((episode.t_s > 25.0) & (episode.t_s < 35.0)).any()
    assert {25.0, 35.0} <= set(episode.t_s.tolist())  # the samples themselves are known
    log = scene.ranges
    inside = (log.t_s > 25.0 + 0.3) & (log.t_s < 35.0 + 0.1)
    junk = replace(log, range_m=np.where(inside, 999.0, log.range_m))
    assert np.array_equal(
        align(replace(scene, ranges=junk)).range_m, episode.range_m, equal_nan=True
    )


def test_readings_outside_the_trajectory_are_not_used() -> None:
    scene = drive_past(read=(-9.0, 9.0))
    log = scene.ranges
    outside = np.abs(log.t_s) > 4.0
    junk = replace(log, range_m=np.where(outside, 500.0, log.range_m))
    episode = align(replace(scene, ranges=junk), TRUSTED)
    expected = align(only(scene, ~outside), TRUSTED)
    assert np.array_equal(episode.range_m, expected.range_m, equal_nan=True)


def test_no_range_is_made_up_before_the_first_or_after_the_last_reading() -> None:
    episode = align(drive_past(read=(-2.0, 2.0)), TRUSTED)
    covered = (episode.t_s >= -1.987) & (episode.t_s <= 1.913)
    assert np.array_equal(episode.valid, np.repeat(covered[:, None], 3, axis=1))


def test_a_slow_trajectory_is_subdivided() -> None:
    episode = align(drive_past(path_hz=1.0, range_hz=20.0), TRUSTED)
    np.testing.assert_allclose(episode.t_s, np.arange(-80, 81) / 20, atol=1e-9)
    np.testing.assert_allclose(episode.position_m, position_m(episode.t_s), atol=1e-9)
    np.testing.assert_allclose(
        episode.range_m[episode.valid], true_range_m(episode.t_s)[episode.valid], atol=1e-3
    )


def test_a_fast_trajectory_is_thinned() -> None:
    scene = drive_past(path_hz=100.0, range_hz=5.0)
    episode = align(scene, TRUSTED)
    assert np.array_equal(episode.t_s, scene.trajectory.t_s[::20])
    np.testing.assert_allclose(
        episode.range_m[episode.valid], true_range_m(episode.t_s)[episode.valid], atol=1e-3
    )


@pytest.mark.parametrize(
    ("path_hz", "range_hz", "step_s"),
    [
        (8.0, 10.0, 1 / 8),
        (10.0, 5.1, 1 / 10),
        (10.0, 5.0, 1 / 5),
        (5.0, 9.9, 1 / 5),
        (5.0, 10.0, 0.1),
    ],
)
def test_the_timeline_follows_the_path_unless_the_rates_differ_by_two(
    path_hz: float, range_hz: float, step_s: float
) -> None:
    episode = align(drive_past(path_hz=path_hz, range_hz=range_hz), TRUSTED)
    np.testing.assert_allclose(np.diff(episode.t_s), step_s, atol=1e-9)


def sampled_at(path_s: np.ndarray, range_hz: float = 10.0) -> Scene:
    """Return the drive with poses at given times instead."""
    path = Trajectory(path_s, position_m(path_s), np.full(len(path_s), 1.6))
    return replace(drive_past(range_hz=range_hz), trajectory=path)


def assert_ranges_are_true(episode: Episode) -> None:
    np.testing.assert_allclose(
        episode.range_m[episode.valid], true_range_m(episode.t_s)[episode.valid], atol=1e-3
    )


@pytest.mark.parametrize("pause_s", [0.1, 0.5, 1.0])
def test_a_path_logged_in_bursts(pause_s: float) -> None:
    """Five poses within 4 ms, then nothing: as many steps as the ranges are worth."""
    first_s = np.arange(-4.0, 4.0 + 1e-9, pause_s)
    episode = align(sampled_at((first_s[:, None] + 1e-3 * np.arange(5)).ravel()), TRUSTED)
    step_s = np.diff(episode.t_s)
    assert 0.05 < step_s.min() < step_s.max() < 0.2
    assert episode.valid[2:-2].all()
    assert_ranges_are_true(episode)


def test_ranges_logged_in_bursts() -> None:
    """Readings that come five at once, once a second, ask for no timeline of milliseconds."""
    scene = drive_past()
    first_s = np.arange(-4.0, 4.0)
    at_s = (first_s[:, None] + 1e-3 * np.arange(5)).ravel() + 0.013
    log = read_log(np.repeat(at_s[:, None], 3, axis=1), true_range_m(at_s))
    episode = align(replace(scene, ranges=log), TRUSTED)
    assert np.diff(episode.t_s).min() > 0.5
    assert episode.valid[1:-1].all()
    assert_ranges_are_true(episode)


@pytest.mark.parametrize("rates_hz", [(100.0, 10.0), (2.0, 10.0), (1.0, 100.0)])
def test_a_path_whose_rate_changes_half_way(rates_hz: tuple[float, float]) -> None:
    before_hz, after_hz = rates_hz
    path_s = np.concatenate(
        [np.arange(-4.0, 0.0, 1.0 / before_hz), np.arange(0.0, 4.0 + 1e-9, 1.0 / after_hz)]
    )
    episode = align(sampled_at(path_s), TRUSTED)
    np.testing.assert_allclose(np.diff(episode.t_s), 0.1, atol=1e-6)
    assert_ranges_are_true(episode)


def test_a_sample_that_the_path_lacks_makes_no_steps() -> None:
    path_s = np.delete(np.arange(81) / 10.0 - 4.0, [30, 31])
    assert np.array_equal(align(sampled_at(path_s), TRUSTED).t_s, path_s)


def test_no_step_is_where_the_path_is_unknown() -> None:
    """A wrong stamp may be years away: nothing is laid out for the time in between."""
    path_s = np.array([-4.0, -3.5, -3.0, 3e8, 6e8, 9e8])
    assert np.diff(align(sampled_at(path_s), TRUSTED).t_s).max() > 2e8


@pytest.mark.parametrize("range_hz", [0.5, 0.9, 2.0])
def test_the_gap_follows_the_rate_of_each_anchor(range_hz: float) -> None:
    """Of a radio that answers seldom no reading is thrown away for that."""
    t_s = np.arange(0.0, 120.0, 0.1)
    path_m = np.column_stack([3.0 * t_s, 6.0 * np.sin(t_s / 5.0)])
    cones_m = np.array([[60.0, 9.0], [180.0, 9.0]])
    often_s, seldom_s = np.arange(0.0, 119.0, 0.1), np.arange(0.05, 119.0, 1.0 / range_hz)
    own_s = np.concatenate([often_s, seldom_s])
    order = np.argsort(own_s)
    own_s, anchor = own_s[order], np.repeat([0, 1], [len(often_s), len(seldom_s)])[order]
    at_m = np.stack([np.interp(own_s, t_s, axis) for axis in path_m.T], axis=1)
    log = RangeLog(own_s, anchor, np.hypot(*(at_m - cones_m[anchor]).T))
    scene = Scene("drive", Trajectory(t_s, path_m), log, ("often", "seldom"))
    episode = align(scene, TRUSTED)
    often, seldom = episode.readings["often"], episode.readings["seldom"]
    assert (seldom.in_log, seldom.kept) == (len(seldom_s), len(seldom_s))
    assert seldom.n_steps > 3 * seldom.kept  # steps are no readings
    assert episode.n_readings.tolist() == [often.kept, seldom.kept]
    error_m = episode.range_m - np.linalg.norm(episode.position_m[:, None] - cones_m, axis=2)
    assert np.nanmax(np.abs(error_m)) < 0.1
    # What is often read has its gaps as before, and a number that is given holds for all.
    fixed = align(scene, TRUSTED.model_copy(update={"max_gap_s": 0.3})).readings
    assert fixed["seldom"].kept == 0
    assert fixed["seldom"].in_gaps == len(seldom_s)
    assert fixed["often"] == often


@pytest.mark.parametrize(("range_hz", "bridged_s"), [(10.0, 1.0), (1.0, 3.0), (0.3, 8.0)])
def test_how_long_a_gap_is_bridged(range_hz: float, bridged_s: float) -> None:
    assert _max_gap_s(np.arange(0.0, 60.0, 1.0 / range_hz), TRUSTED) == pytest.approx(bridged_s)


def test_what_becomes_of_every_reading() -> None:
    scene = drive_past(read=(-6.0, 5.0))  # the path spans -4 to 4 s
    log = scene.ranges
    range_m = log.range_m.copy()
    range_m[(log.anchor == 1) & (np.abs(log.t_s) < 0.11)] -= 6.0
    scene = replace(scene, ranges=replace(log, range_m=range_m))
    lonely = without(without(scene, -3.4, 0.0, anchor=2), 0.05, 3.4, anchor=2)
    episode = align(lonely, TRUSTED)
    a, b, c = (episode.readings[name] for name in "abc")
    assert a == ReadingCounts(110, 80, 0, 0, 30, n_steps=63)
    assert b == ReadingCounts(110, 78, 2, 0, 30, n_steps=63)
    assert (c.kept + c.spikes + c.in_gaps + c.outside, c.in_gaps) == (c.in_log, 1)
    assert episode.n_readings.tolist() == [a.kept, b.kept, c.kept]


def test_a_window_has_its_share_of_the_readings() -> None:
    episode = align(drive_past(), TRUSTED)
    halves = episode.windows(32)
    assert sum(half.n_readings for half in halves).tolist() == pytest.approx([80, 80, 80], abs=2)
    assert halves[0].n_readings[0] == pytest.approx(40, abs=2)
    assert replace(halves[0], readings={}).n_readings[0] == halves[0].valid[:, 0].sum()


def test_stamps_that_hardly_move_make_no_endless_timeline() -> None:
    scene = drive_past()
    log = replace(scene.ranges, t_s=1e-9 * np.arange(len(scene.ranges)))
    assert len(align(replace(scene, ranges=log), TRUSTED).t_s) <= 8000 + 1


def test_the_nearest_reading() -> None:
    scene = drive_past()
    config = TRUSTED.model_copy(update={"resample": "nearest", "max_gap_s": 0.2, "gate": False})
    episode = align(without(scene, -1.0, 0.0), config)
    own_s = np.unique(scene.ranges.t_s)
    own_s = own_s[(own_s <= -1.0) | (own_s >= 0.0)]
    distance_s = np.abs(episode.t_s[:, None] - own_s)
    near = distance_s.argmin(axis=1)
    close = distance_s.min(axis=1) <= 0.1
    assert np.array_equal(episode.valid, np.repeat(close[:, None], 3, axis=1))
    assert 0 < close.sum() < len(close)
    assert np.array_equal(episode.range_m[close], true_range_m(own_s)[near[close]])


@pytest.mark.parametrize("resample", ["linear", "nearest"])
def test_the_gate_takes_spikes_out_unless_it_is_off(resample: str) -> None:
    scene = drive_past()
    log = scene.ranges
    range_m = log.range_m.copy()
    hit = np.flatnonzero(log.anchor == 1)[[0, 1, 30, 31, 32, 55]]
    range_m[hit] -= np.array([6.0, 6.0, 7.0, 7.0, 7.0, -46.0])
    spiky = replace(scene, ranges=replace(log, range_m=range_m))
    config = TRUSTED.model_copy(update={"resample": resample})
    gated = align(spiky, config)
    clean = align(scene, config)
    both = gated.valid & clean.valid
    tolerance_m = 0.01 if resample == "linear" else 0.25 * SPEED_MPS
    assert np.abs(gated.range_m - clean.range_m)[both].max() < tolerance_m
    raw = align(spiky, config.model_copy(update={"gate": False}))
    assert np.nanmax(np.abs(raw.range_m - clean.range_m)[:, 1]) > 5.0


def test_anchors_with_few_or_no_readings() -> None:
    scene = drive_past()
    log = scene.ranges
    few = np.flatnonzero(log.anchor == 1)[[40, 41, 42]]
    keep = log.anchor == 0
    keep[few] = True
    episode = align(only(scene, keep), TRUSTED)
    assert not episode.valid[:, 2].any()
    between = (episode.t_s >= log.t_s[few[0]]) & (episode.t_s <= log.t_s[few[2]])
    assert between.any()
    assert np.array_equal(episode.valid[:, 1], between)
    np.testing.assert_allclose(
        episode.range_m[between, 1], true_range_m(episode.t_s[between])[:, 1], atol=0.1
    )


def test_one_anchor() -> None:
    scene = drive_past()
    own = scene.ranges.anchor == 0
    one = replace(only(scene, own), anchor_ids=("a",), anchor_up_m=CONES_UP_M[:1])
    np.testing.assert_array_equal(align(one, TRUSTED).range_m, align(scene, TRUSTED).range_m[:, :1])


def test_single_readings_count_where_they_were_taken() -> None:
    scene = drive_past()
    at_s = scene.trajectory.t_s[20]
    log = RangeLog(np.full(3, at_s), np.arange(3), np.array([5.0, 6.0, 7.0]))
    episode = align(replace(scene, ranges=log), TRUSTED)
    assert np.array_equal(episode.t_s, scene.trajectory.t_s)
    assert np.array_equal(np.flatnonzero(episode.valid.any(axis=1)), [20])
    assert episode.range_m[20].tolist() == [5.0, 6.0, 7.0]


def test_a_path_of_two_samples() -> None:
    scene = drive_past()
    ends_s = np.array([-4.0, 4.0])
    path = Trajectory(ends_s, position_m(ends_s), np.full(2, 1.6))
    episode = align(
        replace(scene, trajectory=path), AlignmentConfig(max_pose_gap_s=8.0, max_clock_offset_s=0.2)
    )
    assert episode.n_steps == 81
    assert not episode.clock.applied
    np.testing.assert_allclose(
        episode.range_m[episode.valid], true_range_m(episode.t_s)[episode.valid], atol=1e-3
    )


@pytest.mark.parametrize("offset_s", [3600.0, -3600.0])
def test_clocks_an_hour_apart(offset_s: float) -> None:
    with pytest.raises(InputError, match=r"^pass, column t_s: the clocks do not overlap: the tra"):
        align(drive_past(offset_s=offset_s))


def test_clocks_that_only_a_search_could_bring_together() -> None:
    with pytest.raises(InputError, match="no usable ranges"):
        align(drive_past(offset_s=9.0))
    with pytest.raises(InputError, match=r"spans -4\.000 to 4\.000 s, the ranges span 5\.013 to"):
        align(drive_past(offset_s=9.0), TRUSTED)


def test_a_path_so_sparse_that_no_range_is_usable() -> None:
    scene = drive_past()
    sparse = Trajectory(np.array([-4.0, 4.0]), position_m(np.array([-4.0, 4.0])))
    with pytest.raises(
        InputError, match="pass: no usable ranges: no two readings are close enough"
    ):
        align(replace(scene, trajectory=sparse))


@pytest.mark.parametrize("preset", ["lane-closure", "straight"])
def test_the_truth_has_no_influence(preset: str) -> None:
    scene = simulate_pass(PRESETS[preset], seed=4)
    told, blind = align(scene), align(scene.without_truth())
    assert blind.truth is None
    assert told.clock == blind.clock
    for name in ("t_s", "position_m", "range_m", "valid", "tag_up_m"):
        assert np.array_equal(getattr(told, name), getattr(blind, name), equal_nan=True)


def test_the_truth_on_the_timeline() -> None:
    scene = drive_past(offset_s=0.5)
    nlos = scene.ranges.t_s - 0.5 > 1.0
    nlos &= scene.ranges.anchor == 2
    told = replace(scene, truth=Truth(CONES_M, nlos=nlos))
    episode = align(told, TRUSTED)
    np.testing.assert_allclose(episode.truth.range_m, true_range_m(episode.t_s))
    expected = episode.t_s > 1.0 + 0.5
    assert not episode.truth.nlos[:, :2].any()
    assert (episode.truth.nlos[:, 2] == expected).mean() > 0.98
    assert not align(replace(scene, truth=Truth(CONES_M)), TRUSTED).truth.nlos.any()


def test_heights_and_frame_are_carried_over() -> None:
    episode = align(SIMULATED)
    assert episode.frame is SIMULATED.frame
    assert np.array_equal(episode.anchor_up_m, SIMULATED.anchor_up_m)
    assert (episode.tag_up_m == 1.6).all()
    flat = replace(SIMULATED.trajectory, up_m=None)
    assert align(replace(SIMULATED, trajectory=flat)).tag_up_m is None


def test_turning_moving_and_shifting_the_scene_leaves_the_ranges() -> None:
    turn = np.array([[0.0, -1.0], [1.0, 0.0]])
    path, log = SIMULATED.trajectory, SIMULATED.ranges
    moved = replace(
        SIMULATED,
        trajectory=Trajectory(path.t_s + 1e6, path.position_m @ turn.T + 500.0, path.up_m),
        ranges=replace(log, t_s=log.t_s + 1e6),
        truth=None,
    )
    expected, episode = align(SIMULATED), align(moved)
    assert np.array_equal(episode.valid, expected.valid)
    np.testing.assert_allclose(episode.range_m, expected.range_m, atol=1e-3)


def test_blocks_make_no_difference(monkeypatch: pytest.MonkeyPatch) -> None:
    expected = align(SIMULATED, TRUSTED)
    monkeypatch.setattr("gaia_uwb.alignment.readings._BLOCK", 1)
    episode = align(SIMULATED, TRUSTED)
    assert np.array_equal(episode.range_m, expected.range_m, equal_nan=True)
    assert np.array_equal(episode.truth.nlos, expected.truth.nlos)


@pytest.mark.real_data
def test_the_outdoor_windows(outdoor_dir: Path) -> None:
    from gaia_uwb.logs import outdoor_uwb

    runs = [align(scene) for scene in outdoor_uwb.load(outdoor_dir / "outdoor-uwb")]
    windows = [window for run in runs for window in run.windows(64)]
    assert len(windows) == 223
    assert sum(not window.valid.any() for window in windows) == 9
    error2_m2 = [
        ((w.range_m - w.truth.range_m)[w.valid] ** 2).mean() for w in windows if w.valid.any()
    ]
    assert np.mean(error2_m2) < 0.022


def test_a_parked_vehicle_is_refused() -> None:
    with pytest.raises(InputError, match=r"hardly moves: its path spans 0\.\d+ m"):
        align(simulate_pass(PRESETS["parked"], seed=0))
