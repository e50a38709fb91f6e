"""A log that contradicts what is known of its vehicle is told, with both values."""

from dataclasses import replace

import numpy as np
import pytest

from gaia_uwb.config import PipelineConfig, make_config
from gaia_uwb.estimate import ReasonKind
from gaia_uwb.locate.known_values import MOST_PULL, contradicted_values, said_of
from gaia_uwb.locate.zone_places import find_places
from gaia_uwb.scene import Tag
from known_errors import CONES_M, Errors, make_drive, u_turn

ERRORS = Errors(noise_m=0.06, bias_m=0.15, offset_s=0.1)
AS_IT_IS = {
    "clock_offset_s": {"value": 0.1, "sigma": 0.01},
    "range_bias_m": {"value": 0.15, "sigma": 0.01},
}


def told(known, errors=ERRORS, **changes):
    """Return the reasons of a drive of which this is known."""
    episode = replace(make_drive(u_turn(), CONES_M, errors, seed=3), **changes)
    config = make_config({"vehicles": {episode.vehicle: known}})
    places = find_places([[episode]], config)[0]
    return list(contradicted_values([episode], places.errors, config))


def test_two_estimates_taken_apart_are_what_they_were():
    known, own = (0.3, 0.02**2), (0.1, 0.05**2)
    weight = np.array([1 / known[1], 1 / own[1]])
    mean = weight @ [known[0], own[0]] / weight.sum()
    said = said_of(mean, 1 / weight.sum(), *known)
    assert (said.value, said.sigma) == pytest.approx((0.1, 0.05))
    assert said.pull == pytest.approx(0.2 / np.hypot(0.02, 0.05), rel=0.05)


def test_ranges_that_say_nothing_contradict_nothing():
    said = said_of(0.3, 0.04, 0.3, 0.04)
    assert (said.sigma, said.pull) == (np.inf, 0.0)


def test_the_unrest_of_a_fit_is_no_contradiction():
    # The ranges take a hundred thousandth of the variance away: they hardly say a thing.
    assert said_of(0.3 + 0.001, 0.02**2 * (1 - 1e-5), 0.3, 0.02**2).pull < 2.0
    assert said_of(0.3 + 0.02, 0.02**2 * (1 - 1e-3), 0.3, 0.02**2).pull > MOST_PULL


def test_a_log_that_agrees_is_not_told():
    assert not told(AS_IT_IS)
    assert not told({})


def test_another_clock_is_told_with_both_values():
    (reason,) = told(AS_IT_IS | {"clock_offset_s": {"value": 0.3, "sigma": 0.01}}, vehicle="van")
    assert reason.kind is ReasonKind.VEHICLE
    numbers = reason.numbers
    assert numbers["known"] == pytest.approx(0.3)
    assert numbers["known_sigma"] == pytest.approx(np.hypot(0.01, 0.005), rel=1e-3)
    assert numbers["said"] == pytest.approx(0.1, abs=0.02)
    assert numbers["pull"] > MOST_PULL
    assert str(reason).startswith(
        "clock offset: +0.300 ± 0.011 s is known of vehicle van, but these ranges say +0."
    )
    assert str(reason).endswith(" s: is it this vehicle, and is nothing changed on it?")


def test_another_bias_is_told():
    (reason,) = told(AS_IT_IS | {"range_bias_m": {"value": -0.15, "sigma": 0.01}})
    assert str(reason).startswith("range bias: -0.150 ± 0.010 m is known of the vehicle, but")
    assert reason.numbers["said"] == pytest.approx(0.15, abs=0.06)


def test_a_lever_arm_that_is_wrong_is_told_where_the_antenna_is():
    episode = make_drive(u_turn(), CONES_M, ERRORS, seed=3)
    path = episode.own_times.trajectory
    step_m = np.gradient(path.position_m, axis=0)
    left = np.stack([-step_m[:, 1], step_m[:, 0]], axis=1) / np.hypot(*step_m.T)[:, None]
    shifted = replace(path, position_m=path.position_m + 0.5 * left)  # it is at 0 m
    reasons = told(
        {"tags": {"roof": {"lever_sigma_m": 0.01}}},
        tag=Tag("roof", left_m=0.5),
        own_times=replace(episode.own_times, trajectory=shifted),
    )
    (reason,) = [each for each in reasons if str(each).startswith("left_m of tag roof: +0.500")]
    assert reason.numbers["said"] == pytest.approx(0.0, abs=0.15)


def test_of_several_passes_the_worst_is_told_once():
    episodes = [make_drive(u_turn(), CONES_M, ERRORS, seed=3, number=k) for k in range(2)]
    known = {"clock_offset_s": {"value": 0.3, "sigma": 0.01}}
    config = make_config({"vehicles": {"": known}})
    places = find_places([episodes], config)[0]
    (reason,) = contradicted_values(episodes, places.errors, config)
    assert reason.passes[0] in {episode.name for episode in episodes}
    assert not list(contradicted_values(episodes, places.errors, PipelineConfig()))
