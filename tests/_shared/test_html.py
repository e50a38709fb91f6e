"""What a notebook shows of a scene, an episode and a reconstruction is right, small and safe."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterable
from dataclasses import replace
from html.parser import HTMLParser
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from factories import HOSTILE, SQUARE_M, make_fix, make_reason, make_reconstruction, make_unlocated
from gaia_uwb._shared.html import Mark, sketch, summary
from gaia_uwb._shared.text import printable
from gaia_uwb.estimate import AnchorStatus, Reason
from gaia_uwb.reconstruction import ReconstructionStatus
from gaia_uwb.roadside import ZoneForm
from gaia_uwb.scene import ConeRanges, Tag
from gaia_uwb.simulate import PRESETS, simulate_pass
from road_zones import STRAIGHT, make_road, make_road_result, make_zone


class Seen(HTMLParser):
    """Tags, attributes and texts of some HTML."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.attributes: set[str] = set()
        self.texts: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.attributes |= {name for name, _ in attrs}

    def handle_data(self, data: str) -> None:
        self.texts.append(data)


def test_reconstruction_shows_the_verdict_and_every_anchor() -> None:
    changed = {
        0: make_fix("cone-0", SQUARE_M[0], status=AnchorStatus.AMBIGUOUS, mirror_probability=0.4),
        3: make_unlocated("cone-3"),
    }
    reconstruction = replace(
        make_reconstruction(changed=changed), reasons=(make_reason("cone-0: side"),)
    )
    seen = Seen(reconstruction._repr_html_())
    assert seen.texts[0] == "a drive"
    assert "ok: 3 of 4 cones located, boundary ok, 6.0 m²" in seen.texts
    doubted = replace(reconstruction, status=ReconstructionStatus.UNRELIABLE)
    words = "unreliable: 3 of 4 cones located, boundary unreliable, 6.0 m²"
    assert words in Seen(doubted._repr_html_()).texts
    assert "cone-0: side" in seen.texts
    assert seen.tags.count("tr") == 5
    row = seen.texts.index("ambiguous")
    assert seen.texts[row - 1 : row + 6] == [
        "cone-0", "ambiguous", "0.00", "0.00", "0.45", "40.0%", "180",
    ]  # fmt: skip
    assert seen.texts.count("cone-3") == 1  # in the table, not in the picture
    assert seen.texts.count("cone-1") == 2


def test_a_row_of_cones_is_no_area() -> None:
    row, area = (
        Seen(make_road_result(make_road(make_zone(STRAIGHT, form=form)))._repr_html_())
        for form in (ZoneForm.ONE_ROW, ZoneForm.AREA)
    )
    assert "ok: 8 of 8 cones located, one row of cones beside the path, 180 m long" in row.texts
    assert "polygon" not in row.tags
    assert "ok: 8 of 8 cones located, boundary ok, 223.0 m²" in area.texts
    assert area.tags.count("polygon") == 1


def test_several_passes_are_all_named_and_drawn() -> None:
    one = make_reconstruction()
    other = replace(one.episode, name="another drive")
    both = replace(one, more_passes=((other, one.denoised),))
    seen = Seen(both._repr_html_())
    assert seen.texts[0] == "a drive and 1 more"
    assert seen.tags.count("polyline") == 2


def made(texts: Iterable[str]) -> tuple[Reason, ...]:
    return tuple(map(make_reason, texts))


def test_hostile_names_stay_text() -> None:
    changed = {3: make_unlocated(HOSTILE[3])}
    hostile = make_reconstruction(anchor_ids=HOSTILE, name=HOSTILE[0], changed=changed)
    harmless = make_reconstruction(changed={3: make_unlocated("cone-3")})
    for shown, usual in (
        (replace(hostile, reasons=made(HOSTILE)), replace(harmless, reasons=made("abcd"))),
        (hostile.episode, harmless.episode),
    ):
        one, other = Seen(shown._repr_html_()), Seen(usual._repr_html_())
        assert one.tags == other.tags
        assert one.attributes == other.attributes
        assert all(printable(anchor_id) in one.texts for anchor_id in HOSTILE)
    scene = simulate_pass(PRESETS["lane-closure"], seed=0)
    renamed = replace(scene, anchor_ids=(*HOSTILE, *scene.anchor_ids[4:]), name=HOSTILE[1])
    assert Seen(renamed._repr_html_()).tags == Seen(scene._repr_html_()).tags


def test_scene_and_episode_say_what_they_hold() -> None:
    scene = simulate_pass(PRESETS["lane-closure"], seed=0)
    texts = Seen(scene._repr_html_()).texts
    assert f"{len(scene.ranges)} readings of 8 cones, tied to WGS84" in texts
    counts = np.bincount(scene.ranges.anchor)
    at = texts.index("cone-1")
    assert texts[at + 1] == str(counts[0])
    reconstruction = make_reconstruction()
    texts = Seen(reconstruction.episode._repr_html_()).texts
    assert "200 steps in 19.9 s" in texts
    at = texts.index("cone-0")
    assert texts[at + 1 : at + 3] == ["180", "90%"]


def test_a_notebook_shows_what_the_reader_noted_and_found() -> None:
    scene = simulate_pass(PRESETS["lane-closure"], seed=0)
    noted = replace(scene, notes=("u.csv: <i>3</i> rows skipped",), problems=("u.csv: no clock",))
    texts = Seen(noted._repr_html_()).texts
    assert {"note: u.csv: <i>3</i> rows skipped", "u.csv: no clock"} <= set(texts)
    plain = make_reconstruction()
    result = replace(plain, episode=replace(plain.episode, notes=("no frame",)))
    assert "note: no frame" in Seen(result._repr_html_()).texts


def test_a_notebook_shows_where_the_tags_are() -> None:
    scene = simulate_pass(PRESETS["lane-closure"], seed=0)
    tags = (Tag("<b>", 1.8, -0.6), Tag("2", up_m=0.4))
    cones = ConeRanges(np.array([0, 1]), np.array([1, 2]), np.array([6.0, 6.1]))
    tag = np.resize([0, 1], len(scene.ranges))
    ranges = replace(scene.ranges, tag=tag)
    texts = Seen(replace(scene, ranges=ranges, tags=tags, cone_ranges=cones)._repr_html_()).texts
    assert "tags (m forward, left, up): <b> (1.8, -0.6, 0), 2 (0, 0, 0.4)" in texts
    assert "2 ranges between cones" in texts


def test_anchor_without_any_reading() -> None:
    scene = simulate_pass(PRESETS["lane-closure"], seed=0).without_truth()
    more = replace(scene, anchor_ids=(*scene.anchor_ids, "silent"), anchor_up_m=None)
    texts = Seen(more._repr_html_()).texts
    assert texts[texts.index("silent") + 1] == "0"


def test_truth_is_not_shown() -> None:
    scene = simulate_pass(PRESETS["lane-closure"], seed=0)
    assert scene._repr_html_() == scene.without_truth()._repr_html_()


def test_sketch_is_to_scale_with_ellipses_and_north_up() -> None:
    marks = [
        Mark("a", np.array([0.0, 0.0]), np.diag([4.0, 1.0])),
        Mark("b", np.array([10.0, 5.0]), good=False),
    ]
    root = ET.fromstring(sketch(SQUARE_M, area_m=SQUARE_M, marks=marks))
    circles = [e.attrib for e in root.iter("{http://www.w3.org/2000/svg}circle")]
    ellipse, first, second = circles
    x, y = (float(second[c]) - float(first[c]) for c in ("cx", "cy"))
    assert y == pytest.approx(-x / 2.0, abs=0.11)
    scale = x / 10.0
    matrix = np.array(ellipse["transform"][7:-1].split(), dtype=float)
    axes = np.sort(np.hypot(matrix[[0, 2]], matrix[[1, 3]]))
    assert axes == pytest.approx(scale * np.sqrt(4.605) * np.array([1.0, 2.0]), rel=0.01)
    assert first["fill"] != second["fill"]


def test_ellipse_leans_the_right_way() -> None:
    covariance_m2 = np.array([[1.0, 0.9], [0.9, 1.0]])  # towards north-east
    root = ET.fromstring(sketch(SQUARE_M, marks=[Mark("a", SQUARE_M[0], covariance_m2)]))
    ellipse = next(root.iter("{http://www.w3.org/2000/svg}circle"))
    matrix = np.array(ellipse.attrib["transform"][7:-1].split(), dtype=float)[:4].reshape(2, 2)
    longest = matrix[np.argmax(np.hypot(*matrix.T))]
    assert longest[0] * longest[1] < 0  # right and up, since y points down


@pytest.mark.parametrize("n", [0, 1, 2])
def test_sketch_of_little(n: int) -> None:
    marks = [Mark(str(k), SQUARE_M[k]) for k in range(n)]
    root = ET.fromstring(sketch(SQUARE_M[:1], area_m=SQUARE_M[:n], marks=marks))
    assert len(list(root.iter("{http://www.w3.org/2000/svg}circle"))) == n


def test_a_long_table_is_cut_and_says_so() -> None:
    html = summary("many", (), head=("id",), rows=[[str(k)] for k in range(50)])
    assert html.count("<tr>") == 21
    assert "and 30 more" in html


def test_size_of_a_long_run() -> None:
    assert len(make_reconstruction(n_steps=50_000)._repr_html_()) < 12_000


def test_needs_no_heavy_library() -> None:
    code = (
        "import sys; sys.path.insert(0, 'tests/helpers');"
        "from factories import make_reconstruction;"
        "make_reconstruction()._repr_html_();"
        "print(*sorted(set(sys.modules) & {'matplotlib', 'polars', 'pyproj', 'shapely'}))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []
