"""What a log holds besides one tag's ranges is counted, and what it decides is said rightly."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gaia_uwb.evaluate.log_check import check_scene
from gaia_uwb.evaluate.log_evidence import evidence_of
from gaia_uwb.scene import ConeRanges, Scene, Tag
from gaia_uwb.simulate import PRESETS, simulate_pass
from road_tags import road_drive_with_tags


@pytest.fixture(scope="module")
def two_tags() -> Scene:
    return simulate_pass(PRESETS["two-tags"], 3)


def test_a_log_of_one_tag_holds_nothing_else() -> None:
    scene = simulate_pass(PRESETS["straight"], 0)
    assert evidence_of(scene) == ()
    assert evidence_of(replace(scene, tags=(Tag("front", 1.5),))) == ()


@pytest.mark.parametrize(
    ("levers", "says", "tells"),
    [
        (
            [(0.0, 0.8), (0.0, -0.8)],
            "2 tags, 1.60 m apart across the vehicle: they tell sides",
            True,
        ),
        ([(2.0, 0.1), (0.0, 0.0)], "2 tags, 2.00 m apart along the vehicle and 0.10 m", False),
        ([(0.8, 0.0), (0.0, 0.3), (0.0, 0.0)], "3 tags, 0.30 m apart across the vehicle", True),
    ],
)
def test_tags_tell_sides_where_they_are_apart_across(
    levers: list[tuple[float, float]], says: str, tells: bool
) -> None:
    (found,) = evidence_of(road_drive_with_tags(0, levers))
    assert found.text.startswith(says)
    assert found.tells_sides == tells
    assert ("they tell no sides" in found.text) != tells


def test_a_tag_that_is_never_heard_tells_nothing(two_tags: Scene) -> None:
    assert two_tags.ranges.tag is not None
    first = replace(
        two_tags.ranges,
        tag=np.zeros(len(two_tags.ranges), np.int64),
        t_s=np.arange(len(two_tags.ranges)) * 0.01,
    )
    assert evidence_of(replace(two_tags, ranges=first)) == ()


@pytest.mark.parametrize(
    ("sigma_deg", "says", "tells"),
    [
        (10.0, "in 50 of 1,381 readings, 10° in the median: they tell sides", True),
        (60.0, "in 50 of 1,381 readings, 60° in the median: too coarse to tell sides", False),
        (None, "of unknown accuracy", False),
    ],
)
def test_angles_tell_sides_where_they_are_good(
    sigma_deg: float | None, says: str, tells: bool
) -> None:
    scene = simulate_pass(PRESETS["angles"], 3)
    azimuth_rad = np.where(np.arange(len(scene.ranges)) < 50, 0.5, np.nan)
    sigma_rad = None if sigma_deg is None else np.full(len(scene.ranges), np.radians(sigma_deg))
    log = replace(scene.ranges, azimuth_rad=azimuth_rad, azimuth_sigma_rad=sigma_rad)
    (found,) = evidence_of(replace(scene, ranges=log))
    assert says in found.text
    assert found.tells_sides == tells
    none = replace(log, azimuth_rad=np.full(len(log), np.nan), azimuth_sigma_rad=None)
    assert evidence_of(replace(scene, ranges=none)) == ()


def test_cones_that_are_hardly_heard_are_named() -> None:
    scene = simulate_pass(PRESETS["straight"], 0)
    a, b = np.array([0, 1, 1, 4]), np.array([1, 0, 2, 1])
    scene = replace(scene, cone_ranges=ConeRanges(a, b, np.full(4, 9.0)))
    (found,) = evidence_of(scene)
    assert found.text.startswith("4 ranges between 3 pairs of 4 cones: they place cones that the")
    assert "here" not in found.text
    assert not found.tells_sides
    log = scene.ranges
    keep = (log.anchor != 1) & (log.anchor != 7)  # the other is ranged by none
    rows = {name: getattr(log, name)[keep] for name in ("t_s", "anchor", "range_m")}
    (found,) = evidence_of(replace(scene, ranges=type(log)(**rows), truth=None))
    assert "hardly hears (here cone-2), and" in found.text


def test_several_tags_are_checked_one_by_one(two_tags: Scene) -> None:
    steps = []
    report = check_scene(two_tags, progress=lambda done, total: steps.append((done, total)))
    assert [tag.name for tag in report.tags] == [f"{two_tags.name} (tag tag-{k})" for k in (1, 2)]
    assert report.anchors == ()
    n_readings = [sum(anchor.n_readings for anchor in tag.anchors) for tag in report.tags]
    assert n_readings == np.bincount(two_tags.ranges.tag).tolist()
    assert steps == [(k, 16) for k in range(16)]
    lines = report.lines()
    assert lines[0] == two_tags.name
    assert lines[2].startswith("  evidence: 2 tags, 1.60 m apart across the vehicle")
    assert lines.index(report.tags[0].name) < lines.index(report.tags[1].name)
    assert not any("straight" in note or "alone" in note for note in report.notes)
    content = report.as_json()
    assert content["evidence"] == list(report.evidence)
    assert [tag["name"] for tag in content["tags"]] == [tag.name for tag in report.tags]
    assert all("traceback" not in tag for tag in (content, *content["tags"]))


def test_sides_stay_open_where_no_evidence_tells_them() -> None:
    report = check_scene(road_drive_with_tags(0, [(0.8, 0.0), (-0.8, 0.0)]))
    assert (
        "the path is straight: each cone and its mirror position fit equally well" in report.notes
    )
    angles = check_scene(road_drive_with_tags(0, [(0.0, 0.0)], angle_sigma_deg=10.0))
    assert not any("straight" in note or "alone" in note for note in angles.notes)
    assert angles.name == "road-tags-0"
    assert angles.tags == ()
    assert len(angles.evidence) == 1


def test_a_problem_of_one_tag_is_one_of_the_log(two_tags: Scene) -> None:
    log = two_tags.ranges
    assert log.tag is not None
    keep = (log.tag == 0) | (log.anchor != 3)
    rows = {name: getattr(log, name)[keep] for name in ("t_s", "anchor", "range_m", "tag")}
    report = check_scene(replace(two_tags, ranges=type(log)(**rows), truth=None))
    assert "cone-4: no readings" in report.problems
    assert "cone-4: no readings" in report.tags[1].problems
    assert "cone-4: no readings" not in report.tags[0].problems


def test_a_vehicle_that_stands_without_a_heading_has_a_problem(two_tags: Scene) -> None:
    path = two_tags.trajectory
    stands = replace(path, position_m=np.zeros_like(path.position_m))
    report = check_scene(replace(two_tags, trajectory=stands))
    assert len(report.problems) == 1
    assert "a lever arm needs a heading" in report.problems[0]
    assert report.readable
