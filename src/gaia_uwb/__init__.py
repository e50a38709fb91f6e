"""GAIA: from the log of a drive past a work zone to the cones and the boundary.

The names below are the public interface; each is loaded when it is first used, so that importing
the package (and the command line's help) costs nothing.

>>> import gaia_uwb
>>> result = gaia_uwb.reconstruct("sim:lane-closure")  # or the folder of a log
>>> result.boundary.status.value
'ok'
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from gaia_uwb.alignment import align
    from gaia_uwb.api import load_scenes, read, reconstruct
    from gaia_uwb.boundary import make_boundary
    from gaia_uwb.calibration import calibrate
    from gaia_uwb.config import PipelineConfig, load_config
    from gaia_uwb.datasets.check import CheckReport, check_scene
    from gaia_uwb.datasets.native import read_native, write_native
    from gaia_uwb.denoised import DenoisedRanges
    from gaia_uwb.denoisers import make_denoiser
    from gaia_uwb.episode import Episode
    from gaia_uwb.errors import ConfigError, DownloadError, GaiaError, InputError, SourceError
    from gaia_uwb.estimate import (
        AnchorFix,
        AnchorStatus,
        Boundary,
        BoundaryStatus,
        Reason,
        ReasonKind,
    )
    from gaia_uwb.pipeline import prepare
    from gaia_uwb.reconstruction import Reconstruction, ReconstructionStatus
    from gaia_uwb.report import write_all
    from gaia_uwb.scene import LocalFrame, RangeLog, Scene, Trajectory, Truth
    from gaia_uwb.sides import resolve_sides

__version__ = "0.1.0"

_HOME = {
    "AnchorFix": "estimate",
    "AnchorStatus": "estimate",
    "Boundary": "estimate",
    "BoundaryStatus": "estimate",
    "CheckReport": "datasets.check",
    "ConfigError": "errors",
    "DenoisedRanges": "denoised",
    "DownloadError": "errors",
    "Episode": "episode",
    "GaiaError": "errors",
    "InputError": "errors",
    "LocalFrame": "scene",
    "PipelineConfig": "config",
    "RangeLog": "scene",
    "Reason": "estimate",
    "ReasonKind": "estimate",
    "Reconstruction": "reconstruction",
    "ReconstructionStatus": "reconstruction",
    "Scene": "scene",
    "SourceError": "errors",
    "Trajectory": "scene",
    "Truth": "scene",
    "align": "alignment",
    "calibrate": "calibration",
    "check_scene": "datasets.check",
    "load_config": "config",
    "load_scenes": "api",
    "make_boundary": "boundary",
    "make_denoiser": "denoisers",
    "prepare": "pipeline",
    "read": "api",
    "read_native": "datasets.native",
    "reconstruct": "api",
    "resolve_sides": "sides",
    "write_all": "report",
    "write_native": "datasets.native",
}

__all__ = [
    "AnchorFix",
    "AnchorStatus",
    "Boundary",
    "BoundaryStatus",
    "CheckReport",
    "ConfigError",
    "DenoisedRanges",
    "DownloadError",
    "Episode",
    "GaiaError",
    "InputError",
    "LocalFrame",
    "PipelineConfig",
    "RangeLog",
    "Reason",
    "ReasonKind",
    "Reconstruction",
    "ReconstructionStatus",
    "Scene",
    "SourceError",
    "Trajectory",
    "Truth",
    "align",
    "calibrate",
    "check_scene",
    "load_config",
    "load_scenes",
    "make_boundary",
    "make_denoiser",
    "prepare",
    "read",
    "read_native",
    "reconstruct",
    "resolve_sides",
    "write_all",
    "write_native",
]


if not TYPE_CHECKING:  # a type checker knows the names above, and that there are no others

    def __getattr__(name: str) -> object:
        """Load a public name when it is first used (PEP 562)."""
        if name not in _HOME:
            raise AttributeError(f"module 'gaia_uwb' has no attribute {name!r}")
        from importlib import import_module

        value = getattr(import_module(f"gaia_uwb.{_HOME[name]}"), name)
        globals()[name] = value
        return value

    def __dir__() -> list[str]:
        """List the public names, loaded or not, for completion in a shell or notebook."""
        return [*__all__, "__version__"]
