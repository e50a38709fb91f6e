"""Pictures of what a table of six numbers hides: quantiles, memory, and growth with distance."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from gaia_uwb._shared import Array, Float64, house_style, legend_above, look, new_figure
from gaia_uwb.simulate import autocorrelation

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_COLOURS = {"real": "#222222", "naive": "#D55E00", "calibrated": "#0072B2"}
_OTHER = "#009E73"
_BULK = np.linspace(0.005, 0.995, 199)
_SHARES = np.concatenate([[1e-4, 3e-4, 1e-3, 2e-3], _BULK, [0.998, 0.999, 0.9997, 0.9999]])
_BULK_M, _ALL_M = 0.6, 20.0  # half widths of the two panels
_TICKS_M = (-10.0, -3.0, -1.0, -0.3, 0.0, 0.3, 1.0, 3.0, 10.0)
_N_BINS, _LEAST_IN_BIN = 12, 10


def plot_quantiles(
    real: Sequence[Float64[Array, "_"]], simulated: Mapping[str, Sequence[Float64[Array, "_"]]]
) -> Figure:
    """Draw the quantiles of simulated errors over those of real ones: bulk, and everything.

    Parameters
    ----------
    real
        Tracks of errors in metres; NaN is left out.
    simulated
        The same by the simulator's name.
    """
    with house_style():
        figure = new_figure(3.5)
        bulk, tails = figure.subplots(1, 2)
        real_m = _quantiles(real)
        for name, tracks in simulated.items():
            simulated_m = _quantiles(tracks)
            for axes in (bulk, tails):
                axes.plot(
                    real_m, simulated_m, _mark(name), ms=3, lw=0.8, label=name, color=_colour(name)
                )
        for axes, reach_m, title in (
            (bulk, _BULK_M, "the middle 99 %"),
            (tails, _ALL_M, "0.01 % to 99.99 %, logarithmic beyond 0.3 m"),
        ):
            axes.plot([-reach_m, reach_m], [-reach_m, reach_m], color="#9A9A9A", lw=0.8, zorder=0)
            axes.set(xlim=(-reach_m, reach_m), ylim=(-reach_m, reach_m), aspect="equal")
            axes.set(title=title, xlabel="quantile of the real errors (m)")
            axes.set_ylabel("quantile of simulated errors (m)")
        tails.set_xscale("symlog", linthresh=0.3)
        tails.set_yscale("symlog", linthresh=0.3)
        tails.set(xticks=_TICKS_M, yticks=_TICKS_M)
        for axis in (tails.xaxis, tails.yaxis):
            axis.set_major_formatter("{x:g}")
            axis.minorticks_off()
        bulk.legend()
    return figure


def plot_autocorrelation(
    tracks: Mapping[str, Sequence[Float64[Array, "_"]]], *, rate_hz: float, clip_m: float
) -> Figure:
    """Draw how alike errors of one anchor are over the time between them.

    Parameters
    ----------
    tracks
        Tracks of errors in metres, by name.
    rate_hz
        Samples per second of the tracks.
    clip_m
        Larger errors count as this.
    """
    with house_style():
        figure = new_figure(2.8, 5.0)
        axes = figure.subplots()
        lag_s = np.arange(int(30.0 * rate_hz) + 1) / rate_hz
        for name, own in tracks.items():
            correlation = autocorrelation(own, len(lag_s) - 1, clip_m=clip_m)
            axes.plot(lag_s, correlation, lw=1.4, label=name, color=_colour(name), ls=_dashes(name))
        axes.axhline(0.0, color="#9A9A9A", lw=0.8)
        axes.set(xlim=(0.0, lag_s[-1]), ylim=(-0.1, 1.02))
        axes.set(xlabel="time between two errors of an anchor (s)", ylabel="correlation")
        axes.legend()
    return figure


Errors = tuple[Float64[Array, "_"], Float64[Array, "_"]]
"""True distances and signed range errors, in metres."""


def plot_error_over_distance(panels: Mapping[str, Mapping[str, Errors]]) -> Figure:
    """Draw the size of range errors over the true distance: the median, and what 5 % exceed.

    Parameters
    ----------
    panels
        By title, each method's errors.
    """
    from matplotlib.ticker import LogLocator

    with house_style():
        figure = new_figure(2.9)
        grid = figure.subplots(1, len(panels), squeeze=False)[0]
        for axes, (title, by_method) in zip(grid, panels.items(), strict=True):
            every = np.concatenate([distance_m for distance_m, _ in by_method.values()])
            edge_m = np.unique(np.quantile(every, np.linspace(0.0, 1.0, _N_BINS + 1)))
            for method, (distance_m, error_m) in by_method.items():
                middle_m, shares = _binned(distance_m, np.abs(error_m), edge_m)
                style = look(method)
                axes.plot(middle_m, shares[0], color=style.colour, marker=style.mark, ms=3,
                          label=style.label)  # fmt: skip
                axes.plot(middle_m, shares[1], color=style.colour, lw=0.9, ls=(0, (3, 1.5)))
            axes.set(title=title, xlabel="true distance (m)", yscale="log")
            axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            axes.yaxis.set_major_formatter("{x:g}")
            axes.minorticks_off()
        grid[0].set_ylabel("size of the range error (m)")
        legend_above(figure, grid[0])
    return figure


def _binned(
    distance_m: Float64[Array, "_"], size_m: Float64[Array, "_"], edge_m: Float64[Array, "_"]
) -> tuple[Float64[Array, "_"], Float64[Array, "2 _"]]:
    """Return the middles of the bins that hold enough, and median and 95 % quantile there."""
    bins = np.digitize(distance_m, edge_m[1:-1])
    enough = [k for k in range(len(edge_m) - 1) if np.sum(bins == k) >= _LEAST_IN_BIN]
    middle_m = np.array([np.median(distance_m[bins == k]) for k in enough])
    found = [np.quantile(size_m[bins == k], [0.5, 0.95]) for k in enough]
    return middle_m, np.array(found).reshape(-1, 2).T


def _quantiles(tracks: Sequence[Float64[Array, "_"]]) -> Float64[Array, "Q"]:
    error_m = np.concatenate([np.empty(0), *tracks])
    return np.asarray(np.quantile(error_m[np.isfinite(error_m)], _SHARES))


def _colour(name: str) -> str:
    return _COLOURS.get(name, _OTHER)


def _mark(name: str) -> str:
    return "^-" if name == "naive" else "o-"


def _dashes(name: str) -> str:
    return {"real": "-", "naive": ":"}.get(name, "--")
