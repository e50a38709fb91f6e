"""``mlp``: a perceptron on the ranges of one step, without the vehicle's pose.

The paper's MLP baseline ("Baseline Selection"): no temporal structure, no pose.
"""

from __future__ import annotations

from torch import Tensor, nn

from gaia_uwb.learn.networks.layers import WindowPrediction, three_layers
from gaia_uwb.models import MlpArchitecture


class Mlp(nn.Module):
    """Estimate all ranges of a step from the measured ranges of that step.

    Parameters
    ----------
    n_anchors
        Number of anchors N that the network has channels for.
    architecture
        Its sizes.
    """

    def __init__(self, n_anchors: int, architecture: MlpArchitecture) -> None:
        super().__init__()
        self.layers = three_layers(n_anchors, architecture.hidden, n_anchors)

    def forward(
        self, position: Tensor, distance: Tensor, mask: Tensor, height_gap: Tensor
    ) -> WindowPrediction:
        """Denoise a batch.

        Parameters
        ----------
        position
            (B, T, 2): where the tag's antenna is; not used.
        distance
            (B, T, N): measured ranges, 0 where the mask is 0.
        mask
            (B, T, N): 1 where there is a range, else 0.
        height_gap
            (B, T, N): tag's height minus the anchor's; not used.
        """
        return WindowPrediction(self.layers(distance) * mask)
