"""The terms of GAIA's training objective ("Loss Functions"), each a mean over what counts.

Lengths of a prediction are in units of the normalisation's scale; losses are in metres.
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor
from torch.nn import functional

from gaia_uwb.learn.networks.layers import WindowPrediction
from gaia_uwb.learn.networks.unrolled_solver import multilaterate
from gaia_uwb.models import WindowTrainingOptions

_AT_LEAST_ONE = 1e-6  # so that a batch without anything to count has loss 0


class WindowBatch(NamedTuple):
    """Inputs and targets of some episodes, like :mod:`gaia_uwb.models.window_inputs`, as tensors.

    An anchor whose true place is unknown has NaN there: the geometry terms pass over it.
    """

    position: Tensor
    distance: Tensor
    mask: Tensor
    height_gap: Tensor
    range_m: Tensor
    nlos: Tensor
    anchor: Tensor


def masked_huber(prediction_m: Tensor, target_m: Tensor, weight: Tensor, delta_m: float) -> Tensor:
    """Return the weighted Huber loss of ranges, L_mask.

    Parameters
    ----------
    prediction_m, target_m, weight
        (B, T, N): ranges in metres, and what each counts.
    delta_m
        Errors beyond this count linearly.
    """
    loss = functional.huber_loss(prediction_m, target_m, reduction="none", delta=delta_m)
    return _mean(loss, weight)


def layout_loss(layout_m: Tensor, anchor_m: Tensor, anchor_mask: Tensor) -> Tensor:
    """Return the mean squared distance of a layout from the true one, L_layout, in m².

    Parameters
    ----------
    layout_m, anchor_m
        (B, N, 2): places in metres.
    anchor_mask
        (B, N): 1 for anchors that were observed at least once.
    """
    return _mean((layout_m - anchor_m).square().sum(dim=-1), anchor_mask)


def consistency_loss(prediction_m: Tensor, layout_distance_m: Tensor, mask: Tensor) -> Tensor:
    """Return how far predicted ranges are from those of the layout, L_cons, in m².

    Parameters
    ----------
    prediction_m, layout_distance_m, mask
        (B, T, N).
    """
    return _mean((prediction_m - layout_distance_m).square(), mask)


def anchor_loss(
    prediction_m: Tensor,
    batch: WindowBatch,
    known: Tensor,
    scale_m: float,
    options: WindowTrainingOptions,
) -> Tensor:
    """Return how well anchors follow from the predicted ranges, L_anchor, in m².

    Each anchor is located on both sides of the path; the hypothesis nearer to the truth counts, and
    its residual is added, so that predicted ranges fit the true side.

    Parameters
    ----------
    prediction_m
        (B, T, N): predicted ranges in metres.
    batch
        Positions, mask and truth.
    known
        (B, N): whether an anchor's true place is known; the others do not count.
    scale_m
        Of the normalisation.
    options
        ``anchor_*`` and ``gauss_newton_rounds`` are used.
    """
    steps = slice(None, None, options.anchor_stride)
    mask, nlos = batch.mask[:, steps], batch.nlos[:, steps]
    weight = mask * (1 - (1 - options.anchor_nlos_weight) * nlos)
    found_m, residual_m2 = multilaterate(
        batch.position[:, steps] * scale_m,
        prediction_m[:, steps],
        weight,
        batch.height_gap[:, steps] * scale_m,
        rounds=options.gauss_newton_rounds,
    )  # (B, N, 2, 2), (B, N, 2)
    error_m = (found_m - batch.anchor.unsqueeze(2) * scale_m).square().sum(dim=-1)
    error_m = torch.sqrt(error_m + 1e-6)
    nearer = error_m.argmin(dim=-1, keepdim=True)
    error_m = error_m.gather(-1, nearer).squeeze(-1)  # (B, N)
    residual_m2 = residual_m2.gather(-1, nearer).squeeze(-1)
    limit_m = options.anchor_huber_m
    # Huber's loss times 2: the paper's square up to the limit, linear beyond.
    square_m2 = 2 * functional.huber_loss(
        error_m, torch.zeros_like(error_m), reduction="none", delta=limit_m
    )
    return _mean(square_m2 + residual_m2, mask.amax(dim=1) * known)


def window_loss_terms(
    prediction: WindowPrediction, batch: WindowBatch, scale_m: float, options: WindowTrainingOptions
) -> dict[str, Tensor]:
    """Return every term and their weighted sum, ``total``.

    Parameters
    ----------
    prediction
        Of the network.
    batch
        Inputs and truth.
    scale_m
        Of the normalisation.
    options
        Weights and thresholds. A term with weight 0 is left out, and so are the layout's terms
        where the network has no layout.

    Returns
    -------
    dict
        ``mask``, ``layout``, ``consistency``, ``anchor`` as far as they count, and ``total``.
    """
    prediction_m = prediction.distance * scale_m
    known = torch.isfinite(batch.anchor).all(dim=-1)  # (B, N): anchors whose place is known
    batch = batch._replace(anchor=torch.nan_to_num(batch.anchor))
    weight = batch.mask * (1 - (1 - options.nlos_weight) * batch.nlos)
    terms = {"mask": masked_huber(prediction_m, batch.range_m, weight, options.huber_delta_m)}
    total = terms["mask"]
    if prediction.layout is not None and options.layout_weight:
        terms["layout"] = layout_loss(
            prediction.layout * scale_m, batch.anchor * scale_m, batch.mask.amax(dim=1) * known
        )
        total = total + options.layout_weight * terms["layout"]
    if prediction.layout_distance is not None and options.consistency_weight:
        layout_distance_m = prediction.layout_distance * scale_m
        terms["consistency"] = consistency_loss(
            prediction_m, layout_distance_m, batch.mask * known.unsqueeze(1)
        )
        total = total + options.consistency_weight * terms["consistency"]
    if options.anchor_weight:
        terms["anchor"] = anchor_loss(prediction_m, batch, known, scale_m, options)
        total = total + options.anchor_weight * terms["anchor"]
    return terms | {"total": total}


def _mean(value: Tensor, weight: Tensor) -> Tensor:
    return (value * weight).sum() / weight.sum().clamp_min(_AT_LEAST_ONE)
