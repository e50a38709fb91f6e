"""``pose-mlp``: a perceptron on the ranges of one step and the vehicle's position.

The paper's PoseMLP baseline, and the base of its GAIA ("PoseMLP base module").
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from gaia_uwb.learn.networks.layers import WindowPrediction, three_layers
from gaia_uwb.models import PoseMlpArchitecture


class PoseMlp(nn.Module):
    """Estimate all ranges of a step from the measured ranges and the position at that step.

    Parameters
    ----------
    n_anchors
        Number of anchors N that the network has channels for.
    architecture
        Its sizes.
    """

    def __init__(self, n_anchors: int, architecture: PoseMlpArchitecture) -> None:
        super().__init__()
        self.layers = three_layers(n_anchors + 2, architecture.hidden, n_anchors)

    def forward(
        self, position: Tensor, distance: Tensor, mask: Tensor, height_gap: Tensor
    ) -> WindowPrediction:
        """Denoise a batch.

        Parameters
        ----------
        position
            (B, T, 2): where the tag's antenna is.
        distance
            (B, T, N): measured ranges, 0 where the mask is 0.
        mask
            (B, T, N): 1 where there is a range, else 0.
        height_gap
            (B, T, N): tag's height minus the anchor's; not used.
        """
        features = torch.cat([distance, position], dim=-1)  # (B, T, N + 2)
        return WindowPrediction(self.layers(features) * mask)  # b_val: the base estimate, masked
