from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

pytest.importorskip("torch", reason="needs PyTorch: install gaia-uwb[train]")

import torch

from gaia_uwb.learn.networks.gaia import gated_fusion, geometric_distance
from tiny_models import NETWORKS

GAIAS = sorted(set(NETWORKS) - {"mlp", "pose-mlp"})
WITH_LAYOUT = sorted(set(GAIAS) - {"without-layout-head"})
CAUSAL = {"causal": 0, "causal-look-ahead": 2}

Build = Callable[..., Any]


def test_modules_have_the_papers_feature_sizes(build: Build) -> None:
    network, n, h = build("gaia"), 3, 8
    assert network.temporal.gru.input_size == 3 * n + 2
    assert network.temporal.gru.bidirectional
    assert network.temporal.norm.normalized_shape == (2 * h,)

    def widths(layers: torch.nn.Sequential) -> list[int]:
        linear = [layer for layer in layers if isinstance(layer, torch.nn.Linear)]
        return [linear[0].in_features, *(layer.out_features for layer in linear)]

    assert widths(network.base.layers) == [n + 2, 8, 8, n]
    assert widths(network.layout_head.layers) == [2 * h, 8, 8, 2 * n]
    assert widths(network.prediction_head.layers) == [2 * h + 3 * n, 8, 8, 2 * n]
    assert widths(build("without-geo-dist").prediction_head.layers) == [2 * h + 2 * n, 8, 8, 2 * n]


@pytest.mark.parametrize("name", GAIAS)
def test_outputs_have_their_shapes_and_variants_lack_theirs(
    name: str, build: Build, draw: Build
) -> None:
    found = build(name)(*draw())
    assert found.distance.shape == (2, 8, 3)
    layout = None if name == "without-layout-head" else (2, 3, 2)
    geometry = None if name in {"without-layout-head", "without-geo-dist"} else (2, 8, 3)
    assert (found.layout is None) == (layout is None)
    assert layout is None or found.layout.shape == layout
    for value in (found.layout_distance, found.gate):
        assert (value is None) == (geometry is None)
        assert value is None or value.shape == geometry
    if found.gate is not None:
        assert ((found.gate > 0) & (found.gate < 1)).all()


@pytest.mark.parametrize("name", GAIAS)
def test_a_batch_gives_what_each_alone_gives(name: str, build: Build, draw: Build) -> None:
    network, inputs = build(name), draw(n_batch=4)
    together = network(*inputs)
    for k in range(4):
        alone = network(*(part[k : k + 1] for part in inputs))
        torch.testing.assert_close(together.distance[k : k + 1], alone.distance)
        if alone.layout is not None:
            torch.testing.assert_close(together.layout[k : k + 1], alone.layout)


@pytest.mark.parametrize("name", GAIAS)
def test_there_is_nothing_where_nothing_was_measured(name: str, build: Build, draw: Build) -> None:
    position, distance, mask, gap = draw()
    mask[0, :, 1] = 0
    distance = distance * mask
    found = build(name)(position, distance, mask, gap)
    assert (found.distance[mask == 0] == 0).all()
    if found.layout is not None:
        assert (found.layout[0, 1] == 0).all()
        assert (found.layout[1] != 0).all()
    # The height of a padded anchor is nobody's, and reaches no other anchor where there is no l_d.
    if found.layout_distance is None:
        gap[0, :, 1] += 3.0
        again = build(name)(position, distance, mask, gap)
        assert torch.equal(found.distance, again.distance)


@pytest.mark.parametrize("name", GAIAS)
def test_ranges_are_never_negative(name: str, build: Build, draw: Build) -> None:
    network = build(name)
    with torch.no_grad():
        network.prediction_head.layers[-1].bias[:3] = -50.0  # the residual
    found = network(*draw())
    assert (found.distance >= 0).all()
    if found.gate is not None:
        expected = (1 - found.gate) * found.layout_distance * draw()[2]
        torch.testing.assert_close(found.distance, expected)
    else:
        assert (found.distance == 0).all()


def test_fusion_is_the_papers_formula() -> None:
    refined, l_d = torch.tensor([2.0, 2.0, 2.0]), torch.tensor([4.0, 4.0, 4.0])
    logit, mask = torch.tensor([0.0, 40.0, 0.0]), torch.tensor([1.0, 1.0, 0.0])
    pred, gate = gated_fusion(refined, l_d, logit, mask)
    torch.testing.assert_close(gate, torch.tensor([0.5, 1.0, 0.5]))
    torch.testing.assert_close(pred, torch.tensor([3.0, 2.0, 0.0]))


def test_geometric_distance_is_the_slant_distance() -> None:
    position = torch.tensor([[[0.0, 0.0], [3.0, 4.0]]])
    layout = torch.tensor([[[3.0, 4.0], [0.0, 12.0]]])
    flat = geometric_distance(position, layout, torch.zeros(1, 2, 2))
    torch.testing.assert_close(
        flat, torch.tensor([[[5.0, 12.0], [0.0, 73.0**0.5]]]), atol=2e-4, rtol=0
    )
    slant = geometric_distance(position, layout, torch.full((1, 2, 2), 12.0))
    torch.testing.assert_close(slant[0, 0], torch.tensor([13.0, 288.0**0.5]))
    moving = torch.stack([layout, layout + 1.0], dim=1)
    found = geometric_distance(position, moving, torch.zeros(1, 2, 2))
    torch.testing.assert_close(found[:, :1], flat[:, :1])
    torch.testing.assert_close(found[0, 1, 0], torch.tensor(2.0**0.5))


def test_geometric_distance_has_a_gradient_on_top_of_an_anchor() -> None:
    layout = torch.zeros(1, 1, 2, requires_grad=True)
    geometric_distance(torch.zeros(1, 1, 2), layout, torch.zeros(1, 1, 1)).sum().backward()
    assert torch.isfinite(layout.grad).all()


@pytest.mark.parametrize("name", ["gaia", "unfrozen-base"])
def test_the_base_learns_only_if_told_to(name: str, build: Build, draw: Build) -> None:
    network = build(name)
    network(*draw()).distance.square().sum().backward()
    learns = [weight.grad is not None for weight in network.base.parameters()]
    assert learns == [name == "unfrozen-base"] * 6
    rest = {k: w for k, w in network.named_parameters() if not k.startswith("base.")}
    assert all(weight.grad is not None and weight.grad.any() for weight in rest.values())


@pytest.mark.parametrize("name", sorted(CAUSAL))
def test_causal_outputs_know_nothing_of_what_comes_later(
    name: str, build: Build, draw: Build
) -> None:
    network, inputs, others = build(name), draw(seed=1), draw(seed=2)
    present, ahead = 3, CAUSAL[name]
    cut = present + ahead + 1
    later = [
        torch.cat([a[:, :cut], b[:, cut:]], dim=1) for a, b in zip(inputs, others, strict=True)
    ]
    now, then = network(*inputs), network(*later)
    for field in ("distance", "layout_distance", "gate"):
        before, after = getattr(now, field), getattr(then, field)
        assert torch.equal(before[:, : present + 1], after[:, : present + 1])
        assert not torch.equal(before[:, present + 1 :], after[:, present + 1 :])
    # And it does look as far ahead as it may.
    sooner = [
        torch.cat([a[:, : cut - 1], b[:, cut - 1 :]], dim=1)
        for a, b in zip(inputs, others, strict=True)
    ]
    assert not torch.equal(now.distance[:, present], network(*sooner).distance[:, present])


def test_the_bidirectional_network_does_look_ahead(build: Build, draw: Build) -> None:
    network, inputs = build("gaia"), draw()
    later = [part.clone() for part in inputs]
    later[0][:, -1] += 1.0
    assert not torch.equal(network(*inputs).distance[:, 0], network(*later).distance[:, 0])


@pytest.mark.parametrize("name", GAIAS)
@pytest.mark.parametrize("n_steps", [1, 2, 5])
def test_short_runs_are_denoised(name: str, n_steps: int, build: Build, draw: Build) -> None:
    found = build(name)(*draw(n_steps=n_steps)).distance
    assert found.shape == (2, n_steps, 3)
    assert torch.isfinite(found).all()


@pytest.mark.parametrize("name", WITH_LAYOUT)
def test_an_anchor_that_was_not_seen_yet_has_no_place(name: str, build: Build, draw: Build) -> None:
    network, (position, distance, mask, _) = build(name), draw()
    mask[:] = 1
    mask[:, :, 1] = 0
    mask[:, 6:, 1] = 1
    distance = distance * mask
    x = network.temporal(distance, distance, mask, position)
    layout = network.layout_head(x, mask)
    if layout.dim() == 3:
        assert (layout != 0).all()
        return
    first = 6 - CAUSAL[name]
    assert (layout[:, :first, 1] == 0).all()
    assert (layout[:, first:, 1] != 0).all()
    assert (layout[:, :, [0, 2]] != 0).all()


@pytest.mark.parametrize("name", WITH_LAYOUT)
def test_standardised_heads_start_at_the_mean_layout_and_the_bases_error(
    name: str, build: Build, draw: Build
) -> None:
    network, (position, distance, mask, gap) = build(name), draw(n_batch=3)
    mask[:] = 1
    mask[0, :, 2] = 0  # padded there: its place does not count
    anchor = torch.randn(3, 3, 2, generator=torch.Generator().manual_seed(3))
    anchor[1, 0] = torch.nan
    with torch.no_grad():
        base = network.base(position, distance, mask, gap).distance
    network.standardise(position, distance, mask, base + 0.7 * mask, anchor)
    torch.testing.assert_close(network.prediction_head.residual_scale, torch.tensor(0.7))
    head = network.layout_head
    expected = torch.stack([anchor[[0, 2], 0].mean(0), anchor[:, 1].mean(0), anchor[1:, 2].mean(0)])
    torch.testing.assert_close(head.mean, expected)
    away = (
        torch.cat([anchor[[0, 2], 0], anchor[:, 1], anchor[1:, 2]])
        - expected[[0, 0, 1, 1, 1, 2, 2]]
    )
    torch.testing.assert_close(head.spread, away.square().mean().sqrt())
    with torch.no_grad():
        head.layers[-1].weight.zero_()
        head.layers[-1].bias.zero_()
    layout = network(position, distance, mask, gap).layout
    torch.testing.assert_close(layout[1], expected)
    assert (layout[0, 2] == 0).all()


def test_a_single_layout_and_a_perfect_base_leave_finite_scales(build: Build, draw: Build) -> None:
    network, (position, distance, mask, gap) = build("gaia"), draw()
    with torch.no_grad():
        base = network.base(position, distance, mask, gap).distance
    network.standardise(position, distance, mask, base, torch.ones(2, 3, 2))
    assert network.prediction_head.residual_scale > 0
    assert network.layout_head.spread > 0
    nowhere = torch.full((2, 3, 2), torch.nan)
    network.standardise(position, distance, torch.zeros_like(mask), base, nowhere)
    found = network(position, distance, mask, gap)
    assert torch.isfinite(found.distance).all()
    assert torch.isfinite(found.layout).all()
