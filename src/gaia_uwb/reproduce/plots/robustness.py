"""Curves of the robustness study: every method's IoU over the settings of every stressor."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from gaia_uwb._shared import house_style, legend_above, look, new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_METRIC = "polygon_iou"
_COLUMNS = 4


def plot_robustness(results: Mapping[str, Any]) -> Figure:
    """Draw the mean IoU of every method with its 95 % band, a panel per stressor.

    Parameters
    ----------
    results
        ``rows`` of table 4 and the ``titles`` of its stressors.
    """
    titles: Mapping[str, str] = results["titles"]
    n_rows = -(-len(titles) // _COLUMNS)
    with house_style():
        figure = new_figure(0.45 + 1.75 * n_rows)
        grid = figure.subplots(n_rows, _COLUMNS, squeeze=False, sharey=True).ravel()
        for axes, (stressor, title) in zip(grid, titles.items(), strict=False):
            rows = [row for row in results["rows"] if row["stressor"] == stressor]
            settings = list(dict.fromkeys(row["setting"] for row in rows))
            for method in dict.fromkeys(row["method"] for row in rows):
                found = [row["metrics"][_METRIC] for row in rows if row["method"] == method]
                style, leads = look(method), method.startswith("gaia")
                axes.plot(
                    settings,
                    [metric["value"] for metric in found],
                    color=style.colour,
                    marker=style.mark,
                    ls=style.dashes,
                    ms=3.5,
                    lw=1.6 if leads else 1.0,
                    label=style.label,
                    zorder=3 if leads else 2,
                )
                bands = [metric["ci95"] or (metric["value"],) * 2 for metric in found]
                axes.fill_between(
                    settings, *zip(*bands, strict=True), color=style.colour, alpha=0.13, lw=0
                )
            axes.set(xlabel=title, xticks=settings)
            if settings[0] > settings[-1]:
                axes.invert_xaxis()
        for axes in grid[len(titles) :]:
            axes.set_axis_off()
        for axes in grid[::_COLUMNS]:
            axes.set_ylabel("IoU")
        grid[0].set_ylim(bottom=0.0)
        legend_above(figure, grid[0])
    return figure
