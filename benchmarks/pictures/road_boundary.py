"""Take the documentation's pictures of zones along a road: on a curve, with both rows, on an S.

Run ``python benchmarks/pictures/road_boundary.py``; it needs chromium. For each zone it draws
``plot.png``, and the map in a large window and on a telephone, and prints the edge in words. The
drives are those of ``tests/helpers/road_forms.py``, past each zone in two lanes.
"""

from __future__ import annotations

import io
import sys
import tempfile
from importlib import import_module
from pathlib import Path

from PIL import Image

from gaia_uwb._shared import figure_png
from gaia_uwb.config import make_config
from gaia_uwb.outputs import (
    boundary_geojson,
    make_report,
    map_page,
    plot_reconstruction,
    summary_words,
)
from gaia_uwb.pipeline import reconstruct

ROOT = Path(__file__).parents[2]
OUT = ROOT / "docs" / "images" / "road"
ZONES = {
    "curve": (1066, {"closed_lanes": 1}),
    "both-rows": (1089, {}),
    "s-curve": (1070, {}),
}
"""Seed of the drives, and what is stated of the boundary."""
SCREENS = {"map": ((1600, 1000), False), "phone": ((390, 844), True)}
_COLOURS = 128  # of a picture, which takes a third of the space then


def main() -> None:
    """Draw all of them."""
    sys.path.insert(0, str(ROOT / "tests" / "helpers"))
    tools, roads = import_module("browser"), import_module("road_forms")
    OUT.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as place, tools.browser(Path(place) / "profile") as driver:
        driver.prefer("light")
        for name, (seed, stated) in ZONES.items():
            drives = [drive.without_truth() for drive in roads.road_form(seed).drives]
            result = reconstruct(drives, make_config({"boundary": stated}))
            print(f"{name}: {result.status.value}. {summary_words(result)}")
            save(figure_png(plot_reconstruction(result)), f"{name}-plot")
            page = Path(place) / f"{name}.html"
            features = boundary_geojson(result, local=True)
            page.write_text(map_page(result, features, make_report(result)), encoding="utf-8")
            for screen, (size, touch) in SCREENS.items():
                driver.resize(*size, touch=touch)
                driver.open(page)
                save(driver.screenshot(), f"{name}-{screen}")


def save(png: bytes, name: str) -> None:
    """Write a picture with few colours."""
    picture = Image.open(io.BytesIO(png)).convert("RGB")
    path = OUT / f"{name}.png"
    picture.quantize(_COLOURS, dither=Image.Dither.NONE).save(path, optimize=True)
    print(f"wrote {path.relative_to(ROOT)}")


if __name__ == "__main__":
    main()
