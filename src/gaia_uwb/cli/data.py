"""The commands on data: list the data sets, fetch one, check a log."""

from __future__ import annotations

from typing import Annotated

import typer

from gaia_uwb.cli.exit_codes import BAD_INPUT, FAULT, UNRELIABLE, keep_traceback, tell
from gaia_uwb.cli.options import (
    ClockOffsetOption,
    DataDirOption,
    SourceArgument,
    VehicleOption,
    with_vehicles,
)
from gaia_uwb.cli.terminal import Progress

data_app = typer.Typer(help="List, fetch and check data.", no_args_is_help=True)


@data_app.command("list")
def data_list(data_dir: DataDirOption = None) -> None:
    """List the data sets that GAIA knows, and whether each has been downloaded."""
    from gaia_uwb.logs import REGISTRY, data_folder

    base = data_folder(data_dir)
    for name, entry in REGISTRY.items():
        state = "present" if (base / name).is_dir() else "not downloaded"
        typer.echo(f"{name}  [{state}]  {entry.description}")
        typer.echo(f"    licence {entry.licence}; {entry.citation}")
    typer.echo(f"data folder: {base}")


@data_app.command("fetch")
def data_fetch(
    name: Annotated[str, typer.Argument(help="Name of a data set; see 'gaia data list'.")],
    data_dir: DataDirOption = None,
    base_url: Annotated[
        str | None, typer.Option(help="URL or folder of a mirror of the data set's files.")
    ] = None,
) -> None:
    """Download a data set and verify each file; run it again to resume."""
    from gaia_uwb.logs import fetch

    with Progress() as progress:

        def show(done: int, total: int) -> None:
            progress.update(f"fetch {name}", done, total)

        folder = fetch(name, data_dir, base_url=base_url, progress=show)
    typer.echo(f"{name} is complete in {folder}")


@data_app.command("check")
def data_check(
    source: SourceArgument,
    data_dir: DataDirOption = None,
    vehicle: VehicleOption = None,
    clock_offset: ClockOffsetOption = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON document.")] = False,
) -> None:
    """Report what a log contains, its problems and what it can support; exit 1 on problems."""
    import json

    from gaia_uwb._shared import faults_text
    from gaia_uwb.config import PipelineConfig
    from gaia_uwb.evaluate import check_source
    from gaia_uwb.logs import read_vehicle

    driver = None if vehicle is None else read_vehicle(vehicle)
    settings = with_vehicles(PipelineConfig(), [] if driver is None else [driver], clock_offset)
    with Progress() as progress:
        reports = check_source(
            source, settings, data_dir=data_dir, vehicle=driver, progress=progress.update
        )
    if as_json:
        content = {"schema": 2, "reports": [report.as_json() for report in reports]}
        typer.echo(json.dumps(content, indent=1, allow_nan=False))
    else:
        for report in reports:
            typer.echo("\n".join(report.lines()))
    if faulty := [report for report in reports if report.traceback]:
        text = faults_text([(report.name, report.traceback) for report in faulty])
        where = keep_traceback(text, None)
        for report in faulty:
            tell(f"{report.name}: {report.problems[0]} ({where})")
        raise typer.Exit(FAULT)
    if not all(report.readable for report in reports):
        raise typer.Exit(BAD_INPUT)
    if any(report.problems for report in reports):
        raise typer.Exit(UNRELIABLE)
