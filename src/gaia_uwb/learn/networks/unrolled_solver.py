"""Anchors from ranges, differentiably: the geometry inside the anchor-level loss.

"Anchor-level geometry loss" of the paper: a least-squares start, then unrolled Gauss-Newton. On a
nearly straight path an anchor and its mirror image fit alike, so both are followed; the ordinary
linear start, which knows no side, would stand on the path, where the gradient across it vanishes.
"""

from __future__ import annotations

import torch
from torch import Tensor

_LEAST_SQUARE_M2 = 1e-6  # under a root, so that its gradient stays finite
_DAMPING = 1e-3  # of the normal matrix's trace: a degenerate direction stays where it is
_LEAST_WEIGHT = 1e-6


def multilaterate(
    position_m: Tensor, range_m: Tensor, weight: Tensor, height_gap_m: Tensor, *, rounds: int
) -> tuple[Tensor, Tensor]:
    """Locate each anchor by itself from its ranges and the path, on either side of the path.

    Parameters
    ----------
    position_m
        (B, T, 2): path of the tag's antenna.
    range_m
        (B, T, N): ranges; gradients flow through them.
    weight
        (B, T, N): weight of each range, 0 where there is none.
    height_gap_m
        (B, T, N): tag's height minus the anchor's.
    rounds
        Rounds of Gauss-Newton.

    Returns
    -------
    anchor_m : (B, N, 2, 2)
        East and north of the two hypotheses of each anchor; finite whatever the geometry.
    residual_m2 : (B, N, 2)
        Weighted mean of the squared residuals of each.
    """
    weight = weight / weight.sum(dim=1, keepdim=True).clamp_min(_LEAST_WEIGHT)  # sums to 1, or 0
    anchor_m = _start(position_m, range_m, weight, height_gap_m)
    # Hypotheses come after the anchors: (B, T, N, 1) against (B, 1, N, 2).
    range_m, weight, gap_m = (x.unsqueeze(-1) for x in (range_m, weight, height_gap_m))
    for _ in range(rounds):
        offset_m, slant_m = _slant(position_m, anchor_m, gap_m)
        residual_m = slant_m - range_m
        unit = offset_m / slant_m.unsqueeze(-1)  # (B, T, N, 2, 2)
        gradient = (weight * residual_m).unsqueeze(-1).mul(unit).sum(dim=1)  # (B, N, 2, 2)
        east, north = unit[..., 0], unit[..., 1]
        ee = (weight * east * east).sum(dim=1)
        en = (weight * east * north).sum(dim=1)
        nn = (weight * north * north).sum(dim=1)
        damping = _DAMPING * (ee + nn) + _LEAST_WEIGHT
        ee, nn = ee + damping, nn + damping
        step = torch.stack(
            [
                nn * gradient[..., 0] - en * gradient[..., 1],
                ee * gradient[..., 1] - en * gradient[..., 0],
            ],
            dim=-1,
        )
        anchor_m = anchor_m - step / (ee * nn - en * en).unsqueeze(-1)
    _, slant_m = _slant(position_m, anchor_m, gap_m)
    return anchor_m, (weight * (slant_m - range_m).square()).sum(dim=1)


def _slant(position_m: Tensor, anchor_m: Tensor, gap_m: Tensor) -> tuple[Tensor, Tensor]:
    """Return anchor minus tag (B, T, N, 2, 2) and the slant distance (B, T, N, 2)."""
    offset_m = anchor_m.unsqueeze(1) - position_m[:, :, None, None]
    square_m2 = offset_m.square().sum(dim=-1) + gap_m.square()
    return offset_m, torch.sqrt(square_m2 + _LEAST_SQUARE_M2)


def _start(position_m: Tensor, range_m: Tensor, weight: Tensor, gap_m: Tensor) -> Tensor:
    """Return both least-squares starts (B, N, 2, 2) from the squared ranges.

    Along the path, squared ranges are linear in the place; how far across it, but not on which
    side, follows from their mean.
    """
    path = position_m.unsqueeze(2)  # (B, T, 1, 2)
    w = weight.unsqueeze(-1)
    centre = (w * path).sum(dim=1)  # (B, N, 2)
    away = path - centre.unsqueeze(1)  # (B, T, N, 2)
    east, north = away[..., 0], away[..., 1]
    var_e = (weight * east * east).sum(dim=1)
    var_n = (weight * north * north).sum(dim=1)
    covariance = (weight * east * north).sum(dim=1)
    # Principal axis of the path as each anchor saw it. No gradient flows into the path.
    angle = 0.5 * torch.atan2(2 * covariance, var_e - var_n)
    along = torch.stack([torch.cos(angle), torch.sin(angle)], dim=-1)  # (B, N, 2)
    across = torch.stack([-along[..., 1], along[..., 0]], dim=-1)
    u = (away * along.unsqueeze(1)).sum(dim=-1)  # (B, T, N)
    square_m2 = range_m.square() - gap_m.square()
    q = away.square().sum(dim=-1) - square_m2
    spread = (weight * u * u).sum(dim=1)
    a_along = 0.5 * (weight * u * q).sum(dim=1) / spread.clamp_min(_LEAST_SQUARE_M2)
    a_across2 = -(weight * q).sum(dim=1) - a_along.square()
    a_across = torch.sqrt(a_across2.clamp_min(_LEAST_SQUARE_M2))
    sides = torch.stack([a_across, -a_across], dim=-1)  # (B, N, 2)
    middle = centre + a_along.unsqueeze(-1) * along
    return middle.unsqueeze(2) + sides.unsqueeze(-1) * across.unsqueeze(2)
