"""Heights that do not belong together, paths that jump, and what a good log does not say."""

from dataclasses import replace

import numpy as np
import pytest

from gaia_uwb.alignment import log_problems
from gaia_uwb.alignment.implausible import spike_problems
from gaia_uwb.episode import ReadingCounts
from gaia_uwb.estimate import ReasonKind
from gaia_uwb.scene import RangeLog, Scene, Trajectory
from gaia_uwb.simulate import PRESETS, simulate_pass

T_S = np.arange(0.0, 30.0, 0.1)
PATH_M = np.column_stack([3.0 * T_S, 4.0 * np.sin(0.3 * T_S)])
PLACES_M = np.array([[20.0, 9.0], [40.0, 10.0], [60.0, -9.0], [75.0, 9.0]])


def make_scene(*, up_m: float | None = 2.0, gap_m: float = 1.5) -> Scene:
    """Return a drive at 3 m/s past four anchors that stand below the tag."""
    rng = np.random.default_rng(3)
    far_m = np.sqrt(((PATH_M[:, None] - PLACES_M) ** 2).sum(axis=2) + gap_m**2)
    far_m += 0.03 * rng.standard_normal(far_m.shape)
    step, anchor = np.nonzero(np.ones_like(far_m, dtype=bool))
    log = RangeLog(T_S[step], anchor, far_m[step, anchor])
    heights = None if up_m is None else np.full(len(T_S), up_m)
    ids = tuple(f"c{n}" for n in range(len(PLACES_M)))
    anchor_up_m = None if up_m is None else np.full(len(ids), up_m - gap_m)
    return Scene("drive", Trajectory(T_S, PATH_M, heights), log, ids, anchor_up_m)


def words(scene: Scene) -> list[str]:
    return [reason.text for reason in log_problems(scene)]


def test_a_good_log_has_no_problem() -> None:
    assert words(make_scene()) == words(make_scene(up_m=None)) == []


def test_what_the_reader_found_comes_first() -> None:
    (reason,) = log_problems(replace(make_scene(), problems=("row 3: time jumps back",)))
    assert (reason.kind, reason.text) == (ReasonKind.LOG, "row 3: time jumps back")


@pytest.mark.parametrize(("height_m", "said"), [(523.0, "521 m above"), (-60.0, "62.0 m below")])
def test_heights_that_count_from_elsewhere(height_m: float, said: str) -> None:
    scene = replace(make_scene(), anchor_up_m=np.array([height_m, height_m, np.nan, height_m]))
    assert words(scene)[0].startswith(f"the anchors lie {said} the tag: up_m counts from the local")


def test_a_height_gap_that_is_longer_than_the_ranges() -> None:
    """Anchors may be on a bridge, but no range is shorter than the gap."""
    assert words(make_scene(up_m=25.0, gap_m=24.0)) == []
    scene = replace(make_scene(), anchor_up_m=np.full(4, 26.0))
    assert words(scene)[0].startswith("the anchors lie 24.0 m above the tag")


def test_heights_in_centimetres_climb_faster_than_any_road() -> None:
    scene = make_scene()
    up_m = 100.0 * (520.0 + 0.3 * np.sin(0.4 * T_S))
    steep = replace(scene, trajectory=replace(scene.trajectory, up_m=up_m), anchor_up_m=None)
    assert words(steep)[0].startswith("the tag's height changes by 59.9 m over 93.0 m")
    hill = replace(scene, trajectory=replace(scene.trajectory, up_m=0.15 * PATH_M[:, 0]))
    assert not [text for text in words(hill) if "height changes" in text]


@pytest.mark.parametrize("side_m", [3.0, -40.0, 500.0])
def test_a_path_that_jumps_is_named_with_place_and_size(side_m: float) -> None:
    scene = make_scene()
    jumped_m = PATH_M + np.where(T_S[:, None] >= 12.0, [0.0, side_m], 0.0)
    (problem, *_) = words(replace(scene, trajectory=replace(scene.trajectory, position_m=jumped_m)))
    assert problem.startswith(f"the path jumps by {abs(side_m):.{2 if side_m == 3 else 0}f}"[:24])
    assert "within 0.1 s at 12.0 s: was the fix lost?" in problem


def test_driving_hard_and_gaps_are_no_jumps() -> None:
    t_s = np.arange(0.0, 30.0, 1.0)
    speed_mps = np.where(t_s < 12, 25.0, np.maximum(25.0 - 8.0 * (t_s - 12), 0.0))
    path_m = np.column_stack([np.cumsum(speed_mps), 0.1 * t_s**1.5])
    kept = (t_s < 4) | (t_s > 9)
    braking = Trajectory(t_s[kept], path_m[kept])
    scene = replace(make_scene(up_m=None), trajectory=braking)
    assert not [text for text in words(scene) if "jumps" in text]


@pytest.mark.parametrize(("spikes", "told"), [(0, False), (25, False), (26, True), (75, True)])
def test_more_than_a_third_of_an_anchor_lost_as_spikes(spikes: int, told: bool) -> None:
    """Of 100 readings 25 are outside the path, where nobody can tell what they are."""
    counts = ReadingCounts(100, 75 - spikes, spikes, 0, 25, n_steps=60)
    reasons = list(spike_problems({"a": counts, "silent": ReadingCounts(0, 0, 0, 0, 0, n_steps=0)}))
    assert [reason.cones for reason in reasons] == [("a",)] * told
    assert all(f"a: {spikes} of its 75 readings" in reason.text for reason in reasons)


@pytest.mark.parametrize(("n_negative", "told"), [(1, False), (3, True)])
def test_ranges_below_zero(n_negative: int, told: bool) -> None:
    scene = simulate_pass(PRESETS["lane-closure"], seed=0)
    log = scene.ranges
    range_m = log.range_m.copy()
    mine = np.flatnonzero(log.anchor == 3)
    range_m[mine[np.arange(len(mine)) % 6 < n_negative]] = -1.0
    found = list(log_problems(replace(scene, ranges=replace(log, range_m=range_m))))
    assert any("ranges are below 0" in reason.text for reason in found) is told
