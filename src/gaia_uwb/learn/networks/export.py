"""A network as ONNX, with dynamic batch and length."""

from __future__ import annotations

import io
import warnings

import torch
from torch import nn

INPUTS = ("position", "distance", "mask", "height_gap")
"""Names of the exported network's inputs, like :class:`gaia_uwb.models.Features`."""

_OPSET = 17


def export_onnx(network: nn.Module, n_anchors: int) -> bytes:
    """Return a network for ONNX Runtime; what it has not is left out of the outputs.

    Parameters
    ----------
    network
        In evaluation mode, on the CPU.
    n_anchors
        Its channels.

    Returns
    -------
    bytes
        An ONNX file with the outputs ``distance`` and, where the network has them, ``layout``,
        ``layout_distance`` and ``gate``.
    """
    example = (torch.zeros(1, 3, 2), *(torch.zeros(1, 3, n_anchors) for _ in range(3)))
    with torch.no_grad():
        prediction = network(*example)
    outputs = [name for name, value in prediction._asdict().items() if value is not None]
    wrapped = _Outputs(network, outputs)
    names = [*INPUTS, *(f"predicted_{name}" for name in outputs)]
    axes = {name: {0: "batch", 1: "steps"} for name in names}
    axes["predicted_layout"] = {0: "batch"}
    file = io.BytesIO()
    with warnings.catch_warnings():
        # The exporter's successor needs one more package; a GRU's batch is 1 here, as it asks.
        warnings.simplefilter("ignore")
        torch.onnx.export(
            wrapped,
            example,
            file,  # type: ignore[arg-type]  # the annotation forgets what the manual offers
            dynamo=False,
            opset_version=_OPSET,
            input_names=list(INPUTS),
            output_names=names[len(INPUTS) :],
            dynamic_axes={name: axes[name] for name in names},
        )
    return file.getvalue()


class _Outputs(nn.Module):
    """A network whose outputs are a plain tuple of those that it has."""

    def __init__(self, network: nn.Module, outputs: list[str]) -> None:
        super().__init__()
        self.network = network
        self.outputs = outputs

    def forward(self, *features: torch.Tensor) -> tuple[torch.Tensor, ...]:
        prediction = self.network(*features)
        # An input that has no effect would vanish from the file: give it one that adds 0.
        nothing = sum(0.0 * feature.sum() for feature in features)
        first, *others = (getattr(prediction, name) for name in self.outputs)
        return (first + nothing, *others)
