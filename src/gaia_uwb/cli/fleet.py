"""``gaia fleet``: many logs, zone by zone."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gaia_uwb._shared import written_out
from gaia_uwb.cli.exit_codes import UNRELIABLE
from gaia_uwb.cli.options import ConfigOption, OutOption
from gaia_uwb.cli.terminal import progress_bar


def fleet(
    source: Annotated[
        Path,
        typer.Argument(
            help="A folder with a folder of logs for each zone; a YAML file with a list of logs "
            "for each zone; or a CSV file with the columns log and zone."
        ),
    ],
    out: OutOption = Path("out"),
    workers: Annotated[int, typer.Option(min=1, max=256, help="Processes.")] = 1,
    scheduler: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS",
            help="Let the workers of this Dask scheduler do it, which see the same files; for "
            "example tcp://host:8786.",
        ),
    ] = None,
    config: ConfigOption = None,
) -> None:
    """Fuse the passes of many zones; call it again to go on after an interruption."""
    from gaia_uwb._shared import ConfigError, OutputFolder
    from gaia_uwb.config import PipelineConfig, load_config
    from gaia_uwb.fleet import find_zones, reconstruct_fleet, write_tables

    if scheduler is not None and workers > 1:
        raise ConfigError("--workers: a scheduler has workers of its own")
    settings = PipelineConfig() if config is None else load_config(config)
    zones = find_zones(source, out)
    OutputFolder(out)
    results = []
    with progress_bar() as progress:
        task = progress.add_task("zones", total=len(zones))
        for result in reconstruct_fleet(zones, out, settings, workers=workers, scheduler=scheduler):
            results.append(result)
            progress.advance(task)
            if progress.disable:
                line = f"{len(results)} of {len(zones)}: {result.zone} {result.status}"
                typer.echo(written_out(line))
    write_tables(results, out)
    failures = sum(len(result.failures) for result in results)
    unsure = sum(result.status != "ok" for result in results)
    typer.echo(
        f"{len(zones)} zones: {len(zones) - unsure} ok, {unsure} not; {failures} failures are "
        f"listed in {out / 'failures.csv'}"
    )
    if failures or unsure:
        raise typer.Exit(UNRELIABLE)
