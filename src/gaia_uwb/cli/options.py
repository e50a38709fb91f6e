"""Arguments and options that several commands share."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, no_type_check

import typer

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from gaia_uwb.config import PipelineConfig
    from gaia_uwb.logs import Vehicle


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


VehicleOption = Annotated[
    Path | None,
    typer.Option(
        "--vehicle",
        metavar="FILE",
        help="Known: where the vehicle's tags are, and its clock offset and range bias, as 'gaia "
        "vehicle calibrate' writes them.",
    ),
]
ClockOffsetOption = Annotated[
    str | None,
    typer.Option(
        "--clock-offset",
        metavar="SECONDS,SIGMA",
        help="Known: by how much the radio's clock is ahead of the trajectory's, and the standard "
        "deviation of that.",
    ),
]


def with_vehicles(
    settings: PipelineConfig, vehicles: Sequence[Vehicle], clock_offset: str | None
) -> PipelineConfig:
    """Return settings with what the command line says about vehicles.

    Parameters
    ----------
    settings
        What they are without it.
    vehicles
        What the files of ``--vehicle`` hold.
    clock_offset
        The option: what is known of a vehicle of which nothing else is.

    Raises
    ------
    ConfigError
        If the option is malformed, or comes with a vehicle.
    """
    from gaia_uwb._shared import ConfigError
    from gaia_uwb.api import knowing
    from gaia_uwb.config import Known, VehiclePrior

    known = knowing(settings, *vehicles)
    if clock_offset is None:
        return known
    if vehicles:
        problem = "give one: a vehicle's file holds its clock_offset_s"
        raise ConfigError(f"--vehicle and --clock-offset: {problem}")
    offset_s, sigma_s = _clock_offset(clock_offset)
    prior = VehiclePrior(clock_offset_s=Known(value=offset_s, sigma=sigma_s))
    return settings.model_copy(update={"vehicles": {**settings.vehicles, "": prior}})


def read_vehicles(paths: Sequence[Path]) -> list[Vehicle]:
    """Return the vehicles that are described in files, and in folders of such files.

    Parameters
    ----------
    paths
        The files and folders.

    Raises
    ------
    ConfigError
        If a name is there twice, or a description is wrong.
    InputError
        If a file cannot be read.
    """
    from gaia_uwb._shared import ConfigError
    from gaia_uwb.logs import read_vehicle

    files = [
        file
        for path in paths
        for file in (sorted(path.glob("*.yaml")) if path.is_dir() else [path])
    ]
    vehicles = [read_vehicle(file) for file in files]
    for n, vehicle in enumerate(vehicles):
        for file, other in zip(files, vehicles[:n], strict=False):
            if other.name == vehicle.name:
                problem = f"{file} and {files[n]} have the same name, {vehicle.name}"
                raise ConfigError(f"--vehicle: {problem}")
    return vehicles


def _clock_offset(text: str) -> tuple[float, float]:
    """Read SECONDS,SIGMA."""
    from math import isfinite

    from gaia_uwb._shared import ConfigError

    try:
        numbers = [float(number) for number in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) == 1 and isfinite(numbers[0]):
        problem = f"add the standard deviation, such as {numbers[0]:g},0.005"
        raise ConfigError(f"--clock-offset: {problem}, got {text!r}")
    if len(numbers) != 2 or not all(map(isfinite, numbers)) or numbers[1] <= 0.0:
        problem = "expected SECONDS,SIGMA with a standard deviation above 0"
        raise ConfigError(f"--clock-offset: {problem}, got {text!r}")
    return numbers[0], numbers[1]


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
