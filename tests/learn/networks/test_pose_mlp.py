from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

pytest.importorskip("torch", reason="needs PyTorch: install gaia-uwb[train]")

import torch


def test_it_has_three_layers_on_the_ranges_and_the_position(build: Callable[..., Any]) -> None:
    shapes = [tuple(weight.shape) for weight in build("pose-mlp").parameters()]
    assert shapes == [(8, 5), (8,), (8, 8), (8,), (3, 8), (3,)]


def test_a_step_is_denoised_by_itself_and_the_pose_takes_part(
    build: Callable[..., Any], draw: Callable[..., Any]
) -> None:
    network, (position, distance, mask, gap) = build("pose-mlp"), draw()
    whole = network(position, distance, mask, gap).distance
    moved = position.clone()
    moved[:, 3] += 1.0
    changed = network(moved, distance, mask, gap).distance
    others = [0, 1, 2, 4, 5, 6, 7]
    assert torch.equal(whole[:, others], changed[:, others])
    assert not torch.equal(whole[:, 3], changed[:, 3])
    assert (whole[mask == 0] == 0).all()
