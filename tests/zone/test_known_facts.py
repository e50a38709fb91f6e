from dataclasses import replace

import numpy as np
import pytest

from gaia_uwb._shared.errors import ConfigError
from gaia_uwb.config import KnownAnchor, PipelineConfig, PriorConfig, make_config
from gaia_uwb.episode import Episode
from gaia_uwb.estimate import ReasonKind
from gaia_uwb.pipeline import reconstruct
from gaia_uwb.projection import to_geodetic
from gaia_uwb.scene import LocalFrame
from gaia_uwb.simulate import PRESETS, simulate_pass
from gaia_uwb.zone.known_facts import KnownFacts
from gaia_uwb.zone.sides import decide_sides
from two_places import PATH_M, make_hypotheses

SITE = LocalFrame(lat_deg=48.1, lon_deg=11.5, alt_m=520.0)
NO_CLUE = 0.05  # log odds of ranges along a straight path


def make_episode(n, frame=None):
    """Return a drive east along y = 0; :func:`make_hypotheses` puts the cones on its left."""
    path_m = np.stack([np.arange(-10.0, 50.0), np.zeros(60)], axis=1)
    ids = tuple(f"cone-{k}" for k in range(n))
    return Episode(
        "pass", ids, np.arange(60.0), path_m, np.ones((60, n)), np.ones((60, n), dtype=bool),
        frame=frame,
    )  # fmt: skip


def decide(found, frame=None, **said):
    episode = make_episode(len(found.log_odds), frame)
    facts = KnownFacts.of(PriorConfig(**said), episode)
    return decide_sides(episode.anchor_ids, found, episode.position_m, facts=facts)


def wrong_sides(decision, true_m):
    places_m = np.stack([fix.position_m for fix in decision.anchors])
    return int((places_m[:, 1] * true_m[:, 1] < 0).sum())


def worst_mirror(decision):
    return max(fix.mirror_probability for fix in decision.anchors)


def test_nothing_said_is_nothing_known_and_changes_nothing() -> None:
    assert KnownFacts.of(PriorConfig(), make_episode(3)) is None
    found, _ = make_hypotheses(6, seed=2, odds=1.0)
    plain = decide_sides([f"cone-{k}" for k in range(6)], found, PATH_M)
    for one, other in zip(plain.anchors, decide(found).anchors, strict=True):
        assert np.array_equal(one.position_m, other.position_m)
        assert np.array_equal(one.covariance_m2, other.covariance_m2)
        assert one.mirror_probability == other.mirror_probability


@pytest.mark.parametrize("side", ["left", "right"])
def test_a_known_side_settles_what_ranges_leave_open(side) -> None:
    found, true_m = make_hypotheses(6, seed=5, odds=NO_CLUE)
    assert worst_mirror(decide(found)) > 0.4
    decision = decide(found, side=side)
    assert wrong_sides(decision, true_m) == (0 if side == "left" else 6)
    assert worst_mirror(decision) < 0.1
    assert decision.reasons == ()


@pytest.mark.parametrize("error", [0.02, 0.2])
def test_a_statement_may_be_wrong_as_a_whole_and_of_the_cone(error) -> None:
    found, _ = make_hypotheses(1, sigma_m=0.1)
    found.log_odds[:] = 0.0
    (fix,) = decide(found, side="left", statement_error=error).anchors
    # It says nothing at all, or holds but for single cones; per cone against 1/2 without it.
    left, right = (error + (1.0 - error) * 2.0 * share for share in (1.0 - error, error))
    assert fix.position_m[1] > 0.0
    expected = (1.0 - error) * right / (left + right) + error * 0.5
    assert fix.mirror_probability == pytest.approx(expected, rel=1e-3)


def test_a_wrong_side_is_told_and_not_used() -> None:
    found, true_m = make_hypotheses(6, seed=5, odds=12.0)
    decision = decide(found, side="right")
    assert wrong_sides(decision, true_m) == 0
    (reason,) = decision.reasons
    assert (reason.kind, reason.statements) == (ReasonKind.STATEMENT, ("side",))
    assert reason.numbers["likelihood_ratio"] > 20.0
    assert str(reason).startswith('the ranges contradict "all cones are on the right"')
    plain = decide(found)
    for one, other in zip(plain.anchors, decision.anchors, strict=True):
        assert np.array_equal(one.position_m, other.position_m)


def test_a_cone_that_its_ranges_place_on_the_other_side_is_enough() -> None:
    found, _ = make_hypotheses(6, seed=5, odds=30.0)
    found.position_m[2] *= [1.0, -1.0]
    found.log_odds[4:] = NO_CLUE
    decision = decide(found, side="left")
    (reason,) = decision.reasons
    assert (reason.kind, reason.cones) == (ReasonKind.STATEMENT, ("cone-2",))
    assert str(reason) == (
        'the ranges contradict "all cones are on the left", so it is not used: those of cone-2 '
        "rule it out"
    )
    for one, other in zip(decide(found).anchors, decision.anchors, strict=True):
        assert one.mirror_probability == other.mirror_probability


def test_many_cones_that_are_none_of_them_sure_contradict_together() -> None:
    found, _ = make_hypotheses(12, odds=30.0)
    found.log_odds[:] = 1.0
    assert decide(found, side="left").reasons == ()
    (reason,) = decide(found, side="right").reasons
    assert reason.kind is ReasonKind.STATEMENT and reason.cones == ()
    assert reason.numbers["likelihood_ratio"] > 100.0
    assert "layout" not in str(reason)


@pytest.mark.parametrize("poor", ["converged", "fits", "covariance_m2"])
def test_cones_whose_ranges_determine_no_place_contradict_nothing(poor) -> None:
    found, _ = make_hypotheses(2, odds=30.0)
    found.log_odds[:] = [7.5, NO_CLUE]
    (reason,) = decide(found, side="right").reasons
    assert "the ranges contradict" in str(reason)
    getattr(found, poor)[0] = 25.0 * np.eye(2) if poor == "covariance_m2" else False
    assert "the ranges contradict" not in "".join(map(str, decide(found, side="right").reasons))


def test_a_closure_is_contradicted_by_cones_on_both_sides_only() -> None:
    found, _ = make_hypotheses(6, seed=5, odds=30.0)
    assert decide(found, closure="lane-closure").reasons == ()
    found.position_m[1] *= [1.0, -1.0]
    (reason,) = decide(found, closure="lane-closure").reasons
    assert (reason.statements, reason.cones) == (("closure",), ("cone-1",))


def test_a_closure_keeps_all_cones_to_one_side() -> None:
    found, _ = make_hypotheses(8, odds=NO_CLUE)
    found.position_m[..., 0] *= 3.0

    def on_both_sides(**said):
        kept = decide(found, **said).combinations
        left = np.where(kept.side == 0, found.position_m[:, 0, 1], found.position_m[:, 1, 1]) > 0
        return kept.weight @ (left.any(axis=1) & ~left.all(axis=1))

    assert on_both_sides() > 0.15
    assert on_both_sides(closure="lane-closure") < 0.05
    assert on_both_sides(closure="median-crossover") == on_both_sides()


def test_a_surveyed_cone_has_its_side_and_a_better_place() -> None:
    found, true_m = make_hypotheses(5, seed=3, odds=NO_CLUE)
    known = KnownAnchor(anchor_id="cone-1", east_m=true_m[1, 0], north_m=true_m[1, 1], sigma_m=0.05)
    fix = decide(found, known_anchors=(known,)).anchors[1]
    assert fix.mirror_probability < 0.02
    assert np.linalg.norm(fix.position_m - true_m[1]) < 0.15
    assert np.sqrt(np.linalg.eigvalsh(fix.covariance_m2)[1]) < 0.25
    lat_deg, lon_deg, _ = to_geodetic(SITE, true_m[1:2])
    on_earth = KnownAnchor(anchor_id="cone-1", lat_deg=lat_deg[0], lon_deg=lon_deg[0], sigma_m=0.05)
    again = decide(found, frame=SITE, known_anchors=(on_earth,)).anchors[1]
    assert again.position_m == pytest.approx(fix.position_m, abs=1e-3)


def test_a_survey_tells_what_all_cones_have_in_common() -> None:
    rng = np.random.default_rng(4)
    n, sigma_m = 4, 0.05
    found, _ = make_hypotheses(n, seed=3)
    shared_m = np.repeat(rng.normal(0.0, 1.0, (n, 1, 2, 3)), 2, axis=1)
    own_m2 = found.covariance_m2[:, 0]
    shared_m2 = shared_m @ np.swapaxes(shared_m, -1, -2)
    found = replace(found, covariance_m2=own_m2[:, None] + shared_m2, shared_m=shared_m)
    survey_m = found.position_m[1, 0] + [1.0, -0.5]
    facts = KnownFacts(PriorConfig(), PATH_M, {1: (survey_m, sigma_m)}, ("a", "b", "c", "d"))
    told = facts.with_surveys(found)
    # All places at once, conditioned on the survey by the book.
    rows = shared_m[:, 0].reshape(2 * n, 3)
    covariance_m2 = rows @ rows.T
    for k in range(n):
        covariance_m2[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] += own_m2[k]
    to_survey = covariance_m2[:, 2:4]
    gain = to_survey @ np.linalg.inv(covariance_m2[2:4, 2:4] + sigma_m**2 * np.eye(2))
    place_m = found.position_m[:, 0].ravel() + gain @ [1.0, -0.5]
    left_m2 = (covariance_m2 - gain @ to_survey.T).reshape(n, 2, n, 2)
    assert told.position_m[:, 0].ravel() == pytest.approx(place_m)
    for k in range(n):
        assert told.covariance_m2[k, 0] == pytest.approx(left_m2[k, :, k])
        for other in set(range(n)) - {k}:
            common = told.shared_m[k, 0] @ told.shared_m[other, 0].T
            assert common == pytest.approx(left_m2[k, :, other])


def test_a_wrong_survey_is_told_and_not_used() -> None:
    found, true_m = make_hypotheses(5, seed=3)
    known = KnownAnchor(anchor_id="cone-1", east_m=true_m[1, 0] + 9.0, north_m=true_m[1, 1])
    decision = decide(found, known_anchors=(known,))
    assert decision.reasons[0].statements == ("known_anchors.cone-1",)
    assert "cone-1 is at its surveyed position" in str(decision.reasons[0])
    assert np.array_equal(decision.anchors[1].position_m, decide(found).anchors[1].position_m)


def straight_row(n=6, seed=0, sigma_m=0.3):
    """Return cones 8 m apart along y = 4, their ranges telling nothing of the side."""
    found, _ = make_hypotheses(n, seed=seed, odds=NO_CLUE, sigma_m=sigma_m)
    true_m = np.stack([8.0 * np.arange(n), np.full(n, 4.0)], axis=1)
    place_m = true_m + sigma_m * np.random.default_rng(seed).standard_normal((n, 2))
    pair_m = np.stack([place_m, place_m * [1.0, -1.0]], axis=1)
    flipped = np.arange(n) % 2 == 1
    pair_m[flipped] = pair_m[flipped, ::-1]
    found.position_m[:] = pair_m
    return found, true_m


def test_a_known_spacing_brings_neighbours_to_one_side_and_to_their_distance() -> None:
    found, true_m = straight_row()
    decision = decide(found, spacing_m=8.0, spacing_sigma_m=0.1)
    assert decision.reasons == ()
    assert wrong_sides(decision, true_m) in (0, 6)
    places_m = np.stack([fix.position_m for fix in decision.anchors])
    steps_m = np.hypot(*np.diff(places_m, axis=0).T)
    assert np.abs(steps_m - 8.0).max() < 0.2
    plain = decide(found, closure="lane-closure")
    for sharp, usual in zip(decision.anchors[1:-1], plain.anchors[1:-1], strict=True):
        assert sharp.covariance_m2[0, 0] < 0.9 * usual.covariance_m2[0, 0]


def test_a_wrong_spacing_is_told_and_not_used() -> None:
    found, _ = straight_row()
    decision = decide(found, spacing_m=20.0)
    assert decision.reasons[0].statements == ("spacing_m",)
    assert "neighbouring cones are 20 m apart" in str(decision.reasons[0])
    assert np.array_equal(decision.anchors[0].position_m, decide(found).anchors[0].position_m)


def test_facts_go_together_and_a_wrong_one_does_not_spoil_the_others() -> None:
    found, true_m = make_hypotheses(6, seed=5, odds=NO_CLUE)
    decision = decide(found, side="left", spacing_m=90.0)
    assert len(decision.reasons) == 1
    assert wrong_sides(decision, true_m) == 0


def test_what_is_said_must_be_possible() -> None:
    with pytest.raises(ConfigError, match="known anchor 'x': not in the log, which has cone-0"):
        decide(make_hypotheses(3)[0], known_anchors=(
            KnownAnchor(anchor_id="x", east_m=0.0, north_m=0.0),))  # fmt: skip
    with pytest.raises(ConfigError, match="no geographic reference"):
        decide(make_hypotheses(3)[0], known_anchors=(
            KnownAnchor(anchor_id="cone-1", lat_deg=1.0, lon_deg=0.0),))  # fmt: skip
    for prior in (
        {"known_anchors": [{"anchor_id": "a", "east_m": 1.0}]},
        {"known_anchors": [{"anchor_id": "a", "east_m": 1.0, "north_m": 1.0}] * 2},
        {"side": "up"},
    ):
        with pytest.raises(ConfigError, match="prior"):
            make_config({"prior": prior})
    with pytest.raises(ConfigError, match=r"requires sides\.joint"):
        make_config({"sides": {"joint": False}, "prior": {"side": "left"}})


def test_a_straight_pass_from_the_log_to_the_boundary() -> None:
    scene = simulate_pass(PRESETS["straight"], seed=1)
    plain = reconstruct(scene)
    assert ReasonKind.AMBIGUOUS in {reason.kind for reason in plain.reasons}
    known = reconstruct(scene, make_config({"prior": {"side": "right"}}))
    assert known.reasons == ()
    assert known.boundary_uncertainty.inner.area_m2 > plain.boundary_uncertainty.inner.area_m2
    assert PipelineConfig().prior.says_nothing
