"""Work zones as methods reconstruct them, over the true ones, turned so that each lies level.

A zone may be ten times as long as it is wide: then the two directions have different scales.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from gaia_uwb._shared import INK, Array, Float64, house_style, legend_above, look, new_figure
from gaia_uwb.zone import convex_hull

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_TRUE, _PATH = "#BDBDBD", "#7A7A7A"
_REACH = 0.6  # how far around the true zone a picture goes, in sizes of the zone
_LONG = 2.5  # zones that are longer than wide by more get a scale for each direction


@dataclass(frozen=True)
class DrawnZone:
    """One episode's zone.

    Parameters
    ----------
    title
        What to write above it.
    path_m : (T, 2)
        The tag's path.
    true_m : (N, 2)
        True places of the observed anchors.
    found_m
        By method, the places that it found, (K, 2).
    """

    title: str
    path_m: Float64[Array, "T 2"]
    true_m: Float64[Array, "N 2"]
    found_m: Mapping[str, Float64[Array, "_ 2"]]


def plot_layouts(zones: Sequence[Sequence[DrawnZone]], row_titles: Sequence[str] = ()) -> Figure:
    """Draw zones from above.

    Parameters
    ----------
    zones
        Rows of zones.
    row_titles
        What to call the rows.
    """
    columns = max(map(len, zones))
    with house_style():
        figure = new_figure(0.4 + 2.35 * len(zones))
        grid = figure.subplots(len(zones), columns, squeeze=False)
        for k, row in enumerate(zones):
            for axes, zone in zip(grid[k], row, strict=False):
                _draw(axes, zone)
            for axes in grid[k, len(row) :]:
                axes.set_axis_off()
            title = f"{row_titles[k]}\n" if row_titles else ""
            grid[k, 0].set_ylabel(f"{title}across (m)")
        for axes in grid[-1]:
            axes.set_xlabel("along the zone (m)")
        legend_above(figure, grid[0, 0])
    return figure


def _draw(axes: Axes, zone: DrawnZone) -> None:
    turn, centre_m = _level(zone.true_m)

    def turned(points_m: Float64[Array, "K 2"]) -> Float64[Array, "K 2"]:
        return np.asarray((points_m - centre_m) @ turn)

    axes.plot(*turned(zone.path_m).T, color=_PATH, lw=1.0, ls=(0, (2, 1)), label="path", zorder=1)
    true_m = turned(zone.true_m)
    axes.fill(
        *convex_hull(true_m).T, facecolor=_TRUE, edgecolor=INK, alpha=0.55, lw=1.2, label="true",
        zorder=2,
    )  # fmt: skip
    axes.plot(*true_m.T, "+", color=INK, ms=6, mew=1.1, zorder=6)
    for method, places_m in zone.found_m.items():
        style, leads = look(method), method.startswith("gaia")
        ring_m = turned(convex_hull(places_m)) if len(places_m) else places_m
        closed_m = np.concatenate([ring_m, ring_m[:1]])
        axes.plot(
            *closed_m.T,
            color=style.colour,
            ls=style.dashes,
            lw=1.6 if leads else 1.1,
            label=style.label,
            zorder=5 if leads else 4,
        )
        axes.plot(*turned(places_m).T, style.mark, color=style.colour, ms=3, zorder=5)
    low_m, high_m = true_m.min(axis=0), true_m.max(axis=0)
    size_m = np.maximum(high_m - low_m, 1.0)
    long = size_m[0] > _LONG * size_m[1]
    half_m = (0.5 + _REACH) * (size_m * [0.75, 1.6] if long else np.full(2, size_m.max()))
    (west_m, south_m), (east_m, north_m) = (
        (low_m + high_m) / 2 - half_m,
        (low_m + high_m) / 2 + half_m,
    )
    axes.set(xlim=(west_m, east_m), ylim=(south_m, north_m), aspect="auto" if long else "equal")
    axes.set_title(zone.title, size=7.5)


def _level(points_m: Float64[Array, "N 2"]) -> tuple[Float64[Array, "2 2"], Float64[Array, "2"]]:
    """Return the turn that lays points level, their longest direction to the right."""
    centre_m = points_m.mean(axis=0)
    _, _, axes = np.linalg.svd(points_m - centre_m, full_matrices=True)
    along = axes[0] * (1.0 if axes[0, 0] >= 0 else -1.0)
    return np.array([[along[0], -along[1]], [along[1], along[0]]]), centre_m
