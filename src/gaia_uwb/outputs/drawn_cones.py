"""The located cones in a picture: their colours, places, ellipses and names."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from gaia_uwb._shared import CHI_SQUARE_90, SCREEN_DPI, Array, Float64, printable
from gaia_uwb.reconstruction import Reconstruction
from gaia_uwb.roadside import RoadLine

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Okabe and Ito's palette for all kinds of colour vision, without its yellow, faint on paper.
_COLOURS = ("#0072B2", "#E69F00", "#009E73", "#D55E00", "#56B4E9", "#CC79A7", "#000000")
_DASHES = ("-", "--", ":", "-.")
N_LOOKS = len(_COLOURS) * len(_DASHES)
"""After so many cones, the next looks like the first."""
PATH, ZONE, WARNING, INK, TAPER = "#9A9A9A", "#F0E442", "#B3400A", "#222222", "#009E73"
_NAME_POINTS = 8.5  # font size of the cones' names


@dataclass(frozen=True)
class DrawnCones:
    """The located anchors, ready to draw."""

    names: list[str]
    colours: list[str]
    position_m: Float64[Array, "K 2"]
    ellipse_m: Float64[Array, "K E 2"]
    """Points on the 90 % ellipses; NaN where a covariance is unknown."""
    mirror_m: Float64[Array, "M 2 2"]
    """Both places of the anchors whose side is open: the chosen one, the other one."""
    mirror_ellipse_m: Float64[Array, "M E 2"]
    """Points on the 90 % ellipses about the other ones."""

    @classmethod
    def of(cls, reconstruction: Reconstruction) -> DrawnCones:
        """Return the located anchors of a reconstruction."""
        fixes = [(k, f) for k, f in enumerate(reconstruction.anchors) if f.status.has_position]
        position_m = np.array([f.position_m for _, f in fixes]).reshape(-1, 2)
        covariance_m2 = np.array([f.covariance_m2 for _, f in fixes]).reshape(-1, 2, 2)
        mirrored = [f for _, f in fixes if f.side_is_open]
        both_m = np.array([[f.position_m, f.mirror_position_m] for f in mirrored]).reshape(-1, 2, 2)
        mirror_m2 = np.array([f.mirror_covariance_m2 for f in mirrored]).reshape(-1, 2, 2)
        return cls(
            names=[f.anchor_id for _, f in fixes],
            colours=[look(k)[0] for k, _ in fixes],
            position_m=position_m,
            ellipse_m=position_m[:, None] + _ellipses(covariance_m2),
            mirror_m=both_m,
            mirror_ellipse_m=both_m[:, 1, None] + _ellipses(mirror_m2),
        )

    def along(self, line: RoadLine) -> DrawnCones:
        """Return the same with stations and offsets along a road for east and north."""
        position_m, mirror_m = line.locate(self.position_m), line.locate(self.mirror_m)
        off_m = self.ellipse_m - self.position_m[:, None]
        mirror_off_m = self.mirror_ellipse_m - self.mirror_m[:, 1, None]
        return replace(
            self,
            position_m=position_m,
            ellipse_m=position_m[:, None] + _turned(line, position_m[:, 0], off_m),
            mirror_m=mirror_m,
            mirror_ellipse_m=mirror_m[:, 1, None] + _turned(line, mirror_m[:, 1, 0], mirror_off_m),
        )

    def extent_m(self) -> Float64[Array, "P 2"]:
        """Return points that a picture of the zone must show; a hopeless ellipse is not one."""
        if not self.names:
            return self.position_m
        places_m = np.concatenate([self.position_m, self.mirror_m[:, 1]])
        reach_m = max(float(np.ptp(places_m, axis=0).max()), 2.0)
        away_m = np.abs(self.ellipse_m - self.position_m[:, None]).max(axis=2)
        return np.concatenate([places_m, self.ellipse_m[away_m < reach_m]])


def _turned(
    line: RoadLine, station_m: Float64[Array, "K"], off_m: Float64[Array, "K E 2"]
) -> Float64[Array, "K E 2"]:
    """Return steps to east and north as steps along the road and to its left, at stations."""
    ends_m = [line.place(station_m + step_m, np.zeros_like(station_m)) for step_m in (-0.5, 0.5)]
    ahead = ends_m[1] - ends_m[0]
    ahead /= np.hypot(*ahead.T)[:, None]
    left = np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)
    return np.asarray(off_m @ np.stack([ahead, left], axis=2))


def _ellipses(covariance_m2: Float64[Array, "K 2 2"]) -> Float64[Array, "K E 2"]:
    """Return points on the 90 % ellipses about the origin; NaN where a covariance is unknown."""
    known = np.asarray(np.isfinite(covariance_m2).all(axis=(1, 2)))
    variance_m2, axis = np.linalg.eigh(np.where(known[:, None, None], covariance_m2, 0.0))
    angle = np.linspace(0.0, 2.0 * np.pi, 49)
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    semi_m = np.sqrt(CHI_SQUARE_90 * np.maximum(variance_m2, 0.0))
    semi_m[~known] = np.nan
    return np.asarray((circle * semi_m[:, None]) @ np.swapaxes(axis, 1, 2))


def look(k: int) -> tuple[str, str]:
    """Return colour and dashes of the k-th anchor's curve."""
    return _COLOURS[k % len(_COLOURS)], _DASHES[k // len(_COLOURS) % len(_DASHES)]


def name_cones(axes: Axes, cones: DrawnCones, avoid_m: Float64[Array, "P 2"]) -> None:
    """Write each cone's name next to its ellipse, where it covers no mark and no other name.

    A name without room is omitted.
    """
    unit = SCREEN_DPI / 72.0 * _NAME_POINTS
    to_pixel, to_metre = axes.transData.transform, axes.transData.inverted().transform
    pixel = to_pixel(cones.position_m)
    ellipse = to_pixel(cones.ellipse_m.reshape(-1, 2)).reshape(cones.ellipse_m.shape)
    reach = np.abs(np.nan_to_num(ellipse - pixel[:, None])).max(axis=1)
    reach = np.clip(reach, 0.4 * unit, 1.6 * unit) + 0.3 * unit
    marks = to_pixel(np.concatenate([cones.position_m, avoid_m]))
    taken = np.concatenate([marks - 0.4 * unit, marks + 0.4 * unit], axis=1)
    west, south, east, north = axes.bbox.extents
    for k, name in enumerate(cones.names):
        text = short_name(name, 14)
        half = np.array([0.32 * len(text), 0.5]) * unit
        outward = _AROUND @ (pixel[k] - pixel.mean(axis=0))
        for direction in _AROUND[np.argsort(-outward, kind="stable")]:
            x, y = centre = pixel[k] + direction * (reach[k] + half)
            box = np.array([x - half[0], y - half[1], x + half[0], y + half[1]])
            apart = (taken[:, :2] >= box[2:]) | (taken[:, 2:] <= box[:2])
            inside = west < box[0] and south < box[1] and box[2] < east and box[3] < north
            if inside and apart.any(axis=1).all():
                taken = np.concatenate([taken, box[None]])
                east_m, north_m = to_metre(centre)
                axes.text(east_m, north_m, text, size=_NAME_POINTS, color=cones.colours[k],
                          weight="bold", ha="center", va="center_baseline", parse_math=False,
                          zorder=8)  # fmt: skip
                break


# Directions in which a name may stand from its cone.
_AROUND = np.array([[1, 0], [-1, 0], [0, 1], [0, -1], [1, 1], [-1, 1], [1, -1], [-1, -1]], float)
_AROUND[4:] *= 0.75


def tidy(axes: Axes) -> None:
    """Give a panel a faint grid and small grey numbers."""
    axes.grid(color="#E3E3E3", lw=0.6)
    axes.set_axisbelow(True)
    axes.tick_params(labelsize=8, color=PATH)
    axes.spines[:].set_color(PATH)


def short_name(text: str, longest: int) -> str:
    """Return a text on one line, as long as a picture has room for."""
    flat = printable(text)  # fonts have no letters for the rest, and XML forbids some of it
    return flat if len(flat) <= longest else f"{flat[: longest - 1]}…"
