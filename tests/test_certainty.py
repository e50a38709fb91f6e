"""What is called certain is right: situations in which logs deceive.

Each is a log with known truth. A result passes if it is right, or says that it may not be: by its
status, its reasons or the size of its ellipses. docs/concepts/certainty.md explains them.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import poisson

import roads
from gaia_uwb import PipelineConfig, reconstruct
from gaia_uwb._shared import CHI_SQUARE_90
from gaia_uwb.config import PriorConfig
from gaia_uwb.episode import Episode
from gaia_uwb.estimate import AnchorFix, AnchorStatus, ReasonKind, SideSource
from gaia_uwb.locate import find_places
from gaia_uwb.pipeline import prepare, reconstruct_episodes
from gaia_uwb.reconstruction import Reconstruction, ReconstructionStatus
from gaia_uwb.scene import Scene, Trajectory
from gaia_uwb.simulate import PRESETS, PassConfig, simulate_pass
from gaia_uwb.zone import PathSides
from roads import CONE_UP_M, TAG_UP_M, Radios, road_drives

Numbers = NDArray[np.float64]

ALMOST_ALL = 0.8  # of the cones, where 90 % should be: those of one drive err together
UNLUCKY = 0.999  # a test fails by chance once in a thousand


def true_places_m(scene: Scene) -> Numbers:
    assert scene.truth is not None
    return scene.truth.anchor_m


def errors_m(result: Reconstruction, true_m: Numbers) -> Numbers:
    places_m = np.array([fix.position_m for fix in result.anchors])
    return np.asarray(np.hypot(*(places_m - true_m).T))


def is_inside(fix: AnchorFix, true_m: Numbers) -> bool:
    """Whether the 90 % ellipse holds the truth."""
    off_m = fix.position_m - true_m
    return bool(off_m @ np.linalg.solve(fix.covariance_m2, off_m) < CHI_SQUARE_90)


def is_honest(result: Reconstruction, true_m: Numbers) -> bool:
    """Whether a result is not called ok, or its ellipses hold the truth."""
    inside = [is_inside(fix, own_m) for fix, own_m in zip(result.anchors, true_m, strict=True)]
    return result.status is not ReconstructionStatus.OK or float(np.mean(inside)) >= ALMOST_ALL


def test_two_lanes_with_one_clock_are_not_worse_than_the_better_lane() -> None:
    passes = road_drives("two lanes", 3)
    true_m = true_places_m(passes[0])
    both = reconstruct(passes)
    alone_m = np.array([errors_m(reconstruct(one), true_m) for one in passes])
    better_m = alone_m[np.median(alone_m, axis=1).argmin()]
    stated_m = np.array([fix.semi_axes_90_m[0] for fix in both.anchors])
    assert both.status is ReconstructionStatus.OK
    assert np.mean(errors_m(both, true_m) < better_m + stated_m) >= ALMOST_ALL


@pytest.mark.parametrize("seed", [0, 2, 3])
def test_opposite_directions_determine_the_clock_that_they_share(seed: int) -> None:
    passes = road_drives("opposite directions", seed, radios=Radios(offset_s=0.12))
    result = reconstruct(passes)
    assert result.status is ReconstructionStatus.OK, result.reasons
    assert np.median(errors_m(result, true_places_m(passes[0]))) <= 0.10


def mirrored(scene: Scene) -> Scene:
    """Return a drive in a mirror: what was left of the path is right of it."""
    path, truth, flip = scene.trajectory, scene.truth, np.array([1.0, -1.0])
    assert truth is not None
    return replace(
        scene,
        frame=None,
        trajectory=Trajectory(path.t_s, path.position_m * flip, path.up_m),
        truth=replace(truth, anchor_m=truth.anchor_m * flip),
    )


@pytest.mark.parametrize(("stated", "turned"), [("right", False), ("left", True)])
def test_a_wrong_side_that_the_ranges_refute_is_named(stated: str, turned: bool) -> None:
    (scene,) = road_drives("single", 0, radius_m=300.0)  # all cones are on the left
    scene = mirrored(scene) if turned else scene
    told = PipelineConfig(prior=PriorConfig.model_validate({"side": stated}))
    assert max(fix.mirror_probability for fix in reconstruct(scene).anchors) < 0.01
    result = reconstruct(scene, told)
    kinds = {reason.kind for reason in result.reasons}
    assert kinds & {ReasonKind.STATEMENT, ReasonKind.EXCEPTION}
    assert result.status is not ReconstructionStatus.OK


@pytest.mark.parametrize("denoiser", ["gaia-set", "raw"])
@pytest.mark.parametrize("kind", ["u-turn", "two lanes"])
def test_a_side_that_the_ranges_refute_pulls_no_cone(kind: str, denoiser: str) -> None:
    passes = road_drives(kind, 0)
    true_m = true_places_m(passes[0])
    left = PathSides(passes[0].trajectory.position_m).are_left(true_m)
    wrong = "right" if left.mean() > 0.5 else "left"
    assert left.all() or not left.any()
    told, plain = (
        reconstruct(passes, PipelineConfig(denoiser=denoiser, prior=prior))
        for prior in (PriorConfig.model_validate({"side": wrong}), PriorConfig())
    )
    (reason,) = [r for r in told.reasons if r.kind is ReasonKind.STATEMENT]
    assert reason.statements == ("side",) and told.stated == ()
    assert str(reason).startswith(f'the ranges contradict "all cones are on the {wrong}"')
    assert told.status is ReconstructionStatus.UNRELIABLE
    for fix, other in zip(told.anchors, plain.anchors, strict=True):
        assert np.array_equal(fix.position_m, other.position_m)
        assert fix.mirror_probability == other.mirror_probability
        assert fix.side_source is not SideSource.STATEMENT


def with_second_tag(scene: Scene, behind_m: float) -> Scene:
    """Return a log in which about half of the readings are of a tag behind the path's."""
    log, path, truth = scene.ranges, scene.trajectory, scene.truth
    assert truth is not None
    t_s = log.t_s - truth.clock_offset_s

    def place_m(at_s: Numbers) -> Numbers:
        return np.stack([np.interp(at_s, path.t_s, x) for x in path.position_m.T], axis=1)

    step_m = place_m(t_s + 0.25) - place_m(t_s - 0.25)
    back_m = -behind_m * step_m / np.hypot(*step_m.T)[:, None]
    from_m = place_m(t_s) - truth.anchor_m[log.anchor]
    up_m = TAG_UP_M - CONE_UP_M
    longer_m = np.hypot(np.hypot(*(from_m + back_m).T), up_m) - np.hypot(np.hypot(*from_m.T), up_m)
    other = np.random.default_rng(0).random(len(t_s)) < 0.5
    return replace(scene, truth=None, ranges=replace(log, range_m=log.range_m + other * longer_m))


@pytest.mark.parametrize("kind", ["single", "u-turn"])
def test_two_tags_in_one_log_are_never_ok(kind: str) -> None:
    mixed = with_second_tag(road_drives(kind, 0)[0], 4.0)
    assert reconstruct(mixed).status is not ReconstructionStatus.OK


@pytest.mark.parametrize(("shared", "other"), [(10, 11), (5, 15)], ids=["neighbours", "far apart"])
def test_two_radios_with_one_id_are_never_ok(shared: int, other: int) -> None:
    scene = road_drives("u-turn", 0)[0]
    log = scene.ranges
    anchor = np.where(log.anchor == other, shared, log.anchor)
    result = reconstruct(replace(scene, truth=None, ranges=replace(log, anchor=anchor)))
    fix = result.anchors[shared]
    assert fix.status is not AnchorStatus.OK
    assert any(fix.anchor_id in reason.cones for reason in result.reasons)


def with_shifted_path(scene: Scene, by_m: float, gap_s: float) -> Scene:
    """Return a log whose path is shifted to its left from half-way on, after a gap."""
    path = scene.trajectory
    half_s = path.t_s[-1] / 2
    ahead_m = path.position_m[len(path.t_s) // 4] - path.position_m[0]
    left = np.array([-ahead_m[1], ahead_m[0]]) / np.hypot(*ahead_m)
    shifted_m = path.position_m + (path.t_s > half_s)[:, None] * by_m * left
    keep = np.abs(path.t_s - half_s) >= gap_s / 2
    up_m = None if path.up_m is None else path.up_m[keep]
    return replace(scene, trajectory=Trajectory(path.t_s[keep], shifted_m[keep], up_m))


@pytest.mark.parametrize(
    ("kind", "seed", "gap_s"),
    [
        ("single", 2, 0.0),
        ("u-turn", 1, 0.0),
        ("single", 2, 1.4),
        ("u-turn", 1, 1.4),
    ],
)
def test_a_path_that_is_shifted_half_way_is_noticed(kind: str, seed: int, gap_s: float) -> None:
    scene = road_drives(kind, seed)[0]
    result = reconstruct(with_shifted_path(scene, 3.0, gap_s))
    assert is_honest(result, true_places_m(scene))


def straight_closure(work_m: float) -> PassConfig:
    """Return a pass on one side of a long closure, without a lane change."""
    preset = PRESETS["lane-closure"]
    drive = {"lane_change": False, "speed_mps": 15.0, "duration_s": 40.0 + work_m / 15.0}
    closure = {"work_m": work_m, "n_anchors": 24}
    return preset.model_copy(
        update={
            "closure": preset.closure.model_copy(update=closure),
            "road": preset.road.model_copy(update={"curvature_per_m": -0.0002}),
            "drive": preset.drive.model_copy(update=drive),
        }
    )


@pytest.fixture(scope="module")
def straight_closures() -> tuple[list[Episode], list[Numbers]]:
    """Return prepared passes of straight closures, and where their cones are."""
    scenes = [simulate_pass(straight_closure(m), k) for m in (300.0, 900.0) for k in range(3)]
    episodes = [prepare(scene.without_truth()) for scene in scenes]
    return episodes, [true_places_m(scene) for scene in scenes]


def test_sides_of_straight_closures_are_as_open_as_the_ranges_leave_them(
    straight_closures: tuple[list[Episode], list[Numbers]],
) -> None:
    episodes, true_m = straight_closures
    wrong, expected = 0, 0.0
    for places, own_m in zip(find_places([[e] for e in episodes]), true_m, strict=True):
        found = places.hypotheses
        off_m = np.linalg.norm(found.position_m - own_m[:, None], axis=2)
        wrong += int((off_m[:, 0] > off_m[:, 1]).sum())
        expected += float((1.0 / (1.0 + np.exp(found.log_odds))).sum())
    assert expected > 20.0  # straight closures leave sides open
    assert wrong <= poisson.ppf(UNLUCKY, expected)


@pytest.mark.parametrize("denoiser", ["gaia-set", "raw"])
def test_cones_of_straight_closures_called_ok_are_on_the_right_side(
    denoiser: str, straight_closures: tuple[list[Episode], list[Numbers]]
) -> None:
    episodes, true_m = straight_closures
    wrong, expected, n_ok = 0, 0.0, 0
    results = reconstruct_episodes(episodes, PipelineConfig(denoiser=denoiser))
    for result, own_m in zip(results, true_m, strict=True):
        for fix, place_m in zip(result.anchors, own_m, strict=True):
            if fix.status is AnchorStatus.OK:
                n_ok += 1
                off_m = np.hypot(*(np.stack([fix.position_m, fix.mirror_position_m]) - place_m).T)
                wrong += bool(off_m[0] > off_m[1])
                expected += fix.mirror_probability
    assert n_ok >= 48
    assert wrong <= poisson.ppf(UNLUCKY, expected)


@pytest.mark.parametrize("seed", [0, 1, 5])
def test_a_range_bias_that_a_straight_drive_cannot_tell_is_in_the_ellipses(seed: int) -> None:
    (scene,) = road_drives("single", seed, radius_m=np.inf, radios=Radios(bias_m=0.7))
    assert is_honest(reconstruct(scene), true_places_m(scene))


def test_a_reading_every_other_second_locates_cones(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(roads, "READINGS_PER_S", 0.5)
    passes = road_drives("opposite directions", 0)
    true_m = true_places_m(passes[0])
    result = reconstruct(passes)
    assert result.status is ReconstructionStatus.OK, result.reasons
    assert np.median(errors_m(result, true_m)) < 0.15
    assert is_honest(result, true_m)


def test_cones_close_to_a_path_that_changes_lanes_are_located() -> None:
    for seed in (5, 6, 9):
        scene = simulate_pass(PRESETS["lane-closure"], seed)
        true_m = true_places_m(scene)
        (places,) = find_places([[prepare(scene.without_truth())]])
        off_m = np.linalg.norm(places.hypotheses.position_m - true_m[:, None], axis=2)
        assert off_m.min(axis=1).max() < 1.0, seed


def test_a_radio_clock_that_runs_fast_is_not_taken_for_a_range_bias() -> None:
    scene = simulate_pass(PRESETS["lane-closure"], seed=1).without_truth()
    log = scene.ranges
    fast = replace(log, t_s=log.t_s[0] + 1.01 * (log.t_s - log.t_s[0]))
    result = reconstruct(replace(scene, ranges=fast))
    assert result.status is ReconstructionStatus.UNRELIABLE
