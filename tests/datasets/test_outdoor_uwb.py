from __future__ import annotations

from pathlib import Path

import numpy as np
import polars as pl
import pytest

from gaia_uwb.datasets.outdoor_uwb import ANCHOR_IDS, RUNS, load, select_runs
from gaia_uwb.errors import InputError, SourceError
from gaia_uwb.projection import to_geodetic, to_local
from gaia_uwb.scene import LocalFrame

START_NS = 1_730_017_526_625_169_679
SITE = LocalFrame(lat_deg=37.5552, lon_deg=127.0453, alt_m=49.0)
TURN_RAD = np.radians(19.5)
SURVEY = {"3": (2.58, -0.87, 1.97), "5": (-2.58, 0.87, 1.97), "9": (0, 0.5, 0.5), "12": (1, 0, 0.5)}


def rotated(position_m: np.ndarray, angle_rad: float) -> np.ndarray:
    cos, sin = np.cos(angle_rad), np.sin(angle_rad)
    return position_m @ np.array([[cos, sin], [-sin, cos]])


def write_run(data: Path, *, lever_arm_m: float = 0.185) -> np.ndarray:
    """Write a run in the data set's files; return the tag's path in east and north."""
    folder = data / "Dynamic_measurements" / "NLOS" / "Trajectory_B" / "Case_4"
    folder.mkdir(parents=True)
    stamp_ns = START_NS + np.arange(80) * 125_000_000
    angle_rad = np.linspace(0, 2 * np.pi, 80)
    path_m = np.column_stack([8 * np.cos(angle_rad), 5 * np.sin(angle_rad)])
    heading_rad = angle_rad + np.pi / 2
    ahead = np.column_stack([np.cos(heading_rad), np.sin(heading_rad)])
    antenna_m = rotated(path_m - lever_arm_m * ahead, -TURN_RAD)
    lat_deg, lon_deg, alt_m = to_geodetic(SITE, antenna_m, np.full(80, 1.0))
    pl.DataFrame(
        {
            "timestamp": [f"{float(stamp):.16e}" for stamp in stamp_ns],
            "x": path_m[:, 0],
            "y": path_m[:, 1],
            "z": np.zeros(80),
            "heading_degrees": np.degrees(heading_rad),
        }
    ).write_csv(folder / "trajectory.csv")
    pl.DataFrame(
        {
            "%time": stamp_ns,
            "field.header.stamp": stamp_ns,
            "field.latitude": lat_deg,
            "field.longitude": lon_deg,
            "field.altitude": alt_m,
        }
    ).write_csv(folder / "gnss.csv")
    for k, (anchor_id, (x, y, z)) in enumerate(SURVEY.items()):
        pl.DataFrame(
            {
                "%time": stamp_ns,
                "field.stamp": stamp_ns + 1_000_001 * k - 200_000_000,
                "field.id": int(anchor_id),
                "field.x": float(x),
                "field.y": float(y),
                "field.z": float(z),
                "field.distanceFromTag": 5.0 + np.arange(80),
                "field.rssi": [float("-inf")] + [-80.0] * 79,
                "field.rssi_fp": -82.0,
            }
        ).write_csv(folder / f"A{anchor_id}.csv")
    return rotated(path_m, -TURN_RAD)


def test_turns_the_frame_to_east_and_north(tmp_path: Path) -> None:
    path_m = write_run(tmp_path)
    (scene,) = load(tmp_path, "NLOS/B/4")
    np.testing.assert_allclose(scene.trajectory.position_m, path_m, atol=1e-4)
    assert scene.truth is not None
    survey_m = np.array(list(SURVEY.values()))
    np.testing.assert_allclose(scene.truth.anchor_m, rotated(survey_m[:, :2], -TURN_RAD), atol=1e-4)
    assert scene.frame is not None
    np.testing.assert_allclose(
        [scene.frame.lat_deg, scene.frame.lon_deg], [SITE.lat_deg, SITE.lon_deg], atol=1e-10
    )
    assert scene.frame.alt_m == pytest.approx(SITE.alt_m, abs=1e-4)


def test_heights_times_and_labels(tmp_path: Path) -> None:
    write_run(tmp_path)
    (scene,) = load(tmp_path, "NLOS/B/4")
    assert scene.name == "outdoor-uwb:NLOS/B/4"
    assert scene.anchor_ids == ANCHOR_IDS == ("3", "5", "9", "12")
    np.testing.assert_array_equal(scene.anchor_up_m, [1.97, 1.97, 0.5, 0.5])  # type: ignore[arg-type]
    np.testing.assert_array_equal(scene.trajectory.up_m, np.ones(80))  # type: ignore[arg-type]
    np.testing.assert_allclose(scene.trajectory.t_s, np.arange(80) * 0.125, atol=3e-7)
    # The start's float stamp is 15 ns off; between ranges, nanoseconds are exact.
    np.testing.assert_allclose(scene.ranges.t_s[:4], -0.2 + 0.001000001 * np.arange(4), atol=2e-8)
    np.testing.assert_allclose(np.diff(scene.ranges.t_s[:4]), 0.001000001, atol=1e-15)
    np.testing.assert_array_equal(scene.ranges.anchor[:5], [0, 1, 2, 3, 0])
    assert scene.ranges.rssi_dbm is not None
    assert np.isnan(scene.ranges.rssi_dbm).sum() == 4
    assert scene.truth is not None
    assert scene.truth.nlos is not None
    assert scene.truth.nlos.all()


def test_a_frame_that_does_not_fit_is_refused(tmp_path: Path) -> None:
    write_run(tmp_path, lever_arm_m=0.4)
    with pytest.raises(InputError, match=r"trajectory\.csv: fits gnss\.csv only to 0\.062 m"):
        load(tmp_path, "NLOS/B/4")


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"Case_1/trajectory\.csv: cannot be read: No such file"):
        load(tmp_path, "LOS/A/1")


def test_parts() -> None:
    assert select_runs("") == RUNS
    assert select_runs("NLOS") == RUNS[4:]
    assert select_runs("NLOS/B") == RUNS[6:]
    assert select_runs("NLOS/B/4") == RUNS[7:]


@pytest.mark.parametrize("part", ["nlos", "LOS/C", "LOS/A/3", "LOS/A/1/2", "/", "LOS/"])
def test_unknown_parts(part: str) -> None:
    with pytest.raises(SourceError, match="it has LOS/A/1, "):
        select_runs(part)


@pytest.mark.real_data
def test_all_real_runs(outdoor_dir: Path) -> None:
    """What the data set's description says, and that its geometry survives the turn."""
    folder = outdoor_dir / "outdoor-uwb"
    scenes = load(folder)
    assert [scene.name for scene in scenes] == [f"outdoor-uwb:{run}" for run in RUNS]
    assert [len(scene.trajectory) for scene in scenes] == [
        1881, 2040, 1480, 1599, 2515, 2220, 1397, 1425,
    ]  # fmt: skip
    assert sum(len(scene.ranges) for scene in scenes) == 61_702
    n_without_rssi = [
        int(np.isnan(s.ranges.rssi_dbm).sum()) for s in scenes if s.ranges.rssi_dbm is not None
    ]
    assert n_without_rssi == [0, 0, 0, 0, 0, 1, 0, 0]
    for scene in scenes:
        assert scene.truth is not None
        assert scene.truth.nlos is not None
        assert scene.truth.nlos.all() == scene.name.startswith("outdoor-uwb:NLOS")
        # At the surveyed places, three quarters of the ranges fit the path to 0.25 m.
        log, drive = scene.ranges, scene.trajectory
        at_s = log.t_s - 0.18
        east_m, north_m = (np.interp(at_s, drive.t_s, axis) for axis in drive.position_m.T)
        assert drive.up_m is not None
        assert scene.anchor_up_m is not None
        gap_m = np.interp(at_s, drive.t_s, drive.up_m) - scene.anchor_up_m[log.anchor]
        east_m -= scene.truth.anchor_m[log.anchor, 0]
        north_m -= scene.truth.anchor_m[log.anchor, 1]
        residual_m = log.range_m - np.sqrt(east_m**2 + north_m**2 + gap_m**2)
        assert np.quantile(np.abs(residual_m), 0.75) < 0.25


@pytest.mark.real_data
def test_the_real_frame_agrees_with_gnss(outdoor_dir: Path) -> None:
    """Case 3 was measured around a car that stood still between two runs: one place on Earth."""
    frames = [scene.frame for run in ("LOS/B/3", "NLOS/B/3")
              for scene in load(outdoor_dir / "outdoor-uwb", run)]  # fmt: skip
    assert frames[0] is not None
    assert frames[1] is not None
    there_m, _ = to_local(frames[0], np.array([frames[1].lat_deg]), np.array([frames[1].lon_deg]))
    assert np.hypot(*there_m[0]) < 0.1
