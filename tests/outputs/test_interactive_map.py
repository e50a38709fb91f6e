"""The map is one safe file that holds what the reconstruction does; ``test_map_in_browser`` and
``test_map_handling`` look at it."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from typing import Any

import numpy as np

from factories import HOSTILE, make_reason, make_reconstruction, make_unlocated
from gaia_uwb.estimate import AnchorStatus
from gaia_uwb.evaluate.residuals import range_residual_m
from gaia_uwb.outputs.geojson import boundary_geojson
from gaia_uwb.outputs.report import make_report
from map_looks import make_page


class Page(HTMLParser):
    """The tags of a page, and the text of each element by its tag or id."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.texts: dict[str, str] = {}
        self._inside = ""
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self._inside = dict(attrs).get("id") or tag

    def handle_data(self, data: str) -> None:
        self.texts[self._inside] = self.texts.get(self._inside, "") + data

    def handle_endtag(self, tag: str) -> None:
        self._inside = ""


def test_page_holds_features_and_report() -> None:
    reconstruction = make_reconstruction()
    data = json.loads(Page(make_page(reconstruction)).texts["data"])
    assert data["features"] == boundary_geojson(reconstruction, local=True)
    report: dict[str, Any] = make_report(reconstruction)
    report["boundary"].pop("uncertainty", None)  # its regions are features; its grid is not drawn
    assert data["report"] == report


def test_page_has_words_for_every_status() -> None:
    page = make_page(make_reconstruction())
    words = re.search(r"const STATUS = \{(.*?)\};", page, re.DOTALL)
    assert words is not None
    for status in AnchorStatus:
        assert re.search(rf'(?<![\w-])"?{status.value}"?: "', words[1]), status


def test_page_holds_every_range_in_centimetres() -> None:
    reconstruction = make_reconstruction(changed={3: make_unlocated("cone-3")})
    timeline = json.loads(Page(make_page(reconstruction)).texts["data"])["timeline"]
    episode = reconstruction.episode
    assert timeline["t_s"] == (episode.t_s - episode.t_s[0]).round(2).tolist()
    path_m = np.stack([timeline["east_m"], timeline["north_m"]], axis=1)
    assert np.abs(path_m - (episode.position_m - episode.position_m[0])).max() <= 0.005 + 1e-9
    for name, values_m in (
        ("range_cm", episode.range_m),
        ("denoised_cm", reconstruction.denoised.range_m),
        ("residual_cm", range_residual_m(episode, reconstruction.anchors)),
    ):
        shown = np.array(timeline[name], dtype=float).T
        assert np.array_equal(np.isnan(shown), np.isnan(values_m))
        assert np.nanmax(np.abs(shown / 100.0 - values_m)) <= 0.005 + 1e-9


def test_page_of_a_long_log_stays_small() -> None:
    angle = np.arange(50) * 2.0 * np.pi / 50
    ring_m = 20.0 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    page = make_page(make_reconstruction(ring_m, n_steps=6000))
    assert len(page.encode()) < 2_000_000
    timeline = json.loads(Page(page).texts["data"])["timeline"]
    steps = len(timeline["t_s"])
    assert 500 < steps <= 1200
    assert timeline["t_s"][-1] > 590.0
    assert all(len(column) == steps for column in timeline["range_cm"])


def test_ids_never_become_markup() -> None:
    hostile = Page(make_page(make_reconstruction(anchor_ids=HOSTILE, name=HOSTILE[0])))
    harmless = Page(make_page(make_reconstruction()))
    assert hostile.tags == harmless.tags
    data = hostile.texts.pop("data")
    assert [anchor["id"] for anchor in json.loads(data)["report"]["anchors"]] == [*HOSTILE]
    assert re.search("[<>&\u2028]", data) is None
    harmless.texts.pop("data")
    assert hostile.texts == harmless.texts


def test_reasons_never_become_markup() -> None:
    reconstruction = replace(make_reconstruction(), reasons=(make_reason(f"{HOSTILE[0]}: lost"),))
    assert Page(make_page(reconstruction)).tags == Page(make_page(make_reconstruction())).tags


def test_page_refers_to_no_other_host() -> None:
    page = make_page(make_reconstruction())
    assert set(re.findall(r"\w+://[^\"'\s)]+", page)) == {"http://www.w3.org/2000/svg"}
    assert not re.search(r"<(link|img|iframe)|\b(src|href)=|@import|url\(", page)


def test_policy_allows_nothing_but_the_pages_own_script_and_style() -> None:
    page = make_page(make_reconstruction(anchor_ids=HOSTILE))
    policy = re.search(r'http-equiv="Content-Security-Policy" content="([^"]*)"', page)
    assert policy is not None
    hashes = {
        element: base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
        for element, text in Page(page).texts.items()
        if element in ("script", "style")
    }
    assert policy[1] == (
        "default-src 'none'; base-uri 'none'; form-action 'none'; "
        f"style-src 'sha256-{hashes['style']}'; script-src 'sha256-{hashes['script']}'"
    )


def test_passes_stand_one_after_another_on_the_timeline() -> None:
    near = make_reconstruction()
    both = replace(near, more_passes=((replace(near.episode, name="again"), near.denoised),))
    timeline = json.loads(Page(make_page(both)).texts["data"])["timeline"]
    n = near.episode.n_steps
    assert timeline["starts"] == [n]
    assert len(timeline["t_s"]) == len(timeline["residual_cm"][0]) == 2 * n
    assert timeline["residual_cm"][0][:n] == timeline["residual_cm"][0][n:]
    assert np.all(np.diff(timeline["t_s"]) > 0)
