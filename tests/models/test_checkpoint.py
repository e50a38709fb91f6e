from __future__ import annotations

import json
import pickle
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("torch", reason="needs PyTorch: install gaia-uwb[train]")

from gaia_uwb._shared.errors import ConfigError
from gaia_uwb.models.checkpoint import (
    DESCRIPTION,
    ONNX,
    WEIGHTS,
    find_model,
    pack,
    read_description,
    read_file,
    read_weights,
    unpack,
)
from tiny_models import NETWORKS, train_tiny


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a tiny gaia; its base is in it."""
    folder = tmp_path_factory.mktemp("trained")
    train_tiny(folder, NETWORKS["gaia"], epochs=1)
    return folder


@pytest.fixture
def model(trained: Path, tmp_path: Path) -> Path:
    """A copy to be harmed."""
    folder = tmp_path / "model"
    shutil.copytree(trained, folder)
    return folder


def read_all(folder: Path) -> None:
    description = read_description(folder)
    read_weights(folder, description)
    read_file(folder, ONNX, description)


def assert_refused(folder: Path, name: str, problem: str = "") -> None:
    with pytest.raises(ConfigError) as caught:
        read_all(folder)
    message = str(caught.value)
    assert message.startswith(f"{folder / name}: ")
    assert problem in message
    assert "\n" not in message


def change(folder: Path, edit: Callable[[dict[str, object]], object]) -> None:
    path = folder / DESCRIPTION
    fields = json.loads(path.read_text(encoding="utf-8"))
    edit(fields)
    path.write_text(json.dumps(fields), encoding="utf-8")


def test_a_model_is_read_as_it_was_written(model: Path) -> None:
    import torch

    from gaia_uwb.learn.networks.make import make_network

    description = read_description(model)
    assert description.network == NETWORKS["gaia"]
    assert (description.n_anchors, description.window_steps) == (3, 8)
    assert set(description.sha256) == {DESCRIPTION, ONNX, WEIGHTS}
    weights = read_weights(model, description)
    network = make_network(3, description.network)
    network.load_state_dict({name: torch.from_numpy(value) for name, value in weights.items()})
    read_all(model)


@pytest.mark.parametrize("name", [DESCRIPTION, ONNX, WEIGHTS])
def test_a_flipped_byte_is_found_wherever_it_is(model: Path, name: str) -> None:
    content = (model / name).read_bytes()
    places = np.random.default_rng(0).choice(len(content), size=25, replace=False)
    for place in (0, len(content) - 2, *places.tolist()):
        flipped = bytearray(content)
        flipped[place] ^= 1
        if name == DESCRIPTION and chr(content[place]).isspace():
            continue  # nothing hangs on white space
        (model / name).write_bytes(bytes(flipped))
        assert_refused(model, name)


@pytest.mark.parametrize("name", [DESCRIPTION, ONNX, WEIGHTS])
@pytest.mark.parametrize("share", [0.0, 0.5, 0.999])
def test_a_truncated_file_is_refused(model: Path, name: str, share: float) -> None:
    content = (model / name).read_bytes()
    (model / name).write_bytes(content[: int(share * (len(content) - 2))])
    assert_refused(model, name)


@pytest.mark.parametrize("name", [DESCRIPTION, ONNX, WEIGHTS])
def test_a_missing_file_is_named(model: Path, name: str) -> None:
    (model / name).unlink()
    assert_refused(model, name, "cannot read this file")


@pytest.mark.parametrize("name", [ONNX, WEIGHTS])
def test_a_file_of_another_model_is_refused(model: Path, name: str) -> None:
    shutil.copy(model / "base" / name, model / name)
    assert_refused(model, name, "not part of this model")


def test_a_description_that_was_edited_is_refused(model: Path) -> None:
    change(model, lambda fields: fields.update(sigma_m=9.0))
    assert_refused(model, DESCRIPTION, "corrupt")


@pytest.mark.parametrize(
    ("edit", "problem"),
    [
        (lambda fields: fields.update(schema=2), "expected a model of schema 1, got 2"),
        (lambda fields: fields.pop("schema"), "expected a model of schema 1, got None"),
        (lambda fields: fields.update(colour="red"), "colour: Extra inputs"),
        (lambda fields: fields["network"].update(kind="cnn"), "network: "),
        (lambda fields: fields["network"].update(width=3), "network.gaia.width: Extra inputs"),
        (lambda fields: fields.pop("normalisation"), "normalisation: Field required"),
        (lambda fields: fields.update(sigma_m=-1.0), "sigma_m: "),
        (lambda fields: fields.update(n_anchors="3"), "n_anchors: "),
        (lambda fields: fields["sha256"].update({"more.bin": "0" * 64}), "corrupt"),
        (lambda fields: fields["sha256"].pop(ONNX), "corrupt"),
    ],
)
def test_a_description_of_something_else_is_refused(
    model: Path, edit: Callable[[dict[str, object]], object], problem: str
) -> None:
    change(model, edit)
    assert_refused(model, DESCRIPTION, problem)


def test_files_without_a_checksum_are_refused(model: Path) -> None:
    change(model, lambda fields: fields.pop("sha256"))
    assert_refused(model, WEIGHTS, "its checksum is wrong")


@pytest.mark.parametrize("content", [b"", b"schema: 1", b"[1]", b"3", b"\xff\xfe", b"[" * 100_000])
def test_a_description_that_is_no_json_is_refused(model: Path, content: bytes) -> None:
    (model / DESCRIPTION).write_bytes(content)
    assert_refused(model, DESCRIPTION, "not a model description")


class Bomb:
    """What a pickle can do to its reader."""

    def __reduce__(self) -> tuple[object, tuple[str]]:
        return Path.touch, (Path("unpickled"),)


def test_a_pickle_is_refused_and_not_opened(
    model: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    content = pickle.dumps(Bomb())
    (model / WEIGHTS).write_bytes(content)
    assert_refused(model, WEIGHTS, "checksum")
    with pytest.raises(ConfigError, match="weights: not a safetensors file"):
        unpack(content, "weights")
    assert not (tmp_path / "unpickled").exists()


def test_arrays_come_back_whatever_their_order_and_shape() -> None:
    arrays = {
        "columns first": np.asfortranarray(np.arange(6.0).reshape(2, 3)),
        "every other": np.arange(10, dtype=np.float32)[::2],
        "scalar": np.array(7.0, dtype=np.float32),
        "empty": np.zeros((0, 4)),
    }
    found = unpack(pack(arrays), "here")
    assert set(found) == set(arrays)
    for name, value in arrays.items():
        assert found[name].dtype == value.dtype
        assert found[name].shape == value.shape
        np.testing.assert_array_equal(found[name], value)


@pytest.mark.parametrize("name", ["nowhere", "", "a" * 5000, "nul\0byte"])
def test_a_model_that_is_not_there_is_refused(name: str) -> None:
    with pytest.raises(ConfigError, match=r"no gaia model .*: neither a folder with model\.json"):
        find_model("gaia", name)


def test_a_folder_names_its_model(model: Path) -> None:
    assert find_model("gaia", str(model)) == model
