from dataclasses import replace

import numpy as np
import pytest

from gaia_uwb.config import SidesConfig
from gaia_uwb.zone.scene_samples import sample_scenes
from gaia_uwb.zone.sides import decide_sides
from two_places import ALONE, PATH_M, make_hypotheses

MANY = 20_000


def decide(found, config=SidesConfig()):
    return decide_sides([f"cone-{k}" for k in range(len(found.log_odds))], found, PATH_M, config)


@pytest.mark.parametrize("config", [SidesConfig(), ALONE])
def test_draws_have_the_places_covariances_and_sides_that_are_reported(config) -> None:
    found, _ = make_hypotheses(5, seed=3, odds=3.0)
    decision = decide(found, config)
    scenes = sample_scenes(found, decision.combinations, n_samples=MANY)
    best = decision.combinations.side[0]
    side = decision.combinations.side[scenes.combination]
    for k, fix in enumerate(decision.anchors):
        flipped = side[:, k] != best[k]
        assert flipped.mean() == pytest.approx(fix.mirror_probability, abs=0.02)
    likeliest_m = scenes.place_m[scenes.combination == 0]
    for k, fix in enumerate(decision.anchors):
        assert likeliest_m[:, k].mean(axis=0) == pytest.approx(fix.position_m, abs=0.03)
        assert np.cov(likeliest_m[:, k].T) == pytest.approx(fix.covariance_m2, abs=0.01)


def test_mirror_images_come_together_or_not_at_all() -> None:
    found, _ = make_hypotheses(6, seed=1, odds=0.4, sigma_m=0.1)
    scenes = sample_scenes(found, decide(found).combinations)
    left = (scenes.place_m[..., 1] > 0).sum(axis=1)
    # Apart, all six would stand on one side in 3 % of the scenes.
    assert np.isin(left, [0, 6]).mean() > 0.2


def test_what_is_shared_moves_all_anchors_alike() -> None:
    found, _ = make_hypotheses(4, odds=60.0, sigma_m=0.1)
    clock_m = np.zeros((4, 2, 2, 3))
    clock_m[..., 0, 2] = 2.0
    covariance_m2 = found.covariance_m2 + clock_m @ np.swapaxes(clock_m, -1, -2)
    found = replace(found, covariance_m2=covariance_m2, shared_m=clock_m)
    place_m = sample_scenes(found, decide(found, ALONE).combinations, n_samples=MANY).place_m
    east_m = place_m[..., 0] - place_m[..., 0].mean(axis=0)
    own_m2 = found.covariance_m2[0, 0, 0, 0] - 4.0
    assert np.corrcoef(east_m.T)[0, 1] == pytest.approx(4.0 / (4.0 + own_m2), abs=0.01)


def test_a_shift_along_the_road_brings_no_cone_nearer_to_it() -> None:
    found, _ = make_hypotheses(4, odds=60.0, sigma_m=0.05)
    clock_m = np.zeros((4, 2, 2, 1))
    clock_m[..., 0, 0] = 4.0
    covariance_m2 = found.covariance_m2 + clock_m @ np.swapaxes(clock_m, -1, -2)
    centre_m = found.position_m[:, 0] * [1.0, 0.0]  # ranged from beside each cone
    found = replace(found, covariance_m2=covariance_m2, shared_m=clock_m, centre_m=centre_m)
    place_m = sample_scenes(found, decide(found, ALONE).combinations, n_samples=MANY).place_m
    assert place_m[..., 0].std(axis=0) == pytest.approx(np.full(4, 4.0), rel=0.05)
    beside_m = place_m[..., 1] - found.position_m[:, 0, 1]
    assert np.abs(beside_m.mean(axis=0)).max() < 0.02
    assert beside_m.std(axis=0).max() < 0.1


def test_half_of_the_errors_is_common_where_nobody_knows() -> None:
    found, _ = make_hypotheses(4, odds=60.0, sigma_m=0.1)
    place_m = sample_scenes(found, decide(found, ALONE).combinations, n_samples=MANY).place_m
    east_m = place_m[..., 0] - place_m[..., 0].mean(axis=0)
    assert np.corrcoef(east_m.T)[0, 1] == pytest.approx(0.5, abs=0.03)


def test_one_log_gives_one_result_and_unlocated_anchors_are_left_out() -> None:
    found, _ = make_hypotheses(5)
    found.position_m[2] = np.nan
    found.covariance_m2[2] = np.nan
    combinations = decide(found).combinations
    first, again = (sample_scenes(found, combinations) for _ in range(2))
    assert combinations.located.tolist() == [0, 1, 3, 4]
    assert first.place_m.shape == (512, 4, 2)
    assert np.isfinite(first.place_m).all()
    assert np.array_equal(first.place_m, again.place_m)


def test_many_anchors_get_fewer_scenes() -> None:
    found, _ = make_hypotheses(500, odds=60.0)
    assert len(sample_scenes(found, decide(found, ALONE).combinations).place_m) == 400
