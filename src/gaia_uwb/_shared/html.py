"""What notebooks show of an object (``_repr_html_``): a few facts, a small picture, a table.

Everything is escaped here and nowhere else. The picture is inline SVG in the colours of the page,
so that it is readable on light and on dark.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from gaia_uwb._shared.arrays import Array, Float64
from gaia_uwb._shared.levels import CHI_SQUARE_90
from gaia_uwb._shared.text import in_html

_MOST_ROWS = 20
_MOST_POINTS = 300  # of a path: more than the picture has pixels for
_WIDTH, _HEIGHT, _MARGIN = 360.0, 220.0, 24.0
_CONE, _WARNING, _ZONE = "#0072b2", "#d55e00", "#f0e442"


@dataclass(frozen=True)
class Mark:
    """A place in the picture.

    Parameters
    ----------
    name
        The text next to it.
    place_m : (2,)
        East and north, in metres.
    covariance_m2 : (2, 2), optional
        Drawn as a 90 % ellipse where it is finite.
    good
        Whether it has the usual colour, or that of a warning.
    """

    name: str
    place_m: Float64[Array, "2"]
    covariance_m2: Float64[Array, "2 2"] | None = None
    good: bool = True


def summary(
    title: str,
    facts: Iterable[str],
    picture: str = "",
    *,
    head: Sequence[str] = (),
    rows: Sequence[Sequence[str]] = (),
) -> str:
    """Return an object's summary as HTML.

    Parameters
    ----------
    title, facts
        Plain text, a line each.
    picture
        What :func:`sketch` returned.
    head, rows
        A table of plain text; of many rows, only the first are shown.
    """
    lines = [
        f"<strong>{in_html(title)}</strong>",
        *(f"<div>{in_html(fact)}</div>" for fact in facts),
    ]
    if rows:
        cells = [f"<th>{in_html(name)}</th>" for name in head]
        body = [
            "<tr>" + "".join(f"<td>{in_html(cell) if cell else ''}</td>" for cell in row) + "</tr>"
            for row in rows[:_MOST_ROWS]
        ]
        table = f"<table><thead><tr>{''.join(cells)}</tr></thead><tbody>{''.join(body)}</tbody>"
        lines += [picture, f"{table}</table>"]
        if len(rows) > _MOST_ROWS:
            lines.append(f"<div>and {len(rows) - _MOST_ROWS} more</div>")
    else:
        lines.append(picture)
    return f"<div>{''.join(lines)}</div>"


def sketch(
    *paths_m: Float64[Array, "_ 2"],
    area_m: Float64[Array, "K 2"] | None = None,
    marks: Sequence[Mark] = (),
) -> str:
    """Return a top view as inline SVG, north up, one scale for both directions.

    Parameters
    ----------
    paths_m : (T, 2)
        The path of each drive, in metres; at least one.
    area_m : (K, 2), optional
        Corners of an area, filled.
    marks
        Places; the picture shows them all, and of the paths what is near.
    """
    shown_m = np.array([mark.place_m for mark in marks]).reshape(-1, 2)
    shown_m = shown_m if marks else np.concatenate(paths_m)
    low_m, high_m = shown_m.min(axis=0), shown_m.max(axis=0)
    room = np.array([_WIDTH, _HEIGHT]) - 2.0 * _MARGIN
    scale = float(np.min(room / np.maximum(high_m - low_m, 1.0)))
    middle_m = (low_m + high_m) / 2.0

    def pixels(points_m: Float64[Array, "K 2"]) -> Float64[Array, "K 2"]:
        moved = (points_m - middle_m) * [scale, -scale]
        return np.asarray(moved + np.array([_WIDTH, _HEIGHT]) / 2.0)

    parts = []
    if area_m is not None and len(area_m) > 2:
        corners = _points(pixels(area_m))
        parts.append(f'<polygon points="{corners}" fill="{_ZONE}" fill-opacity="0.5"/>')
    for path_m in paths_m:
        thinned_m = path_m[:: max(1, -(-len(path_m) // _MOST_POINTS))]
        inside = np.clip(pixels(thinned_m), -2000.0, 2000.0)
        parts.append(
            f'<polyline points="{_points(inside)}" fill="none" stroke="currentColor" '
            'stroke-opacity="0.55" stroke-width="1.5"/>'
        )
    places = pixels(np.array([mark.place_m for mark in marks]).reshape(-1, 2))
    parts += [_mark(mark, at, scale) for mark, at in zip(marks, places, strict=True)]
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{_WIDTH:g}" height="{_HEIGHT:g}" '
        f'viewBox="0 0 {_WIDTH:g} {_HEIGHT:g}" role="img" style="max-width:100%">'
        f"{''.join(parts)}</svg>"
    )


def _points(pixels: Float64[Array, "K 2"]) -> str:
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in pixels.tolist())


def _mark(mark: Mark, at: Float64[Array, "2"], scale: float) -> str:
    colour = _CONE if mark.good else _WARNING
    x, y = at.tolist()
    ellipse = ""
    covariance_m2 = mark.covariance_m2
    if covariance_m2 is not None and np.isfinite(covariance_m2).all():
        # The image of the unit circle under a root of the covariance is the ellipse; y points down.
        value, axes = np.linalg.eigh(covariance_m2)
        root = (
            np.sqrt(CHI_SQUARE_90)
            * scale
            * axes
            * np.sqrt(np.maximum(value, 0.0))
            * np.array([[1.0], [-1.0]])
        )
        matrix = " ".join(f"{part:.3f}" for part in (*root[:, 0], *root[:, 1], x, y))
        ellipse = (
            f'<circle r="1" transform="matrix({matrix})" fill="{colour}" fill-opacity="0.2" '
            f'stroke="{colour}" vector-effect="non-scaling-stroke"/>'
        )
    end = x > 0.75 * _WIDTH
    return (
        f'{ellipse}<circle cx="{x:.1f}" cy="{y:.1f}" r="3.5" fill="{colour}"/>'
        f'<text x="{x + (-6 if end else 6):.1f}" y="{y - 5:.1f}" font-size="11" '
        f'fill="currentColor" text-anchor="{"end" if end else "start"}">'
        f"{in_html(_short(mark.name))}</text>"
    )


def _short(name: str) -> str:
    return name if len(name) <= 14 else f"{name[:13]}…"
