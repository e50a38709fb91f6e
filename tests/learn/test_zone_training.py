from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("torch", reason="needs PyTorch: install gaia-uwb[train]")

import torch

from gaia_uwb._shared.errors import ConfigError
from gaia_uwb.learn.training_folder import CURVES, LOG, STATE
from gaia_uwb.models.checkpoint import CARD, DESCRIPTION, ONNX, WEIGHTS, read_set_description
from gaia_uwb.models.description import SetModelDescription
from killed_runs import kill_training
from tiny_models import train_tiny_set


class InterruptionError(Exception):
    """Stands for whatever stops a training."""


def stop_after(n: int) -> Callable[[Iterable[int], int], Iterator[int]]:
    def go(portions: Iterable[int], done: int) -> Iterator[int]:
        for portion in portions:
            if portion - done >= n:
                raise InterruptionError
            yield portion

    return go


def test_it_learns_and_writes_all_that_belongs_to_a_model(tmp_path: Path) -> None:
    found = train_tiny_set(tmp_path, curves=True, portions=6, portion_episodes=48)
    log = [json.loads(line) for line in (tmp_path / LOG).read_text(encoding="utf-8").splitlines()]
    assert log[-1]["training"]["total"] < 0.8 * log[0]["training"]["total"]
    names = {DESCRIPTION, ONNX, WEIGHTS, CARD, CURVES, LOG, STATE}
    assert names <= {path.name for path in tmp_path.iterdir()}
    assert read_set_description(tmp_path) == found
    assert [steps for steps, _ in found.variance_scales] == [64, 256, 1024]
    assert all(scale > 0 for _, scale in found.variance_scales)
    assert found.metrics["wild_scene"] == pytest.approx(log[-1]["kinds"]["wild"]["scene"], abs=1e-5)


def test_variances_grow_in_proportion_between_the_lengths_they_were_calibrated_at(
    tmp_path: Path,
) -> None:
    found = train_tiny_set(tmp_path).model_copy(
        update={"variance_scales": ((64, 1.0), (256, 4.0), (1024, 2.0))}
    )
    lengths = (5, 64, 128, 256, 512, 1024, 4096)
    expected = (1.0, 1.0, 2.0, 4.0, np.sqrt(8.0), 2.0, 2.0)
    assert [found.variance_scale(n) for n in lengths] == pytest.approx(expected)


@pytest.mark.parametrize("scales", [(), ((64, 0.0),), ((0, 1.0),), ((256, 1.0), (64, 2.0))])
def test_scales_that_are_none_are_refused(tmp_path: Path, scales: tuple[Any, ...]) -> None:
    content = train_tiny_set(tmp_path).model_dump(by_alias=True) | {"variance_scales": scales}
    with pytest.raises(ValueError, match="variance_scales"):
        SetModelDescription.model_validate(content)


def test_an_interrupted_training_ends_as_one_that_was_not(tmp_path: Path) -> None:
    train_tiny_set(tmp_path / "whole", portions=3)
    for n in (1, 1):
        with pytest.raises(InterruptionError):
            train_tiny_set(tmp_path / "cut", portions=3, progress=stop_after(n))
    assert not (tmp_path / "cut" / DESCRIPTION).exists()
    train_tiny_set(tmp_path / "cut", portions=3)
    for file in (WEIGHTS, ONNX, LOG, DESCRIPTION):
        whole, cut = (tmp_path / run / file for run in ("whole", "cut"))
        assert whole.read_bytes() == cut.read_bytes(), file


def test_a_killed_training_ends_as_one_that_was_not(tmp_path: Path) -> None:
    train_tiny_set(tmp_path / "whole", portions=4)
    kill_training(partial(train_tiny_set, tmp_path / "cut", portions=4), after=1)
    assert len((tmp_path / "cut" / LOG).read_text(encoding="utf-8").splitlines()) == 1
    train_tiny_set(tmp_path / "cut", portions=4)
    for file in (WEIGHTS, LOG):
        assert (tmp_path / "cut" / file).read_bytes() == (tmp_path / "whole" / file).read_bytes()


def test_a_finished_training_is_not_done_again(tmp_path: Path) -> None:
    train_tiny_set(tmp_path, portions=1)
    before = (tmp_path / WEIGHTS).read_bytes()
    train_tiny_set(tmp_path, portions=1, progress=stop_after(0))
    assert (tmp_path / WEIGHTS).read_bytes() == before


@pytest.mark.parametrize("change", [{"seed": 1}, {"portions": 2}, {"learning_rate": 1e-4}])
def test_a_folder_of_another_training_is_refused(tmp_path: Path, change: dict[str, float]) -> None:
    train_tiny_set(tmp_path, portions=1)
    with pytest.raises(ConfigError, match="belongs to another training") as caught:
        train_tiny_set(tmp_path, **({"portions": 1} | change))
    assert str(tmp_path / STATE) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_damaged_state_is_refused(tmp_path: Path) -> None:
    (tmp_path / STATE).write_bytes(b"\x80\x04pickle")
    with pytest.raises(ConfigError, match="training-state"):
        train_tiny_set(tmp_path, portions=1)


def test_a_step_without_a_finite_gradient_is_left_out_and_counted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    norms = iter([torch.tensor(torch.nan)])
    clip = torch.nn.utils.clip_grad_norm_
    monkeypatch.setattr(
        torch.nn.utils, "clip_grad_norm_", lambda *given: next(norms, None) or clip(*given)
    )
    train_tiny_set(tmp_path, portions=1, portion_episodes=64)
    (line,) = map(json.loads, (tmp_path / LOG).read_text(encoding="utf-8").splitlines())
    assert line["skipped_steps"] == 1
    assert line["steps"] > 1
    assert all(np.isfinite(value) for value in line["training"].values())
