from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

pytest.importorskip("torch", reason="needs PyTorch: install gaia-uwb[train]")

import torch


def test_it_has_three_layers_on_the_ranges_alone(build: Callable[..., Any]) -> None:
    shapes = [tuple(weight.shape) for weight in build("mlp").parameters()]
    assert shapes == [(8, 3), (8,), (8, 8), (8,), (3, 8), (3,)]


def test_a_step_is_denoised_by_itself_whatever_the_pose_and_the_heights(
    build: Callable[..., Any], draw: Callable[..., Any]
) -> None:
    network, (position, distance, mask, gap) = build("mlp"), draw()
    whole = network(position, distance, mask, gap).distance
    elsewhere = network(position + 5.0, distance, mask, gap + 1.0).distance
    assert torch.equal(whole, elsewhere)
    alone = network(position[:, 3:4], distance[:, 3:4], mask[:, 3:4], gap[:, 3:4]).distance
    torch.testing.assert_close(whole[:, 3:4], alone)
    assert (whole[mask == 0] == 0).all()
    assert (whole[mask == 1] != 0).any()
