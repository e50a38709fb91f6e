"""Work zones, settings and the official schemas, for the tests of feeds."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import strategies as st

from gaia_uwb.config import PipelineConfig
from gaia_uwb.denoised import DenoisedRanges
from gaia_uwb.episode import Episode
from gaia_uwb.estimate import AnchorFix, AnchorStatus, Reason, ReasonKind
from gaia_uwb.reconstruction import Reconstruction, ReconstructionStatus
from gaia_uwb.scene import LocalFrame
from gaia_uwb.wzdx import FeedConfig, OfficialSchemas, make_feed_config
from gaia_uwb.zone.boundary import make_boundary

IOWA = LocalFrame(lat_deg=42.0, lon_deg=-93.5, alt_m=270.0)
OFFICIAL = Path(__file__).parents[3] / "shared" / "schemas"
CONFIG: dict[str, Any] = {
    "publisher": "Test DOT",
    "data_source": {"organization_name": "Test DOT"},
    "road_names": ["I-80"],
    "direction": "unknown",
    "start_date": "2026-11-22T09:00:00Z",
    "end_date": "2026-11-22T17:00:00Z",
}
FEED_YAML = """
publisher: Test DOT
data_source: {organization_name: Test DOT}
road_names: [I-80]
direction: westbound
start_date: 2026-11-22T09:00:00Z
end_date: 2026-11-22T19:00:00+02:00
"""
CWZ: dict[str, Any] = {
    "profile": "cwz-1.0",
    "license": "CC0-1.0",
    "update_frequency_s": 300,
    "data_source": {"organization_name": "Test DOT", "update_frequency_s": -1},
}


def feed_config(**changes: object) -> FeedConfig:
    return make_feed_config(CONFIG | changes)


@cache
def official_schemas() -> OfficialSchemas:
    """Return the official schemas, or leave the test out."""
    if not OFFICIAL.is_dir():
        pytest.skip("left out: the official schemas are not here (shared/schemas beside us)")
    return OfficialSchemas(OFFICIAL)


def zone_pass(
    path_m: Sequence[Sequence[float]] | np.ndarray,
    fixes: Sequence[AnchorFix],
    *,
    frame: LocalFrame | None = IOWA,
    reasons: tuple[Reason, ...] = (),
    name: str = "a drive",
) -> Reconstruction:
    """Return a reconstruction with these results, without any solving."""
    points_m = np.asarray(path_m, dtype=np.float64)
    shape = (len(points_m), len(fixes))
    ranges = {"range_m": np.full(shape, np.nan), "valid": np.zeros(shape, dtype=bool)}
    episode = Episode(
        name=name, anchor_ids=tuple(fix.anchor_id for fix in fixes), position_m=points_m,
        t_s=np.arange(len(points_m)) * 1.0, frame=frame, **ranges,
    )  # fmt: skip
    return Reconstruction(
        episode=episode,
        denoised=DenoisedRanges(sigma_m=np.full(shape, np.nan), **ranges),
        anchors=tuple(fixes),
        boundary=make_boundary(np.array([fix.position_m for fix in fixes])),
        status=ReconstructionStatus.UNRELIABLE if reasons else ReconstructionStatus.OK,
        reasons=reasons,
        config=PipelineConfig(),
    )


@st.composite
def passes(draw: st.DrawFn) -> Callable[[], Reconstruction]:
    """Drives along straight or winding roads, there and perhaps back, past cones of any status."""
    place = draw(st.tuples(st.floats(-59.0, 84.0), st.floats(-179.9, 179.9)))
    length_m, turn_rad = draw(st.floats(20.0, 2000.0)), draw(st.floats(-2.0, 2.0))
    heading_rad = draw(st.floats(0.0, 6.28)) + np.linspace(0.0, turn_rad, 60)
    step_m = np.stack([np.cos(heading_rad), np.sin(heading_rad)], axis=1) * length_m / 60
    road_m = np.cumsum(step_m, axis=0)
    share = np.array(draw(st.lists(st.floats(0.0, 1.0), max_size=5)))
    share = np.concatenate([share, [0.1, 0.9]])
    side_m = np.array(
        draw(st.lists(st.floats(-9.0, 9.0), min_size=len(share), max_size=len(share)))
    )
    index = np.rint(share * 59).astype(int)
    left = np.stack([-np.sin(heading_rad), np.cos(heading_rad)], axis=1)
    cones_m = road_m[index] + side_m[:, None] * left[index]
    path_m = np.concatenate([road_m, road_m[::-1]]) if draw(st.booleans()) else road_m
    status = draw(st.lists(st.sampled_from(AnchorStatus), min_size=len(share), max_size=len(share)))
    status[-2:] = [AnchorStatus.OK] * 2
    words = draw(st.lists(st.text(max_size=6), min_size=len(share), max_size=len(share)))
    ids = [f"{word}{k}" for k, word in enumerate(words)]
    sigma_m = draw(st.sampled_from([0.01, 0.2, 3.0, 1e4]))
    rows = list(zip(ids, cones_m, status, strict=True))
    texts = draw(st.lists(st.text(min_size=1, max_size=30), max_size=2))
    kinds = [draw(st.sampled_from(ReasonKind)) for _ in texts]
    name = draw(st.text(min_size=1, max_size=20))

    def make() -> Reconstruction:
        # Not while drawing: the checks of annotations pick random elements of lists.
        fixes = [_fix(*row, sigma_m) for row in rows]
        frame = LocalFrame(*place)
        reasons = tuple(map(Reason, kinds, texts))
        return zone_pass(path_m, fixes, frame=frame, reasons=reasons, name=name)

    return make


def _fix(anchor_id: str, position_m: np.ndarray, status: AnchorStatus, sigma_m: float) -> AnchorFix:
    fix = AnchorFix(
        anchor_id=anchor_id, position_m=position_m, covariance_m2=sigma_m**2 * np.eye(2),
        mirror_position_m=-position_m, mirror_probability=0.2, status=AnchorStatus.OK, n_ranges=50,
    )  # fmt: skip
    if status.has_position:
        return replace(fix, status=status)
    nowhere = np.full(2, np.nan)
    return replace(fix, position_m=nowhere, covariance_m2=np.full((2, 2), np.nan),
                   mirror_position_m=nowhere, status=status, n_ranges=2)  # fmt: skip
