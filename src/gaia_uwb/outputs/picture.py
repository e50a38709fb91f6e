"""The reconstruction as one picture: the site from above, and the ranges over time.

matplotlib is loaded when a picture is made, and without ``pyplot``, so there is no global state.
Anchors that share a colour share their artists: a thousand anchors cost as few as seven.
"""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import wrap
from typing import TYPE_CHECKING, Any

import numpy as np

from gaia_uwb._shared import SCREEN_DPI, Array, Float64, plain_style
from gaia_uwb.estimate import BoundaryStatus
from gaia_uwb.locate import end_to_end, starts_s
from gaia_uwb.outputs.drawn_cones import (
    INK,
    N_LOOKS,
    PATH,
    WARNING,
    ZONE,
    DrawnCones,
    look,
    name_cones,
    short_name,
    tidy,
)
from gaia_uwb.outputs.road_words import edges_words, hull_leads
from gaia_uwb.outputs.strip import draw_strip, draw_zones, needs_strip
from gaia_uwb.reconstruction import Reconstruction, ReconstructionStatus
from gaia_uwb.zone import BoundaryUncertainty

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_INNER, _OUTER = "#009E73", "#7A4FA3"

_SIZE_IN = (10.0, 9.0)
_MOST_RANGES = 100_000  # more dots than this the picture has no pixels for
_MOST_NAMES = 12
_ROW_LETTERS, _HANDLE_LETTERS = 155, 8  # of a row of the legend, and as wide as a handle in it
_LINE_LETTERS, _LETTERS = 136, 400  # of a line below the title, and of all


@plain_style()
def plot_reconstruction(
    reconstruction: Reconstruction, truth_m: Float64[Array, "N 2"] | None = None
) -> Figure:
    """Draw the site, the ranges over time, and what the denoiser changed.

    The site is seen from above. Where the drive is far longer than the work zone, a close-up of the
    zone is drawn next to it; where the zone itself is a long row, the road is straightened there.

    Parameters
    ----------
    reconstruction
        What to draw.
    truth_m : (N, 2), optional
        True east and north of the anchors, in metres, marked by crosses.

    Returns
    -------
    matplotlib.figure.Figure
        Ten by nine inches. It belongs to no window and no global state.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=_SIZE_IN, dpi=SCREEN_DPI)
    _write_title(figure, reconstruction)
    cones = DrawnCones.of(reconstruction)
    known_m = np.empty((0, 2)) if truth_m is None else truth_m
    zone_m = np.concatenate([cones.extent_m(), known_m])
    drawn_m = np.empty((0, 2))  # what names must not cover
    paths_m = [episode.position_m for episode, _ in reconstruction.passes]
    drive_m = np.concatenate([*paths_m, zone_m])
    road = reconstruction.road_boundary
    if road is not None and needs_strip(road):
        overview = _add_site(figure, (0.77, 0.51, 0.21, 0.39), drive_m)
        overview.set_title("from above", size=9, loc="left", pad=3)
        _draw_site(overview, reconstruction, cones)
        axes = figure.add_axes((0.07, 0.51, 0.63, 0.39))
        cones, known_m = cones.along(road.line), road.line.locate(known_m)
        drawn_m = draw_strip(axes, road, cones)
        axes.set_title("along the road, drawn wider than it is", size=9, loc="left", pad=3)
    elif len(zone_m) and np.ptp(drive_m, axis=0).max() > 3.0 * np.ptp(zone_m, axis=0).max():
        overview = _add_site(figure, (0.07, 0.51, 0.39, 0.39), drive_m)
        axes = _add_site(figure, (0.535, 0.51, 0.445, 0.39), zone_m)
        _draw_site(overview, reconstruction, cones)
        _mark_close_up(overview, axes)
        _draw_site(axes, reconstruction, cones)
    else:
        axes = _add_site(figure, (0.07, 0.51, 0.91, 0.39), drive_m)
        _draw_site(axes, reconstruction, cones)
    if len(known_m):
        axes.plot(*known_m.T, "x", color=INK, ms=6, mew=1, label="true position", zorder=7)
    name_cones(axes, cones, avoid_m=np.concatenate([cones.mirror_m[:, 1], known_m, drawn_m]))
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="upper center", bbox_to_anchor=(0.5, 0.476),
                  ncols=-(-len(labels) // _rows_of(labels)),
                  fontsize=8, frameon=False)  # fmt: skip
    _draw_ranges(figure, reconstruction)
    return figure


def _rows_of(labels: Sequence[str]) -> int:
    """Return how many rows a legend takes, so that no row is wider than the picture."""
    return 1 + (sum(len(label) + _HANDLE_LETTERS for label in labels) > _ROW_LETTERS)


def _write_title(figure: Figure, reconstruction: Reconstruction) -> None:
    located = sum(anchor.status.has_position for anchor in reconstruction.anchors)
    boundary, status = reconstruction.boundary, reconstruction.status
    area = f"{boundary.area_m2:.1f} m²" if boundary.status is BoundaryStatus.OK else "no area"
    n_cones = len(reconstruction.anchors)
    found = f"all {n_cones}" if located == n_cones > 1 else f"{located} of {n_cones}"
    summary = f"{found} cones located, boundary: {area}"
    road = reconstruction.road_boundary
    if road is not None and not hull_leads(road):
        zones = [edges_words(zone) for zone in road.zones]
        told = zones[0] if len(zones) == 1 else f"There are {len(zones)} work zones."
        summary = f"{found[:1].upper()}{found[1:]} cones located. {told}"
    colour = INK
    if status is not ReconstructionStatus.OK:
        summary = f"{status.value.upper()}: {'; '.join(map(str, reconstruction.reasons))}"
        colour = WARNING
    name = short_name(reconstruction.name, 80)
    figure.text(0.07, 0.968, name, size=13, weight="bold", color=INK, parse_math=False)
    lines = wrap(short_name(summary, _LETTERS), _LINE_LETTERS, max_lines=2, placeholder="…")
    for k, line in enumerate(lines):
        place = (0.07, 0.945 - 0.018 * k)
        figure.text(*place, line, size=9.0, color=colour, parse_math=False)


def _add_site(
    figure: Figure, box: tuple[float, float, float, float], shown_m: Float64[Array, "P 2"]
) -> Axes:
    """Add a top view that shows all points with a margin, in one scale for both directions."""
    low_m, high_m = shown_m.min(axis=0), shown_m.max(axis=0)
    size_in = np.array(box[2:]) * _SIZE_IN
    metres_per_inch = np.max(np.maximum(high_m - low_m, 1.0) / (0.84 * size_in))
    centre_m, half_m = (low_m + high_m) / 2.0, metres_per_inch * size_in / 2.0
    (west_m, south_m), (east_m, north_m) = centre_m - half_m, centre_m + half_m
    axes = figure.add_axes(box)
    axes.set(xlim=(west_m, east_m), ylim=(south_m, north_m), aspect="equal")
    axes.set_xlabel("east (m)", size=9)
    axes.set_ylabel("north (m)", size=9)
    tidy(axes)
    return axes


def _mark_close_up(overview: Axes, close_up: Axes) -> None:
    (west_m, east_m), (south_m, north_m) = close_up.get_xlim(), close_up.get_ylim()
    corners_east_m = [west_m, east_m, east_m, west_m, west_m]
    corners_north_m = [south_m, south_m, north_m, north_m, south_m]
    overview.plot(corners_east_m, corners_north_m, color=INK, lw=0.9, zorder=8)
    overview.set_title("the drive", size=9, loc="left", pad=3)
    close_up.set_title("the work zone (the box on the left)", size=9, loc="left", pad=3)


def _draw_site(axes: Axes, reconstruction: Reconstruction, cones: DrawnCones) -> None:
    from matplotlib.collections import LineCollection, PolyCollection

    for k, (episode, _) in enumerate(reconstruction.passes):
        path, start = ("path of the vehicle's antenna", "start") if k == 0 else (None, None)
        axes.plot(*episode.position_m.T, color=PATH, lw=1.2, label=path, zorder=1)
        axes.plot(*episode.position_m[0], "s", color=PATH, ms=6, label=start, zorder=1)
    road = reconstruction.road_boundary
    if road is not None and not hull_leads(road):
        draw_zones(axes, road)
    else:
        _draw_hull(axes, reconstruction)
    if cones.names:
        ellipses = PolyCollection(list(cones.ellipse_m), label="90 % ellipse", zorder=4)
        ellipses.set(facecolors=[f"{colour}30" for colour in cones.colours], lw=1.0)
        ellipses.set_edgecolor(cones.colours)
        axes.add_collection(ellipses, autolim=False)
        east_m, north_m = cones.position_m.T
        axes.scatter(east_m, north_m, s=14, c=cones.colours, label="cone", zorder=6)
    if len(cones.mirror_m):
        links = LineCollection(list(cones.mirror_m), colors=WARNING, ls=":", lw=0.9, zorder=4)
        axes.add_collection(links, autolim=False)
        around = PolyCollection(list(cones.mirror_ellipse_m), facecolors="none", ls=":", lw=0.8)
        around.set(edgecolors=WARNING, zorder=4)
        axes.add_collection(around, autolim=False)
        east_m, north_m = cones.mirror_m[:, 1].T
        axes.plot(east_m, north_m, "o", mfc="white", mec=WARNING, ms=5.5, zorder=5,
                  label="other possible position of a cone")  # fmt: skip


def _draw_hull(axes: Axes, reconstruction: Reconstruction) -> None:
    """Draw the hull, the outline and the hull's regions."""
    boundary = reconstruction.boundary
    if boundary.status is BoundaryStatus.OK:
        axes.fill(*boundary.hull_m.T, color=ZONE, alpha=0.4, lw=0, label="boundary", zorder=2)
        closed_m = np.concatenate([boundary.outline_m, boundary.outline_m[:1]])
        axes.plot(*closed_m.T, "--", color=INK, lw=0.9, label="outline of the cones", zorder=3)
    if reconstruction.boundary_uncertainty is not None:
        _draw_regions(axes, reconstruction.boundary_uncertainty)


def _draw_regions(axes: Axes, found: BoundaryUncertainty) -> None:
    """Draw the outlines of the inner and the outer region."""
    from matplotlib.collections import PolyCollection

    for region, colour, label in (
        (found.inner, _INNER, "inside the zone (90 %)"),
        (found.outer, _OUTER, "contains the zone (90 %)"),
    ):
        rings_m = [ring for rings in region.polygons for ring in rings]
        if rings_m:
            lines = PolyCollection(rings_m, facecolors="none", edgecolors=colour, lw=1.2)
            lines.set(label=label, zorder=3, ls="-" if colour == _INNER else "-.")
            axes.add_collection(lines, autolim=False)


def _draw_ranges(figure: Figure, reconstruction: Reconstruction) -> None:
    episodes = [each for each, _ in reconstruction.passes]
    episode, denoised = end_to_end(episodes, [ranges for _, ranges in reconstruction.passes])
    upper = figure.add_axes((0.07, 0.215, 0.79, 0.205))
    lower = figure.add_axes((0.07, 0.055, 0.79, 0.13), sharex=upper)
    every = slice(None, None, -(-episode.range_m.size // _MOST_RANGES))
    t_s = np.append(episode.t_s[every] - episode.t_s[0], np.nan)
    raw_m, clean_m = episode.range_m[every], denoised.range_m[every]
    change_m, bound_m = _bounded(raw_m - clean_m)
    dots: dict[str, Any] = {"ls": "", "marker": ".", "ms": 3.5, "mew": 0, "alpha": 0.5}
    dots["rasterized"] = True  # in an SVG: tens of thousands of them are no drawing to edit
    for first in range(min(episode.n_anchors, N_LOOKS)):
        same = slice(first, None, N_LOOKS)
        colour, dashes = look(first)
        time_s = np.tile(t_s, raw_m[:, same].shape[1])
        upper.plot(time_s, _joined(raw_m[:, same]), color=colour, **dots)
        upper.plot(time_s, _joined(clean_m[:, same]), color=colour, ls=dashes, lw=1.0)
        lower.plot(time_s, _joined(change_m[:, same]), color=colour, **dots)
    lower.axhline(0.0, color=INK, lw=0.6)
    for start_s in starts_s(episodes)[1:]:
        upper.axvline(start_s, color=INK, lw=0.6)
        lower.axvline(start_s, color=INK, lw=0.6)
    upper.set_ylabel("range (m)", size=9)
    when = "time since the start (s)"
    if reconstruction.more_passes:
        when = "time, passes one after another (s)"
    lower.set_ylabel("raw − denoised (m)", size=9)
    lower.set_ylim(-1.1 * bound_m, 1.1 * bound_m)
    lower.set_xlabel(when, size=9)
    upper.tick_params(labelbottom=False)
    upper.set_xlim(0.0, max(float(episode.t_s[-1] - episode.t_s[0]), 1e-3))
    tidy(upper)
    tidy(lower)
    _name_colours(upper, episode.anchor_ids)


def _bounded(change_m: Float64[Array, "T N"]) -> tuple[Float64[Array, "T N"], float]:
    """Move the largest changes to a bound, so that a few spikes do not hide all the others."""
    sizes_m = np.abs(change_m[np.isfinite(change_m)])
    bound_m = max(2.0 * float(np.quantile(sizes_m, 0.98)), 0.05) if sizes_m.size else 1.0
    return np.clip(change_m, -bound_m, bound_m), bound_m


def _joined(values: Float64[Array, "T n"]) -> Float64[Array, "S"]:
    """Return all columns as one line, broken by NaN between them: one artist draws them all."""
    return np.pad(values, ((0, 1), (0, 0)), constant_values=np.nan).T.ravel()


def _name_colours(axes: Axes, anchor_ids: Sequence[str]) -> None:
    from matplotlib.lines import Line2D

    handles = [
        Line2D([], [], color=PATH, marker=".", ls=""),
        Line2D([], [], color=PATH, lw=1.0),
    ]
    names = ["raw", "denoised"]
    for k, anchor_id in enumerate(anchor_ids[:_MOST_NAMES]):
        colour, dashes = look(k)
        handles.append(Line2D([], [], color=colour, ls=dashes, lw=4 if dashes == "-" else 2))
        names.append(short_name(anchor_id, 14))
    if len(anchor_ids) > _MOST_NAMES:
        handles.append(Line2D([], [], ls=""))
        names.append(f"and {len(anchor_ids) - _MOST_NAMES} more")
    legend = axes.legend(handles, names, loc="upper left", bbox_to_anchor=(1.0, 1.05),
                         fontsize=8, frameon=False, handlelength=1.2)  # fmt: skip
    for text in legend.get_texts():
        text.set_parse_math(False)
