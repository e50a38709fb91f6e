from dataclasses import fields, replace
from typing import Any, Literal

import numpy as np
import pytest

from drives_past import with_moved_anchor
from gaia_uwb._shared.errors import ConfigError, InputError
from gaia_uwb.config import (
    BoundaryConfig,
    PipelineConfig,
    PriorConfig,
    SidesConfig,
    SolverConfig,
    make_config,
)
from gaia_uwb.estimate import AnchorFix, AnchorStatus, ReasonKind
from gaia_uwb.pipeline import (
    _listed,
    prepare,
    reconstruct,
    reconstruct_episodes,
    reconstruct_passes,
)
from gaia_uwb.reconstruction import ReconstructionStatus
from gaia_uwb.scene import RangeLog, Scene, Trajectory, Truth
from gaia_uwb.simulate import PRESETS, find_preset, simulate_episodes, simulate_zone

RAW = PipelineConfig(denoiser="raw")
CONES = np.array([[10.0, 6.0], [18.0, 5.0], [26.0, 6.5], [20.0, 11.0], [12.0, 10.0]])


def make_scene(cones=CONES, *, bend_m=4.0, seed=0, seconds=20.0, stop_s=np.inf):
    """Return a drive at 2 m/s past cones; after ``stop_s`` nothing is heard of the last one."""
    rng = np.random.default_rng(seed)
    t_s = np.arange(0.0, seconds, 0.1)
    path = np.stack([2.0 * t_s, bend_m * np.sin(0.5 * t_s) - 2.0], axis=1)
    range_m = np.linalg.norm(path[:, None] - cones, axis=2)
    range_m += 0.05 * rng.standard_normal(range_m.shape)
    step, anchor = np.nonzero(np.ones_like(range_m, dtype=bool))
    use = (anchor < len(cones) - 1) | (t_s[step] < stop_s)
    step, anchor = step[use], anchor[use]
    return Scene(
        name="drive", trajectory=Trajectory(t_s, path),
        ranges=RangeLog(t_s[step], anchor, range_m[step, anchor]),
        anchor_ids=tuple(f"cone-{n}" for n in range(len(cones))), truth=Truth(cones),
    )  # fmt: skip


def assert_same(a, b, rounding=0.0):
    assert (a.status, a.config) == (b.status, b.config)
    assert [reason.kind for reason in a.reasons] == [reason.kind for reason in b.reasons]
    assert a.boundary.hull_m == pytest.approx(b.boundary.hull_m, abs=rounding, rel=0.0)
    assert np.array_equal(a.denoised.range_m, b.denoised.range_m, equal_nan=True)
    for one, other in zip(a.anchors, b.anchors, strict=True):
        for field in fields(AnchorFix):
            x, y = getattr(one, field.name), getattr(other, field.name)
            if isinstance(x, (np.ndarray, float)):
                same = y == pytest.approx(x, abs=rounding, rel=rounding, nan_ok=True)
            else:
                same = x == y
            assert same, field.name


def test_a_clean_drive_gives_the_zone():
    result = reconstruct(make_scene())
    places = np.stack([anchor.position_m for anchor in result.anchors])
    assert np.linalg.norm(places - CONES, axis=1).max() < 0.2
    assert result.status is ReconstructionStatus.OK
    assert result.reasons == ()
    assert result.episode.truth is None
    assert result.config == PipelineConfig()


@pytest.mark.parametrize("denoiser", ["raw", "pose-kalman"])
def test_the_truth_is_never_looked_at(denoiser):
    config = PipelineConfig(denoiser=denoiser)
    scene = make_scene()
    wrong = Truth(np.random.default_rng(1).normal(0, 99, CONES.shape), clock_offset_s=5.0,
                  nlos=np.ones(len(scene.ranges), dtype=bool))  # fmt: skip
    plain = reconstruct(scene.without_truth(), config)
    assert_same(plain, reconstruct(replace(scene, truth=wrong), config))
    assert_same(plain, reconstruct(scene, config))
    with_truth = prepare(replace(scene, truth=wrong), config)
    assert_same(plain, reconstruct_episodes([with_truth], config)[0])


@pytest.mark.parametrize("denoiser", ["raw", "pose-kalman"])
def test_a_batch_gives_what_each_episode_alone_gives(denoiser):
    config = PipelineConfig(denoiser=denoiser)
    run = prepare(make_scene(), config)
    episodes = [*run.windows(64), run, prepare(make_scene(seed=2, stop_s=3.0), config)]
    together = reconstruct_episodes(episodes, config)
    for episode, result in zip(episodes, together, strict=True):
        # Sums over a batch are rounded otherwise than those of an episode alone.
        assert_same(result, reconstruct_episodes([episode], config)[0], rounding=1e-8)


def test_no_episodes_give_no_results():
    assert reconstruct_episodes([]) == []


def test_calibration_can_be_left_out():
    off = make_config({"calibration": {"range_bias": "off"}})
    assert prepare(make_scene(), off).calibration is None
    assert prepare(make_scene()).calibration is not None


def test_true_labels_are_for_the_papers_solver():
    scene = make_scene()
    config = PipelineConfig(denoiser="raw", solver=SolverConfig(kind="wls"))
    episode = prepare(scene, config)
    nlos = np.random.default_rng(3).random(episode.range_m.shape) < 0.5
    (labelled,) = reconstruct_episodes([episode], config, true_nlos=[nlos])
    (plain,) = reconstruct_episodes([episode], config)
    assert not np.array_equal(labelled.anchors[0].position_m, plain.anchors[0].position_m)


def test_other_solvers_refuse_true_labels():
    episode = prepare(make_scene(), RAW)
    with pytest.raises(ValueError, match="takes no NLOS labels"):
        reconstruct_episodes([episode], RAW, true_nlos=[np.zeros_like(episode.valid)])


def test_a_straight_path_is_unreliable_and_says_so():
    result = reconstruct(make_scene(CONES[:2], bend_m=0.0), RAW)
    assert result.status is ReconstructionStatus.UNRELIABLE
    assert tuple(map(str, result.reasons)) == (
        "both cones: side ambiguous: the mirror position fits almost as well",
    )


def test_one_cone_has_no_edge_and_two_have() -> None:
    kinds = {
        n: {reason.kind for reason in reconstruct(make_scene(CONES[:n]), RAW).reasons}
        for n in (1, 2)
    }
    assert ReasonKind.TOO_FEW_CONES in kinds[1]
    assert ReasonKind.TOO_FEW_CONES not in kinds[2]


def test_a_road_edge_without_a_place_on_the_earth_is_told_before_the_work() -> None:
    edge = BoundaryConfig(road_edge=((11.5, 48.1), (11.6, 48.1)))
    with pytest.raises(ConfigError, match="where the local frame is on the Earth"):
        prepare(make_scene(), PipelineConfig(boundary=edge))


def test_cones_in_a_row_are_no_reason_for_doubt() -> None:
    row_m = np.stack([np.linspace(10.0, 50.0, 5), np.full(5, 4.0)], axis=1)
    result = reconstruct(make_scene(row_m, bend_m=0.5), RAW)
    assert ReasonKind.COLLINEAR not in {reason.kind for reason in result.reasons}
    assert result.road_boundary is not None
    (zone,) = result.road_boundary.zones
    assert (zone.form.value, len(zone.edges[0].cones)) == ("one-row", 5)


def test_an_anchor_hardly_heard_is_named():
    result = reconstruct(make_scene(stop_s=0.25), RAW)
    assert result.anchors[-1].status is AnchorStatus.TOO_FEW_RANGES
    (reason,) = result.reasons
    assert (reason.kind, reason.cones) == (ReasonKind.TOO_FEW_RANGES, ("cone-4",))
    assert str(reason) == "cone-4: too few usable ranges"
    assert len(result.boundary.outline_index) == 4


def seldom_read(scene: Scene, cone: int, every: int, first: int = 0) -> Scene:
    """Return a scene with only every so many readings of a cone."""
    log = scene.ranges
    own = np.flatnonzero(log.anchor == cone)
    keep = np.ones(len(log), dtype=bool)
    keep[np.setdiff1d(own, own[first::every])] = False
    ranges = RangeLog(log.t_s[keep], log.anchor[keep], log.range_m[keep])
    return replace(scene, ranges=ranges)


@pytest.mark.parametrize("denoiser", ["raw", "gaia-set"])
def test_a_fix_counts_readings_not_steps(denoiser: str) -> None:
    scene = seldom_read(make_scene(), cone=1, every=10)
    result = reconstruct(scene, PipelineConfig(denoiser=denoiser))
    assert result.episode.valid[:, 1].sum() > 150
    assert [fix.n_ranges for fix in result.anchors] == [
        result.episode.readings[fix.anchor_id].kept for fix in result.anchors
    ]
    # The clock that is found can put the first or the last reading outside the path.
    assert 19 <= result.anchors[1].n_ranges <= 20
    twice = reconstruct([scene, make_scene(seed=1)], PipelineConfig(denoiser=denoiser))
    assert 19 + 198 <= twice.anchors[1].n_ranges <= 20 + 200


@pytest.mark.parametrize("denoiser", ["raw", "gaia-set"])
def test_three_readings_do_not_locate_a_cone_however_many_steps_they_give(denoiser: str) -> None:
    scene = seldom_read(make_scene(), cone=1, every=25, first=5)
    log = scene.ranges
    keep = (log.anchor != 1) | (log.t_s < 6.0)  # at 0.5, 3 and 5.5 s
    scene = replace(scene, ranges=RangeLog(log.t_s[keep], log.anchor[keep], log.range_m[keep]))
    result = reconstruct(scene, PipelineConfig(denoiser=denoiser))
    assert result.anchors[1].status is AnchorStatus.TOO_FEW_RANGES
    assert result.anchors[1].n_ranges == 3
    assert all(fix.status.has_position for fix in result.anchors if fix.anchor_id != "cone-1")


def test_many_anchors_are_not_all_listed():
    cones = np.column_stack([np.linspace(2.0, 38.0, 8), np.full(8, 6.0)])
    config = RAW.model_copy(update={"solver": SolverConfig(ill_conditioned_above_m=1e-3)})
    result = reconstruct(make_scene(cones), config)
    expected = "all 8 cones: position poorly determined in at least one direction"
    assert expected in map(str, result.reasons)
    ids, n_all = [f"cone-{k}" for k in range(8)], 9
    assert _listed(ids, n_all) == "cone-0, cone-1, cone-2, cone-3, cone-4 and 3 more"


def test_what_cannot_be_done_is_said():
    scene = make_scene()
    with pytest.raises(ConfigError, match="no-such"):
        reconstruct(scene, PipelineConfig(denoiser="no-such"))
    ranges = replace(scene.ranges, t_s=scene.ranges.t_s + 3600.0)
    with pytest.raises(InputError):
        reconstruct(replace(scene, ranges=ranges))


def test_what_speaks_against_the_whole_log_makes_it_unreliable():
    scene = make_scene()
    log = scene.ranges

    def kinds(t_s, range_m):
        ranges = RangeLog(t_s, log.anchor, range_m)
        result = reconstruct(replace(scene, ranges=ranges, truth=None))
        assert result.status is ReconstructionStatus.UNRELIABLE
        return {reason.kind for reason in result.reasons}

    assert ReasonKind.MISFIT in kinds(log.t_s, log.range_m * 3.28084)
    assert ReasonKind.RANGE_BIAS in kinds(log.t_s, log.range_m + 2.0)


def test_a_clock_far_off_is_found_with_the_cones():
    scene = make_scene()
    late = replace(scene, ranges=replace(scene.ranges, t_s=scene.ranges.t_s + 2.4))
    result = reconstruct(late, RAW)
    assert result.status is ReconstructionStatus.OK
    assert result.episode.clock.applied_s == pytest.approx(2.4, abs=0.03)
    places = np.stack([anchor.position_m for anchor in result.anchors])
    assert np.linalg.norm(places - CONES, axis=1).max() < 0.1


def test_a_clock_that_the_drive_does_not_determine_makes_it_unreliable():
    rng = np.random.default_rng(0)
    t_s = np.arange(0.0, 20.0, 0.1)
    path_m = np.stack([8.0 * t_s - 80.0, np.zeros(len(t_s))], axis=1)
    step = np.arange(40, 160).repeat(len(CONES))  # nothing is heard near the ends
    anchor = np.tile(np.arange(len(CONES)), 120)
    range_m = np.hypot(*(path_m[step] - CONES[anchor]).T) + rng.normal(0.0, 0.05, len(step))
    ids = tuple(f"cone-{n}" for n in range(len(CONES)))
    log = RangeLog(t_s[step], anchor, range_m)
    result = reconstruct(Scene("straight", Trajectory(t_s, path_m), log, ids), RAW)
    (reason,) = [each for each in result.reasons if each.kind is ReasonKind.CLOCK]
    assert reason.numbers["sigma_s"] == pytest.approx(0.5, rel=0.05)
    along_m = np.array([np.sqrt(anchor.covariance_m2[0, 0]) for anchor in result.anchors])
    assert along_m == pytest.approx(4.0, rel=0.1)  # 0.5 s at 8 m/s


def knowing(offset_s, sigma_s):
    """Return settings under which the clock offset of a log that names no vehicle is known."""
    known = {"clock_offset_s": {"value": offset_s, "sigma": sigma_s}}
    return make_config({"denoiser": "raw", "vehicles": {"": known}})


def test_a_clock_that_is_known_gives_a_straight_drive_its_places_along_the_road():
    rng = np.random.default_rng(0)
    t_s = np.arange(0.0, 20.0, 0.1)
    path_m = np.stack([8.0 * t_s - 80.0, np.zeros(len(t_s))], axis=1)
    step = np.arange(40, 160).repeat(len(CONES))
    anchor = np.tile(np.arange(len(CONES)), 120)
    range_m = np.hypot(*(path_m[step] - CONES[anchor]).T) + rng.normal(0.0, 0.05, len(step))
    ids = tuple(f"cone-{n}" for n in range(len(CONES)))
    scene = Scene(
        "straight", Trajectory(t_s, path_m), RangeLog(t_s[step] + 0.7, anchor, range_m), ids
    )
    result = reconstruct(scene, knowing(0.7, 0.005))
    assert ReasonKind.CLOCK not in {each.kind for each in result.reasons}
    assert result.episode.clock.applied_s == pytest.approx(0.7)
    places = np.stack([anchor.position_m for anchor in result.anchors])
    assert np.abs(places[:, 0] - CONES[:, 0]).max() < 0.15


def test_a_log_that_contradicts_what_is_known_of_its_clock_is_unreliable():
    scene = make_scene()
    result = reconstruct(scene, knowing(0.3, 0.01))
    (reason,) = [each for each in result.reasons if each.kind is ReasonKind.VEHICLE]
    assert reason.numbers["said"] == pytest.approx(0.0, abs=0.02)
    assert result.status is ReconstructionStatus.UNRELIABLE
    assert not reconstruct(scene, knowing(0.0, 0.01)).reasons


def test_of_passes_that_contradict_their_vehicle_one_tells_it():
    result = reconstruct(simulate_zone(PRESETS["lane-closure"], seed=3), knowing(0.5, 0.01))
    kinds = [each.kind for each in result.reasons]
    assert kinds.count(ReasonKind.VEHICLE) == 1


def test_a_bent_drive_is_sure_of_its_zone_and_a_straight_one_is_not_sure_of_the_side():
    bent, straight = (reconstruct(make_scene(bend_m=bend_m)) for bend_m in (4.0, 0.0))
    area_m2 = bent.boundary.area_m2
    found = bent.boundary_uncertainty
    assert 0.7 * area_m2 < found.inner.area_m2 < area_m2 < found.outer.area_m2 < 1.5 * area_m2
    assert bent.boundary_uncertainty is found  # worked out once
    assert straight.boundary_uncertainty.inner.area_m2 == 0.0
    corners_m = np.concatenate([r for p in straight.boundary_uncertainty.outer.polygons for r in p])
    assert corners_m[:, 1].min() < -10.0 < 4.0 < corners_m[:, 1].max()  # beyond both sides
    assert ReasonKind.AMBIGUOUS in {reason.kind for reason in straight.reasons}


def test_fewer_than_three_anchors_have_no_boundary_to_be_unsure_of():
    assert reconstruct(make_scene(CONES[:2])).boundary_uncertainty is None


def two_lanes(seed=0, **changes):
    return simulate_zone(PRESETS["straight"].model_copy(update=changes), seed)


def test_a_second_lane_settles_the_sides():
    near, far = two_lanes(seed=3)
    alone, together = reconstruct(near), reconstruct([near, far])
    assert alone.status is ReconstructionStatus.UNRELIABLE
    assert any(fix.status is AnchorStatus.AMBIGUOUS for fix in alone.anchors)
    assert together.status is ReconstructionStatus.OK
    assert max(fix.mirror_probability for fix in together.anchors) < 1e-3
    places = np.stack([fix.position_m for fix in together.anchors])
    assert np.linalg.norm(places - near.truth.anchor_m, axis=1).max() < 0.4
    names = [episode.name for episode, _ in together.passes]
    assert names == [near.name, far.name]
    assert together.name == f"{near.name} and 1 more"
    assert together.passes[0][0].clock != together.passes[1][0].clock


def test_the_order_of_passes_changes_nothing():
    near, far = two_lanes(seed=1)
    assert_same(reconstruct([near, far], RAW), reconstruct([far, near], RAW))


def test_a_single_pass_in_a_list_is_that_pass():
    near, _ = two_lanes()
    assert_same(reconstruct([near], RAW), reconstruct(near, RAW))


@pytest.mark.parametrize("denoiser", ["raw", "pose-kalman"])
def test_windows_of_one_run_fused_give_the_run(denoiser):
    config = PipelineConfig(denoiser=denoiser)
    run = prepare(make_scene().without_truth(), config)
    windows = [run.window(k, min(k + 64, run.n_steps)) for k in range(0, run.n_steps, 16)]
    fused = reconstruct_passes(windows, config)
    assert_same(fused, reconstruct_episodes([run], config)[0])


def test_a_pass_counts_once():
    run = prepare(make_scene().without_truth(), RAW)
    assert_same(reconstruct_passes([run, run], RAW), reconstruct_episodes([run], RAW)[0])


def test_an_anchor_moved_between_passes_makes_the_result_unreliable():
    near, far = two_lanes(seed=3)
    result = reconstruct([near, with_moved_anchor(far, 2, (1.0, -0.5))], RAW)
    assert [fix.anchor_id for fix in result.anchors if fix.status is AnchorStatus.MOVED] == [
        "cone-3"
    ]
    assert result.status is ReconstructionStatus.UNRELIABLE
    about = {reason.kind: reason.cones for reason in result.reasons}
    assert about[ReasonKind.PASSES_APART] == about[ReasonKind.MOVED] == ("cone-3",)


def test_a_pass_with_other_anchors_joins_the_zone():
    near, far = two_lanes(seed=3)
    few = far.ranges.anchor < 3
    log = far.ranges
    part = replace(
        far, anchor_ids=(*far.anchor_ids[:2], "new"), anchor_up_m=far.anchor_up_m[:3], truth=None,
        ranges=RangeLog(log.t_s[few], log.anchor[few], log.range_m[few]),
    )  # fmt: skip
    result = reconstruct([near, part], RAW)
    assert [fix.anchor_id for fix in result.anchors] == [*near.anchor_ids, "new"]
    for episode, ranges in result.passes:
        assert episode.anchor_ids == (*near.anchor_ids, "new")
        assert ranges.valid.shape == episode.valid.shape
    new, third = result.anchors[-1], near.truth.anchor_m[2]
    both = np.stack([new.position_m, new.mirror_position_m])
    assert np.linalg.norm(both - third, axis=1).min() < 0.6


def test_what_is_wrong_with_one_pass_names_it():
    near, far = two_lanes(seed=3)
    wrong = replace(far, ranges=replace(far.ranges, range_m=far.ranges.range_m + 2.0))
    reasons = reconstruct([near, wrong], RAW).reasons
    (bias,) = [reason for reason in reasons if reason.kind is ReasonKind.RANGE_BIAS]
    assert bias.passes == (far.name,)
    assert bias.text.startswith(f"{far.name}: range bias of")
    assert f"{bias.numbers['bias_m']:+.2f} m" in bias.text
    assert not any(near.name in reason.passes for reason in reasons)


def test_the_ellipses_of_two_passes_cover():
    inside = []
    for seed in range(8):
        near, far = two_lanes(seed=seed)
        for fix, true_m in zip(reconstruct([near, far]).anchors, near.truth.anchor_m, strict=True):
            off = fix.position_m - true_m
            inside.append(off @ np.linalg.solve(fix.covariance_m2, off) < 2.0 * np.log(10.0))
    assert np.mean(inside) > 0.8


def test_a_denoiser_that_knows_work_zones_locates_their_anchors() -> None:
    (episode,) = simulate_episodes(find_preset("wild-test"), 1, seed=3)
    ours = PipelineConfig(denoiser="gaia-set")
    (found,) = reconstruct_episodes([episode], ours)
    zone = found.denoised.zone
    assert zone is not None
    for n, anchor in enumerate(found.anchors):
        places = [zone.place_m[n, side].tolist() for side in (0, 1)]
        assert anchor.position_m.tolist() in places
        assert anchor.mirror_position_m.tolist() in places
    assert found.boundary_uncertainty is not None


@pytest.mark.parametrize(
    "changes", [{"sides": SidesConfig(joint=False)}, {"solver": SolverConfig(kind="wls")}]
)
def test_it_has_no_say_where_another_solver_is_asked_for(changes: dict[str, Any]) -> None:
    (episode,) = simulate_episodes(find_preset("wild-test"), 1, seed=3)
    config = PipelineConfig(denoiser="gaia-set").model_copy(update=changes)
    (found,) = reconstruct_episodes([episode], config)
    zone = found.denoised.zone
    assert zone is not None
    for n, anchor in enumerate(found.anchors):
        assert np.abs(zone.place_m[n] - anchor.position_m).max(axis=1).min() > 1e-6


@pytest.mark.parametrize("side", ["left", "right"])
def test_what_is_known_is_weighed_with_its_places(side: Literal["left", "right"]) -> None:
    (episode,) = simulate_episodes(find_preset("wild-test"), 1, seed=3)
    config = PipelineConfig(denoiser="gaia-set", prior=PriorConfig(side=side))
    (found,) = reconstruct_episodes([episode], config)
    zone = found.denoised.zone
    assert zone is not None
    for n, anchor in enumerate(found.anchors):
        assert anchor.position_m.tolist() in zone.place_m[n].tolist()
    on_it = [zone.place_m[n, "lr".index(side[0])] for n in range(episode.n_anchors)]
    there = [a.position_m.tolist() == p.tolist() for a, p in zip(found.anchors, on_it, strict=True)]
    assert all(there)
    # No cone is left ambiguous, though a single one may stand elsewhere than was said.
    assert max(anchor.mirror_probability for anchor in found.anchors) < 0.1


def test_what_a_locating_denoiser_found_is_no_evidence_of_places_to_the_solver() -> None:
    near, far = two_lanes(seed=3)
    drawn, measured = (
        reconstruct([near, far], PipelineConfig(denoiser=name)) for name in ("gaia-set", "raw")
    )
    assert str(drawn.anchors) == str(measured.anchors)
    assert not np.array_equal(drawn.denoised.range_m, measured.denoised.range_m, equal_nan=True)
    (episode,) = simulate_episodes(find_preset("wild-test"), 1, seed=3)
    apart = SidesConfig(joint=False)
    alone = [
        reconstruct_episodes([episode], PipelineConfig(denoiser=name, sides=apart))[0].anchors
        for name in ("gaia-set", "raw")
    ]
    assert str(alone[0]) == str(alone[1])


def test_what_the_reader_noted_and_found_reaches_the_result():
    scene = replace(make_scene(), notes=("uwb.csv: 3 rows left out",))
    result = reconstruct(scene)
    assert (result.status, result.notes[:1]) == (ReconstructionStatus.OK, scene.notes)
    result = reconstruct(replace(scene, problems=("uwb.csv, row 7: time jumps back",)))
    assert result.status is ReconstructionStatus.UNRELIABLE
    (reason,) = result.reasons
    assert (reason.kind, str(reason)) == (ReasonKind.LOG, "uwb.csv, row 7: time jumps back")


def test_notes_of_several_passes_name_their_pass():
    far, near = make_scene(seed=1), replace(make_scene(seed=2, bend_m=-3.0), name="near")
    result = reconstruct([replace(far, notes=("late",)), replace(near, notes=("short", "wet"))])
    own = [note for note in result.notes if ":" in note[:6]]
    assert own == ["drive: late", "near: short", "near: wet"]
    of_both = "no geographic reference: results are in local metres, and no feed can be written"
    assert result.notes.count(of_both) == 1


def test_cones_that_were_driven_over_have_no_edge() -> None:
    rng = np.random.default_rng(4)
    t_s = np.arange(0.0, 40.0, 0.1)
    path_m = np.stack([3.0 * t_s, np.zeros(len(t_s))], axis=1)
    reading = np.repeat(np.arange(len(t_s)), 4)
    anchor = np.tile(np.arange(4), len(t_s))
    cones_m = np.stack([np.array([30.0, 50.0, 70.0, 90.0]), np.zeros(4)], axis=1)
    range_m = np.hypot(*(path_m[reading] - cones_m[anchor]).T)
    ranges = RangeLog(t_s[reading], anchor, range_m + rng.normal(0.0, 0.05, len(reading)))
    scene = Scene("over", Trajectory(t_s, path_m), ranges, ("a", "b", "c", "d"))
    result = reconstruct(scene)
    assert ReasonKind.COLLINEAR in {reason.kind for reason in result.reasons}
    assert result.status is ReconstructionStatus.UNRELIABLE


@pytest.mark.parametrize("denoiser", ["raw", "gaia-set"])
def test_cones_in_one_place_have_no_edge(denoiser: str) -> None:
    rng = np.random.default_rng(3)
    t_s = np.arange(0.0, 40.0, 0.1)
    path_m = np.stack([2.0 * t_s, 4.0 * np.sin(t_s / 4.0)], axis=1)
    reading = np.repeat(np.arange(len(t_s)), 4)
    anchor = np.tile(np.arange(4), len(t_s))
    range_m = np.hypot(*(path_m[reading] - np.array([40.0, 9.0])).T)
    ranges = RangeLog(t_s[reading], anchor, range_m + rng.normal(0.0, 0.1, len(reading)))
    scene = Scene("heap", Trajectory(t_s, path_m), ranges, ("a", "b", "c", "d"))
    result = reconstruct(scene, PipelineConfig(denoiser=denoiser))
    assert result.status is ReconstructionStatus.UNRELIABLE
    (reason,) = [reason for reason in result.reasons if reason.kind is ReasonKind.COLLINEAR]
    assert "in one place within their errors" in reason.text
