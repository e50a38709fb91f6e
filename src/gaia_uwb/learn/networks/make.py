"""One function that builds each of the paper's networks."""

from __future__ import annotations

from torch import nn

from gaia_uwb.learn.networks.gaia import Gaia
from gaia_uwb.learn.networks.mlp import Mlp
from gaia_uwb.learn.networks.pose_mlp import PoseMlp
from gaia_uwb.models import (
    GaiaArchitecture,
    MlpArchitecture,
    PoseMlpArchitecture,
    WindowArchitecture,
)


def make_network(n_anchors: int, architecture: WindowArchitecture) -> nn.Module:
    """Build a network with fresh weights from PyTorch's global generator.

    Parameters
    ----------
    n_anchors
        Number of anchors that it has channels for.
    architecture
        Their class says which network.

    Examples
    --------
    >>> from gaia_uwb.models import GaiaArchitecture
    >>> network = make_network(12, GaiaArchitecture())
    >>> sum(weights.numel() for weights in network.parameters())
    162940
    """
    match architecture:
        case MlpArchitecture():
            return Mlp(n_anchors, architecture)
        case PoseMlpArchitecture():
            return PoseMlp(n_anchors, architecture)
        case GaiaArchitecture():
            return Gaia(n_anchors, architecture)
