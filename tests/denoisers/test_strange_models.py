"""Models that load but do not run, or reach outside their folder: one line each, and no wait."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

onnx = pytest.importorskip("onnx", reason="needs onnx: install gaia-uwb[train]")
from onnx import TensorProto, helper  # noqa: E402

from gaia_uwb._shared.errors import ConfigError, GaiaError  # noqa: E402
from gaia_uwb.denoisers import _onnx, make_denoiser  # noqa: E402
from gaia_uwb.models import (  # noqa: E402
    DESCRIPTION,
    ONNX,
    WEIGHTS,
    WindowInputs,
    find_model,
    read_description,
    seal,
)
from gaia_uwb.models.description import WindowModel  # noqa: E402
from tiny_models import make_run  # noqa: E402

N = 12  # channels of the model that is copied
FLOAT = TensorProto.FLOAT


def graph(
    nodes: list[Any],
    *,
    output: str = "predicted_distance",
    shape: tuple[Any, ...] | None = ("B", "T", N),
    kind: int = FLOAT,
    inputs: int = FLOAT,
    weights: tuple[Any, ...] = (),
) -> bytes:
    """Return a network with our inputs, the third of which has the shape of the output."""
    sizes = dict(zip(WindowInputs._fields, (2, N, N, N), strict=True))
    takes = [
        helper.make_tensor_value_info(name, inputs, ["B", "T", size])
        for name, size in sizes.items()
    ]
    gives = [helper.make_tensor_value_info(output, kind, shape)]
    made = helper.make_graph(nodes, "strange", takes, gives, list(weights))
    model = helper.make_model(made, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
    return bytes(model.SerializeToString())


RANGE = WindowInputs._fields[1]


def node(kind: str, inputs: list[str], output: str = "predicted_distance", **more: Any) -> Any:
    return helper.make_node(kind, inputs, [output], **more)


def endless() -> bytes:
    """Return a network that counts for ever."""
    value, flag = helper.make_tensor_value_info, TensorProto.BOOL
    body = helper.make_graph(
        [node("Identity", ["go"], "goes"), node("Identity", ["x"], "y")],
        "body",
        [value("i", TensorProto.INT64, []), value("go", flag, []), value("x", FLOAT, None)],
        [value("goes", flag, []), value("y", FLOAT, None)],
    )
    always = helper.make_tensor("always", flag, [], [True])
    return graph([node("Loop", ["", "always", RANGE], body=body)], weights=(always,))


def with_weights_in_another_file() -> bytes:
    weights = helper.make_tensor("w", FLOAT, [N], np.zeros(N, np.float32))
    weights.ClearField("float_data")
    weights.data_location = TensorProto.EXTERNAL
    entry = weights.external_data.add()
    entry.key, entry.value = "location", "w.bin"
    return graph([node("Mul", [RANGE, "w"])], weights=(weights,))


def strings() -> bytes:
    word = helper.make_tensor("word", TensorProto.STRING, [1], [b"far"])
    kept = node("Identity", ["word"])
    return graph([kept], kind=TensorProto.STRING, shape=(1,), weights=(word,))


def huge() -> bytes:
    size = helper.make_tensor("size", TensorProto.INT64, [3], [2**20, 2**20, 2**20])
    return graph([node("ConstantOfShape", ["size"])], shape=None, weights=(size,))


STRANGE: dict[str, tuple[Callable[[], bytes], str]] = {
    "another name": (
        lambda: graph([node("Identity", [RANGE], "other")], output="other"),
        "predicted_distance",
    ),
    "another rank": (
        lambda: graph([node("ReduceMax", [RANGE], keepdims=0)], shape=()),
        "expected the shape",
    ),
    "another size": (
        lambda: graph([node("Concat", [RANGE, RANGE], axis=1)], shape=("B", "T2", N)),
        "expected the shape",
    ),
    "double inputs": (
        lambda: graph(
            [node("Identity", [RANGE])], kind=TensorProto.DOUBLE, inputs=TensorProto.DOUBLE
        ),
        "double",
    ),
    "no numbers": (strings, "expected numbers"),
    "more than there is memory": (huge, ""),
    "weights in another file": (with_weights_in_another_file, ""),
}


def put_in(folder: Path, content: bytes) -> str:
    """Write a model whose checksums are right; return the denoiser's name."""
    shutil.copytree(find_model("pose-mlp", "stress"), folder)
    description = read_description(folder)
    assert isinstance(description, WindowModel)
    weights = (folder / WEIGHTS).read_bytes()
    sealed = seal(description, {WEIGHTS: weights, ONNX: content})
    (folder / ONNX).write_bytes(content)
    (folder / DESCRIPTION).write_text(sealed.model_dump_json(by_alias=True), encoding="utf-8")
    return f"pose-mlp:{folder}"


@pytest.mark.parametrize("name", STRANGE)
def test_a_model_that_does_not_run_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], name: str
) -> None:
    make, says = STRANGE[name]
    monkeypatch.chdir(tmp_path)
    np.zeros(N, np.float32).tofile(tmp_path / "w.bin")
    with pytest.raises(ConfigError) as caught:
        make_denoiser(put_in(tmp_path / "model", make()))([make_run(0)])
    message = str(caught.value)
    assert message.startswith(f"{tmp_path / 'model' / ONNX}: cannot run this model: ")
    assert says in message
    assert message.isprintable()
    assert capfd.readouterr() == ("", "")


def test_a_loop_without_end_is_ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_onnx, "_LONGEST_RUN_S", 0.05)
    with pytest.raises(ConfigError, match=r"cannot run this model: no result within 0\.05 s"):
        make_denoiser(put_in(tmp_path / "model", endless()))([make_run(0)])


def test_what_is_no_regular_file_is_not_waited_for(tmp_path: Path) -> None:
    for name in (ONNX, DESCRIPTION):
        folder = tmp_path / name
        denoiser = put_in(folder, graph([node("Identity", [RANGE])]))
        (folder / name).unlink()
        (folder / name).symlink_to("/dev/zero")
        with pytest.raises(GaiaError, match="model"):
            make_denoiser(denoiser)
        (folder / name).unlink()
        os.mkfifo(folder / name)
        with pytest.raises(GaiaError, match="model"):
            make_denoiser(denoiser)


@pytest.mark.parametrize("number", [1e13, 3e38, np.nan])
def test_numbers_that_nothing_can_be_computed_with(tmp_path: Path, number: float) -> None:
    most = helper.make_tensor("most", FLOAT, [1], [number])
    content = graph([node("Mul", [RANGE, "most"])], weights=(most,))
    with pytest.raises(ConfigError, match=r"expected numbers below 1e\+12"):
        make_denoiser(put_in(tmp_path / "model", content))([make_run(0)])


def test_lengths_are_scaled_by_what_can_be_a_length(tmp_path: Path) -> None:
    name = put_in(tmp_path / "model", graph([node("Identity", [RANGE])]))
    path = tmp_path / "model" / DESCRIPTION
    fields = json.loads(path.read_text(encoding="utf-8"))
    fields["normalisation"]["scale_m"] = 1e300
    path.write_text(json.dumps(fields), encoding="utf-8")
    with pytest.raises(ConfigError, match=r"normalisation\.scale_m"):
        make_denoiser(name)
