"""Networks as ONNX, with dynamic numbers of episodes, steps and, for ``gaia-set``, anchors."""

from __future__ import annotations

import io
import tempfile
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path

import onnx
import onnxruntime
import torch
from torch import Tensor, nn

from gaia_uwb.models import WindowInputs, ZoneInputs

ZONE_OUTPUTS = {
    "denoised_range": "range", "log_sigma": "log_sigma", "place": "place",
    "information": "information", "scene_logit": "scene_logit", "side_logit": "side_logit",
    "nlos_logit": "nlos_logit",
}  # fmt: skip
"""Names of an exported ``gaia-set``'s outputs, and of the fields of ``ZonePrediction``."""

_OPSET = 17
_AXES = {
    "range": {0: "batch", 1: "anchors", 2: "steps"},
    "position": {0: "batch", 1: "steps"},
    "anchors": {0: "batch", 1: "anchors"},
    "batch": {0: "batch"},
}
_ZONE_INPUT_AXES = ("position", "position", "range", "range", "range", "anchors", "anchors",
                    "batch", "batch", "batch", "batch")  # fmt: skip
_ZONE_OUTPUT_AXES = ("range", "range", "anchors", "anchors", "batch", "anchors", "range")


def export_window(network: nn.Module, n_anchors: int) -> bytes:
    """Return one of the paper's networks for ONNX Runtime; its inputs are ``WindowInputs``.

    Parameters
    ----------
    network
        In evaluation mode, on the CPU.
    n_anchors
        Its channels.

    Returns
    -------
    bytes
        An ONNX file with the outputs ``predicted_distance`` and, where the network has them,
        ``predicted_layout``, ``predicted_layout_distance`` and ``predicted_gate``.
    """
    example = (torch.zeros(1, 3, 2), *(torch.zeros(1, 3, n_anchors) for _ in range(3)))
    with torch.no_grad():
        prediction = network(*example)
    fields = [name for name, value in prediction._asdict().items() if value is not None]
    outputs = [f"predicted_{name}" for name in fields]
    axes = dict.fromkeys((*WindowInputs._fields, *outputs), "position")
    if "layout" in fields:
        axes["predicted_layout"] = "batch"
    wrapped = _OutputsOfAllInputs(network, fields)
    return _export(wrapped, example, WindowInputs._fields, outputs, axes)


def export_zone(network: nn.Module) -> bytes:
    """Return ``gaia-set`` for ONNX Runtime; its inputs are ``ZoneInputs``.

    Parameters
    ----------
    network
        In evaluation mode, on the CPU.
    """
    names = (*ZoneInputs._fields, *ZONE_OUTPUTS)
    axes = dict(zip(names, (*_ZONE_INPUT_AXES, *_ZONE_OUTPUT_AXES), strict=True))
    wrapped = _Outputs(network, list(ZONE_OUTPUTS.values()))
    return _export(wrapped, _zone_example(), ZoneInputs._fields, list(ZONE_OUTPUTS), axes)


def _zone_example() -> tuple[Tensor, ...]:
    """Return inputs of 2 episodes with 3 anchors and 5 steps."""
    batch, anchors, steps = 2, 3, 5
    along = torch.arange(steps, dtype=torch.float32).expand(batch, steps)
    position = torch.stack([along, torch.zeros_like(along)], dim=-1)
    one = torch.ones(batch, anchors, steps)
    return (
        position, torch.ones_like(position), 5 * one, one, one,
        torch.ones(batch, anchors, 2, 2), torch.ones(batch, anchors, 2, 4),
        torch.zeros(batch, 3), torch.ones(batch, 6), torch.ones(batch, 5), torch.zeros(batch),
    )  # fmt: skip


def _export(
    network: nn.Module,
    example: tuple[Tensor, ...],
    inputs: Sequence[str],
    outputs: Sequence[str],
    axes: Mapping[str, str],
) -> bytes:
    file = io.BytesIO()
    with warnings.catch_warnings():
        # The exporter's successor needs one more package; a GRU's batch is 1 here, as it asks.
        warnings.simplefilter("ignore")
        torch.onnx.export(
            network,
            example,
            file,  # type: ignore[arg-type]  # the annotation forgets what the manual offers
            dynamo=False,
            opset_version=_OPSET,
            input_names=list(inputs),
            output_names=list(outputs),
            dynamic_axes={name: _AXES[kind] for name, kind in axes.items()},
        )
    return folded(file.getvalue())


def folded(content: bytes) -> bytes:
    """Return a network with all computed that does not depend on its inputs.

    ONNX Runtime does that whenever a session starts, which takes half of the session's time. Only
    operators of ONNX itself are used, so that every runtime takes the result.

    Parameters
    ----------
    content
        An ONNX file's.
    """
    options = onnxruntime.SessionOptions()
    options.graph_optimization_level = onnxruntime.GraphOptimizationLevel.ORT_ENABLE_BASIC
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder) / "folded.onnx"
        options.optimized_model_filepath = str(place)
        onnxruntime.InferenceSession(content, options, providers=["CPUExecutionProvider"])
        model = onnx.load(place)
    # ONNX Runtime names all sets of operators that it knows; an older one may know fewer.
    used = {node.domain for node in model.graph.node}
    for each in [each for each in model.opset_import if each.domain not in used]:
        model.opset_import.remove(each)
    return bytes(model.SerializeToString(deterministic=True))


class _Outputs(nn.Module):
    """A network whose outputs are a plain tuple of some fields of its prediction."""

    def __init__(self, network: nn.Module, fields: Sequence[str]) -> None:
        super().__init__()
        self.network, self.fields = network, fields

    def forward(self, *inputs: Tensor) -> tuple[Tensor, ...]:
        prediction = self.network(*inputs)
        return tuple(getattr(prediction, name) for name in self.fields)


class _OutputsOfAllInputs(_Outputs):
    """The same; an input that has no effect would vanish from the file, so it adds 0."""

    def forward(self, *inputs: Tensor) -> tuple[Tensor, ...]:
        first, *others = super().forward(*inputs)
        return (first + sum(0.0 * part.sum() for part in inputs), *others)
