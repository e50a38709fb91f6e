"""What the loop promises, for either family: the same end however often it is stopped."""

from __future__ import annotations

import json
from collections.abc import Iterable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("torch", reason="needs PyTorch: install gaia-uwb[train]")

import torch

from gaia_uwb._shared.errors import ConfigError
from gaia_uwb.learn.training_folder import LOG, STATE
from gaia_uwb.models.checkpoint import DESCRIPTION, ONNX, WEIGHTS
from killed_runs import kill_training
from tiny_models import InterruptionError, stop_after, train_tiny_steps

FAMILIES = ("mlp", "gaia", "unfrozen-base", "gaia-set")


def same_files(one: Path, other: Path, names: Iterable[str]) -> bool:
    return all((one / name).read_bytes() == (other / name).read_bytes() for name in names)


@pytest.mark.parametrize("name", FAMILIES)
def test_an_interrupted_training_ends_as_one_that_was_not(name: str, tmp_path: Path) -> None:
    whole, cut = tmp_path / "whole", tmp_path / "cut"
    train_tiny_steps(whole, name, 4)
    for n in (2, 1):
        with pytest.raises(InterruptionError):
            train_tiny_steps(cut, name, 4, progress=stop_after(n))
    assert len((cut / LOG).read_text(encoding="utf-8").splitlines()) == 3
    assert not (cut / DESCRIPTION).exists()
    train_tiny_steps(cut, name, 4)
    assert same_files(whole, cut, (WEIGHTS, ONNX, LOG, DESCRIPTION))


# The base of a gaia is trained first, for twice as many epochs.
@pytest.mark.parametrize(("name", "after"), [("gaia", 9), ("gaia-set", 1)])
def test_a_killed_training_ends_as_one_that_was_not(name: str, after: int, tmp_path: Path) -> None:
    whole, cut = tmp_path / "whole", tmp_path / "cut"
    train_tiny_steps(whole, name, 4)
    kill_training(partial(train_tiny_steps, cut, name, 4), after=after)
    assert len((cut / LOG).read_text(encoding="utf-8").splitlines()) == 1
    train_tiny_steps(cut, name, 4)
    assert same_files(whole, cut, (WEIGHTS, LOG))


@pytest.mark.parametrize("name", ["gaia", "gaia-set"])
def test_a_finished_training_is_not_done_again(name: str, tmp_path: Path) -> None:
    train_tiny_steps(tmp_path, name, 1)
    before = (tmp_path / WEIGHTS).read_bytes()
    train_tiny_steps(tmp_path, name, 1, progress=stop_after(0))
    assert (tmp_path / WEIGHTS).read_bytes() == before


@pytest.mark.parametrize("name", ["mlp", "gaia-set"])
@pytest.mark.parametrize("change", [{"seed": 1}, {"n_steps": 2}, {"learning_rate": 1e-4}])
def test_a_folder_of_another_training_is_refused(
    name: str, change: dict[str, Any], tmp_path: Path
) -> None:
    train_tiny_steps(tmp_path, name, n_steps=1)
    with pytest.raises(ConfigError, match="belongs to another training") as caught:
        train_tiny_steps(tmp_path, name, **({"n_steps": 1} | change))
    assert str(tmp_path / STATE) in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["mlp", "gaia-set"])
def test_a_step_without_a_finite_gradient_is_left_out_and_counted(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    norms = iter([torch.tensor(torch.nan)])
    clip = torch.nn.utils.clip_grad_norm_
    monkeypatch.setattr(
        torch.nn.utils, "clip_grad_norm_", lambda *given: next(norms, None) or clip(*given)
    )
    train_tiny_steps(tmp_path, name, 1)
    (line,) = map(json.loads, (tmp_path / LOG).read_text(encoding="utf-8").splitlines())
    assert line["skipped_steps"] == 1
    assert all(np.isfinite(value) for value in line["training"].values())
    assert {"scene", "mask"} & set(line["training"])
