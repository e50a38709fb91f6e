"""Heads of ``gaia-set``: what is wrong with a range, where an anchor stands, and on which side.

The axes are those of ``gaia_set.py``.
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional

from gaia_uwb.learn.networks.zone_blocks import two_layers
from gaia_uwb.learn.networks.zone_tokens import (
    TokenScene,
    by_side,
    off_road_m,
    road_left_m,
    slant_m,
)

_NEWTON_STEPS = 3
_LONGEST_STEP_M = 30.0
_FARTHEST_PRIOR_M = 600.0


def _begin_with(layer: nn.Module, *outputs: float) -> None:
    """Let a layer give these outputs before any training, whatever its inputs."""
    nn.init.zeros_(layer.weight)  # type: ignore[arg-type]  # the layer is linear or a convolution
    layer.bias = nn.Parameter(torch.tensor(outputs))


class RangeHead(nn.Module):
    """What is wrong with each range, given the token's place.

    Parameters
    ----------
    channels, width
        C and D.
    """

    def __init__(self, channels: int, width: int) -> None:
        super().__init__()
        self.from_step = nn.Conv1d(channels, channels, 1)
        self.from_token = nn.Linear(width, channels)
        self.out = nn.Conv1d(channels, 4, 1)
        # No correction, 0.2 m, line of sight, the corrected range itself.
        _begin_with(self.out, 0.0, -1.5, -1.0, 2.0)

    def forward(self, h: Tensor, token: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """Return correction, log sigma, NLOS logit and gate, each (B, M, T)."""
        batch, tokens, channels, steps = h.shape
        x = self.from_step(h.reshape(batch * tokens, channels, steps))
        x = functional.gelu(x + self.from_token(token).reshape(batch * tokens, channels, 1))
        delta, log_sigma, nlos_logit, gate = self.out(x).reshape(batch, tokens, 4, steps).unbind(2)
        return delta, log_sigma.clamp(-5.0, 3.0), nlos_logit, torch.sigmoid(gate)


class Prior(NamedTuple):
    """Where a token's anchor would stand without its ranges: a Gaussian, in the token's frame."""

    mean: Tensor  # (B, M, 2)
    information: Tensor  # (B, M, 3)


def gauss_newton(
    scene: TokenScene, place: Tensor, range_m: Tensor, weight: Tensor, prior: Prior
) -> tuple[Tensor, Tensor]:
    """Find the places that corrected ranges and priors agree on.

    Parameters
    ----------
    scene
        Paths and heights.
    place : (B, M, 2)
        Where to begin.
    range_m, weight : (B, M, T)
        Corrected ranges, and what each is worth (1 / variance), 0 where there is none.
    prior
        Of the places.

    Returns
    -------
    place : (B, M, 2)
        In the tokens' frames.
    information : (B, M, 3)
        Inverse covariance there.
    """
    p_aa, p_al, p_ll = prior.information.unbind(-1)
    for _ in range(_NEWTON_STEPS):
        distance, off = slant_m(scene, place)
        unit_a, unit_l = (off / distance.unsqueeze(-1)).unbind(-1)
        error = range_m - distance
        pull_a, pull_l = weight * unit_a, weight * unit_l
        aa = (pull_a * unit_a).sum(dim=-1) + p_aa
        al = (pull_a * unit_l).sum(dim=-1) + p_al
        ll = (pull_l * unit_l).sum(dim=-1) + p_ll
        to_prior = prior.mean - place
        force_a = (pull_a * error).sum(dim=-1) + p_aa * to_prior[..., 0] + p_al * to_prior[..., 1]
        force_l = (pull_l * error).sum(dim=-1) + p_al * to_prior[..., 0] + p_ll * to_prior[..., 1]
        determinant = (aa * ll - al * al).clamp_min(1e-9)
        step = torch.stack([ll * force_a - al * force_l, aa * force_l - al * force_a], dim=-1)
        step = step / determinant.unsqueeze(-1)
        length = torch.sqrt(step.square().sum(dim=-1, keepdim=True) + 1e-12)
        place = place + step * (_LONGEST_STEP_M / length.clamp_min(_LONGEST_STEP_M))
    return place, torch.stack([aa, al, ll], dim=-1)


class PlaceHead(nn.Module):
    """Where such an anchor stands beside such a road, and what its ranges are worth.

    Parameters
    ----------
    width
        Width D.
    """

    def __init__(self, width: int) -> None:
        super().__init__()
        self.layers = nn.Sequential(nn.LayerNorm(width), *two_layers(width, width, 7))
        # Hardly any prior, at the solver's place.
        _begin_with(self.layers[-1], 0.0, 0.0, -2.0, -2.0, 0.0, 0.0, 2.0)

    def forward(self, scene: TokenScene, place: Tensor, token: Tensor) -> tuple[Prior, Tensor]:
        """Return the prior, and which share of the ranges' information counts (B, M, 1)."""
        ahead, across, log_along, log_left, correlation, share, keep = self.layers(token).unbind(-1)
        along = (place[..., 0] + 5 * ahead).clamp(-_FARTHEST_PRIOR_M, _FARTHEST_PRIOR_M)
        # Beside the road: some of the present distance from it, and an absolute one.
        off_road = torch.sigmoid(keep) * off_road_m(scene, place) + 5 * across
        mean = torch.stack([along, road_left_m(scene, along) + off_road], dim=-1)
        aa, ll = torch.exp(log_along.clamp(-9.0, 7.0)), torch.exp(log_left.clamp(-9.0, 7.0))
        al = 0.95 * torch.tanh(correlation) * torch.sqrt(aa * ll)
        information = torch.stack([aa, al, ll], dim=-1)
        return Prior(mean, information), torch.sigmoid(share - 1).unsqueeze(-1)


class SideHead(nn.Module):
    """The joint probability of the sides.

    Parameters
    ----------
    width
        Width D.
    """

    def __init__(self, width: int) -> None:
        super().__init__()
        self.scene = two_layers(2 * width, width, 1)
        self.anchor = two_layers(2 * width + 2, width, 1)
        self.own = two_layers(3 * width + 2, width, 1)
        nn.init.zeros_(self.scene[-1].weight)  # type: ignore[arg-type]  # a linear layer's
        _begin_with(self.own[-1], 1.5)  # anchors stand on the zone's side

    def forward(self, token: Tensor, evidence: Tensor, observed: Tensor) -> tuple[Tensor, Tensor]:
        """Return the scene's logit (B,) and the anchors' own (B, N, 2)."""
        tokens, ev = by_side(token), by_side(evidence)  # (B, N, 2, D), (B, N, 2, 2)
        live = by_side(observed.unsqueeze(-1))[:, :, 0]  # (B, N, 1)
        mean = (tokens * live.unsqueeze(2)).sum(dim=1) / live.sum(dim=1).clamp_min(1).unsqueeze(1)
        both = torch.cat([tokens, tokens.flip(2)], dim=-1)  # own side, other side
        scene = self.scene(torch.cat([mean, mean.flip(1)], dim=-1)).squeeze(-1)  # (B, 2)
        anchor = self.anchor(torch.cat([both, ev], dim=-1)).squeeze(-1)  # (B, N, 2)
        # What speaks for a side speaks against the other; anchors add up.
        scene_logit = scene[:, 0] - scene[:, 1]
        scene_logit = scene_logit + ((anchor[..., 0] - anchor[..., 1]) * live.squeeze(-1)).sum(
            dim=1
        )
        around = mean.unsqueeze(1).expand(-1, tokens.shape[1], -1, -1)
        own = self.own(torch.cat([both, around, ev], dim=-1)).squeeze(-1)
        return scene_logit, own


def side_probability(scene_logit: Tensor, side_logit: Tensor) -> Tensor:
    """Return the probability that an anchor stands on the left (B, N)."""
    left = torch.sigmoid(scene_logit).unsqueeze(1)
    own = torch.sigmoid(side_logit)
    return left * own[..., 0] + (1 - left) * (1 - own[..., 1])
