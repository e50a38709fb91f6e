"""One look for all figures of the paper, and their files: PDF for print, PNG for pages.

Sizes are those of a page of two columns: text of 8 points stays 8 points. Methods differ in colour
(Okabe and Ito's palette, for all kinds of colour vision), in their marks and in their dashes, so
that they can be told apart in grey. Fonts are embedded as TrueType. matplotlib is loaded when a
picture is made, and without ``pyplot``, so there is no global state. What a user's ``matplotlibrc``
says, such as to set all text in LaTeX, does not count: pictures are the same everywhere.
"""

from __future__ import annotations

import io
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from gaia_uwb._shared.errors import ConfigError

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH_IN = 7.1
"""Width of a page's text, in inches."""
INK, GRID, TRUTH = "#222222", "#E3E3E3", "#222222"
_PNG_DPI = 200
_MOST_IN_A_ROW = 6  # of a legend

STYLE: dict[str, Any] = {
    "font.size": 8.0,
    "axes.titlesize": 8.5,
    "axes.titlelocation": "left",
    "axes.labelsize": 8.0,
    "xtick.labelsize": 7.5,
    "ytick.labelsize": 7.5,
    "legend.fontsize": 8.0,
    "legend.frameon": False,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": GRID,
    "grid.linewidth": 0.5,
    "lines.linewidth": 1.2,
    "lines.markersize": 4.0,
    "pdf.fonttype": 42,
    "figure.dpi": 100.0,
}


@dataclass(frozen=True)
class Look:
    """How a method is drawn: what to call it, colour, mark and dashes."""

    label: str
    colour: str
    mark: str
    dashes: Any


_LOOKS = {
    "raw": Look("raw", "#8A8A8A", "x", (0, (1, 1))),
    "median": Look("median", "#56B4E9", "v", (0, (1, 1.5))),
    "kalman": Look("Kalman", "#E69F00", "^", (0, (4, 1.5))),
    "pose-kalman": Look("PoseKalman", "#009E73", "s", (0, (4, 1.5))),
    "mlp": Look("MLP", "#CC79A7", "P", (0, (4, 1, 1, 1))),
    "pose-mlp": Look("PoseMLP", "#0072B2", "D", (0, (4, 1, 1, 1))),
    "gaia": Look("GAIA", "#D55E00", "o", "-"),
    "gaia-set": Look("GAIA-set", "#000000", "*", "-"),
}


def look(method: str) -> Look:
    """Return how a method is drawn.

    Parameters
    ----------
    method
        Its name; an unknown one is drawn in black.

    Examples
    --------
    >>> look("gaia").label
    'GAIA'
    """
    return _LOOKS.get(method, Look(method, INK, ".", "-"))


@contextmanager
def plain_style() -> Iterator[None]:
    """Draw figures inside this block, or function, with matplotlib's own settings."""
    try:
        import matplotlib as mpl
    except (ImportError, ValueError, OSError) as error:  # also a damaged matplotlibrc
        raise ConfigError(f"matplotlib cannot be loaded: {error}") from error

    ours = {k: v for k, v in mpl.rcParamsDefault.items() if not k.startswith("backend")}
    with mpl.rc_context(ours):
        yield


@contextmanager
def house_style() -> Iterator[None]:
    """Draw figures inside this block in the house style."""
    from matplotlib import rc_context

    with plain_style(), rc_context(STYLE):  # type: ignore[arg-type]  # its keys are literals
        yield


def new_figure(height_in: float, width_in: float = WIDTH_IN) -> Figure:
    """Return an empty figure that lays itself out.

    Parameters
    ----------
    height_in, width_in
        Its size, in inches.
    """
    from matplotlib.figure import Figure

    return Figure(figsize=(width_in, height_in), layout="constrained")


def figure_files(figure: Figure, *, note: str = "") -> dict[str, bytes]:
    """Return a figure's files by their ending, the same bytes for the same picture.

    Parameters
    ----------
    figure
        Any figure.
    note
        Written across its foot, in red.
    """
    if note:
        figure.supxlabel(note, color="#C00000", size=9)  # the layout makes room for it
    metadata: dict[str, dict[str, Any]] = {"pdf": {"CreationDate": None}, "png": {"Software": None}}
    files = {}
    with house_style(), warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing from font")
        for kind, own in metadata.items():
            buffer = io.BytesIO()
            figure.savefig(buffer, format=kind, dpi=_PNG_DPI, metadata=own)
            files[kind] = buffer.getvalue()
    return files


def legend_above(figure: Figure, axes: Axes) -> None:
    """Put one legend above all panels, in as many rows as the page's width requires.

    Parameters
    ----------
    figure
        The figure, with a constrained layout.
    axes
        A panel that shows everything that is explained.
    """
    handles, labels = axes.get_legend_handles_labels()
    n_rows = -(-len(labels) // _MOST_IN_A_ROW)
    n_columns = -(-len(labels) // n_rows) if labels else 1
    figure.legend(handles, labels, loc="outside upper center", ncols=n_columns)


SCREEN_DPI = 110


def figure_png(figure: Figure) -> bytes:
    """Return a figure as the bytes of a PNG file.

    Parameters
    ----------
    figure
        What :func:`plot_reconstruction` returned.
    """
    buffer = io.BytesIO()
    with plain_style(), warnings.catch_warnings():
        # A name may hold letters that the font lacks; a box in their place is no news to a user.
        warnings.filterwarnings("ignore", message="Glyph .* missing from font")
        # Little compression: the encoder takes half the time for a file a fifth larger.
        figure.savefig(buffer, format="png", dpi=SCREEN_DPI, pil_kwargs={"compress_level": 2})
    return buffer.getvalue()


def figure_svg(figure: Figure) -> str:
    """Return a figure as the text of an SVG file: lines and letters to scale and to edit.

    Parameters
    ----------
    figure
        What :func:`plot_reconstruction` returned.
    """
    import matplotlib as mpl

    buffer = io.StringIO()
    with (
        plain_style(),
        warnings.catch_warnings(),
        mpl.rc_context({"svg.hashsalt": "gaia"}),
    ):
        warnings.filterwarnings("ignore", message="Glyph .* missing from font")
        figure.savefig(buffer, format="svg", dpi=1.5 * SCREEN_DPI, metadata={"Date": None})
    return buffer.getvalue()
