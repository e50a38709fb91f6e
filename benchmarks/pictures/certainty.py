"""Draw why white noise alone gives false certainty, from a run of the outdoor UWB data set.

Run ``python benchmarks/pictures/certainty.py``; it takes some seconds. Set ``GAIA_DATA_DIR`` to the
folder that holds the data set. It prints the numbers that stand on the page of certainty.
"""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.patches import Ellipse

from gaia_uwb import read
from gaia_uwb._shared import CHI_SQUARE_90, Array, Float64
from gaia_uwb.evaluate import rigid_align
from gaia_uwb.locate import find_places
from gaia_uwb.pipeline import prepare

OUT = Path(__file__).parents[2] / "docs" / "images" / "concepts" / "certainty.png"
RUN = "outdoor-uwb:LOS/B/4"
BLUE, RED, GREY, INK = "#0072B2", "#D55E00", "#9A9A9A", "#222222"
DRIVEN_M = 120.0  # of the path, so that single bends of the error can be seen
OVER_M = 1.0  # of the path, over which the error is averaged


def semi_axis_m(covariance_m2: Float64[Array, "N 2 2"]) -> Float64[Array, "N"]:
    """Return the longer semi-axis of each 90 % ellipse."""
    return np.asarray(np.sqrt(CHI_SQUARE_90 * np.linalg.eigvalsh(covariance_m2)[:, 1]))


def draw_ellipse(axes: Axes, covariance_m2: Float64[Array, "2 2"], colour: str) -> None:
    """Draw a 90 % ellipse about the middle, in centimetres."""
    value, vector = np.linalg.eigh(covariance_m2)
    width_cm, height_cm = 200.0 * np.sqrt(CHI_SQUARE_90 * value)
    angle_deg = np.degrees(np.arctan2(vector[1, 0], vector[0, 0]))
    axes.add_patch(
        Ellipse((0, 0), width_cm, height_cm, angle=angle_deg, fill=False, ec=colour, lw=2)
    )


def white_noise_covariance_m2(
    path_m: Float64[Array, "R 2"], place_m: Float64[Array, "2"], noise_m: float
) -> Float64[Array, "2 2"]:
    """Return the covariance of a place if all errors of its ranges were independent."""
    away_m = path_m - place_m
    direction = away_m / np.linalg.norm(away_m, axis=1, keepdims=True)
    return np.asarray(noise_m**2 * np.linalg.inv(direction.T @ direction))


def draw_errors(
    axes: Axes, driven_m: Float64[Array, "R"], error_m: Float64[Array, "R"], anchor_id: str
) -> None:
    """Draw the range errors of one anchor along the path, and what is left of them on average."""
    slot = (driven_m // OVER_M).astype(np.int64)
    slots = np.unique(slot)
    middle_m = [float(np.median(error_m[slot == k])) for k in slots]
    axes.plot(driven_m, 100 * error_m, ".", color=GREY, ms=2.5, label="one reading")
    axes.plot(OVER_M * (slots + 0.5), 100 * np.array(middle_m), "-", color=BLUE, lw=1.8,
              label=f"median over {OVER_M:g} m of the path")  # fmt: skip
    axes.set(xlim=(0, DRIVEN_M), ylim=(-45, 45), xlabel="distance driven (m)",
             ylabel="range error less its median (cm)",
             title=f"ranges to anchor {anchor_id}")  # fmt: skip
    axes.legend(fontsize=9, loc="upper right")


def main() -> None:
    """Draw the picture and print its numbers."""
    scene = read(RUN)
    assert scene.truth is not None
    episode = prepare(scene.without_truth())
    (places,) = find_places([[episode]])
    readings, found = episode.own_times, places.hypotheses
    assert readings is not None
    off_m = np.linalg.norm(found.position_m - scene.truth.anchor_m[:, None], axis=2)
    better = np.arange(scene.n_anchors), off_m.argmin(axis=1)
    place_m, whole_m2 = found.position_m[better], found.covariance_m2[better]
    # The frames of path and survey differ: only what a turn and a shift leave is the ranges' fault.
    true_m = rigid_align(scene.truth.anchor_m, place_m).points_m
    noise_m = places.errors[0].sizes.noise_m
    path_m = readings.position_at(readings.t_s)
    white_m2 = np.stack([
        white_noise_covariance_m2(path_m[readings.anchor == n], own_m, noise_m)
        for n, own_m in enumerate(place_m)
    ])  # fmt: skip

    figure = plt.figure(figsize=(10.5, 4.2), layout="constrained")
    left, right = np.array(figure.subfigures(1, 2, width_ratios=(1.35, 1)))
    worst = int(np.argmax(np.linalg.norm(place_m - true_m, axis=1)))
    driven_m = np.cumsum(np.hypot(*np.diff(path_m, axis=0, prepend=path_m[:1]).T))
    shown = (readings.anchor == worst) & (driven_m < DRIVEN_M)
    error_m = readings.range_m[shown] - np.hypot(*(path_m[shown] - true_m[worst]).T)
    draw_errors(left.subplots(), driven_m[shown], error_m - np.median(error_m),
                scene.anchor_ids[worst])  # fmt: skip
    panels = right.subplots(2, 2, sharex=True, sharey=True)
    for n, axes in enumerate(panels.ravel()):
        draw_ellipse(axes, whole_m2[n], BLUE)
        draw_ellipse(axes, white_m2[n], RED)
        axes.plot(*(100 * (true_m[n] - place_m[n])), "x", color=INK, ms=9, mew=2)
        axes.set(xlim=(-12, 12), ylim=(-12, 12), aspect="equal")
        axes.set_title(f"anchor {scene.anchor_ids[n]}", fontsize=9)
    right.supxlabel("cm", fontsize=9)
    figure.savefig(OUT, dpi=110, metadata={"Software": None})
    print(f"wrote {OUT}")

    error_cm = 100 * np.linalg.norm(place_m - true_m, axis=1)
    alike = places.errors[0].sizes.alike
    print(f"{RUN}: {len(readings.t_s)} readings, noise {100 * noise_m:.1f} cm")
    print(f"correlation of the noise in 0.1 s: {alike:.1f}")
    print(f"errors of the places {error_cm.min():.1f} to {error_cm.max():.1f} cm")
    for name, covariance_m2 in (("white noise alone", white_m2), ("the whole model", whole_m2)):
        long_cm = 100 * semi_axis_m(covariance_m2)
        print(f"{name}: 90 % ellipses of {long_cm.min():.1f} to {long_cm.max():.1f} cm")


if __name__ == "__main__":
    main()
