"""What the command line says of a vehicle: ``--vehicle`` and ``--clock-offset``."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from gaia_uwb.config import Known
from gaia_uwb.logs import Vehicle, VehicleTag, write_native, write_vehicle
from gaia_uwb.scene import RangeLog, Scene, Tag
from gaia_uwb.simulate import PRESETS, simulate_pass


def with_two_tags() -> Scene:
    """Return a simulated log of which every other reading is of a second tag at the same place."""
    scene = simulate_pass(PRESETS["lane-closure"], seed=0).without_truth()
    log = scene.ranges
    tag = np.arange(len(log)) % 2
    ranges = RangeLog(log.t_s, log.anchor, log.range_m, tag=tag)
    return Scene(scene.name, scene.trajectory, ranges, scene.anchor_ids, tags=(Tag("1"), Tag("2")))


@pytest.mark.parametrize(
    ("said", "problem"),
    [
        ("0.12", "add the standard deviation, such as 0.12,0.005, got '0.12'"),
        ("0.12,0", "expected SECONDS,SIGMA with a standard deviation above 0, got '0.12,0'"),
        ("0.12,x", "expected SECONDS,SIGMA with a standard deviation above 0, got '0.12,x'"),
        ("nan", "expected SECONDS,SIGMA with a standard deviation above 0, got 'nan'"),
        ("1,2,3", "expected SECONDS,SIGMA with a standard deviation above 0, got '1,2,3'"),
    ],
)
@pytest.mark.parametrize("command", [("reconstruct", "sim"), ("data", "check", "sim")])
def test_a_clock_offset_needs_its_standard_deviation(
    run, command: tuple[str, ...], said: str, problem: str
) -> None:  # type: ignore[no-untyped-def]
    code, out, err = run(*command, "--clock-offset", said)
    assert (code, out, err) == (2, "", f"gaia: --clock-offset: {problem}\n")


def test_a_clock_offset_that_is_wrong_is_told_by_every_command(run, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    said = "clock offset: +0.500 ± 0.011 s is known of the vehicle, but these ranges say +0."
    code, out, _ = run("data", "check", "sim:lane-closure", "--clock-offset", "0.5,0.01")
    assert (code, f"PROBLEM: {said}" in out) == (1, True)
    options = ("--clock-offset", "0.5,0.01", "--denoiser", "raw", "--out", tmp_path)
    code, out, _ = run("reconstruct", "sim:lane-closure", *options)
    assert (code, f"reason: {said}" in out) == (1, True)
    report = json.loads((tmp_path / "report.json").read_text(encoding="utf-8"))
    assert "vehicle" in {reason["kind"] for reason in report["reasons"]}
    assert "calibrate that again" in (tmp_path / "report.md").read_text(encoding="utf-8")


def test_one_that_is_right_is_kept_in_the_settings_and_read_back(run, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    options = ("--denoiser", "raw", "--clock-offset", "0.2,0.01", "--out", tmp_path / "one")
    assert run("reconstruct", "sim:lane-closure", *options)[0] == 0
    settings = tmp_path / "one" / "config.yaml"
    again = ("--config", settings, "--out", tmp_path / "two")
    assert run("reconstruct", "sim:lane-closure", *again)[0] == 0
    one, two = (tmp_path / name / "cones.csv" for name in ("one", "two"))
    assert one.read_bytes() == two.read_bytes()


def test_the_tags_of_a_vehicle_read_a_log_that_says_nothing_of_them(run, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    log, van = tmp_path / "log", tmp_path / "van.yaml"
    write_native(with_two_tags(), log)
    (log / "scene.yaml").unlink()
    code, _, err = run("reconstruct", log, "--out", tmp_path / "out")
    assert code == 2
    assert err == (
        f"gaia: {log / 'ranges.csv'}, column tag_id: holds ranges of 2 tags ('1', '2'): say where "
        "each is on the vehicle, tags: {1: {forward_m: ..., left_m: ...}, ...} in scene.yaml or in "
        "a vehicle's file (--vehicle), or take one by where: {tag_id: 1} in scene.yaml\n"
    )
    tags = {"1": VehicleTag(), "2": VehicleTag()}
    known = Known(value=0.2, sigma=0.02)
    write_vehicle(Vehicle(name="van 7", tags=tags, clock_offset_s=known), van)
    options = ("--vehicle", van, "--denoiser", "raw", "--out", tmp_path / "out")
    code, _, err = run("reconstruct", log, *options)
    assert (code, err) == (0, "")
    assert "van 7" in (tmp_path / "out" / "config.yaml").read_text(encoding="utf-8")
    assert run("data", "check", log, "--vehicle", van)[0] == 0


def test_a_vehicle_and_a_clock_offset_are_one_too_many(run, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    van = tmp_path / "van.yaml"
    write_vehicle(Vehicle(name="van 7"), van)
    code, _, err = run("reconstruct", "sim", "--vehicle", van, "--clock-offset", "0.1,0.1")
    problem = "give one: a vehicle's file holds its clock_offset_s"
    assert (code, err) == (2, f"gaia: --vehicle and --clock-offset: {problem}\n")
    code, _, err = run("data", "check", "sim", "--vehicle", tmp_path / "none.yaml")
    assert (code, "none.yaml" in err) == (2, True)
