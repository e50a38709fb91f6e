"""Draw the gallery of work zones in ``docs/images/zones``: one picture per kind, all in road view.

Run ``python benchmarks/pictures/gallery.py``; every picture shows a pass that the simulator made.
"""

from __future__ import annotations

from pathlib import Path
from typing import get_args

import matplotlib as mpl

mpl.use("Agg")

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes

from gaia_uwb.simulate import (
    ClosureConfig,
    DriveConfig,
    PassConfig,
    RangingConfig,
    RoadConfig,
    Setting,
    ZoneKind,
    road_to_local,
    set_up,
    simulate_episode,
)

OUT = Path(__file__).parents[2] / "docs" / "images" / "zones"
SEED = 4
LIMIT_MPH = {"median-crossover": 45, "shoulder-closure": 55}  # short tapers elsewhere


def pass_of(kind: ZoneKind) -> PassConfig:
    """Return a pass through a zone of this kind, with obstacles."""
    return PassConfig(
        road=RoadConfig(
            direction_rad=0.1,
            curvature_per_m=0.0 if kind == "median-crossover" else -0.001,
            s_curve=kind == "lane-shift",
            speed_limit_mph=LIMIT_MPH.get(kind, 30),
        ),
        closure=ClosureConfig(
            kind=kind,
            n_anchors=12,
            both_sides=kind in ("lane-shift", "median-crossover"),
            n_trucks=2,
            n_crew=3,
            sign_spacing_m=30.0,
        ),
        drive=DriveConfig(speed_mps=10.0),
        ranging=RangingConfig(los_s=None, max_range_m=1000.0, clock_offset_s=0.0),
    )


def draw(axes: Axes, kind: ZoneKind) -> None:
    """Draw one zone: cones with anchors, the path, obstacles, and lines of sight that were cut."""
    config = pass_of(kind)
    setting = set_up(config, SEED, 0)
    episode = simulate_episode(config, SEED)
    assert episode.truth is not None
    plan, anchor_m = setting.plan, setting.anchor_m
    draw_road(axes, setting)
    inside = plan.sign_along_m[0] - 20
    path_m = episode.position_m
    axes.plot(*path_m.T, color="tab:blue", lw=1.2, label="path of the vehicle")
    for step in range(0, episode.n_steps, 12):
        for n in np.flatnonzero(episode.truth.nlos[step]):
            axes.plot(*np.stack([path_m[step], anchor_m[n]]).T, color="0.75", lw=0.4, zorder=0)
    corners = setting.obstacles.start_m, setting.obstacles.end_m
    k = len(corners[0]) // 2
    for a, b in zip(range(k), range(k, 2 * k), strict=True):
        box = np.array([corners[0][a], corners[1][b], corners[1][a], corners[0][b]])
        axes.fill(*box.T, color="0.25", label="truck or person" if a == 0 else None)
    signs = road_to_local(config.road, plan.sign_along_m, np.full(3, -config.road.lane_width_m - 2))
    axes.plot(*signs.T, "D", color="tab:orange", ms=5, label="sign of the advance warning")
    axes.plot(*anchor_m.T, "^", color="tab:red", ms=6, label="cone with an anchor")
    ends = np.array([inside, plan.end_m + 60])
    east, north = road_to_local(config.road, ends, np.zeros(2)).T
    axes.set_xlim(east.min(), east.max())
    shown = path_m[(path_m[:, 0] > east.min()) & (path_m[:, 0] < east.max())]
    heights_m = np.concatenate([north, anchor_m[:, 1], shown[:, 1]])
    axes.set_ylim(heights_m.min() - 20, heights_m.max() + 8)
    axes.set(xlabel="east (m)", ylabel="north (m), enlarged", title=kind)
    axes.legend(fontsize=7, loc="lower right")


def draw_road(axes: Axes, setting: Setting) -> None:
    """Draw the road's lanes and the line of cones."""
    road, plan = setting.config.road, setting.plan
    along_m = np.linspace(plan.sign_along_m[0] - 30, plan.end_m + 80, 400)
    lines = [(-1.0, "-"), (0.0, "--"), (1.0, "-")]
    if setting.config.closure.kind == "median-crossover":
        over = setting.config.closure.median_m / road.lane_width_m
        lines += [(over + 1, "-"), (over + 2, "--"), (over + 3, "-")]
    for across, style in lines:
        line = road_to_local(road, along_m, np.full(400, across * road.lane_width_m))
        axes.plot(*line.T, color="0.5", lw=0.8, ls=style)
    zone_m = np.linspace(0, plan.end_m, 300)
    cones = road_to_local(road, zone_m, plan.edge_m(zone_m))
    axes.plot(*cones.T, color="tab:red", lw=0.8, ls=":", label="line of cones")


def main() -> None:
    """Draw all kinds."""
    OUT.mkdir(parents=True, exist_ok=True)
    for kind in get_args(ZoneKind):
        figure, axes = plt.subplots(figsize=(9, 3.2), layout="constrained")
        draw(axes, kind)
        figure.savefig(OUT / f"{kind}.png", dpi=110, metadata={"Software": None})
        plt.close(figure)
        print(f"wrote {OUT / kind}.png")


if __name__ == "__main__":
    main()
