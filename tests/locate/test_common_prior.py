"""What the cones of a zone have in common, before any range: clocks, biases, patterns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from gaia_uwb.config import AlignmentConfig, PipelineConfig
from gaia_uwb.episode import ClockOffset, Episode
from gaia_uwb.locate.common_prior import shared_prior
from gaia_uwb.locate.slow_errors import DRIVE, RADIOS
from gaia_uwb.scene import Tag
from known_errors import CONES_M, WORKING, make_drive, u_turn

CONFIG = PipelineConfig()
DRIVE_EPISODE = make_drive(u_turn(), CONES_M, WORKING, seed=0)


def tagged(tag: Tag, drive: str = "one", vehicle: str = "", **more: object) -> Episode:
    return replace(DRIVE_EPISODE, tag=tag, drive=drive, vehicle=vehicle, **more)  # type: ignore[arg-type]


def covariance(episodes: Sequence[Episode]) -> NDArray[np.float64]:
    _, precision = shared_prior(episodes, CONFIG)
    return np.linalg.inv(precision)


def differ(episodes: Sequence[Episode], part: int) -> float:
    """Return the standard deviation of what two episodes differ by in one of their unknowns."""
    total = covariance(episodes)
    one, other = RADIOS + part, RADIOS + DRIVE + part
    return float(np.sqrt(total[one, one] + total[other, other] - 2.0 * total[one, other]))


def test_tags_of_one_drive_share_a_clock() -> None:
    left, right = Tag("l", left_m=0.8), Tag("r", left_m=-0.8)
    assert differ([tagged(left), tagged(right)], 0) < 0.001
    drives = AlignmentConfig().drive_offset_sigma_s
    apart = differ([tagged(left), tagged(left, drive="two")], 0)
    assert apart == pytest.approx(np.sqrt(2.0) * drives, rel=0.01)
    own = [tagged(left), tagged(replace(right, own_clock=True))]
    prior_s = AlignmentConfig().clock_offset_sigma_s
    assert differ(own, 0) == pytest.approx(np.sqrt(2.0) * prior_s, rel=0.01)
    vehicles = [tagged(left, vehicle="a"), tagged(left, drive="two", vehicle="b")]
    assert differ(vehicles, 0) == pytest.approx(np.sqrt(2.0) * prior_s, rel=0.01)


def test_a_clock_that_was_applied_is_an_estimate_not_knowledge() -> None:
    applied = [
        tagged(Tag("l"), clock=ClockOffset(0.3, 0.1, True, "")),
        tagged(Tag("r"), clock=ClockOffset(0.1, 0.1, False, "")),
    ]
    mean, _ = shared_prior(applied, CONFIG)
    assert mean[[RADIOS, RADIOS + DRIVE]] == pytest.approx([-0.3, 0.0])


def test_a_tag_is_the_same_in_all_drives_of_its_vehicle() -> None:
    again = [tagged(Tag("l")), tagged(Tag("l"), drive="two")]
    others = [tagged(Tag("l")), tagged(Tag("r"))]
    for part in (1, 4):  # bias and second harmonic
        assert differ(again, part) < 0.75 * differ(others, part)


def test_a_wrong_heading_moves_the_tags_of_a_vehicle_against_each_other() -> None:
    left, right = Tag("l", left_m=2.0), Tag("r", left_m=-2.0)
    total = covariance([tagged(left), tagged(right)])
    forward = [RADIOS + 2, RADIOS + DRIVE + 2]  # cosines of the first harmonics
    together = total[forward[0], forward[1]]
    course_rad = np.radians(2.0)
    assert together == pytest.approx(-((2.0 * course_rad) ** 2), rel=0.01)
    sideways = [RADIOS + 3, RADIOS + DRIVE + 3]
    assert total[sideways[0], sideways[1]] == pytest.approx(0.0, abs=1e-9)
    apart = covariance([tagged(left), tagged(right, drive="two")])
    assert apart[forward[0], forward[1]] == pytest.approx(0.0, abs=1e-9)


def test_a_measured_heading_is_better_than_a_course() -> None:
    own = DRIVE_EPISODE.own_times
    assert own is not None
    path = replace(own.trajectory, heading_rad=np.zeros(len(own.trajectory)))
    measured = replace(own, trajectory=path)
    tags = Tag("l", left_m=2.0), Tag("r", left_m=-2.0)
    by_course = covariance([tagged(tag) for tag in tags])
    by_compass = covariance([tagged(tag, own_times=measured) for tag in tags])
    at = RADIOS + 2, RADIOS + DRIVE + 2
    assert by_compass[at] == pytest.approx(0.25 * by_course[at], rel=0.01)
