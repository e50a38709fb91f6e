"""Scores of edges, ends, forms and closed areas, for errors that are known."""

from __future__ import annotations

import numpy as np
import pytest

from cones_beside import BEND, STRAIGHT, drive, zones_of
from factories import make_reconstruction
from gaia_uwb._shared import InputError
from gaia_uwb.config import BoundaryConfig
from gaia_uwb.evaluate import reconstruct_and_score, score_road
from gaia_uwb.evaluate.road_scores import compare
from road_forms import road_form
from roads import Numbers, Road

STATION_M = 100.0 + 15.0 * np.arange(20)
STATED = BoundaryConfig(closed_width_m=4.0)


def scores_of(
    true_m: Numbers, estimate_m: Numbers, *, road: Road = BEND, sigma_m: float = 0.1
) -> dict[str, float]:
    drives = [drive(road, 0.0, 500.0)]
    found = zones_of(drives, estimate_m, sigma_m=sigma_m, config=STATED)
    true = zones_of(drives, true_m, n_scenes=1, config=STATED)
    metrics = compare(found, true, [drives[0].position_m])
    return {name: metric.value for name, metric in metrics.items()}


def test_what_is_right_has_no_error() -> None:
    cones_m = BEND.place(STATION_M, -3.0)
    scores = scores_of(cones_m, cones_m)
    for name in ("edge_error_mean", "edge_error_worst", "zone_start_error", "free_width_error"):
        assert scores[name] == pytest.approx(0.0, abs=1e-6)
    for name in ("edge_found_share", "edge_band_coverage_90", "zone_form_right"):
        assert scores[name] == 1.0
    assert scores["closed_area_iou"] == pytest.approx(1.0)
    assert scores["path_in_closed_area"] == scores["path_in_inner_region"] == 0.0
    assert scores["inner_region_right"] == scores["outer_region_right"] == 1.0


@pytest.mark.parametrize("aside_m", [0.3, -0.5])
def test_an_edge_that_is_aside_errs_by_that(aside_m: float) -> None:
    scores = scores_of(BEND.place(STATION_M, -3.0), BEND.place(STATION_M, -3.0 + aside_m))
    for name in ("edge_error_mean", "edge_error_95", "edge_error_worst", "free_width_error"):
        assert scores[name] == pytest.approx(abs(aside_m), abs=0.02)
    assert scores["edge_band_coverage_90"] == 0.0
    expected_iou = (4.0 - abs(aside_m)) / (4.0 + abs(aside_m))
    assert scores["closed_area_iou"] == pytest.approx(expected_iou, abs=0.01)
    assert scores["zone_start_error"] == pytest.approx(0.0, abs=0.1)


def test_a_zone_that_is_further_along_errs_at_its_ends() -> None:
    scores = scores_of(
        STRAIGHT.place(STATION_M, -3.0), STRAIGHT.place(STATION_M + 2.0, -3.0), road=STRAIGHT
    )
    assert scores["zone_start_error"] == pytest.approx(2.0, abs=0.05)
    assert scores["zone_end_error"] == pytest.approx(2.0, abs=0.05)
    assert scores["zone_ends_coverage_90"] == 0.0
    assert scores["edge_error_mean"] == pytest.approx(0.0, abs=0.01)
    assert scores["edge_found_share"] == pytest.approx(283 / 285, abs=0.005)


def test_the_wrong_side_is_not_found_and_has_no_error() -> None:
    scores = scores_of(BEND.place(STATION_M, -3.0), BEND.place(STATION_M, 3.0))
    assert scores["edge_found_share"] == 0.0
    assert "edge_error_mean" not in scores
    assert "free_width_error" not in scores
    assert scores["closed_area_iou"] == 0.0
    assert scores["inner_region_right"] == 0.0


def test_another_form_is_wrong() -> None:
    cones_m = BEND.place(STATION_M, -3.0)
    wrong_m = BEND.place(STATION_M, np.where(np.arange(20) == 3, 3.0, -3.0))
    assert scores_of(cones_m, wrong_m)["zone_form_right"] == 0.0


def test_a_path_inside_the_closed_area_is_told() -> None:
    """The area of one drive, and a second one that leads through it."""
    cones_m = STRAIGHT.place(STATION_M, -3.0)
    first, second = drive(STRAIGHT, 0.0, 500.0), drive(STRAIGHT, 0.0, 500.0, -5.0)
    found = zones_of([first], cones_m, sigma_m=0.1, config=STATED)
    scores = compare(found, found, [first.position_m, second.position_m])
    assert scores["path_in_closed_area"].value == pytest.approx(285.0, abs=0.5)
    assert 270.0 < scores["path_in_inner_region"].value < 285.0


def test_without_truth_or_possible_places_there_is_nothing_to_score() -> None:
    result = make_reconstruction()
    with pytest.raises(InputError, match="expected an episode with its truth"):
        score_road(result, result.episode)


def test_a_log_is_scored_with_its_edges() -> None:
    case = road_form(5)
    _, metrics = reconstruct_and_score(case.drives[0])
    assert metrics is not None
    assert metrics["edge_error_mean"].value < 0.3
    assert {"polygon_iou", "zone_start_error", "zone_form_right"} <= metrics.keys()
