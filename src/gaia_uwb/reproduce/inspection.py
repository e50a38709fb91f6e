"""What happens inside a trained GAIA, for figures: its gate and its layout's distances."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch

from gaia_uwb._shared import Array, ConfigError, Float64
from gaia_uwb.episode import Episode
from gaia_uwb.learn import Gaia
from gaia_uwb.models import (
    GaiaArchitecture,
    WindowModel,
    make_window_inputs,
    read_description,
    read_weights,
)


def gate_and_layout(
    folder: Path, windows: Sequence[Episode]
) -> tuple[Float64[Array, "B T N"], Float64[Array, "B T N"]]:
    """Return a model's gate, and the distances of its layout in metres.

    Parameters
    ----------
    folder
        Of a trained ``gaia`` with a layout.
    windows
        Episodes of one length, of at most as many anchors as the model has channels for.

    Returns
    -------
    gate : (B, T, N)
        Share of the corrected range in the result; the rest is the layout's distance.
    layout_m : (B, T, N)
        Distances of the layout; N is the number of the model's channels.

    Raises
    ------
    ConfigError
        If the model has no gate.
    """
    description = read_description(folder)
    made = description.network
    if not (
        isinstance(description, WindowModel)
        and isinstance(made, GaiaArchitecture)
        and made.layout_head
        and made.geo_dist
    ):
        raise ConfigError(f"{folder}: expected a GAIA model with a gate, got {made!r}")
    network = Gaia(description.n_anchors, made)
    weights = read_weights(folder, description)
    network.load_state_dict({name: torch.from_numpy(v.copy()) for name, v in weights.items()})
    network.eval()
    features = make_window_inputs(windows, description.n_anchors, description.normalisation)
    with torch.no_grad():
        found = network(*map(torch.from_numpy, features))
    scale_m = description.normalisation.scale_m
    return (
        found.gate.numpy().astype(np.float64),
        found.layout_distance.numpy().astype(np.float64) * scale_m,
    )
