"""The picture shows what it must, hides nothing under something else, and survives odd results."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from factories import SQUARE_M, make_fix, make_reason, make_reconstruction, make_unlocated
from gaia_uwb._shared.figures import figure_png, figure_svg
from gaia_uwb.estimate import AnchorStatus
from gaia_uwb.outputs.picture import plot_reconstruction
from gaia_uwb.reconstruction import Reconstruction, ReconstructionStatus

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def site(figure: Figure) -> Axes:
    """Return the top view that names the cones: the close-up where there is one."""
    return figure.axes[-3]


def names(figure: Figure) -> list[str]:
    return [text.get_text() for text in site(figure).texts]


def legend(figure: Figure) -> list[str]:
    return [text.get_text() for text in figure.legends[0].get_texts()]


def contains(axes: Axes, places_m: np.ndarray) -> bool:
    low, high = np.array([axes.get_xlim(), axes.get_ylim()]).T
    return bool(((low < places_m) & (places_m < high)).all())


def test_close_up_only_where_the_drive_is_far_longer_than_the_zone() -> None:
    assert len(plot_reconstruction(make_reconstruction()).axes) == 4
    assert len(plot_reconstruction(make_reconstruction(SQUARE_M * 6.0)).axes) == 3


def test_both_top_views_show_what_they_must() -> None:
    reconstruction = make_reconstruction()
    figure = plot_reconstruction(reconstruction)
    assert contains(figure.axes[0], reconstruction.episode.position_m)
    for axes in figure.axes[:2]:
        assert contains(axes, SQUARE_M)
    assert np.ptp(figure.axes[1].get_xlim()) < 12.0


@pytest.mark.parametrize("stretch", [[1.0, 1.0], [8.0, 0.5], [0.5, 8.0]])
def test_a_metre_is_as_long_in_both_directions(stretch: list[float]) -> None:
    figure = plot_reconstruction(make_reconstruction(SQUARE_M * stretch))
    figure.draw_without_rendering()
    for axes in figure.axes[:-2]:
        (x0, y0), (x1, y1) = axes.transData.transform([(0.0, 0.0), (1.0, 1.0)])
        assert x1 - x0 == pytest.approx(y1 - y0)


def test_truth_only_where_it_is_given() -> None:
    reconstruction = make_reconstruction()
    assert "true position" not in legend(plot_reconstruction(reconstruction))
    figure = plot_reconstruction(reconstruction, truth_m=SQUARE_M + np.array([9.0, 0.0]))
    assert "true position" in legend(figure)
    assert contains(site(figure), SQUARE_M + np.array([9.0, 0.0]))


def test_mirror_place_only_of_an_ambiguous_cone() -> None:
    other = "other possible position of a cone"
    assert other not in legend(plot_reconstruction(make_reconstruction()))
    fix = make_fix("A", SQUARE_M[0], status=AnchorStatus.AMBIGUOUS, mirror_probability=0.4)
    figure = plot_reconstruction(make_reconstruction(changed={0: fix}))
    assert other in legend(figure)
    assert contains(site(figure), fix.mirror_position_m)


def test_names_cover_neither_each_other_nor_cones() -> None:
    crowd_m = np.concatenate([SQUARE_M, SQUARE_M[:2], SQUARE_M[2:] + 0.05])
    figure = plot_reconstruction(make_reconstruction(crowd_m))
    figure.draw_without_rendering()
    axes = site(figure)
    boxes = [text.get_window_extent() for text in axes.texts]
    assert len(boxes) == 8
    for first, second in combinations(boxes, 2):
        assert not first.overlaps(second)
    for box in boxes:
        assert not any(box.contains(*place) for place in axes.transData.transform(crowd_m))
        assert axes.bbox.contains(box.x0, box.y0) and axes.bbox.contains(box.x1, box.y1)


def test_names_without_room_are_left_out() -> None:
    heap_m = SQUARE_M[0] + 0.01 * np.random.default_rng(3).normal(size=(60, 2))
    assert 0 < len(names(plot_reconstruction(make_reconstruction(heap_m)))) < 60


def test_hopeless_or_unknown_ellipse_does_not_spoil_the_view() -> None:
    changed = {
        0: make_fix("A", SQUARE_M[0], covariance_m2=np.diag([1e6, 1e8])),
        1: make_fix("B", SQUARE_M[1], covariance_m2=np.full((2, 2), np.nan)),
    }
    figure = plot_reconstruction(make_reconstruction(changed=changed))
    assert np.ptp(site(figure).get_xlim()) < 20.0
    assert figure_png(figure)


def test_title_says_what_was_found_or_why_it_is_unreliable() -> None:
    reconstruction = make_reconstruction(changed={0: make_unlocated("cone-0")})
    texts = [text.get_text() for text in plot_reconstruction(reconstruction).texts]
    assert texts == ["a drive", "3 of 4 cones located, boundary: 6.0 m²"]
    unreliable = replace(
        reconstruction,
        status=ReconstructionStatus.UNRELIABLE,
        reasons=(make_reason("first"), make_reason("second")),
    )
    texts = [text.get_text() for text in plot_reconstruction(unreliable).texts]
    assert texts[1] == "UNRELIABLE: first; second"


def test_range_panels_show_raw_and_denoised_over_time() -> None:
    reconstruction = make_reconstruction()
    *_, upper, lower = plot_reconstruction(reconstruction).axes
    raw, clean = (np.asarray(line.get_ydata()) for line in upper.lines[:2])
    episode, denoised = reconstruction.episode, reconstruction.denoised
    assert np.array_equal(raw[:-1], episode.range_m[:, 0], equal_nan=True)
    assert np.array_equal(clean[:-1], denoised.range_m[:, 0], equal_nan=True)
    assert np.isnan(raw[-1])
    assert upper.get_xlim() == lower.get_xlim() == pytest.approx((0.0, 19.9))


def test_spikes_stay_in_sight_without_hiding_the_rest() -> None:
    reconstruction = make_reconstruction()
    range_m = reconstruction.episode.range_m.copy()
    range_m[50, 1] -= 500.0
    spiked = replace(reconstruction, episode=replace(reconstruction.episode, range_m=range_m))
    lower = plot_reconstruction(spiked).axes[-1]
    low, high = lower.get_ylim()
    assert -1.0 < low < 0.0 < high < 1.0
    changes = np.asarray(lower.lines[1].get_ydata())
    assert changes[50] == pytest.approx(low / 1.1)  # at the edge, not beyond it


def test_many_anchors_and_steps_cost_few_artists() -> None:
    angle = np.linspace(0.0, 2.0 * np.pi, 300, endpoint=False)
    circle_m = 15.0 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    figure = plot_reconstruction(make_reconstruction(circle_m, n_steps=2000))
    *_, upper, lower = figure.axes
    assert len(upper.lines) == 2 * 28
    assert len(lower.lines) == 28 + 1
    assert sum(len(np.asarray(line.get_xdata())) for line in upper.lines) < 300_000
    key = upper.get_legend()
    assert key is not None
    assert [text.get_text() for text in key.get_texts()][-2:] == ["cone-11", "and 288 more"]


def test_awkward_names_are_written_as_they_are() -> None:
    ids = ("$\\frac{", "_hidden", "施工-1", "two\nlines " + "x" * 500)
    figure = plot_reconstruction(make_reconstruction(anchor_ids=ids, name="$x_$ 施工"))
    assert figure_png(figure)
    assert sorted(names(figure)) == sorted(["$\\frac{", "_hidden", "施工-1", "two lines xxx…"])
    key = figure.axes[-2].get_legend()
    assert key is not None
    assert [text.get_text() for text in key.get_texts()][2:5] == ["$\\frac{", "_hidden", "施工-1"]


def nothing_located() -> Reconstruction:
    return make_reconstruction(changed={k: make_unlocated(f"cone-{k}") for k in range(4)})


def no_range_left() -> Reconstruction:
    whole = nothing_located()
    none = np.zeros_like(whole.episode.valid)
    empty = np.full(none.shape, np.nan)
    episode = replace(whole.episode, range_m=empty, valid=none)
    denoised = replace(whole.denoised, range_m=empty, sigma_m=empty, valid=none)
    return replace(whole, episode=episode, denoised=denoised)


def one_step() -> Reconstruction:
    whole = make_reconstruction()
    valid = whole.denoised.valid[100:101]
    denoised = replace(
        whole.denoised, range_m=whole.denoised.range_m[100:101],
        sigma_m=whole.denoised.sigma_m[100:101], valid=valid,
    )  # fmt: skip
    return replace(whole, episode=whole.episode.window(100, 101), denoised=denoised)


@pytest.mark.parametrize("make", [nothing_located, no_range_left, one_step])
def test_degenerate_results_are_drawn_too(make: Callable[[], Reconstruction]) -> None:
    png = figure_png(plot_reconstruction(make()))
    assert png.startswith(b"\x89PNG\r\n\x1a\n")


def test_png_has_the_promised_size_and_is_the_same_again() -> None:
    first, second = (figure_png(plot_reconstruction(make_reconstruction())) for _ in range(2))
    assert first == second
    assert int.from_bytes(first[16:20]) == 1100
    assert int.from_bytes(first[20:24]) == 990


def test_leaves_pyplot_alone() -> None:
    code = (
        "import sys; from factories import make_reconstruction; "
        "from gaia_uwb._shared.figures import figure_png; "
        "from gaia_uwb.outputs.picture import plot_reconstruction; "
        "figure_png(plot_reconstruction(make_reconstruction())); "
        "print('matplotlib.pyplot' in sys.modules)"
    )
    helpers = Path(__file__).parents[1] / "helpers"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=helpers, capture_output=True, text=True, check=True
    )
    assert done.stdout == "False\n"


def test_svg_is_the_same_picture_again_and_whole() -> None:
    hostile = ("--><script>x</script>", "\x1b[31m", "a\x00b", "\u2028")
    reconstruction = make_reconstruction(anchor_ids=hostile, name="<a>&\x07 \ud800")
    first, second = (figure_svg(plot_reconstruction(reconstruction)) for _ in range(2))
    assert first == second
    root = ET.fromstring(first.encode())
    assert root.attrib["viewBox"] == "0 0 720 648"
    tags = {element.tag.rpartition("}")[2] for element in root.iter()}
    assert "script" not in tags
    assert "image" in tags  # the dots
    assert len(first) < 400_000


def test_settings_of_the_user_do_not_count() -> None:
    from matplotlib import rc_context

    def drawn() -> tuple[bytes, str]:
        figure = plot_reconstruction(make_reconstruction())
        return figure_png(figure), figure_svg(figure)

    before = drawn()
    with rc_context({"text.usetex": True, "font.size": 40, "savefig.facecolor": "red"}):
        assert drawn() == before
