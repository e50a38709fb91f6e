from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, strategies as st

from gaia_uwb.config import PipelineConfig, SolverConfig, make_config
from gaia_uwb.denoised import ZonePosterior
from gaia_uwb.episode import ClockOffset, Episode
from gaia_uwb.estimate import AnchorStatus, SideSource
from gaia_uwb.zone.decision import Decision
from gaia_uwb.zone.known_facts import KnownFacts
from gaia_uwb.zone.network_prior import ByRanges
from gaia_uwb.zone.network_sides import decide_zone, widened
from two_places import make_hypotheses

RANGES = np.full(60, 50)
SURVEY = {"anchor_id": "c0", "east_m": 0.0, "north_m": 5.0, "sigma_m": 0.05}


def zone(scene: float, left: np.ndarray, located: np.ndarray | None = None) -> ZonePosterior:
    """Return anchors 10 m apart along the path, 5 m left or right of it."""
    n = left.shape[1]
    along = 10.0 * np.arange(n)
    place = np.stack([np.stack([along, np.full(n, s * 5.0)], axis=-1) for s in (1, -1)], axis=1)
    return ZonePosterior(
        place_m=place,
        covariance_m2=np.broadcast_to(0.04 * np.eye(2), (n, 2, 2, 2)),
        scene_probability=np.array([scene, 1 - scene]),
        left_probability=left,
        located=np.ones(n, dtype=bool) if located is None else located,
    )


def both(n: int, stays: float) -> np.ndarray:
    """Return that under each hypothesis anchors stand on its side with some probability."""
    return np.stack([np.full(n, stays), np.full(n, 1 - stays)])


def decide(one: ZonePosterior, **said: object) -> Decision:
    """Decide on the sides, given what is said of the zone, by a vehicle that drives along x."""
    n = len(one.located)
    ids = tuple(f"c{k}" for k in range(n))
    prior = make_config({"prior": said}).prior
    path = np.stack([np.linspace(-20.0, 10.0 * n + 20.0, 200), np.zeros(200)], axis=-1)
    surveyed = {
        ids.index(known.anchor_id): (np.array([known.east_m, known.north_m]), known.sigma_m)
        for known in prior.known_anchors
    }
    facts = None if prior.says_nothing else KnownFacts(prior, path, surveyed, ids)
    return decide_zone(ids, one, RANGES[:n], facts=facts)


def test_an_undecided_zone_keeps_its_anchors_together() -> None:
    decision = decide(zone(0.5, both(6, 0.999)))
    sides = {np.sign(fix.position_m[1]) for fix in decision.anchors}
    assert len(sides) == 1
    for fix in decision.anchors:
        assert fix.mirror_probability == pytest.approx(0.5, abs=0.01)
        assert fix.status is AnchorStatus.AMBIGUOUS
    # Two combinations hold nearly all of the probability: all left, all right.
    assert decision.combinations.weight[:2].sum() > 0.98
    assert {tuple(side) for side in decision.combinations.side[:2].tolist()} == {(0,) * 6, (1,) * 6}


def test_a_decided_zone_is_ok_and_its_mirror_has_its_own_ellipse() -> None:
    decision = decide(zone(0.001, both(3, 0.9999)))
    for k, fix in enumerate(decision.anchors):
        np.testing.assert_allclose(fix.position_m, [10.0 * k, -5.0])
        np.testing.assert_allclose(fix.mirror_position_m, [10.0 * k, 5.0])
        np.testing.assert_allclose(fix.mirror_covariance_m2, 0.04 * np.eye(2))
        assert fix.status is AnchorStatus.OK and fix.mirror_probability < 0.002


@given(
    st.floats(0, 1), st.lists(st.tuples(st.floats(0, 1), st.floats(0, 1)), min_size=1, max_size=6)
)
def test_the_choice_is_the_likeliest_of_all_combinations(
    scene: float, left: list[tuple[float, float]]
) -> None:
    one = zone(scene, np.array(left).T)
    decision = decide(one)

    def probability(side: tuple[int, ...]) -> float:
        given = [
            np.prod([p if s == 0 else 1 - p for p, s in zip(row, side, strict=True)])
            for row in one.left_probability
        ]
        return float(one.scene_probability @ given)

    combinations = list(itertools.product((0, 1), repeat=len(left)))
    best = max(map(probability, combinations))
    chosen = tuple(0 if fix.position_m[1] > 0 else 1 for fix in decision.anchors)
    assert probability(chosen) == pytest.approx(best, rel=1e-6)
    for n, fix in enumerate(decision.anchors):
        other = sum(probability(c) for c in combinations if c[n] != chosen[n])
        assert fix.mirror_probability == pytest.approx(other, abs=1e-9)
    assert decision.combinations.weight.sum() == pytest.approx(1.0)


def test_of_many_open_anchors_the_likeliest_combination_is_chosen() -> None:
    left = np.random.default_rng(0).uniform(0.55, 0.95, (2, 20))
    decision = decide(zone(0.6, left))
    assert all(fix.position_m[1] > 0 for fix in decision.anchors)
    right = np.array([0.6, 0.4]) @ (1 - left)
    found = [fix.mirror_probability for fix in decision.anchors]
    np.testing.assert_allclose(found, right, atol=1e-12)


@pytest.mark.parametrize("n", [1, 4, 5])
def test_the_kept_combinations_are_the_likeliest_of_all(n: int) -> None:
    left = np.random.default_rng(n).uniform(0.0, 1.0, (2, n))
    decision = decide(zone(0.3, left))
    sides = np.array(list(itertools.product((0, 1), repeat=n)))
    given = np.where(sides[:, None] == 0, left, 1 - left).prod(axis=2)
    probability = np.sort(given @ [0.3, 0.7])[::-1]
    kept = decision.combinations.weight
    expected = probability[: len(kept)] / probability[: len(kept)].sum()
    np.testing.assert_allclose(kept, expected, rtol=1e-9)


def test_anchors_without_enough_ranges_are_not_located() -> None:
    located = np.array([True, False, True])
    one = zone(0.9, both(3, 0.99), located)
    decision = decide_zone(["a", "b", "c"], one, np.array([50, 0, 3]))
    statuses = [fix.status for fix in decision.anchors]
    assert statuses[1:] == [AnchorStatus.TOO_FEW_RANGES] * 2
    assert np.isnan(decision.anchors[1].position_m).all()
    assert np.isnan(decision.anchors[1].covariance_m2).all()
    assert decision.combinations.located.tolist() == [0]


def test_a_place_that_is_known_only_poorly_says_so() -> None:
    one = zone(0.0, both(2, 1.0))
    wide = np.array(one.covariance_m2)
    wide[1] = np.diag([100.0, 0.1])
    decision = decide(
        ZonePosterior(one.place_m, wide, one.scene_probability, one.left_probability, one.located)
    )
    assert [fix.status for fix in decision.anchors] == [
        AnchorStatus.OK,
        AnchorStatus.ILL_CONDITIONED,
    ]
    assert not any(fix.side_is_open for fix in decision.anchors)


def test_an_open_side_is_told_beside_a_poor_place() -> None:
    one = zone(0.5, both(4, 1.0))
    wide = np.array(one.covariance_m2)
    wide[1] = np.diag([100.0, 0.1])
    decision = decide(replace(one, covariance_m2=wide))
    assert decision.anchors[1].status is AnchorStatus.ILL_CONDITIONED
    assert decision.anchors[0].status is AnchorStatus.AMBIGUOUS
    assert all(fix.side_is_open for fix in decision.anchors)


@pytest.mark.parametrize(("side", "sign"), [("left", 1), ("right", -1)])
def test_a_known_side_settles_an_undecided_zone(side: str, sign: int) -> None:
    decision = decide(zone(0.5, both(6, 0.99)), side=side)
    for fix in decision.anchors:
        assert np.sign(fix.position_m[1]) == sign
        assert fix.mirror_probability < 0.02 and fix.status is AnchorStatus.OK
    assert decision.reasons == ()


def test_one_surveyed_cone_settles_the_side_of_all() -> None:
    surveyed = {"anchor_id": "c2", "east_m": 20.1, "north_m": -5.05, "sigma_m": 0.05}
    decision = decide(zone(0.5, both(5, 0.999)), known_anchors=[surveyed])
    assert all(fix.position_m[1] < 0 and fix.status is AnchorStatus.OK for fix in decision.anchors)
    # Its own place is drawn to the survey, by its better standard deviation; the others stay.
    np.testing.assert_allclose(decision.anchors[2].position_m, [20.1, -5.05], atol=0.01)
    assert decision.anchors[2].covariance_m2[0, 0] < 0.05**2
    np.testing.assert_allclose(decision.anchors[1].position_m, [10.0, -5.0])


def test_a_survey_says_where_one_cone_stands_and_is_believed_against_the_zone() -> None:
    surveyed = {"anchor_id": "c1", "east_m": 10.0, "north_m": -5.0, "sigma_m": 0.05}
    decision = decide(zone(0.99999, both(4, 0.98)), known_anchors=[surveyed])
    assert [np.sign(fix.position_m[1]) for fix in decision.anchors] == [1, -1, 1, 1]


def test_a_wrong_side_is_noticed_and_not_used() -> None:
    sure = zone(0.99999, both(6, 0.9999))
    decision, plain = decide(sure, side="right"), decide(sure)
    assert [reason.statements for reason in decision.reasons] == [("side",)]
    for fix, alone in zip(decision.anchors, plain.anchors, strict=True):
        np.testing.assert_array_equal(fix.position_m, alone.position_m)
        assert fix.mirror_probability < 0.01


def test_a_cone_on_the_other_side_than_said_is_named() -> None:
    left = both(6, 0.9999)
    left[:, 3] = 1e-6
    decision = decide(zone(0.6, left), side="left")
    assert [np.sign(fix.position_m[1]) for fix in decision.anchors] == [1, 1, 1, -1, 1, 1]
    assert list(map(str, decision.reasons)) == [
        "the ranges place c3 on the right; all cones were stated to be on the left"
    ]


def test_a_cone_without_a_good_place_is_no_exception() -> None:
    left = both(3, 0.9999)
    left[:, 1] = 1e-6
    found, _ = make_hypotheses(3)
    for converged, n_told in ((True, 1), (False, 0)):
        found.converged[1] = converged
        facts = KnownFacts(
            make_config({"prior": {"side": "left"}}).prior,
            np.stack([np.linspace(-20.0, 60.0, 200), np.zeros(200)], axis=-1), {}, tuple("abc"),
        )  # fmt: skip
        fit = ByRanges(found, np.full(3, 0.5))
        told = decide_zone(tuple("abc"), zone(0.6, left), RANGES[:3], facts=facts, by_ranges=fit)
        assert [reason.cones for reason in told.reasons] == [("b",)] * n_told


def test_a_known_spacing_draws_neighbours_to_it() -> None:
    one = zone(0.999, both(5, 0.999))
    off = np.array([0.15, -0.1, 0.1, -0.15, 0.1])
    place = one.place_m + np.stack([off, np.zeros(5)], axis=-1)[:, None]
    decision = decide(replace(one, place_m=place), spacing_m=10.0, spacing_sigma_m=0.05)
    found = np.array([fix.position_m[0] for fix in decision.anchors])
    assert np.abs(np.diff(found) - 10.0).max() < 0.5 * np.abs(np.diff(off)).max()
    assert all(fix.covariance_m2[0, 0] < 0.04 for fix in decision.anchors)


def test_two_hundred_anchors_and_a_statement() -> None:
    decision = decide_zone(
        [str(k) for k in range(200)],
        zone(0.5, both(200, 0.99)),
        np.full(200, 50),
        facts=KnownFacts(
            PipelineConfig().prior.model_copy(update={"side": "right"}),
            np.stack([np.linspace(-20.0, 2020.0, 500), np.zeros(500)], axis=-1),
            {},
            tuple(str(k) for k in range(200)),
        ),
    )
    assert all(fix.position_m[1] < 0 for fix in decision.anchors)


def test_two_places_that_meet_are_one_and_leave_no_side_open() -> None:
    one = zone(0.5, both(3, 0.8))
    place = one.place_m.copy()
    place[1, 1] = place[1, 0] + [0.0, 0.3]  # both refined to one place, as on a winding path
    decision = decide(replace(one, place_m=place))
    assert [fix.status for fix in decision.anchors] == [
        AnchorStatus.AMBIGUOUS, AnchorStatus.OK, AnchorStatus.AMBIGUOUS,
    ]  # fmt: skip
    merged = decision.anchors[1]
    assert merged.mirror_probability == 0.0
    # Mean and variance of two places with probability 1/2 each, 0.3 m apart.
    np.testing.assert_allclose(merged.position_m, place[1, 0] + [0.0, 0.15])
    np.testing.assert_allclose(merged.covariance_m2, np.diag([0.04, 0.04 + 0.15**2]))
    assert len({tuple(side[[0, 2]]) for side in decision.combinations.side}) == 4
    assert len({int(side[1]) for side in decision.combinations.side}) == 1


def test_places_are_as_unsure_as_the_clock_and_never_surer_than_the_floor() -> None:
    t_s = np.arange(50) * 0.1
    valid = np.ones((50, 2), dtype=bool)
    valid[10:, 1] = False
    episode = Episode(
        name="drive",
        anchor_ids=("a", "b"),
        t_s=t_s,
        position_m=np.stack([3.0 * t_s, np.zeros(50)], axis=-1),
        range_m=np.where(valid, 5.0, np.nan),
        valid=valid,
        clock=ClockOffset(0.0, 0.02, applied=True, reason="found"),
    )
    one = zone(0.5, both(2, 0.9))
    found = widened(one, episode, SolverConfig(position_floor_m=0.05))
    more = found.covariance_m2 - one.covariance_m2
    expected = np.diag([0.06**2 + 0.05**2, 0.05**2])  # 0.02 s at 3 m/s, along the path
    np.testing.assert_allclose(more, np.broadcast_to(expected, (2, 2, 2, 2)), atol=1e-12)
    alone = widened(one, replace(episode, clock=None), SolverConfig(position_floor_m=0.0))
    np.testing.assert_array_equal(alone.covariance_m2, one.covariance_m2)


@pytest.mark.parametrize("n", [3, 12, 30])
def test_a_statement_about_one_anchor_leaves_the_others_as_open_as_they_were(n: int) -> None:
    alone = np.full((2, n), 0.7)  # each anchor for itself
    plain, told = decide(zone(0.5, alone)), decide(zone(0.5, alone), known_anchors=[SURVEY])
    assert plain.anchors[0].mirror_probability == pytest.approx(0.3)
    assert told.anchors[0].mirror_probability < 0.01
    for fix in told.anchors[1:]:
        assert fix.mirror_probability == pytest.approx(0.3, abs=0.03)
        assert fix.status is AnchorStatus.AMBIGUOUS


def test_a_spacing_does_not_tell_what_moves_all_anchors_alike() -> None:
    one = replace(zone(0.999, both(6, 0.999)), covariance_m2=np.tile(4.0 * np.eye(2), (6, 2, 1, 1)))
    decision = decide(one, spacing_m=10.0, spacing_sigma_m=0.05)
    assert all(2.0 < fix.covariance_m2[0, 0] < 4.0 for fix in decision.anchors)


def test_scenes_of_many_open_sides_are_drawn_not_listed() -> None:
    decision = decide(zone(0.5, np.full((2, 30), 0.7)))
    assert all(fix.mirror_probability == pytest.approx(0.3) for fix in decision.anchors)
    kept = decision.combinations
    share = kept.weight @ (kept.side == 1)
    assert share.mean() == pytest.approx(0.3, abs=0.05) and share.min() > 0.05


@pytest.mark.parametrize("said", [{}, {"known_anchors": [{**SURVEY, "sigma_m": 100.0}]}])
def test_no_combination_is_drawn_twice_and_the_likeliest_come_first(said: dict) -> None:
    few_open = np.tile([0.7] * 6 + [0.97] * 10, (2, 1))
    kept = decide(zone(0.5, few_open), **said).combinations
    assert len(np.unique(kept.side, axis=0)) == len(kept.side)
    assert (np.diff(kept.weight) <= 0).all()
    assert kept.weight.sum() == pytest.approx(1.0)


def test_a_statement_may_be_wrong_of_all_cones_at_once() -> None:
    decision = decide(zone(0.5, both(8, 1.0)), side="left")
    for fix in decision.anchors:
        assert fix.status is AnchorStatus.OK
        assert fix.mirror_probability == pytest.approx(0.02 * 0.5, rel=0.1)


def test_many_open_sides_stay_open_beside_a_statement_that_says_little() -> None:
    n = 30
    decision = decide(zone(0.5, np.full((2, n), 0.7)), known_anchors=[SURVEY])
    kept = decision.combinations
    share = kept.weight @ (kept.side == 1)
    assert share[0] < 0.01
    assert share[1:].mean() == pytest.approx(0.3, abs=0.05)
    assert share[1:].min() > 0.05


def test_a_statement_on_all_anchors_is_listed_where_no_draw_would_find_it() -> None:
    decision = decide(zone(0.5, np.full((2, 60), 0.7)), side="left")
    kept = decision.combinations
    assert kept.weight @ (kept.side == 1).mean(axis=1) < 0.05
    assert all(fix.position_m[1] > 0 for fix in decision.anchors)


def test_what_the_ranges_say_alone_stands_beside_what_the_network_says() -> None:
    one = zone(0.5, both(3, 0.999))
    fit = ByRanges(make_hypotheses(3)[0], np.array([0.999, 0.4, np.nan]))
    facts = KnownFacts(
        make_config({"prior": {"side": "right"}}).prior,
        np.stack([np.linspace(-20.0, 60.0, 200), np.zeros(200)], axis=-1), {}, ("c0", "c1", "c2"),
    )  # fmt: skip
    fixes = decide_zone(["c0", "c1", "c2"], one, RANGES[:3], facts=facts, by_ranges=fit).anchors
    assert all(fix.position_m[1] < 0 for fix in fixes)
    alone = [fix.mirror_probability_by_ranges for fix in fixes]
    np.testing.assert_allclose(alone, [0.001, 0.6, np.nan])
    sources = [fix.side_source for fix in fixes]
    assert sources == [SideSource.RANGES, SideSource.STATEMENT, SideSource.STATEMENT]


def test_a_statement_that_a_single_cone_rules_out_by_its_ranges_pulls_no_other() -> None:
    one = zone(0.5, both(3, 0.9))
    fit = ByRanges(make_hypotheses(3)[0], np.array([0.9999, 0.5, 0.5]))
    facts = KnownFacts(
        make_config({"prior": {"side": "left"}}).prior,
        np.stack([np.linspace(-20.0, 60.0, 200), np.zeros(200)], axis=-1), {}, ("c0", "c1", "c2"),
    )  # fmt: skip
    told = decide_zone(["c0", "c1", "c2"], one, RANGES[:3], facts=facts, by_ranges=fit)
    assert [(r.statements, r.cones) for r in told.reasons] == [(("side",), ("c0",))]
    plain = decide_zone(["c0", "c1", "c2"], one, RANGES[:3], by_ranges=fit)
    for fix, other in zip(told.anchors, plain.anchors, strict=True):
        assert fix.mirror_probability == pytest.approx(other.mirror_probability)
