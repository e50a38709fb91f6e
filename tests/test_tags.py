"""Evidence that decides: several tags, angles, ranges between cones, from a log to its result."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from gaia_uwb import PipelineConfig, Scene, reconstruct
from gaia_uwb.config import AlignmentConfig, KnownAnchor, PriorConfig, SolverConfig
from gaia_uwb.estimate import AnchorStatus, ReasonKind
from gaia_uwb.reconstruction import ReconstructionStatus
from gaia_uwb.scene import ConeRanges, RangeLog, Tag, Trajectory, Truth

Numbers = NDArray[np.float64]

LEFT_AND_RIGHT = (Tag("left", left_m=0.8), Tag("right", left_m=-0.8))


TRUSTED = PipelineConfig(alignment=AlignmentConfig(clock_offset="off"))


def past_cones(tags: tuple[Tag, ...], seed: int, *, surge_m: float = 0.0) -> Scene:
    """Return a straight drive past cones on both sides, at constant speed but for surges."""
    rng = np.random.default_rng(seed)
    t_s = np.arange(0.0, 16.0, 0.05)

    def along_m(at_s: Numbers) -> Numbers:
        return np.asarray(15.0 * at_s - 120.0 + surge_m * np.sin(at_s))

    path_m = np.stack([along_m(t_s), np.zeros(len(t_s))], axis=1)
    cones_m = np.stack([np.linspace(-50, 50, 10), 3.0 * rng.choice([-1.0, 1.0], 10)], axis=1)
    parts = []
    for k, tag in enumerate(tags):
        for n, cone_m in enumerate(cones_m):
            at_s = np.arange(rng.uniform(0, 0.1), 16.0, 0.1)
            east_m = along_m(at_s) + tag.forward_m
            true_m = np.hypot(cone_m[0] - east_m, cone_m[1] - tag.left_m)
            heard = true_m < 60.0
            range_m = true_m + 0.15 + 0.05 * rng.normal(size=len(at_s))
            parts.append((at_s[heard], range_m[heard], np.full((heard.sum(), 2), (n, k))))
    stamp_s, range_m = (np.concatenate([part[i] for part in parts]) for i in (0, 1))
    anchor, tag_of = np.concatenate([part[2] for part in parts]).T
    order = np.argsort(stamp_s, kind="stable")
    return Scene(
        name="roof",
        trajectory=Trajectory(t_s, path_m),
        ranges=RangeLog(stamp_s[order], anchor[order], range_m[order], tag=tag_of[order]),
        anchor_ids=tuple(f"c{n}" for n in range(len(cones_m))),
        truth=Truth(anchor_m=cones_m),
        tags=tags,
    )


def test_two_tags_across_tell_the_sides_that_one_leaves_open() -> None:
    one = reconstruct(past_cones((Tag("roof"),), seed=1), TRUSTED)
    assert one.status is ReconstructionStatus.UNRELIABLE
    scene = past_cones(LEFT_AND_RIGHT, seed=1)
    both = reconstruct(scene, TRUSTED)
    assert both.status is ReconstructionStatus.OK, both.reasons
    places_m = np.array([fix.position_m for fix in both.anchors])
    assert scene.truth is not None
    assert np.hypot(*(places_m - scene.truth.anchor_m).T).max() < 0.2
    assert max(fix.mirror_probability for fix in both.anchors) < 0.001


def test_places_along_a_steady_drive_are_uncertain_together() -> None:
    """The clock moves all cones alike, and nothing draws them together."""
    scene = past_cones(LEFT_AND_RIGHT, seed=1)
    result = reconstruct(scene)
    assert scene.truth is not None
    off_m = np.array([fix.position_m for fix in result.anchors]) - scene.truth.anchor_m
    assert np.ptp(off_m, axis=0).max() < 0.3
    assert result.status is not ReconstructionStatus.OK


def test_a_pass_of_each_tag_is_in_the_result() -> None:
    result = reconstruct(past_cones(LEFT_AND_RIGHT, seed=2))
    assert [episode.name for episode, _ in result.passes] == ["roof (tag left)", "roof (tag right)"]
    left, right = (episode.position_m for episode, _ in result.passes)
    assert left[:, 1] == pytest.approx(0.8) and right[:, 1] == pytest.approx(-0.8)


def test_the_order_of_tags_and_readings_does_not_matter() -> None:
    scene = past_cones(LEFT_AND_RIGHT, seed=3)
    log = scene.ranges
    assert log.tag is not None
    turned = replace(scene, tags=scene.tags[::-1], ranges=replace(log, tag=1 - log.tag))
    for one, other in zip(reconstruct(scene).anchors, reconstruct(turned).anchors, strict=True):
        assert one.position_m == pytest.approx(other.position_m, abs=1e-9)


def test_tags_with_clocks_of_their_own_may_differ() -> None:
    scene = past_cones(LEFT_AND_RIGHT, seed=4, surge_m=8.0)
    log = scene.ranges
    assert log.tag is not None
    late_s = np.where(log.tag == 1, 0.2, 0.0)
    order = np.argsort(log.t_s + late_s, kind="stable")
    moved = RangeLog(
        (log.t_s + late_s)[order], log.anchor[order], log.range_m[order], tag=log.tag[order]
    )
    shared = replace(scene, ranges=moved)
    own = replace(shared, tags=tuple(replace(tag, own_clock=True) for tag in scene.tags))
    found = reconstruct(own)
    clocks = [episode.clock for episode, _ in found.passes]
    assert all(clock is not None for clock in clocks)
    late = [0.0 if clock is None else clock.applied_s for clock in clocks]
    assert late[1] - late[0] == pytest.approx(0.2, abs=0.02)
    assert reconstruct(shared).status is not ReconstructionStatus.OK


def true_places_m(scene: Scene) -> Numbers:
    assert scene.truth is not None
    return scene.truth.anchor_m


def with_azimuths(scene: Scene, sigma_deg: float, seed: int = 0, behind: float = 0.0) -> Scene:
    """Return a drive to the east with angles of arrival, a share of them mirrored to behind."""
    rng = np.random.default_rng(seed)
    log = scene.ranges
    from_m = np.stack([15.0 * log.t_s - 120.0, np.zeros(len(log))], axis=1)
    to_m = true_places_m(scene)[log.anchor] - from_m
    azimuth_rad = np.arctan2(to_m[:, 1], to_m[:, 0])
    azimuth_rad += np.radians(3.0 + sigma_deg * rng.normal(size=len(log)))
    wild = rng.random(len(log)) < 0.05
    azimuth_rad[wild] = rng.uniform(-np.pi, np.pi, wild.sum())
    turned = rng.random(len(log)) < behind
    azimuth_rad = np.where(turned, np.pi - azimuth_rad, azimuth_rad)
    sigma_rad = np.full(len(log), np.radians(sigma_deg))
    return replace(scene, ranges=replace(log, azimuth_rad=azimuth_rad, azimuth_sigma_rad=sigma_rad))


@pytest.mark.parametrize("sigma_deg", [5.0, 20.0])
def test_angles_alone_tell_the_sides(sigma_deg: float) -> None:
    scene = with_azimuths(past_cones((Tag("roof"),), seed=5), sigma_deg)
    result = reconstruct(scene, TRUSTED)
    assert result.status is ReconstructionStatus.OK, result.reasons
    places_m = np.array([fix.position_m for fix in result.anchors])
    assert np.hypot(*(places_m - true_places_m(scene)).T).max() < 0.4


def test_angles_that_may_come_from_behind_tell_the_sides_if_it_is_said() -> None:
    scene = with_azimuths(past_cones((Tag("roof"),), seed=6), 5.0, behind=0.5)
    both = PipelineConfig(
        alignment=AlignmentConfig(clock_offset="off"), solver=SolverConfig(azimuth_front_back=True)
    )
    result = reconstruct(scene, both)
    places_m = np.array([fix.position_m for fix in result.anchors])
    assert np.hypot(*(places_m - true_places_m(scene)).T).max() < 0.4


def test_angles_in_another_frame_of_the_vehicle_change_nothing_in_the_ranges() -> None:
    scene = with_azimuths(past_cones((Tag("roof"),), seed=5), 5.0)
    none = replace(scene.ranges, azimuth_rad=np.full(len(scene.ranges), np.nan))
    result = reconstruct(replace(scene, ranges=none), TRUSTED)
    plain = reconstruct(past_cones((Tag("roof"),), seed=5), TRUSTED)
    for one, other in zip(result.anchors, plain.anchors, strict=True):
        assert np.array_equal(one.position_m, other.position_m)


def with_cone_ranges(scene: Scene, seed: int, wrong: bool = False) -> Scene:
    """Return a drive with twenty ranges from each cone to the next two."""
    rng = np.random.default_rng(seed)
    cones_m = true_places_m(scene)
    pairs = [(a, b) for a in range(len(cones_m)) for b in (a + 1, a + 2) if b < len(cones_m)]
    a, b = np.repeat(np.array(pairs), 20, axis=0).T
    delay_m = 0.03 * rng.normal(size=len(cones_m))
    range_m = np.hypot(*(cones_m[a] - cones_m[b]).T) + 0.1 + delay_m[a] + delay_m[b]
    range_m += 0.06 * rng.normal(size=len(a)) + 3.0 * (wrong & (a == 2) & (b == 3))
    return replace(scene, cone_ranges=ConeRanges(a, b, range_m))


@pytest.mark.parametrize("seed", range(3))
def test_a_cone_that_was_heard_three_times_is_placed_by_its_neighbours(seed: int) -> None:
    scene = with_cone_ranges(past_cones(LEFT_AND_RIGHT, seed), seed)
    log = scene.ranges
    assert log.tag is not None
    heard = np.flatnonzero(log.anchor == 4)
    keep = np.ones(len(log), np.bool_)
    keep[np.setdiff1d(heard, heard[[10, len(heard) // 2, -10]])] = False
    few = RangeLog(log.t_s[keep], log.anchor[keep], log.range_m[keep], tag=log.tag[keep])
    result = reconstruct(replace(scene, ranges=few), TRUSTED)
    fix = result.anchors[4]
    assert fix.status is AnchorStatus.OK
    off_m = fix.position_m - true_places_m(scene)[4]
    assert off_m @ np.linalg.solve(fix.covariance_m2, off_m) < 9.2  # 99 %
    alone = reconstruct(replace(scene, ranges=few, cone_ranges=None), TRUSTED)
    assert alone.anchors[4].status is AnchorStatus.TOO_FEW_RANGES


def test_ranges_between_cones_that_contradict_are_named() -> None:
    scene = with_cone_ranges(past_cones(LEFT_AND_RIGHT, 7), 7, wrong=True)
    result = reconstruct(scene, TRUSTED)
    assert any({"c2", "c3"} == set(reason.cones) for reason in result.reasons)
    places_m = np.array([fix.position_m for fix in result.anchors])
    assert np.hypot(*(places_m - true_places_m(scene)).T).max() < 0.2


def test_ranges_between_cones_leave_a_mirrored_zone_open() -> None:
    scene = with_cone_ranges(past_cones((Tag("roof"),), seed=8), 8)
    result = reconstruct(scene, TRUSTED)
    assert result.status is not ReconstructionStatus.OK


def test_what_all_tags_share_is_said_once_by_the_name_of_the_drive() -> None:
    result = reconstruct(past_cones(LEFT_AND_RIGHT, seed=1))
    (clock,) = [reason for reason in result.reasons if reason.kind is ReasonKind.CLOCK]
    assert str(clock).startswith("roof: clock offset uncertain")
    assert len(clock.passes) == 2
    assert result.name == "roof"


def test_the_free_width_is_beside_the_vehicle_not_beside_one_of_its_tags() -> None:
    result = reconstruct(past_cones(LEFT_AND_RIGHT, seed=1), TRUSTED)
    road = result.road_boundary
    assert road is not None
    assert len(road.paths) == 1
    for edge in road.zones[0].edges:
        assert edge.free.least_m == pytest.approx(3.0, abs=0.2)


def test_one_surveyed_cone_tells_where_along_a_steady_road_all_stand() -> None:
    scene = past_cones(LEFT_AND_RIGHT, seed=1)
    assert scene.truth is not None
    free = reconstruct(scene)
    assert ReasonKind.CLOCK in [reason.kind for reason in free.reasons]
    east_m, north_m = scene.truth.anchor_m[4].tolist()
    survey = KnownAnchor(anchor_id="c4", east_m=east_m, north_m=north_m, sigma_m=0.05)
    told = reconstruct(scene, PipelineConfig(prior=PriorConfig(known_anchors=(survey,))))
    assert told.status is ReconstructionStatus.OK
    off_m = np.stack([fix.position_m for fix in told.anchors]) - scene.truth.anchor_m
    assert np.hypot(*off_m.T).max() < 0.3
    assert max(fix.semi_axes_90_m[0] for fix in told.anchors) < 0.5
