"""The models inside the package: whole, small, described, and the same in ONNX and PyTorch."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gaia_uwb.checkpoint import CARD, read_description, read_weights, shipped_models
from gaia_uwb.denoisers import make_denoiser
from gaia_uwb.features import make_features
from gaia_uwb.model_card import model_card
from gaia_uwb.simulate import find_preset, simulate_episodes

MODELS = shipped_models()


def test_what_the_documentation_promises_is_there() -> None:
    expected = {"gaia-stress", "gaia-outdoor-uwb", "pose-mlp-stress", "pose-mlp-outdoor-uwb"}
    assert expected <= set(MODELS)


@pytest.mark.parametrize("folder", MODELS.values(), ids=MODELS)
def test_a_model_is_small_and_its_card_is_that_of_its_description(folder: Path) -> None:
    assert sum(path.stat().st_size for path in folder.iterdir()) < 2e6
    assert (folder / CARD).read_text(encoding="utf-8") == model_card(read_description(folder))


@pytest.mark.parametrize("folder", MODELS.values(), ids=MODELS)
def test_onnx_is_the_network_of_the_weights(folder: Path) -> None:
    torch = pytest.importorskip("torch", reason="PyTorch is not installed")
    from gaia_uwb.networks import make_network

    description = read_description(folder)
    n = description.n_anchors
    config = find_preset("stress").model_copy(update={"vary": {"closure.n_anchors": [n, n]}})
    episodes = list(simulate_episodes(config, 3, seed=1))
    network = make_network(n, description.network).eval()
    weights = read_weights(folder, description)
    network.load_state_dict({name: torch.from_numpy(value) for name, value in weights.items()})
    features = make_features(episodes, n, description.normalisation)
    with torch.no_grad():
        expected = network(*map(torch.from_numpy, features)).distance.numpy()
    kind = description.network.kind
    found = make_denoiser(f"{kind}:{folder}")(episodes)
    for ranges, values in zip(found, expected, strict=True):
        np.testing.assert_allclose(
            ranges.range_m / description.normalisation.scale_m, values, atol=1e-5
        )


def test_gaia_beats_what_it_is_built_on_and_what_it_gets() -> None:
    episodes = list(simulate_episodes(find_preset("stress-test"), 24, seed=5))

    def error_m2(name: str) -> float:
        errors = []
        for episode, ranges in zip(episodes, make_denoiser(name)(episodes), strict=True):
            assert episode.truth is not None
            errors.append(np.nanmean((ranges.range_m - episode.truth.range_m) ** 2))
        return float(np.mean(errors))

    gaia, base, raw = (error_m2(name) for name in ("gaia:stress", "pose-mlp:stress", "raw"))
    assert gaia < 0.5 * base < 0.25 * raw
