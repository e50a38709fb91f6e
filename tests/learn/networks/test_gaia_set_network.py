"""What the network promises whatever its weights are: they are random here."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("torch", reason="needs PyTorch: install gaia-uwb[train]")

import torch
from torch import Tensor

from gaia_uwb.learn.networks.gaia_set import GaiaSet, ZonePrediction
from gaia_uwb.learn.networks.zone_heads import Prior, gauss_newton, side_probability
from gaia_uwb.learn.networks.zone_tokens import make_token_scene
from gaia_uwb.models.description import GaiaSetArchitecture
from gaia_uwb.models.zone_inputs import ZoneInputs

SMALL = GaiaSetArchitecture(channels=6, width=8, layers=1)


def make_network(options: GaiaSetArchitecture = SMALL, seed: int = 0) -> GaiaSet:
    torch.manual_seed(seed)
    network = GaiaSet(options).double().eval()
    with torch.no_grad():  # also those that start as zeros
        for weights in network.parameters():
            weights.add_(0.1 * torch.randn_like(weights))
    return network


def make_inputs(batch: int = 3, anchors: int = 4, steps: int = 20, seed: int = 0) -> ZoneInputs:
    """Return random inputs that are consistent: a path, anchors beside it, ranges with gaps."""
    rng = np.random.default_rng(seed)
    along = np.linspace(-20, 20, steps) + np.zeros((batch, 1))
    left = rng.normal(size=(batch, 1)) * along**2 / 400 + rng.normal(scale=0.1, size=along.shape)
    position = np.stack([along, left], axis=-1)
    place = rng.normal(scale=[20, 6], size=(batch, anchors, 2))
    off = position[:, None] - place[:, :, None]
    mask = (rng.random((batch, anchors, steps)) < 0.8).astype(float)
    noisy = np.linalg.norm(off, axis=-1) + rng.normal(scale=0.3, size=mask.shape)
    height = np.abs(place[..., 1:]) + 0.1 * rng.random((batch, anchors, 1))
    both = np.stack([height, -height], axis=2)[..., 0]  # (B, N, 2): left and right of the path
    start = np.stack([np.broadcast_to(place[..., :1], both.shape), both], axis=-1)
    better = rng.normal(scale=3, size=(batch, anchors, 1))
    fit = np.stack(
        [
            np.concatenate([better, -better], axis=-1),
            *(rng.normal(scale=0.3, size=both.shape) for _ in range(2)),
            np.abs(rng.normal(size=both.shape)),
        ],
        axis=-1,
    )
    return ZoneInputs(
        position, np.gradient(position, 0.1, axis=1), noisy * mask, mask,
        rng.random((batch, anchors, 1)) + np.zeros(mask.shape), start, fit,
        rng.normal(scale=[0.1, 0.01, 1e-3], size=(batch, 3)), rng.normal(size=(batch, 6)),
        rng.normal(size=(batch, 5)), np.full(batch, np.log(0.1)),
    )  # fmt: skip


def run(network: GaiaSet, inputs: ZoneInputs) -> ZonePrediction:
    with torch.no_grad():
        found: ZonePrediction = network(*(torch.from_numpy(np.array(part)) for part in inputs))
    return found


def same(found: Tensor, expected: Tensor) -> None:
    torch.testing.assert_close(found, expected, rtol=1e-7, atol=1e-7)


def test_permuting_anchors_permutes_the_output() -> None:
    network, inputs = make_network(), make_inputs()
    order = [2, 0, 3, 1]
    per_anchor = {"range", "mask", "height_gap", "start", "fit"}
    permuted = inputs._replace(**{name: getattr(inputs, name)[:, order] for name in per_anchor})
    before, after = run(network, inputs), run(network, permuted)
    for name in ("range", "log_sigma", "nlos_logit", "place", "information", "side_logit"):
        same(getattr(after, name), getattr(before, name)[:, order])
    same(after.scene_logit, before.scene_logit)


def test_mirroring_a_scene_mirrors_the_output() -> None:
    network, inputs = make_network(), make_inputs()
    flip = np.array([1.0, -1.0])
    mirrored = inputs._replace(
        position=inputs.position * flip,
        velocity=inputs.velocity * flip,
        start=inputs.start[:, :, ::-1] * flip,
        fit=inputs.fit[:, :, ::-1],
        road=-inputs.road,
        path_odd=-inputs.path_odd,
    )
    before, after = run(network, inputs), run(network, mirrored)
    for name in ("range", "corrected", "log_sigma", "nlos_logit"):
        same(getattr(after, name), getattr(before, name))
    same(after.place, before.place.flip(2) * torch.tensor(flip))
    same(after.information, before.information.flip(2) * torch.tensor([1.0, -1.0, 1.0]))
    same(after.scene_logit, -before.scene_logit)
    same(after.side_logit, before.side_logit.flip(-1))
    left = side_probability(before.scene_logit, before.side_logit)
    same(side_probability(after.scene_logit, after.side_logit), 1 - left)


def test_an_anchor_without_ranges_changes_nothing_for_the_others() -> None:
    network, inputs = make_network(), make_inputs()
    rng = np.random.default_rng(5)

    def padded(values: np.ndarray, *, empty: bool) -> np.ndarray:
        shape = (len(values), 2, *values.shape[2:])
        more = np.zeros(shape) if empty else rng.normal(size=shape)
        return np.concatenate([values, more], axis=1)

    longer = inputs._replace(
        range=padded(inputs.range, empty=True),
        mask=padded(inputs.mask, empty=True),
        **{
            name: padded(getattr(inputs, name), empty=False)
            for name in ("height_gap", "start", "fit")
        },
    )
    before, after = run(network, inputs), run(network, longer)
    for name in ("range", "log_sigma", "place", "information", "side_logit"):
        same(getattr(after, name)[:, :4], getattr(before, name))
    same(after.scene_logit, before.scene_logit)


def test_an_episode_gives_what_it_gives_alone() -> None:
    network, inputs = make_network(), make_inputs()
    together = run(network, inputs)
    for k in range(3):
        alone = run(network, ZoneInputs(*(part[k : k + 1] for part in inputs)))
        for one, all_of_them in zip(alone, together, strict=True):
            same(one[0], all_of_them[k])


@pytest.mark.parametrize(("anchors", "steps"), [(1, 3), (1, 64), (2, 400), (200, 8)])
def test_any_number_of_anchors_and_steps(anchors: int, steps: int) -> None:
    found = run(make_network(), make_inputs(1, anchors, steps))
    assert found.range.shape == (1, anchors, steps)
    assert found.place.shape == (1, anchors, 2, 2)
    assert all(torch.isfinite(part).all() for part in found)


def test_information_is_that_of_an_ellipse() -> None:
    found = run(make_network(), make_inputs(8))
    aa, al, ll = found.information.unbind(-1)
    assert (aa > 0).all() and (aa * ll - al * al > 0).all()


def test_without_attention_anchors_do_not_see_each_other() -> None:
    network = make_network(GaiaSetArchitecture(channels=6, width=8, layers=0))
    inputs = make_inputs()
    changed = inputs.range.copy()
    changed[:, 3] *= 1.5
    before, after = run(network, inputs), run(network, inputs._replace(range=changed))
    same(after.place[:, :3], before.place[:, :3])
    assert not torch.allclose(after.place[:, 3], before.place[:, 3])


def test_gauss_newton_without_a_prior_finds_where_ranges_meet() -> None:
    inputs = [torch.from_numpy(np.array(part)) for part in make_inputs(2, 3, 40)]
    scene = make_token_scene(ZoneInputs(*inputs))
    truth = torch.tensor([[8.0, 5.0], [-3.0, 9.0], [0.0, 4.0]], dtype=torch.float64)
    place = torch.cat([truth, truth]).expand(2, -1, -1)  # each token in its own frame
    off = place.unsqueeze(2) - scene.path
    range_m = torch.sqrt(off.square().sum(-1) + scene.gap.square() + 1e-4)
    none = Prior(torch.zeros_like(place), torch.zeros(2, 6, 3, dtype=torch.float64))
    weight = scene.mask
    found = place + 1.0
    for _ in range(6):
        found, information = gauss_newton(scene, found, range_m, weight, none)
    torch.testing.assert_close(found, place, atol=1e-6, rtol=0)
    # A prior that is certain wins.
    sure = Prior(place + 2.0, torch.tensor([1e9, 0.0, 1e9], dtype=torch.float64).expand(2, 6, 3))
    held, _ = gauss_newton(scene, place, range_m, weight, sure)
    torch.testing.assert_close(held, place + 2.0, atol=1e-3, rtol=0)
    assert (information[..., 0] > 0).all()


def test_gradients_are_those_of_finite_differences() -> None:
    torch.manual_seed(0)
    network = GaiaSet(GaiaSetArchitecture(channels=2, width=4, layers=1, rounds=1)).double()
    inputs = [torch.from_numpy(np.array(part)) for part in make_inputs(1, 2, 6)]

    def value(bias: Tensor) -> Tensor:
        moved = [part + bias if k == 2 else part for k, part in enumerate(inputs)]
        found = network(*moved)
        total: Tensor = found.range.sum() + found.place.sum() + found.information.log().nansum()
        return total

    assert torch.autograd.gradcheck(value, torch.zeros((), dtype=torch.float64, requires_grad=True))


def test_a_vehicle_on_top_of_an_anchor_has_finite_gradients() -> None:
    network = make_network()
    inputs = make_inputs()
    start = inputs.start.copy()
    start[:, 0] = inputs.position[:, 10][:, None]  # both places of an anchor are on the path
    parts = [
        torch.from_numpy(np.array(part))
        for part in inputs._replace(start=start, height_gap=0 * inputs.height_gap)
    ]
    found = network(*parts)
    (found.range.sum() + found.place.sum() + found.scene_logit.sum()).backward()
    for weights in network.parameters():
        assert weights.grad is None or torch.isfinite(weights.grad).all()
