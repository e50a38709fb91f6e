"""What GAIA's gate does over time: whom it trusts, and what for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from gaia_uwb._shared import INK, Array, Bool, Float64, house_style, look, new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_BLOCKED = "#F0E442"
_CUT = 0.02  # share of the errors that may leave the picture at either end


@dataclass(frozen=True)
class GateRecord:
    """One anchor's ranges over time, and what the network makes of them; NaN where there is none.

    Parameters
    ----------
    title
        Which episode and anchor.
    t_s : (T,)
        Time from the start.
    measured_m, denoised_m, layout_m : (T,)
        Errors of the measured and the denoised range, and of the layout's distance.
    gate : (T,)
        Share of the corrected range in the result; the rest is the layout's distance.
    nlos : (T,)
        Whether there was no line of sight.
    """

    title: str
    t_s: Float64[Array, "T"]
    measured_m: Float64[Array, "T"]
    denoised_m: Float64[Array, "T"]
    layout_m: Float64[Array, "T"]
    gate: Float64[Array, "T"]
    nlos: Bool[Array, "T"]


def plot_gate(records: list[GateRecord]) -> Figure:
    """Draw errors above and the gate below, a column per record.

    Parameters
    ----------
    records
        At least one.
    """
    lines = (
        ("measured_m", "measured", look("raw").colour, (0, (1, 1))),
        ("layout_m", "layout's distance", look("pose-mlp").colour, (0, (4, 1.5))),
        ("denoised_m", "denoised", look("gaia").colour, "-"),
    )
    with house_style():
        figure = new_figure(3.3)
        grid = figure.subplots(
            2, len(records), squeeze=False, sharex="col", height_ratios=(1.5, 1.0)
        )
        for column, record in enumerate(records):
            errors, gate = grid[:, column]
            for name, label, colour, dashes in lines:
                errors.plot(record.t_s, getattr(record, name), color=colour, ls=dashes, label=label)
            gate.plot(record.t_s, record.gate, color=INK, label="gate")
            gate.axhline(np.nanmean(record.gate), color=INK, lw=0.7, ls=(0, (1, 2)))
            errors.set_ylim(*_shown(record))
            for axes in (errors, gate):
                low, high = axes.get_ylim() if axes is errors else (0.0, 1.0)
                axes.fill_between(
                    record.t_s, low, high, where=record.nlos, step="mid", color=_BLOCKED,
                    alpha=0.35, lw=0, label="no line of sight", zorder=0,
                )  # fmt: skip
                axes.set_ylim(low, high)
            errors.set_title(record.title)
            gate.set(xlabel="time (s)", ylim=(0.0, 1.0))
        grid[0, 0].set_ylabel("range error (m)")
        grid[1, 0].set_ylabel("gate")
        figure.legend(*grid[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=4)
    return figure


def _shown(record: GateRecord) -> tuple[float, float]:
    """Return the axis's ends: all but the wildest errors, which would hide the others."""
    every = np.concatenate([record.measured_m, record.denoised_m, record.layout_m])
    low, high = np.nanquantile(every, [_CUT, 1.0 - _CUT])
    slack = 0.25 * max(high - low, 0.1)
    return float(low - slack), float(high + slack)
