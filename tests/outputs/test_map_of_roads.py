"""A browser shows of a road's zones the edge first, and the hull only where it is asked for."""

from __future__ import annotations

from pathlib import Path

import pytest

from browser import Browser
from factories import HOSTILE, make_reconstruction
from gaia_uwb.roadside import ZoneForm
from map_looks import DESKTOP, PHONE, colour_share, picture, show, texts, write_page
from road_zones import (
    STRAIGHT,
    bend,
    closed_strip,
    ids_of,
    lane_between,
    make_edge,
    make_road,
    make_road_result,
    make_zone,
    with_road,
)

SIZES = {"phone": PHONE, "desktop": DESKTOP}
HULL_SHOWN = "[byId('hull-shown').checked, getComputedStyle(hull).display !== 'none']"


@pytest.fixture(scope="module")
def road_pages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("roads")
    curve = bend()
    closed = make_zone(curve, make_edge(curve, ids_of(8)), closed=closed_strip(curve))
    hostile = make_edge(STRAIGHT, (*HOSTILE, *ids_of(4)), unlocated=HOSTILE[:1])
    results = {
        "open": make_road_result(make_road(make_zone(STRAIGHT))),
        "closed": make_road_result(make_road(closed, line=curve)),
        "both": make_road_result(make_road(lane_between(curve), line=curve)),
        "area": make_road_result(make_road(make_zone(STRAIGHT, form=ZoneForm.AREA))),
        "hostile": make_road_result(make_road(make_zone(STRAIGHT, hostile))),
        "no road": with_road(make_reconstruction(), None),
    }
    return {name: write_page(result, folder / f"{name}.html") for name, result in results.items()}


@pytest.mark.parametrize(
    ("name", "shown"),
    [("open", False), ("closed", False), ("both", False), ("area", True), ("no road", True)],
)
def test_the_hull_is_shown_at_first_only_where_it_is_the_zone(
    chromium: Browser, road_pages: dict[str, Path], name: str, shown: bool
) -> None:
    show(chromium, road_pages[name])
    assert chromium.evaluate(HULL_SHOWN) == [shown, shown]
    chromium.click_on("#hull-shown")
    assert chromium.evaluate(HULL_SHOWN) == [not shown, not shown]
    name = "work zone" if shown else "hull"
    assert texts(chromium, "#hull-legend div")[0] == f"{name} (around all cones)"
    chromium.evaluate("map.focus()")
    chromium.press("h")
    assert chromium.evaluate(HULL_SHOWN) == [shown, shown]


def test_edges_and_gaps_are_lines_and_areas_are_filled(
    chromium: Browser, road_pages: dict[str, Path]
) -> None:
    show(chromium, road_pages["closed"])
    ends = "[...document.querySelectorAll('#map path.%s')].map((p) => p.getAttribute('d').at(-1))"
    for role in ("edge", "taper", "gap"):
        (last,) = chromium.evaluate(ends % role)
        assert last != "z", role
    for role in ("closed-area", "edge-band"):
        assert chromium.evaluate(ends % role) == ["z"], role
    pieces = "document.querySelector('#map path.edge').getAttribute('d').split('M').length - 1"
    assert chromium.evaluate(pieces) == 2
    assert {
        "edge: do not cross", "contains the edge (90 %)", "taper", "closed to traffic",
        "gap, such as an opening for access", "inside the closed area (90 %)",
    } <= set(texts(chromium, "#legend div"))  # fmt: skip


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("name", ["open", "closed", "both"])
def test_the_edge_is_plain_to_see_on_every_screen(
    chromium: Browser, road_pages: dict[str, Path], name: str, size: str
) -> None:
    show(chromium, road_pages[name], SIZES[size])
    seen = picture(chromium, f"road-{name}-{size}")
    chromium.evaluate("lines.style.display = 'none'")
    chromium.settle()
    without = picture(chromium, f"road-{name}-{size}-without")
    lost = colour_share(seen, "#1b2129") - colour_share(without, "#1b2129")
    assert lost > 0.0003  # of the screen is the edge's ink, which is the text's


def test_the_page_tells_the_edge_first(chromium: Browser, road_pages: dict[str, Path]) -> None:
    show(chromium, road_pages["open"])
    (status,) = texts(chromium, "#status")
    assert status.startswith(
        "✓ reliable All 8 cones located. The edge runs 2.9 to 3.1 m right of your path from 100 to "
        "280 m; the lane beside it is at least 2.6 m free (90 %). Behind it is an open strip"
    )
    assert "m²" not in status
    assert any(line.startswith("A taper leads 3.00 m") for line in texts(chromium, "#road li"))
    show(chromium, road_pages["no road"])
    assert chromium.evaluate("byId('road-part').hidden") is True


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_lines_stand_out_from_the_ground(
    chromium: Browser, road_pages: dict[str, Path], theme: str
) -> None:
    show(chromium, road_pages["open"], DESKTOP, theme)
    ratios = chromium.evaluate(
        """(() => {
      const light = (rgb) => rgb.map((v) => (v /= 255) <= .04045 ? v / 12.92
        : ((v + .055) / 1.055) ** 2.4).reduce((s, v, k) => s + v * [.2126, .7152, .0722][k], 0);
      const rgb = (text) => text.match(/[0-9.]+/g).slice(0, 3).map(Number);
      const ratio = (a, b) => {
        const [x, y] = [light(rgb(a)), light(rgb(b))];
        return (Math.max(x, y) + .05) / (Math.min(x, y) + .05);
      };
      const ground = getComputedStyle(document.querySelector('main')).backgroundColor;
      return ['edge', 'taper', 'gap'].map((name) =>
        ratio(getComputedStyle(document.querySelector('#map .' + name)).stroke, ground));
    })()"""
    )
    assert min(ratios) >= 4.5


def test_hostile_ids_stay_text(chromium: Browser, road_pages: dict[str, Path]) -> None:
    show(chromium, road_pages["hostile"])
    assert chromium.evaluate("document.title") == "GAIA: a drive"
    assert f"may stand in it ({HOSTILE[0]})" in " ".join(texts(chromium, "#road li"))
    count = "document.querySelectorAll('img, iframe, aside script, main script').length"
    assert chromium.evaluate(count) == 0


def test_marks_of_crowded_cones_are_small_until_there_is_room(
    chromium: Browser, road_pages: dict[str, Path]
) -> None:
    size = "document.querySelector('.place .mark').getBoundingClientRect().width"
    show(chromium, road_pages["open"], PHONE)
    chromium.evaluate("showDrive()")
    chromium.settle()
    small = chromium.evaluate(size)
    chromium.evaluate("zoom(8)")
    chromium.settle()
    assert chromium.evaluate(size) == pytest.approx(2.0 * small, rel=0.1)


def test_names_of_options_stay_whole(chromium: Browser, road_pages: dict[str, Path]) -> None:
    show(chromium, road_pages["open"], PHONE)
    assert texts(chromium, "#status code") == ["--closed-width", "--closed-lanes", "--road-edge"]
    heights = "[...document.querySelectorAll('#status code')].map((e) => e.getClientRects().length)"
    assert chromium.evaluate(heights) == [1, 1, 1]
