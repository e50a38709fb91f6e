"""``gaia vehicle calibrate``, as a user runs it, and what comes of it in a reconstruction."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml

from drives_past import as_scene
from gaia_uwb.logs import Vehicle, VehicleTag, read_vehicle, write_native, write_vehicle
from known_errors import CONES_M, Errors, make_drive, straight
from vehicle_calibrations import TrueVehicle

VAN = TrueVehicle.draw(np.random.default_rng(7))


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the log of two tags of which it does not say where they are."""
    folder = tmp_path_factory.mktemp("log")
    write_native(VAN.drive(1, levers_known=False), folder, file_format="parquet")
    (folder / "scene.yaml").unlink()
    return folder


def test_a_vehicle_is_calibrated_and_then_known(run, log: Path, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    start, out = tmp_path / "start.yaml", tmp_path / "out" / "van-7.yaml"
    write_vehicle(Vehicle(name="start", tags={"0": VehicleTag(), "1": VehicleTag()}), start)
    code, said, err = run(
        "vehicle", "calibrate", log, "--vehicle", start, "--levers-unknown", "--name", "van-7",
        "--out", out,
    )  # fmt: skip
    assert (code, err) == (0, "")
    lines = said.splitlines()
    assert lines[0] == "van-7: 1 drive"
    assert lines[-1] == f"wrote {out}"
    assert any(line.startswith("  tag 1, left_m: -") for line in lines)
    van = read_vehicle(out)
    assert van.clock_offset_s is not None
    assert van.clock_offset_s.value == pytest.approx(VAN.offset_s, abs=0.01)
    options = ("--denoiser", "raw", "--vehicle", out, "--out", tmp_path / "zone")
    code, _, err = run("reconstruct", log, *options)
    assert (code in (0, 1), err) == (True, "")
    settings = yaml.safe_load((tmp_path / "zone" / "config.yaml").read_text(encoding="utf-8"))
    assert list(settings["vehicles"]) == ["van-7"]


def test_what_a_drive_does_not_tell_is_left_out_and_said(run, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    errors = Errors(noise_m=0.06, offset_s=0.12)
    scene = as_scene(make_drive(straight(), CONES_M, errors, seed=4))
    write_native(scene, tmp_path / "log")
    out = tmp_path / "out" / "van.yaml"
    code, said, _ = run("vehicle", "calibrate", tmp_path / "log", "--out", out)
    assert code == 1
    (line,) = [each for each in said.splitlines() if "clock_offset_s" in each]
    assert line.endswith(
        "the drives do not tell it; speed up and brake beside the cones, or stop and go"
    )
    assert read_vehicle(out).name == "van"
    assert "clock_offset_s" not in out.read_text(encoding="utf-8")


def test_nobodys_file_is_replaced_but_ones_own_is(run, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    theirs = tmp_path / "van.yaml"
    theirs.write_text("theirs", encoding="utf-8")
    code, _, err = run("vehicle", "calibrate", "sim:lane-closure", "--out", theirs)
    assert (code, "was not written by gaia" in err) == (2, True)
    assert theirs.read_text(encoding="utf-8") == "theirs"
    ours = tmp_path / "ours.yaml"
    for _ in range(2):
        assert run("vehicle", "calibrate", "sim:lane-closure", "--out", ours)[0] == 0
    code, _, err = run("vehicle", "calibrate", "sim", "sim", "--out", tmp_path / "twice.yaml")
    assert (code, "is the same drive as" in err) == (2, True)
    assert not (tmp_path / "twice.yaml").exists()


def test_where_lever_arms_are_not_known_the_refusal_names_the_option(
    run, log: Path, tmp_path: Path
) -> None:  # type: ignore[no-untyped-def]
    code, _, err = run("vehicle", "calibrate", log, "--out", tmp_path / "van.yaml")
    assert (code, "or in a vehicle's file (--vehicle)" in err) == (2, True)
