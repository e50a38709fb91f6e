"""``gaia fleet``: many logs, zone by zone."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path
from typing import Annotated

import typer

from gaia_uwb._shared import FAULTS_LOG, written_out
from gaia_uwb.cli.exit_codes import FAULT, UNRELIABLE, tell
from gaia_uwb.cli.options import (
    ClockOffsetOption,
    ConfigOption,
    OutOption,
    model_folders,
    read_vehicles,
    with_vehicles,
)
from gaia_uwb.cli.terminal import Progress


def fleet(
    source: Annotated[
        Path,
        typer.Argument(
            help="A folder with one folder of logs per zone; a YAML file with a list of logs per "
            "zone; or a CSV file with the columns log and zone, and perhaps vehicle."
        ),
    ],
    out: OutOption = Path("out"),
    workers: Annotated[int, typer.Option(min=1, max=256, help="Number of worker processes.")] = 1,
    scheduler: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS",
            help="Run on this Dask scheduler, for example tcp://host:8786; its workers must see "
            "the same files.",
        ),
    ] = None,
    config: ConfigOption = None,
    vehicle: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="FILE",
            help="Known: a vehicle, by its name, as 'gaia vehicle calibrate' writes it, or a "
            "folder of such files. One that is not known is learned. Can be repeated.",
        ),
    ] = None,
    clock_offset: ClockOffsetOption = None,
) -> None:
    """Fuse the passes of many zones; run it again to resume after an interruption."""
    from gaia_uwb._shared import ConfigError
    from gaia_uwb.config import PipelineConfig, load_config
    from gaia_uwb.fleet import (
        FAILURE_FILES,
        ZONES,
        find_zones,
        learn_vehicles,
        reconstruct_fleet,
        write_tables,
    )
    from gaia_uwb.logs import results_folder

    if scheduler is not None and workers > 1:
        raise ConfigError("--workers cannot be combined with --scheduler")
    settings = PipelineConfig() if config is None else load_config(config)
    vehicles = read_vehicles(vehicle or [])
    settings = with_vehicles(settings, vehicles, clock_offset)
    zones = find_zones(source, out, vehicles)
    logs = (log for zone in zones for log in zone.logs)
    results_folder(out, [source, *logs, *model_folders([settings.denoiser])]).claim(
        [ZONES, *FAILURE_FILES]
    )
    results = []
    with Progress() as progress:
        progress.update("zones", 0, len(zones))
        found = reconstruct_fleet(zones, out, settings, workers=workers, scheduler=scheduler)
        with closing(found):  # so that an interrupt ends its processes at once
            for result in found:
                results.append(result)
                progress.update("zones", len(results), len(zones))
                if not progress.on_terminal:
                    line = f"{len(results)} of {len(zones)}: {result.zone} {result.status}"
                    typer.echo(written_out(line))
    write_tables(results, out)
    learned = learn_vehicles([result.vehicles for result in results], out, settings)
    failures = sum(len(result.failures) for result in results)
    faults = [f for result in results for f in result.failures if f.traceback]
    unsure = sum(result.status != "ok" for result in results)
    typer.echo(
        f"{len(zones)} zones: {len(zones) - unsure} ok, {unsure} not ok; {failures} failures, "
        f"listed in {out / 'failures.csv'}"
    )
    for each in learned:
        where = "its drives do not tell its clock or its ranges"
        if each.path is not None:
            where = f"learned, in {each.path}"
        past = f"{each.n_zones} zone{'' if each.n_zones == 1 else 's'}"
        typer.echo(written_out(f"vehicle {each.name}, past {past}: {where}"))
    for fault in faults:
        tell(f"{fault.zone} {fault.log}: {fault.problem} (traceback in {out / FAULTS_LOG})")
    if faults:
        raise typer.Exit(FAULT)
    if failures or unsure:
        raise typer.Exit(UNRELIABLE)
