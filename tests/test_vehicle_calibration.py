"""What drives say of their vehicle: numbers with standard errors, and what they cannot tell."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from drives_past import as_scene
from gaia_uwb._shared.errors import InputError
from gaia_uwb.config import Known
from gaia_uwb.logs import Vehicle, VehicleTag
from gaia_uwb.scene import Scene, Tag
from gaia_uwb.vehicle_calibration import (
    Calibration,
    average,
    calibrate_vehicle,
    combine,
    usual_values,
)
from known_errors import CONES_M, Errors, make_drive, straight
from vehicle_calibrations import TrueVehicle

VAN = TrueVehicle.draw(np.random.default_rng(7))
STEADY = make_drive(straight(), CONES_M, Errors(noise_m=0.06, offset_s=0.12), seed=4)
USUAL = Known(value=0.0, sigma=0.5)


@pytest.fixture(scope="module")
def drive() -> Scene:
    return VAN.drive(1, levers_known=False)


@pytest.fixture(scope="module")
def found(drive: Scene) -> Calibration:
    return calibrate_vehicle([drive], name="van", levers_unknown=True)


def test_everything_that_a_drive_tells_is_what_it_is(found: Calibration) -> None:
    assert found.unknown == ()
    truth = VAN.truth()
    assert set(found.found) == set(truth)
    for name, known in found.found.items():
        assert abs(known.value - truth[name]) < 3.5 * known.sigma, name
        assert known.sigma < 0.08


def test_lever_arms_are_found_from_nothing(found: Calibration) -> None:
    for index, (ahead_m, left_m) in enumerate(VAN.levers_m):
        tag = found.vehicle.tags[str(index)]
        assert tag.forward_m == pytest.approx(ahead_m, abs=0.15)
        assert tag.left_m == pytest.approx(left_m, abs=0.15)
        assert tag.lever_sigma_m is not None and tag.delay_m is not None


def test_the_heading_stays_in_the_standard_error(found: Calibration) -> None:
    far_m = np.abs(VAN.levers_m[0])  # a course that is 2 degrees off moves it across that
    for what, other_m in (("forward_m", far_m[1]), ("left_m", far_m[0])):
        assert found.found[f"tags.0.{what}"].sigma > np.radians(2.0) * (other_m - 0.1)


def test_a_measured_lever_arm_moves_less_than_one_that_is_not(drive: Scene) -> None:
    tags = {
        k: tag.model_copy(update={"lever_sigma_m": 0.001}) for k, tag in VAN.stated.tags.items()
    }
    stated = tuple(Tag(k, tag.forward_m, tag.left_m) for k, tag in tags.items())
    known = Vehicle(name="van", tags=tags)
    found = calibrate_vehicle([replace(drive, tags=stated)], known)
    assert {f"tags.{k}.left_m" for k in tags} <= set(found.unknown)
    assert found.vehicle.tags["0"].left_m == tags["0"].left_m
    assert found.vehicle.tags["0"].lever_sigma_m == 0.001
    off_m = found.found["tags.0.left_m"].value - tags["0"].left_m
    assert abs(off_m) < 0.1


def test_a_straight_steady_drive_does_not_tell_its_clock() -> None:
    known = Vehicle(name="van", clock_offset_s=Known(value=0.1, sigma=0.02))
    alone = calibrate_vehicle([as_scene(STEADY)])
    assert alone.unknown[0] == "clock_offset_s"
    assert alone.vehicle.clock_offset_s is None
    kept = calibrate_vehicle([as_scene(STEADY)], known, name="van 8").vehicle
    assert kept.clock_offset_s == known.clock_offset_s  # what was known stays
    assert kept.name == "van 8"


def test_the_truth_is_not_looked_at_and_a_drive_counts_once(drive: Scene) -> None:
    with pytest.raises(InputError, match="is the same drive as drive-1"):
        calibrate_vehicle([drive, replace(drive, name="copy")])
    with pytest.raises(InputError, match="expected at least one drive, got none"):
        calibrate_vehicle([])


def test_drives_are_averaged_with_their_precisions() -> None:
    values = [Known(value=1.0, sigma=0.1), Known(value=1.1, sigma=0.2)]
    mean = average(values, Known(value=0.0, sigma=1e6))
    assert mean.value == pytest.approx((100 * 1.0 + 25 * 1.1) / 125)
    assert mean.sigma == pytest.approx(125**-0.5)
    assert average([], USUAL) == USUAL


def test_drives_that_scatter_more_than_they_say_have_a_larger_standard_error() -> None:
    values = [Known(value=x, sigma=0.01) for x in (0.9, 1.0, 1.1)]
    mean = average(values, Known(value=0.0, sigma=1e6))
    assert mean.value == pytest.approx(1.0)
    assert mean.sigma == pytest.approx(0.1 / np.sqrt(3))


def test_what_was_known_before_counts_once() -> None:
    usual = Known(value=0.0, sigma=0.1)
    mean = average([Known(value=0.3, sigma=0.1)] * 2, usual)
    assert mean.value == pytest.approx(0.2)


def test_half_of_a_lever_arm_is_none() -> None:
    tag, start = Tag("1", 1.0, 0.5), Vehicle(name="van", tags={"1": VehicleTag(forward_m=1.0)})
    before = usual_values(["clock_offset_s", "range_bias_m"]) | {
        "tags.1.forward_m": Known(value=1.0, sigma=2.0),
        "tags.1.left_m": Known(value=0.5, sigma=2.0),
    }
    drives = [{"tags.1.forward_m": Known(value=1.2, sigma=0.02)}]
    found = combine(start, drives, before, {"1": tag})
    assert set(found.unknown) == set(before)
    assert found.vehicle == start
    both = combine(
        start, [drives[0] | {"tags.1.left_m": Known(value=0.7, sigma=0.01)}], before, {"1": tag}
    )
    arm = both.vehicle.tags["1"]
    assert (arm.forward_m, arm.left_m, arm.lever_sigma_m) == (1.2, 0.7, 0.02)
