"""A zone in a folder: results, order, withdrawing, killed programs and wrong logs."""

from __future__ import annotations

import multiprocessing
import os
import random
import signal
import time
from dataclasses import replace

import numpy as np
import pytest

import gaia_uwb
from gaia_uwb import ConfigError, InputError
from gaia_uwb.config import PipelineConfig, make_config
from gaia_uwb.kept import Zone
from gaia_uwb.outputs import write_all
from gaia_uwb.simulate import PRESETS, simulate_zone
from killed_runs import files_of
from roads import road_drives

LANES_M = (0.0, 3.6, 0.2, 3.4, -0.1, 3.7)


def drives(preset="lane-closure", seed=3, lanes_m=LANES_M):
    scenes = simulate_zone(PRESETS[preset], seed=seed, lanes_m=lanes_m)
    return [at(scene, 1000.0 * number) for number, scene in enumerate(scenes)]


def at(scene, later_s):
    """Return a log that was recorded later."""
    path = replace(scene.trajectory, t_s=scene.trajectory.t_s + later_s)
    return replace(
        scene, trajectory=path, ranges=replace(scene.ranges, t_s=scene.ranges.t_s + later_s)
    )


@pytest.fixture(scope="module")
def six():
    return drives()


@pytest.fixture(scope="module")
def undisturbed(six, tmp_path_factory):
    zone = Zone.create(tmp_path_factory.mktemp("zone") / "zone", frame=six[0].frame)
    for scene in six:
        zone.add(scene)
    return zone


def bytes_of(zone):
    """Return what lies there under final names: a killed program leaves a hidden file at most."""
    return files_of(zone.folder)


def new_zone(folder, scenes):
    return Zone.create(folder, frame=scenes[0].frame)


@pytest.mark.parametrize("n", [1, 2, 4])
def test_a_few_drives_give_what_they_give_together(n, six, tmp_path):
    zone = new_zone(tmp_path / "zone", six)
    zone.add(six[:n])
    found, expected = zone.result(), gaia_uwb.reconstruct(six[:n])
    assert found.status is expected.status
    assert found.reasons == expected.reasons
    for mine, other in zip(found.anchors, expected.anchors, strict=True):
        np.testing.assert_array_equal(mine.position_m, other.position_m)
        np.testing.assert_array_equal(mine.covariance_m2, other.covariance_m2)
        assert mine.n_ranges == other.n_ranges


def test_many_drives_give_about_that(undisturbed, six):
    found, expected = undisturbed.result(), gaia_uwb.reconstruct(six)
    assert found.status is expected.status
    of = {fix.anchor_id: fix for fix in expected.anchors}
    for fix in found.anchors:
        other = of[fix.anchor_id]
        within_m = 0.5 * other.semi_axes_90_m[0]
        assert np.hypot(*(fix.position_m - other.position_m)) < within_m
        assert fix.n_ranges == other.n_ranges
        assert fix.status is other.status
    assert len(found.passes) == 4


def test_a_result_can_be_written(undisturbed, tmp_path):
    paths = write_all(undisturbed.result(), tmp_path / "out", None)
    assert {"boundary.geojson", "report.json"} <= {path.name for path in paths}


def test_two_drives_with_several_tags_are_passes_of_their_tags(tmp_path):
    scenes = drives("two-tags", lanes_m=LANES_M[:5])
    zone = new_zone(tmp_path / "zone", scenes)
    zone.add(scenes)
    found, expected = zone.result(), gaia_uwb.reconstruct(scenes)
    apart_m = [
        np.hypot(*(mine.position_m - other.position_m))
        for mine, other in zip(found.anchors, expected.anchors, strict=True)
    ]
    assert np.median(apart_m) < 0.05


def test_the_order_of_adding_does_not_show(undisturbed, six, tmp_path):
    zone = new_zone(tmp_path / "zone", six)
    zone.add([six[4], six[0], six[2]])
    zone.add(six[5])
    zone.add([six[3], six[1]])
    assert bytes_of(zone) == bytes_of(undisturbed)
    assert [drive.name for drive in zone.drives] == [scene.name for scene in six]


def test_a_drive_that_is_taken_out_was_never_there(undisturbed, six, tmp_path):
    zone = new_zone(tmp_path / "zone", six)
    other = drives(seed=4)[0]
    other = at(replace(other, frame=six[0].frame), 4500.0)
    zone.add([*six[:5], other])
    zone.withdraw(other.name)
    zone.add(six[5])
    assert bytes_of(zone) == bytes_of(undisturbed)
    with pytest.raises(InputError, match="has no drive 'nobody'"):
        zone.withdraw("nobody")


def test_another_process_adds_and_we_see_it(six, tmp_path):
    zone = new_zone(tmp_path / "zone", six)
    Zone.open(tmp_path / "zone").add(six[0])
    zone.add(six[1])
    assert [drive.name for drive in zone.drives] == [scene.name for scene in six[:2]]


def _add(folder, scenes):
    zone = Zone.open(folder)
    there = {drive.name for drive in zone.drives}
    for scene in scenes:
        if scene.name not in there:
            zone.add(scene)


@pytest.mark.skipif(os.name != "posix", reason="needs SIGKILL")
def test_killed_at_any_moment_it_ends_with_the_same_bytes(undisturbed, six, tmp_path):
    kills = int(os.environ.get("GAIA_KILLS", "12"))
    context = multiprocessing.get_context("fork")
    draw, folder = random.Random(1), tmp_path / "zone"
    Zone.create(folder, frame=six[0].frame)
    killed = 0
    while killed < kills:
        process = context.Process(target=_add, args=(folder, six))
        process.start()
        time.sleep(draw.uniform(0.0, 0.6))
        if not process.is_alive():  # all drives are in: begin again
            process.join()
            for drive in Zone.open(folder).drives[2:]:
                Zone.open(folder).withdraw(drive.name)
            continue
        os.kill(process.pid, signal.SIGKILL)
        process.join()
        killed += 1
        Zone.open(folder).result() if Zone.open(folder).drives else None
    _add(folder, six)
    zone = Zone.open(folder)
    assert bytes_of(zone) == bytes_of(undisturbed)


def test_logs_that_cannot_go_in_are_refused(undisturbed, six, tmp_path):
    before = bytes_of(undisturbed)
    with pytest.raises(InputError, match="is in the zone already"):
        undisturbed.add(six[2])
    with pytest.raises(InputError, match="is in the zone already"):
        undisturbed.add(replace(six[2], name="the same under another name"))
    with pytest.raises(InputError, match="not tied to WGS84, but the zone is"):
        undisturbed.add(replace(six[2], name="loose", frame=None))
    assert bytes_of(undisturbed) == before


def test_a_zone_in_local_metres_takes_no_drive_on_the_earth(six, tmp_path):
    zone = Zone.create(tmp_path / "zone")
    with pytest.raises(InputError, match="tied to WGS84, but the zone is not"):
        zone.add(six[0])
    zone.add(replace(six[0], frame=None))
    assert zone.result().episode.frame is None


def test_drives_of_other_frames_are_carried_into_the_zones(tmp_path):
    one, other = road_drives("two lanes", seed=1)
    frame = replace(one.frame, lat_deg=one.frame.lat_deg + 0.001)
    zone = Zone.create(tmp_path / "zone", frame=frame)
    zone.add(one)
    assert zone.result().episode.frame == frame
    assert zone.frame == frame
    zone.add(other)
    assert len(zone.result().passes) == 2


def test_settings_stay(six, tmp_path):
    config = make_config({"denoiser": "raw", "solver": {"position_floor_m": 0.01}})
    Zone.create(tmp_path / "zone", frame=six[0].frame, config=config)
    assert Zone.open(tmp_path / "zone").config == config


def test_folders_that_hold_something_else_are_left_alone(six, tmp_path):
    (tmp_path / "note.txt").write_text("theirs")
    with pytest.raises(ConfigError, match=r"holds note\.txt"):
        new_zone(tmp_path, six)
    with pytest.raises(InputError, match="cannot be read"):
        Zone.open(tmp_path)
    with pytest.raises(ConfigError, match="measured ranges"):
        Zone.create(tmp_path / "zone", config=PipelineConfig(denoiser="median"))
    with pytest.raises(InputError, match="no drives"):
        new_zone(tmp_path / "new", six).result()
