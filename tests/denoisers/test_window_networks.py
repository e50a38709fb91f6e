from __future__ import annotations

import json
import shutil
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("torch", reason="needs PyTorch: install gaia-uwb[train]")

import torch

from gaia_uwb._shared.errors import ConfigError, InputError
from gaia_uwb.config import PipelineConfig
from gaia_uwb.denoised import DenoisedRanges
from gaia_uwb.denoisers.registry import make_denoiser
from gaia_uwb.episode import Episode
from gaia_uwb.estimate import ReasonKind
from gaia_uwb.learn.networks.make import make_network
from gaia_uwb.models.checkpoint import (
    DESCRIPTION,
    ONNX,
    WEIGHTS,
    read_description,
    read_weights,
    seal,
)
from gaia_uwb.models.description import GaiaArchitecture
from gaia_uwb.models.plausible_correction import largest_median_correction_m
from gaia_uwb.models.window_inputs import blend, make_window_inputs, window_starts
from gaia_uwb.pipeline import reconstruct_episodes
from tiny_models import NETWORKS, make_run, make_sets, train_tiny

WINDOW = 64


@pytest.fixture(scope="module")
def models(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Folders of tiny models by name in ``NETWORKS``, trained on windows of 64 steps."""
    base = tmp_path_factory.mktemp("base")
    sets = make_sets(4, 2, n_steps=WINDOW)
    train_tiny(base, NETWORKS["pose-mlp"], sets, epochs=1)
    folders = {"pose-mlp": base}
    for name in sorted(set(NETWORKS) - {"pose-mlp"}):
        folders[name] = tmp_path_factory.mktemp(name)
        start = base if isinstance(NETWORKS[name], GaiaArchitecture) else None
        train_tiny(folders[name], NETWORKS[name], sets, base=start, epochs=1)
        allow_corrections_of(None, folders[name])
    return folders


def allow_corrections_of(limit_m: float | None, folder: Path) -> None:
    """Change how far a model may correct a window; ``None`` lets it do what it likes."""
    description = read_description(folder).model_copy(update={"plausible_correction_m": limit_m})
    sealed = seal(description, {name: (folder / name).read_bytes() for name in (ONNX, WEIGHTS)})
    (folder / DESCRIPTION).write_text(sealed.model_dump_json(by_alias=True), encoding="utf-8")


def denoise(folder: Path, episodes: Sequence[Episode]) -> list[DenoisedRanges]:
    kind = read_description(folder).network.kind
    return make_denoiser(f"{kind}:{folder}")(episodes)


def run_network(folder: Path, episodes: Sequence[Episode]) -> np.ndarray:
    """Return what PyTorch makes of whole episodes, in metres."""
    description = read_description(folder)
    network = make_network(description.n_anchors, description.network).eval()
    weights = read_weights(folder, description)
    network.load_state_dict({name: torch.from_numpy(value) for name, value in weights.items()})
    features = make_window_inputs(episodes, description.n_anchors, description.normalisation)
    with torch.no_grad():
        distance = network(*map(torch.from_numpy, features)).distance.numpy()
    return distance.astype(float) * description.normalisation.scale_m


@pytest.mark.parametrize("name", sorted(NETWORKS))
def test_a_window_gives_the_networks_own_output(name: str, models: dict[str, Path]) -> None:
    runs = [make_run(seed, n_steps=WINDOW, missing=0.3) for seed in (90, 91)]
    expected_m = run_network(models[name], runs)
    for found, run, range_m in zip(denoise(models[name], runs), runs, expected_m, strict=True):
        np.testing.assert_allclose(found.range_m[run.valid], range_m[run.valid], atol=1e-4)


def test_a_window_that_is_corrected_too_far_gets_a_running_median(
    models: dict[str, Path], tmp_path: Path
) -> None:
    shutil.copytree(models["gaia"], folder := tmp_path / "gaia")
    runs = [make_run(seed, n_steps=WINDOW, missing=0.3) for seed in range(80, 90)]
    networks_own = denoise(folder, runs)
    moved_m = [
        largest_median_correction_m(found.range_m - run.range_m, run.valid)
        for found, run in zip(networks_own, runs, strict=True)
    ]
    allow_corrections_of(limit_m := float(np.median(moved_m)), folder)
    medians = make_denoiser("median")(runs)
    for found, own, run, median, moved in zip(
        denoise(folder, runs), networks_own, runs, medians, moved_m, strict=True
    ):
        # A range that the median rejects as a spike stays as it was measured.
        plain_m = np.where(median.valid, median.range_m, run.range_m)
        expected_m = plain_m if moved > limit_m else own.range_m
        np.testing.assert_allclose(found.range_m, expected_m, rtol=1e-12)


@pytest.mark.parametrize("n_steps", [1, 2, 5, 63, 64, 65, 200])
def test_a_run_of_any_length_comes_out_whole(n_steps: int, models: dict[str, Path]) -> None:
    run = make_run(7, n_steps=n_steps, missing=0.3)
    (found,) = denoise(models["gaia"], [run])
    np.testing.assert_array_equal(found.valid, run.valid)
    sigma_m = read_description(models["gaia"]).sigma_m
    assert (found.sigma_m[run.valid] == sigma_m).all()
    starts, size = window_starts(n_steps, WINDOW), min(n_steps, WINDOW)
    windows_m = run_network(models["gaia"], [run.window(s, s + size) for s in starts])
    expected_m = blend(windows_m, starts, n_steps)
    np.testing.assert_allclose(found.range_m[run.valid], expected_m[run.valid], atol=1e-4)


@pytest.mark.parametrize("name", ["mlp", "pose-mlp", "gaia", "causal-look-ahead"])
def test_episodes_together_give_what_each_alone_gives(name: str, models: dict[str, Path]) -> None:
    runs = [
        make_run(1, n_steps=200), make_run(2, n_steps=5), make_run(3, n_anchors=1, n_steps=70),
        make_run(4, n_steps=64, missing=1.1), make_run(5, n_anchors=2, n_steps=64),
    ]  # fmt: skip
    together = denoise(models[name], runs)
    assert denoise(models[name], []) == []
    for found, run in zip(together, runs, strict=True):
        (alone,) = denoise(models[name], [run])
        np.testing.assert_array_equal(found.valid, run.valid)
        np.testing.assert_allclose(found.range_m, alone.range_m, atol=1e-4)


def test_many_windows_go_through_in_chunks(
    models: dict[str, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    runs = [make_run(seed, n_steps=100) for seed in range(4)]
    whole = denoise(models["gaia"], runs)
    monkeypatch.setattr("gaia_uwb.denoisers.window_networks._CHUNK", 3)
    for cut, expected in zip(denoise(models["gaia"], runs), whole, strict=True):
        np.testing.assert_allclose(cut.range_m, expected.range_m, atol=1e-4)


def test_truth_takes_no_part(models: dict[str, Path]) -> None:
    run = make_run(11, n_steps=80)
    (with_truth,), (without,) = (
        denoise(models["gaia"], [episode]) for episode in (run, run.without_truth())
    )
    np.testing.assert_array_equal(with_truth.range_m, without.range_m)


def test_more_anchors_than_channels_are_refused(models: dict[str, Path]) -> None:
    with pytest.raises(InputError, match=r"run-3.*: the model has channels for 3 cones"):
        denoise(models["gaia"], [make_run(3, n_anchors=4, n_steps=WINDOW)])


def test_a_path_outside_the_training_data_is_unreliable(models: dict[str, Path]) -> None:
    run = make_run(3, n_steps=WINDOW)
    elsewhere = replace(run, position_m=run.position_m + np.array([500.0, 0.0]))
    name = f"gaia:{models['gaia']}"
    denoiser = make_denoiser(name)
    assert denoiser.notes(run) == ()
    (note,) = denoiser.notes(elsewhere)
    assert note.kind is ReasonKind.OUTSIDE_TRAINING
    assert str(note).startswith("gaia:")
    assert "100 % of the path lies outside" in str(note)
    fewer = make_run(3, n_steps=WINDOW, n_anchors=2)
    (note_of_fewer,) = denoiser.notes(fewer)
    assert "trained on 3 cones, this log has 2" in str(note_of_fewer)
    found = reconstruct_episodes([run, elsewhere], PipelineConfig(denoiser=name))
    assert note not in found[0].reasons
    assert note in found[1].reasons
    assert found[1].status.value == "unreliable"


def test_a_model_is_named_in_two_ways(models: dict[str, Path], tmp_path: Path) -> None:
    folder = str(models["gaia"])
    run = make_run(0)
    named = make_denoiser(f"gaia:{folder}")
    optional = make_denoiser("gaia", {"model": folder})
    assert named.options == optional.options
    np.testing.assert_array_equal(named([run])[0].range_m, optional([run])[0].range_m)
    odd = tmp_path / "a:b"
    shutil.copytree(folder, odd)
    assert make_denoiser(f"gaia:{odd}").options.model == str(odd)


@pytest.mark.parametrize(
    ("name", "problem"),
    [
        ("gaia:", "model: "),
        ("gaia:nowhere", "no gaia model 'nowhere'"),
        ("raw:stress", "model: Extra inputs"),
        ("nonsense:stress", "no denoiser is called 'nonsense'"),
    ],
)
def test_a_wrong_name_is_refused_in_one_line(name: str, problem: str) -> None:
    with pytest.raises(ConfigError, match=problem) as caught:
        make_denoiser(name)
    assert "\n" not in str(caught.value)


def test_a_model_of_another_kind_is_refused(models: dict[str, Path]) -> None:
    with pytest.raises(ConfigError, match="expected a model of kind gaia, got mlp"):
        make_denoiser("gaia", {"model": str(models["mlp"])})


@pytest.mark.parametrize("harm", ["missing", "damaged", "not onnx", "other channels"])
def test_a_network_that_cannot_run_is_refused(
    harm: str, models: dict[str, Path], tmp_path: Path
) -> None:
    folder = tmp_path / "model"
    shutil.copytree(models["gaia"], folder)
    make_denoiser(f"gaia:{folder}")  # what was in order before is not remembered
    path, description = folder / ONNX, read_description(folder)
    content = path.read_bytes()
    if harm == "missing":
        path.unlink()
    elif harm == "damaged":
        path.write_bytes(content[:-1] + bytes([content[-1] ^ 1]))
    else:
        if harm == "not onnx":
            path.write_bytes(content := b"no network")
        else:
            description = description.model_copy(update={"n_anchors": 4})
        sealed = seal(description, {ONNX: content, WEIGHTS: (folder / WEIGHTS).read_bytes()})
        (folder / DESCRIPTION).write_text(sealed.model_dump_json(by_alias=True), encoding="utf-8")
    with pytest.raises(ConfigError) as caught:
        make_denoiser(f"gaia:{folder}")
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


def test_a_model_that_was_trained_anew_is_read_anew(tmp_path: Path) -> None:
    run = make_run(0)
    found = []
    for seed in (0, 1):
        (tmp_path / "training-state.safetensors").unlink(missing_ok=True)
        train_tiny(tmp_path, NETWORKS["mlp"], seed=seed, epochs=1)
        found.append(denoise(tmp_path, [run])[0].range_m[run.valid])
    assert not np.allclose(found[0], found[1])


def test_a_reconstruction_imports_no_pytorch(models: dict[str, Path], tmp_path: Path) -> None:
    run = make_run(0, n_steps=WINDOW)
    np.savez(
        tmp_path / "run.npz", t_s=run.t_s, position_m=run.position_m, range_m=run.range_m,
        valid=run.valid,
    )  # fmt: skip
    code = f"""
import json, sys, numpy as np
from gaia_uwb.config import PipelineConfig
from gaia_uwb.episode import Episode
from gaia_uwb.pipeline import reconstruct_episodes
run = Episode(name="run", anchor_ids=("a", "b", "c"), **np.load({str(tmp_path / "run.npz")!r}))
(found,) = reconstruct_episodes([run], PipelineConfig(denoiser={f"gaia:{models['gaia']}"!r}))
heavy = set(sys.modules) & {{"torch", "onnx", "safetensors", "gaia_uwb.learn.networks"}}
print(json.dumps([sorted(heavy), len(found.anchors)]))
"""
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=tmp_path
    )
    assert json.loads(done.stdout) == [[], 3]
