"""The map is one safe file, and a browser draws in it what the reconstruction holds."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from factories import SQUARE_M, make_fix, make_reconstruction, make_unlocated
from gaia_uwb.estimate import AnchorStatus
from gaia_uwb.geojson import boundary_geojson
from gaia_uwb.map_page import map_page
from gaia_uwb.pipeline import Reconstruction
from gaia_uwb.report import make_report

HOSTILE = (
    "</script><script>document.title='owned'</script>",
    "<!--<script>",
    '"><img src=x onerror="document.title=1">&lt;',
    "line\u2028break\\u003c{{DATA}}",
)


class Page(HTMLParser):
    """The tags of a page, and the text of its data element."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.data = ""
        self._inside = False
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self._inside = ("id", "data") in attrs

    def handle_data(self, data: str) -> None:
        if self._inside:
            self.data += data

    def handle_endtag(self, tag: str) -> None:
        self._inside = False


def make_page(reconstruction: Reconstruction) -> str:
    return map_page(boundary_geojson(reconstruction, local=True), make_report(reconstruction))


def test_page_holds_features_and_report() -> None:
    reconstruction = make_reconstruction()
    data = json.loads(Page(make_page(reconstruction)).data)
    assert data == {
        "features": boundary_geojson(reconstruction, local=True),
        "report": make_report(reconstruction),
    }


def test_ids_never_become_markup() -> None:
    hostile = Page(make_page(make_reconstruction(anchor_ids=HOSTILE, name=HOSTILE[0])))
    harmless = Page(make_page(make_reconstruction()))
    assert hostile.tags == harmless.tags
    assert [anchor["id"] for anchor in json.loads(hostile.data)["report"]["anchors"]] == [*HOSTILE]
    assert re.search("[<>&\u2028]", hostile.data) is None


def test_page_refers_to_no_other_host() -> None:
    page = make_page(make_reconstruction())
    assert set(re.findall(r"\w+://[^\"'\s)]+", page)) == {"http://www.w3.org/2000/svg"}
    assert not re.search(r"<(link|img|iframe)|\b(src|href)=|@import|url\(", page)
    assert "default-src 'none'" in page


# ---- the rest needs a browser ---------------------------------------------------------------

PROBE = """
<script>
const wheel = new WheelEvent("wheel", { deltaY: -400, clientX: 100, clientY: 80 });
const under = () => [view.east + (100 - map.clientWidth / 2) / view.scale,
                     view.north - (80 - map.clientHeight / 2) / view.scale];
const zone = { scale: view.scale, before: under() };
map.dispatchEvent(wheel);
zone.after = under();
zone.zoomed = view.scale / zone.scale;
showDrive();
const driveScale = view.scale;
showZone();
const seen = [...document.querySelectorAll("#map circle")].map((circle) => ({
  role: circle.classList[0], warn: circle.classList.contains("warn"),
  x: +circle.getAttribute("cx"), y: +circle.getAttribute("cy"),
}));
document.querySelectorAll("#cones button")[0].click();
document.documentElement.dataset.seen = JSON.stringify({
  zone, driveScale, circles: seen, title: document.title,
  width: map.clientWidth, height: map.clientHeight,
  polygons: [...document.querySelectorAll("#map polygon")].map((p) => p.getAttribute("class")),
  details: byId("details").textContent, status: byId("status").textContent,
  labels: [...marks.querySelectorAll("text")].map((label) => label.textContent),
  buttons: byId("cones").textContent, legend: byId("legend").textContent,
  elements: document.querySelectorAll("img, iframe, #map script").length,
});
</script>
"""


def look(page: str, folder: Path) -> Any:
    """Return what a browser makes of a page, as a script in it sees it."""
    browser = shutil.which("chromium") or shutil.which("chromium-browser")
    if browser is None:
        pytest.skip("left out: no chromium to look at the map with")
    (folder / "map.html").write_text(page.replace("</body>", f"{PROBE}</body>"), encoding="utf-8")
    done = subprocess.run(
        [
            browser, "--headless", "--no-sandbox", "--disable-gpu", "--no-first-run",
            "--disable-background-networking", "--disable-sync", "--window-size=1100,700",
            f"--user-data-dir={folder / 'profile'}", "--dump-dom", str(folder / "map.html"),
        ],
        capture_output=True, text=True, timeout=60, check=True,
    )  # fmt: skip
    root = re.search(r'data-seen="([^"]*)"', done.stdout)
    assert root is not None, f"the page's script failed: {done.stderr}"
    return json.loads(root[1].replace("&quot;", '"').replace("&lt;", "<").replace("&gt;", ">")
                      .replace("&amp;", "&"))  # fmt: skip


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """One look at a page with hostile ids, an ambiguous cone and one that was not located."""
    changed = {
        0: make_fix(HOSTILE[0], SQUARE_M[0], status=AnchorStatus.AMBIGUOUS, mirror_probability=0.4),
        3: make_unlocated(HOSTILE[3]),
    }
    reconstruction = make_reconstruction(anchor_ids=HOSTILE, changed=changed)
    return look(make_page(reconstruction), tmp_path_factory.mktemp("browser"))


def test_browser_draws_every_role(seen: Any) -> None:
    roles = [circle["role"] for circle in seen["circles"]]
    assert roles == ["mirror", "cone", "cone", "cone"]
    assert [circle["warn"] for circle in seen["circles"]] == [False, True, False, False]
    assert seen["polygons"] == [
        "boundary", "outline", "ellipse warn", "ellipse", "ellipse",
    ]  # fmt: skip
    assert seen["status"] == "ok, 3 of 4 cones located, boundary: 6.0 m²"


def test_browser_places_cones_to_scale_with_north_up(seen: Any) -> None:
    _, first, second, third = (np.array([c["x"], -c["y"]]) for c in seen["circles"])
    scale = (second - first)[0] / 4.0
    assert second - first == pytest.approx(np.array([4.0, 0.0]) * scale)
    assert third - second == pytest.approx(np.array([0.0, 3.0]) * scale)
    for circle in seen["circles"]:
        assert 0 < circle["x"] < seen["width"]
        assert 0 < circle["y"] < seen["height"]


def test_browser_zooms_about_the_pointer(seen: Any) -> None:
    assert seen["zone"]["zoomed"] == pytest.approx(np.e)
    assert seen["zone"]["after"] == pytest.approx(seen["zone"]["before"])
    assert seen["driveScale"] < seen["zone"]["scale"]


def test_browser_shows_ids_as_text(seen: Any) -> None:
    assert seen["elements"] == 0
    assert seen["title"] == "GAIA: a drive"
    assert seen["labels"] == [f"{HOSTILE[0]}?", *HOSTILE[:3]]
    assert all(anchor_id in seen["buttons"] for anchor_id in HOSTILE)


def test_browser_shows_details_of_the_chosen_cone(seen: Any) -> None:
    for text in (HOSTILE[0], "ambiguous", "0.00 m ± 0.20 m", "40.0 % likely", "48.1000000"):
        assert text in seen["details"]
    assert "other place of an ambiguous cone" in seen["legend"]


def test_browser_shows_a_page_without_any_cone(tmp_path: Path) -> None:
    changed = {k: make_unlocated(f"cone-{k}") for k in range(4)}
    nothing = look(make_page(make_reconstruction(changed=changed, frame=None)), tmp_path)
    assert nothing["circles"] == []
    assert nothing["status"] == "ok, 0 of 4 cones located, boundary: too-few-anchors"
    assert "too-few-ranges" in nothing["details"]
