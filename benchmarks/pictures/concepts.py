"""Draw the pictures of the concept pages, and print the numbers that stand on them.

Run ``python benchmarks/pictures/concepts.py``; it takes about half a minute. What is drawn is what
the simulator and the package's own steps give, except where a title says that it is a sketch.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from scipy.optimize import least_squares

from gaia_uwb import PipelineConfig, Scene, read, reconstruct
from gaia_uwb._shared import CHI_SQUARE_90, Array, Float64
from gaia_uwb.alignment import fit_anchors, gather_readings
from gaia_uwb.config import AlignmentConfig
from gaia_uwb.simulate import PRESETS, PassConfig, simulate_pass

OUT = Path(__file__).parents[2] / "docs" / "images" / "concepts"
# Okabe and Ito: told apart by all kinds of colour vision; line styles and markers tell as well.
BLUE, ORANGE, GREEN, RED = "#0072B2", "#E69F00", "#009E73", "#D55E00"
GREY, INK = "#9A9A9A", "#222222"
CONE_M = np.array([0.0, 7.0])
BIASES_M = np.linspace(-0.4, 0.4, 9)
N_PASSES = 10
STRAIGHT_STEADY = PRESETS["straight"].model_copy(
    update={"drive": PRESETS["straight"].drive.model_copy(update={"speed_variation": 0.0})}
)


def lane_change_m(along_m: Float64[Array, "T"], shift_m: float) -> Float64[Array, "T 2"]:
    """Return a path east that moves over to the right by ``shift_m`` about its middle."""
    across_m = -shift_m / (1.0 + np.exp(-along_m / 5.0)) + 0.5 * shift_m
    return np.column_stack([along_m, across_m])


def draw_mirror_side() -> Figure:
    """Draw where ranges from three places meet: twice on a straight path, once with a lane change.

    A sketch with exact ranges.
    """
    figure, panels = plt.subplots(1, 2, figsize=(10.5, 3.2), layout="constrained", sharey=True)
    for axes, shift_m, title in zip(
        panels,
        (0.0, 3.6),
        ("straight: two places fit all ranges", "with a lane change of 3.6 m: one does"),
        strict=True,
    ):
        path_m = lane_change_m(np.linspace(-28, 28, 200), shift_m)
        mirror_m = best_place(path_m, side=-1)
        axes.plot(*path_m.T, color=GREY, lw=3, label="path of the tag")
        axes.set(xlim=(-30, 30), ylim=(-13, 13), aspect="equal", title=title, xlabel="along (m)")
        near = axes.inset_axes((0.02, 0.04, 0.31, 0.4))
        near.set(xlim=mirror_m[0] + np.array([-2, 2]), ylim=mirror_m[1] + np.array([-1.3, 1.3]),
                 aspect="equal", xticks=[], yticks=[])  # fmt: skip
        axes.indicate_inset_zoom(near, edgecolor=INK)
        for each in (axes, near):
            for k, style in zip((15, 92, 170), ("-", "--", ":"), strict=True):
                range_m = float(np.hypot(*(CONE_M - path_m[k])))
                each.add_patch(Circle(path_m[k], range_m, fill=False, ec=BLUE, lw=1.4, ls=style))
                each.plot(*path_m[k], "o", color=INK, ms=5)
            each.plot(*CONE_M, "^", color=RED, ms=12, label="cone", zorder=5)
            each.plot(*mirror_m, "v", mfc="none", mec=RED, mew=1.8, ms=12, label="mirror image")
    panels[0].set_ylabel("across (m)")
    panels[0].legend(loc="upper right", fontsize=8)
    return figure


def best_place(path_m: Float64[Array, "T 2"], side: int) -> Float64[Array, "2"]:
    """Return the place on one side of a path that fits the cone's exact ranges best."""
    range_m = np.hypot(*(CONE_M - path_m).T)
    found = least_squares(
        lambda place_m: np.hypot(*(place_m - path_m).T) - range_m, [1.0, 7.0 * side]
    )
    return np.asarray(found.x)


def draw_mirror_misfit() -> Figure:
    """Draw how badly the mirror image fits, by the size of the lane change."""
    figure, axes = plt.subplots(figsize=(6.4, 3.6), layout="constrained")
    shifts_m = np.linspace(0.0, 4.0, 21)
    along_m = np.linspace(-60, 60, 400)
    for away_m, colour, style in ((4.0, BLUE, "-"), (8.0, ORANGE, "--"), (16.0, GREEN, "-.")):
        misfit_m = [mirror_misfit_m(lane_change_m(along_m, s), away_m) for s in shifts_m]
        axes.plot(shifts_m, 100 * np.array(misfit_m), style, color=colour, lw=2,
                  label=f"cone {away_m:g} m beside the path")  # fmt: skip
        print(f"lane change of 3.6 m, cone {away_m:g} m away: mirror misfit "
              f"{100 * float(np.interp(3.6, shifts_m, misfit_m)):.0f} cm")  # fmt: skip
    axes.axhspan(0, 6, color=GREY, alpha=0.35, lw=0)
    axes.text(3.95, 1.5, "noise of one range, about 6 cm", ha="right", fontsize=9)
    axes.set(
        xlabel="lane change while passing the cone (m)",
        ylabel="misfit of the mirror image, rms (cm)",
        xlim=(0, 4), ylim=(0, None),
    )  # fmt: skip
    axes.legend(fontsize=9)
    return figure


def mirror_misfit_m(path_m: Float64[Array, "T 2"], away_m: float) -> float:
    """Return the root mean square misfit of the best place on the wrong side."""
    cone_m = np.array([0.0, away_m])
    range_m = np.hypot(*(cone_m - path_m).T)
    heard = range_m < 60.0
    found = least_squares(lambda m: (np.hypot(*(m - path_m).T) - range_m)[heard], [1.0, -away_m])
    return float(np.sqrt(np.mean(found.fun**2)))


def draw_geometry() -> Figure:
    """Draw how many metres of place one metre of range error makes, cone by cone."""
    figure, panels = plt.subplots(1, 2, figsize=(10.5, 3.1), layout="constrained", sharey=True)
    east_m, north_m = np.meshgrid(np.linspace(-70, 70, 141), np.linspace(-30, 30, 121))
    cones_m = np.column_stack([east_m.ravel(), north_m.ravel()])
    for axes, (start_m, end_m), title in zip(
        panels,
        ((-70.0, 70.0), (-70.0, 0.0)),
        ("the whole zone is passed", "the log ends halfway"),
        strict=True,
    ):
        path_m = lane_change_m(np.linspace(start_m, end_m, 280), 3.6)
        dilution = worst_dilution(path_m, cones_m).reshape(east_m.shape)
        shade = axes.contourf(east_m, north_m, dilution, [1, 1.5, 2, 3, 5, 10, 20],
                              cmap="cividis_r", extend="both")  # fmt: skip
        if np.isnan(dilution).any():
            axes.text(68, 25, "not\nheard", ha="right", va="top", fontsize=9)
        axes.plot(*path_m.T, color=RED, lw=2.5)
        axes.set(aspect="equal", title=title, xlabel="along (m)", facecolor="white")
        for place_m in ((0.0, 10.0), (50.0, 10.0)):
            value = float(worst_dilution(path_m, np.array([place_m]))[0])
            print(f"{title}: dilution at {place_m} m is {value:.1f}")
    panels[0].set_ylabel("across (m)")
    figure.colorbar(shade, ax=panels, label="dilution, worst direction", pad=0.01, aspect=15)
    return figure


def worst_dilution(
    path_m: Float64[Array, "T 2"], cones_m: Float64[Array, "N 2"]
) -> Float64[Array, "N"]:
    """Return the place's standard deviation over that of the mean range, worst direction.

    All ranges within 60 m count alike, so this is the geometry alone: sqrt(T) times the square root
    of the largest eigenvalue of the inverse of the summed outer products of directions. NaN where a
    cone is hardly heard.
    """
    away = cones_m[:, None] - path_m
    distance_m = np.linalg.norm(away, axis=2, keepdims=True)
    heard = (distance_m[..., 0] < 60.0).astype(float)
    direction = away / np.fmax(distance_m, 1e-6)
    information = np.einsum("nt,nti,ntj->nij", heard, direction, direction)
    smallest = np.linalg.eigvalsh(information)[:, 0]
    count = heard.sum(axis=1)
    return np.where(count < 20, np.nan, np.sqrt(count / np.fmax(smallest, 1e-9)))


def draw_clock_offset() -> Figure:
    """Draw what a late clock does to ranges, and how well a log tells the offset."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(10.5, 3.8), layout="constrained")
    t_s = np.linspace(-6, 6, 300)
    for late_s, style, colour, label in (
        (0.0, "-", BLUE, "range at the pose's time"),
        (0.5, "--", RED, "stamped 0.5 s late"),
    ):
        range_m = np.hypot(6.0 * (t_s - late_s), 7.0)
        left.plot(t_s, range_m, style, color=colour, lw=2, label=label)
    left.set(xlabel="time since the cone is abeam (s)", ylabel="range (m)",
             title="sketch: 6 m/s, cone 7 m beside the path")  # fmt: skip
    left.legend(fontsize=9)
    offsets_s = np.linspace(-0.6, 1.0, 33)
    for config, style, colour, label in (
        (PRESETS["lane-closure"], "-", BLUE, "speed changes"),
        (STRAIGHT_STEADY, "--", RED, "straight, steady speed"),
    ):
        scene = simulate_pass(config, seed=0)
        cost = misfit_by_offset(scene, offsets_s)
        right.plot(offsets_s, cost - cost.min(), style, color=colour, lw=2, label=label)
        clock = reconstruct(scene).episode.clock
        assert clock is not None
        print(f"clock offset, {label}: {clock.offset_s:+.3f} s, +- {clock.sigma_s:.3f} s, "
              f"{'applied' if clock.applied else 'not applied'}")  # fmt: skip
    right.axvline(0.2, color=INK, lw=1, ls=":")
    right.text(0.22, 0.94, "true offset", transform=right.get_xaxis_transform(), fontsize=9)
    right.set(xlabel="offset that is tried (s)", ylabel="misfit of all ranges (log likelihood)",
              title="simulated logs, clock 0.2 s late")  # fmt: skip
    right.legend(fontsize=9, loc="lower right", bbox_to_anchor=(1.0, 0.08))
    return figure


def misfit_by_offset(scene: Scene, offsets_s: Float64[Array, "K"]) -> Float64[Array, "K"]:
    """Return the negative log likelihood of a log's ranges for each offset."""
    blocks = list(gather_readings(scene))
    at = scene.trajectory.t_s
    cost = []
    for offset_s in offsets_s:
        fits = [
            fit_anchors(scene, block, float(offset_s), 1.5,
                        (block.t_s > at[0] + 1.5) & (block.t_s < at[-1] - 1.5))
            for block in blocks
        ]  # fmt: skip
        cost.append(sum(fit.negative_log_likelihood for fit in fits))
    return np.array(cost)


def draw_range_bias() -> Figure:
    """Draw where a radio that reads too long puts a cone, and what calibration makes of it."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(10.5, 3.8), layout="constrained")
    path_m = lane_change_m(np.linspace(-28, 28, 100), 0.0)
    left.plot(*path_m.T, color=GREY, lw=3, label="path of the tag")
    for k in (25, 50, 74):
        for bias_m, colour, style in ((0.0, BLUE, "-"), (1.5, RED, "--")):
            radius_m = float(np.hypot(*(CONE_M - path_m[k]))) + bias_m
            arc = np.linspace(0, np.pi, 100)
            left.plot(path_m[k, 0] + radius_m * np.cos(arc), radius_m * np.sin(arc),
                      color=colour, lw=1.2, ls=style)  # fmt: skip
    left.plot(*CONE_M, "^", color=BLUE, ms=11, label="cone")
    left.plot(0.0, 9.0, "s", mfc="none", mec=RED, mew=2, ms=10, label="where it seems to be")
    left.set(xlim=(-22, 22), ylim=(-2, 17), aspect="equal", xlabel="along (m)",
             ylabel="across (m)", title="sketch: ranges 1.5 m too long")  # fmt: skip
    left.legend(fontsize=8, loc="upper right")
    for back, colour, style, label in (
        (False, RED, "--o", "one pass"),
        (True, BLUE, "-s", "there and back, on both carriageways"),
    ):
        found = [mean_error_m(biased_pass(float(bias_m), back=back)) for bias_m in BIASES_M]
        error_m, bias_error_m, inside, semi_axis_m = np.array(found).T
        right.plot(100 * BIASES_M, 100 * error_m, style, color=colour, lw=2, label=label)
        print(f"{label}: cones off by {100 * error_m.min():.0f} to {100 * error_m.max():.0f} cm on "
              f"average, bias found to {100 * bias_error_m.max():.0f} cm or better")  # fmt: skip
        for k in (1, 4):
            print(f"  {100 * BIASES_M[k]:.0f} cm: 90 % ellipses of {semi_axis_m[k]:.1f} m hold "
                  f"{100 * inside[k]:.0f} %")  # fmt: skip
    right.set(xlabel="bias of all ranges (cm)", ylabel="mean error of the cones (cm)",
              ylim=(0, None), title="simulated lane closures, bias found from the log")  # fmt: skip
    right.legend(fontsize=9)
    return figure


def biased_pass(bias_m: float, *, back: bool) -> PassConfig:
    """Return the default pass with radios that read too long, or a drive there and back."""
    default = PRESETS["lane-closure"]
    drive = {"turn_after_m": 40.0, "duration_s": 150.0, "ahead_m": -100.0} if back else {}
    return default.model_copy(
        update={
            "ranging": default.ranging.model_copy(update={"bias_m": bias_m}),
            "drive": default.drive.model_copy(update=drive),
        }
    )


def mean_error_m(config: PassConfig) -> tuple[float, ...]:
    """Return the mean error of the cones, each on its better side, and of the bias at 10 m.

    Then what the cones' ellipses say: the share that they hold, and their median longer semi-axis.
    """
    errors, bias_errors, inside, semi_axes_m = [], [], [], []
    for seed in range(N_PASSES):
        scene = simulate_pass(config, seed)
        assert scene.truth is not None
        result = reconstruct(scene)
        assert result.episode.calibration is not None
        # What lost lines of sight add on average counts as bias for a cone, so near it is enough.
        bias_errors.append(abs(result.episode.calibration.bias[0] - config.ranging.bias_m))
        for anchor, true_m in zip(result.anchors, scene.truth.anchor_m, strict=True):
            off_m = np.stack([anchor.position_m, anchor.mirror_position_m]) - true_m
            better = int(np.nanargmin(np.linalg.norm(off_m, axis=1)))
            covariance_m2 = (anchor.covariance_m2, anchor.mirror_covariance_m2)[better]
            errors.append(float(np.linalg.norm(off_m[better])))
            distance = off_m[better] @ np.linalg.solve(covariance_m2, off_m[better])
            inside.append(float(distance < CHI_SQUARE_90))
            semi_axes_m.append(anchor.semi_axes_90_m[0])
    means = (float(np.mean(values)) for values in (errors, bias_errors, inside))
    return *means, float(np.median(semi_axes_m))


def print_effects() -> None:
    """Print what the other numbers on the pages rest on."""
    scene = read("sim:lane-closure")
    assert scene.truth is not None
    trusted = PipelineConfig(alignment=AlignmentConfig(clock_offset="off"))
    for label, settings in (("found", PipelineConfig()), ("ignored", trusted)):
        result = reconstruct(scene, settings)
        off_m = np.stack([a.position_m for a in result.anchors]) - scene.truth.anchor_m
        print(f"clock offset of 0.2 s {label}: cones off by "
              f"{float(np.linalg.norm(off_m, axis=1).mean()):.2f} m on average")  # fmt: skip


def save(name: str, draw: Callable[[], Figure]) -> None:
    """Draw and write one picture."""
    figure = draw()
    figure.savefig(OUT / f"{name}.png", dpi=110, metadata={"Software": None})
    plt.close(figure)
    print(f"wrote {OUT / name}.png")


def main() -> None:
    """Draw all pictures."""
    OUT.mkdir(parents=True, exist_ok=True)
    save("mirror-side", draw_mirror_side)
    save("mirror-misfit", draw_mirror_misfit)
    save("geometry", draw_geometry)
    save("clock-offset", draw_clock_offset)
    save("range-bias", draw_range_bias)
    print_effects()


if __name__ == "__main__":
    main()
