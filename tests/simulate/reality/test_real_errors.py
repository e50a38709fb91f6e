"""Errors of a log whose ranges are known: exact, shifted in time, held, lowered."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gaia_uwb._shared.errors import InputError
from gaia_uwb.scene import RangeLog, Scene, Trajectory, Truth
from gaia_uwb.simulate.reality.real_errors import (
    ANTENNA_UP_M,
    ErrorDefinition,
    clock_offset_s,
    range_errors,
    true_range_m,
)

SPEED_MPS = 2.0
OFFSET_S = 0.25


def make_scene(*, error_m: float = 0.0, gap: bool = False, lowered_m: float = 0.0) -> Scene:
    """Drive east past two anchors; a range stamped t is the distance at t - OFFSET_S."""
    path_s = np.arange(0.0, 60.0, 0.125)
    if gap:
        path_s = path_s[(path_s < 20.0) | (path_s > 25.0)]
    path_m = np.stack([SPEED_MPS * path_s - 60.0, np.zeros_like(path_s)], axis=1)
    anchor_m, anchor_up_m = np.array([[0.0, 8.0], [10.0, -5.0]]), np.array([0.5, 1.5])
    t_s = np.arange(1.0, 55.0, 0.1)
    anchor = np.arange(len(t_s)) % 2
    east_m = SPEED_MPS * (t_s - OFFSET_S) - 60.0
    true_m = np.sqrt(
        (east_m - anchor_m[anchor, 0]) ** 2
        + anchor_m[anchor, 1] ** 2
        + (2.0 - anchor_up_m[anchor]) ** 2
    )
    return Scene(
        name="drive",
        trajectory=Trajectory(path_s, path_m, np.full(len(path_s), 2.0 + lowered_m)),
        ranges=RangeLog(t_s, anchor, true_m + error_m),
        anchor_ids=("a", "b"),
        anchor_up_m=anchor_up_m,
        truth=Truth(anchor_m, clock_offset_s=OFFSET_S),
    )


def test_corrected_errors_are_what_was_added() -> None:
    tracks = range_errors(make_scene(error_m=0.3), ErrorDefinition.CORRECTED)
    assert [len(track.t_s) for track in tracks] == [270, 270]
    for track in tracks:
        np.testing.assert_allclose(track.error_m, 0.3, atol=1e-9)


def test_an_unknown_offset_is_estimated() -> None:
    scene = make_scene()
    blind = replace(scene, truth=replace(scene.truth, clock_offset_s=None))
    assert clock_offset_s(scene) == OFFSET_S
    # A straight drive at constant speed cannot tell the offset, so none is applied.
    assert clock_offset_s(blind) == 0.0


def test_errors_in_gaps_of_the_path_are_unknown() -> None:
    scene = make_scene(gap=True)
    for track in range_errors(scene, ErrorDefinition.CORRECTED):
        driven_s = track.t_s - OFFSET_S
        inside = (driven_s > 19.88) & (driven_s < 25.12)  # between the two samples around the gap
        assert np.isnan(track.error_m[inside]).all()
        np.testing.assert_allclose(track.error_m[~inside], 0.0, atol=1e-9)
        assert inside.sum() > 20


def test_paper_errors_are_held_late_and_lowered() -> None:
    # Recorded a metre higher than it was, the antenna is right once it is lowered: what is left is
    # the clock, and the range's age of up to 0.2 s.
    tracks = range_errors(make_scene(lowered_m=ANTENNA_UP_M), ErrorDefinition.PAPER)
    for track in tracks:
        np.testing.assert_allclose(np.diff(track.t_s), 0.1, atol=1e-9)
        far = track.t_s < 10.0  # driving straight at the anchors, ranges shrink by the speed
        late_s = track.error_m[far] / SPEED_MPS
        assert late_s.min() > OFFSET_S * 0.9
        assert late_s.max() < OFFSET_S + 0.2
        same = np.diff(track.reading) == 0
        assert 0.4 < same.mean() < 0.6  # polled at 5 Hz, held on a timeline of 10 Hz


def test_an_anchor_without_readings_has_no_track() -> None:
    scene = make_scene()
    own = scene.ranges.anchor == 1
    log = RangeLog(scene.ranges.t_s[own], scene.ranges.anchor[own], scene.ranges.range_m[own])
    assert len(range_errors(replace(scene, ranges=log), ErrorDefinition.CORRECTED)) == 1


@pytest.mark.parametrize("definition", list(ErrorDefinition))
def test_a_survey_is_needed(definition: ErrorDefinition) -> None:
    scene = make_scene().without_truth()
    with pytest.raises(InputError, match="drive: expected surveyed anchors"):
        range_errors(scene, definition)
    with pytest.raises(InputError, match="drive: expected surveyed anchors"):
        true_range_m(scene, 0, np.array([1.0]))
