"""Size and first paint of the map page of a 5-minute run, in a headless Chromium without a network.

    python benchmarks/speed/map_page.py [--rounds 5]   (needs chromium; budgets: 2 MB and 1 s)

Where folium is installed, its map of the same cones and path stands beside it: what one would take
otherwise. It loads its parts from other hosts, so offline its page counts what it could not load.
"""

from __future__ import annotations

import statistics
import tempfile
import time
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from _measure import make_parser, tests_module, write_json
from gaia_uwb.outputs import boundary_geojson, make_report, map_page
from gaia_uwb.pipeline import reconstruct
from gaia_uwb.reconstruction import Reconstruction
from gaia_uwb.simulate import PRESETS, simulate_pass

BUDGET_MB, BUDGET_S = 2.0, 1.0
PAINT = """(async () => {
  const find = () => performance.getEntriesByName("first-contentful-paint")[0];
  for (let k = 0; k < 100 && !find(); k += 1) await new Promise((done) => setTimeout(done, 20));
  const [load] = performance.getEntriesByType("navigation");
  return [find()?.startTime ?? null, load.domContentLoadedEventEnd];
})()"""


def five_minutes(n_anchors: int) -> Reconstruction:
    """Return a run of five minutes in which every anchor is read ten times a second."""
    preset = PRESETS["lane-closure"]
    config = preset.model_copy(
        update={
            "closure": preset.closure.model_copy(update={"n_anchors": n_anchors}),
            "drive": preset.drive.model_copy(update={"duration_s": 300.0, "rate_hz": 10.0}),
            "ranging": preset.ranging.model_copy(update={"rate_hz": 10.0, "max_range_m": 2000.0}),
        }
    )
    return reconstruct(simulate_pass(config, seed=0))


def folium_page(reconstruction: Reconstruction, path: Path) -> None:
    """Write the cones and the path as a map of folium's."""
    folium = import_module("folium")
    shown = folium.Map()
    folium.GeoJson(boundary_geojson(reconstruction)).add_to(shown)
    shown.save(str(path))


def look(page: Path, rounds: int) -> dict[str, float | int | None]:
    """Open a page in browsers without a past, and return what it took."""
    tools = tests_module("browser")
    paints, loads, refused = [], [], 0
    for _ in range(rounds):
        with tempfile.TemporaryDirectory() as profile, tools.browser(Path(profile)) as driver:
            driver.resize(1400, 860)
            driver.open(page)
            paint_ms, load_ms = driver.evaluate(PAINT)
            paints.append(paint_ms)
            loads.append(load_ms / 1e3)
            refused = len(driver.requests()) - 1
    known = [paint / 1e3 for paint in paints if paint is not None]
    return {
        "mb": page.stat().st_size / 1e6,
        "first_paint_best_s": min(known) if known else None,
        "first_paint_median_s": statistics.median(known) if known else None,
        "loaded_median_s": statistics.median(loads),
        "not_loaded": refused,
    }


def main() -> None:
    """Measure and print."""
    parser = make_parser(__doc__, __file__)
    parser.add_argument("--rounds", type=int, default=5)
    given = parser.parse_args()
    rows: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as place:
        for n_anchors in (4, 10, 50):
            reconstruction = five_minutes(n_anchors)
            features = boundary_geojson(reconstruction, local=True)
            report = make_report(reconstruction)
            start = time.perf_counter()
            text = map_page(reconstruction, features, report)
            made_s = time.perf_counter() - start
            page = Path(place) / f"map-{n_anchors}.html"
            page.write_text(text, encoding="utf-8")
            name = f"map page, {n_anchors} anchors, {reconstruction.episode.valid.sum()} ranges"
            rows[name] = {**look(page, given.rounds), "made_s": made_s}
        if find_spec("folium"):
            page = Path(place) / "folium.html"
            folium_page(five_minutes(10), page)
            rows["folium, 10 anchors, no ranges"] = look(page, given.rounds)
        else:
            print("left out, not installed: folium")
    for name, row in rows.items():
        paint = row["first_paint_median_s"]
        median = f"median of {given.rounds}"
        shown = "nothing painted" if paint is None else f"first paint {paint:.2f} s ({median})"
        print(
            f"{name:42} {row['mb']:.2f} MB, {shown}, loaded {row['loaded_median_s']:.2f} s, "
            f"{row['not_loaded']} files of other hosts missing"
        )
    print(f"budgets: {BUDGET_MB} MB, first paint {BUDGET_S} s")
    write_json(rows, given.out)


if __name__ == "__main__":
    main()
