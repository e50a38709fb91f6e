"""The passes of one zone together: moved anchors, errors larger than thought, single passes."""

from dataclasses import fields, replace

import numpy as np
import pytest
from scipy.stats import chi2

from drives_past import CONES_M, IDS, PURE, located, make_pass, place_error_m
from gaia_uwb.estimate import AnchorStatus, ReasonKind
from gaia_uwb.locate.fusion import fuse, mark_moved
from gaia_uwb.locate.hypotheses import Hypotheses
from gaia_uwb.locate.joint_fit import JointFit, hear
from gaia_uwb.zone.sides import resolve_sides


def moved_cones(k, by_m=(1.5, 0.0)):
    cones_m = CONES_M.copy()
    cones_m[k] += by_m
    return cones_m


def with_solver(**changes):
    return PURE.model_copy(update={"solver": PURE.solver.model_copy(update=changes)})


def test_a_pass_without_an_anchor_adds_nothing_to_it():
    near = located(make_pass(0.0))
    far = located(make_pass(3.6, CONES_M[[0, 3]], ("a", "d"), seed=1))
    together = fuse([near, far], PURE)
    assert together.anchor_ids == IDS
    for field in fields(Hypotheses):
        if field.name not in ("errors", "shared_m"):
            both = getattr(together.hypotheses, field.name)
            own = getattr(near.hypotheses, field.name)
            assert np.array_equal(both[[1, 2, 4]], own[[1, 2, 4]]), field.name
    assert together.hypotheses.log_odds[[0, 3]].min() > 100.0
    assert together.hypotheses.n_ranges.tolist() == [400, 200, 200, 400, 200]


def test_too_few_ranges_in_one_pass_leave_the_anchor_to_the_other():
    near, far = make_pass(0.0), make_pass(3.6, seed=1)
    valid = far.valid.copy()
    valid[3:, 1] = False
    far = replace(far, valid=valid, range_m=np.where(valid, far.range_m, np.nan))
    one, other = located(near), located(far)
    together = fuse([other, one], PURE).hypotheses
    assert np.array_equal(together.position_m[1], one.hypotheses.position_m[1])
    assert together.n_ranges[1] == 200


def test_an_anchor_that_nobody_heard_is_not_located():
    episode = make_pass(0.0)
    valid = episode.valid.copy()
    valid[:, 2] = False
    mute = replace(episode, valid=valid, range_m=np.where(valid, episode.range_m, np.nan))
    together = fuse([located(mute), located(replace(mute, name="again"))], PURE).hypotheses
    assert np.isnan(together.position_m[2]).all()
    assert together.n_ranges[2] == 0


def test_the_order_of_passes_does_not_matter():
    passes = [located(make_pass(lane, seed=k)) for k, lane in enumerate((0.0, 3.6, -2.0))]
    one, other = fuse(passes, PURE), fuse(passes[::-1], PURE)
    assert one.anchor_ids == other.anchor_ids
    a, b = one.hypotheses, other.hypotheses
    assert np.abs(a.position_m[:, 0] - b.position_m[:, 0]).max() < 1e-3  # a tenth of a sigma
    assert a.log_odds == pytest.approx(b.log_odds, rel=1e-2)
    assert a.covariance_m2[:, 0] == pytest.approx(b.covariance_m2[:, 0], rel=1e-2)


@pytest.mark.parametrize("k", range(len(IDS)))
def test_an_anchor_moved_between_passes_is_noticed(k):
    lanes = (0.0, 3.6, -2.0)
    passes = [located(make_pass(lane, seed=j)) for j, lane in enumerate(lanes)]
    late = located(make_pass(5.0, moved_cones(k), seed=9, name="the last one"))
    together = fuse([*passes, late], PURE)
    (apart,) = together.disagreements
    assert (apart.anchor_id, apart.pass_name) == (IDS[k], "the last one")
    assert apart.distance_m == pytest.approx(1.5, abs=0.25)
    fixes = mark_moved(resolve_sides(IDS, together.hypotheses), together)
    assert [fix.anchor_id for fix in fixes if fix.status is AnchorStatus.MOVED] == [IDS[k]]
    (reason,) = together.reasons()
    assert reason.kind is ReasonKind.PASSES_APART
    assert (reason.cones, reason.passes) == ((IDS[k],), ("the last one",))
    assert f"{IDS[k]}: its position from the last one alone is" in str(reason)
    assert place_error_m(together.hypotheses).max() < 0.15  # three passes outvote one


def test_honest_passes_disagree_on_nothing():
    for seed in range(10):
        passes = [located(make_pass(lane, seed=seed + k)) for k, lane in ((0, 0.0), (50, 3.6))]
        together = fuse(passes, PURE)
        assert together.disagreements == ()
        assert together.error_scale < 2.5
        assert list(together.reasons()) == []


def test_passes_in_two_frames_are_noticed():
    one = located(make_pass(0.0))
    other = located(make_pass(3.6, CONES_M + np.array([4.0, -7.0]), seed=1))
    kinds = [reason.kind for reason in fuse([one, other], PURE).reasons()]
    assert kinds.count(ReasonKind.NOT_ONE_ZONE) == 1


def test_errors_larger_than_each_pass_thinks_widen_the_ellipses():
    honest = [located(make_pass(lane, seed=k)) for k, lane in enumerate((0.0, 3.6))]
    rng = np.random.default_rng(2)
    scattered = [
        located(make_pass(lane, CONES_M + 0.08 * rng.standard_normal((5, 2)), seed=k))
        for k, lane in enumerate((0.0, 3.6))
    ]
    one, other = fuse(honest, PURE), fuse(scattered, PURE)
    assert other.error_scale > 1.5 * one.error_scale
    growth = np.linalg.det(other.hypotheses.covariance_m2[:, 0]) ** 0.25
    growth /= np.linalg.det(one.hypotheses.covariance_m2[:, 0]) ** 0.25
    assert growth.min() > 1.2


@pytest.mark.parametrize(("by_m", "is_moved"), [(1.2, False), (1.9, False), (2.8, True)])
def test_only_what_chance_hardly_ever_does_is_called_moved(by_m, is_moved):
    # Least squares put the anchor in the middle, and the floor is all that the places err by.
    config = with_solver(kind="wls", position_floor_m=0.3)
    passes = [
        located(make_pass(0.0, moved_cones(2, (east_m, 0.0)), seed=k, sigma_m=0.02), config)
        for k, east_m in enumerate((0.0, by_m))
    ]
    together = fuse(passes, config)
    assert [apart.anchor_id for apart in together.disagreements] == (["c"] if is_moved else [])
    # Of a million anchors that stand still, at most one is called moved.
    by_chance = chi2.sf(by_m**2 / (2.0 * 0.3**2), df=2)
    assert (by_chance < 1e-6) == is_moved


def test_passes_that_agree_by_luck_are_no_surer_than_their_ranges_are():
    # Six times the same noise: the places scatter less than their errors allow for.
    lanes = (0.0, 3.6, -2.0) * 2
    passes = [located(make_pass(lane, name=f"pass {k}")) for k, lane in enumerate(lanes)]
    together = fuse(passes, PURE)
    assert together.error_scale == 1.0
    for k, anchor_id in enumerate(IDS):
        ranges = JointFit([hear(each, anchor_id, PURE) for each in passes], PURE).best_two()
        more_m2 = together.hypotheses.covariance_m2[k] - ranges.covariance_m2
        assert np.linalg.eigvalsh(more_m2).min() > -1e-12
        assert together.hypotheses.log_odds[k] <= ranges.log_odds * (1.0 + 1e-12)


@pytest.mark.parametrize("floor_m", [0.1, 0.3])
def test_no_number_of_passes_makes_a_place_surer_than_the_floor(floor_m):
    config = with_solver(position_floor_m=floor_m)
    passes = [located(make_pass(0.7 * k, seed=k), config) for k in range(6)]
    sigma_m = np.sqrt(np.linalg.eigvalsh(fuse(passes, config).hypotheses.covariance_m2))
    assert sigma_m.min() > floor_m
    assert sigma_m[:, 0].max() < 1.1 * floor_m  # all the rest is averaged away


def test_a_short_look_from_one_direction_does_not_disagree():
    # Ten ranges give a place on an arc that is far longer than its linear covariance is.
    config = with_solver(position_floor_m=0.01)
    for seed in range(4):
        short = make_pass(3.6, seed=100 + seed)
        valid = short.valid.copy()
        valid[10:] = False
        short = replace(short, valid=valid, range_m=np.where(valid, short.range_m, np.nan))
        passes = [located(each, config) for each in (make_pass(0.0, seed=seed), short)]
        together = fuse(passes, config)
        assert together.disagreements == ()
        assert together.error_scale < 2.5
        assert place_error_m(together.hypotheses).max() < 0.2
