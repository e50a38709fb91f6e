"""Take the documentation's pictures of the map page: of a wide window, and of a telephone's.

Run ``python benchmarks/pictures/map_page.py``; it needs chromium.
"""

from __future__ import annotations

import sys
import tempfile
from importlib import import_module
from pathlib import Path

from gaia_uwb.outputs import boundary_geojson, make_report, map_page
from gaia_uwb.pipeline import reconstruct
from gaia_uwb.simulate import PRESETS, simulate_pass

ROOT = Path(__file__).parents[2]
OUT = ROOT / "docs" / "images"


def main() -> None:
    """Draw both."""
    sys.path.insert(0, str(ROOT / "tests" / "helpers"))
    tools = import_module("browser")
    with tempfile.TemporaryDirectory() as place, tools.browser(Path(place) / "profile") as driver:
        for preset, size, touch, script in (
            ("lane-closure", (1280, 760), False, "showMoment(225); select('cone-5'); showZone()"),
            ("straight", (360, 740), True, "select(null)"),
        ):
            reconstruction = reconstruct(simulate_pass(PRESETS[preset], seed=0))
            features = boundary_geojson(reconstruction, local=True)
            page = Path(place) / f"{preset}.html"
            text = map_page(reconstruction, features, make_report(reconstruction))
            page.write_text(text, encoding="utf-8")
            driver.prefer("light")
            driver.resize(*size, touch=touch)
            driver.open(page)
            driver.evaluate(script)
            driver.settle()
            (OUT / f"map-{preset}.png").write_bytes(driver.screenshot())
            print(f"wrote {OUT / f'map-{preset}'}.png")


if __name__ == "__main__":
    main()
