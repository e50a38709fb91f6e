"""Each limit is named where it is there, with its numbers, and only there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import nan
from typing import Any

import numpy as np
import pytest

from factories import SQUARE_M, make_fix, make_reconstruction, make_unlocated
from gaia_uwb.config import AlignmentConfig, KnownAnchor, PipelineConfig, PriorConfig, make_config
from gaia_uwb.episode import ClockOffset, RangeCalibration
from gaia_uwb.estimate import AnchorFix, AnchorStatus, Reason, ReasonKind
from gaia_uwb.evaluate.advice import Advice
from gaia_uwb.evaluate.limits import Limit, find_limits, limits_of_reasons
from gaia_uwb.reconstruction import Reconstruction

DEFAULTS = PipelineConfig()
LEVEL = {"tag_up_m": np.full(200, 1.5), "anchor_up_m": np.full(4, 1.0)}


def limits_of(reconstruction: Reconstruction, **changes: Any) -> dict[ReasonKind, Limit]:
    """Return what limited a reconstruction, with its heights known, by kind."""
    shape = {"tag_up_m": np.full(reconstruction.episode.n_steps, 1.5)}
    shape["anchor_up_m"] = np.full(reconstruction.episode.n_anchors, 1.5)
    episode = replace(reconstruction.episode, **(shape | changes))
    found = find_limits(episode, reconstruction.anchors, reconstruction.config)
    assert len({limit.kind for limit in found}) == len(found)
    return {limit.kind: limit for limit in found}


def limits_of_fix(**changes: object) -> dict[ReasonKind, Limit]:
    """Return the limits of a reconstruction of which the first fix is changed."""
    fix = make_fix("cone-0", SQUARE_M[0], **changes)
    return limits_of(make_reconstruction(changed={0: fix}))


def test_a_good_result_has_none() -> None:
    assert limits_of(make_reconstruction()) == {}


@pytest.mark.parametrize(("sigma_s", "limited"), [(0.02, False), (0.03, True), (0.5, True)])
def test_clock_counts_by_what_it_moves(sigma_s: float, limited: bool) -> None:
    clock = ClockOffset(0.0, sigma_s, applied=False, reason="the drive is too steady")
    found = limits_of(make_reconstruction(), clock=clock)
    assert (ReasonKind.CLOCK in found) is limited  # at 2.26 m/s, 0.027 s are 0.1 m with 90 %
    if limited:
        speed_mps = 45.0 / 199 / 0.1
        shift_m = 1.645 * sigma_s * speed_mps
        assert f"± {shift_m:.2f} m (90 %) along the road" in found[ReasonKind.CLOCK].text
        assert Advice.BOTH_WAYS in found[ReasonKind.CLOCK].advice


def test_a_clock_that_was_trusted_is_no_limit() -> None:
    assert limits_of(make_reconstruction(), clock=None) == {}


def test_unknown_side_of_a_straight_path() -> None:
    found = limits_of_fix(status=AnchorStatus.AMBIGUOUS, mirror_probability=0.37)
    text = found[ReasonKind.AMBIGUOUS].text
    assert text.startswith("The side of the path is uncertain for cone-0")
    assert "the other side has 37 % probability" in text
    assert "45.0 m long within a strip of 0.00 m" in text
    advice = found[ReasonKind.AMBIGUOUS].advice
    assert advice == (
        Advice.SECOND_DRIVE, Advice.WEAVE, Advice.STATE_SIDE, Advice.SURVEY, Advice.SECOND_TAG,
    )  # fmt: skip


def test_unknown_side_of_a_bent_path_does_not_blame_the_path() -> None:
    fix = make_fix("cone-0", SQUARE_M[0], status=AnchorStatus.AMBIGUOUS, mirror_probability=0.1)
    reconstruction = make_reconstruction(changed={0: fix})
    bent_m = reconstruction.episode.position_m + np.sin(np.arange(200) / 20.0)[:, None] * [0, 2]
    found = limits_of(reconstruction, position_m=bent_m)
    assert "straight" not in found[ReasonKind.AMBIGUOUS].text


def advice_for_an_open_side(
    config: PipelineConfig = DEFAULTS, passes: Sequence[np.ndarray] = (), **changes: Any
) -> tuple[Advice, ...]:
    """Return what is advised about a cone whose side is open, with passes along other paths."""
    fix = make_fix("cone-0", SQUARE_M[0], status=AnchorStatus.AMBIGUOUS, mirror_probability=0.4)
    made = make_reconstruction(changed={0: fix})
    episode = replace(made.episode, **changes)
    others = [replace(episode, position_m=path_m) for path_m in passes]
    found = find_limits(episode, made.anchors, config, passes=(episode, *others))
    return tuple(advice for limit in found for advice in limit.advice)


def stated(**prior: Any) -> PipelineConfig:
    return PipelineConfig(prior=PriorConfig(**prior))


LINE_M = make_reconstruction().episode.position_m


def test_a_side_that_was_stated_is_not_asked_for() -> None:
    assert Advice.STATE_SIDE in advice_for_an_open_side(stated(closure="lane-closure"))
    told = advice_for_an_open_side(stated(side="left"))
    assert Advice.STATE_SIDE not in told
    assert not any("--side" in advice for advice in told)
    assert Advice.SURVEY in told


@pytest.mark.parametrize(("surveyed", "asked"), [("cone-0", False), ("cone-1", True)])
def test_a_cone_that_was_surveyed_is_not_to_be_surveyed(surveyed: str, asked: bool) -> None:
    known = KnownAnchor(anchor_id=surveyed, east_m=0.0, north_m=0.0)
    told = advice_for_an_open_side(stated(known_anchors=(known,)))
    assert (Advice.SURVEY in told) is asked


@pytest.mark.parametrize(("lane_m", "other_lane"), [(0.5, True), (3.6, False)])
def test_a_second_pass_is_not_asked_for_twice(lane_m: float, other_lane: bool) -> None:
    alone = advice_for_an_open_side()
    assert Advice.SECOND_DRIVE in alone
    assert Advice.WEAVE in alone
    assert Advice.OTHER_LANE not in alone
    told = advice_for_an_open_side(passes=[LINE_M + np.array([0.0, lane_m])])
    assert Advice.SECOND_DRIVE not in told
    assert Advice.WEAVE not in told
    assert (Advice.OTHER_LANE in told) is other_lane


def test_who_wove_is_not_asked_to() -> None:
    woven_m = LINE_M + np.sin(np.arange(200) / 20.0)[:, None] * [0, 3]
    told = advice_for_an_open_side(position_m=woven_m)
    assert Advice.WEAVE not in told
    assert Advice.SECOND_DRIVE in told


UNSURE = ClockOffset(0.0, 0.5, applied=False, reason="the drive is too steady")


@pytest.mark.parametrize(("path_m", "asked"), [(LINE_M, True), (LINE_M[::-1], False)])
def test_the_other_direction_is_not_asked_for_twice(path_m: np.ndarray, asked: bool) -> None:
    told = advice_for_an_open_side(passes=[path_m], clock=UNSURE)
    assert (Advice.BOTH_WAYS in told) is asked
    assert Advice.ONE_CLOCK in told


def test_who_trusts_the_clocks_gets_no_advice_on_them() -> None:
    trusted = PipelineConfig(alignment=AlignmentConfig(clock_offset="off"))
    told = advice_for_an_open_side(trusted, clock=UNSURE)
    assert not {Advice.BOTH_WAYS, Advice.ONE_CLOCK, Advice.CALIBRATE_VEHICLE} & set(told)


def test_a_vehicle_whose_clock_is_known_is_not_to_be_calibrated() -> None:
    known = make_config({"vehicles": {"": {"clock_offset_s": {"value": 0.1, "sigma": 0.4}}}})
    assert Advice.CALIBRATE_VEHICLE not in advice_for_an_open_side(known, clock=UNSURE)
    assert Advice.CALIBRATE_VEHICLE in advice_for_an_open_side(clock=UNSURE)


@pytest.mark.parametrize("known", [True, False])
def test_heights_that_are_known_are_not_to_be_measured(known: bool) -> None:
    calibration = RangeCalibration(np.array([0.5, 0.0]), np.eye(2) * 0.01, 0.06, 4.0)
    heights = {} if known else {"tag_up_m": None}
    found = limits_of(make_reconstruction(), calibration=calibration, **heights)
    assert (Advice.HEIGHTS in found[ReasonKind.RANGE_BIAS].advice) is not known


def test_a_pass_in_which_nothing_was_heard() -> None:
    episode = make_reconstruction().episode
    silent = {"valid": np.zeros_like(episode.valid), "range_m": np.full_like(episode.range_m, nan)}
    changed = {k: make_unlocated(f"cone-{k}") for k in range(4)}
    found = limits_of(make_reconstruction(changed=changed), **silent)
    assert set(found) == {ReasonKind.TOO_FEW_RANGES}


def test_poor_geometry_names_the_worst_and_both_axes() -> None:
    found = limits_of_fix(status=AnchorStatus.ILL_CONDITIONED, covariance_m2=np.diag([9.0, 0.01]))
    text = found[ReasonKind.ILL_CONDITIONED].text
    assert "the worst is cone-0, ± 6.44 m in one direction and ± 0.21 m across it" in text


def test_poor_geometry_without_a_covariance() -> None:
    found = limits_of_fix(
        status=AnchorStatus.ILL_CONDITIONED, covariance_m2=np.full((2, 2), np.nan)
    )
    assert found[ReasonKind.ILL_CONDITIONED].text.endswith("poorly in at least one direction.")


def test_not_settled() -> None:
    found = limits_of_fix(status=AnchorStatus.NOT_CONVERGED)
    assert "cone-0 did not reach a stable position" in found[ReasonKind.NOT_CONVERGED].text


def test_ranges_that_fit_no_position() -> None:
    found = limits_of_fix(status=AnchorStatus.DOES_NOT_FIT)
    limit = found[ReasonKind.DOES_NOT_FIT]
    assert limit.text == "The ranges to cone-0 do not fit one position."
    assert Advice.CHECK_LOG in limit.advice


def test_lost_cones_say_how_many_ranges_were_missing() -> None:
    found = limits_of(make_reconstruction(changed={1: make_unlocated("cone-1")}))
    text = found[ReasonKind.TOO_FEW_RANGES].text
    assert text == ("No position was found for cone-1: 2 usable ranges, and 4 are needed.")
    assert Advice.SLOWER not in found[ReasonKind.TOO_FEW_RANGES].advice  # it went 2 m/s


@pytest.mark.parametrize(("n_ranges", "limited"), [(29, True), (30, False)])
def test_few_ranges(n_ranges: int, limited: bool) -> None:
    assert (ReasonKind.FEW_RANGES in limits_of_fix(n_ranges=n_ranges)) is limited


def test_driving_slower_is_advised_to_who_drove_fast() -> None:
    reconstruction = make_reconstruction(changed={0: make_fix("cone-0", SQUARE_M[0], n_ranges=9)})
    found = limits_of(reconstruction, t_s=reconstruction.episode.t_s / 5.0)
    assert Advice.SLOWER in found[ReasonKind.FEW_RANGES].advice


def test_moved_cones_and_passes_of_different_zones_ask_for_a_look() -> None:
    fix = make_fix("cone-0", SQUARE_M[0], status=AnchorStatus.MOVED)
    found = limits_of(make_reconstruction(changed={0: fix}))
    assert "The position of cone-0 differs between passes" in found[ReasonKind.MOVED].text
    assert found[ReasonKind.MOVED].advice == (Advice.CHECK_CONES,)
    passes, statement = limits_of_reasons(
        [
            Reason(ReasonKind.NOT_ONE_ZONE, "the passes differ"),
            Reason(ReasonKind.MISFIT, "something else"),
            Reason(ReasonKind.STATEMENT, 'not "this"'),
        ]
    )
    assert (passes.kind, passes.advice) == (ReasonKind.NOT_ONE_ZONE, (Advice.CHECK_PASSES,))
    assert (statement.kind, statement.advice) == (ReasonKind.STATEMENT, (Advice.CHECK_STATEMENT,))
    assert statement.text == 'Not "this".'


def test_a_clock_that_nobody_knows_is_not_blamed_on_the_cones() -> None:
    fixes = {k: make_fix(f"cone-{k}", SQUARE_M[k], status=AnchorStatus.ILL_CONDITIONED)
             for k in range(4)}  # fmt: skip
    reconstruction = make_reconstruction(changed=fixes)
    unknown = ClockOffset(0.0, 0.5, applied=False, reason="too steady")
    fast = {"t_s": reconstruction.episode.t_s / 5.0, "clock": unknown}
    assert ReasonKind.ILL_CONDITIONED in limits_of(reconstruction)
    found = limits_of(reconstruction, **fast)
    assert ReasonKind.CLOCK in found
    assert ReasonKind.ILL_CONDITIONED not in found


@pytest.mark.parametrize(("steps", "limited"), [(15, False), (40, True)])
def test_gaps(steps: int, limited: bool) -> None:
    reconstruction = make_reconstruction()
    valid = reconstruction.episode.valid.copy()
    valid[100 : 100 + steps, 2] = False
    range_m = np.where(valid, reconstruction.episode.range_m, np.nan)
    found = limits_of(reconstruction, valid=valid, range_m=range_m)
    assert (ReasonKind.GAPS in found) is limited
    if limited:
        assert "cone-2 was out of range or blocked for 4.1 s." in found[ReasonKind.GAPS].text


@pytest.mark.parametrize(("steps", "limited"), [(8, False), (40, True)])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_blocked_line_of_sight_reads_too_long(steps: int, limited: bool, sign: float) -> None:
    reconstruction = make_reconstruction()
    range_m = reconstruction.episode.range_m.copy()
    range_m[100 : 100 + steps, 1] += 0.8 * sign
    found = limits_of(reconstruction, range_m=range_m)
    assert (ReasonKind.BLOCKED in found) is (limited and sign > 0)
    if ReasonKind.BLOCKED in found:
        assert "Of the ranges to cone-1, 20 % are too long by more than 0.30 m" in (
            found[ReasonKind.BLOCKED].text
        )


def test_ranges_to_a_poor_place_blame_no_obstacle() -> None:
    fix = make_fix("cone-0", SQUARE_M[0] + 5.0, status=AnchorStatus.ILL_CONDITIONED)
    found = limits_of(make_reconstruction(changed={0: fix}))
    assert set(found) == {ReasonKind.ILL_CONDITIONED}


@pytest.mark.parametrize(("bias_m", "way"), [(0.5, "long"), (-0.5, "short"), (0.3, "")])
def test_common_range_bias(bias_m: float, way: str) -> None:
    calibration = RangeCalibration(np.array([bias_m, 0.0]), np.eye(2) * 0.01, 0.06, 4.0)
    found = limits_of(make_reconstruction(), calibration=calibration)
    assert set(found) == ({ReasonKind.RANGE_BIAS} if way else set())
    if way:
        assert f"All ranges are 0.50 m too {way} at 10 m" in found[ReasonKind.RANGE_BIAS].text


def test_own_range_bias_of_a_cone() -> None:
    found = limits_of_fix(range_bias_m=-0.2)
    assert "ranges to cone-0 have a bias of their own, 0.20 m." in found[ReasonKind.RANGE_BIAS].text


def test_misfit_of_the_whole_log() -> None:
    calibration = RangeCalibration(np.zeros(2), np.eye(2) * 0.01, 3.0, 4.0)
    found = limits_of(make_reconstruction(), calibration=calibration)
    assert "more than 2.01 m" in found[ReasonKind.MISFIT].text
    assert found[ReasonKind.MISFIT].advice == (Advice.CHECK_LOG,)


def test_unknown_heights_count_where_cones_were_near() -> None:
    found = limits_of(make_reconstruction(), tag_up_m=None)
    nearest_m = float(np.nanmin(make_reconstruction().episode.range_m))
    change_m = np.hypot(nearest_m, 1.0) - nearest_m
    assert f"At the shortest range, {nearest_m:.2f} m, " in found[ReasonKind.HEIGHTS].text
    assert f"changes a range by {change_m:.2f} m." in found[ReasonKind.HEIGHTS].text
    far = make_reconstruction(SQUARE_M + np.array([0.0, 40.0]))
    assert ReasonKind.HEIGHTS not in limits_of(far, tag_up_m=None)


def test_hardly_moved() -> None:
    reconstruction = make_reconstruction(SQUARE_M + np.array([0.0, 200.0]))
    assert ReasonKind.SHORT_PATH in limits_of(reconstruction)


@pytest.mark.parametrize("n", [1, 2])
def test_too_few_cones_for_an_area(n: int) -> None:
    found = limits_of(make_reconstruction(SQUARE_M[:n]))
    assert set(found) == {ReasonKind.TOO_FEW_CONES}
    assert f"The log has {n} cone" in found[ReasonKind.TOO_FEW_CONES].text


def test_many_cones_are_not_all_named() -> None:
    angle = np.arange(9) * 2.0 * np.pi / 9
    ring_m = 5.0 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    changed: dict[int, AnchorFix] = {k: make_unlocated(f"cone-{k}") for k in range(7)}
    text = limits_of(make_reconstruction(ring_m, changed=changed))[ReasonKind.TOO_FEW_RANGES].text
    assert "cone-0, cone-1, cone-2, cone-3, cone-4 and 2 more:" in text


def test_ids_are_written_as_asked() -> None:
    found = find_limits(
        make_reconstruction().episode,
        (*[make_unlocated("*")] * 3, make_fix("cone-3", SQUARE_M[3])),
        name=lambda text: f"<{text}>",
    )
    lost = next(limit for limit in found if limit.kind is ReasonKind.TOO_FEW_RANGES)
    assert "for <*>, <*> and <*>:" in lost.text


def test_nothing_at_all_was_located() -> None:
    changed = {k: make_unlocated(f"cone-{k}") for k in range(4)}
    assert set(limits_of(make_reconstruction(changed=changed))) == {ReasonKind.TOO_FEW_RANGES}
