"""Reconstructions made by hand, for the tests of what is written about them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from gaia_uwb.config import PipelineConfig
from gaia_uwb.denoised import DenoisedRanges
from gaia_uwb.episode import ClockOffset, Episode, RangeCalibration
from gaia_uwb.estimate import (
    AnchorFix,
    AnchorStatus,
    Boundary,
    BoundaryStatus,
    Reason,
    ReasonKind,
    SideSource,
)
from gaia_uwb.reconstruction import Reconstruction, ReconstructionStatus
from gaia_uwb.scene import LocalFrame

SITE = LocalFrame(lat_deg=48.1, lon_deg=11.5, alt_m=520.0)
SQUARE_M = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [0.0, 3.0]])
NOWHERE = np.full(2, np.nan)
HOSTILE = (
    "</script><script>document.title='owned'</script>",
    "<!--<script>",
    '"><img src=x onerror="document.title=1">&lt;',
    "line\u2028break\\u003c{{DATA}}{{SCRIPT}}",
)
"""Ids that try to be markup."""


def make_fix(anchor_id: str, position_m: np.ndarray, **changes: object) -> AnchorFix:
    usual: dict[str, Any] = {
        "covariance_m2": np.array([[0.04, 0.01], [0.01, 0.02]]),
        "mirror_position_m": position_m * [1.0, -1.0] - [0.0, 8.0],
        "mirror_probability": 0.002,
        "mirror_probability_by_ranges": 0.3,
        "side_source": SideSource.LAYOUT,
        "status": AnchorStatus.OK,
        "n_ranges": 180,
        "range_bias_m": 0.05,
    }
    return AnchorFix(anchor_id=anchor_id, position_m=position_m, **(usual | changes))


def make_unlocated(anchor_id: str) -> AnchorFix:
    return make_fix(
        anchor_id, NOWHERE, covariance_m2=np.full((2, 2), np.nan), mirror_position_m=NOWHERE,
        mirror_probability=0.0, mirror_probability_by_ranges=np.nan, side_source=None,
        status=AnchorStatus.TOO_FEW_RANGES, n_ranges=2,
    )  # fmt: skip


def make_reason(text: str, kind: ReasonKind = ReasonKind.MISFIT) -> Reason:
    """Return a reason, by default one that concerns the whole log."""
    return Reason(kind, text)


def make_reconstruction(
    position_m: np.ndarray = SQUARE_M,
    *,
    anchor_ids: tuple[str, ...] | None = None,
    changed: Mapping[int, AnchorFix] | None = None,
    n_steps: int = 200,
    frame: LocalFrame | None = SITE,
    name: str = "a drive",
) -> Reconstruction:
    """Return a drive along y = -4 m past cones at ``position_m``, which must be a convex ring.

    The first anchor's ranges start late and the last one's end early. ``changed`` replaces fixes;
    those without a position leave the boundary.
    """
    ids = anchor_ids or tuple(f"cone-{k}" for k in range(len(position_m)))
    rng = np.random.default_rng(7)
    path_m = np.stack([np.linspace(-20.0, 25.0, n_steps), np.full(n_steps, -4.0)], axis=1)
    true_m = np.hypot(*(path_m[:, None] - position_m).transpose(2, 0, 1))
    valid = np.ones_like(true_m, dtype=bool)
    valid[: n_steps // 10, 0] = False
    valid[-n_steps // 10 :, -1] = False
    noisy_m = np.where(valid, true_m + 0.1 * rng.standard_normal(true_m.shape), np.nan)
    smooth_m, sigma_m = np.where(valid, [true_m, np.full_like(true_m, 0.05)], np.nan)
    episode = Episode(
        name=name, anchor_ids=ids, t_s=np.arange(n_steps) * 0.1, position_m=path_m,
        range_m=noisy_m, valid=valid, frame=frame,
        clock=ClockOffset(offset_s=0.18, sigma_s=0.01, applied=True, reason="told from 0"),
        calibration=RangeCalibration(np.array([0.1, 0.25]), 0.01 * np.eye(2), 0.06, 4.0),
    )  # fmt: skip
    anchors = [make_fix(i, p) for i, p in zip(ids, position_m, strict=True)]
    for k, fix in (changed or {}).items():
        anchors[k] = fix
    return Reconstruction(
        episode=episode,
        denoised=DenoisedRanges(range_m=smooth_m, sigma_m=sigma_m, valid=valid),
        anchors=tuple(anchors),
        boundary=_ring(anchors),
        status=ReconstructionStatus.OK,
        reasons=(),
        config=PipelineConfig(),
    )


def _ring(anchors: list[AnchorFix]) -> Boundary:
    index = tuple(k for k, anchor in enumerate(anchors) if anchor.status.has_position)
    ring_m = np.array([anchors[k].position_m for k in index]).reshape(-1, 2)
    if len(ring_m) < 3:
        return Boundary(ring_m, ring_m, index, 0.0, BoundaryStatus.TOO_FEW_ANCHORS)
    east, north = ring_m.T
    area_m2 = 0.5 * float(np.sum(east * np.roll(north, -1) - np.roll(east, -1) * north))
    status = BoundaryStatus.OK if area_m2 else BoundaryStatus.COLLINEAR
    return Boundary(ring_m, ring_m, index, abs(area_m2), status)
