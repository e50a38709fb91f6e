"""Scenes and their parts: checked when built, never changed afterwards."""

from __future__ import annotations

from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest
from hypothesis import given, strategies as st
from hypothesis.extra import numpy as hnp

from gaia_uwb._shared.errors import InputError
from gaia_uwb.scene import ConeRanges, LocalFrame, RangeLog, Scene, Tag, Trajectory, Truth
from outside import annotations_off

DRIVE = Trajectory(
    t_s=np.array([0.0, 1.0, 2.0]),
    position_m=np.array([[0.0, 0.0], [3.0, 4.0], [3.0, 10.0]]),
    up_m=np.full(3, 1.6),
)
LOG = RangeLog(
    t_s=np.array([0.1, 0.1, 1.2]), anchor=np.array([0, 1, 0]), range_m=np.array([5.0, 6.0, -0.3])
)
SCENE = Scene(
    name="pass",
    trajectory=DRIVE,
    ranges=LOG,
    anchor_ids=("a", "b"),
    anchor_up_m=np.array([0.9, np.nan]),
    truth=Truth(np.zeros((2, 2)), nlos=np.array([True, False, False]), range_m=np.ones(3)),
)
TIMES = hnp.arrays(np.float64, st.integers(0, 8), elements=st.floats(-1e9, 1e9) | st.just(np.nan))


@pytest.mark.parametrize("lat_lon_alt", [(90.0, -180.0, 0.0), (-90.0, 180.0, -100.0)])
def test_frames_anywhere_on_earth(lat_lon_alt: tuple[float, float, float]) -> None:
    assert LocalFrame(*lat_lon_alt).alt_m == lat_lon_alt[2]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"lat_deg": 90.1}, r"lat_deg: expected a number between -90 and 90, got 90.1"),
        ({"lon_deg": -181.0}, "lon_deg: expected a number between"),
        ({"alt_m": float("inf")}, "alt_m: expected a number between"),
        ({"lat_deg": float("nan")}, "lat_deg: expected a number between"),
    ],
)
def test_frames_off_earth(changes: dict, message: str) -> None:
    with pytest.raises(InputError, match=message):
        replace(LocalFrame(48.0, 11.0), **changes)


def test_path_length() -> None:
    assert len(DRIVE) == 3
    assert DRIVE.path_length_m == pytest.approx(11.0)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"t_s": np.zeros(1)}, "t_s: expected at least 2 samples, got 1"),
        ({"t_s": np.zeros((3, 1))}, "t_s: expected at least 2 samples"),
        ({"t_s": np.array([0.0, 1.0, 1.0])}, "row 3, column t_s: expected increasing time"),
        ({"t_s": np.array([0.0, np.nan, 1.0])}, "row 2, column t_s: expected finite"),
        ({"position_m": np.zeros((3, 3))}, r"position_m: expected shape \(3, 2\), got \(3, 3\)"),
        ({"position_m": np.full((3, 2), np.inf)}, "row 1, column position_m: expected finite"),
        ({"up_m": np.zeros(2)}, "up_m: expected shape"),
        ({"up_m": np.array([0.0, 0.0, np.nan])}, "row 3, column up_m: expected finite"),
        ({"position_m": np.array([["a", "b"]] * 3)}, "position_m: expected float64 values"),
        ({"heading_rad": np.zeros(2)}, r"heading_rad: expected shape \(3,\)"),
        ({"roll_rad": np.array([0.0, np.inf, 0.0])}, "row 2, column roll_rad: .* got infinity"),
        ({"pitch_rad": np.array([-np.inf] * 3)}, "row 1, column pitch_rad: .* got infinity"),
        ({"lever_m": np.zeros(3)}, r"lever_m: expected shape \(3, 2\)"),
        ({"lever_m": np.full((3, 2), np.nan)}, "row 1, column lever_m: expected finite"),
    ],
)
def test_a_trajectory_refuses(changes: dict, message: str) -> None:
    with annotations_off(), pytest.raises(InputError, match=message):
        replace(DRIVE, **changes)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"t_s": np.zeros(0)}, "t_s: expected at least one range, got none"),
        ({"anchor": np.array([0, 1])}, r"anchor: expected shape \(3,\), got \(2,\)"),
        ({"anchor": np.array([0, -1, 0])}, "anchor: expected indices from 0, got -1"),
        ({"anchor": np.array([0.0, 1.0, 0.0])}, "anchor: expected int64 values, got float64"),
        ({"anchor": np.array([1, 1, 0])}, "row 2, column t_s: anchor 1 has two readings at 0.1000"),
        ({"range_m": np.zeros(4)}, "range_m: expected shape"),
        ({"range_m": np.array([1.0, np.nan, 1.0])}, "row 2, column range_m: expected finite"),
        ({"t_s": np.array([0.1, np.inf, 1.2])}, "row 2, column t_s: expected finite"),
        ({"t_s": np.array([0.1, 0.0, 1.2])}, "row 2, column t_s: expected increasing time"),
        ({"rssi_dbm": np.zeros(2)}, "rssi_dbm: expected shape"),
        ({"rssi_fp_dbm": np.zeros(2)}, "rssi_fp_dbm: expected shape"),
        ({"tag": np.zeros(2, np.int64)}, "tag: expected shape"),
        ({"tag": np.array([0, -1, 0])}, "tag: expected indices from 0, got -1"),
        (
            {"tag": np.array([1, 1, 0]), "anchor": np.zeros(3, np.int64)},
            "row 2, column t_s: anchor 0 has two readings by tag 1 at 0.1000",
        ),
        ({"azimuth_rad": np.zeros(2)}, "azimuth_rad: expected shape"),
        ({"azimuth_rad": np.array([0.0, 0.0, np.inf])}, "row 3, column azimuth_rad: .*infinity"),
        ({"azimuth_sigma_rad": np.ones(3)}, "azimuth_sigma_rad: needs azimuth_rad beside it"),
        (
            {"azimuth_rad": np.zeros(3), "azimuth_sigma_rad": np.array([0.1, np.nan, 0.0])},
            "row 3, column azimuth_sigma_rad: expected a number above 0 .*, got 0",
        ),
    ],
)
def test_a_range_log_refuses(changes: dict, message: str) -> None:
    with annotations_off(), pytest.raises(InputError, match=message):
        replace(LOG, **changes)


def test_a_repeat_is_found_across_the_blocks_of_the_check(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gaia_uwb.scene.readings._BLOCK", 2)
    anchor = np.array([0, 1, 2, 3, 0, 1])
    t_s = np.array([0.0, 1.0, 1.0, 1.0, 2.0, 2.0])
    RangeLog(t_s, anchor, np.ones(6))
    with pytest.raises(InputError, match=r"row 4.*anchor 1 has two readings at 1\.000000 s"):
        RangeLog(t_s, np.array([0, 1, 2, 1, 0, 1]), np.ones(6))


def test_two_tags_may_read_one_anchor_at_one_time() -> None:
    log = replace(LOG, anchor=np.zeros(3, np.int64), tag=np.array([0, 1, 0]))
    assert len(log) == 3


def test_an_angle_may_be_unknown() -> None:
    unknown = np.array([0.1, np.nan, 0.3])
    assert np.isnan(replace(LOG, azimuth_rad=unknown, azimuth_sigma_rad=unknown).azimuth_rad[1])
    assert np.isnan(replace(DRIVE, heading_rad=unknown).heading_rad[1])


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"tag_id": ""}, "tag_id: tag ids must be non-empty text"),
        (
            {"tag_id": "roof", "left_m": 51.0},
            "left_m: expected a number between -50 and 50 for tag roof, got 51",
        ),
        ({"tag_id": "roof", "up_m": float("nan")}, "up_m: expected a number .* got nan"),
    ],
)
def test_a_tag_refuses(values: dict, message: str) -> None:
    with pytest.raises(InputError, match=message):
        Tag(**values)


CONES = ConeRanges(np.array([0, 1]), np.array([1, 0]), np.array([6.0, 6.1]))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"range_m": np.zeros(0)}, "range_m: expected at least one range, got none"),
        ({"range_m": np.array([6.0, np.nan])}, "row 2, column range_m: expected finite"),
        ({"anchor_a": np.zeros(3, np.int64)}, r"anchor_a: expected shape \(2,\)"),
        ({"anchor_a": np.array([0, -1])}, "anchor_a: expected indices from 0, got -1"),
        ({"anchor_b": np.array([1, 1])}, "row 2, column anchor_b: expected two anchors, got 1"),
        ({"t_s": np.zeros(3)}, "t_s: expected shape"),
        ({"t_s": np.array([0.0, np.inf])}, "row 2, column t_s: expected finite"),
    ],
)
def test_ranges_between_cones_refuse(changes: dict, message: str) -> None:
    with annotations_off(), pytest.raises(InputError, match=message):
        replace(CONES, **changes)


def test_received_power_may_be_unknown() -> None:
    log = replace(LOG, rssi_dbm=np.array([-80.0, np.nan, -np.inf]))
    assert np.isnan(log.rssi_dbm[1])


@given(t_s=TIMES)
def test_any_times_give_a_checked_trajectory_or_an_input_error(t_s: np.ndarray) -> None:
    good = len(t_s) >= 2 and np.isfinite(t_s).all() and (np.diff(t_s) > 0).all()
    position_m = np.zeros((len(t_s), 2))
    if good:
        assert np.array_equal(Trajectory(t_s, position_m).t_s, t_s)
    else:
        with pytest.raises(InputError):
            Trajectory(t_s, position_m)


@given(t_s=TIMES, data=st.data())
def test_any_readings_give_a_checked_log_or_an_input_error(
    t_s: np.ndarray, data: st.DataObject
) -> None:
    anchor = data.draw(hnp.arrays(np.int64, len(t_s), elements=st.integers(-1, 3)))
    ordered = bool(len(t_s) and np.isfinite(t_s).all() and (np.diff(t_s) >= 0).all())
    unique = len(set(zip(t_s.tolist(), anchor.tolist(), strict=True))) == len(t_s)
    if ordered and unique and anchor.min() >= 0:
        assert len(RangeLog(t_s, anchor, np.zeros(len(t_s)))) == len(t_s)
    else:
        with pytest.raises(InputError):
            RangeLog(t_s, anchor, np.zeros(len(t_s)))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"anchor_m": np.zeros(2)}, r"anchor_m: expected shape \(N, 2\), got \(2,\)"),
        ({"anchor_m": np.zeros((2, 3))}, r"anchor_m: expected shape \(N, 2\)"),
        ({"anchor_m": np.full((2, 2), np.nan)}, "row 1, column anchor_m: expected finite"),
        ({"range_m": np.array([1.0, np.inf, 0.0])}, "row 2, column range_m: expected finite"),
        ({"bias_m": np.array([1.0, 0.0, np.nan])}, "row 3, column bias_m: expected finite"),
        ({"nlos": np.array([0, 1, 0])}, "nlos: expected bool values, got int64"),
        ({"outlier": np.array([0, 1, 0])}, "outlier: expected bool values, got int64"),
    ],
)
def test_a_truth_refuses(changes: dict, message: str) -> None:
    with annotations_off(), pytest.raises(InputError, match=message):
        replace(SCENE.truth, **changes)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"anchor_ids": ()}, "pass, column anchor_id: expected at least one anchor"),
        ({"anchor_ids": ("a", "a")}, "pass, column anchor_id: anchor ids must be unique"),
        (
            {"anchor_ids": ("a",)},
            "pass, column anchor: a reading refers to anchor 1, but there are",
        ),
        ({"anchor_up_m": np.zeros(3)}, r"pass, column anchor_up_m: expected shape \(2,\)"),
        ({"anchor_up_m": np.array([1.0, np.inf])}, "pass, row 2, column anchor_up_m: .*infinity"),
        ({"truth": Truth(np.zeros((3, 2)))}, r"pass, column truth.anchor_m: expected shape \(2, 2"),
        (
            {"truth": Truth(np.zeros((2, 2)), nlos=np.zeros(4, dtype=bool))},
            r"pass, column truth.nlos: expected shape \(3,\)",
        ),
        (
            {"truth": Truth(np.zeros((2, 2)), outlier=np.zeros(2, dtype=bool))},
            r"pass, column truth.outlier: expected shape \(3,\)",
        ),
        (
            {"truth": Truth(np.zeros((2, 2)), range_m=np.zeros(4))},
            "pass, column truth.range_m: expected shape",
        ),
        (
            {"tags": (Tag("1"), Tag("2"))},
            "pass, column tag: there are 2 tags: ranges.tag must say which took what",
        ),
        ({"tags": (Tag("1"), Tag("1"))}, "pass, column tag_id: tag ids must be unique, got '1'"),
        (
            {"ranges": replace(LOG, tag=np.array([0, 1, 0])), "tags": (Tag("1"),)},
            "pass, column tag: a reading refers to tag 1, but there are 1 tags, numbered from 0",
        ),
        (
            {"ranges": replace(LOG, tag=np.array([0, 1, 0]))},
            "pass, column tag: a reading refers to tag 1, but there are 0 tags$",
        ),
        (
            {"cone_ranges": replace(CONES, anchor_b=np.array([2, 0]))},
            "pass, column cone_ranges.anchor_b: a reading refers to anchor 2, but there are 2",
        ),
    ],
)
def test_a_scene_refuses(changes: dict, message: str) -> None:
    with annotations_off(), pytest.raises(InputError, match=message):
        replace(SCENE, **changes)


def test_nothing_can_be_changed() -> None:
    with pytest.raises(FrozenInstanceError):
        SCENE.name = "other"  # type: ignore[misc]  # the point of the test
    arrays = (DRIVE.t_s, DRIVE.position_m, DRIVE.up_m, LOG.t_s, LOG.anchor, LOG.range_m)
    for array in (
        *arrays,
        SCENE.anchor_up_m,
        SCENE.truth.anchor_m,
        SCENE.truth.nlos,
        CONES.range_m,
    ):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0


def test_without_truth_nothing_else_changes() -> None:
    blind = SCENE.without_truth()
    assert blind.truth is None
    assert blind.ranges is SCENE.ranges
    assert blind.trajectory is SCENE.trajectory
    assert blind.n_anchors == 2
    assert "truth" not in repr(SCENE)
