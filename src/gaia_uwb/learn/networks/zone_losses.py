"""What ``gaia-set`` is trained on: where all anchors stand, on which sides, and true ranges.

The anchors' places are a mixture of two scene hypotheses, each a product over the anchors of a
mixture of two places (left and right), each a bivariate Student-t. So the loss of a scene is the
negative log likelihood of the true layout as a whole: sides that cannot be told cost ln 2 once, not
once for each anchor, and an ellipse that is too small or too large costs what it must.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import torch
from torch import Tensor
from torch.nn import functional

from gaia_uwb.learn.networks.gaia_set import ZonePrediction
from gaia_uwb.learn.networks.zone_heads import side_probability

_PLACE_TAILS = 4.0  # degrees of freedom: a place may be off by more than its ellipse says
_RANGE_TAILS = 4.0
_RANGE_DELTA_M = 1.0  # range errors beyond this count linearly
_SCENE_LIMITS = (-20.0, 200.0)  # a hopeless scene must not decide on a whole batch's gradient
_RANGE_WEIGHT, _SIGMA_WEIGHT, _NLOS_WEIGHT = 2.0, 0.5, 0.1
_EARLIER_ROUND_WEIGHT = 0.4


class ZoneTargets(NamedTuple):
    """The truth of a batch."""

    anchor: Tensor
    """(B, N, 2): true places in the path's frame, in metres."""
    range: Tensor
    """(B, N, T): true slant ranges, in metres."""
    nlos: Tensor
    """(B, N, T): 1 where there was no line of sight."""


def scene_loss(prediction: ZonePrediction, anchor: Tensor, observed: Tensor) -> Tensor:
    """Return the negative log likelihood of each scene's layout per observed anchor (B,).

    Parameters
    ----------
    prediction
        Of the network.
    anchor
        (B, N, 2): true places in the path's frame, in metres.
    observed
        (B, N): 1 for anchors that count.
    """
    log_place = place_log_density(prediction, anchor)  # (B, N, 2)
    own = functional.logsigmoid(prediction.side_logit)
    other = functional.logsigmoid(-prediction.side_logit)
    # Given a hypothesis: on its side with probability own, on the other one else.
    given = torch.logaddexp(own + log_place, other + log_place.flip(-1))
    total = (given * observed.unsqueeze(-1)).sum(dim=1)  # (B, 2)
    logit = prediction.scene_logit
    log_scene = torch.logaddexp(
        functional.logsigmoid(logit) + total[:, 0], functional.logsigmoid(-logit) + total[:, 1]
    )
    return -log_scene / observed.sum(dim=1).clamp_min(1)


def place_log_density(prediction: ZonePrediction, anchor: Tensor) -> Tensor:
    """Return the log density of true places under each of the two predicted ones (B, N, 2)."""
    off = anchor.unsqueeze(2) - prediction.place
    aa, al, ll = prediction.information.unbind(-1)
    square = aa * off[..., 0] ** 2 + 2 * al * off[..., 0] * off[..., 1] + ll * off[..., 1] ** 2
    determinant = (aa * ll - al * al).clamp_min(1e-9)
    tails = 0.5 * (_PLACE_TAILS + 2) * torch.log1p(square.clamp_min(0) / _PLACE_TAILS)
    return 0.5 * determinant.log() - math.log(2 * math.pi) - tails


def zone_loss_terms(
    predictions: list[ZonePrediction], mask: Tensor, targets: ZoneTargets
) -> dict[str, Tensor]:
    """Return every term of the last round, and the weighted sum over all rounds, ``total``.

    Parameters
    ----------
    predictions
        Of each round.
    mask
        (B, N, T): 1 where there was a range.
    targets
        The truth.

    Returns
    -------
    dict
        ``scene``, ``range``, ``sigma``, ``nlos``, ``total``, and ``distance_mse_overall`` in m².
    """
    observed = mask.amax(dim=-1)
    total = mask.new_zeros(())
    terms: dict[str, Tensor] = {}
    for k, prediction in enumerate(predictions):
        error = prediction.range - targets.range
        terms = {
            "scene": scene_loss(prediction, targets.anchor, observed).clamp(*_SCENE_LIMITS).mean(),
            "range": _mean(_huber(error), mask),
            "sigma": _mean(_range_loss(prediction, targets.range), mask),
            "nlos": _mean(
                functional.binary_cross_entropy_with_logits(
                    prediction.nlos_logit, targets.nlos, reduction="none"
                ),
                mask,
            ),
        }
        weight = 1.0 if k == len(predictions) - 1 else _EARLIER_ROUND_WEIGHT
        total = total + weight * (
            terms["scene"]
            + _RANGE_WEIGHT * terms["range"]
            + _SIGMA_WEIGHT * terms["sigma"]
            + _NLOS_WEIGHT * terms["nlos"]
        )
        terms["distance_mse_overall"] = _mean(error.square(), mask).detach()
    return terms | {"total": total}


def wrong_side_share(prediction: ZonePrediction, anchor: Tensor, observed: Tensor) -> Tensor:
    """Return the share of observed anchors whose likelier place is the farther one.

    Parameters
    ----------
    prediction, anchor, observed
        Like :func:`scene_loss`.
    """
    error = (prediction.place - anchor.unsqueeze(2)).norm(dim=-1)  # (B, N, 2)
    left = side_probability(prediction.scene_logit, prediction.side_logit) > 0.5
    wrong = torch.where(left, error[..., 0] > error[..., 1], error[..., 1] > error[..., 0])
    return _mean(wrong.to(error.dtype), observed)


def _range_loss(prediction: ZonePrediction, target: Tensor) -> Tensor:
    """Return the negative log likelihood of corrected ranges under Student-t errors."""
    square = (prediction.corrected - target).square() * torch.exp(-2 * prediction.log_sigma)
    tails = 0.5 * (_RANGE_TAILS + 1) * torch.log1p(square / _RANGE_TAILS)
    return tails + prediction.log_sigma


def _huber(error: Tensor) -> Tensor:
    zero = torch.zeros_like(error)
    return functional.huber_loss(error, zero, reduction="none", delta=_RANGE_DELTA_M)


def _mean(values: Tensor, weight: Tensor) -> Tensor:
    return (values * weight).sum() / weight.sum().clamp_min(1.0)
