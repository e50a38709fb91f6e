"""Builders for the tests of the networks."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from tiny_models import N_ANCHORS, N_STEPS, NETWORKS


@pytest.fixture
def build() -> Callable[..., Any]:
    """Return a network by its name in ``NETWORKS``, the same weights whenever it is called."""
    import torch

    from gaia_uwb.learn.networks.make import make_network

    def make(name: str, n_anchors: int = N_ANCHORS) -> torch.nn.Module:
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(5)
            return make_network(n_anchors, NETWORKS[name]).eval()

    return make


@pytest.fixture
def draw() -> Callable[..., Any]:
    """Return random inputs of a network: position, distance, mask, height_gap."""
    import torch

    def make(
        seed: int = 0, n_batch: int = 2, n_steps: int = N_STEPS, n_anchors: int = N_ANCHORS
    ) -> list[torch.Tensor]:
        generator = torch.Generator().manual_seed(seed)
        shape = (n_batch, n_steps, n_anchors)
        mask = (torch.rand(shape, generator=generator) > 0.2).float()
        distance = torch.rand(shape, generator=generator) * mask
        position = torch.randn((*shape[:2], 2), generator=generator)
        return [position, distance, mask, torch.full(shape, 0.1)]

    return make
