import numpy as np
import pytest

from gaia_uwb.config import PriorConfig, SidesConfig, SolverConfig
from gaia_uwb.estimate import AnchorStatus, SideSource
from gaia_uwb.zone import sides
from gaia_uwb.zone.known_facts import KnownFacts
from gaia_uwb.zone.neighbour_sides import NeighbourSides
from gaia_uwb.zone.sides import decide_sides, resolve_sides
from two_places import ALONE, PATH_M, make_hypotheses


def resolve(found, config=SidesConfig(), solver=SolverConfig()):
    return resolve_sides(
        [f"cone-{k}" for k in range(len(found.log_odds))], found, PATH_M, config, solver
    )


@pytest.mark.parametrize("listed", [True, False])
@pytest.mark.parametrize("n", [2, 5, 8])
def test_the_joint_decision_is_the_best_of_all_combinations(n, listed, monkeypatch):
    found, _ = make_hypotheses(n, seed=n)
    if not listed:
        monkeypatch.setattr(sides, "_LISTED", 0)
    combinations = (np.arange(2**n)[:, None] >> np.arange(n)) & 1
    weight = np.exp(NeighbourSides.of(found, np.arange(n), PATH_M).log_weight(combinations))
    best = combinations[weight.argmax()]
    mirror = weight @ (combinations != best)
    for k, fix in enumerate(resolve(found)):
        assert np.array_equal(fix.mirror_position_m, found.position_m[k, 1 - best[k]])
        assert fix.mirror_probability == pytest.approx(mirror[k], abs=1e-9)


def test_together_they_know_the_side_better_than_each_alone():
    wrong_alone = wrong_together = total = 0
    for seed in range(30):
        found, true_m = make_hypotheses(6, seed=seed)
        for config in (ALONE, SidesConfig()):
            places = np.stack([fix.position_m for fix in resolve(found, config)])
            wrong = int((places[:, 1] * true_m[:, 1] < 0).sum())
            if config.joint:
                wrong_together += wrong
            else:
                wrong_alone += wrong
        total += 6
    assert wrong_alone > 0.15 * total
    assert wrong_together < 0.4 * wrong_alone


def test_alone_each_anchor_has_its_own_odds():
    found, _ = make_hypotheses(5)
    for k, fix in enumerate(resolve(found, ALONE)):
        assert fix.mirror_probability == pytest.approx(1.0 / (1.0 + np.exp(found.log_odds[k])))
        assert np.array_equal(fix.position_m, found.position_m[k, 0])
        assert np.array_equal(fix.mirror_position_m, found.position_m[k, 1])
        assert np.array_equal(fix.covariance_m2, found.covariance_m2[k, 0])


def test_own_probabilities_are_what_happens():
    found, true_m = make_hypotheses(3000, seed=9)
    fixes = resolve(found, ALONE)
    mirror = np.array([fix.mirror_probability for fix in fixes])
    wrong = np.array([fix.position_m[1] < 0 for fix in fixes])
    assert np.all(true_m[:, 1] > 0)
    for low in (0.0, 0.1, 0.2, 0.3, 0.4):
        inside = (mirror >= low) & (mirror < low + 0.1)
        assert wrong[inside].mean() == pytest.approx(mirror[inside].mean(), abs=0.07)


def test_joint_probabilities_are_cautious():
    wrong, mirror = [], []
    for seed in range(60):
        found, true_m = make_hypotheses(5, seed=100 + seed, odds=0.5)
        for fix, true in zip(resolve(found), true_m, strict=True):
            wrong.append(fix.position_m[1] * true[1] < 0)
            mirror.append(fix.mirror_probability)
    wrong, mirror = np.array(wrong), np.array(mirror)
    for part in (mirror <= np.median(mirror), mirror > np.median(mirror)):
        assert wrong[part].mean() < mirror[part].mean() + 0.1


def test_of_many_open_anchors_a_row_stands_on_one_side():
    found, true_m = make_hypotheses(35, seed=4, odds=0.3)
    places = np.stack([fix.position_m for fix in resolve(found)])
    right = (places[:, 1] * true_m[:, 1] > 0).mean()
    assert right > 0.9 or right < 0.1  # all on one side: which one, hardly anything tells


@pytest.mark.parametrize("odds", [0.05, 2.0])
def test_no_combination_of_many_open_sides_is_kept_twice(odds):
    found, _ = make_hypotheses(12, seed=3, odds=odds)
    decision = decide_sides(tuple("abcdefghijkl"), found, PATH_M)
    kept = decision.combinations
    assert len(np.unique(kept.side, axis=0)) == len(kept.side)
    share = kept.weight @ (kept.side != kept.side[0])
    best = [np.array_equal(fix.mirror_position_m, p[1 - s]) for fix, p, s in zip(
        decision.anchors, found.position_m, kept.side[0], strict=True)]  # fmt: skip
    mirror = np.array([fix.mirror_probability for fix in decision.anchors])
    assert np.where(best, share, 1.0 - share) == pytest.approx(mirror, abs=0.2)


def test_sure_sides_are_left_alone():
    found, _ = make_hypotheses(4, odds=60.0)
    for fix, place in zip(resolve(found), found.position_m[:, 0], strict=True):
        assert fix.mirror_probability < 1e-5
        assert np.linalg.norm(fix.position_m - place) < 0.5
        assert fix.status is AnchorStatus.OK


def test_one_place_twice_leaves_no_side_open():
    found, _ = make_hypotheses(3, odds=0.01)
    found.position_m[1, 1] = found.position_m[1, 0] + 0.05
    fixes = resolve(found)
    assert fixes[1].mirror_probability == 0.0


def test_each_status_is_reached():
    found, _ = make_hypotheses(6, odds=60.0)
    found.position_m[1] = np.nan
    found.covariance_m2[1] = np.nan
    found.log_odds[1] = 0.0
    found.log_odds[2] = 0.1
    found.covariance_m2[3] = np.diag([0.01, 9.0])
    found.converged[4] = False
    found.fits[5] = False
    status = [fix.status for fix in resolve(found, ALONE)]
    assert status == [
        AnchorStatus.OK, AnchorStatus.TOO_FEW_RANGES, AnchorStatus.AMBIGUOUS,
        AnchorStatus.ILL_CONDITIONED, AnchorStatus.NOT_CONVERGED, AnchorStatus.DOES_NOT_FIT,
    ]  # fmt: skip
    assert resolve(found)[1].mirror_probability == 0.0
    assert np.isnan(resolve(found)[1].position_m).all()


@pytest.mark.parametrize(("apart", "is_one"), [(0.8, True), (1.5, False), (2.5, False)])
@pytest.mark.parametrize("sigma_m", [0.05, 0.3])
def test_places_more_than_a_standard_error_apart_are_two(apart, is_one, sigma_m):
    found, _ = make_hypotheses(4, odds=60.0, sigma_m=sigma_m)
    found.log_odds[2] = 0.0
    # Each of the two places errs by sigma, so their difference errs by sqrt(2) of it.
    found.position_m[2, 1] = found.position_m[2, 0] + [np.sqrt(2.0) * sigma_m * apart, 0.0]
    fix = resolve(found, ALONE)[2]
    assert fix.mirror_probability == (0.0 if is_one else 0.5)
    assert fix.status is (AnchorStatus.OK if is_one else AnchorStatus.AMBIGUOUS)


@pytest.mark.parametrize("level", [0.1, 0.02, 0.3])
def test_ok_means_less_likely_on_the_other_side_than_the_settings_allow(level):
    found, _ = make_hypotheses(4)
    probability = np.array([0.5, 0.99, 1.01, 1.9]) * level
    found.log_odds[:] = np.log(1.0 / probability - 1.0)
    fixes = resolve(found, SidesConfig(joint=False, ambiguous_above=level))
    assert [fix.mirror_probability for fix in fixes] == pytest.approx(probability)
    assert [fix.status for fix in fixes] == [AnchorStatus.OK] * 2 + [AnchorStatus.AMBIGUOUS] * 2
    assert [fix.side_is_open for fix in fixes] == [False, False, True, True]
    assert SidesConfig().ambiguous_above == 0.1  # what the documentation promises


def test_of_an_open_side_and_a_poor_place_the_poor_place_is_told():
    found, _ = make_hypotheses(2)
    found.log_odds[:] = 0.1
    found.covariance_m2[0] = np.diag([0.01, 9.0])
    poor, open_side = resolve(found, ALONE)
    assert poor.side_is_open
    assert poor.status is AnchorStatus.ILL_CONDITIONED
    assert open_side.status is AnchorStatus.AMBIGUOUS


def test_a_side_that_was_known_anyway_leaves_places_as_sure_as_they_were():
    found, _ = make_hypotheses(5, odds=60.0)
    facts = KnownFacts(PriorConfig(side="left"), PATH_M, {}, tuple("abcde"))
    plain, told = (decide_sides("abcde", found, PATH_M, facts=said) for said in (None, facts))
    assert told.reasons == ()
    for one, other in zip(plain.anchors, told.anchors, strict=True):
        assert other.position_m == pytest.approx(one.position_m)
        assert other.covariance_m2 == pytest.approx(one.covariance_m2)


@pytest.mark.parametrize("config", [SidesConfig(), ALONE])
def test_the_likeliest_combinations_are_kept_and_the_choice_is_the_first(config):
    found, _ = make_hypotheses(5, seed=6, odds=1.0)
    decision = decide_sides("abcde", found, PATH_M, config)
    kept = decision.combinations
    for k, fix in enumerate(decision.anchors):
        assert np.array_equal(fix.mirror_position_m, found.position_m[k, 1 - kept.side[0, k]])
    assert (np.diff(kept.weight) <= 0.0).all()
    assert kept.weight.sum() == pytest.approx(1.0)
    flipped = (kept.weight[:, None] * (kept.side != kept.side[0])).sum(axis=0)
    mirror = [fix.mirror_probability for fix in decision.anchors]
    assert flipped == pytest.approx(mirror, abs=2e-3)  # a thousandth is left out


def test_ranges_and_neighbours_and_statements_are_told_apart():
    found, _ = make_hypotheses(6)
    found.position_m[:, 0] = [[20.0 * k, 4.0] for k in range(6)]
    found.position_m[:, 1] = found.position_m[:, 0] * [1.0, -1.0]
    found.position_m[3] = found.position_m[3, ::-1]  # its ranges prefer the wrong side a little
    found.log_odds[:] = [9.0, 0.5, 9.0, 0.2, 9.0, 0.3]
    fixes = resolve(found)
    assert [fix.side_source.value for fix in fixes] == [
        "ranges", "layout", "ranges", "layout", "ranges", "layout",
    ]  # fmt: skip
    for fix, odds in zip(fixes, [9.0, 0.5, 9.0, -0.2, 9.0, 0.3], strict=True):
        assert fix.position_m[1] > 0.0
        assert fix.mirror_probability_by_ranges == pytest.approx(1.0 / (1.0 + np.exp(odds)))
    found.log_odds[:] = 0.01
    assert {fix.side_source for fix in resolve(found)} == {SideSource.OPEN}
    facts = KnownFacts(PriorConfig(side="left"), PATH_M, {}, tuple("abcdef"))
    told = decide_sides("abcdef", found, PATH_M, facts=facts).anchors
    assert {fix.side_source for fix in told} == {SideSource.STATEMENT}
    assert max(fix.mirror_probability for fix in told) < 0.02
    assert min(fix.mirror_probability_by_ranges for fix in told) > 0.49
