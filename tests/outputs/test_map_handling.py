"""The map follows a mouse, fingers and keys; it shows moments of the drive and measures."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from browser import Browser
from factories import HOSTILE, make_reconstruction
from map_looks import PHONE, RADII, picture, place, show, texts

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
    assert texts(chromium, "#tip") == [f"{HOSTILE[0]}other position, 37 % probability"]
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
    assert chromium.evaluate(role) == "cone-0, located, ±\u00a00.45\u00a0m (90\u00a0%)"
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
    radii = chromium.evaluate(RADII)
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
    assert texts(chromium, "#measured-text") == ["7.00 m in total, area 6.0 m²"]
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
    assert texts(chromium, "#measured-text") == ["Click the next point"]
