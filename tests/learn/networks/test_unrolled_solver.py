"""Of ``networks/multilateration.py``; the solver's own tests are in ``test_multilateration.py``."""

from __future__ import annotations

import pytest

pytest.importorskip("torch", reason="needs PyTorch: install gaia-uwb[train]")

import torch
from torch import Tensor

from gaia_uwb.learn.networks.unrolled_solver import multilaterate

ANCHOR_M = torch.tensor([[[4.0, 3.0], [-6.0, 5.0], [1.0, -9.0]]], dtype=torch.float64)


def curved(n_steps: int = 20) -> Tensor:
    angle = torch.linspace(0.0, 2.5, n_steps, dtype=torch.float64)
    return 8.0 * torch.stack([torch.cos(angle), torch.sin(angle)], dim=-1).unsqueeze(0)


def straight(n_steps: int = 20) -> Tensor:
    x = torch.linspace(-12.0, 12.0, n_steps, dtype=torch.float64)
    return torch.stack([x, 0.5 * x - 1.0], dim=-1).unsqueeze(0)


def ranges_to(position_m: Tensor, gap_m: float) -> Tensor:
    away = position_m[:, :, None] - ANCHOR_M[:, None]
    return torch.sqrt(away.square().sum(-1) + gap_m**2)


@pytest.mark.parametrize("gap_m", [0.0, 2.5])
def test_a_curved_path_gives_the_anchors_exactly(gap_m: float) -> None:
    range_m = ranges_to(curved(), gap_m)
    weight, gap = torch.ones_like(range_m), torch.full_like(range_m, gap_m)
    found_m, residual_m2 = multilaterate(curved(), range_m, weight, gap, rounds=8)
    error_m = (found_m - ANCHOR_M.unsqueeze(2)).norm(dim=-1)
    best = error_m.argmin(dim=-1, keepdim=True)
    assert error_m.gather(-1, best).max() < 1e-5
    assert residual_m2.gather(-1, best).max() < 1e-10
    if gap_m:
        flat_m, _ = multilaterate(curved(), range_m, weight, torch.zeros_like(gap), rounds=8)
        assert (flat_m - ANCHOR_M.unsqueeze(2)).norm(dim=-1).amin(dim=-1).min() > 0.05


@pytest.mark.parametrize("rounds", [0, 4])
def test_a_straight_path_gives_both_mirror_places(rounds: int) -> None:
    range_m = ranges_to(straight(), 1.0)
    gap = torch.ones_like(range_m)
    found_m, residual_m2 = multilaterate(
        straight(), range_m, torch.ones_like(range_m), gap, rounds=rounds
    )
    normal = torch.tensor([-0.5, 1.0], dtype=torch.float64) / 1.25**0.5
    offset = (ANCHOR_M - torch.tensor([0.0, -1.0])) @ normal
    mirror_m = ANCHOR_M - 2 * offset.unsqueeze(-1) * normal
    for place_m in (ANCHOR_M, mirror_m):
        error_m = (found_m - place_m.unsqueeze(2)).norm(dim=-1).amin(dim=-1)
        assert error_m.max() < 1e-4
    assert residual_m2.max() < 1e-8


def test_weights_count_and_anchors_do_not_touch_each_other() -> None:
    range_m = ranges_to(curved(), 0.0)
    weight, gap = torch.ones_like(range_m), torch.zeros_like(range_m)
    clean_m, _ = multilaterate(curved(), range_m, weight, gap, rounds=6)
    weight[:, 5, 1] = 0.0
    range_m[:, 5, 1] = 300.0
    found_m, _ = multilaterate(curved(), range_m, weight, gap, rounds=6)
    assert torch.equal(found_m[:, [0, 2]], clean_m[:, [0, 2]])
    torch.testing.assert_close(found_m[:, 1], clean_m[:, 1], atol=1e-3, rtol=0)
    scaled_m, _ = multilaterate(curved(), range_m, 7.0 * weight, gap, rounds=6)
    torch.testing.assert_close(scaled_m, found_m)


def _degenerate() -> dict[str, tuple[Tensor, Tensor, Tensor, Tensor]]:
    path = straight()
    range_m = ranges_to(path, 0.0)
    ones, zeros = torch.ones_like(range_m), torch.zeros_like(range_m)
    parked = path[:, :1].expand(-1, 20, -1)
    one = zeros.clone()
    one[:, 7] = 1.0
    on_top = ANCHOR_M[:, :1] + torch.zeros_like(path)
    on_line = (path[:, :, None] - path[:, 10:11, None]).norm(dim=-1).expand(-1, -1, 3)
    return {
        "parked": (parked, ranges_to(parked, 0.0), ones, zeros),
        "parked far off": (parked, 5.0 * ones, ones, zeros),
        "straight": (path, range_m, ones, zeros),
        "no weight": (path, range_m, zeros, zeros),
        "no range": (path, zeros, zeros, zeros),
        "one range": (path, range_m, one, zeros),
        "one step": (path[:, :1], range_m[:, :1], ones[:, :1], zeros[:, :1]),
        "on top of an anchor": (on_top, ranges_to(on_top, 0.0), ones, zeros),
        "anchor on the path": (path, on_line, ones, zeros),
        "ranges of 0": (path, zeros, ones, zeros),
        "ranges shorter than the height": (path, ones, ones, 3.0 * ones),
        "impossible ranges": (path, 1000.0 * ones, ones, zeros),
    }


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
@pytest.mark.parametrize("case", sorted(_degenerate()))
def test_outputs_and_gradients_are_finite_whatever_the_geometry(
    case: str, dtype: torch.dtype
) -> None:
    position_m, range_m, weight, gap_m = (part.to(dtype) for part in _degenerate()[case])
    range_m = range_m.clone().requires_grad_()
    found_m, residual_m2 = multilaterate(position_m, range_m, weight, gap_m, rounds=6)
    (found_m.square().sum() + residual_m2.sum()).backward()
    for value in (found_m, residual_m2, range_m.grad):
        assert torch.isfinite(value).all()
