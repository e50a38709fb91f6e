"""Passes made comparable: frames, the same drive twice, windows of one run."""

from dataclasses import replace

import numpy as np
import pytest

from drives_past import as_scene, make_pass
from gaia_uwb._shared.errors import InputError
from gaia_uwb.denoisers.registry import make_denoiser
from gaia_uwb.locate.passes import (
    all_anchors,
    end_to_end,
    in_one_frame,
    join_windows,
    same_drive,
    starts_s,
    with_anchors,
)
from gaia_uwb.pipeline import prepare
from gaia_uwb.projection import to_geodetic, to_local
from gaia_uwb.scene import LocalFrame, RangeLog
from gaia_uwb.simulate import PRESETS, simulate_zone

ELSEWHERE = LocalFrame(lat_deg=42.01, lon_deg=-93.52, alt_m=280.0)


def scenes():
    return simulate_zone(PRESETS["straight"], seed=0)


def in_frame(scene, frame):
    """Return the same scene as if its log had been recorded in another local frame."""
    path, truth = scene.trajectory, scene.truth
    place = to_geodetic(scene.frame, path.position_m, path.up_m)
    position_m, up_m = to_local(frame, *place)
    anchor_m, anchor_up_m = to_local(
        frame, *to_geodetic(scene.frame, truth.anchor_m, scene.anchor_up_m)
    )
    return replace(
        scene, frame=frame, trajectory=replace(path, position_m=position_m, up_m=up_m),
        truth=replace(truth, anchor_m=anchor_m), anchor_up_m=anchor_up_m,
    )  # fmt: skip


def test_passes_come_in_the_order_of_their_names():
    near, far = scenes()
    assert [scene.name for scene in in_one_frame([far, near])] == [near.name, far.name]


def test_equal_names_are_told_apart():
    near, far = scenes()
    named = in_one_frame([replace(far, name="log"), replace(near, name="log")])
    assert [scene.name for scene in named] == ["log (1)", "log (2)"]


def test_georeferenced_passes_are_brought_into_one_frame():
    near, far = scenes()
    moved = in_frame(far, ELSEWHERE)
    assert np.abs(moved.trajectory.position_m - far.trajectory.position_m).max() > 1000.0
    first, second = in_one_frame([moved, near])
    assert first is near
    assert second.frame == near.frame
    assert second.trajectory.position_m == pytest.approx(far.trajectory.position_m, abs=1e-6)
    assert second.trajectory.up_m == pytest.approx(far.trajectory.up_m, abs=1e-6)
    assert second.anchor_up_m == pytest.approx(far.anchor_up_m, abs=0.05)
    assert second.truth.anchor_m == pytest.approx(far.truth.anchor_m, abs=5e-3)


def test_without_heights_a_pass_is_moved_on_the_ground():
    near, far = scenes()
    moved = in_frame(far, ELSEWHERE)
    flat = replace(moved, trajectory=replace(moved.trajectory, up_m=None), anchor_up_m=None)
    _, second = in_one_frame([near, flat])
    assert second.trajectory.up_m is None
    assert second.trajectory.position_m == pytest.approx(far.trajectory.position_m, abs=0.02)


def test_what_has_no_common_frame_is_refused():
    near, far = scenes()
    with pytest.raises(InputError, match=r"pass-1: not tied to WGS84, but sim-0-0-pass-0 is"):
        in_one_frame([near, replace(far, frame=None)])
    with pytest.raises(InputError, match=r"pass-0: not tied to WGS84, but sim-0-0-pass-1 is"):
        in_one_frame([far, replace(near, frame=None)])
    with pytest.raises(InputError, match="too far from the other passes"):
        in_one_frame([near, replace(far, frame=LocalFrame(lat_deg=48.0, lon_deg=11.0))])
    with pytest.raises(InputError, match="at least one pass"):
        in_one_frame([])


def test_local_frames_are_taken_as_one():
    loose = [replace(scene, frame=None) for scene in scenes()]
    assert in_one_frame(loose) == loose


def test_one_drive_does_not_count_twice():
    near, far = scenes()
    log = near.ranges
    part = slice(len(log) // 3, None)
    later = replace(
        near, name="second half", truth=None,
        ranges=RangeLog(log.t_s[part], log.anchor[part], log.range_m[part]),
    )  # fmt: skip
    assert same_drive(near, near)
    assert same_drive(near, later)
    assert not same_drive(near, far)
    with pytest.raises(InputError, match="pass-0: the same drive as second half"):
        in_one_frame([later, far, near])


def test_rounded_ranges_that_agree_by_chance_are_another_drive():
    one, other = (as_scene(make_pass(seed=seed)) for seed in (0, 1))

    def rounded(scene):
        log = scene.ranges
        return replace(scene, ranges=replace(log, range_m=np.round(log.range_m, 2)))

    one, other = rounded(one), rounded(other)
    assert (one.ranges.range_m == other.ranges.range_m).mean() > 0.03
    assert not same_drive(one, other)


def test_windows_of_one_run_become_the_run():
    run = prepare(as_scene(make_pass()))
    windows = [run.window(60, run.n_steps), run.window(0, 100), run.window(20, 90)]
    (joined,) = join_windows(windows)
    assert joined.name == run.name
    for name in ("t_s", "position_m", "range_m", "valid"):
        assert np.array_equal(getattr(joined, name), getattr(run, name), equal_nan=True)


def test_runs_without_clock_and_calibration_stay_apart():
    one, other = make_pass(0.0), make_pass(3.6)
    assert join_windows([one, other]) == [one, other]


def test_every_pass_gets_all_anchors_of_the_zone():
    one = make_pass(0.0)
    other = make_pass(3.6, np.array([[1.0, 2.0], [-12.0, 6.0]]), ("z", "a"))
    ids = all_anchors([one, other])
    assert ids == ("a", "b", "c", "d", "e", "z")
    wide = with_anchors(other, ids)
    assert np.array_equal(wide.range_m[:, [5, 0]], other.range_m)
    assert not wide.valid[:, 1:5].any()
    assert with_anchors(one, one.anchor_ids) is one


def test_passes_are_laid_end_to_end():
    near, far = (prepare(scene) for scene in scenes())
    joined, ranges = end_to_end([near, far], make_denoiser("raw")([near, far]))
    assert joined.n_steps == near.n_steps + far.n_steps
    assert starts_s([near, far]).tolist() == [0.0, near.t_s[-1] - near.t_s[0] + 1.0]
    assert joined.truth.anchor_m == pytest.approx(near.truth.anchor_m)
    assert np.array_equal(ranges.valid[near.n_steps :], far.valid)
