"""Fixes and boundaries: read-only, and consistent with their status."""

from __future__ import annotations

from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest

from gaia_uwb._shared.errors import InputError
from gaia_uwb.estimate import AnchorFix, AnchorStatus, Boundary, BoundaryStatus
from outside import annotations_off

NOWHERE = np.full(2, np.nan)
FIX = AnchorFix(
    anchor_id="cone-1",
    position_m=np.array([1.0, 2.0]),
    covariance_m2=np.eye(2),
    mirror_position_m=np.array([1.0, -2.0]),
    mirror_probability=0.1,
    status=AnchorStatus.OK,
    n_ranges=9,
)
TRIANGLE_M = np.array([[0.0, 0.0], [2.0, 0.0], [0.0, 2.0]])
BOUNDARY = Boundary(TRIANGLE_M, TRIANGLE_M, (0, 1, 2), 2.0, BoundaryStatus.OK)


@pytest.mark.parametrize("status", AnchorStatus)
def test_every_status_has_a_message(status: AnchorStatus) -> None:
    assert status.message
    assert status.has_position is (status is not AnchorStatus.TOO_FEW_RANGES)


def test_a_fix_cannot_be_changed() -> None:
    with pytest.raises(FrozenInstanceError):
        FIX.n_ranges = 3  # type: ignore[misc]  # the point of the test
    for array in (FIX.position_m, FIX.covariance_m2, FIX.mirror_position_m):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0.0


def test_an_anchor_without_position() -> None:
    fix = replace(FIX, position_m=NOWHERE, status=AnchorStatus.TOO_FEW_RANGES)
    assert np.isnan(fix.position_m).all()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"position_m": np.zeros(3)}, r"position_m: expected shape \(2,\), got \(3,\)"),
        ({"covariance_m2": np.zeros(2)}, r"covariance_m2: expected shape \(2, 2\)"),
        ({"mirror_position_m": np.zeros(1)}, "mirror_position_m: expected shape"),
        ({"position_m": NOWHERE}, "'cone-1'.*contradicts the status 'ok'"),
        ({"status": AnchorStatus.TOO_FEW_RANGES}, "contradicts the status 'too-few-ranges'"),
        ({"mirror_probability": 1.5}, "expected a probability, got 1.5"),
        ({"mirror_probability": float("nan")}, "expected a probability, got nan"),
        ({"mirror_probability_by_ranges": -0.1}, "expected a probability, got -0.1"),
    ],
)
def test_a_fix_refuses(changes: dict, message: str) -> None:
    with annotations_off(), pytest.raises(InputError, match=message):
        replace(FIX, **changes)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"hull_m": np.zeros((3, 3))}, r"hull_m: expected shape \(3, 2\), got \(3, 3\)"),
        ({"outline_m": np.zeros((3, 1))}, "outline_m: expected shape"),
        ({"outline_index": (0, 1)}, "expected 3 indices, got 2"),
        ({"area_m2": 0.0}, "area 0.0 m² contradicts the status 'ok'"),
        ({"status": BoundaryStatus.COLLINEAR}, "area 2.0 m² contradicts.*'collinear'"),
    ],
)
def test_a_boundary_refuses(changes: dict, message: str) -> None:
    with annotations_off(), pytest.raises(InputError, match=message):
        replace(BOUNDARY, **changes)


def test_an_empty_boundary() -> None:
    nothing = np.zeros((0, 2))
    boundary = Boundary(nothing, nothing, (), 0.0, BoundaryStatus.TOO_FEW_ANCHORS)
    assert not boundary.hull_m.flags.writeable
