"""Readings that contradict the others of their anchor, and logs in which most do."""

from dataclasses import replace

import numpy as np
import pytest

from gaia_uwb.alignment.contradictions import contradicted_anchors, contradicting
from gaia_uwb.estimate import ReasonKind
from gaia_uwb.pipeline import prepare
from gaia_uwb.scene import RangeLog, Scene, Trajectory
from gaia_uwb.simulate import PRESETS, simulate_pass

T_S = np.arange(0.0, 30.0, 0.1)
PATH_M = np.column_stack([3.0 * T_S, 4.0 * np.sin(0.3 * T_S)])


def heard_from(*places_m: tuple[float, float], heard_every: int = 1) -> Scene:
    """Return a drive along which one anchor after the other of each id answers."""
    rng = np.random.default_rng(3)
    far_m = np.stack([np.hypot(*(PATH_M - place).T) for place in places_m], axis=1)
    far_m += 0.03 * rng.standard_normal(far_m.shape)
    step, anchor = np.nonzero(np.ones_like(far_m[::heard_every], dtype=bool))
    log = RangeLog(T_S[::heard_every][step], anchor, far_m[::heard_every][step, anchor])
    ids = tuple(f"c{n}" for n in range(len(places_m)))
    return Scene("drive", Trajectory(T_S, PATH_M), log, ids)


def test_two_radios_with_one_id_are_named() -> None:
    scene = heard_from((20.0, 9.0), (40.0, 10.0), (60.0, -9.0))
    assert not list(contradicted_anchors(scene))
    # What c2 hears now comes from its own place and from one 30 m away in turn.
    log = scene.ranges
    range_m = log.range_m.copy()
    mine = np.flatnonzero(log.anchor == 2)[::2]
    at_m = np.stack([np.interp(log.t_s[mine], T_S, axis) for axis in PATH_M.T], axis=1)
    range_m[mine] = np.hypot(*(at_m - [35.0, 8.0]).T)
    (reason,) = contradicted_anchors(replace(scene, ranges=replace(log, range_m=range_m)))
    assert (reason.kind, reason.cones) == (ReasonKind.LOG, ("c2",))
    assert reason.numbers["half_beyond_m"] > 2.5


def test_a_few_spikes_are_no_reason() -> None:
    scene = heard_from((20.0, 9.0))
    range_m = scene.ranges.range_m.copy()
    range_m[::5] += 4.0
    scene = replace(scene, ranges=replace(scene.ranges, range_m=range_m))
    assert contradicting(T_S, range_m, scene.trajectory).sum() == pytest.approx(60, abs=3)
    assert not list(contradicted_anchors(scene))


@pytest.mark.parametrize("place", [0, 1, 2, -1, -2, -3])
def test_a_spike_at_an_end_is_found_and_no_neighbour_blamed(place: int) -> None:
    scene = heard_from((20.0, 9.0))
    range_m = scene.ranges.range_m.copy()
    range_m[place] += 50.0
    found = np.flatnonzero(contradicting(T_S, range_m, scene.trajectory))
    assert found.tolist() == [place % len(T_S)]


@pytest.mark.parametrize("every", [1, 5])
@pytest.mark.parametrize("speed_mps", [1.5, 6.0, 25.0])
def test_speed_makes_no_contradictions_and_hides_none(speed_mps: float, every: int) -> None:
    preset = PRESETS["lane-closure"]
    clean = {"burst_per_s": 0.0, "held_share": 0.0, "nlos_bias_m": 0.0}
    drive = {"speed_mps": speed_mps, "duration_s": max(30.0, 200.0 / speed_mps)}
    config = preset.model_copy(
        update={
            "ranging": preset.ranging.model_copy(update=clean),
            "drive": preset.drive.model_copy(update=drive),
        }
    )
    scene = simulate_pass(config, seed=0)
    log = scene.ranges
    for n in range(scene.n_anchors):
        own = np.flatnonzero(log.anchor == n)[::every]
        t_s, range_m = log.t_s[own], log.range_m[own].copy()
        found = contradicting(t_s, range_m, scene.trajectory)
        assert found.mean() < 0.01
        if n == 0 and len(own) >= 20:  # fewer do not tell which of them is wrong
            range_m[len(own) // 2] += 8.0
            spoilt = contradicting(t_s, range_m, scene.trajectory)
            assert np.flatnonzero(spoilt & ~found).tolist() == [len(own) // 2]


def test_a_long_log_is_judged_by_a_part_of_it(monkeypatch: pytest.MonkeyPatch) -> None:
    from gaia_uwb.alignment import contradictions

    scene = heard_from((20.0, 9.0))
    range_m = scene.ranges.range_m.copy()
    range_m[::2] += 5.0
    spoilt = replace(scene, ranges=replace(scene.ranges, range_m=range_m))
    (whole,) = contradicted_anchors(spoilt)
    seen: list[int] = []
    judge = contradictions.contradicting

    def counted_judge(*args: object) -> object:
        seen.append(len(args[3]))  # type: ignore[arg-type]
        return judge(*args)  # type: ignore[arg-type]

    monkeypatch.setattr(contradictions, "_MOST_LOOKED_AT", 100)
    monkeypatch.setattr(contradictions, "contradicting", counted_judge)
    (part,) = contradicted_anchors(spoilt)
    assert seen[0] <= 100
    assert part.numbers["share"] == pytest.approx(whole.numbers["share"], abs=0.1)


def test_the_clock_offset_is_taken_into_account() -> None:
    scene = heard_from((20.0, 9.0))
    late = replace(scene, ranges=replace(scene.ranges, t_s=scene.ranges.t_s + 500.0))
    assert not list(contradicted_anchors(late, 500.0))


def test_notes_and_problems_of_a_log_stay_with_its_episode() -> None:
    scene = heard_from((20.0, 9.0), (40.0, 10.0), (60.0, -9.0))
    episode = prepare(replace(scene, notes=("a", "b"), problems=("time stood still",)))
    assert episode.notes[:2] == ("a", "b")
    assert [str(problem) for problem in episode.problems] == ["time stood still"]
    assert episode.window(0, 50).problems == episode.problems
