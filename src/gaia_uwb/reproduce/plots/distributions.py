"""How scores spread over episodes: distribution functions, and boxes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from gaia_uwb._shared import INK, Array, Float64, house_style, legend_above, look, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_SHARE_SHOWN = (
    0.97  # of the largest errors of the worst method, so that a few do not fill the panel
)

Panels = Mapping[str, Mapping[str, Float64[Array, "_"]]]
"""By the axis's label, the scores of each method's episodes; NaN is left out."""


def plot_cdfs(panels: Panels) -> Figure:
    """Draw the share of episodes up to each score, a panel per metric.

    Parameters
    ----------
    panels
        The scores.
    """
    with house_style():
        figure = new_figure(2.9)
        grid = figure.subplots(1, len(panels), squeeze=False)[0]
        for axes, (label, by_method) in zip(grid, panels.items(), strict=True):
            for method, values in by_method.items():
                own, style = np.sort(values[np.isfinite(values)]), look(method)
                share = np.arange(1, len(own) + 1) / len(own)
                axes.step(
                    np.concatenate([own[:1], own]),
                    np.concatenate([[0.0], share]),
                    where="post",
                    color=style.colour,
                    ls=style.dashes,
                    label=style.label,
                    lw=1.8 if method.startswith("gaia") else 1.1,
                )
            axes.set(xlabel=label, ylim=(0.0, 1.0))
            _limit(axes, by_method)
        grid[0].set_ylabel("share of episodes")
        legend_above(figure, grid[0])
    return figure


def plot_boxes(panels: Panels) -> Figure:
    """Draw a box per method: quartiles and median; whiskers from 5 % to 95 %; a mark for the mean.

    Parameters
    ----------
    panels
        The scores.
    """
    with house_style():
        figure = new_figure(2.8)
        grid = figure.subplots(1, len(panels), squeeze=False)[0]
        for axes, (label, by_method) in zip(grid, panels.items(), strict=True):
            values = [own[np.isfinite(own)] for own in by_method.values()]
            drawn = axes.boxplot(
                values,
                whis=(5, 95),
                showfliers=False,
                showmeans=True,
                patch_artist=True,
                widths=0.6,
                medianprops={"color": INK, "lw": 1.3},
                meanprops={"marker": "D", "ms": 3.5, "mfc": "white", "mec": INK, "mew": 0.8},
                whiskerprops={"color": INK, "lw": 0.8},
                capprops={"color": INK, "lw": 0.8},
            )
            for box, method in zip(drawn["boxes"], by_method, strict=True):
                box.set(facecolor=look(method).colour, alpha=0.75, lw=0.8, edgecolor=INK)
            axes.set_xticks(range(1, len(values) + 1), [look(m).label for m in by_method])
            axes.tick_params(axis="x", rotation=35)
            axes.grid(visible=False, axis="x")
            axes.set_ylabel(label)
            axes.set_ylim(bottom=0.0)
    return figure


def _limit(axes: Axes, by_method: Mapping[str, Float64[Array, "_"]]) -> None:
    """End the axis where the worst method's largest errors begin."""
    ends = [np.quantile(own[np.isfinite(own)], _SHARE_SHOWN) for own in by_method.values()]
    axes.set_xlim(0.0, 1.02 * float(max(ends)))
