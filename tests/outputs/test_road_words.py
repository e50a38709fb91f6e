"""The report and the terminal tell a driver's edge first, and the hull last, as the paper's."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from factories import HOSTILE, make_reconstruction
from gaia_uwb._shared import in_markdown
from gaia_uwb.cli.terminal import print_summary
from gaia_uwb.config import make_config
from gaia_uwb.outputs.plain_words import people_report
from gaia_uwb.outputs.road_words import edge_words, hull_leads, summary_words, zone_words
from gaia_uwb.roadside import DroveThrough, RoadBoundary, RoadSide, ZoneForm
from gaia_uwb.zone import Region
from road_zones import (
    AT_M,
    STRAIGHT,
    closed_strip,
    ids_of,
    lane_between,
    make_edge,
    make_road,
    make_road_result,
    make_zone,
    with_road,
)

EDGE = (
    "The edge runs 2.9 to 3.1 m right of your path from 100 to 280 m; the lane beside it is at "
    "least 2.6 m free (90 %)."
)
HULL = "The convex hull of the cones, the paper's boundary, has 5 corners"


def part(report: str, heading: str) -> list[str]:
    return report.partition(f"## {heading}\n\n")[2].partition("\n\n")[0].splitlines()


def details(boundary: RoadBoundary) -> str:
    return "\n".join(zone_words(make_road_result(boundary), in_markdown))


def test_an_open_row_is_told_by_its_edge_and_the_hull_comes_last() -> None:
    report = people_report(make_road_result(make_road(make_zone(STRAIGHT))))
    first = report.splitlines()[2]
    assert first.startswith(f"**Reliable.** All 8 cones were located. {EDGE} Behind it is an open")
    assert "`--closed-width`, `--closed-lanes` or `--road-edge` to get an area." in first
    found = part(report, "What was found")
    assert found[-1].startswith(f"- {HULL}")
    assert not any("covers" in line for line in found[:-1])
    assert "work zone with" not in "\n".join(part(report, "Confidence"))


def test_a_closed_area_is_the_area_that_is_told() -> None:
    zone = make_zone(STRAIGHT, make_edge(STRAIGHT, ids_of(8)), closed=closed_strip(STRAIGHT))
    report = people_report(make_road_result(make_road(zone)))
    assert f"{EDGE} 648 m² are closed to traffic." in report.splitlines()[2]
    assert "- Closed to traffic: 648 m², as wide as stated, without what was driven over." in part(
        report, "What was found"
    )
    inner_m2, outer_m2 = (region.area_m2 for region in (zone.closed.inner, zone.closed.outer))
    assert (
        f"- A region of {inner_m2:.0f} m² is closed with 90 % confidence; all that is closed lies "
        f"within a region of {outer_m2:.0f} m² with 90 % confidence."
    ) in part(report, "Confidence")
    nothing = replace(zone, closed=replace(zone.closed, inner=Region((), 0.0)))
    report = people_report(make_road_result(make_road(nothing)))
    assert "No area can be called closed with 90 % confidence" in report


def test_ends_form_and_taper_against_the_manual() -> None:
    shares = {ZoneForm.ONE_ROW: 0.9, ZoneForm.AREA: 0.095, ZoneForm.WORKS_BETWEEN: 0.005}
    words = details(make_road(make_zone(STRAIGHT, probability=shares)))
    assert (
        "Form of the zone: one row of cones beside the path (90 % probability); or cones around an "
        "area (10 %)."
    ) in words
    assert (
        "The first cone is cone-0, at 100 m (± 0.20 m, 90 %); the last one is cone-7, at 280 m "
        "(± 0.20 m, 90 %): 180 m in all."
    ) in words
    assert (
        "A taper leads 3.00 m into the road over 40.0 m, from cone-0 to cone-2; at the 90 km/h "
        "that were driven, the manual (MUTCD) asks for 78.0 m: it is too short."
    ) in words


@pytest.mark.parametrize(
    ("asked_m", "said"), [(40.0, "asks for 40.0 m: it is long enough."), (np.nan, "to cone-2.")]
)
def test_a_taper_may_be_long_enough_or_have_no_length_to_keep(asked_m: float, said: str) -> None:
    edge = make_edge(STRAIGHT, ids_of(8))
    taper = replace(edge.tapers[0], asked_m=asked_m)
    words = details(make_road(make_zone(STRAIGHT, replace(edge, tapers=(taper,)))))
    (line,) = re.findall("A taper.*", words)
    assert line.endswith(said)
    assert ("manual" in line) is bool(np.isfinite(asked_m))


def test_a_form_that_was_stated_is_told_as_such() -> None:
    boundary = make_road(make_zone(STRAIGHT))
    config = make_config({"boundary": {"form": "one-row"}})
    result = with_road(replace(make_road_result(boundary), config=config), boundary)
    words = "\n".join(zone_words(result, in_markdown))
    assert "Form of the zone: one row of cones beside the path, as stated." in words
    assert "Form of the zone: one row of cones beside the path (more than 99 %" in details(boundary)


def told_with(boundary: RoadBoundary, **stated: object) -> str:
    """Return summary and details of a result with statements."""
    config = make_config({"boundary": stated})
    result = with_road(replace(make_road_result(boundary), config=config), boundary)
    return "\n".join([summary_words(result), *zone_words(result, in_markdown)])


def test_a_stated_form_that_the_places_refute_is_told_with_what_it_leaves_out() -> None:
    share = {ZoneForm.ONE_ROW: 0.0, ZoneForm.LANE_BETWEEN: 1.0}
    zone = make_zone(STRAIGHT, probability=share)
    zone = replace(zone, cones=(*zone.cones, "left-1", "left-2"))
    words = told_with(make_road(zone), form="one-row")
    assert (
        "one row of cones beside the path, as stated; by the places of the cones it is rather two "
        "rows of cones, with the lane that was driven between them (more than 99 %)."
    ) in words
    assert "As a zone of this form, it has no place for left-1, left-2." in words


def test_a_road_edge_that_is_not_behind_the_cones_is_told_not_asked_for() -> None:
    words = told_with(make_road(make_zone(STRAIGHT)), road_edge=[[11.0, 48.0], [11.1, 48.0]])
    assert "open strip: the road's edge that was given does not run behind the cones" in words
    assert "to get an area" not in words


def test_gaps_are_named_and_may_hold_a_cone_that_was_not_located() -> None:
    edge = make_edge(STRAIGHT, ids_of(8), unlocated=("lost_1", "lost-2"))
    words = details(make_road(make_zone(STRAIGHT, edge)))
    assert (
        "Between cone-4 and cone-5 is a gap of 60.0 m, such as an opening for access; cones "
        "usually stand 20.0 m apart. A cone without a position to go by may stand in it "
        r"(lost\_1, lost-2)."
    ) in words


def test_an_edge_without_a_settled_side_says_so() -> None:
    sure, open_ = (make_edge(STRAIGHT, ids_of(8), side_probability=p) for p in (0.999, 0.8))
    assert edge_words(sure).startswith("runs 2.9 to 3.1 m right of your path from")
    assert edge_words(open_).startswith("runs 2.9 to 3.1 m right (80 %) of your path from")


def test_both_rows_have_an_edge_each_and_a_lane_between() -> None:
    boundary = make_road(lane_between(STRAIGHT))
    summary = summary_words(make_road_result(boundary))
    assert "The left edge runs 3.0 m left of your path" in summary
    assert "The right edge runs 3.0 m right of your path" in summary
    assert (
        "The lane between the edges is 6.00 m wide at its narrowest, at 100 m, and at least 5.50 m"
    ) in details(boundary)
    assert "On the left: Between left-4" in details(boundary)


def test_several_zones_are_numbered() -> None:
    far = make_edge(STRAIGHT, ids_of(8, "far"), station_m=AT_M + 1300.0)
    passed = DroveThrough(0.83, 1400.0, 1410.0, ("far-0", "far-1"))
    boundary = make_road(make_zone(STRAIGHT), make_zone(STRAIGHT, far, drove_through=passed))
    summary = summary_words(make_road_result(boundary))
    assert summary.startswith(f"There are 2 work zones. Zone 1: {EDGE}")
    assert "Zone 2: The edge runs 2.9 to 3.1 m right of your path from 1,400 to 1,580 m" in summary
    assert (
        "Zone 2: The vehicle drove through the zone (83 % probability), from 1,400 to 1,410 m, "
        "past far-0, far-1."
    ) in details(boundary)


def test_the_range_across_leaves_tapers_out_and_nothing_is_less_than_free() -> None:
    edge = make_edge(STRAIGHT, ids_of(8), side=RoadSide.LEFT)
    assert edge_words(edge).startswith("runs 2.9 to 3.1 m left of your path")
    whole = replace(edge, tapers=())
    assert edge_words(whole).startswith("runs 2.9 to 6.0 m left of your path")
    blocked = replace(edge, free=replace(edge.free, at_least_m=-0.3))
    assert "is at least 0.0 m free" in edge_words(blocked)


def test_an_area_is_told_by_its_hull_as_before() -> None:
    boundary = make_road(make_zone(STRAIGHT, form=ZoneForm.AREA))
    report = people_report(make_road_result(boundary))
    assert "The work zone covers 223 m²." in report.splitlines()[2]
    found = part(report, "What was found")
    assert found[0].startswith("- The work zone has 5 corners")
    assert f"- {EDGE}" in found
    assert "paper's boundary" not in report
    assert hull_leads(boundary) and hull_leads(None) and hull_leads(make_road())


def test_without_a_road_the_report_is_as_before() -> None:
    plain = people_report(make_reconstruction())
    assert people_report(with_road(make_reconstruction(), None)) == plain
    assert people_report(with_road(make_reconstruction(), make_road())) == plain


def test_hostile_ids_stay_text() -> None:
    edge = make_edge(STRAIGHT, (*HOSTILE, *ids_of(4)), unlocated=HOSTILE[:1])
    report = people_report(make_road_result(make_road(make_zone(STRAIGHT, edge))))
    for line in part(report, "What was found"):
        assert not re.search(r"(?<!\\)[<>`*\[]", line)


def test_the_terminal_tells_the_edge_first(capsys: pytest.CaptureFixture[str]) -> None:
    print_summary(make_road_result(make_road(make_zone(STRAIGHT))), None, [])
    lines = capsys.readouterr().out.splitlines()
    assert lines[1] == f"  edge: {EDGE.removeprefix('The edge ').removesuffix('.')}"
    assert lines[2] == "  closed area: unknown, an open strip; one row of cones beside the path"
    assert lines[-1] == "  hull (the paper's boundary): ok, 223.0 m²"
    print_summary(make_road_result(make_road(lane_between(STRAIGHT))), None, [])
    lines = capsys.readouterr().out.splitlines()
    assert [line.partition(":")[0] for line in lines[1:4]] == [
        "  left edge", "  right edge", "  closed area",
    ]  # fmt: skip
    print_summary(make_reconstruction(), None, [])
    assert "  boundary: ok, 12.0 m²" in capsys.readouterr().out.splitlines()
