"""Pictures of what a table of six numbers hides: quantiles against quantiles, and memory.

matplotlib is loaded when a picture is made, and without ``pyplot``, so there is no global state.
"""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from gaia_uwb._typing import Array, Float64
from gaia_uwb.error_statistics import autocorrelation

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_COLOURS = {"real": "#222222", "naive": "#D55E00", "calibrated": "#0072B2"}
_OTHER = "#009E73"
_BULK = np.linspace(0.005, 0.995, 199)
_SHARES = np.concatenate([[1e-4, 3e-4, 1e-3, 2e-3], _BULK, [0.998, 0.999, 0.9997, 0.9999]])
_BULK_M, _ALL_M = 0.6, 20.0  # half widths of the two panels


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
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 4.4), layout="constrained")
    bulk, tails = figure.subplots(1, 2)
    real_m = _quantiles(real)
    for name, tracks in simulated.items():
        simulated_m = _quantiles(tracks)
        for axes in (bulk, tails):
            axes.plot(real_m, simulated_m, ".-", ms=4, lw=0.8, label=name, color=_colour(name))
    for axes, reach_m, title in (
        (bulk, _BULK_M, "the middle 99 %"),
        (tails, _ALL_M, "0.01 % to 99.99 %, logarithmic beyond 0.3 m"),
    ):
        axes.plot([-reach_m, reach_m], [-reach_m, reach_m], color="#9A9A9A", lw=0.8, zorder=0)
        axes.set(xlim=(-reach_m, reach_m), ylim=(-reach_m, reach_m), aspect="equal")
        _label(axes, title, "quantile of the real errors (m)", "quantile of simulated errors (m)")
    tails.set_xscale("symlog", linthresh=0.3)
    tails.set_yscale("symlog", linthresh=0.3)
    bulk.legend(frameon=False)
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
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.0, 3.8), layout="constrained")
    axes = figure.subplots()
    lag_s = np.arange(int(30.0 * rate_hz) + 1) / rate_hz
    for name, own in tracks.items():
        correlation = autocorrelation(own, len(lag_s) - 1, clip_m=clip_m)
        axes.plot(lag_s, correlation, lw=1.4, label=name, color=_colour(name))
    axes.axhline(0.0, color="#9A9A9A", lw=0.8)
    axes.set(xlim=(0.0, lag_s[-1]), ylim=(-0.1, 1.02))
    _label(axes, "", "time between two errors of an anchor (s)", "correlation")
    axes.legend(frameon=False)
    return figure


def figure_svg(figure: Figure) -> bytes:
    """Return a figure as the bytes of an SVG file, the same for the same picture.

    Parameters
    ----------
    figure
        Any figure.
    """
    from matplotlib import rc_context

    buffer = io.BytesIO()
    with rc_context({"svg.hashsalt": "gaia"}):
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    return buffer.getvalue()


def _quantiles(tracks: Sequence[Float64[Array, "_"]]) -> Float64[Array, "Q"]:
    error_m = np.concatenate([np.empty(0), *tracks])
    return np.asarray(np.quantile(error_m[np.isfinite(error_m)], _SHARES))


def _colour(name: str) -> str:
    return _COLOURS.get(name, _OTHER)


def _label(axes: Axes, title: str, x: str, y: str) -> None:
    axes.set_title(title, size=10, loc="left")
    axes.set_xlabel(x, size=9)
    axes.set_ylabel(y, size=9)
    axes.grid(color="#E3E3E3", lw=0.6)
    axes.tick_params(labelsize=8)
