"""Draw two tags on a roof, and what decides a side; print the numbers that stand beside them.

Run ``python benchmarks/pictures/evidence.py``; it takes some seconds. Both pictures are sketches
with exact ranges.
"""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, FancyBboxPatch, Rectangle, Wedge
from scipy.optimize import least_squares

from gaia_uwb._shared import Array, Float64

OUT = Path(__file__).parents[2] / "docs" / "images"
BLUE, ORANGE, GREEN, RED = "#0072B2", "#E69F00", "#009E73", "#D55E00"
GREY, INK = "#9A9A9A", "#222222"
CONE_M = np.array([0.0, 5.0])
WIDE_M = 1.6
SIGMA_DEG = 10.0
APART_M = (0.1, 0.2, 0.4, 0.8, 1.6)


def draw_roof() -> Figure:
    """Draw a van from above, with two tags and their lever arms."""
    figure, axes = plt.subplots(figsize=(9.0, 4.0), layout="constrained")
    axes.add_patch(FancyBboxPatch((-2.6, -0.95), 5.2, 1.9, boxstyle="round,pad=0.05", fc="#F2F2F2",
                                  ec=INK, lw=1.5))  # fmt: skip
    axes.add_patch(Rectangle((1.45, -0.8), 0.45, 1.6, fc="#D9E6EF", ec=GREY))
    axes.text(2.25, 0.45, "front", rotation=90, va="center", ha="center", color=INK, fontsize=9)
    for end_m, name, place in (
        ((3.4, 0.0), "x: forward", "left"),
        ((0.0, 1.6), "y: left", "center"),
    ):
        axes.annotate("", end_m, (0, 0), arrowprops={"arrowstyle": "->", "color": INK, "lw": 1.4})
        axes.text(end_m[0] + 0.05, end_m[1] + 0.04, name, ha=place, va="bottom", fontsize=10)
    axes.plot(0, 0, "s", color=INK, ms=9)
    axes.text(0.15, -0.12, "reference point:\nGNSS antenna", ha="left", va="top", fontsize=9)
    for tag_id, (forward_m, left_m) in {"tag-1": (-1.2, 0.8), "tag-2": (-1.2, -0.8)}.items():
        axes.plot([0, forward_m], [0, left_m], ":", color=BLUE, lw=1.2)
        axes.plot(forward_m, left_m, "o", color=BLUE, ms=13)
        lever = f"{tag_id}\nforward_m: {forward_m:g}\nleft_m: {left_m:g}"
        axes.text(forward_m - 0.15, 0.8 * left_m, lever, ha="right", va="center", color=BLUE,
                  fontsize=9)  # fmt: skip
    axes.annotate("", (-3.1, 0.8), (-3.1, -0.8), arrowprops={"arrowstyle": "<->", "color": RED})
    axes.text(-3.2, 0, "1.6 m across:\nthis tells sides", ha="right", va="center", color=RED,
              fontsize=10)  # fmt: skip
    axes.set(xlim=(-5.2, 4.4), ylim=(-1.5, 2.1), aspect="equal")
    axes.axis("off")
    return figure


def draw_sides() -> Figure:
    """Draw what one tag, two tags, a lane change and angles say of a cone and its mirror image."""
    figure, panels = plt.subplots(2, 2, figsize=(10.5, 7.6), layout="constrained")
    one, two, change, angle = panels.ravel()
    along_m = np.array([-9.0, -3.0, 4.0])
    straight_m = np.column_stack([along_m, np.zeros(3)])
    _road(one, np.column_stack([[-16, 16], [0, 0]]), "one tag: both places fit")
    _circles(one, straight_m, BLUE)
    _road(two, np.column_stack([[-16, 16], [0, 0]]), "two tags across: the cone alone fits")
    for left_m, colour in ((0.5 * WIDE_M, BLUE), (-0.5 * WIDE_M, ORANGE)):
        _circles(two, straight_m + np.array([0.0, left_m]), colour)
    bend_m = np.linspace(-16, 16, 100)
    path_m = np.column_stack([bend_m, 1.8 * np.tanh(-bend_m / 4.0)])
    _road(change, path_m, "one tag, a lane change: the cone alone fits")
    _circles(change, np.column_stack([along_m, 1.8 * np.tanh(-along_m / 4.0)]), BLUE)
    _road(
        angle,
        np.column_stack([[-16, 16], [0, 0]]),
        f"angles of {SIGMA_DEG:g}°: the cone alone fits",
    )
    for place_m in straight_m:
        away_m = CONE_M - place_m
        bearing_deg = float(np.degrees(np.arctan2(away_m[1], away_m[0])))
        angle.add_patch(Wedge(place_m, 20.0, bearing_deg - SIGMA_DEG, bearing_deg + SIGMA_DEG,
                              fc=GREEN, alpha=0.25))  # fmt: skip
    _circles(angle, straight_m, BLUE)
    one.legend(loc="lower left", fontsize=8, framealpha=1)
    return figure


def _road(axes: Axes, path_m: Float64[Array, "T 2"], title: str) -> None:
    axes.plot(*path_m.T, color=GREY, lw=3, label="path")
    axes.plot(*CONE_M, "^", color=RED, ms=12, label="cone", zorder=5)
    axes.plot(*(CONE_M * [1, -1]), "v", mfc="none", mec=RED, mew=1.8, ms=12, label="mirror image",
              zorder=5)  # fmt: skip
    axes.set(xlim=(-16, 16), ylim=(-11, 11), aspect="equal", title=title, xlabel="along (m)",
             ylabel="across (m)")  # fmt: skip


def _circles(axes: Axes, tag_m: Float64[Array, "T 2"], colour: str) -> None:
    for place_m, style in zip(tag_m, ("-", "--", ":"), strict=True):
        range_m = float(np.hypot(*(CONE_M - place_m)))
        axes.add_patch(Circle(tuple(place_m), range_m, fill=False, ec=colour, lw=1.4, ls=style))
        axes.plot(*place_m, "o", color=colour, ms=6)


def misfit_m(apart_m: float, left_m: float) -> float:
    """Return what the best place on the wrong side leaves of exact ranges to two tags.

    Parameters
    ----------
    apart_m
        Distance between the tags across the vehicle.
    left_m
        Distance of the cone from the path.

    Notes
    -----
    The root mean square over 40 m of the path before and after the cone, with a free delay of each
    tag.
    """
    along_m = np.linspace(-40.0, 40.0, 161)
    tags_m = np.stack([np.column_stack([along_m, np.full(161, side * apart_m / 2)])
                       for side in (-1, 1)])  # fmt: skip
    range_m = np.hypot(*(np.array([0.0, left_m]) - tags_m).transpose(2, 0, 1))

    def residual_m(unknown: Float64[Array, "4"]) -> Float64[Array, "K"]:
        found_m = np.hypot(*(unknown[:2] - tags_m).transpose(2, 0, 1)) + unknown[2:, None]
        return np.asarray(found_m - range_m).ravel()

    found = least_squares(residual_m, np.array([0.0, -left_m, 0.0, 0.0]))
    return float(np.sqrt(np.mean(residual_m(found.x) ** 2)))


def main() -> None:
    """Draw the pictures and print their numbers."""
    for name, draw in (
        ("evidence/roof.png", draw_roof),
        ("concepts/sides-evidence.png", draw_sides),
    ):
        figure = draw()
        (OUT / name).parent.mkdir(exist_ok=True)
        figure.savefig(OUT / name, dpi=110, metadata={"Software": None})
        plt.close(figure)
        print(f"wrote {OUT / name}")
    print("misfit of the mirror position (cm) for cones 2, 4 and 8 m from the path")
    for apart_m in APART_M:
        found_cm = [100 * misfit_m(apart_m, left_m) for left_m in (2.0, 4.0, 8.0)]
        print(f"tags {apart_m:.1f} m apart: {', '.join(f'{each:.1f}' for each in found_cm)}")


if __name__ == "__main__":
    main()
