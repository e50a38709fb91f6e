from __future__ import annotations

import pytest

pytest.importorskip("torch", reason="needs PyTorch: install gaia-uwb[train]")

import numpy as np
import torch

from gaia_uwb.learn.networks.augmentation import varied
from gaia_uwb.learn.networks.window_losses import WindowBatch
from gaia_uwb.models.domain import Normalisation
from gaia_uwb.models.window_inputs import make_window_inputs, window_targets
from tiny_models import WindowTrainingOptions, make_run

SCALE_M = 10.0


def make_batch(n: int = 40) -> WindowBatch:
    runs = [make_run(seed, n_steps=20) for seed in range(n)]
    norm = Normalisation(origin_east_m=0.0, origin_north_m=-4.0, scale_m=SCALE_M)
    parts = (*make_window_inputs(runs, 4, norm), *window_targets(runs, 4, norm))
    return WindowBatch(*map(torch.from_numpy, parts))


def vary(batch: WindowBatch, seed: int = 0, **changes: float | bool) -> WindowBatch:
    return varied(batch, np.random.default_rng(seed), SCALE_M, WindowTrainingOptions(**changes))


def same(one: WindowBatch, other: WindowBatch) -> set[str]:
    return {
        name
        for name in WindowBatch._fields
        if torch.equal(getattr(one, name), getattr(other, name))
    }


def test_nothing_is_varied_unless_asked() -> None:
    assert same(vary(make_batch()), make_batch()) == set(WindowBatch._fields)


def test_noise_has_its_size_in_metres_and_keeps_out_of_the_truth() -> None:
    batch = make_batch()
    moved = vary(batch, position_noise_m=0.5)
    assert same(moved, batch) == set(WindowBatch._fields) - {"position"}
    assert (moved.position - batch.position).std().item() * SCALE_M == pytest.approx(0.5, rel=0.1)
    noisy = vary(batch, range_noise_m=0.5)
    assert same(noisy, batch) == set(WindowBatch._fields) - {"distance"}
    error = (noisy.distance - batch.distance)[batch.mask == 1]
    assert error.std().item() * SCALE_M == pytest.approx(0.5, rel=0.1)
    assert not noisy.distance[batch.mask == 0].any()
    assert (vary(batch, range_noise_m=10.0).distance >= 0).all()


def test_wrong_ranges_are_a_share_and_anywhere_a_range_may_be() -> None:
    batch = make_batch()
    wrong = vary(batch, outlier_share=0.2)
    assert same(wrong, batch) == set(WindowBatch._fields) - {"distance"}
    assert not wrong.distance[wrong.mask == 0].any()
    changed = (wrong.distance != batch.distance)[batch.mask == 1]
    assert changed.double().mean().item() == pytest.approx(0.2, abs=0.02)
    anywhere = wrong.distance[(wrong.distance != batch.distance) & (batch.mask == 1)]
    longest = batch.distance.max().item()
    assert 0 <= anywhere.min().item() < 0.1 * longest
    assert 0.9 * longest < anywhere.max().item() <= longest


def test_left_out_ranges_are_a_share_of_each_episode_and_unseen() -> None:
    batch = make_batch()
    less = vary(batch, drop_share=0.5)
    assert same(less, batch) == set(WindowBatch._fields) - {"distance", "mask"}
    assert not less.distance[less.mask == 0].any()
    kept = less.mask == 1
    assert torch.equal(less.distance[kept], batch.distance[kept])
    shares = 1 - less.mask.sum(dim=(1, 2)) / batch.mask.sum(dim=(1, 2))
    assert shares.mean().item() == pytest.approx(0.25, abs=0.06)
    assert shares.max().item() < 0.7
    assert shares.min().item() < 0.1


def test_about_half_of_the_drives_go_backwards_as_a_whole() -> None:
    batch = make_batch()
    turned = vary(batch, reverse=True)
    backwards = 0
    for k in range(len(batch.mask)):
        flip = not torch.equal(turned.position[k], batch.position[k])
        backwards += flip
        for name in set(WindowBatch._fields) - {"anchor"}:
            part = getattr(batch, name)[k]
            assert torch.equal(getattr(turned, name)[k], part.flip(0) if flip else part), name
    assert torch.equal(turned.anchor, batch.anchor)
    assert 10 < backwards < 30
