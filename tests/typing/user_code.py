"""A user's program, for mypy only: what the public names are to somebody who imports them.

``make types`` checks it in strict mode. It is not run; ``docs/howto/python.md`` is.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, assert_type

import numpy as np

import gaia_uwb
from gaia_uwb import (
    AnchorFix,
    AnchorStatus,
    Boundary,
    DenoisedRanges,
    Episode,
    GaiaError,
    PipelineConfig,
    Reconstruction,
    ReconstructionStatus,
    Scene,
    read,
    reconstruct,
)

Floats = np.ndarray[Any, np.dtype[Any]]


def whole_job(folder: Path) -> Sequence[str]:
    """Read, reconstruct, look, write."""
    scene = read(folder)
    assert_type(scene, Scene)
    result = reconstruct(scene, PipelineConfig(denoiser="kalman"))
    assert_type(result, Reconstruction)
    assert_type(result.status, ReconstructionStatus)
    assert_type(result.anchors, tuple[AnchorFix, ...])
    assert_type(result.boundary, Boundary)
    east_m: float = result.anchors[0].position_m[0]
    hull_m: Floats = result.boundary.hull_m
    gaia_uwb.write_all(result, folder / "result")
    gaia_uwb.write_all(result, "result", svg=True)
    names = [a.anchor_id for a in result.anchors if a.status is AnchorStatus.AMBIGUOUS]
    return [*names, f"{east_m:.2f}", str(hull_m.shape)]


def named_logs() -> list[Reconstruction]:
    """Logs by name: of a data set, of the simulator, of a place."""
    scenes = gaia_uwb.load_scenes("outdoor-uwb", data_dir=Path("data"))
    assert_type(scenes, list[Scene])
    return [reconstruct("sim:lane-closure"), reconstruct("my-log"), *map(reconstruct, scenes)]


def step_by_step(scene: Scene) -> DenoisedRanges:
    """Take the pieces one by one."""
    episode = gaia_uwb.calibrate(gaia_uwb.align(scene))
    assert_type(episode, Episode)
    (denoised,) = gaia_uwb.make_denoiser("median", {"window_steps": 7})([episode])
    assert_type(denoised, DenoisedRanges)
    return denoised


def errors() -> str:
    """Catch all that GAIA raises on purpose."""
    try:
        return read("nowhere").name
    except GaiaError as error:
        return str(error)


def mistakes() -> None:
    """Make mistakes that a type checker must find: an ignore that is not needed is an error."""
    gaia_uwb.no_such_name  # type: ignore[attr-defined]  # noqa: B018
    read(17)  # type: ignore[arg-type]
    reconstruct("my-log").anchors[0].position  # type: ignore[attr-defined]  # noqa: B018
