"""The models inside the package: whole, small, described, and the same in ONNX and PyTorch."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gaia_uwb.config import PipelineConfig
from gaia_uwb.denoisers.registry import make_denoiser
from gaia_uwb.evaluate import scores as evaluate
from gaia_uwb.evaluate.metrics import aggregate
from gaia_uwb.models.card import model_card
from gaia_uwb.models.checkpoint import (
    CARD,
    read_description,
    read_weights,
    shipped_models,
)
from gaia_uwb.models.window_inputs import make_window_inputs
from gaia_uwb.models.zone_inputs import make_zone_inputs, zone_readings
from gaia_uwb.simulate import find_preset, simulate_episodes

ZONE_MODELS = {
    name: path for name, path in shipped_models().items() if name.startswith("gaia-set-")
}
WINDOW_MODELS = {name: path for name, path in shipped_models().items() if name not in ZONE_MODELS}
"""The paper's networks."""


def test_what_the_documentation_promises_is_there() -> None:
    expected = {"gaia-stress", "gaia-outdoor-uwb", "pose-mlp-stress", "pose-mlp-outdoor-uwb"}
    assert expected <= set(WINDOW_MODELS)
    assert "gaia-set-mixed" in ZONE_MODELS


@pytest.mark.parametrize("folder", WINDOW_MODELS.values(), ids=WINDOW_MODELS)
def test_a_model_is_small_and_its_card_is_that_of_its_description(folder: Path) -> None:
    assert sum(path.stat().st_size for path in folder.iterdir()) < 2e6
    assert (folder / CARD).read_text(encoding="utf-8") == model_card(read_description(folder))


@pytest.mark.parametrize("folder", WINDOW_MODELS.values(), ids=WINDOW_MODELS)
def test_onnx_is_the_network_of_the_weights(folder: Path) -> None:
    torch = pytest.importorskip("torch", reason="PyTorch is not installed")
    from gaia_uwb.learn.networks.make import make_network

    description = read_description(folder)
    n = description.n_anchors
    config = find_preset("stress").model_copy(update={"vary": {"closure.n_anchors": [n, n]}})
    episodes = list(simulate_episodes(config, 3, seed=1))
    network = make_network(n, description.network).eval()
    weights = read_weights(folder, description)
    network.load_state_dict({name: torch.from_numpy(value) for name, value in weights.items()})
    features = make_window_inputs(episodes, n, description.normalisation)
    with torch.no_grad():
        expected = network(*map(torch.from_numpy, features)).distance.numpy()
    kind = description.network.kind
    denoiser = make_denoiser(f"{kind}:{folder}")
    # The network's own ranges, also where it takes these layouts for others.
    denoiser.description = description.model_copy(update={"plausible_correction_m": None})  # type: ignore[attr-defined]
    found = denoiser(episodes)
    for ranges, values in zip(found, expected, strict=True):
        np.testing.assert_allclose(
            ranges.range_m / description.normalisation.scale_m, values, atol=1e-5
        )


@pytest.mark.parametrize("folder", ZONE_MODELS.values(), ids=ZONE_MODELS)
def test_a_zone_model_is_whole_and_small(folder: Path) -> None:
    sizes = {path.name: path.stat().st_size for path in folder.iterdir()}
    assert max(sizes.values()) < 2e6
    description = read_description(folder)
    assert (folder / CARD).read_text(encoding="utf-8") == model_card(description)


@pytest.mark.parametrize("folder", ZONE_MODELS.values(), ids=ZONE_MODELS)
def test_the_zone_models_onnx_is_the_network_of_its_weights(folder: Path) -> None:
    torch = pytest.importorskip("torch", reason="PyTorch is not installed")
    from gaia_uwb.learn.networks.gaia_set import GaiaSet

    description = read_description(folder)
    network = GaiaSet(description.network).eval()
    weights = read_weights(folder, description)
    network.load_state_dict({name: torch.from_numpy(value) for name, value in weights.items()})
    denoiser = make_denoiser(f"gaia-set:{folder}")
    for episode in simulate_episodes(find_preset("wild-test"), 5, seed=1):
        inputs, frame = make_zone_inputs(zone_readings([episode]))
        with torch.no_grad():
            expected = network(*map(torch.from_numpy, inputs))
        (found,) = denoiser([episode])
        range_m = np.where(episode.valid, expected.range[0].numpy().T, np.nan)
        # Single precision, of ranges of up to 300 m.
        np.testing.assert_allclose(found.range_m, np.maximum(range_m, 0), rtol=1e-5, atol=1e-3)
        assert found.zone is not None
        place = expected.place.reshape(1, -1, 2).double().numpy()
        np.testing.assert_allclose(
            found.zone.place_m.reshape(1, -1, 2), frame.leave(place), rtol=1e-5, atol=1e-2
        )


def test_gaia_set_knows_zones_that_it_has_never_seen() -> None:
    episodes = tuple(simulate_episodes(find_preset("wild-test"), 40, seed=11))
    test = evaluate.TestSet(episodes, tuple(episode.name for episode in episodes), 0)

    def scores(name: str) -> dict[str, float]:
        found = aggregate(
            evaluate.score_method(test, name, PipelineConfig()).per_episode, test.groups
        )
        return {key: value.value for key, value in found.items()}

    ours, plain = scores("gaia-set"), scores("pose-kalman")
    assert ours["distance_mse_overall"] < 0.4 * plain["distance_mse_overall"]
    assert ours["polygon_iou"] > plain["polygon_iou"] + 0.1
    assert ours["anchor_mae"] < 0.7 * plain["anchor_mae"]


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
