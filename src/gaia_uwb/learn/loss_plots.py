"""Picture of a training: every term of the loss, on training and on validation data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from gaia_uwb._shared import house_style, new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_LINES = {"training": ("#0072B2", "-"), "validation": ("#D55E00", "--")}
_NAMES = {
    "total": "total",
    "mask": "ranges (m²)",
    "layout": "layout (m²)",
    "consistency": "consistency (m²)",
    "anchor": "anchors (m²)",
    "scene": "layout: negative log likelihood",
    "range": "ranges: Huber (m²)",
    "sigma": "ranges: negative log likelihood",
    "nlos": "line of sight: cross entropy",
}


def plot_losses(log: Sequence[Mapping[str, Any]], unit: str = "epoch") -> Figure:
    """Draw every term over the epochs.

    Parameters
    ----------
    log
        One entry per epoch: ``epoch``, and terms by name under ``training`` and ``validation``.
    unit
        What an epoch is called.
    """
    terms = [name for name in _NAMES if name in log[0]["training"]]
    with house_style():
        figure = new_figure(2.1, 0.6 + 1.3 * len(terms))
        epochs = [line["epoch"] + 1 for line in log]
        for axes, term in zip(figure.subplots(1, len(terms), squeeze=False)[0], terms, strict=True):
            for part, (colour, dashes) in _LINES.items():
                values = [line[part][term] for line in log]
                mark = None if len(epochs) > 1 else "o"
                axes.plot(epochs, values, marker=mark, color=colour, ls=dashes, label=part)
            positive = all(line[part][term] > 0 for line in log for part in _LINES)
            axes.set(title=_NAMES[term], xlabel=unit, yscale="log" if positive else "linear")
        figure.legend(
            *figure.axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=2
        )
    return figure
