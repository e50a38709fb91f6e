"""A browser shows of the map what the reconstruction holds, on every screen."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from browser import Browser
from factories import HOSTILE, SQUARE_M, make_reconstruction
from gaia_uwb.outputs.geojson import boundary_geojson
from gaia_uwb.outputs.interactive_map import map_page
from gaia_uwb.outputs.report import make_report
from map_looks import (
    DESKTOP,
    PHONE,
    RADII,
    colour_share,
    picture,
    place,
    show,
    texts,
    write_page,
)

# ---- what is drawn --------------------------------------------------------------------------


def test_good_result(chromium: Browser, pages: dict[str, Path]) -> None:
    show(chromium, pages["good"])
    assert chromium.requests() == [pages["good"].as_uri()]
    assert chromium.evaluate("document.title") == "GAIA: a drive"
    assert texts(chromium, "#status") == [
        "✓ reliable All 4 cones located, the zone covers 12.0 m²."
    ]
    assert texts(chromium, "#cones .value") == ["± 0.45 m (90 %)"] * 4
    image = picture(chromium, "good")
    assert image.shape == (860, 1400, 3)
    assert colour_share(image, "#f0ecaa") > 0.02  # the zone's yellow on the ground


def test_cones_are_to_scale_with_north_up(chromium: Browser, pages: dict[str, Path]) -> None:
    show(chromium, pages["good"])
    pixel = np.array([place(chromium, "cone", k) for k in range(4)]) * [1.0, -1.0]
    scale = chromium.evaluate("view.scale")
    assert pixel - pixel[0] == pytest.approx((SQUARE_M - SQUARE_M[0]) * scale)


def test_notes_of_the_reader_are_shown_as_text(
    chromium: Browser, pages: dict[str, Path], tmp_path: Path
) -> None:
    notes = (f"uwb.csv: {HOSTILE[0]}", "uwb.csv: skipped 3 rows")
    plain = make_reconstruction()
    noted = replace(plain, episode=replace(plain.episode, notes=notes))
    show(chromium, write_page(noted, tmp_path / "noted.html"))
    assert chromium.evaluate('document.getElementById("log").hidden') is False
    assert chromium.evaluate(
        '[...document.querySelectorAll("#notes li")].map((each) => each.textContent)'
    ) == list(notes)
    show(chromium, pages["good"])
    assert chromium.evaluate('document.getElementById("log").hidden') is True


def test_doubtful_result_shows_both_places_and_why(
    chromium: Browser, pages: dict[str, Path]
) -> None:
    show(chromium, pages["doubtful"])
    assert texts(chromium, "#status") == [
        "! needs review 3 of 4 cones located, the zone as computed covers 6.0 m²."
    ]
    assert texts(chromium, "#reasons li") == [f"anchor {HOSTILE[0]}: the other side fits as well"]
    states = ["side uncertain", "± 0.45 m (90 %)", "poorly determined", "not located"]
    assert texts(chromium, "#cones .value") == states
    labels = texts(chromium, "#map .place + .label")
    assert labels[0].endswith("… 37 %")
    assert labels[1].endswith("… 63 %")
    ends = chromium.evaluate("document.querySelector('.link').getAttribute('d')")
    link = np.array([end.split() for end in ends[1:].split("L")], dtype=float)
    assert link == pytest.approx(np.array([place(chromium, "cone"), place(chromium, "mirror")]))
    legend = texts(chromium, "#legend div")
    assert "other possible position of a cone" in legend
    assert "cone: side uncertain" in legend
    assert "cone: poorly determined" in legend
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
    assert "too few usable ranges" in texts(chromium, "#details dd")
    chromium.evaluate("showMoment(50)")
    chromium.settle()
    radii = chromium.evaluate(RADII)
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
        "hull-inner": {"type": "Polygon", "coordinates": [rings[0.9], rings[0.2]]},
        "hull-outer": {"type": "MultiPolygon", "coordinates": [[rings[1.1]], [across]]},
        "closed-area-inner": {"type": "MultiPolygon", "coordinates": []},
        "closed-area-outer": None,
    }
    for role, geometry in areas.items():
        properties = {"role": role, "area_m2": 9.5 if role == "hull-inner" else 1210.0}
        features["features"].insert(1, {"geometry": geometry, "properties": properties})
    page = tmp_path / "outlines.html"
    page.write_text(map_page(reconstruction, features, make_report(reconstruction)), "utf-8")
    show(chromium, page)
    pieces = (
        "[...document.querySelectorAll('#hull .%s')].map((p) => p.getAttribute('d').split('z'))"
    )
    for role in ("inner", "outer"):
        (drawn,) = chromium.evaluate(pieces % role)
        assert len(drawn) == 3  # two rings each, and what follows the last z
    assert (
        "12.0 m² (at least 9.5 m², at most 1,210 m²; 90 % each)" in (texts(chromium, "#status")[0])
    )
    legend = texts(chromium, "#hull-legend div")
    assert "inside the work zone (90 %)" in legend
    assert "contains the work zone (90 %)" in legend
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
    assert texts(chromium, "#path-title") == ["Path: residual of the ranges to cone-2"]
    chromium.evaluate("select('cone-1')")
    corners = [c.split() for c in chromium.evaluate(worst).replace("M", "L").split("L")[1:]]
    east_m = np.array(corners, dtype=float)[:, 0]
    blocked_m = episode.position_m[60:80, 0] - episode.position_m[0, 0]
    assert east_m.min() == pytest.approx(blocked_m.min(), abs=1.0)
    assert east_m.max() == pytest.approx(blocked_m.max(), abs=1.0)
    chromium.evaluate("showDrive()")
    picture(chromium, "misfit")
    chromium.press("Escape")
    assert texts(chromium, "#path-title") == ["Path: residual of all ranges"]


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
