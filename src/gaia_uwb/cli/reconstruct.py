"""``gaia reconstruct``: from logs to cones and boundary."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gaia_uwb._shared import ConfigError, printable
from gaia_uwb.cli.boundary_options import (
    ClosedLanesOption,
    ClosedWidthOption,
    FormOption,
    LaneWidthOption,
    RoadEdgeOption,
    with_boundary,
)
from gaia_uwb.cli.exit_codes import BAD_INPUT, FAULT, UNRELIABLE, stop, tell
from gaia_uwb.cli.options import (
    ClockOffsetOption,
    ClosureOption,
    ConfigOption,
    DataDirOption,
    KnownAnchorOption,
    OutOption,
    SideOption,
    SolverOption,
    SpacingOption,
    VehicleOption,
    make_settings,
    model_folders,
    with_prior,
    with_vehicles,
)
from gaia_uwb.cli.terminal import Progress, print_summary

if TYPE_CHECKING:
    from collections.abc import Sequence

    from gaia_uwb._shared import OutputFolder
    from gaia_uwb.config import PipelineConfig
    from gaia_uwb.reconstruction import Reconstruction
    from gaia_uwb.scene import Scene


def reconstruct(
    sources: Annotated[
        list[str],
        typer.Argument(
            metavar="SOURCE...",
            help="Logs, folders of logs, or NAME[:PART], such as outdoor-uwb:NLOS/B/4 or sim. "
            "Several sources are passes of one zone.",
        ),
    ],
    out: OutOption = Path("out"),
    one_zone: Annotated[
        bool | None,
        typer.Option(
            "--one-zone/--each-alone",
            help="Fuse all logs as passes of one zone, or reconstruct each on its own. Default: "
            "several sources are fused; logs in one folder are not.",
        ),
    ] = None,
    denoiser: Annotated[
        str | None,
        typer.Option(
            help="gaia-set (default), raw, median, kalman, pose-kalman; or one of the paper's "
            "networks (mlp, pose-mlp, gaia). For a network, append a model name or folder after a "
            "colon: gaia:stress."
        ),
    ] = None,
    solver: SolverOption = None,
    config: ConfigOption = None,
    data_dir: DataDirOption = None,
    side: SideOption = None,
    closure: ClosureOption = None,
    spacing: SpacingOption = None,
    known_anchor: KnownAnchorOption = None,
    form: FormOption = None,
    closed_width: ClosedWidthOption = None,
    closed_lanes: ClosedLanesOption = None,
    lane_width: LaneWidthOption = None,
    road_edge: RoadEdgeOption = None,
    vehicle: VehicleOption = None,
    clock_offset: ClockOffsetOption = None,
    svg: Annotated[bool, typer.Option("--svg", help="Also write plot.svg.")] = False,
    zone: Annotated[
        Path | None,
        typer.Option(
            help="Folder of a zone that is kept: the logs are added to the drives in it, and the "
            "result is that of all. It is made if it is not there; then the settings stay.",
        ),
    ] = None,
    gis: Annotated[
        bool, typer.Option("--gis", help="Also write boundary.gpkg and boundary.kml.")
    ] = False,
) -> None:
    """Locate the cones and draw the boundary, from the log of one drive or of several."""
    from gaia_uwb.api import load_readable
    from gaia_uwb.evaluate import reconstruct_and_score
    from gaia_uwb.fleet import FAILURE_FILES
    from gaia_uwb.logs import read_vehicle, results_folder
    from gaia_uwb.outputs import RESULT_FILES, write_all
    from gaia_uwb.reconstruction import ReconstructionStatus

    settings = make_settings(config, denoiser, solver)
    settings = with_prior(settings, side, closure, spacing, known_anchor)
    settings = with_boundary(settings, form, closed_width, closed_lanes, lane_width, road_edge)
    driver = None if vehicle is None else read_vehicle(vehicle)
    settings = with_vehicles(settings, [] if driver is None else [driver], clock_offset)
    read: list[str | Path] = [*sources, *model_folders([settings.denoiser])]
    results = results_folder(out, read, data_dir=data_dir)
    scenes: list[Scene] = []
    failures: list[tuple[str | Path, Exception]] = []
    with Progress() as progress:
        for source in sources:
            readable, unreadable = load_readable(
                source,
                data_dir=data_dir,
                vehicle=driver,
                each=lambda logs: progress.track(logs, "read"),
            )
            scenes += readable
            failures += unreadable
    n_logs = len(scenes) + len(failures)
    if n_logs > 1:
        results.claim(FAILURE_FILES)
    reliable = True
    if zone is not None and scenes:
        results.claim(RESULT_FILES)
        result = _added(scenes, zone, settings)
        print_summary(result, None, write_all(result, out, None, svg=svg, gis=gis))
        reliable, scenes = result.status is ReconstructionStatus.OK, []
    with Progress() as progress:
        if one_zone if one_zone is not None else len(sources) > 1:
            runs = [(scenes, out)] if scenes else []
        else:
            folders = _folders(out, [scene.name for scene in scenes], several=n_logs > 1)
            runs = [([scene], folder) for scene, folder in zip(scenes, folders, strict=True)]
        for _, folder in runs:
            results_folder(folder, read, data_dir=data_dir).claim(RESULT_FILES)
        for passes, folder in progress.track(runs, "reconstruct"):
            try:
                result, metrics = reconstruct_and_score(passes, settings)
                paths = write_all(result, folder, metrics, svg=svg, gis=gis)
            except Exception as error:  # what is wrong with one log must not cost the others
                if len(passes) > 1:
                    raise
                failures.append((passes[0].name, error))
                continue
            reliable &= result.status is ReconstructionStatus.OK
            print_summary(result, metrics, paths)
    _tell_failures(failures, n_logs, results)
    if not reliable:
        raise typer.Exit(UNRELIABLE)


def _added(scenes: Sequence[Scene], folder: Path, settings: PipelineConfig) -> Reconstruction:
    """Add drives to a kept zone, and return the result of all of its drives."""
    from gaia_uwb.kept import Zone

    if folder.is_dir() and any(folder.iterdir()):
        kept = Zone.open(folder)
        if kept.config != settings:
            problem = "was made with other settings, which stay: name another folder"
            raise ConfigError(f"{folder}: {problem}")
    else:
        frame = scenes[0].frame if scenes else None
        kept = Zone.create(folder, frame=frame, config=settings)
    kept.add(scenes)
    return kept.result()


def _tell_failures(
    failures: Sequence[tuple[str | Path, Exception]], n_logs: int, folder: OutputFolder
) -> None:
    """List the logs that were skipped; the error of a single log is the command's own."""
    from gaia_uwb._shared import FAULTS_LOG
    from gaia_uwb.fleet import Failure, write_failures

    if n_logs == 1:
        folder.remove(FAULTS_LOG)  # of an earlier run
        for _, error in failures:
            raise error
        return
    rows = [Failure.of(Path(log).name, str(log), error) for log, error in failures]
    faults = [row for row in rows if row.traceback]
    for row in rows:
        if row in faults:
            where = folder.path / FAULTS_LOG
            tell(f"skipped: {row.log}: {row.problem} (traceback in {where})")
        else:
            tell(f"skipped: {row.problem}")
    write_failures(rows, folder)
    if rows:
        code = FAULT if faults else BAD_INPUT
        stop(f"{len(rows)} of {n_logs} logs were skipped", code)


def _folders(out: Path, names: Sequence[str], *, several: bool = False) -> list[Path]:
    """Return a folder for each scene's results, all different; a single scene gets ``out``."""
    if len(names) == 1 and not several:
        return [out]
    safe = [printable(name).replace("/", "-").lstrip(".")[:100] for name in names]
    if "" in safe or len(set(safe)) < len(safe):
        safe = [f"{k}-{name}" for k, name in enumerate(safe)]
    return [out / name for name in safe]
