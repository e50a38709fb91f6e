"""Arguments and options that several commands share."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, no_type_check

import typer

if TYPE_CHECKING:
    from collections.abc import Iterable

    from gaia_uwb.config import PipelineConfig


class SolverName(StrEnum):
    """The solvers, as the command line names them."""

    ROBUST = "robust"
    WLS = "wls"


class Side(StrEnum):
    """Sides of the path, in the direction of travel."""

    LEFT = "left"
    RIGHT = "right"


class Closure(StrEnum):
    """Kinds of closure, as a work-zone feed names them."""

    LANE_CLOSURE = "lane-closure"
    SHOULDER_CLOSURE = "shoulder-closure"
    LANE_SHIFT = "lane-shift"
    MOBILE_OPERATION = "mobile-operation"
    MEDIAN_CROSSOVER = "median-crossover"


SourceArgument = Annotated[
    str,
    typer.Argument(
        metavar="SOURCE",
        help="A log (a folder in GAIA's own format, a ROS log, or a folder with "
        "gaia.yaml), a folder of logs, or NAME[:PART], such as outdoor-uwb:NLOS/B/4 or sim.",
    ),
]


@dataclass
class RunningCommand:
    """What is known of the command that runs; typer hands it to callbacks as the context's object.

    Parameters
    ----------
    out
        The folder for results, if the command has one.
    """

    out: Path | None = None


@no_type_check  # the class of a context is another one from version to version of typer
def _remember_out(context: typer.Context, out: Path) -> Path:
    if isinstance(context.obj, RunningCommand):
        context.obj.out = out
    return out


OutOption = Annotated[
    Path,
    typer.Option("--out", help="Output folder; created if missing.", callback=_remember_out),
]
DataDirOption = Annotated[
    Path | None,
    typer.Option(help="Folder with the data sets, one subfolder each [GAIA_DATA_DIR]."),
]
ConfigOption = Annotated[
    Path | None, typer.Option("--config", help="YAML settings file; options override it.")
]
SolverOption = Annotated[SolverName | None, typer.Option(help="How cones are located.")]

SideOption = Annotated[
    Side | None, typer.Option(help="Known: all cones are on this side of the path.")
]
ClosureOption = Annotated[
    Closure | None,
    typer.Option(help="Known: type of closure; for most, all cones are on one side."),
]
SpacingOption = Annotated[
    float | None,
    typer.Option(metavar="METRES", help="Known: distance between consecutive cones."),
]
KnownAnchorOption = Annotated[
    list[str] | None,
    typer.Option(
        metavar="ID=EAST,NORTH",
        help="Known: position of a surveyed cone, in local metres, or ID=@LAT,LON in degrees; an "
        "optional third number is its standard deviation in metres. Can be repeated.",
    ),
]


def with_prior(
    settings: PipelineConfig,
    side: Side | None,
    closure: Closure | None,
    spacing_m: float | None,
    known_anchors: list[str] | None,
) -> PipelineConfig:
    """Return settings with what the command line says about the zone.

    Parameters
    ----------
    settings
        What they are without it.
    side, closure, spacing_m, known_anchors
        The options; None leaves what the settings say.

    Raises
    ------
    ConfigError
        If an option is malformed.
    """
    from gaia_uwb.config import make_config

    said = {
        "side": side,
        "closure": closure,
        "spacing_m": spacing_m,
        "known_anchors": [_known_anchor(text) for text in known_anchors or ()] or None,
    }
    said = {name: value for name, value in said.items() if value is not None}
    if not said:
        return settings
    content = settings.model_dump(mode="json")
    content["prior"] |= {k: str(v) if isinstance(v, StrEnum) else v for k, v in said.items()}
    return make_config(content, source="options")


def _known_anchor(text: str) -> dict[str, str | float]:
    """Read ID=EAST,NORTH[,SIGMA] or ID=@LAT,LON[,SIGMA]; an id may hold an equals sign."""
    from gaia_uwb._shared import ConfigError

    name, _, place = text.rpartition("=")
    names = ("lat_deg", "lon_deg") if place.startswith("@") else ("east_m", "north_m")
    try:
        numbers = [float(number) for number in place.removeprefix("@").split(",")]
    except ValueError:
        numbers = []
    if not name or len(numbers) not in (2, 3):
        raise ConfigError(f"--known-anchor: expected ID=EAST,NORTH or ID=@LAT,LON, got {text!r}")
    return {"anchor_id": name} | dict(zip((*names, "sigma_m"), numbers, strict=False))


def version() -> str:
    """Return the package's version."""
    from gaia_uwb import __version__

    return __version__


def model_folders(denoisers: Iterable[str]) -> list[Path]:
    """Return what denoisers name after a colon: the folders of their models, or shipped ones.

    Parameters
    ----------
    denoisers
        As on the command line.
    """
    return [Path(model) for _, _, model in (name.partition(":") for name in denoisers) if model]


def require_torch() -> None:
    """Say in one line what a training lacks, before any work."""
    from importlib.util import find_spec

    from gaia_uwb._shared import ConfigError

    for package in ("torch", "safetensors"):
        if find_spec(package) is None:
            raise ConfigError(f"training needs {package}: pip install 'gaia-uwb[train]'")


def make_settings(
    config: Path | None, denoiser: str | None, solver: SolverName | None
) -> PipelineConfig:
    """Return the settings: defaults, then the file, then the command line.

    Parameters
    ----------
    config
        The file of ``--config``.
    denoiser, solver
        As on the command line.

    Raises
    ------
    ConfigError
        If the file is wrong, or no denoiser has this name: before any work.
    """
    from gaia_uwb.config import PipelineConfig, load_config
    from gaia_uwb.denoisers import make_denoiser

    settings = PipelineConfig() if config is None else load_config(config)
    if denoiser is not None:
        settings = settings.model_copy(update={"denoiser": denoiser})
    make_denoiser(settings.denoiser)
    if solver is not None:
        kind = settings.solver.model_copy(update={"kind": solver.value})
        settings = settings.model_copy(update={"solver": kind})
    return settings
