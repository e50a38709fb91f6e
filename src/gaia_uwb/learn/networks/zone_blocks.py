"""Blocks of ``gaia-set``: a temporal encoder for each token, and attention among all of them.

The axes are those of ``gaia_set.py``.
"""

from __future__ import annotations

import math

import torch
from torch import Tensor, nn
from torch.nn import functional

from gaia_uwb.learn.networks.zone_tokens import STEP_FEATURES, TokenScene, step_features

PAIR_WIDTH = 16
"""Width P of what is said about a pair of tokens."""

_NOTHING = -1e4  # a logit that is never chosen
_HEADS = 4
_DILATIONS = (1, 3, 9)
_KERNEL = 5


def two_layers(n_in: int, hidden: int, n_out: int) -> nn.Sequential:
    """Return two linear layers with a nonlinearity between them."""
    return nn.Sequential(nn.Linear(n_in, hidden), nn.GELU(), nn.Linear(hidden, n_out))


class DilatedConvolution(nn.Module):
    """A convolution over steps, as long after it as before.

    Its weights are a matrix, which is what the training's optimiser takes (``zone_training.py``).

    Parameters
    ----------
    channels
        Channels C.
    dilation
        Steps between two of the kernel's taps.
    """

    def __init__(self, channels: int, *, dilation: int) -> None:
        super().__init__()
        self.dilation = dilation
        beginning = nn.Conv1d(channels, channels, _KERNEL)
        self.weight = nn.Parameter(beginning.weight.detach().flatten(1))
        self.bias = beginning.bias

    def forward(self, h: Tensor) -> Tensor:
        """Return (B, C, T) of (B, C, T)."""
        kernel = self.weight.reshape(len(self.weight), -1, _KERNEL)
        padding = _KERNEL // 2 * self.dilation
        return functional.conv1d(h, kernel, self.bias, padding=padding, dilation=self.dilation)


class TemporalEncoder(nn.Module):
    """Convolutions over the steps of every token, shared by all anchors and both sides.

    Parameters
    ----------
    channels
        Channels C.
    """

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.enter = nn.Conv1d(STEP_FEATURES, channels, 1)
        self.layers = nn.ModuleList(DilatedConvolution(channels, dilation=d) for d in _DILATIONS)

    def forward(self, scene: TokenScene, place: Tensor) -> tuple[Tensor, Tensor]:
        """Return features of every step (B, M, C, T), and of the whole token (B, M, 2C)."""
        x = step_features(scene, place)  # (B, M, T, F)
        batch, tokens, steps, n_features = x.shape
        h = functional.gelu(
            self.enter(x.reshape(batch * tokens, steps, n_features).transpose(1, 2))
        )
        for layer in self.layers:
            h = h + functional.gelu(layer(h))
        h = h.reshape(batch, tokens, -1, steps)
        mask = scene.mask.unsqueeze(2)
        mean = (h * mask).sum(dim=-1) / mask.sum(dim=-1).clamp_min(1)
        largest = (h * mask + (mask - 1) * 1e3).amax(dim=-1).clamp_min(-10.0)
        return h, torch.cat([mean, largest], dim=-1)


class Attention(nn.Module):
    """Self-attention over the tokens of a scene; what one sees in another depends on the pair.

    Parameters
    ----------
    width
        Width D.
    """

    def __init__(self, width: int) -> None:
        super().__init__()
        self.norm = nn.LayerNorm(width)
        self.query_key_value = nn.Linear(width, 3 * width)
        self.pair_bias = nn.Linear(PAIR_WIDTH, _HEADS)
        self.pair_value = nn.Linear(PAIR_WIDTH, width)
        self.out = nn.Linear(width, width)
        self.feed_forward = nn.Sequential(nn.LayerNorm(width), *two_layers(width, 2 * width, width))

    def forward(self, token: Tensor, pair: Tensor, observed: Tensor) -> Tensor:
        """Return new tokens (B, M, D); tokens of anchors that were not observed are not seen."""
        batch, tokens, width = token.shape
        parts = self.query_key_value(self.norm(token))
        parts = parts.reshape(batch, tokens, 3, _HEADS, width // _HEADS).permute(2, 0, 3, 1, 4)
        query, key, value = parts[0], parts[1], parts[2]  # (B, heads, M, D / heads)
        logit = query @ key.transpose(-1, -2) / math.sqrt(width // _HEADS)
        logit = logit + self.pair_bias(pair).permute(0, 3, 1, 2)
        logit = logit + (1 - observed[:, None, None, :]) * _NOTHING
        share = logit.softmax(dim=-1)  # (B, heads, M, M)
        shape = (batch, tokens, tokens, _HEADS, width // _HEADS)
        seen = share @ value + torch.einsum(
            "bhij,bijhd->bhid", share, self.pair_value(pair).reshape(shape)
        )
        token = token + self.out(seen.permute(0, 2, 1, 3).reshape(batch, tokens, width))
        better: Tensor = token + self.feed_forward(token)
        return better
