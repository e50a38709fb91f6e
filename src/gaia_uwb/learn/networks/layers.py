"""What several networks are made of."""

from __future__ import annotations

from typing import NamedTuple

from torch import Tensor, nn


class WindowPrediction(NamedTuple):
    """What a network makes of a batch, in units of its normalisation's length scale."""

    distance: Tensor
    """(B, T, N): denoised ranges, 0 where the mask is 0."""
    layout: Tensor | None = None
    """(B, N, 2): where the anchors stand, for networks that say so."""
    layout_distance: Tensor | None = None
    """(B, T, N): the ranges that follow from ``layout`` and the path."""
    gate: Tensor | None = None
    """(B, T, N): share of the corrected ranges in ``distance``; the rest is the layout's."""


def three_layers(n_in: int, hidden: int, n_out: int) -> nn.Sequential:
    """Return a three-layer perceptron with ReLU activations, as in the paper.

    Parameters
    ----------
    n_in, hidden, n_out
        Widths of its input, of its two hidden layers and of its output.
    """
    return nn.Sequential(
        nn.Linear(n_in, hidden),
        nn.ReLU(),
        nn.Linear(hidden, hidden),
        nn.ReLU(),
        nn.Linear(hidden, n_out),
    )
