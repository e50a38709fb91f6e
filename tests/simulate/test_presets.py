"""Impossible settings are refused, the presets are what their names say."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from gaia_uwb._shared.errors import ConfigError
from gaia_uwb.config import dump_config
from gaia_uwb.simulate.presets import DEFAULT_PRESET, PRESETS, find_preset, load_preset
from gaia_uwb.simulate.rows import PassRows
from gaia_uwb.simulate.settings import (
    SECTIONS,
    ClosureConfig,
    DriveConfig,
    PassConfig,
    RangingConfig,
    RoadConfig,
)
from gaia_uwb.simulate.variation import draw_settings, layout_part


def test_presets_are_what_their_names_say() -> None:
    assert DEFAULT_PRESET in PRESETS
    assert PRESETS["lane-closure"].drive.lane_change
    assert not PRESETS["straight"].drive.lane_change
    assert PRESETS["straight"].road.curvature_per_m == 0
    assert PRESETS["parked"].drive.speed_mps == 0
    assert PRESETS["naive"].ranging.averaged == 1
    assert PRESETS["stress"].road.direction_rad == 0
    assert {"road.direction_rad", "road.closed_lane"} <= PRESETS["wild"].vary.keys()


@pytest.mark.parametrize(
    ("model", "settings"),
    [
        (RoadConfig, {"closed_lane": "middle"}),
        (RoadConfig, {"speed_limit_mph": 42}),  # between the two formulas for the taper
        (RoadConfig, {"lane_width_m": float("nan")}),
        (ClosureConfig, {"n_anchors": 0}),
        (ClosureConfig, {"n_anchors": 2.5}),
        (ClosureConfig, {"kind": "roundabout"}),
        (DriveConfig, {"speed_mps": -1.0}),
        (DriveConfig, {"speed": 8.0}),
        (RangingConfig, {"dropout_share": 1.1}),
        (RangingConfig, {"nlos_s": 0.0}),
        (RangingConfig, {"tail_dof": 2.0}),  # no variance
        (RangingConfig, {"burst_lengths": [0.5, 0.4]}),
        (RangingConfig, {"burst_lengths": [1.5, -0.5]}),
        (PassConfig, {"vary": {"drive.colour": [0.0, 1.0]}}),
        (PassConfig, {"vary": {"speed_mps": [0.0, 1.0]}}),
        (PassConfig, {"vary": {"drive.speed_mps": [9.0, 8.0]}}),
        (PassConfig, {"vary": {"drive.speed_mps": [9.0, 800.0]}}),
        (PassConfig, {"vary": {"closure.n_anchors": [4, 8.5]}}),
        (PassConfig, {"vary": {"closure.kind": []}}),
        (PassConfig, {"vary": {"closure.kind": ["lane-closure", "roundabout"]}}),
        (PassConfig, {"split": "validation"}),
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


@pytest.mark.parametrize("name", PRESETS)
def test_a_preset_survives_its_file(name: str, tmp_path: Path) -> None:
    path = tmp_path / "preset.yaml"
    path.write_text(dump_config(PRESETS[name]), encoding="utf-8")
    assert load_preset(path) == PRESETS[name]
    assert find_preset(str(path)) == PRESETS[name]


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"drive: {speed_mps: fast}", "drive.speed_mps"),
        (b"drive: {colour: 3}", "drive.colour"),
        (b"- 1", "dictionary"),
        (b"drive: [", "cannot read"),
        (b"drive: {}\ndrive: {}", "line 2: duplicate key 'drive'"),
        (b"\xff\xfe", "cannot read"),
        (b"vary: {drive.colour: [1.0, 2.0]}", "unknown setting"),
    ],
)
def test_a_bad_preset_file_is_a_config_error(content: bytes, says: str, tmp_path: Path) -> None:
    path = tmp_path / "preset.yaml"
    path.write_bytes(content)
    with pytest.raises(ConfigError, match=says) as error:
        load_preset(path)
    assert str(path) in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("name", ["moon", "wild-", "wild-validation", "absent.yaml", ""])
def test_an_unknown_preset_is_a_config_error(name: str) -> None:
    with pytest.raises(ConfigError, match=r"unknown preset|cannot read"):
        find_preset(name)


def drawn(n: int = 300, **settings: Any) -> list[PassRows]:
    rng, config = np.random.default_rng(0), PassConfig(**settings)
    return [PassRows.of(config, [draw_settings(config, rng)]) for _ in range(n)]


def test_variation_draws_evenly_from_spans_and_choices() -> None:
    vary = {
        "drive.speed_mps": [5.0, 15.0],
        "closure.n_anchors": [4, 12],
        "closure.kind": ["lane-shift", "lane-closure", "shoulder-closure"],
        "closure.both_sides": [False, True],
    }
    passes = drawn(vary=vary)
    speed = np.array([config.drive.speed_mps for config in passes])
    assert speed.min() >= 5
    assert speed.max() <= 15
    assert speed.mean() == pytest.approx(10, abs=4 * 2.9 / 300**0.5)
    anchors = [config.closure.n_anchors for config in passes]
    assert set(anchors) == set(range(4, 13))
    assert {config.closure.kind for config in passes} == set(vary["closure.kind"])
    assert np.mean([config.closure.both_sides for config in passes]) == pytest.approx(0.5, abs=0.1)
    for config in passes[:20]:  # what was drawn is as valid as what is written by hand
        sections = {name: vars(getattr(config, name)) for name in SECTIONS}
        again = PassConfig.model_validate(sections)
        assert sections == {name: vars(getattr(again, name)) for name in SECTIONS}


@pytest.mark.parametrize("name", ["stress", "wild"])
def test_no_layout_is_in_both_parts(name: str) -> None:
    vary = PRESETS[name].vary
    for part in ("training", "test"):
        passes = drawn(100, vary=vary, split=part)
        assert {layout_part(config) for config in passes} == {part}
    everything = [layout_part(config) for config in drawn(vary=vary)]
    assert 0.05 < everything.count("test") / len(everything) < 0.4


def test_a_part_without_layouts_is_a_config_error() -> None:
    other = {"training": "test", "test": "training"}[layout_part(PassConfig())]
    with pytest.raises(ConfigError, match=f"no layout .* {other} part"):
        drawn(1, split=other)
