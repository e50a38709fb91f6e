from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gaia_uwb._shared.errors import InputError
from gaia_uwb.estimate import ReasonKind
from gaia_uwb.evaluate.log_check import CheckReport, check_scene
from gaia_uwb.evaluate.outdoor_check import check_outdoor_static
from gaia_uwb.pipeline import reconstruct
from gaia_uwb.scene import LocalFrame, RangeLog, Scene, Trajectory, Truth
from gaia_uwb.simulate import PRESETS, simulate_pass


def make_scene(**changes: object) -> Scene:
    """Return a round drive past three anchors that answer 10 times a second, all in order."""
    t_s = np.arange(0.0, 60.0, 0.125)
    angle_rad = t_s / 60 * 2 * np.pi
    position_m = 20 * np.column_stack([np.cos(angle_rad), np.sin(angle_rad)])
    anchor_m = np.array([[0.0, 0.0], [12.0, 0.0], [0.0, 10.0]])
    range_t_s = np.repeat(np.arange(0.05, 59.5, 0.1), 3)
    anchor = np.tile(np.arange(3), len(range_t_s) // 3)
    at_m = np.stack([np.interp(range_t_s, t_s, axis) for axis in position_m.T], axis=1)
    range_m = np.linalg.norm(at_m - anchor_m[anchor], axis=1)
    # The range to the circle's centre does not change; a little noise keeps it from repeating.
    range_m += np.random.default_rng(0).normal(0, 0.01, len(range_m))
    scene = Scene(
        name="round",
        trajectory=Trajectory(t_s, position_m, np.ones(len(t_s))),
        ranges=RangeLog(range_t_s, anchor, range_m, rssi_dbm=np.full(len(range_m), -80.0)),
        anchor_ids=("a", "b", "c"),
        anchor_up_m=np.ones(3),
        frame=LocalFrame(48.0, 11.0),
        truth=Truth(anchor_m),
    )
    return replace(scene, **changes)  # type: ignore[arg-type]


def with_ranges(scene: Scene, index: slice | list[int], value: float) -> Scene:
    """Return the scene with readings of anchor a replaced."""
    range_m = scene.ranges.range_m.copy()
    range_m[np.flatnonzero(scene.ranges.anchor == 0)[index]] = value
    return replace(scene, ranges=replace(scene.ranges, range_m=range_m))


def test_a_good_log() -> None:
    report = check_scene(make_scene())
    assert report.problems == report.notes == ()
    assert report.drive is not None
    assert report.drive.rate_hz == pytest.approx(8.0)
    assert report.drive.path_length_m == pytest.approx(2 * np.pi * 20 * 59.875 / 60, rel=1e-3)
    assert report.drive.straightness == pytest.approx(1.0, abs=0.01)
    for anchor in report.anchors:
        assert (anchor.n_readings, anchor.n_kept, anchor.n_gaps) == (595, 595, 0)
        assert (anchor.negative_share, anchor.rssi_share) == (0.0, 1.0)
        assert anchor.rate_hz == pytest.approx(10.0)
    assert report.lines()[-1] == "  no problems found"


def test_counts_what_is_dropped() -> None:
    scene = with_ranges(make_scene(), [100, 101], 3.5)  # a burst of two, the second a repeat
    scene = with_ranges(scene, [200], -2.0)
    a, b, _ = check_scene(scene).anchors
    assert (a.n_kept, a.n_spikes, a.n_in_gaps, a.n_outside) == (592, 3, 0, 0)
    assert a.negative_share == pytest.approx(1 / 595)
    assert a.repeat_share == pytest.approx(1 / 595)
    assert (b.n_kept, b.n_spikes) == (595, 0)


def test_counts_gaps_and_readings_outside_the_drive() -> None:
    log = make_scene().ranges
    keep = ~((log.anchor == 0) & (log.t_s > 10.0) & (log.t_s < 15.0))
    ranges = RangeLog(log.t_s[keep] - 10.0, log.anchor[keep], log.range_m[keep])
    report = check_scene(make_scene(ranges=ranges, truth=None))
    a = report.anchors[0]
    assert (a.n_gaps, a.rssi_share) == (1, 0.0)
    assert a.longest_gap_s == pytest.approx(5.1)
    assert (a.n_outside, a.n_in_gaps, a.n_kept) == (100, 0, 445)
    assert "300 of 1735 readings are outside the trajectory's time, or in its gaps" in report.notes


def test_a_slow_radio_has_no_gap_at_every_step() -> None:
    log = make_scene().ranges
    slow = (np.arange(len(log)) // 3) % 6 == 0  # every 0.6 s
    keep = slow & ~((log.anchor == 0) & (log.t_s > 10.0) & (log.t_s < 15.0))
    ranges = RangeLog(log.t_s[keep], log.anchor[keep], log.range_m[keep])
    a, b, _ = check_scene(make_scene(ranges=ranges, truth=None)).anchors
    assert (a.n_gaps, b.n_gaps) == (1, 0)


def test_a_parked_vehicle() -> None:
    t_s = np.arange(0.0, 60.0, 0.125)
    parked = Trajectory(t_s, np.random.default_rng(0).normal(0, 0.02, (len(t_s), 2)))
    report = check_scene(make_scene(trajectory=parked))
    (problem,) = report.problems
    assert problem.startswith("round: the vehicle hardly moves: its path spans 0.1")
    assert [anchor.n_kept for anchor in report.anchors] == [0, 0, 0]
    still = Trajectory(t_s, np.zeros((len(t_s), 2)))
    assert "0.00 m" in check_scene(make_scene(trajectory=still)).problems[0]


def test_a_straight_path() -> None:
    report = check_scene(simulate_pass(PRESETS["straight"], seed=0))
    assert any(note.startswith("the path is straight") for note in report.notes)
    assert not report.problems  # the zone as a whole may tell the sides
    assert report.drive is not None
    assert report.drive.straightness == pytest.approx(0.0, abs=1e-3)


def test_anchors_that_cannot_be_located() -> None:
    log = make_scene().ranges
    keep = (log.anchor != 0) | (log.t_s < 0.4)
    scene = make_scene(
        ranges=RangeLog(log.t_s[keep], log.anchor[keep], log.range_m[keep]),
        anchor_ids=("a", "b", "c", "silent"),
        anchor_up_m=None,
        truth=None,
    )
    assert check_scene(scene).problems == (
        "a: 4 of its 4 readings can be used, too few to locate it",
        "silent: no readings",
        "a boundary needs 3 cones, and this log can give 2",
    )


def test_numbers_that_stand_for_no_range() -> None:
    report = check_scene(with_ranges(make_scene(), slice(0, 400), -1.0))
    assert report.anchors[0].negative_share == pytest.approx(400 / 595)
    assert (
        "a: 400 of its 595 ranges are below 0: does a number stand for no range?" in report.problems
    )


def two_radios_with_one_id() -> Scene:
    """Return a log in which a's readings come from its place and from another one in turn."""
    scene = make_scene()
    log = scene.ranges
    range_m = log.range_m.copy()
    mine = np.flatnonzero(log.anchor == 0)
    other = mine[np.arange(len(mine)) % 5 < 2]
    path = scene.trajectory
    at_m = np.stack([np.interp(log.t_s[other], path.t_s, axis) for axis in path.position_m.T], 1)
    range_m[other] = np.hypot(*(at_m - [14.0, -9.0]).T)
    return replace(scene, ranges=replace(log, range_m=range_m))


def parked() -> Scene:
    t_s = np.arange(0.0, 60.0, 0.125)
    drive = Trajectory(t_s, np.random.default_rng(0).normal(0, 0.02, (len(t_s), 2)))
    return make_scene(trajectory=drive)


def too_short_a_path() -> Scene:
    return simulate_pass(PRESETS["wild"], seed=1)


BAD_LOGS = {
    "two radios with one id": two_radios_with_one_id(),
    "numbers for no range": with_ranges(make_scene(), slice(0, 400), -1.0),
    "in feet": replace(
        make_scene(),
        ranges=replace(make_scene().ranges, range_m=make_scene().ranges.range_m / 0.3048),
    ),
    "a reader's problem": replace(make_scene(), problems=("the clock was set back",)),
    "too long by 2 m": replace(
        make_scene(), ranges=replace(make_scene().ranges, range_m=make_scene().ranges.range_m + 2.0)
    ),
    "a path of seconds": too_short_a_path(),
    "no problem": make_scene(),
    "straight": simulate_pass(PRESETS["straight"], seed=0),
    "simulated": simulate_pass(PRESETS["lane-closure"], seed=0),
}


@pytest.mark.parametrize("what", BAD_LOGS)
def test_a_check_and_a_reconstruction_say_the_same_of_a_log(what: str) -> None:
    scene = BAD_LOGS[what]
    report, result = check_scene(scene), reconstruct(scene)
    of_log = (ReasonKind.LOG, ReasonKind.CLOCK, ReasonKind.MISFIT, ReasonKind.RANGE_BIAS)
    said = [str(reason) for reason in result.reasons if reason.kind in of_log]
    assert list(report.problems) == said
    assert [anchor.n_kept for anchor in report.anchors] == [fix.n_ranges for fix in result.anchors]
    assert set(result.notes) <= set(report.notes)


def test_what_a_reconstruction_refuses_is_a_problem() -> None:
    far = replace(make_scene().ranges, t_s=make_scene().ranges.t_s + 3600.0)
    for scene in (parked(), make_scene(ranges=far)):
        with pytest.raises(InputError) as refused:
            reconstruct(scene)
        assert check_scene(scene).problems == (str(refused.value),)


def test_two_radios_with_one_id_are_named() -> None:
    report = check_scene(two_radios_with_one_id())
    assert report.anchors[0].n_spikes > 595 / 3
    assert any("a: 2" in problem and "dropped as spikes" in problem for problem in report.problems)


def test_too_few_anchors() -> None:
    log = make_scene().ranges
    mine = log.anchor == 0
    ranges = RangeLog(log.t_s[mine], log.anchor[mine], log.range_m[mine])
    scene = make_scene(ranges=ranges, anchor_ids=("a",), anchor_up_m=None, truth=None)
    assert check_scene(scene).problems == ("a boundary needs 3 cones, and this log can give 1",)


def test_notes_what_is_unknown() -> None:
    keep = np.r_[0:100, 200:480]
    drive = make_scene().trajectory
    gappy = Trajectory(drive.t_s[keep], drive.position_m[keep])
    scene = make_scene(trajectory=gappy, frame=None, truth=None)
    assert check_scene(replace(scene, notes=("ranges.csv: sorted",))).notes == (
        "ranges.csv: sorted",
        "the trajectory has a gap of 12.6 s",
        "378 of 1785 readings are outside the trajectory's time, or in its gaps",
        "not all heights are known: ranges are treated as horizontal where one is missing",
        "no geographic reference: results are in local metres, and no feed can be written",
        "no surveyed cones: nothing to score against",
    )


def test_lines_are_text_for_people() -> None:
    scene = with_ranges(make_scene(frame=None), [100], -8.0)
    lines = check_scene(scene).lines()
    clock = [line for line in lines if "clock offset" in line]
    assert len(clock) == 1 and clock[0].startswith("  clock offset: 0 s ± ")
    assert "not corrected" in clock[0]
    assert [line for line in lines if line not in clock] == [
        "round",
        "  path: 480 samples in 59.9 s (8.0 Hz), 125.4 m long within 56.6 m",
        "  cone          readings     Hz   gaps  longest     kept   spikes  in gaps  outside  "
        "negative  repeats   RSSI",
        "  a                  595   10.0      0    0.1 s      594        1        0        0     "
        "0.17%     0.0%   100%",
        "  b                  595   10.0      0    0.1 s      595        0        0        0     "
        "0.00%     0.0%   100%",
        "  c                  595   10.0      0    0.1 s      595        0        0        0     "
        "0.00%     0.0%   100%",
        "  in range: at least one cone for 100% of the drive, at least three for 100%",
        "  cone           nearest   view     DOP   side of the path",
        "  a               20.0 m   356°     0.5   clear",
        "  b                8.0 m   351°     0.5   clear",
        "  c               10.0 m   357°     0.5   clear",
        "  DOP: metres of position error per metre of lasting range error; 2 is good, above 5 is "
        "poor",
        "  note: no geographic reference: results are in local metres, and no feed can be written",
        "  no problems found",
    ]


def test_a_name_of_two_lines_takes_one() -> None:
    report = check_scene(replace(make_scene(), name="a\nb", anchor_ids=("c\nd", "e", "f")))
    assert report.lines()[0] == "a\\nb"
    assert any("c\\nd" in line for line in report.lines())
    assert not any("\n" in line for line in report.lines())


def test_a_log_that_cannot_be_read() -> None:
    error = InputError("is empty", source="x/ranges.csv")
    report = CheckReport.of_failure("x", error)
    assert not report.readable
    assert report.lines() == ["x", "  PROBLEM: x/ranges.csv: is empty"]


def test_static_files(tmp_path: Path) -> None:
    header = (
        "timestamp,Distance,RSSI(dBm),RSSI_fp(dBm),maxNoise,Standard Noise,FirstPathAmp1,"
        "FirstPathAmp2,FirstPathAmp3,Max Growth CIR,Rx Preamble Count,rtd_init,rtd_resp,"
        "poll_tx_ts,poll_rx_ts,resp_tx_ts,resp_rx_ts"
    )
    row = ",".join(["1"] * 17)
    folder = tmp_path / "Static_measurements/NLOS/height_50.0cm"
    folder.mkdir(parents=True)
    for distance, rows in ((2, [row] * 60), (4, [row, "x" + row]), (6, [])):
        (folder / f"{distance}m.csv").write_text("\n".join([header, *rows]))
    assert check_outdoor_static(tmp_path).notes == (
        "3 files with 61 readings",
        "1 files have no readings: NLOS/height_50.0cm/6m.csv",
        "1 files have fewer than 50 readings: NLOS/height_50.0cm/4m.csv",
        "1 files have garbled rows: NLOS/height_50.0cm/4m.csv",
    )
    with pytest.raises(InputError, match="has no Static_measurements"):
        check_outdoor_static(tmp_path / "Static_measurements")
