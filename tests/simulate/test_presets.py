"""Impossible settings are refused, the presets are what their names say."""

from __future__ import annotations

import pytest
from pydantic import ValidationError

from gaia_uwb.simulate.presets import (
    DEFAULT_PRESET,
    PRESETS,
    ClosureConfig,
    DriveConfig,
    PassConfig,
    RangingConfig,
    RoadConfig,
)


def test_presets_are_what_their_names_say() -> None:
    assert DEFAULT_PRESET in PRESETS
    assert PRESETS["lane-closure"].drive.lane_change
    assert not PRESETS["straight"].drive.lane_change
    assert PRESETS["straight"].road.curvature_per_m == 0
    assert PRESETS["parked"].drive.speed_mps == 0


@pytest.mark.parametrize(
    ("model", "settings"),
    [
        (RoadConfig, {"closed_lane": "middle"}),
        (RoadConfig, {"speed_limit_mph": 42}),  # between the two formulas for the taper
        (RoadConfig, {"lane_width_m": float("nan")}),
        (ClosureConfig, {"n_anchors": 0}),
        (ClosureConfig, {"n_anchors": 2.5}),
        (DriveConfig, {"speed_mps": -1.0}),
        (DriveConfig, {"speed": 8.0}),
        (RangingConfig, {"nlos_share": 1.0}),
        (RangingConfig, {"burst_min_m": 3.0, "burst_max_m": 2.0}),
        (RangingConfig, {"dropout_share": 0.9, "dropout_duration_s": 0.1}),
        (PassConfig, {"ranging": {"nlos_share": 0.8, "nlos_duration_s": 0.2}}),
    ],
)
def test_impossible_settings_are_refused(
    model: type[RoadConfig], settings: dict[str, object]
) -> None:
    with pytest.raises(ValidationError):
        model.model_validate(settings)


def test_settings_are_frozen() -> None:
    with pytest.raises(ValidationError, match="frozen"):
        PRESETS["parked"].drive.speed_mps = 3.0
