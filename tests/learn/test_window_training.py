from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("torch", reason="needs PyTorch: install gaia-uwb[train]")

import torch

from gaia_uwb._shared.errors import ConfigError, InputError
from gaia_uwb.learn.networks.make import make_network
from gaia_uwb.learn.training_folder import CURVES, LOG, STATE
from gaia_uwb.learn.window_sets import WindowSets
from gaia_uwb.learn.window_training import BASE
from gaia_uwb.models.checkpoint import WEIGHTS, read_description, read_weights
from gaia_uwb.models.description import GaiaArchitecture, MlpArchitecture
from gaia_uwb.models.training_options import WindowTrainingOptions
from gaia_uwb.models.window_inputs import make_window_inputs
from tiny_models import NETWORKS, SIZES, make_run, make_sets, stop_after, train_tiny

GAIA = NETWORKS["gaia"]


@pytest.fixture(scope="module")
def base(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a trained PoseMLP, so that not every test trains one."""
    folder = tmp_path_factory.mktemp("base")
    train_tiny(folder, NETWORKS["pose-mlp"])
    return folder


def read_log(folder: Path) -> list[dict[str, dict[str, float]]]:
    lines = (folder / LOG).read_text(encoding="utf-8").splitlines()
    return [json.loads(line) for line in lines]


def weights_of(folder: Path) -> dict[str, np.ndarray]:
    return read_weights(folder, read_description(folder))


def test_it_learns(tmp_path: Path, base: Path) -> None:
    found = train_tiny(tmp_path, GAIA, base=base, epochs=15, learning_rate=0.02)
    totals = [line["training"]["total"] for line in read_log(tmp_path)]
    assert totals[-1] < 0.4 * totals[0]
    metrics = found.metrics
    assert found.sigma_m == pytest.approx(
        metrics["validation_distance_mse_overall"] ** 0.5, rel=1e-4
    )


def test_a_folder_of_another_training_is_refused(tmp_path: Path, base: Path) -> None:
    train_tiny(tmp_path / "model", GAIA, base=base)
    other = tmp_path / "other-base"
    train_tiny(other, NETWORKS["pose-mlp"], seed=1)
    changes = [
        {"network": GaiaArchitecture(**(SIZES | {"gru_hidden": 7}))},
        {"network": NETWORKS["unfrozen-base"]},
        {"learning_rate": 1e-4},
        {"seed": 1},
        {"epochs": 3},
        {"base": other},
        {"sets": WindowSets(make_sets().training, make_sets(9).validation, (), (), {})},
    ]
    for change in changes:
        with pytest.raises(ConfigError, match="belongs to another training") as caught:
            train_tiny(tmp_path / "model", **({"network": GAIA, "base": base} | change))
        assert str(tmp_path / "model" / STATE) in str(caught.value)
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize("content", [b"", b"\x80\x04pickle", None])
def test_a_damaged_state_is_refused(tmp_path: Path, base: Path, content: bytes | None) -> None:
    (tmp_path / STATE).write_bytes((base / WEIGHTS).read_bytes() if content is None else content)
    with pytest.raises(ConfigError, match="training-state") as caught:
        train_tiny(tmp_path, NETWORKS["mlp"])
    assert "\n" not in str(caught.value)


def test_it_stops_when_nothing_improves(tmp_path: Path) -> None:
    settings = {"epochs": 50, "patience": 2, "learning_rate": 1e-12, "weight_decay": 0.0}
    found = train_tiny(tmp_path, MlpArchitecture(hidden=8), **settings)
    log = read_log(tmp_path)
    totals = [line["validation"]["total"] for line in log]
    best = int(np.argmin(totals))
    assert len(log) == best + 3 < 50
    assert (found.metrics["best_epoch"], found.metrics["epochs"]) == (best, len(log))
    # Stopped is stopped, also for whoever asks again.
    train_tiny(tmp_path, MlpArchitecture(hidden=8), progress=stop_after(0), **settings)


def test_the_best_weights_are_kept_not_the_last(tmp_path: Path) -> None:
    found = train_tiny(tmp_path, MlpArchitecture(hidden=8), epochs=8, learning_rate=0.3)
    totals = [line["validation"]["total"] for line in read_log(tmp_path)]
    assert found.metrics["best_epoch"] == np.argmin(totals)
    assert found.metrics["validation_total"] == pytest.approx(min(totals), abs=1e-6)
    network = make_network(3, found.network)
    network.load_state_dict({k: torch.from_numpy(v) for k, v in weights_of(tmp_path).items()})
    runs = make_sets().validation
    features = make_window_inputs(runs, 3, found.normalisation)
    with torch.no_grad():
        distance = network(*map(torch.from_numpy, features)).distance.numpy()
    square_m2 = [
        np.mean(np.square(d * found.normalisation.scale_m - run.truth.range_m)[run.valid])
        for d, run in zip(distance, runs, strict=True)
        if run.truth is not None
    ]
    assert found.sigma_m == pytest.approx(np.mean(square_m2) ** 0.5, rel=1e-5)


def test_the_base_is_trained_first_and_then_left_alone(tmp_path: Path) -> None:
    train_tiny(tmp_path, GAIA, epochs=1)
    expected = read_description(tmp_path / BASE)
    assert expected.network == NETWORKS["pose-mlp"]
    assert (expected.training.epochs, expected.training.anchor_weight) == (2, 0.0)
    assert "anchor" not in read_log(tmp_path / BASE)[0]["training"]
    base, whole = weights_of(tmp_path / BASE), weights_of(tmp_path)
    assert {name for name in whole if name.startswith("base.")} == {f"base.{n}" for n in base}
    for name, value in base.items():
        np.testing.assert_array_equal(whole[f"base.{name}"], value)


def test_an_unfrozen_base_goes_on_from_the_given_one(tmp_path: Path, base: Path) -> None:
    train_tiny(tmp_path, NETWORKS["unfrozen-base"], base=base, epochs=1, learning_rate=1e-5)
    whole = weights_of(tmp_path)
    for name, value in weights_of(base).items():
        assert not np.array_equal(whole[f"base.{name}"], value)
        np.testing.assert_allclose(whole[f"base.{name}"], value, atol=1e-4)


def test_a_base_that_does_not_fit_is_refused(tmp_path: Path, base: Path) -> None:
    wider = GaiaArchitecture(**(SIZES | {"base_hidden": 9}))
    four = make_sets(n_anchors=4)
    elsewhere = WindowSets(make_sets(9).training, make_sets().validation, (), (), {})
    mlp = tmp_path / "mlp"
    train_tiny(mlp, NETWORKS["mlp"], epochs=1)
    for problem, network, sets, where in (
        ("as the base, got PoseMlpArchitecture", wider, make_sets(), base),
        ("as the base, got MlpArchitecture", GAIA, make_sets(), mlp),
        ("for 4 anchors, got 3", GAIA, four, base),
        ("a different normalisation", GAIA, elsewhere, base),
        ("cannot read this file", GAIA, make_sets(), tmp_path / "nowhere"),
    ):
        with pytest.raises(ConfigError, match=problem) as caught:
            train_tiny(tmp_path / "gaia", network, sets, base=where)
        assert str(where) in str(caught.value)
        assert "\n" not in str(caught.value)


def test_the_log_has_every_term_of_every_epoch(tmp_path: Path, base: Path) -> None:
    train_tiny(tmp_path, GAIA, base=base, epochs=3)
    log = read_log(tmp_path)
    terms = {"mask", "layout", "consistency", "anchor", "total"}
    assert [line["epoch"] for line in log] == [0, 1, 2]
    rate = WindowTrainingOptions().learning_rate
    rates = [line["learning_rate"] for line in log]
    assert rates == pytest.approx([rate, 0.75 * rate, 0.25 * rate])
    for line in log:
        assert set(line["training"]) == terms
        assert set(line["validation"]) == terms | {"distance_mse_overall"}


def test_the_loss_curves_are_drawn(tmp_path: Path) -> None:
    train_tiny(tmp_path, NETWORKS["mlp"], curves=True)
    assert (tmp_path / CURVES).read_bytes().startswith(b"\x89PNG")


def test_the_seed_alone_decides(tmp_path: Path) -> None:
    for name, seed in (("first", 1), ("again", 1), ("other", 2)):
        torch.rand(3)  # whatever happened before
        train_tiny(tmp_path / name, NETWORKS["mlp"], seed=seed, position_noise_m=0.1)
    first, again, other = (
        (tmp_path / n / WEIGHTS).read_bytes() for n in ("first", "again", "other")
    )
    assert first == again != other
    state = torch.random.get_rng_state()
    train_tiny(tmp_path / "more", NETWORKS["mlp"])
    assert torch.equal(torch.random.get_rng_state(), state)


def test_a_loss_beyond_all_numbers_ends_in_one_line(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="lower the learning rate") as caught:
        train_tiny(
            tmp_path, MlpArchitecture(hidden=8), _far_off(), huber_delta_m=1e30, anchor_weight=0.0
        )
    assert "\n" not in str(caught.value)


def _far_off() -> WindowSets:
    """Return one run whose true ranges overflow float32 when they are squared."""
    run = make_run(0)
    assert run.truth is not None
    absurd = replace(run, truth=replace(run.truth, range_m=run.truth.range_m + 1e30))
    return WindowSets((absurd,), (absurd,), (), (), {})


def test_sets_that_cannot_be_learned_from_are_refused(tmp_path: Path) -> None:
    sets = make_sets()
    nothing = WindowSets(sets.training, (), (), (), {})
    with pytest.raises(InputError, match="training and validation episodes, got none"):
        train_tiny(tmp_path, NETWORKS["mlp"], nothing)
    blind = WindowSets(tuple(e.without_truth() for e in sets.training), sets.validation, (), (), {})
    with pytest.raises(InputError, match="run-0: expected true ranges"):
        train_tiny(tmp_path, NETWORKS["mlp"], blind)
