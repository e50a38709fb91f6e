from __future__ import annotations

import numpy as np
import pytest

from gaia_uwb._shared.errors import InputError
from gaia_uwb.evaluate.bootstrap import bootstrap_mean, paired_difference


def names(n: int) -> list[str]:
    return [f"run-{k}" for k in range(n)]


def share_covered(n_groups: int, per_group: int, *, blocked: bool) -> float:
    """Share of intervals that hold the true mean where the values of a group share an error."""
    rng = np.random.default_rng(7)
    n_trials, covered = 300, 0
    for trial in range(n_trials):
        shared = rng.normal(size=(n_groups, 1))
        values = (shared + 0.3 * rng.normal(size=(n_groups, per_group))).ravel()
        groups = np.repeat(names(n_groups), per_group).tolist() if blocked else names(len(values))
        low, high = bootstrap_mean(values, groups, seed=trial).interval or (0, 0)
        covered += low <= 0.0 <= high
    return covered / n_trials


class TestBootstrapMean:
    def test_covers_the_true_mean_about_as_often_as_it_says(self) -> None:
        assert 0.90 <= share_covered(40, 1, blocked=True) <= 0.98
        assert 0.90 <= share_covered(40, 5, blocked=True) <= 0.98

    def test_ignoring_the_groups_would_claim_too_much(self) -> None:
        assert share_covered(40, 5, blocked=False) < 0.75

    def test_covers_with_eight_groups_as_documented(self) -> None:
        assert share_covered(8, 1, blocked=True) == pytest.approx(0.88, abs=0.04)

    def test_is_as_wide_as_theory_says(self) -> None:
        values = np.random.default_rng(0).normal(5.0, 2.0, size=400)
        mean = bootstrap_mean(values, names(400), n_resamples=4000)
        half = 1.96 * values.std() / np.sqrt(400)
        assert mean.value == pytest.approx(values.mean())
        assert mean.interval == pytest.approx((mean.value - half, mean.value + half), abs=0.02)

    def test_two_groups_have_three_possible_draws(self) -> None:
        # AA, AB and BA, BB: the pooled means 1, 4, 5.
        values, groups = np.array([1.0, 5.0, 5.0, 5.0]), ["a", "b", "b", "b"]
        mean = bootstrap_mean(values, groups, level=0.2)
        assert mean.value == 4.0
        assert mean.interval == (4.0, 4.0)
        assert bootstrap_mean(values, groups).interval == (1.0, 5.0)
        assert mean.n_groups == 2

    def test_weights_stand_for_repeated_values(self) -> None:
        repeated = bootstrap_mean(np.array([1.0, 1.0, 4.0, 6.0]), ["a", "a", "b", "c"])
        weighted = bootstrap_mean(
            np.array([1.0, 4.0, 6.0]), ["a", "b", "c"], weights=np.array([2.0, 1.0, 1.0])
        )
        assert weighted.value == repeated.value == 3.0
        assert weighted.interval == pytest.approx(repeated.interval)

    def test_does_not_depend_on_the_order_of_the_values(self) -> None:
        values, groups = np.arange(6.0), ["a", "b", "a", "c", "c", "c"]
        order = [5, 2, 0, 3, 1, 4]
        other = bootstrap_mean(values[order], [groups[k] for k in order])
        assert other.interval == pytest.approx(bootstrap_mean(values, groups).interval)

    def test_is_decided_by_the_seed(self) -> None:
        values, groups = np.random.default_rng(3).normal(size=30), names(30)
        first = bootstrap_mean(values, groups, seed=1)
        assert first == bootstrap_mean(values, groups, seed=1)
        assert first == bootstrap_mean(values, groups, seed=np.random.default_rng(1))
        assert first != bootstrap_mean(values, groups, seed=2)

    @pytest.mark.parametrize("values", [[2.0], [1.0, 3.0]])
    def test_a_single_group_has_no_interval(self, values: list[float]) -> None:
        mean = bootstrap_mean(np.array(values), ["only"] * len(values))
        assert (mean.value, mean.interval, mean.n_groups) == (2.0, None, 1)

    def test_a_higher_level_gives_a_wider_interval(self) -> None:
        values, groups = np.random.default_rng(4).normal(size=30), names(30)
        low, high = bootstrap_mean(values, groups, level=0.5).interval or (0, 0)
        lower, higher = bootstrap_mean(values, groups, level=0.95).interval or (0, 0)
        assert lower < low < high < higher

    @pytest.mark.parametrize(
        ("changes", "message"),
        [
            ({"values": np.zeros(0), "groups": []}, "at least one value"),
            ({"groups": ["a"]}, "a group for each of 2 values, got 1"),
            ({"values": np.array([1.0, np.nan])}, "values: expected finite"),
            ({"weights": np.array([1.0, 0.0])}, "weights: expected finite weights above 0"),
            ({"weights": np.array([1.0, np.inf])}, "weights: expected finite weights above 0"),
            ({"weights": np.ones(3)}, r"weights: expected shape \(2,\), got \(3,\)"),
            ({"level": 1.0}, "a level between 0 and 1"),
            ({"n_resamples": 0}, "at least 1 resample"),
        ],
    )
    def test_refuses(self, changes: dict[str, object], message: str) -> None:
        good = {"values": np.array([1.0, 2.0]), "groups": ["a", "b"]}
        with pytest.raises(InputError, match=message):
            bootstrap_mean(**(good | changes))  # type: ignore[arg-type]  # wrong on purpose


class TestPairedDifference:
    def test_sees_what_separate_intervals_cannot(self) -> None:
        rng = np.random.default_rng(5)
        difficulty = rng.gamma(2.0, 5.0, size=50)
        first = difficulty + 0.2 + 0.1 * rng.normal(size=50)
        second = difficulty + 0.1 * rng.normal(size=50)
        difference = paired_difference(first, second, names(50))
        assert difference.value == pytest.approx((first - second).mean())
        assert difference.interval is not None
        assert difference.interval[0] > 0.0
        alone = (
            bootstrap_mean(first, names(50)).interval,
            bootstrap_mean(second, names(50)).interval,
        )
        assert alone[0][0] < alone[1][1]  # type: ignore[index]  # 50 groups have an interval

    def test_changes_sign_with_the_order(self) -> None:
        first, second = np.array([1.0, 2.0, 4.0]), np.array([0.0, 3.0, 1.0])
        forth = paired_difference(first, second, names(3))
        back = paired_difference(second, first, names(3))
        assert back.value == -forth.value
        assert back.interval == pytest.approx(tuple(-end for end in reversed(forth.interval or ())))

    def test_refuses_scores_of_different_episodes(self) -> None:
        with pytest.raises(InputError, match=r"second: expected shape \(3,\), got \(2,\)"):
            paired_difference(np.zeros(3), np.zeros(2), names(3))
