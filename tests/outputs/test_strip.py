"""A long zone is drawn straightened, where metres across the road can be seen."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import pytest

from factories import HOSTILE, make_fix
from gaia_uwb._shared.figures import figure_png, figure_svg
from gaia_uwb.estimate import AnchorStatus
from gaia_uwb.outputs.drawn_cones import DrawnCones
from gaia_uwb.outputs.picture import plot_reconstruction
from gaia_uwb.outputs.strip import needs_strip
from gaia_uwb.roadside import RoadBoundary, ZoneForm
from road_zones import (
    AT_M,
    BAND_M,
    BESIDE_M,
    STRAIGHT,
    bend,
    closed_strip,
    ids_of,
    lane_between,
    make_edge,
    make_road,
    make_road_result,
    make_zone,
    s_curve,
    with_road,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def draw(boundary: RoadBoundary) -> Figure:
    figure = plot_reconstruction(make_road_result(boundary))
    figure.draw_without_rendering()
    return figure


def strip(figure: Figure) -> Axes:
    return figure.axes[-3]


def lines(axes: Axes, label: str) -> list[np.ndarray]:
    """Return the lines of a label, and those like them that follow without one."""
    (first,) = [line for line in axes.lines if line.get_label() == label]
    return [
        np.asarray(line.get_xydata()) for line in axes.lines
        if (line.get_color(), line.get_linestyle(), line.get_linewidth())
        == (first.get_color(), first.get_linestyle(), first.get_linewidth())
    ]  # fmt: skip


def legend(figure: Figure) -> list[str]:
    return [text.get_text() for text in figure.legends[0].get_texts()]


@pytest.mark.parametrize("line", [STRAIGHT, bend(), s_curve()])
def test_edges_are_where_their_cones_are_along_the_road(line: object) -> None:
    edge = make_edge(line, ids_of(8))
    figure = draw(make_road(make_zone(line, edge), line=line))
    pieces = lines(strip(figure), "edge")
    assert len(pieces) == 2
    for piece, rows in zip(pieces, (slice(0, 5), slice(5, 8)), strict=True):
        assert piece[[0, -1], 0] == pytest.approx(AT_M[rows][[0, -1]], abs=0.05)
        for at_m, beside_m in zip(AT_M[rows], BESIDE_M[rows], strict=True):
            nearest = piece[np.argmin(np.abs(piece[:, 0] - at_m))]
            assert nearest == pytest.approx([at_m, -beside_m], abs=0.15)
    (gap,) = lines(strip(figure), "gap")
    assert gap == pytest.approx(np.array([[180.0, -2.9], [240.0, -3.0]]), abs=0.02)


def test_the_map_stands_small_beside_the_strip() -> None:
    figure = draw(make_road(make_zone(STRAIGHT)))
    overview, along, *_ = figure.axes
    assert len(figure.axes) == 4
    assert along.bbox.width > 2.5 * overview.bbox.width
    assert along.get_xlabel() == "along the road (m)"
    low_m, high_m = along.get_xlim()
    assert low_m < 100.0 and high_m > 280.0 and high_m - low_m < 1.3 * 180.0
    # A metre across is much wider than a metre along.
    (x0, y0), (x1, y1) = along.transData.transform([(0.0, 0.0), (1.0, 1.0)])
    assert y1 - y0 > 5.0 * (x1 - x0)
    # From above nothing is the hull: a sliver from the first cone to the last.
    assert not any(patch.get_label() == "boundary" for patch in overview.patches)


@pytest.mark.parametrize(
    ("boundary", "wanted"),
    [
        (make_road(make_zone(STRAIGHT)), True),
        (make_road(lane_between(STRAIGHT)), True),
        (make_road(make_zone(STRAIGHT, form=ZoneForm.AREA)), False),
        (make_road(), False),
        (None, False),
    ],
)
def test_only_long_rows_are_straightened(boundary: RoadBoundary | None, wanted: bool) -> None:
    assert needs_strip(boundary) is wanted


def test_a_short_row_is_seen_from_above() -> None:
    short = make_edge(STRAIGHT, ids_of(3), station_m=np.array([100.0, 105.0, 110.0]),
                      beside_m=np.full(3, 3.0), taper_rows=None)  # fmt: skip
    boundary = make_road(make_zone(STRAIGHT, short))
    assert not needs_strip(boundary)
    assert "boundary" not in legend(draw(boundary))


def test_bands_areas_tapers_and_open_strips_are_in_the_legend() -> None:
    closed = make_zone(STRAIGHT, make_edge(STRAIGHT, ids_of(8)), closed=closed_strip(STRAIGHT))
    always = {"path of the vehicle's antenna", "edge", "contains the edge (90 %)", "taper", "gap",
              "cone, ± 90 %"}  # fmt: skip
    assert set(legend(draw(make_road(make_zone(STRAIGHT))))) == always | {
        "behind the edge: no width known"
    }
    assert set(legend(draw(make_road(closed)))) == always | {
        "closed to traffic", "closed for sure (90 %)", "contains what is closed (90 %)",
    }  # fmt: skip


def test_labels_come_once_however_many_zones_there_are() -> None:
    far = make_edge(STRAIGHT, ids_of(8, "far"), station_m=AT_M + 100.0)
    labels = legend(draw(make_road(lane_between(STRAIGHT), make_zone(STRAIGHT, far))))
    assert len(labels) == len(set(labels))


def test_everything_near_is_in_sight() -> None:
    figure = draw(make_road(lane_between(bend()), line=bend()))
    low_m, high_m = strip(figure).get_ylim()
    assert low_m < -3.0 - BAND_M and 3.0 + BAND_M < high_m < 12.0


def test_error_bars_are_ninety_percent_along_and_across() -> None:
    boundary = make_road(make_zone(STRAIGHT))
    figure = draw(boundary)
    along, across = (c for c in strip(figure).collections if hasattr(c, "get_segments"))
    half_m = 1.645 * np.sqrt(0.02)
    for bars, axis in ((along, 0), (across, 1)):
        for bar in bars.get_segments():
            assert np.ptp(bar, axis=0)[axis] / 2.0 == pytest.approx(half_m, rel=0.01)
            assert np.ptp(bar, axis=0)[1 - axis] == 0.0


def test_both_places_of_an_undecided_cone_are_drawn() -> None:
    boundary = make_road(make_zone(STRAIGHT))
    result = make_road_result(boundary)
    fixes = list(result.anchors)
    place_m = fixes[3].position_m
    fixes[3] = make_fix("cone-3", place_m, status=AnchorStatus.AMBIGUOUS, mirror_probability=0.4,
                        mirror_position_m=place_m + np.array([0.0, 6.2]))  # fmt: skip
    object.__setattr__(result, "anchors", tuple(fixes))
    axes = strip(plot_reconstruction(with_road(result, boundary)))
    (other,) = [line for line in axes.lines
                if line.get_label() == "other possible position of a cone"]  # fmt: skip
    assert np.asarray(other.get_xydata()) == pytest.approx(np.array([[160.0, 3.1]]))
    assert axes.get_ylim()[1] > 3.1


def test_unknown_ellipses_stay_unknown_along_the_road() -> None:
    result = make_road_result(make_road(make_zone(STRAIGHT)))
    fixes = list(result.anchors)
    fixes[0] = make_fix("cone-0", fixes[0].position_m, covariance_m2=np.full((2, 2), np.nan))
    object.__setattr__(result, "anchors", tuple(fixes))
    cones = DrawnCones.of(result).along(STRAIGHT)
    assert np.isnan(cones.ellipse_m[0]).all() and np.isfinite(cones.ellipse_m[1:]).all()
    assert figure_png(plot_reconstruction(with_road(result, make_road(make_zone(STRAIGHT)))))


def test_the_title_tells_the_edge() -> None:
    texts = [text.get_text() for text in draw(make_road(make_zone(STRAIGHT))).texts]
    assert " ".join(texts[1:]).startswith(
        "All 8 cones located. The edge runs 2.9 to 3.1 m right of your path from 100 to 280 m;"
    )
    assert all(len(text) <= 136 for text in texts)


def test_truth_is_drawn_along_the_road_too() -> None:
    result = make_road_result(make_road(make_zone(STRAIGHT)))
    truth_m = np.array([fix.position_m for fix in result.anchors])
    axes = strip(plot_reconstruction(result, truth_m=truth_m))
    (truth,) = [line for line in axes.lines if line.get_label() == "true position"]
    assert np.asarray(truth.get_xydata()) == pytest.approx(np.column_stack([AT_M, -BESIDE_M]))


def test_hostile_ids_are_written_as_they_are() -> None:
    edge = make_edge(STRAIGHT, (*HOSTILE, *ids_of(4)))
    svg = figure_svg(plot_reconstruction(make_road_result(make_road(make_zone(STRAIGHT, edge)))))
    assert "<script>" not in svg


def test_names_do_not_cover_an_edge() -> None:
    figure = draw(make_road(make_zone(bend()), line=bend()))
    axes = strip(figure)
    assert len(axes.texts) == 8
    for piece in lines(axes, "edge"):
        along = np.concatenate([np.linspace(a, b, 20) for a, b in pairwise(piece)])
        pixels = axes.transData.transform(along)
        for text in axes.texts:
            box = text.get_window_extent()
            assert not any(box.contains(*pixel) for pixel in pixels)


@pytest.mark.parametrize("form", [ZoneForm.ONE_ROW, ZoneForm.LANE_BETWEEN])
def test_the_legend_is_no_wider_than_the_picture(form: ZoneForm) -> None:
    row = make_zone(STRAIGHT) if form is ZoneForm.ONE_ROW else lane_between(STRAIGHT)
    result = make_road_result(make_road(row))
    fixes = [make_fix(f.anchor_id, f.position_m, status=AnchorStatus.AMBIGUOUS,
                      mirror_probability=0.4) for f in result.anchors]  # fmt: skip
    object.__setattr__(result, "anchors", tuple(fixes))
    figure = plot_reconstruction(with_road(result, make_road(row)))
    figure.draw_without_rendering()
    box, page = figure.legends[0].get_window_extent(), figure.bbox
    assert page.x0 <= box.x0 and box.x1 <= page.x1
