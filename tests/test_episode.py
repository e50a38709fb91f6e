"""Episodes: checked, read-only, cut into windows without a copy."""

from __future__ import annotations

from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest
from hypothesis import given, strategies as st
from hypothesis.extra import numpy as hnp

from gaia_uwb._shared.errors import InputError
from gaia_uwb.denoised import DenoisedRanges
from gaia_uwb.episode import (
    ClockOffset,
    Episode,
    EpisodeTruth,
    RangeCalibration,
    ReadingCounts,
    bias_basis,
)
from outside import annotations_off


def make_episode(n_steps: int = 10) -> Episode:
    range_m = 5.0 + np.arange(2.0 * n_steps).reshape(n_steps, 2)
    range_m[1, 0] = np.nan
    truth = EpisodeTruth(
        np.zeros((2, 2)), np.nan_to_num(range_m), np.zeros((n_steps, 2), dtype=bool)
    )
    return Episode(
        name="pass",
        anchor_ids=("a", "b"),
        t_s=np.arange(n_steps) * 0.1,
        position_m=np.arange(2.0 * n_steps).reshape(n_steps, 2),
        range_m=range_m,
        valid=np.isfinite(range_m),
        tag_up_m=np.full(n_steps, 1.6),
        anchor_up_m=np.array([0.9, np.nan]),
        truth=truth,
    )


EPISODE = make_episode()
DENOISED = DenoisedRanges(EPISODE.range_m, np.where(EPISODE.valid, 0.1, np.nan), EPISODE.valid)


def test_only_an_applied_offset_shifts() -> None:
    assert ClockOffset(0.2, 0.01, True, "").applied_s == 0.2
    assert ClockOffset(0.2, 0.3, False, "").applied_s == 0.0


@pytest.mark.parametrize("numbers", [(np.nan, 0.1), (0.1, np.inf), (0.1, -0.1), (np.inf, 0.1)])
def test_a_clock_offset_refuses(numbers: tuple[float, float]) -> None:
    with pytest.raises(InputError, match="clock: expected a finite offset and a sigma of at least"):
        ClockOffset(*map(float, numbers), True, "")


def test_range_bias_grows_with_the_logarithm() -> None:
    found = RangeCalibration(np.array([0.1, 0.25]), np.eye(2), 0.1, 1.0)
    bias_m = found.bias_m(np.array([[10.0, 100.0], [1.0, np.nan]]))
    np.testing.assert_allclose(bias_m, [[0.1, 0.35], [-0.15, np.nan]])


def test_range_bias_stays_finite_near_and_below_0() -> None:
    basis = bias_basis(np.array([0.5, 0.1, 0.0, -3.0]))
    assert np.isfinite(basis).all()
    assert (basis == basis[0]).all()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"bias": np.zeros(3)}, r"bias: expected shape \(2,\)"),
        ({"covariance": np.full((2, 2), np.nan)}, "row 1, column covariance: expected finite"),
        ({"sigma_m": 0.0}, "expected sigma_m above 0 and correlation of at least 1, got 0.0"),
        ({"correlation": 0.5}, "got 0.1 and 0.5"),
        ({"sigma_m": float("nan")}, "expected sigma_m above 0"),
    ],
)
def test_a_calibration_refuses(changes: dict, message: str) -> None:
    good = RangeCalibration(np.zeros(2), np.eye(2), 0.1, 1.0)
    with annotations_off(), pytest.raises(InputError, match=message):
        replace(good, **changes)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"range_m": np.zeros(10)}, r"truth.range_m: expected shape \(T, N\), got \(10,\)"),
        ({"range_m": np.full((10, 2), np.nan)}, "row 1, column truth.range_m: expected finite"),
        ({"anchor_m": np.zeros((3, 2))}, r"truth.anchor_m: expected shape \(2, 2\)"),
        ({"anchor_m": np.full((2, 2), np.inf)}, "row 1, column truth.anchor_m: expected finite"),
        ({"nlos": np.zeros((9, 2), dtype=bool)}, "truth.nlos: expected shape"),
        ({"outlier": np.zeros((9, 2), dtype=bool)}, "truth.outlier: expected shape"),
        ({"bias_m": np.zeros((10, 1))}, "truth.bias_m: expected shape"),
        ({"bias_m": np.full((10, 2), np.nan)}, "row 1, column truth.bias_m: expected finite"),
    ],
)
def test_an_episode_truth_refuses(changes: dict, message: str) -> None:
    with annotations_off(), pytest.raises(InputError, match=message):
        replace(EPISODE.truth, **changes)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"anchor_ids": ("a", "")}, "anchor_id: anchor ids must be non-empty text"),
        ({"anchor_ids": ("a", "b", "c")}, r"range_m: expected shape \(10, 3\), got \(10, 2\)"),
        ({"t_s": np.zeros(0)}, "t_s: expected at least one step, got none"),
        ({"t_s": np.zeros(10)}, "row 2, column t_s: expected increasing time"),
        ({"t_s": np.full(10, np.nan)}, "row 1, column t_s: expected finite"),
        ({"position_m": np.zeros((9, 2))}, "position_m: expected shape"),
        ({"position_m": np.full((10, 2), np.nan)}, "row 1, column position_m: expected finite"),
        ({"valid": np.ones((9, 2), dtype=bool)}, "valid: expected shape"),
        ({"valid": np.ones((10, 2), dtype=bool)}, "range_m: expected finite ranges exactly where"),
        ({"range_m": np.ones((10, 2))}, "range_m: expected finite ranges exactly where valid"),
        ({"tag_up_m": np.zeros(9)}, "tag_up_m: expected shape"),
        ({"tag_up_m": np.full(10, np.nan)}, "row 1, column tag_up_m: expected finite"),
        ({"anchor_up_m": np.zeros(3)}, "anchor_up_m: expected shape"),
        ({"anchor_up_m": np.array([1.0, np.inf])}, "anchor_up_m: expected finite heights"),
        ({"truth": make_episode(9).truth}, r"truth.range_m: expected shape \(10, 2\)"),
    ],
)
def test_an_episode_refuses(changes: dict, message: str) -> None:
    with annotations_off(), pytest.raises(InputError, match=f"^pass, .*{message}"):
        replace(EPISODE, **changes)


def test_nothing_can_be_changed() -> None:
    with pytest.raises(FrozenInstanceError):
        EPISODE.name = "other"  # type: ignore[misc]  # the point of the test
    arrays = (EPISODE.t_s, EPISODE.position_m, EPISODE.range_m, EPISODE.valid, EPISODE.tag_up_m)
    truth, denoised = EPISODE.truth, DENOISED
    for array in (*arrays, EPISODE.anchor_up_m, truth.range_m, truth.nlos, denoised.sigma_m):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0


def test_height_gap_is_0_where_unknown() -> None:
    np.testing.assert_allclose(EPISODE.height_gap_m(), np.tile([0.7, 0.0], (10, 1)))
    np.testing.assert_allclose(EPISODE.height_gap_m(slice(0, 1)), np.full((10, 1), 0.7))
    for name in ("tag_up_m", "anchor_up_m"):
        assert not replace(EPISODE, **{name: None}).height_gap_m().any()


def test_a_window_is_a_view() -> None:
    window = EPISODE.window(3, 7)
    assert window.name == "pass[3:7]"
    assert (window.n_steps, window.n_anchors) == (4, 2)
    for name in ("t_s", "position_m", "range_m", "valid", "tag_up_m"):
        assert np.array_equal(getattr(window, name), getattr(EPISODE, name)[3:7])
        assert np.shares_memory(getattr(window, name), getattr(EPISODE, name))
    full = replace(EPISODE.truth, outlier=EPISODE.valid, bias_m=EPISODE.truth.range_m)
    part = replace(EPISODE, truth=full).window(3, 7).truth
    for name in ("range_m", "nlos"):
        assert np.shares_memory(getattr(window.truth, name), getattr(EPISODE.truth, name))
        assert getattr(window.truth, {"range_m": "bias_m", "nlos": "outlier"}[name]) is None
    assert np.array_equal(part.outlier, EPISODE.valid[3:7])
    assert np.array_equal(part.bias_m, EPISODE.truth.range_m[3:7])
    assert np.array_equal(window.truth.range_m, EPISODE.truth.range_m[3:7])


@given(n_steps=st.integers(1, 30), length=st.integers(1, 12), stride=st.none() | st.integers(1, 12))
def test_windows_leave_out_the_tail(n_steps: int, length: int, stride: int | None) -> None:
    episode = make_episode(n_steps) if n_steps > 1 else EPISODE.window(0, 1)
    windows = episode.windows(length, stride)
    step = stride or length
    assert all(window.n_steps == length for window in windows)
    starts = [round(window.t_s[0] * 10) for window in windows]
    assert starts == [k for k in range(0, n_steps, step) if k + length <= n_steps]


def test_readings_are_counted_not_steps() -> None:
    assert EPISODE.n_readings.tolist() == [9, 10]  # without a log, each range is a reading
    told = replace(
        EPISODE,
        readings={
            "a": ReadingCounts(12, 3, 4, 0, 5, n_steps=9),
            "b": ReadingCounts(30, 30, 0, 0, 0, n_steps=10),
        },
    )
    assert told.n_readings.tolist() == [3, 30]
    assert told.window(0, 5).n_readings.tolist() == [1, 15]  # 4 of 9 and 5 of 10 steps
    assert sum(window.n_readings for window in told.windows(5)).tolist() == [3, 30]
    assert told.without_truth().n_readings.tolist() == [3, 30]
    assert told.readings["a"] + told.readings["b"] == ReadingCounts(42, 33, 4, 0, 5, n_steps=19)


def test_a_window_of_everything_is_the_episode() -> None:
    (whole,) = EPISODE.windows(10)
    assert np.array_equal(whole.range_m, EPISODE.range_m, equal_nan=True)
    assert EPISODE.windows(11) == []


@pytest.mark.parametrize("cut", [(-1, 3), (3, 3), (4, 3), (0, 11)])
def test_a_window_outside_the_episode(cut: tuple[int, int]) -> None:
    with pytest.raises(IndexError, match="expected 0 <= start < stop <= 10, got"):
        EPISODE.window(*cut)


@pytest.mark.parametrize("cut", [(0, 1), (1, 0), (-1, None)])
def test_windows_of_no_length_or_stride(cut: tuple[int, int | None]) -> None:
    with pytest.raises(ValueError, match="length and stride of at least 1"):
        EPISODE.windows(*cut)


def test_without_truth_nothing_else_changes() -> None:
    blind = EPISODE.without_truth()
    assert blind.truth is None
    assert blind.range_m is EPISODE.range_m


@given(
    range_m=hnp.arrays(
        np.float64,
        (3, 2),
        elements=st.floats(-10, 100) | st.sampled_from([np.nan, np.inf, -np.inf]),
    ),
    valid=hnp.arrays(np.bool_, (3, 2)),
)
def test_any_ranges_give_a_checked_episode_or_an_input_error(
    range_m: np.ndarray, valid: np.ndarray
) -> None:
    t_s, position_m = np.arange(3.0), np.zeros((3, 2))
    if (np.isfinite(range_m) == valid).all():
        episode = Episode("any", ("a", "b"), t_s, position_m, range_m, valid)
        assert np.array_equal(episode.range_m, range_m, equal_nan=True)
    else:
        with pytest.raises(InputError, match="any, column range_m: expected finite ranges exactly"):
            Episode("any", ("a", "b"), t_s, position_m, range_m, valid)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"sigma_m": np.ones(2)}, "sigma_m: expected shape"),
        ({"valid": np.ones(2, dtype=bool)}, "valid: expected shape"),
        ({"valid": np.ones((10, 2), dtype=bool)}, "finite ranges and positive sigmas where valid"),
        ({"sigma_m": np.zeros((10, 2))}, "finite ranges and positive sigmas where valid"),
        ({"sigma_m": np.full((10, 2), np.inf)}, "finite ranges and positive sigmas where valid"),
        ({"sigma_m": np.ones((10, 2))}, "expected NaN where not valid"),
        ({"range_m": np.ones((10, 2))}, "expected NaN where not valid"),
        ({"valid": np.zeros((10, 2), dtype=bool)}, "expected NaN where not valid"),
    ],
)
def test_denoised_ranges_refuse(changes: dict, message: str) -> None:
    with annotations_off(), pytest.raises(InputError, match=message):
        replace(DENOISED, **changes)
