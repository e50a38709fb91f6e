"""``gaia-set`` as ONNX, with dynamic numbers of episodes, steps and anchors."""

from __future__ import annotations

import io
import warnings

import torch
from torch import Tensor, nn

from gaia_uwb.learn.networks.gaia_set import GaiaSet
from gaia_uwb.models import ZoneInputs

OUTPUTS = (
    "denoised_range", "log_sigma", "place", "information", "scene_logit", "side_logit", "nlos_logit"
)  # fmt: skip
"""Names of the exported network's outputs."""

_OPSET = 17
_AXES = {
    "range": {0: "batch", 1: "anchors", 2: "steps"},
    "position": {0: "batch", 1: "steps"},
    "anchors": {0: "batch", 1: "anchors"},
    "batch": {0: "batch"},
}
_INPUT_AXES = ("position", "position", "range", "range", "range", "anchors", "anchors",
               "batch", "batch", "batch", "batch")  # fmt: skip
_OUTPUT_AXES = ("range", "range", "anchors", "anchors", "batch", "anchors", "range")


def export_set_onnx(network: GaiaSet) -> bytes:
    """Return a network for ONNX Runtime; its inputs are those of ``zone_inputs.py``.

    Parameters
    ----------
    network
        In evaluation mode, on the CPU.
    """
    axes = dict(zip((*ZoneInputs._fields, *OUTPUTS), (*_INPUT_AXES, *_OUTPUT_AXES), strict=True))
    file = io.BytesIO()
    with warnings.catch_warnings():
        # The exporter's successor needs one more package.
        warnings.simplefilter("ignore")
        torch.onnx.export(
            _Outputs(network),
            _example(),
            file,  # type: ignore[arg-type]  # the annotation forgets what the manual offers
            dynamo=False,
            opset_version=_OPSET,
            input_names=list(ZoneInputs._fields),
            output_names=list(OUTPUTS),
            dynamic_axes={name: _AXES[kind] for name, kind in axes.items()},
        )
    return file.getvalue()


def _example() -> tuple[Tensor, ...]:
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


class _Outputs(nn.Module):
    """The network with a plain tuple of outputs."""

    def __init__(self, network: GaiaSet) -> None:
        super().__init__()
        self.network = network

    def forward(self, *inputs: Tensor) -> tuple[Tensor, ...]:
        found = self.network(*inputs)
        return (
            found.range, found.log_sigma, found.place, found.information, found.scene_logit,
            found.side_logit, found.nlos_logit,
        )  # fmt: skip
