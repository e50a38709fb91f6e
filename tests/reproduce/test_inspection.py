"""What is looked at is what the exported network does."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gaia_uwb._shared.errors import ConfigError
from gaia_uwb.denoisers.registry import make_denoiser
from gaia_uwb.reproduce.inspection import gate_and_layout
from tiny_models import NETWORKS, make_run, train_tiny


def test_gate_lies_between_and_distances_are_metres(tmp_path: Path) -> None:
    train_tiny(tmp_path, NETWORKS["gaia"])
    run = make_run(3)
    gate, layout_m = gate_and_layout(tmp_path, [run])
    assert gate.shape == layout_m.shape == (1, *run.range_m.shape)
    assert ((gate > 0) & (gate < 1)).all()
    # Where the result is the blend of both, what is left over is a distance, hence not below 0.
    (denoised,) = make_denoiser(f"gaia:{tmp_path}")([run.without_truth()])
    rest_m = (denoised.range_m - (1 - gate[0]) * layout_m[0])[run.valid]
    assert np.isfinite(rest_m).all()
    assert (layout_m >= 0.5).all()  # the tag is 1 m above every anchor


def test_a_network_without_a_gate_is_refused(tmp_path: Path) -> None:
    train_tiny(tmp_path, NETWORKS["without-geo-dist"])
    with pytest.raises(ConfigError, match="expected a GAIA model with a gate"):
        gate_and_layout(tmp_path, [make_run(3)])
