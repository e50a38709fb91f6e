"""Arguments and options that several commands share."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer


class SolverName(StrEnum):
    """The solvers, as the command line names them."""

    ROBUST = "robust"
    WLS = "wls"


SourceArgument = Annotated[
    str,
    typer.Argument(
        metavar="SOURCE",
        help="A log (a folder in GAIA's own format, .bag, .mcap, or a folder with gaia.yaml), a "
        "folder of logs, or NAME[:PART], such as outdoor-uwb:NLOS/B/4 or sim.",
    ),
]
OutOption = Annotated[Path, typer.Option("--out", help="Folder for the results; made if needed.")]
DataDirOption = Annotated[
    Path | None,
    typer.Option(help="Folder that holds the data sets, one sub-folder each [GAIA_DATA_DIR]."),
]
ConfigOption = Annotated[
    Path | None, typer.Option("--config", help="YAML file with settings; options override it.")
]
SolverOption = Annotated[SolverName | None, typer.Option(help="How anchors are located.")]


def version() -> str:
    """Return the package's version."""
    from gaia_uwb import __version__

    return __version__


def require_torch() -> None:
    """Say what is missing for a training before any work, in one line."""
    from importlib.util import find_spec

    from gaia_uwb.errors import ConfigError

    for package in ("torch", "safetensors"):
        if find_spec(package) is None:
            raise ConfigError(f"training needs {package}: pip install 'gaia-uwb[train]'")
