from __future__ import annotations

import math

import numpy as np
import pytest

pytest.importorskip("torch", reason="needs PyTorch: install gaia-uwb[train]")

import torch
from torch import Tensor

from gaia_uwb.learn.networks.gaia_set import ZonePrediction
from gaia_uwb.learn.networks.zone_losses import (
    ZoneTargets,
    place_log_density,
    scene_loss,
    wrong_side_share,
    zone_loss_terms,
)


def prediction(
    scene_logit: float = 0.0, side_logit: float = 4.0, information: float = 4.0
) -> ZonePrediction:
    """Return one scene of two anchors, 5 m left or right of the path."""
    place = torch.tensor([[[[0.0, 5.0], [0.0, -5.0]], [[10.0, 5.0], [10.0, -5.0]]]])
    shape = (1, 2, 6)
    return ZonePrediction(
        range=torch.full(shape, 7.0),
        corrected=torch.full(shape, 7.0),
        log_sigma=torch.full(shape, math.log(0.1)),
        nlos_logit=torch.zeros(shape),
        place=place,
        information=torch.tensor([information, 0.0, information]).expand(1, 2, 2, 3),
        scene_logit=torch.tensor([scene_logit]),
        side_logit=torch.full((1, 2, 2), side_logit),
    )


LEFT = torch.tensor([[[0.0, 5.0], [10.0, 5.0]]])
MIXED = torch.tensor([[[0.0, 5.0], [10.0, -5.0]]])
BOTH = torch.ones(1, 2)


def value(found: ZonePrediction, anchor: Tensor, observed: Tensor = BOTH) -> float:
    return float(scene_loss(found, anchor, observed))


def test_a_place_has_the_density_of_a_student_t() -> None:
    scipy_stats = pytest.importorskip("scipy.stats")
    precision = np.array([[3.0, 0.8], [0.8, 1.5]])
    found = prediction()._replace(information=torch.tensor([3.0, 0.8, 1.5]).expand(1, 2, 2, 3))
    anchor = torch.tensor([[[0.4, 5.7], [10.0, 5.0]]])
    expected = scipy_stats.multivariate_t(
        loc=[0.0, 5.0], shape=np.linalg.inv(precision), df=4
    ).logpdf([0.4, 5.7])
    assert float(place_log_density(found, anchor)[0, 0, 0]) == pytest.approx(expected, abs=1e-5)


def test_a_side_that_cannot_be_told_costs_ln_2_once_for_all_anchors() -> None:
    sure, open_ = prediction(scene_logit=30.0, side_logit=30.0), prediction(side_logit=30.0)
    assert value(open_, LEFT) - value(sure, LEFT) == pytest.approx(math.log(2) / 2, abs=1e-5)
    # A wrong side that was called sure costs far more.
    wrong = prediction(scene_logit=-30.0, side_logit=30.0)
    assert value(wrong, LEFT) > value(open_, LEFT) + 5


def test_anchors_on_both_sides_cost_what_their_own_probability_says() -> None:
    found = prediction(side_logit=1.0)
    stays = float(torch.sigmoid(torch.tensor(1.0)))
    gap = value(found, MIXED) - value(found, LEFT)
    # Given either hypothesis one anchor stays and one does not, or (LEFT) both do or neither.
    both = stays**2 + (1 - stays) ** 2
    assert gap == pytest.approx(-(math.log(2 * stays * (1 - stays)) - math.log(both)) / 2, abs=1e-4)


@pytest.mark.parametrize("information", [1.0, 100.0])
def test_the_ellipse_that_fits_costs_least(information: float) -> None:
    torch.manual_seed(0)
    scatter = torch.randn(4000, 1, 2) / math.sqrt(information)
    anchor = LEFT[:, :1] + scatter
    losses = {}
    for factor in (0.25, 1.0, 4.0):
        one = prediction(scene_logit=30.0, side_logit=30.0, information=factor * information)
        many = ZonePrediction(*(part[:, :1] if part.dim() > 1 else part for part in one))
        many = ZonePrediction(*(part.expand(4000, *part.shape[1:]) for part in many))
        losses[factor] = float(scene_loss(many, anchor, torch.ones(4000, 1)).mean())
    # With four degrees of freedom the best ellipse is a little smaller than the scatter's.
    assert losses[1.0] < losses[4.0] and losses[1.0] < losses[0.25]


def test_anchors_that_were_not_observed_do_not_count() -> None:
    far = LEFT.clone()
    far[0, 1] = 300.0
    only_first = torch.tensor([[1.0, 0.0]])
    assert value(prediction(), far, only_first) == value(prediction(), LEFT, only_first)
    nobody = value(prediction(), far, torch.zeros(1, 2))
    assert nobody == pytest.approx(0.0, abs=1e-6)


def test_terms_add_up_and_missing_ranges_do_not_count() -> None:
    mask = torch.ones(1, 2, 6)
    mask[:, :, 4:] = 0
    truth = torch.full((1, 2, 6), 7.2)
    truth[:, :, 4:] = 99.0
    targets = ZoneTargets(LEFT, truth, torch.zeros(1, 2, 6))
    terms = {name: float(v) for name, v in zone_loss_terms([prediction()], mask, targets).items()}
    assert terms["distance_mse_overall"] == pytest.approx(0.04, rel=1e-4)
    assert terms["range"] == pytest.approx(0.02, rel=1e-4)
    assert terms["nlos"] == pytest.approx(math.log(2), rel=1e-4)
    expected = terms["scene"] + 2 * terms["range"] + 0.5 * terms["sigma"] + 0.1 * terms["nlos"]
    assert terms["total"] == pytest.approx(expected, rel=1e-5)
    twice = zone_loss_terms([prediction(), prediction()], mask, targets)
    assert float(twice["total"]) == pytest.approx(1.4 * expected, rel=1e-5)


def test_the_wrong_side_is_the_farther_place() -> None:
    assert float(wrong_side_share(prediction(scene_logit=3.0), LEFT, BOTH)) == 0.0
    assert float(wrong_side_share(prediction(scene_logit=-3.0), LEFT, BOTH)) == 1.0
    assert float(wrong_side_share(prediction(scene_logit=3.0), MIXED, BOTH)) == 0.5
