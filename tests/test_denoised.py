from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from gaia_uwb._shared.errors import InputError
from gaia_uwb.denoised import ZonePosterior
from outside import annotations_off


def fields(n: int = 3) -> dict[str, Any]:
    return {
        "place_m": np.zeros((n, 2, 2)),
        "covariance_m2": np.broadcast_to(np.eye(2), (n, 2, 2, 2)),
        "scene_probability": np.array([0.7, 0.3]),
        "left_probability": np.full((2, n), 0.5),
        "located": np.ones(n, dtype=bool),
    }


def test_it_holds_what_it_is_given_and_does_not_change() -> None:
    zone = ZonePosterior(**fields())
    assert zone.scene_probability.tolist() == [0.7, 0.3]
    with pytest.raises(ValueError, match="read-only"):
        zone.place_m[0] = 1.0


@pytest.mark.parametrize(
    ("name", "value", "problem"),
    [
        ("left_probability", np.full((2, 3), 1.5), "expected probabilities"),
        ("scene_probability", np.array([0.7, 0.7]), "add up to 1"),
        ("place_m", np.full((3, 2, 2), np.nan), "finite"),
        ("covariance_m2", np.zeros((3, 2, 2)), "shape"),
        ("located", np.ones(2, dtype=bool), "shape"),
    ],
)
def test_what_cannot_be_is_refused(name: str, value: np.ndarray, problem: str) -> None:
    with annotations_off(), pytest.raises(InputError, match=problem):
        ZonePosterior(**(fields() | {name: value}))
