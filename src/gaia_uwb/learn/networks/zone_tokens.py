"""What the rounds of ``gaia-set`` see: two tokens per anchor, each in a frame of its own.

A token is one place of an anchor, on the left or the right of the path. Its frame is the path's
(``path_frame.py``), mirrored for places on the right, so that both sides look alike to the weights.

Axes as in ``gaia_set.py``: B episodes, T steps, N anchors, M = 2 N tokens (all left ones first).
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from gaia_uwb.models import ZoneInputs

_LEAST_SQUARE_M2 = 1e-4  # under a root, so that its gradient stays finite on top of an anchor

STEP_FEATURES, TOKEN_FEATURES, PAIR_FEATURES = 17, 42, 15
"""Numbers of features of a step, of a token with its evidence, and of a pair of tokens."""


class TokenScene(NamedTuple):
    """What the rounds know of a batch, token by token, each in its own frame."""

    side: Tensor  # (B, M): 1 left, -1 right
    path: Tensor  # (B, M, T, 2)
    velocity: Tensor  # (B, M, T, 2)
    range: Tensor  # (B, M, T)
    mask: Tensor  # (B, M, T)
    gap: Tensor  # (B, M, T)
    road: Tensor  # (B, M, 3)
    known: Tensor  # (B, M, 27): features that no round changes
    step: Tensor  # (B, 1, 1, 1)
    observed: Tensor  # (B, M)
    kin: Tensor  # (M, M, 3): of one side; of one anchor; the same


def make_token_scene(inputs: ZoneInputs) -> TokenScene:
    """Lay the inputs out for the tokens, each in its own frame."""
    ones = torch.ones_like(inputs.range[:, :, 0])  # (B, N)
    side = torch.cat([ones, -ones], dim=1)  # (B, M)
    mirror = flip(side).unsqueeze(2)  # (B, M, 1, 2)
    known, observed = _known(inputs, side)
    n = inputs.range.shape[1]
    number = torch.arange(n, device=inputs.range.device)
    number = torch.cat([number, number])
    one_side = (side[0].unsqueeze(1) * side[0].unsqueeze(0) + 1) / 2
    one_anchor = (number.unsqueeze(1) == number.unsqueeze(0)).to(inputs.range.dtype)
    return TokenScene(
        side=side,
        path=inputs.position.unsqueeze(1) * mirror,
        velocity=inputs.velocity.unsqueeze(1) * mirror,
        range=_twice(inputs.range),
        mask=_twice(inputs.mask),
        gap=_twice(inputs.height_gap),
        road=inputs.road.unsqueeze(1) * side.unsqueeze(-1),
        known=known,
        step=inputs.step.reshape(-1, 1, 1, 1),
        observed=_twice(observed),
        kin=torch.stack([one_side, one_anchor, one_side * one_anchor], dim=-1),
    )


def _known(inputs: ZoneInputs, side: Tensor) -> tuple[Tensor, Tensor]:
    """Return the tokens' features that no round changes (B, M, 27), and the observed (B, N)."""
    count = inputs.mask.sum(dim=-1)
    apart = torch.sqrt((inputs.start[:, :, 0] - inputs.start[:, :, 1]).square().sum(dim=-1) + 1e-4)
    mean_m = (inputs.range * inputs.mask).sum(dim=-1) / count.clamp_min(1)
    both = torch.stack(
        [
            count.clamp_min(1).log() / 4,
            mean_m.clamp_min(0.1).log() / 4,
            (apart + 0.01).log() / 3,
            inputs.height_gap.mean(dim=-1),
        ],
        dim=-1,
    )  # (B, N, 4)
    fits = to_tokens(inputs.fit)  # (B, M, 4)
    better = fits[..., :1]
    observed = (count > 0).to(inputs.range.dtype)
    even = inputs.path_even / inputs.path_even.new_tensor([3.0, 3.0, 2.0, 15.0, 5.0, 1.0])
    odd = inputs.path_odd.unsqueeze(1) * side.unsqueeze(-1)  # (B, M, 5)
    known = torch.cat(
        [
            *(torch.tanh(better / scale) for scale in (1.0, 5.0, 25.0)),
            fits[..., 1:2] / 2,
            torch.tanh(fits[..., 2:3] / 0.2),
            fits[..., 3:4] / 2,
            _twice(both),
            _twice(observed).unsqueeze(-1),
            even.unsqueeze(1).expand(-1, side.shape[1], -1),
            torch.tanh(odd / 2),
            torch.tanh(odd / 20),
        ],
        dim=-1,
    )
    return known, observed


def _twice(values: Tensor) -> Tensor:
    """Return what holds for an anchor for both of its tokens."""
    return torch.cat([values, values], dim=1)


def slant_m(scene: TokenScene, place: Tensor) -> tuple[Tensor, Tensor]:
    """Return slant distances (B, M, T) of places, and place minus path (B, M, T, 2)."""
    off = place.unsqueeze(2) - scene.path
    return torch.sqrt(off.square().sum(dim=-1) + scene.gap.square() + _LEAST_SQUARE_M2), off


def road_left_m(scene: TokenScene, along: Tensor) -> Tensor:
    """Return where the road's parabola is at ``along`` (B, M), in the tokens' frames."""
    return scene.road[..., 0] + scene.road[..., 1] * along + scene.road[..., 2] * along.square()


def off_road_m(scene: TokenScene, place: Tensor) -> Tensor:
    """Return how far places stand off the road, towards the token's side (B, M)."""
    return place[..., 1] - road_left_m(scene, place[..., 0])


def step_features(scene: TokenScene, place: Tensor) -> Tensor:
    """Return what an anchor at a place would leave unexplained at each step (B, M, T, 17)."""
    distance, off = slant_m(scene, place)
    residual = (scene.range - distance) * scene.mask
    speed = torch.sqrt(scene.velocity.square().sum(dim=-1) + 1e-6)
    left = scene.path[..., 1]
    return torch.cat(
        [
            _squashed(residual, 0.1, 0.5, 2.0, 10.0),
            scene.mask.unsqueeze(-1),
            off / distance.unsqueeze(-1),
            torch.log1p(scene.range.clamp_min(0)).unsqueeze(-1) / 5,
            _squashed(left, 1.0, 5.0, 25.0),
            scene.path[..., :1] / 50,
            scene.velocity / 10,
            3 * scene.velocity[..., 1:] / (speed.unsqueeze(-1) + 0.1),
            scene.step.expand(*residual.shape, 1),
            _squashed(off[..., 1], 3.0),
        ],
        dim=-1,
    )


def token_features(scene: TokenScene, place: Tensor) -> Tensor:
    """Return what is known of a token as a whole, less the evidence (B, M, 40)."""
    off_road = off_road_m(scene, place)
    slope = scene.road[..., 1] + 2 * scene.road[..., 2] * place[..., 0]
    return torch.cat(
        [
            _squashed(off_road, 1.0, 3.0, 10.0, 40.0),
            (off_road / 10).clamp(-5.0, 5.0).unsqueeze(-1),
            slope.clamp(-2.0, 2.0).unsqueeze(-1),
            place[..., :1] / 100,
            _squashed(place[..., 1], 1.0, 3.0, 10.0, 40.0),
            _squashed(place[..., 0], 10.0, 50.0),
            scene.known,
        ],
        dim=-1,
    )


def pair_features(scene: TokenScene, place: Tensor) -> Tensor:
    """Return how token j stands to token i, in the frame of i (B, M, M, 15)."""
    common_left = place[..., 1] * scene.side
    ahead = place[..., 0].unsqueeze(1) - place[..., 0].unsqueeze(2)  # (B, i, j)
    left = common_left.unsqueeze(1) - common_left.unsqueeze(2)
    off_road = off_road_m(scene, place) * scene.side
    across = (off_road.unsqueeze(1) - off_road.unsqueeze(2)) * scene.side.unsqueeze(2)
    apart = torch.sqrt(ahead.square() + left.square() + 1e-4)
    return torch.cat(
        [
            _squashed(ahead, 2.0, 8.0, 30.0, 120.0),
            _squashed(across, 1.0, 3.0, 10.0, 40.0),
            _squashed(ahead.abs(), 2.0, 8.0, 30.0),
            (apart + 0.1).log().unsqueeze(-1) / 3,
            scene.kin.unsqueeze(0).expand(ahead.shape[0], -1, -1, -1),
        ],
        dim=-1,
    )


def flip(side: Tensor) -> Tensor:
    """Return what mirrors (along, left) for tokens on the right (B, M, 2)."""
    return torch.stack([torch.ones_like(side), side], dim=-1)


def to_tokens(values: Tensor) -> Tensor:
    """Return (B, N, 2, F) as (B, M, F): all left ones first."""
    return torch.cat([values[:, :, 0], values[:, :, 1]], dim=1)


def by_side(values: Tensor) -> Tensor:
    """Return (B, M, F) as (B, N, 2, F)."""
    n = values.shape[1] // 2
    return torch.stack([values[:, :n], values[:, n:]], dim=2)


def _squashed(values: Tensor, *scales: float) -> Tensor:
    """Return values on several scales, each between -1 and 1, along a new last axis."""
    return torch.stack([torch.tanh(values / scale) for scale in scales], dim=-1)
