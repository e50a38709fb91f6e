"""``gaia train``: what it writes, how it goes on, how it refuses."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from gaia_uwb._shared.errors import ConfigError, GaiaError
from gaia_uwb._shared.files import visible
from gaia_uwb.cli import app
from tiny_models import SIZES

pytest.importorskip("torch", reason="PyTorch is not installed: no model can be trained here")

RECIPE = {
    "network": SIZES,
    "training": {"epochs": 2},
    "sets": {"n_training": 12, "n_validation": 4},
}


def run(*arguments: object) -> None:
    app([str(word) for word in arguments], standalone_mode=False)


@pytest.fixture
def recipe(tmp_path: Path) -> Path:
    path = tmp_path / "recipe.yaml"
    path.write_text(json.dumps(RECIPE))
    return path


def test_train_writes_a_model_that_reconstructs(
    tmp_path: Path, recipe: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model = tmp_path / "model"
    run("train", "gaia", "--data", "sim:stress", "--out", model, "--recipe", recipe)
    written = {path.name for path in visible(model)}
    assert written == {
        "model.json",
        "model.onnx",
        "weights.safetensors",
        "MODEL_CARD.md",
        "training-log.jsonl",
        "training-state.safetensors",
        "loss-curves.png",
        "base",
    }
    shown = capsys.readouterr()
    assert f"--denoiser gaia:{model}" in shown.out
    run("evaluate", "sim:stress-test/0/2", "--methods", f"raw,gaia:{model}", "--out", tmp_path)
    rows = json.loads((tmp_path / "results.json").read_text())["rows"]
    assert [row["method"] for row in rows] == ["raw", f"gaia:{model}"]


@pytest.mark.parametrize(
    ("options", "problem"),
    [
        (
            ("--data", "sim:wild"),
            "--data sim:wild: gaia-set can only be trained on the whole of sim:mixed",
        ),
        (
            ("--data", "sim:mixed", "--split", "run/0"),
            "--split: gaia-set can only be trained on the whole of sim:mixed",
        ),
    ],
)
def test_gaia_set_takes_its_own_scenes_only(
    tmp_path: Path, options: tuple[str, ...], problem: str
) -> None:
    with pytest.raises(ConfigError, match=problem):
        run("train", "gaia-set", *options, "--out", tmp_path / "model")
    assert not (tmp_path / "model").exists()


def test_train_goes_on_where_it_was(
    tmp_path: Path, recipe: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ("train", "gaia", "--data", "sim:stress", "--out", tmp_path / "m", "--recipe")
    run(*arguments, recipe)
    capsys.readouterr()
    weights = (tmp_path / "m/weights.safetensors").read_bytes()
    run(*arguments, recipe)
    assert "resuming after 2 epochs" in capsys.readouterr().err
    assert (tmp_path / "m/weights.safetensors").read_bytes() == weights


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        (("--data", "sim:nothing"), "unknown preset"),
        (("--data", "sim:stress", "--split", "window/0"), "own split"),
        (("--data", "no-such-folder"), "neither a folder nor one of"),
        (("--data", "sim:stress", "--base", "nowhere"), "nowhere"),
    ],
)
def test_wrong_training_is_one_line(
    tmp_path: Path, recipe: Path, arguments: tuple[str, ...], problem: str
) -> None:
    with pytest.raises(GaiaError, match=problem) as caught:
        run("train", "gaia", *arguments, "--out", tmp_path / "m", "--recipe", recipe)
    assert "\n" not in str(caught.value)


def test_training_without_torch_says_how_to_get_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import importlib.util

    found = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name: None if name == "torch" else found(name)
    )
    with pytest.raises(ConfigError, match=r"pip install 'gaia-uwb\[train\]'"):
        run("train", "mlp", "--data", "sim:stress", "--out", tmp_path / "m")
