from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

pytest.importorskip("torch", reason="needs PyTorch: install gaia-uwb[train]")

import numpy as np
import onnx
import onnxruntime
import torch

from gaia_uwb.learn.networks.export import export_window
from gaia_uwb.models.window_inputs import WindowInputs
from tiny_models import NETWORKS


@pytest.mark.parametrize("name", sorted(NETWORKS))
def test_onnx_gives_what_pytorch_gives(
    name: str, build: Callable[..., Any], draw: Callable[..., Any]
) -> None:
    network = build(name)
    session = onnxruntime.InferenceSession(
        export_window(network, 3), providers=["CPUExecutionProvider"]
    )
    assert tuple(part.name for part in session.get_inputs()) == WindowInputs._fields
    for n_batch, n_steps in ((1, 1), (1, 8), (3, 5), (5, 64)):
        inputs = draw(seed=n_steps, n_batch=n_batch, n_steps=n_steps)
        with torch.no_grad():
            expected = network(*inputs)._asdict()
        names = [part.name for part in session.get_outputs()]
        assert names == [f"predicted_{k}" for k, v in expected.items() if v is not None]
        found = session.run(
            names, dict(zip(WindowInputs._fields, (p.numpy() for p in inputs), strict=True))
        )
        for label, value in zip(names, found, strict=True):
            np.testing.assert_allclose(
                value, expected[label.removeprefix("predicted_")].numpy(), rtol=0, atol=1e-5
            )


def test_the_same_network_gives_the_same_file(build: Callable[..., Any]) -> None:
    assert export_window(build("gaia"), 3) == export_window(build("gaia"), 3)


def test_it_is_plain_onnx_in_which_all_constants_are_computed(build: Callable[..., Any]) -> None:
    model = onnx.load_from_string(export_window(build("gaia"), 3))
    assert [each.domain for each in model.opset_import] == [""]
    assert {node.domain for node in model.graph.node} == {""}
    assert "Constant" not in {node.op_type for node in model.graph.node}
