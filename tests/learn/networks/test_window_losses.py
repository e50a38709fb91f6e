from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

pytest.importorskip("torch", reason="needs PyTorch: install gaia-uwb[train]")

import torch

from gaia_uwb.learn.networks.layers import WindowPrediction
from gaia_uwb.learn.networks.window_losses import (
    WindowBatch,
    anchor_loss,
    consistency_loss,
    layout_loss,
    masked_huber,
    window_loss_terms,
)
from tiny_models import GaiaArchitecture, WindowTrainingOptions

SCALE_M = 10.0
OPTIONS = WindowTrainingOptions(anchor_stride=1)


def make_batch(*, dtype: torch.dtype = torch.float32, n_steps: int = 12) -> WindowBatch:
    """Return two passes along a bent path past two anchors, in units of ``SCALE_M``."""
    x = torch.linspace(-1.0, 1.0, n_steps, dtype=dtype)
    position = torch.stack([x, -0.4 + 0.3 * x**2], dim=-1).expand(2, -1, -1)
    anchor = torch.tensor([[[0.1, 0.2], [0.5, 0.1]], [[-0.3, 0.3], [0.0, 0.5]]], dtype=dtype)
    gap = torch.full((2, n_steps, 2), 0.1, dtype=dtype)
    distance = torch.sqrt((position[:, :, None] - anchor[:, None]).square().sum(-1) + 0.01)
    nlos = torch.zeros_like(distance)
    nlos[:, ::3, 0] = 1
    return WindowBatch(
        position, distance, torch.ones_like(distance), gap, distance * SCALE_M, nlos, anchor
    )


def perfect(batch: WindowBatch) -> WindowPrediction:
    return WindowPrediction(batch.distance, batch.anchor, batch.distance)


def test_the_masked_loss_is_hubers() -> None:
    error_m = torch.tensor([[[0.5, -3.0, 7.0]]])
    target_m = torch.full((1, 1, 3), 10.0)
    weight = torch.tensor([[[1.0, 3.0, 0.0]]])
    found = masked_huber(target_m + error_m, target_m, weight, delta_m=1.0)
    assert found.item() == pytest.approx((1.0 * 0.125 + 3.0 * 2.5) / 4.0)
    wide = masked_huber(target_m + error_m, target_m, weight, delta_m=4.0)
    assert wide.item() == pytest.approx((1.0 * 0.125 + 3.0 * 4.5) / 4.0)


def test_the_layout_loss_is_the_mean_squared_distance_of_observed_anchors() -> None:
    layout_m = torch.tensor([[[3.0, 4.0], [1.0, 0.0], [9.0, 9.0]]])
    mask = torch.tensor([[1.0, 1.0, 0.0]])
    assert layout_loss(layout_m, torch.zeros(1, 3, 2), mask).item() == pytest.approx(13.0)


def test_the_consistency_loss_is_a_masked_mean_square() -> None:
    prediction_m = torch.tensor([[[1.0, 5.0], [2.0, 2.0]]])
    mask = torch.tensor([[[1.0, 0.0], [1.0, 0.0]]])
    found = consistency_loss(prediction_m, torch.zeros(1, 2, 2), mask)
    assert found.item() == pytest.approx(2.5)


def test_a_perfect_prediction_costs_nothing() -> None:
    terms = window_loss_terms(perfect(make_batch()), make_batch(), SCALE_M, OPTIONS)
    assert set(terms) == {"mask", "layout", "consistency", "anchor", "total"}
    assert {name: value.item() for name, value in terms.items()} == pytest.approx(
        dict.fromkeys(terms, 0.0), abs=1e-4
    )


def test_terms_are_in_metres_and_add_up_with_their_weights() -> None:
    batch = make_batch()
    off = WindowPrediction(batch.distance + 0.05, batch.anchor + 0.1, batch.distance - 0.05)
    terms = window_loss_terms(off, batch, SCALE_M, OPTIONS)
    assert terms["mask"].item() == pytest.approx(0.5 * 0.5**2, rel=1e-4)
    assert terms["layout"].item() == pytest.approx(2.0, rel=1e-4)
    assert terms["consistency"].item() == pytest.approx(1.0, rel=1e-4)
    total = (
        terms["mask"]
        + OPTIONS.layout_weight * terms["layout"]
        + OPTIONS.consistency_weight * terms["consistency"]
        + OPTIONS.anchor_weight * terms["anchor"]
    )
    assert terms["total"].item() == pytest.approx(total.item())


def test_terms_without_weight_or_layout_are_left_out() -> None:
    batch = make_batch()
    off = {"layout_weight": 0.0, "consistency_weight": 0.0, "anchor_weight": 0.0}
    for name in ("layout", "consistency", "anchor"):
        options = OPTIONS.model_copy(update={f"{name}_weight": 0.0})
        expected = {"mask", "layout", "consistency", "anchor", "total"} - {name}
        assert set(window_loss_terms(perfect(batch), batch, SCALE_M, options)) == expected
    alone = window_loss_terms(perfect(batch), batch, SCALE_M, OPTIONS.model_copy(update=off))
    assert set(alone) == {"mask", "total"}
    assert torch.equal(alone["mask"], alone["total"])
    bare = window_loss_terms(WindowPrediction(batch.distance), batch, SCALE_M, OPTIONS)
    assert set(bare) == {"mask", "anchor", "total"}
    no_geometry = window_loss_terms(
        WindowPrediction(batch.distance, batch.anchor), batch, SCALE_M, OPTIONS
    )
    assert set(no_geometry) == {"mask", "layout", "anchor", "total"}


def test_ranges_without_line_of_sight_count_as_told() -> None:
    batch = make_batch()
    wrong_there = WindowPrediction(batch.distance + 0.05 * batch.nlos)
    deaf = OPTIONS.model_copy(update={"nlos_weight": 0.0})
    assert window_loss_terms(wrong_there, batch, SCALE_M, deaf)["mask"].item() == pytest.approx(
        0, abs=1e-9
    )
    share = batch.nlos.mean().item()
    heard = window_loss_terms(wrong_there, batch, SCALE_M, OPTIONS)["mask"].item()
    assert heard == pytest.approx(share * 0.125, rel=1e-4)
    half = OPTIONS.model_copy(update={"nlos_weight": 0.5})
    expected = 0.5 * share * 0.125 / (1 - 0.5 * share)
    assert window_loss_terms(wrong_there, batch, SCALE_M, half)["mask"].item() == pytest.approx(
        expected, rel=1e-4
    )


@pytest.mark.parametrize("unknown", ["one", "all"])
def test_anchors_in_unknown_places_do_not_count_and_harm_no_gradient(unknown: str) -> None:
    batch = make_batch()
    anchor = batch.anchor.clone()
    anchor[(0, 1) if unknown == "one" else ...] = torch.nan
    distance = (batch.distance + 0.03).requires_grad_()
    layout = (batch.anchor + 0.1).requires_grad_()
    layout_distance = batch.distance - 0.05
    terms = window_loss_terms(
        WindowPrediction(distance, layout, layout_distance),
        batch._replace(anchor=anchor),
        SCALE_M,
        OPTIONS,
    )
    terms["total"].backward()
    assert torch.isfinite(distance.grad).all()
    assert torch.isfinite(layout.grad).all()
    assert (layout.grad[0, 1] == 0).all()
    if unknown == "all":
        assert torch.equal(terms["total"], terms["mask"])
    else:
        assert terms["layout"].item() == pytest.approx(2.0, rel=1e-4)
        assert (layout.grad[1] != 0).all()


def test_a_batch_without_any_range_costs_nothing_and_has_a_gradient() -> None:
    batch = make_batch()
    empty = batch._replace(mask=torch.zeros_like(batch.mask), distance=torch.zeros_like(batch.mask))
    distance = torch.zeros_like(batch.distance).requires_grad_()
    terms = window_loss_terms(
        WindowPrediction(distance, batch.anchor, batch.distance), empty, SCALE_M, OPTIONS
    )
    terms["total"].backward()
    assert all(value.item() == 0 for value in terms.values())
    assert (distance.grad == 0).all()


def test_the_anchor_loss_follows_from_the_anchors_errors() -> None:
    batch = make_batch(dtype=torch.float64)
    known = torch.ones(2, 2, dtype=torch.bool)
    options = OPTIONS.model_copy(update={"gauss_newton_rounds": 8})
    for shift, expected_m2 in ((0.2, 2.0**2), (2.0, 2 * 5.0 * (20.0 - 0.5 * 5.0))):
        # Where the truth is moved along the path's mean direction, anchors are off by just that.
        moved = batch._replace(anchor=batch.anchor + torch.tensor([0.0, shift]))
        found = anchor_loss(batch.range_m, moved, known, SCALE_M, options).item()
        assert found == pytest.approx(expected_m2, rel=1e-3)


def test_the_anchor_loss_takes_every_nth_step_and_hears_blocked_ranges_less() -> None:
    batch = make_batch(dtype=torch.float64)
    known = torch.ones(2, 2, dtype=torch.bool)
    options = OPTIONS.model_copy(update={"anchor_stride": 4})
    elsewhere = batch.range_m.clone()
    elsewhere[:, 1::4] += 3.0
    assert anchor_loss(elsewhere, batch, known, SCALE_M, options).item() < 1e-5
    blocked = batch.range_m + 0.5 * batch.nlos
    loss = [
        anchor_loss(
            blocked, batch, known, SCALE_M, OPTIONS.model_copy(update={"anchor_nlos_weight": w})
        ).item()
        for w in (0.0, 0.2, 1.0)
    ]
    assert loss[0] < 1e-5 < loss[1] < loss[2]


@pytest.mark.parametrize("rounds", [1, 2, 3, 4, 5, 6])
def test_the_anchor_losss_gradient_is_that_of_finite_differences(rounds: int) -> None:
    batch = make_batch(dtype=torch.float64, n_steps=8)
    known = torch.ones(2, 2, dtype=torch.bool)
    options = OPTIONS.model_copy(update={"gauss_newton_rounds": rounds})
    noise = torch.sin(torch.arange(batch.range_m.numel(), dtype=torch.float64) * 1.7)
    range_m = (batch.range_m + 0.3 * noise.reshape(batch.range_m.shape)).requires_grad_()
    assert torch.autograd.gradcheck(
        lambda values: anchor_loss(values, batch, known, SCALE_M, options), (range_m,)
    )


def test_a_networks_weights_get_finite_gradients(
    build: Callable[..., Any], draw: Callable[..., Any]
) -> None:
    network, (position, distance, mask, gap) = build("gaia"), draw()
    assert isinstance(network.architecture, GaiaArchitecture)
    position[0] = position[0, 0]  # parked
    mask[1, :, 0] = 0
    distance = distance * mask
    batch = WindowBatch(
        position, distance, mask, gap, distance * SCALE_M, torch.zeros_like(mask),
        torch.full((2, 3, 2), torch.nan),
    )  # fmt: skip
    terms = window_loss_terms(network(*batch[:4]), batch, SCALE_M, OPTIONS)
    terms["total"].backward()
    for weight in network.parameters():
        assert weight.grad is None or torch.isfinite(weight.grad).all()
