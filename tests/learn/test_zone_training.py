from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("torch", reason="needs PyTorch: install gaia-uwb[train]")


from gaia_uwb import models
from gaia_uwb._shared.errors import ConfigError
from gaia_uwb.learn.training_folder import CURVES, LOG, STATE
from gaia_uwb.models.checkpoint import CARD, DESCRIPTION, ONNX, WEIGHTS, read_description
from gaia_uwb.models.description import ZoneModel
from tiny_models import train_tiny_zone


def test_it_learns_and_writes_all_that_belongs_to_a_model(tmp_path: Path) -> None:
    found = train_tiny_zone(tmp_path, curves=True, portions=6, portion_episodes=48)
    log = [json.loads(line) for line in (tmp_path / LOG).read_text(encoding="utf-8").splitlines()]
    assert log[-1]["training"]["total"] < 0.8 * log[0]["training"]["total"]
    names = {DESCRIPTION, ONNX, WEIGHTS, CARD, CURVES, LOG, STATE}
    assert names <= {path.name for path in tmp_path.iterdir()}
    assert read_description(tmp_path) == found
    assert [steps for steps, _ in found.variance_scales] == [64, 256, 1024]
    assert all(scale > 0 for _, scale in found.variance_scales)
    assert found.metrics["wild_scene"] == pytest.approx(log[-1]["kinds"]["wild"]["scene"], abs=1e-5)


def shipped_model() -> ZoneModel:
    description = read_description(Path(models.__file__).parent / "shipped" / "gaia-set-mixed")
    assert isinstance(description, ZoneModel)
    return description


def test_variances_grow_in_proportion_between_the_lengths_they_were_calibrated_at() -> None:
    scales = ((64, 1.0), (256, 4.0), (1024, 2.0))
    found = shipped_model().model_copy(update={"variance_scales": scales})
    lengths = (5, 64, 128, 256, 512, 1024, 4096)
    expected = (1.0, 1.0, 2.0, 4.0, np.sqrt(8.0), 2.0, 2.0)
    assert [found.variance_scale(n) for n in lengths] == pytest.approx(expected)


@pytest.mark.parametrize("scales", [(), ((64, 0.0),), ((0, 1.0),), ((256, 1.0), (64, 2.0))])
def test_scales_that_are_none_are_refused(scales: tuple[Any, ...]) -> None:
    content = shipped_model().model_dump(by_alias=True) | {"variance_scales": scales}
    with pytest.raises(ValueError, match="variance_scales"):
        ZoneModel.model_validate(content)


def test_a_damaged_state_is_refused(tmp_path: Path) -> None:
    (tmp_path / STATE).write_bytes(b"\x80\x04pickle")
    with pytest.raises(ConfigError, match="training-state"):
        train_tiny_zone(tmp_path, portions=1)
