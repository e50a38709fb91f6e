from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, replace

import numpy as np
import pytest

from gaia_uwb._shared.errors import InputError
from gaia_uwb.denoised import DenoisedRanges
from gaia_uwb.episode import Episode, EpisodeTruth
from gaia_uwb.estimate import AnchorFix, AnchorStatus
from gaia_uwb.evaluate.metrics import Metric, aggregate, score_episode
from gaia_uwb.evaluate.rigid_alignment import rotation_matrix

# Four cones round a strip of 10 m x 4 m, beside a straight drive along the east axis.
CONES = np.array([[0.0, 2.0], [10.0, 2.0], [10.0, 6.0], [0.0, 6.0]])
COVARIANCE_M2 = 0.01 * np.eye(2)
EAST, NORTH = np.eye(2)
IDS = ("a", "b", "c", "d")
STEPS = 5
RANGE_NAMES = ("distance_mse_overall", "distance_mse_los", "distance_mse_nlos")


def make_episode(nlos: np.ndarray | None = None, valid: np.ndarray | None = None) -> Episode:
    position_m = np.stack([np.linspace(-5.0, 15.0, STEPS), np.zeros(STEPS)], axis=1)
    true_m = np.hypot(*(position_m[:, None] - CONES).transpose(2, 0, 1))
    valid = np.ones((STEPS, 4), dtype=bool) if valid is None else valid
    nlos = np.zeros((STEPS, 4), dtype=bool) if nlos is None else nlos
    return Episode(
        name="strip",
        anchor_ids=IDS,
        t_s=np.arange(float(STEPS)),
        position_m=position_m,
        range_m=np.where(valid, true_m + 0.5, np.nan),
        valid=valid,
        truth=EpisodeTruth(anchor_m=CONES, range_m=true_m, nlos=nlos),
    )


def make_denoised(
    episode: Episode, error_m: np.ndarray | float = 0.0, kept: np.ndarray | None = None
) -> DenoisedRanges:
    valid = episode.valid if kept is None else kept
    assert episode.truth is not None
    return DenoisedRanges(
        range_m=np.where(valid, episode.truth.range_m + error_m, np.nan),
        sigma_m=np.where(valid, 0.1, np.nan),
        valid=valid,
    )


def make_fixes(
    position_m: np.ndarray = CONES,
    *,
    mirror_m: np.ndarray | None = None,
    covariance_m2: np.ndarray = COVARIANCE_M2,
    lost: Sequence[int] = (),
) -> list[AnchorFix]:
    mirror_m = position_m * [1.0, -1.0] if mirror_m is None else mirror_m
    nothing = np.full((2, 2), np.nan)
    return [
        AnchorFix(
            anchor_id=name,
            position_m=nothing[0] if k in lost else position_m[k],
            covariance_m2=nothing if k in lost else covariance_m2,
            mirror_position_m=nothing[0] if k in lost else mirror_m[k],
            mirror_probability=0.0,
            status=AnchorStatus.TOO_FEW_RANGES if k in lost else AnchorStatus.OK,
            n_ranges=STEPS,
        )
        for k, name in enumerate(IDS)
    ]


def score(fixes: list[AnchorFix], episode: Episode | None = None) -> dict[str, Metric]:
    episode = episode or make_episode()
    return score_episode(episode, make_denoised(episode), fixes)


class TestMetric:
    @pytest.mark.parametrize(("value", "n"), [(np.nan, 3), (np.inf, 3), (1.0, 0)])
    def test_refuses_what_is_no_number_of_something(self, value: float, n: int) -> None:
        with pytest.raises(
            InputError, match="anchor_mae: expected a finite value over at least one"
        ):
            Metric("anchor_mae", value, "m", n)


class TestPerfectEstimate:
    def test_has_every_score_at_its_best(self) -> None:
        nlos = np.zeros((STEPS, 4), dtype=bool)
        nlos[0] = True
        scores = score(make_fixes(), make_episode(nlos))
        assert {name: (s.value, s.unit, s.n) for name, s in scores.items()} == {
            "distance_mse_overall": (0.0, "m^2", 20),
            "distance_mse_los": (0.0, "m^2", 16),
            "distance_mse_nlos": (0.0, "m^2", 4),
            "anchor_mae": (0.0, "m", 4),
            "polygon_iou": (1.0, "", 1),
            "polygon_hausdorff": (0.0, "m", 1),
            "located_share": (1.0, "", 4),
            "anchor_mae_right_side": (0.0, "m", 4),
            "wrong_side_share": (0.0, "", 4),
            "open_share": (0.0, "", 4),
            "ellipse_coverage_90": (1.0, "", 4),
            "region_coverage_90": (1.0, "", 4),
            "anchor_mae_aligned": (pytest.approx(0.0, abs=1e-12), "m", 4),
            "ellipse_coverage_90_aligned": (1.0, "", 4),
            "region_coverage_90_aligned": (1.0, "", 4),
        }
        assert all(name == s.name for name, s in scores.items())


class TestRangeScores:
    def test_are_the_papers_means_over_valid_ranges(self) -> None:
        rng = np.random.default_rng(0)
        nlos, valid = rng.random((STEPS, 4)) < 0.4, rng.random((STEPS, 4)) < 0.8
        error_m = rng.normal(size=(STEPS, 4))
        episode = make_episode(nlos, valid)
        scores = score_episode(episode, make_denoised(episode, error_m), make_fixes())
        for name, label in zip(RANGE_NAMES, (np.ones_like(nlos), ~nlos, nlos), strict=True):
            weight = (valid & label).astype(float)
            assert scores[name].value == pytest.approx((weight * error_m**2).sum() / weight.sum())
            assert scores[name].n == weight.sum()

    def test_leave_out_what_the_denoiser_rejected_or_made_up(self) -> None:
        valid, kept = np.ones((STEPS, 4), dtype=bool), np.ones((STEPS, 4), dtype=bool)
        valid[0, 0] = kept[1, 1] = False
        error_m = np.zeros((STEPS, 4))
        error_m[0, 0] = error_m[1, 1] = 100.0
        episode = make_episode(valid=valid)
        scores = score_episode(episode, make_denoised(episode, error_m, kept), make_fixes())
        assert (scores["distance_mse_overall"].value, scores["distance_mse_overall"].n) == (0.0, 18)

    def test_are_absent_where_there_is_nothing_of_the_kind(self) -> None:
        assert "distance_mse_nlos" not in score(make_fixes())
        assert "distance_mse_los" not in score(
            make_fixes(), make_episode(np.ones((STEPS, 4), dtype=bool))
        )
        episode = make_episode()
        nothing_kept = make_denoised(episode, kept=np.zeros((STEPS, 4), dtype=bool))
        assert not set(score_episode(episode, nothing_kept, make_fixes())) & set(RANGE_NAMES)


class TestAnchorScores:
    def test_a_shift_is_an_error_until_aligned(self) -> None:
        scores = score(make_fixes(CONES + 3.0 * EAST + 4.0 * NORTH))
        assert scores["anchor_mae"].value == pytest.approx(5.0)
        assert scores["polygon_hausdorff"].value == pytest.approx(5.0)
        assert scores["polygon_iou"].value == 0.0
        assert scores["anchor_mae_aligned"].value == pytest.approx(0.0, abs=1e-12)
        assert scores["ellipse_coverage_90"].value == 0.0
        assert scores["ellipse_coverage_90_aligned"].value == 1.0

    def test_half_a_shift_shares_a_known_area(self) -> None:
        assert score(make_fixes(CONES + 5.0 * EAST))["polygon_iou"].value == pytest.approx(1 / 3)

    def test_the_other_side_is_counted_as_such(self) -> None:
        mirror_m = CONES * [1.0, -1.0]
        chosen_m = np.concatenate([mirror_m[:1], CONES[1:]])
        other_m = np.concatenate([CONES[:1], mirror_m[1:]])
        scores = score(make_fixes(chosen_m, mirror_m=other_m))
        assert scores["anchor_mae"].value == pytest.approx(4.0 / 4)
        assert scores["anchor_mae_right_side"].value == 0.0
        assert (scores["wrong_side_share"].value, scores["wrong_side_share"].n) == (0.25, 4)

    def test_a_mirrored_layout_stays_wrong_after_alignment(self) -> None:
        triangle = np.array([[0.0, 2.0], [10.0, 2.0], [10.0, 6.0], [4.0, 5.0]])
        aligned = score(make_fixes(triangle * [1.0, -1.0]))["anchor_mae_aligned"].value
        assert aligned > 1.0

    @pytest.mark.parametrize(
        ("apart_m", "sigma_m", "counted"),
        [(0.09, 0.001, False), (0.11, 0.001, True), (0.29, 0.1, False), (0.31, 0.1, True)],
    )
    def test_sides_count_only_where_hypotheses_are_clearly_apart(
        self, apart_m: float, sigma_m: float, counted: bool
    ) -> None:
        # Very uncertain along the path, which has nothing to do with the side.
        covariance_m2 = np.diag([100.0, sigma_m**2])
        fixes = make_fixes(mirror_m=CONES - apart_m * NORTH, covariance_m2=covariance_m2)
        assert ("wrong_side_share" in score(fixes)) is counted

    def test_a_fix_without_another_hypothesis_has_one_side(self) -> None:
        scores = score(make_fixes(CONES + 0.3 * EAST, mirror_m=np.full((4, 2), np.nan)))
        assert scores["anchor_mae_right_side"].value == pytest.approx(0.3)
        assert "wrong_side_share" not in scores

    def test_ellipses_hold_the_truth_as_often_as_they_say(self) -> None:
        rng = np.random.default_rng(1)
        covariance_m2 = rotation_matrix(0.5) @ np.diag([0.5, 0.01]) @ rotation_matrix(-0.5)
        episode, covered = make_episode(), []
        for _ in range(150):
            error_m = rng.multivariate_normal(np.zeros(2), covariance_m2, size=4)
            fixes = make_fixes(CONES + error_m, covariance_m2=covariance_m2)
            covered.append(score(fixes, episode)["ellipse_coverage_90"].value)
        assert np.mean(covered) == pytest.approx(0.90, abs=0.03)

    @pytest.mark.parametrize(("probability", "covered"), [(0.09, 0.0), (0.11, 1.0)])
    def test_the_region_of_an_open_side_has_both_places(
        self, probability: float, covered: float
    ) -> None:
        wrong = make_fixes(CONES * [1.0, -1.0], mirror_m=CONES)
        ellipse = np.diag([0.01, 0.01])
        fixes = [
            replace(fix, mirror_probability=probability, mirror_covariance_m2=ellipse)
            for fix in wrong
        ]
        scores = score(fixes)
        assert scores["ellipse_coverage_90"].value == 0.0
        assert scores["region_coverage_90"].value == covered
        assert scores["open_share"].value == covered
        # Without an ellipse of its own, a mirror place holds nothing.
        assert (
            score([replace(f, mirror_probability=0.5) for f in wrong])["region_coverage_90"].value
            == 0.0
        )

    def test_ellipses_turn_with_the_alignment(self) -> None:
        # The layout is turned by 90 degrees and off by 1 m along what was its long axis.
        turn = rotation_matrix(np.pi / 2)
        stretched = CONES + np.array([[-1.0, 0.0], [1.0, 0.0], [1.0, 0.0], [-1.0, 0.0]])
        long_north = np.diag([1e-4, 1.0])
        scores = score(make_fixes(stretched @ turn.T, covariance_m2=long_north))
        assert scores["anchor_mae_aligned"].value == pytest.approx(1.0)
        assert scores["ellipse_coverage_90_aligned"].value == 1.0
        scores = score(make_fixes(stretched @ turn.T, covariance_m2=np.diag([1.0, 1e-4])))
        assert scores["ellipse_coverage_90_aligned"].value == 0.0

    @pytest.mark.parametrize("unknown", [np.full((2, 2), np.nan), np.diag([np.inf, 1.0])])
    def test_a_fix_without_a_covariance_has_no_ellipse_and_no_side(
        self, unknown: np.ndarray
    ) -> None:
        scores = score(make_fixes(covariance_m2=unknown))
        assert not {name for name in scores if "ellipse" in name or "side_share" in name}
        assert scores["anchor_mae"].n == 4

    @pytest.mark.parametrize("singular", [np.zeros((2, 2)), np.diag([1.0, 0.0])])
    def test_an_ellipse_without_area_is_a_claim_that_fails(self, singular: np.ndarray) -> None:
        fixes = make_fixes(CONES + 1e-3 * EAST, covariance_m2=singular)
        assert score(fixes)["ellipse_coverage_90"].value == 0.0


class TestAnchorsThatWereNotLocated:
    def test_count_in_the_share_and_by_their_absence_in_the_polygon(self) -> None:
        scores = score(make_fixes(lost=[2]))
        assert (scores["anchor_mae"].value, scores["anchor_mae"].n) == (0.0, 3)
        assert (scores["located_share"].value, scores["located_share"].n) == (0.75, 4)
        assert scores["polygon_iou"].value == pytest.approx(0.5)
        assert scores["polygon_hausdorff"].value == pytest.approx(10 * 4 / np.hypot(10, 4))

    def test_that_were_never_heard_do_not_count_at_all(self) -> None:
        valid = np.ones((STEPS, 4), dtype=bool)
        valid[:, 2] = False
        scores = score(make_fixes(lost=[2]), make_episode(valid=valid))
        assert (scores["located_share"].value, scores["located_share"].n) == (1.0, 3)
        assert scores["polygon_iou"].value == pytest.approx(1.0)

    def test_leave_a_segment_with_iou_zero(self) -> None:
        scores = score(make_fixes(lost=[2, 3]))
        assert scores["polygon_iou"].value == 0.0
        assert scores["polygon_hausdorff"].value == pytest.approx(4.0)
        assert scores["anchor_mae_aligned"].n == 2

    def test_leave_one_that_cannot_be_aligned(self) -> None:
        scores = score(make_fixes(lost=[1, 2, 3]))
        assert scores["polygon_hausdorff"].value == pytest.approx(np.hypot(10, 4))
        assert not {name for name in scores if name.endswith("aligned")}

    def test_leave_nothing(self) -> None:
        scores = score(make_fixes(lost=[0, 1, 2, 3]))
        assert set(scores) - set(RANGE_NAMES) == {"polygon_iou", "located_share"}
        assert scores["polygon_iou"].value == scores["located_share"].value == 0.0

    def test_in_an_episode_without_ranges_leave_no_score(self) -> None:
        silent = make_episode(valid=np.zeros((STEPS, 4), dtype=bool))
        assert score(make_fixes(lost=[0, 1, 2, 3]), silent) == {}


class TestRefusals:
    def test_without_truth(self) -> None:
        episode = make_episode()
        with pytest.raises(InputError, match="strip: expected an episode with its truth"):
            score_episode(episode.without_truth(), make_denoised(episode), make_fixes())

    def test_of_ranges_of_another_episode(self) -> None:
        episode = make_episode()
        with pytest.raises(InputError, match=r"denoised ranges of shape \(5, 4\), got \(3, 4\)"):
            score_episode(episode, make_denoised(episode.window(0, 3)), make_fixes())

    def test_of_fixes_in_another_order(self) -> None:
        with pytest.raises(InputError, match="expected fixes for"):
            score(make_fixes()[::-1])


class TestAggregate:
    def test_says_what_it_averaged_and_how(self) -> None:
        first = {
            "distance_mse_overall": Metric("distance_mse_overall", 1.0, "m^2", 30),
            "anchor_mae": Metric("anchor_mae", 2.0, "m", 4),
        }
        second = {"distance_mse_overall": Metric("distance_mse_overall", 5.0, "m^2", 10)}
        results = aggregate([first, second], ["run-1", "run-2"])
        assert json.loads(json.dumps({k: asdict(v) for k, v in results.items()})) == {
            "distance_mse_overall": {
                "value": 3.0,
                "ci95": [1.0, 5.0],
                "n": 2,
                "unit": "m^2",
                "how": "mean_over_episodes",
                "left_out": 0,
            },
            "pooled_distance_mse_overall": {
                "value": 2.0,
                "ci95": [1.0, 5.0],
                "n": 40,
                "unit": "m^2",
                "how": "pooled",
                "left_out": 0,
            },
            "anchor_mae": {
                "value": 2.0,
                "ci95": None,
                "n": 1,
                "unit": "m",
                "how": "mean_over_episodes",
                "left_out": 1,
            },
        }

    def test_pooling_episodes_equals_one_long_episode(self) -> None:
        rng = np.random.default_rng(2)
        nlos, error_m = rng.random((STEPS, 4)) < 0.5, rng.normal(size=(STEPS, 4))
        whole = make_episode(nlos)
        denoised = make_denoised(whole, error_m)
        parts = []
        for start, stop in ((0, 1), (1, 5)):
            cut = slice(start, stop)
            part = DenoisedRanges(denoised.range_m[cut], denoised.sigma_m[cut], denoised.valid[cut])
            parts.append(score_episode(whole.window(start, stop), part, make_fixes()))
        results = aggregate(parts, ["run-1", "run-1"])
        expected = score_episode(whole, denoised, make_fixes())
        for name in RANGE_NAMES:
            assert results[f"pooled_{name}"].value == pytest.approx(expected[name].value)
            assert results[f"pooled_{name}"].n == expected[name].n

    def test_draws_whole_runs(self) -> None:
        # Windows of a run are alike: their number must not make the interval shorter.
        few = [{"polygon_iou": Metric("polygon_iou", iou, "", 1)} for iou in (0.2, 0.4, 0.9)]
        runs = ["run-1", "run-2", "run-3"]
        many = aggregate(few * 20, runs * 20)["polygon_iou"]
        assert many.n == 60
        assert many.ci95 == pytest.approx(aggregate(few, runs)["polygon_iou"].ci95)
        independent = aggregate(few * 20, [f"window-{k}" for k in range(60)])["polygon_iou"]
        assert np.ptp(independent.ci95) < 0.5 * np.ptp(many.ci95)

    def test_refuses_no_episodes_and_missing_groups(self) -> None:
        with pytest.raises(InputError, match="got 0 episodes and 0 groups"):
            aggregate([], [])
        with pytest.raises(InputError, match="got 1 episodes and 2 groups"):
            aggregate([score(make_fixes())], ["run-1", "run-2"])
