"""A browser shows of the map what the reconstruction holds, in every state and on every screen.

The pictures of the states are kept where GAIA_SCREENSHOTS names a folder.
"""

from __future__ import annotations

import io
import os
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from browser import Browser, browser, find_chromium
from factories import SQUARE_M, make_fix, make_reconstruction, make_unlocated
from gaia_uwb.estimate import AnchorStatus
from gaia_uwb.geojson import boundary_geojson
from gaia_uwb.map_page import map_page
from gaia_uwb.pipeline import Reconstruction, ReconstructionStatus
from gaia_uwb.report import make_report
from test_map_page import HOSTILE, make_page

pytestmark = pytest.mark.skipif(
    find_chromium() is None, reason="left out: no chromium to look at the map with"
)

RADII = "[...document.querySelectorAll('.range')].map((c) => c.r.baseVal.value)"
DESKTOP, PHONE = (1400, 860), (360, 740)
OTHER_M = np.array([0.5, -8.2])


@pytest.fixture(scope="module")
def chromium(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    """One browser for all tests of this file, without a network."""
    with browser(tmp_path_factory.mktemp("profile")) as driver:
        yield driver


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Pages by name: a good result, a doubtful one with hostile ids, one without any cone."""
    doubtful = {
        0: make_fix(HOSTILE[0], SQUARE_M[0], status=AnchorStatus.AMBIGUOUS,
                    mirror_probability=0.37, mirror_position_m=OTHER_M),
        2: make_fix(HOSTILE[2], SQUARE_M[2], status=AnchorStatus.ILL_CONDITIONED,
                    covariance_m2=np.diag([9.0, 0.04])),
        3: make_unlocated(HOSTILE[3]),
    }  # fmt: skip
    results = {
        "good": make_reconstruction(),
        "doubtful": replace(
            make_reconstruction(anchor_ids=HOSTILE, changed=doubtful, name=HOSTILE[0]),
            status=ReconstructionStatus.UNRELIABLE,
            reasons=(f"anchor {HOSTILE[0]}: the other side fits as well",),
        ),
        "nothing": make_reconstruction(
            changed={k: make_unlocated(f"cone-{k}") for k in range(4)}, frame=None
        ),
    }
    folder = tmp_path_factory.mktemp("pages")
    return {name: write_page(result, folder / f"{name}.html") for name, result in results.items()}


def write_page(reconstruction: Reconstruction, path: Path) -> Path:
    path.write_text(make_page(reconstruction), encoding="utf-8")
    return path


def show(
    driver: Browser, page: Path, size: tuple[int, int] = DESKTOP, theme: str = "light"
) -> Browser:
    """Open a page on a screen of some size, and see that it has nothing to complain of."""
    driver.prefer(theme)
    driver.resize(*size, touch=size == PHONE)
    driver.open(page)
    assert driver.complaints() == []
    return driver


def picture(driver: Browser, name: str) -> np.ndarray:
    """Return what is seen as (height, width, 3), and keep it if somebody wants to look."""
    png = driver.screenshot()
    if folder := os.environ.get("GAIA_SCREENSHOTS"):
        Path(folder).mkdir(parents=True, exist_ok=True)
        (Path(folder) / f"map-{name}.png").write_bytes(png)
    return np.asarray(Image.open(io.BytesIO(png)).convert("RGB"), dtype=int)


def colour_share(image: np.ndarray, colour: str) -> float:
    """Return the share of the pixels that have a colour, given as #rrggbb."""
    value = [int(colour[k : k + 2], 16) for k in (1, 3, 5)]
    return float((np.abs(image - value).max(axis=2) <= 6).mean())


def texts(driver: Browser, selector: str) -> list[str]:
    found: list[str] = driver.evaluate(
        f"[...document.querySelectorAll('{selector}')].map((e) => e.textContent.trim())"
    )
    return [text.replace("\u00a0", " ") for text in found]


def place(driver: Browser, role: str, index: int = 0) -> tuple[float, float]:
    x, y = driver.evaluate(
        f"places.filter((p) => p.role === '{role}').map((p) => [p.x, p.y])[{index}]"
    )
    return x, y


# ---- what is drawn --------------------------------------------------------------------------


def test_good_result(chromium: Browser, pages: dict[str, Path]) -> None:
    show(chromium, pages["good"])
    assert chromium.requests() == [pages["good"].as_uri()]
    assert chromium.evaluate("document.title") == "GAIA: a drive"
    assert texts(chromium, "#status") == [
        "✓ reliable 4 of 4 cones located, the zone covers 12.0 m²."
    ]
    assert texts(chromium, "#cones .value") == ["± 0.45 m"] * 4
    image = picture(chromium, "good")
    assert image.shape == (860, 1400, 3)
    assert colour_share(image, "#f0ecaa") > 0.02  # the zone's yellow on the ground


def test_cones_are_to_scale_with_north_up(chromium: Browser, pages: dict[str, Path]) -> None:
    show(chromium, pages["good"])
    pixel = np.array([place(chromium, "cone", k) for k in range(4)]) * [1.0, -1.0]
    scale = chromium.evaluate("view.scale")
    assert pixel - pixel[0] == pytest.approx((SQUARE_M - SQUARE_M[0]) * scale)


def test_doubtful_result_shows_both_places_and_why(
    chromium: Browser, pages: dict[str, Path]
) -> None:
    show(chromium, pages["doubtful"])
    assert texts(chromium, "#status") == [
        "! check before use 3 of 4 cones located, the zone covers 6.0 m²."
    ]
    assert texts(chromium, "#reasons li") == [f"anchor {HOSTILE[0]}: the other side fits as well"]
    states = ["side not certain", "± 0.45 m", "poorly fixed", "not located"]
    assert texts(chromium, "#cones .value") == states
    labels = texts(chromium, "#map .place + .label")
    assert labels[0].endswith("… 37 %")
    assert labels[1].endswith("… 63 %")
    ends = chromium.evaluate("document.querySelector('.link').getAttribute('d')")
    link = np.array([end.split() for end in ends[1:].split("L")], dtype=float)
    assert link == pytest.approx(np.array([place(chromium, "cone"), place(chromium, "mirror")]))
    legend = texts(chromium, "#legend div")
    assert "other possible place of such a cone" in legend
    assert "cone: side not certain" in legend
    assert "cone: poorly fixed" in legend
    image = picture(chromium, "doubtful")
    assert colour_share(image, "#ad3b06") > 0.0005


def test_ids_stay_text(chromium: Browser, pages: dict[str, Path]) -> None:
    show(chromium, pages["doubtful"])
    assert chromium.evaluate("document.title") == f"GAIA: {HOSTILE[0]}"
    assert texts(chromium, "#cones .name") == [*(t.strip() for t in HOSTILE)]
    for anchor_id in range(4):
        chromium.evaluate(f"centre(order[{anchor_id}]); showMoment(100)")
        chromium.settle()
        assert texts(chromium, "dd.name") == [HOSTILE[anchor_id]]
    chromium.evaluate("showTip(places[0])")
    count = "document.querySelectorAll('img, iframe, aside script, main script').length"
    assert chromium.evaluate(count) == 0
    assert chromium.complaints() == []


def test_page_without_any_cone(chromium: Browser, pages: dict[str, Path]) -> None:
    show(chromium, pages["nothing"])
    assert chromium.evaluate("places.length") == 0
    assert "too few cones for a boundary" in texts(chromium, "#status")[0]
    chromium.click_on("#cones button")
    assert "too few usable ranges to locate it" in texts(chromium, "#details dd")
    chromium.evaluate("showMoment(50)")
    chromium.settle()
    radii = chromium.evaluate(
        "[...document.querySelectorAll('.range')].map((c) => c.r.baseVal.value)"
    )
    expected = make_reconstruction().episode.range_m[50]
    assert radii == pytest.approx(expected[np.isfinite(expected)], abs=0.006)
    picture(chromium, "nothing")


def test_inner_and_outer_outline_are_drawn_where_they_are_known(
    chromium: Browser, tmp_path: Path
) -> None:
    reconstruction = make_reconstruction()
    features: Any = boundary_geojson(reconstruction, local=True)
    rings = {}
    for size in (0.9, 1.1, 0.2):
        ring_m = (SQUARE_M - SQUARE_M.mean(axis=0)) * size + SQUARE_M.mean(axis=0)
        rings[size] = [*ring_m.tolist(), ring_m[0].tolist()]
    across = [[e, n - 12.0] for e, n in rings[0.9]]
    areas = {
        "inner": {"type": "Polygon", "coordinates": [rings[0.9], rings[0.2]]},
        "outer": {"type": "MultiPolygon", "coordinates": [[rings[1.1]], [across]]},
        "inner-most": {"type": "MultiPolygon", "coordinates": []},
        "outer-most": None,
    }
    for role, geometry in areas.items():
        features["features"].insert(1, {"geometry": geometry, "properties": {"role": role}})
    page = tmp_path / "outlines.html"
    page.write_text(map_page(reconstruction, features, make_report(reconstruction)), "utf-8")
    show(chromium, page)
    pieces = "[...document.querySelectorAll('#map .%s')].map((p) => p.getAttribute('d').split('z'))"
    for role in ("inner", "outer"):
        (drawn,) = chromium.evaluate(pieces % role)
        assert len(drawn) == 3  # two rings each, and what follows the last z
    legend = texts(chromium, "#legend div")
    assert "all of this is work zone (90 %)" in legend
    assert "no work zone beyond this (90 %)" in legend
    picture(chromium, "outlines")


def test_path_is_coloured_by_the_chosen_cones_misfit(chromium: Browser, tmp_path: Path) -> None:
    reconstruction = make_reconstruction()
    range_m = reconstruction.episode.range_m.copy()
    range_m[60:80, 1] += 3.0  # blocked here
    episode = replace(reconstruction.episode, range_m=range_m)
    show(chromium, write_page(replace(reconstruction, episode=episode), tmp_path / "blocked.html"))
    worst = "document.querySelector('path.fit4').getAttribute('d')"
    chromium.evaluate("select('cone-2')")
    assert chromium.evaluate(worst) == ""
    assert texts(chromium, "#path-title") == ["Path: misfit of the ranges to cone-2"]
    chromium.evaluate("select('cone-1')")
    corners = [c.split() for c in chromium.evaluate(worst).replace("M", "L").split("L")[1:]]
    east_m = np.array(corners, dtype=float)[:, 0]
    blocked_m = episode.position_m[60:80, 0] - episode.position_m[0, 0]
    assert east_m.min() == pytest.approx(blocked_m.min(), abs=1.0)
    assert east_m.max() == pytest.approx(blocked_m.max(), abs=1.0)
    chromium.evaluate("showDrive()")
    picture(chromium, "misfit")
    chromium.press("Escape")
    assert texts(chromium, "#path-title") == ["Path: misfit of all ranges"]


# ---- mouse, fingers and keys ----------------------------------------------------------------


def test_mouse_pans_and_zooms_about_the_pointer(chromium: Browser, pages: dict[str, Path]) -> None:
    show(chromium, pages["good"])
    under = "[toEast(300), toNorth(400)]"
    before, scale = chromium.evaluate(under), chromium.evaluate("view.scale")
    chromium.wheel(300, 400, -400)
    assert chromium.evaluate("view.scale") == pytest.approx(np.e * scale)
    assert chromium.evaluate(under) == pytest.approx(before)
    chromium.drag((300, 400), (360, 380))
    assert chromium.evaluate("[toEast(360), toNorth(380)]") == pytest.approx(before)


def test_fingers_pan_and_pinch(chromium: Browser, pages: dict[str, Path]) -> None:
    show(chromium, pages["good"], PHONE)
    scale, before = (
        chromium.evaluate("view.scale"),
        chromium.evaluate("[toEast(180), toNorth(200)]"),
    )
    chromium.touch([(160, 200), (200, 200)], [(140, 200), (220, 200)])
    assert chromium.evaluate("view.scale") == pytest.approx(2.0 * scale)
    assert chromium.evaluate("[toEast(180), toNorth(200)]") == pytest.approx(before)
    chromium.touch([(180, 200)], [(200, 230)])
    assert chromium.evaluate("[toEast(200), toNorth(230)]") == pytest.approx(before)


def test_pointing_and_choosing(chromium: Browser, pages: dict[str, Path]) -> None:
    show(chromium, pages["doubtful"])
    chromium.point(*place(chromium, "mirror"))
    assert texts(chromium, "#tip") == [f"{HOSTILE[0]}other possible place, 37 % likely"]
    picture(chromium, "hover")
    chromium.click(*place(chromium, "cone", 1))
    assert texts(chromium, "dd.name") == [HOSTILE[1]]
    assert "48.1000000, 11.5000537" in texts(chromium, "#details dd")
    chromium.point(20, 120)
    assert chromium.evaluate("byId('tip').hidden")


def test_keys_reach_everything(chromium: Browser, pages: dict[str, Path]) -> None:
    show(chromium, pages["good"])
    chromium.press("Tab")
    assert chromium.evaluate("document.activeElement.id") == "map"
    scale, east = chromium.evaluate("[view.scale, view.east]")
    chromium.press("+", "ArrowRight")
    assert chromium.evaluate("view.scale") == pytest.approx(1.4 * scale)
    assert chromium.evaluate("view.east") == pytest.approx(east + 60 / (1.4 * scale))
    chromium.press("n", "n")
    assert texts(chromium, "dd.name") == ["cone-1"]
    chromium.press("b")
    assert texts(chromium, "dd.name") == ["cone-0"]
    chromium.press(".", ".")
    assert chromium.evaluate("chosen.step") == 2
    chromium.press("Tab")
    role = "document.activeElement.getAttribute('aria-label')"
    assert chromium.evaluate(role) == "cone-0, located, ±\u00a00.45\u00a0m"
    assert "180 ranges" in texts(chromium, "#tip")[0]
    picture(chromium, "keyboard")
    chromium.press("Tab", "Enter")
    assert texts(chromium, "dd.name") == ["cone-1"]
    names = []
    for _ in range(16):
        chromium.press("Tab")
        names.append(chromium.evaluate("document.activeElement.id"))
    assert [n for n in names if n][:10] == [
        "closer", "farther", "zone", "drive", "measure", "theme", "fold", "play", "slider",
        "ranges",
    ]  # fmt: skip


# ---- time -----------------------------------------------------------------------------------


def test_slider_shows_the_ranges_of_a_moment(chromium: Browser, pages: dict[str, Path]) -> None:
    show(chromium, pages["good"])
    assert chromium.evaluate("document.querySelectorAll('.range').length") == 0
    chromium.evaluate("byId('slider').focus()")
    chromium.press(*["ArrowRight"] * 3)
    assert texts(chromium, "#clock") == ["0.3 / 19.9 s"]
    chromium.evaluate("slider.value = 120; slider.dispatchEvent(new Event('input')); showDrive()")
    chromium.settle()
    reconstruction = make_reconstruction()
    measured_m = reconstruction.episode.range_m[120]
    rows = [row.replace("\u2212", "-") for row in texts(chromium, "#now-table tbody tr")]
    for k, row in enumerate(rows):
        assert row.startswith(f"cone-{k}{measured_m[k]:.2f} m")
    radii = chromium.evaluate(
        "[...document.querySelectorAll('.range')].map((c) => c.r.baseVal.value)"
    )
    assert radii == pytest.approx(measured_m - 0.05, abs=0.011)  # less the cone's bias
    picture(chromium, "slider")
    chromium.click_on("#ranges")
    assert chromium.evaluate("document.querySelectorAll('.range').length") == 0
    assert chromium.evaluate("byId('now').hidden")


def test_click_on_the_path_goes_to_that_moment(chromium: Browser, pages: dict[str, Path]) -> None:
    show(chromium, pages["good"])
    chromium.evaluate("showDrive()")
    chromium.settle()
    x, y = chromium.evaluate(
        "[toX(timeline.east_m[42] + origin[0]), toY(timeline.north_m[42] + origin[1])]"
    )
    chromium.point(x, y)
    assert texts(chromium, "#tip b") == ["4.2 s after the start"]
    chromium.click(x, y)
    assert chromium.evaluate("chosen.step") == 42


def test_playing_moves_on_and_pauses(chromium: Browser, pages: dict[str, Path]) -> None:
    show(chromium, pages["good"])
    chromium.click_on("#play")
    chromium.evaluate("new Promise((done) => setTimeout(done, 700))")
    chromium.click_on("#play")
    step = chromium.evaluate("chosen.step")
    assert step > 2
    chromium.evaluate("new Promise((done) => setTimeout(done, 300))")
    assert chromium.evaluate("chosen.step") == step
    assert chromium.evaluate("byId('play').getAttribute('aria-label')") == "Play"


# ---- measuring ------------------------------------------------------------------------------


def test_measuring_by_mouse(chromium: Browser, pages: dict[str, Path]) -> None:
    show(chromium, pages["good"])
    chromium.click_on("#measure")
    x, y = place(chromium, "cone", 0)
    chromium.click(x + 9, y - 9)  # snaps
    chromium.click(*place(chromium, "cone", 1))
    sure_m = 1.645 * np.sqrt(2 * 0.04)
    assert texts(chromium, "#measured-text") == [f"4.00 m ± {sure_m:.2f} m (90 %)"]
    chromium.click(*place(chromium, "cone", 2))
    assert texts(chromium, "#measured-text") == ["7.00 m in all, area 6.0 m²"]
    picture(chromium, "measuring")
    chromium.click_on("#undo")
    assert texts(chromium, "#measured-text")[0].startswith("4.00 m")
    chromium.press("Escape", "Escape")
    assert chromium.evaluate("byId('measured').hidden")


def test_measuring_by_keys(chromium: Browser, pages: dict[str, Path]) -> None:
    show(chromium, pages["good"])
    chromium.press("Tab", "m")
    assert chromium.evaluate("document.querySelectorAll('.cross').length") == 1
    scale = chromium.evaluate("view.scale")
    chromium.press("Enter", *["ArrowRight"] * 2, "Enter")
    assert texts(chromium, "#measured-text") == [f"{120 / scale:.2f} m"]
    chromium.press("Backspace")
    assert texts(chromium, "#measured-text") == ["Pick the next place"]


# ---- phones, big screens, light and dark ----------------------------------------------------


@pytest.mark.parametrize("name", ["good", "doubtful", "nothing"])
@pytest.mark.parametrize("theme", ["light", "dark"])
def test_phone(chromium: Browser, pages: dict[str, Path], name: str, theme: str) -> None:
    show(chromium, pages[name], PHONE, theme)
    chromium.evaluate("showMoment(100)")
    chromium.settle()
    image = picture(chromium, f"phone-{name}-{theme}")
    assert image.shape == (740, 360, 3)
    assert chromium.evaluate("document.documentElement.scrollWidth") <= 360
    assert chromium.evaluate("byId('panel').scrollWidth <= byId('panel').clientWidth")
    boxes = chromium.evaluate(
        "[...document.querySelectorAll('main button')].filter((b) => b.offsetParent)"
        ".map((b) => b.getBoundingClientRect()).map((r) => [r.left, r.right, r.width, r.height])"
    )
    left, right, width, height = np.array(boxes).T
    assert left.min() >= 0
    assert right.max() <= 360
    assert width.min() >= 36
    assert height.min() >= 44
    assert chromium.evaluate("byId('tools').offsetHeight") < 60  # one row
    assert chromium.evaluate("map.clientHeight") > 0.5 * 740
    for x, y in chromium.evaluate("places.map((p) => [p.x, p.y])"):
        assert 0 < x < 360
        assert chromium.evaluate("byId('tools').offsetHeight") < y
        assert y < chromium.evaluate("byId('time').offsetTop")


def test_panel_folds_away(chromium: Browser, pages: dict[str, Path]) -> None:
    show(chromium, pages["good"], PHONE)
    chromium.click_on("#fold")
    assert chromium.evaluate("map.clientHeight") == 740
    chromium.click_on("#fold")
    assert chromium.evaluate("map.clientHeight") < 740


def test_big_screen(chromium: Browser, pages: dict[str, Path]) -> None:
    show(chromium, pages["doubtful"], (2560, 1440), "dark")
    assert picture(chromium, "big-dark").shape == (1440, 2560, 3)
    assert chromium.evaluate("document.documentElement.scrollHeight") <= 1440


CONTRASTS = """(() => {
  const numbers = (text) => text.match(/[\\d.]+/g).map(Number);
  const luminance = (text) => {
    const part = numbers(text).slice(0, 3).map((c) => c / 255)
      .map((c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4));
    return 0.2126 * part[0] + 0.7152 * part[1] + 0.0722 * part[2];
  };
  const ratio = (a, b) => {
    const [low, high] = [luminance(a), luminance(b)].sort((x, y) => x - y);
    return (high + 0.05) / (low + 0.05);
  };
  const ground = (element) => {
    for (let e = element; e; e = e.parentElement) {
      const colour = getComputedStyle(e).backgroundColor;
      if ((numbers(colour)[3] ?? 1) > 0) return colour;
    }
  };
  const words = [...document.querySelectorAll('body *')].filter((e) => e.offsetParent
    && [...e.childNodes].some((n) => n.nodeType === 3 && n.textContent.trim()));
  const main = getComputedStyle(document.querySelector('main')).backgroundColor;
  const stroke = (name) => getComputedStyle(pathLines[name]).stroke;
  return {
    words: Math.min(...words.map((e) => ratio(getComputedStyle(e).color, ground(e)))),
    path: ['fit0', 'fit1', 'fit2', 'fit3', 'fit4'].map((name) => ratio(stroke(name), main)),
    label: ratio(getComputedStyle(document.querySelector('.label')).fill, main),
  };
})()"""


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_contrast_and_colours_that_everybody_can_tell_apart(
    chromium: Browser, pages: dict[str, Path], theme: str
) -> None:
    show(chromium, pages["doubtful"], DESKTOP, theme)
    chromium.evaluate("centre(order[0]); showMoment(100); toggleRuler(true)")
    chromium.settle()
    seen = chromium.evaluate(CONTRASTS)
    assert seen["words"] >= 4.5  # WCAG 2.2, AA
    assert seen["label"] >= 7.0
    # A worse fit stands out more by brightness alone, whatever a reader sees of the hues.
    assert np.all(np.diff(seen["path"]) > 0.4)
    assert seen["path"][0] >= 3.0
    picture(chromium, f"contrast-{theme}")


def test_reader_overrules_the_systems_theme(chromium: Browser, pages: dict[str, Path]) -> None:
    show(chromium, pages["good"], DESKTOP, "dark")
    dark = picture(chromium, "good-dark").mean()
    chromium.click_on("#theme")
    assert picture(chromium, "good-light-again").mean() > dark + 100
