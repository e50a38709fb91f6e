"""The reconstruction as one HTML file: an interactive map that needs no network and no server.

The page is put together from ``assets/map_page.html``, its style and its scripts, with the data in
between. It draws the features of ``geojson.py`` in local metres, the ranges over time, and shows
the report next to them. Its content security policy forbids it to load anything from anywhere and
to run any script but its own, which it knows by their hash: even a text that got past the escaping
would stay a text.
"""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from gaia_uwb._shared import Array, Float64, printable
from gaia_uwb.estimate import AnchorStatus, SideSource
from gaia_uwb.evaluate import range_residual_m
from gaia_uwb.locate import end_to_end
from gaia_uwb.outputs.map_evidence import map_evidence
from gaia_uwb.outputs.road_words import hull_leads, summary_words, zone_words
from gaia_uwb.reconstruction import Reconstruction

_ASSETS = Path(__file__).parent / "assets"
_SCRIPTS = ("map_data", "map_drawing", "map_view", "map_time", "map_measure", "map_panel")
_MOST_STEPS = 4000  # of the timeline in the page: more than a slider has pixels for
_MOST_RANGES = 60_000  # in the page, which keeps it below a megabyte


def map_page(
    reconstruction: Reconstruction, features: Mapping[str, object], report: Mapping[str, object]
) -> str:
    """Return a self-contained HTML page.

    Parameters
    ----------
    reconstruction
        What to show; its ranges are thinned where there are very many.
    features
        :func:`gaia_uwb.outputs.boundary_geojson` of it in local metres.
    report
        The content of its ``report.json``.
    """
    data = {
        "features": features,
        "report": {
            **report,
            "boundary": _without_grid(report["boundary"]),
            "road_boundary": None,  # it is drawn from the features and told in words
        },
        "road": _road(reconstruction),
        "timeline": _timeline(reconstruction),
        "messages": {status.value: status.message for status in AnchorStatus},
        "sources": {source.value: source.message for source in SideSource},
    }
    text = json.dumps(data, allow_nan=False, separators=(",", ":"))
    # An anchor's id may hold anything, "</script>" included. All that could end the script element
    # or open a comment in it is escaped; json.dumps has escaped everything that is not ASCII.
    for character in "<>&":
        text = text.replace(character, f"\\u{ord(character):04x}")
    style = _asset("map_page.css")
    script = "".join(_asset(f"{name}.js") for name in _SCRIPTS)
    page = _asset("map_page.html")
    for place, content in (
        ("{{STYLE_HASH}}", _hash(style)),
        ("{{SCRIPT_HASH}}", _hash(script)),
        ("{{STYLE}}", style),
        ("{{SCRIPT}}", script),
        ("{{DATA}}", text),  # last, so that no place is looked for in it
    ):
        page = page.replace(place, content)
    return page


def _without_grid(boundary: object) -> object:
    """Return a report's boundary without its probability grid, which would be most of the page."""
    if not isinstance(boundary, Mapping):
        return boundary
    return {name: value for name, value in boundary.items() if name != "uncertainty"}


def _road(reconstruction: Reconstruction) -> dict[str, object] | None:
    """Return in words what a driver sees of the zones; None where the hull is the zone."""
    road = reconstruction.road_boundary
    if road is None or hull_leads(road):
        return None
    words = list(zone_words(reconstruction, printable))
    return {"summary": summary_words(reconstruction), "details": words}


def _asset(name: str) -> str:
    return (_ASSETS / name).read_text(encoding="utf-8")


def _hash(text: str) -> str:
    """Return the name by which a content security policy knows an inline element."""
    digest = hashlib.sha256(text.encode()).digest()
    return f"sha256-{base64.b64encode(digest).decode()}"


def _timeline(reconstruction: Reconstruction) -> dict[str, object]:
    """Return path and ranges over time, each range as whole centimetres and per anchor.

    Places are relative to the first one of the path, like everything that a browser draws. Several
    passes stand one after another; ``starts`` are the steps at which the next one starts.
    """
    episodes = [each for each, _ in reconstruction.passes]
    episode, denoised = end_to_end(episodes, [ranges for _, ranges in reconstruction.passes])
    residual_m = np.concatenate([range_residual_m(e, reconstruction.anchors) for e in episodes])
    starts = np.cumsum([each.n_steps for each in episodes])[:-1]
    most = max(min(_MOST_STEPS, _MOST_RANGES // episode.n_anchors), 2)
    every = slice(None, None, -(-episode.n_steps // most))
    local_m = (episode.position_m - episode.position_m[0])[every]
    return {
        "starts": (-(-starts // every.step)).tolist(),
        "t_s": (episode.t_s - episode.t_s[0])[every].round(2).tolist(),
        "east_m": local_m[:, 0].round(2).tolist(),
        "north_m": local_m[:, 1].round(2).tolist(),
        "range_cm": _centimetres(episode.range_m[every]),
        "denoised_cm": _centimetres(denoised.range_m[every]),
        **map_evidence(episodes, every.step),
        "residual_cm": _centimetres(residual_m[every]),
    }


def _centimetres(values_m: Float64[Array, "T N"]) -> list[list[int | None]]:
    """Return whole centimetres, one list per anchor; None where there is no number."""
    known = np.isfinite(values_m)
    whole = np.where(known, np.round(values_m * 100.0), 0.0).astype(np.int64)
    rows = zip(whole.T.tolist(), known.T.tolist(), strict=True)
    return [[v if k else None for v, k in zip(*row, strict=True)] for row in rows]
