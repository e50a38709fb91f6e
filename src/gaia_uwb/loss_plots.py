"""Picture of a training: every term of the loss, on training and on validation data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_COLOURS = {"training": "#0072B2", "validation": "#D55E00"}
_NAMES = {
    "total": "total",
    "mask": "ranges: masked Huber (m²)",
    "layout": "layout (m²)",
    "consistency": "consistency (m²)",
    "anchor": "anchors (m²)",
}


def plot_losses(log: Sequence[Mapping[str, Any]]) -> Figure:
    """Draw every term over the epochs.

    Parameters
    ----------
    log
        One entry per epoch: ``epoch``, and terms by name under ``training`` and ``validation``.
    """
    from matplotlib.figure import Figure

    terms = [name for name in _NAMES if name in log[0]["training"]]
    figure = Figure(figsize=(3.2 * len(terms), 3.0), layout="constrained")
    epochs = [line["epoch"] + 1 for line in log]
    for axes, term in zip(figure.subplots(1, len(terms), squeeze=False)[0], terms, strict=True):
        for part, colour in _COLOURS.items():
            axes.plot(epochs, [line[part][term] for line in log], color=colour, label=part)
        axes.set(title=_NAMES[term], xlabel="epoch", yscale="log")
        axes.grid(visible=True, which="both", lw=0.3)
    figure.axes[0].legend(frameon=False)
    return figure
