from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from gaia_uwb._shared.errors import ConfigError, InputError
from gaia_uwb.config import Known
from gaia_uwb.logs import (
    Vehicle,
    VehicleTag,
    read_native,
    read_vehicle,
    write_native,
    write_vehicle,
)
from gaia_uwb.simulate import PRESETS, simulate_pass

TRUCK = """
name: truck 7
tags:
  1: {forward_m: 1.8, left_m: 0.6, up_m: 0.4, delay_m: {value: 0.12, sigma: 0.03}}
  '2': {own_clock: true}
clock_offset_s: {value: -0.04, sigma: 0.01}
"""


def write(folder: Path, text: str) -> Path:
    path = folder / "vehicle.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def test_reads_what_a_vehicle_is_known_for(tmp_path: Path) -> None:
    truck = read_vehicle(write(tmp_path, TRUCK))
    assert truck.name == "truck 7"
    assert truck.tags["1"].delay_m == Known(value=0.12, sigma=0.03)
    assert truck.tags["2"] == VehicleTag(own_clock=True)
    assert truck.clock_offset_s == Known(value=-0.04, sigma=0.01)
    assert truck.range_bias_m is None


@pytest.mark.parametrize(
    "vehicle",
    [
        Vehicle(name="no"),
        Vehicle(name="0x1F", tags={"010": VehicleTag(left_m=-1.0), "off": VehicleTag()}),
        Vehicle(
            name="Müller: 7 #3",
            tags={"1": VehicleTag(up_m=0.1, delay_m=Known(value=1e-7, sigma=1e-12))},
            range_bias_m=Known(value=0.2, sigma=0.05),
        ),
    ],
)
def test_gives_back_what_was_written(tmp_path: Path, vehicle: Vehicle) -> None:
    path = tmp_path / "vehicle.yaml"
    path.write_text("old", encoding="utf-8")
    write_vehicle(vehicle, path)
    assert read_vehicle(path) == vehicle


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("tags: {}", "name: required"),
        ("name: x\nbias_m: 1", "bias_m: unknown key"),
        ("- x", "top level: input should be a valid dictionary or instance of Vehicle, got ['x']"),
        (
            "name: x\nrange_bias_m: {value: 1, sigma: 0}",
            "range_bias_m.sigma: input should be greater than 0, got 0",
        ),
        ("name: x\nrange_bias_m: {value: 1}", "range_bias_m.sigma: required"),
        (
            "name: x\ntags: {1: {}, '1.0': {}}",
            "tags: tag 1 appears twice, got {1: {}, '1.0': {}}",
        ),
        ("name: x\ntags: {1: {forward_m: .nan}}", "tags.1.forward_m: input should be a finite"),
    ],
)
def test_what_is_wrong_is_said_in_one_line(tmp_path: Path, text: str, message: str) -> None:
    path = write(tmp_path, text)
    with pytest.raises(ConfigError) as caught:
        read_vehicle(path)
    assert str(caught.value).startswith(f"{path}: {message}")
    assert "\n" not in str(caught.value)


def test_files_that_cannot_be_read_or_written(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        read_vehicle(tmp_path / "none.yaml")
    with pytest.raises(InputError, match="cannot be read: line 2"):
        read_vehicle(write(tmp_path, "name: [x"))
    with pytest.raises(ConfigError, match="cannot write this file"):
        write_vehicle(Vehicle(name="x"), tmp_path / "none" / "vehicle.yaml")


def test_a_lever_arm_that_drives_have_told_counts_more_than_the_one_of_a_log(
    tmp_path: Path,
) -> None:
    log = simulate_pass(PRESETS["two-tags"], seed=0)
    write_native(log, tmp_path / "log")
    told = VehicleTag(forward_m=0.1, left_m=0.83, lever_sigma_m=0.01)
    van = Vehicle(name="van", tags={"tag-1": told, "tag-2": VehicleTag(left_m=-3.0)})
    read = read_native(tmp_path / "log", vehicle=van)
    assert [(tag.forward_m, tag.left_m) for tag in read.tags] == [(0.1, 0.83), (0.0, -0.8)]
    assert read.vehicle == "van"


def test_a_log_keeps_the_name_of_its_vehicle(tmp_path: Path) -> None:
    log = replace(simulate_pass(PRESETS["two-tags"], seed=0), vehicle="van")
    write_native(log, tmp_path / "log")
    assert read_native(tmp_path / "log").vehicle == "van"


def test_a_lever_arm_far_from_that_of_the_log_makes_the_log_a_problem() -> None:
    log = simulate_pass(PRESETS["two-tags"], seed=0)
    near, far = (
        Vehicle(name="van", tags={"tag-1": VehicleTag(left_m=left_m, lever_sigma_m=0.01)})
        for left_m in (0.7, -0.8)
    )
    assert near.drove(log).problems == log.problems
    (problem,) = set(far.drove(log).problems) - set(log.problems)
    assert problem.startswith("tag tag-1: the log puts it 0 m forward and 0.8 m left, but van was")
