"""GAIA: from the log of a drive past a work zone to the cones and the boundary.

The names below are the public interface; each is loaded when it is first used, so that importing
the package (and the command line's help) costs nothing.

>>> import gaia_uwb
>>> from gaia_uwb.simulate import PRESETS, simulate_pass
>>> result = gaia_uwb.reconstruct(simulate_pass(PRESETS["lane-closure"], seed=0))
>>> result.boundary.status.value
'ok'
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from gaia_uwb.alignment import align
    from gaia_uwb.calibration import calibrate
    from gaia_uwb.config import PipelineConfig, load_config
    from gaia_uwb.datasets.native import read_native, write_native
    from gaia_uwb.denoisers import make_denoiser
    from gaia_uwb.episode import DenoisedRanges, Episode
    from gaia_uwb.errors import ConfigError, DownloadError, GaiaError, InputError, SourceError
    from gaia_uwb.estimate import AnchorFix, AnchorStatus, Boundary, BoundaryStatus
    from gaia_uwb.pipeline import Reconstruction, ReconstructionStatus, reconstruct
    from gaia_uwb.report import write_all
    from gaia_uwb.scene import LocalFrame, RangeLog, Scene, Trajectory, Truth
    from gaia_uwb.sources import load_scenes

__version__ = "0.1.0"

_HOME = {
    "AnchorFix": "estimate",
    "AnchorStatus": "estimate",
    "Boundary": "estimate",
    "BoundaryStatus": "estimate",
    "ConfigError": "errors",
    "DenoisedRanges": "episode",
    "DownloadError": "errors",
    "Episode": "episode",
    "GaiaError": "errors",
    "InputError": "errors",
    "LocalFrame": "scene",
    "PipelineConfig": "config",
    "RangeLog": "scene",
    "Reconstruction": "pipeline",
    "ReconstructionStatus": "pipeline",
    "Scene": "scene",
    "SourceError": "errors",
    "Trajectory": "scene",
    "Truth": "scene",
    "align": "alignment",
    "calibrate": "calibration",
    "load_config": "config",
    "load_scenes": "sources",
    "make_denoiser": "denoisers",
    "read_native": "datasets.native",
    "reconstruct": "pipeline",
    "write_all": "report",
    "write_native": "datasets.native",
}

__all__ = [
    "AnchorFix",
    "AnchorStatus",
    "Boundary",
    "BoundaryStatus",
    "ConfigError",
    "DenoisedRanges",
    "DownloadError",
    "Episode",
    "GaiaError",
    "InputError",
    "LocalFrame",
    "PipelineConfig",
    "RangeLog",
    "Reconstruction",
    "ReconstructionStatus",
    "Scene",
    "SourceError",
    "Trajectory",
    "Truth",
    "align",
    "calibrate",
    "load_config",
    "load_scenes",
    "make_denoiser",
    "read_native",
    "reconstruct",
    "write_all",
    "write_native",
]


def __getattr__(name: str) -> object:
    """Load a public name when it is first used (PEP 562)."""
    if name not in _HOME:
        raise AttributeError(f"module 'gaia_uwb' has no attribute {name!r}")
    from importlib import import_module

    value = getattr(import_module(f"gaia_uwb.{_HOME[name]}"), name)
    globals()[name] = value
    return value
