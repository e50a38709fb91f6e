"""The reconstruction as one HTML file: an interactive map that needs no network and no server.

The page is ``assets/map_page.html`` with the data put in. It draws the features of ``geojson.py``
in local metres and shows the report beside them. Its content security policy forbids it to load
anything from anywhere.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

_TEMPLATE = Path(__file__).parent / "assets" / "map_page.html"
_PLACE = "{{DATA}}"


def map_page(features: Mapping[str, object], report: Mapping[str, object]) -> str:
    """Return a self-contained HTML page.

    Parameters
    ----------
    features
        :func:`gaia_uwb.geojson.boundary_geojson` in local metres.
    report
        The content of ``report.json``.
    """
    data = {"features": features, "report": report}
    text = json.dumps(data, allow_nan=False, separators=(",", ":"))
    # An anchor's id may hold anything, "</script>" included. All that could end the script element
    # or open a comment in it is escaped; json.dumps has escaped everything that is not ASCII.
    for character in "<>&":
        text = text.replace(character, f"\\u{ord(character):04x}")
    return _TEMPLATE.read_text(encoding="utf-8").replace(_PLACE, text)
