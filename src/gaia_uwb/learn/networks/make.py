"""One function that builds each of the paper's networks."""

from __future__ import annotations

from torch import nn

from gaia_uwb.learn.networks.gaia import Gaia
from gaia_uwb.learn.networks.mlp import Mlp
from gaia_uwb.learn.networks.pose_mlp import PoseMlp
from gaia_uwb.models import GaiaOptions, MlpOptions, NetworkOptions, PoseMlpOptions


def make_network(n_anchors: int, options: NetworkOptions) -> nn.Module:
    """Build a network with fresh weights from PyTorch's global generator.

    Parameters
    ----------
    n_anchors
        Number of anchors that it has channels for.
    options
        Their class says which network.

    Examples
    --------
    >>> from gaia_uwb.models import GaiaOptions
    >>> network = make_network(12, GaiaOptions())
    >>> sum(weights.numel() for weights in network.parameters())
    162940
    """
    match options:
        case MlpOptions():
            return Mlp(n_anchors, options)
        case PoseMlpOptions():
            return PoseMlp(n_anchors, options)
        case GaiaOptions():
            return Gaia(n_anchors, options)
