"""A drive whose readings and positions come in batches."""

from __future__ import annotations

import numpy as np
import pytest

from gaia_uwb import InputError, reconstruct
from gaia_uwb.config import PipelineConfig
from gaia_uwb.kept import Zone
from gaia_uwb.scene import Scene
from gaia_uwb.simulate import PRESETS, simulate_pass

RAW = PipelineConfig(denoiser="raw")


@pytest.fixture(scope="module")
def log():
    scene = simulate_pass(PRESETS["lane-closure"], seed=5)
    return Scene("drive", scene.trajectory, scene.ranges, scene.anchor_ids, frame=scene.frame)


def batches(log, size=300):
    names = np.array(log.anchor_ids)[log.ranges.anchor]
    for first in range(0, len(log.ranges), size):
        rows = slice(first, first + size)
        yield {
            "t_s": log.ranges.t_s[rows],
            "anchor_ids": names[rows].tolist(),
            "range_m": log.ranges.range_m[rows],
        }


def test_it_has_a_result_while_it_goes_on_and_counts_once_when_it_ends(log, tmp_path):
    zone = Zone.create(tmp_path / "zone", frame=log.frame, config=RAW)
    drive = zone.start("drive")
    drive.add_poses(t_s=log.trajectory.t_s, position_m=log.trajectory.position_m)
    parts = list(batches(log))
    for part in parts[:-1]:
        drive.add_ranges(**part)
    assert len(drive.result().anchors) == log.n_anchors
    assert zone.drives == ()
    drive.add_ranges(**parts[-1])
    drive.add_ranges(**parts[0])  # the network delivers a batch twice
    drive.end(ended_s=1e9)
    assert [(each.name, each.ended_s) for each in zone.drives] == [("drive", 1e9)]
    flat = Scene("drive", _flat(log.trajectory), log.ranges, log.anchor_ids, frame=log.frame)
    expected = {fix.anchor_id: fix for fix in reconstruct(flat, RAW).anchors}
    for fix in zone.result().anchors:
        np.testing.assert_allclose(fix.position_m, expected[fix.anchor_id].position_m, atol=1e-6)


def _flat(path):
    return type(path)(path.t_s, path.position_m)


def test_batches_may_come_in_any_order(log, tmp_path):
    zone = Zone.create(tmp_path / "zone", frame=log.frame, config=RAW)
    one, other = zone.start("drive"), zone.start("drive")
    for drive, order in ((one, 1), (other, -1)):
        for part in list(batches(log))[::order]:
            drive.add_ranges(**part)
        drive.add_poses(
            t_s=log.trajectory.t_s[::order], position_m=log.trajectory.position_m[::order]
        )
    np.testing.assert_array_equal(one.scene().ranges.range_m, other.scene().ranges.range_m)
    np.testing.assert_array_equal(one.scene().trajectory.t_s, log.trajectory.t_s)


def test_what_is_not_enough_or_does_not_match_is_told(log, tmp_path):
    drive = Zone.create(tmp_path / "zone", frame=log.frame, config=RAW).start("drive")
    with pytest.raises(InputError, match="no ranges or fewer than two positions"):
        drive.result()
    with pytest.raises(InputError, match="expected as many of each"):
        drive.add_ranges(t_s=[0.0], anchor_ids=["cone-1"], range_m=[])
    with pytest.raises(InputError, match="expected as many of each"):
        drive.add_poses(t_s=[0.0], position_m=[])
