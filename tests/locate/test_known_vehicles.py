"""What is known of a vehicle stands in for what is usual, and nothing else changes."""

from dataclasses import replace

import numpy as np
import pytest

from gaia_uwb.config import AlignmentConfig, CalibrationConfig, PipelineConfig, make_config
from gaia_uwb.episode import ClockOffset
from gaia_uwb.locate.common_prior import heading_sigma_m, shared_prior
from gaia_uwb.locate.zone_places import CLOCK_KNOWN, find_places, with_run_errors
from gaia_uwb.scene import Tag
from known_errors import CONES_M, Errors, make_drive, straight, u_turn

BIAS, CLOCK, DELAY, AHEAD = 0, 2, 3, 4
KNOWN = {
    "clock_offset_s": {"value": 0.12, "sigma": 0.012},
    "range_bias_m": {"value": 0.3, "sigma": 0.02},
    "tags": {
        "front": {"delay_m": {"value": -0.1, "sigma": 0.01}, "lever_sigma_m": 0.2},
        "rear": {},
    },
}


def vehicles(**known):
    return make_config({"vehicles": known})


def prior_of(episodes, config):
    mean, precision = shared_prior(episodes, config)
    return mean, np.linalg.inv(precision)


def drive(number=0, **changes):
    return replace(make_drive(straight(), CONES_M, number=number), **changes)


def of_tag(name, number=0, **changes):
    return drive(
        number, tag=Tag(name, forward_m=1.5), **({"vehicle": "van", "drive": "d"} | changes)
    )


def test_nothing_known_of_this_vehicle_changes_nothing():
    one = [drive(vehicle="van")]
    for got, usual in zip(
        shared_prior(one, vehicles(bus=KNOWN)), shared_prior(one, PipelineConfig()), strict=True
    ):
        assert np.array_equal(got, usual)


def test_a_single_pass_knows_its_clock_its_bias_and_the_delay_of_its_tag():
    applied = ClockOffset(0.1, 0.0, True, "applied")
    mean, variance = prior_of([of_tag("front", clock=applied)], vehicles(van=KNOWN))
    assert mean[[BIAS, CLOCK, DELAY]] == pytest.approx([0.3, 0.02, -0.1])
    sigma = np.sqrt(np.diag(variance))
    assert sigma[BIAS] == pytest.approx(0.02)
    assert sigma[CLOCK] == pytest.approx(0.013, rel=1e-3)  # and 5 ms from drive to drive
    assert sigma[DELAY] == pytest.approx(np.hypot(0.01, 0.02))  # and 2 cm


def test_a_log_that_names_no_vehicle_is_known_under_no_name():
    mean, _ = prior_of([drive()], vehicles(**{"": KNOWN}))
    assert mean[CLOCK] == pytest.approx(0.12)


def test_the_clock_of_a_tag_of_its_own_is_not_that_of_the_vehicle():
    own = of_tag("front")
    own = replace(own, tag=replace(own.tag, own_clock=True))
    mean, variance = prior_of([own], vehicles(van=KNOWN))
    assert (mean[CLOCK], variance[CLOCK, CLOCK]) == pytest.approx((0.0, 0.25))


def test_what_is_switched_off_stays_off():
    config = vehicles(van=KNOWN).model_copy(
        update={
            "alignment": AlignmentConfig(clock_offset="off"),
            "calibration": CalibrationConfig(range_bias="off"),
        }
    )
    mean, variance = prior_of([of_tag("front")], config)
    assert not mean.any()
    assert np.diag(variance)[[BIAS, CLOCK, DELAY]].max() < 1e-11


def test_a_lever_arm_is_as_uncertain_as_is_known_and_the_same_in_all_drives():
    front, again = of_tag("front"), of_tag("front", 1, drive="e")
    usual = prior_of([of_tag("rear")], vehicles(van=KNOWN))[1]
    assert usual[AHEAD, AHEAD] == pytest.approx(0.05**2 + 0.02**2)
    mean, variance = prior_of([front, again], vehicles(van=KNOWN))
    assert variance[AHEAD, AHEAD] == pytest.approx(0.05**2 + 0.2**2)
    assert variance[AHEAD, AHEAD + 6] == pytest.approx(0.5 * 0.05**2 + 0.2**2)
    assert mean[AHEAD] == 0.0


def test_two_vehicles_in_a_zone_keep_their_biases_apart():
    other = {"range_bias_m": {"value": -0.2, "sigma": 0.03}}
    passes = [drive(vehicle="van"), drive(1, vehicle="bus"), drive(2, vehicle="unknown")]
    mean, variance = prior_of(passes, vehicles(van=KNOWN, bus=other))
    for k, (value, sigma) in enumerate([(0.3, 0.02), (-0.2, 0.03), (0.0, 0.2)]):
        both = [BIAS, DELAY + 6 * k]
        assert mean[both].sum() == pytest.approx(value)
        total = variance[np.ix_(both, both)].sum()
        assert total == pytest.approx(sigma**2 + 0.1**2, abs=1e-9)  # 0.1 m of the tags'


def test_a_measured_heading_turns_the_tags_less_than_a_course():
    tag = of_tag("front")
    path = tag.own_times.trajectory
    measured = replace(path, heading_rad=np.zeros(len(path)))
    known = replace(tag, own_times=replace(tag.own_times, trajectory=measured))
    assert heading_sigma_m(tag) == pytest.approx([0.0, -np.radians(2.0) * 1.5])
    assert heading_sigma_m(known) == pytest.approx([0.0, -np.radians(1.0) * 1.5])
    assert not heading_sigma_m(drive()).any()


def test_a_drive_that_cannot_tell_its_clock_has_places_along_the_road_once_it_is_known():
    episode = make_drive(straight(), CONES_M, Errors(noise_m=0.06, offset_s=0.12), seed=4)
    usual = find_places([[episode]], PipelineConfig())[0].hypotheses
    config = vehicles(**{"": KNOWN})
    places = find_places([[episode]], config)[0]
    along_m = (
        np.sqrt(usual.covariance_m2[:, 0, 0, 0]),
        np.sqrt(places.hypotheses.covariance_m2[:, 0, 0, 0]),
    )
    assert along_m[0].min() > 2.0
    assert along_m[1].max() < 0.1
    error_m = np.abs(places.hypotheses.position_m[:, 0, 0] - CONES_M[:, 0])
    assert (error_m < 3.0 * along_m[1]).all()
    clock = with_run_errors(episode, places, config).clock
    assert clock.applied_s == pytest.approx(0.12, abs=0.02)
    assert clock.sigma_s == pytest.approx(0.013, rel=0.05)
    assert clock.reason == CLOCK_KNOWN


def test_a_drive_that_tells_its_clock_better_says_so():
    episode = make_drive(u_turn(), CONES_M, Errors(noise_m=0.06, offset_s=0.12), seed=4)
    config = vehicles(**{"": {"clock_offset_s": {"value": 0.2, "sigma": 0.2}}})
    clock = with_run_errors(episode, find_places([[episode]], config)[0], config).clock
    assert clock.applied_s == pytest.approx(0.12, abs=0.01)
    assert clock.reason == "estimated together with the cones' positions"
