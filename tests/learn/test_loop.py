"""What the loop promises, for either family: the same end however often it is stopped."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterable
from functools import cache, partial
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
N_STEPS = 4


def same_files(one: Path, other: Path, names: Iterable[str]) -> bool:
    return all((one / name).read_bytes() == (other / name).read_bytes() for name in names)


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """Give the folder of a training that nothing disturbed, the same for all tests."""

    @cache
    def folder_of(name: str) -> Path:
        folder = tmp_path_factory.mktemp(name)
        train_tiny_steps(folder, name, N_STEPS)
        return folder

    return folder_of


@pytest.mark.parametrize("name", FAMILIES)
def test_an_interrupted_training_ends_as_one_that_was_not(
    name: str, trained: Callable[[str], Path], tmp_path: Path
) -> None:
    whole, cut = trained(name), tmp_path / "cut"
    for n in (2, 1):
        with pytest.raises(InterruptionError):
            train_tiny_steps(cut, name, N_STEPS, progress=stop_after(n))
    assert len((cut / LOG).read_text(encoding="utf-8").splitlines()) == 3
    assert not (cut / DESCRIPTION).exists()
    train_tiny_steps(cut, name, N_STEPS)
    assert same_files(whole, cut, (WEIGHTS, ONNX, LOG, DESCRIPTION))


# The base of a gaia is trained first, for twice as many epochs.
@pytest.mark.parametrize(("name", "after"), [("gaia", 9), ("gaia-set", 1)])
def test_a_killed_training_ends_as_one_that_was_not(
    name: str, after: int, trained: Callable[[str], Path], tmp_path: Path
) -> None:
    whole, cut = trained(name), tmp_path / "cut"
    kill_training(partial(train_tiny_steps, cut, name, N_STEPS), after=after)
    assert len((cut / LOG).read_text(encoding="utf-8").splitlines()) == 1
    train_tiny_steps(cut, name, N_STEPS)
    assert same_files(whole, cut, (WEIGHTS, LOG))


@pytest.mark.parametrize("name", ["gaia", "gaia-set"])
def test_a_finished_training_is_not_done_again(
    name: str, trained: Callable[[str], Path], tmp_path: Path
) -> None:
    folder = shutil.copytree(trained(name), tmp_path / "copy")
    train_tiny_steps(folder, name, N_STEPS, progress=stop_after(0))
    assert same_files(trained(name), folder, (WEIGHTS,))


@pytest.mark.parametrize("name", ["mlp", "gaia-set"])
@pytest.mark.parametrize("change", [{"seed": 1}, {"n_steps": 2}, {"learning_rate": 1e-4}])
def test_a_folder_of_another_training_is_refused(
    name: str, change: dict[str, Any], trained: Callable[[str], Path], tmp_path: Path
) -> None:
    folder = shutil.copytree(trained(name), tmp_path / "copy")
    with pytest.raises(ConfigError, match="belongs to another training") as caught:
        train_tiny_steps(folder, name, **({"n_steps": N_STEPS} | change))
    assert str(folder / STATE) in str(caught.value)
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
