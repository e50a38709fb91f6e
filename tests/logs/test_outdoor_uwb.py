from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from gaia_uwb._shared.errors import InputError, SourceError
from gaia_uwb.logs.outdoor_uwb import ANCHOR_IDS, RUNS, load, select_runs
from gaia_uwb.projection import to_local
from outdoor_files import SITE, SURVEY, TURN_RAD, rotated, write_run


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
    with pytest.raises(
        InputError, match=r"trajectory\.csv: fits gnss\.csv only to within 0\.062 m"
    ):
        load(tmp_path, "NLOS/B/4")


@pytest.mark.parametrize(
    ("name", "column", "value", "problem"),
    [
        ("trajectory", "timestamp", "1e300", "row 6, column timestamp: expected nanoseconds"),
        ("trajectory", "timestamp", "-1e18", "row 6, column timestamp: expected nanoseconds"),
        ("trajectory", "x", "1e308", "row 6, column x: expected metres between"),
        ("trajectory", "z", "1e7", "row 6, column z: expected metres between"),
        (
            "gnss",
            "field.latitude",
            "1e200",
            "row 6, column field.latitude: expected a number between",
        ),
        ("gnss", "field.header.stamp", str(2**63 - 1), "row 6, column field.header.stamp: expect"),
        ("A5", "field.stamp", str(-(2**63)), "row 6, column field.stamp: expected nanoseconds"),
        ("A5", "field.y", "1e308", "row 6, column field.y: expected metres between"),
        ("A5", "field.distanceFromTag", "1e300", "row 6, column field.distanceFromTag: expected"),
    ],
)
def test_numbers_beyond_all_reason_are_named(
    tmp_path: Path, name: str, column: str, value: str, problem: str
) -> None:
    write_run(tmp_path)
    (path,) = tmp_path.rglob(f"{name}.csv")
    table = pl.read_csv(path, infer_schema=False)
    cells = [value if k == 4 else cell for k, cell in enumerate(table[column])]
    table.with_columns(pl.Series(column, cells)).write_csv(path)
    with pytest.raises(InputError, match=rf"{name}\.csv, {re.escape(problem)}"):
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
    with pytest.raises(SourceError, match="available: LOS/A/1, "):
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
