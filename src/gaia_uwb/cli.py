"""The command line: reads arguments and sets exit codes; ``terminal.py`` has what people see.

Exit codes: 0 done; 1 done, but a result is marked unreliable; 2 bad input or usage, with one line
on stderr. Heavy modules are imported inside the commands, so that ``gaia --help`` is quick.
"""

from __future__ import annotations

import sys
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer

from gaia_uwb.cli_data import data_app
from gaia_uwb.cli_learning import train
from gaia_uwb.cli_options import (
    ClosureOption,
    ConfigOption,
    DataDirOption,
    KnownAnchorOption,
    OutOption,
    SideOption,
    SolverName,
    SolverOption,
    SourceArgument,
    SpacingOption,
    version,
    with_prior,
)
from gaia_uwb.cli_reproduce import reproduce_app
from gaia_uwb.cli_wzdx import wzdx_app
from gaia_uwb.terminal import plain, print_results, print_summary, progress_bar, track

if TYPE_CHECKING:
    from collections.abc import Sequence

    from gaia_uwb.config import PipelineConfig
    from gaia_uwb.errors import GaiaError
    from gaia_uwb.simulate.settings import PassConfig

UNRELIABLE, BAD_INPUT, INTERRUPTED = 1, 2, 130
SCORED = "raw,median,kalman,pose-kalman"

app = typer.Typer(
    name="gaia",
    help="From the log of a drive past a work zone to the cones and the boundary.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
app.add_typer(data_app, name="data")
app.add_typer(reproduce_app, name="reproduce")
app.add_typer(wzdx_app, name="wzdx")
app.command("train")(train)


class SimulatedAs(StrEnum):
    """What a simulated pass is written as."""

    LOGS = "logs"
    EPISODES = "episodes"


class LayoutPart(StrEnum):
    """The parts of a preset's layouts; none is in both of the last two."""

    ALL = "all"
    TRAINING = "training"
    TEST = "test"


class TableFormat(StrEnum):
    """File formats of our native tables."""

    CSV = "csv"
    PARQUET = "parquet"


@app.callback(invoke_without_command=True)
def _root(
    show_version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False,
) -> None:
    if show_version:
        typer.echo(f"gaia {version()}")
        raise typer.Exit


@app.command()
def reconstruct(
    source: SourceArgument,
    out: OutOption = Path("out"),
    denoiser: Annotated[
        str | None,
        typer.Option(
            help="raw, median, kalman, pose-kalman; or a network (mlp, pose-mlp, gaia), with what "
            "it was trained on or its folder after a colon: gaia:stress."
        ),
    ] = None,
    solver: SolverOption = None,
    config: ConfigOption = None,
    data_dir: DataDirOption = None,
    side: SideOption = None,
    closure: ClosureOption = None,
    spacing: SpacingOption = None,
    known_anchor: KnownAnchorOption = None,
    svg: Annotated[bool, typer.Option("--svg", help="Write plot.svg beside plot.png.")] = False,
    gis: Annotated[
        bool, typer.Option("--gis", help="Write boundary.gpkg and boundary.kml, too.")
    ] = False,
) -> None:
    """Locate the cones and draw the boundary from the log of a drive."""
    from gaia_uwb.errors import InputError
    from gaia_uwb.evaluate import reconstruct_and_score
    from gaia_uwb.files import OutputFolder
    from gaia_uwb.pipeline import ReconstructionStatus
    from gaia_uwb.report import write_all
    from gaia_uwb.sources import load_readable

    settings = _settings(config, denoiser, solver)
    settings = with_prior(settings, side, closure, spacing, known_anchor)
    OutputFolder(out)
    scenes, failures = load_readable(source, data_dir=data_dir)
    n_logs = len(scenes) + len(failures)
    reliable = True
    with progress_bar() as progress:
        folders = _folders(out, [scene.name for scene in scenes], several=n_logs > 1)
        runs = list(zip(scenes, folders, strict=True))
        for scene, folder in track(progress, runs, "reconstruct"):
            try:
                result, metrics = reconstruct_and_score(scene, settings)
            except InputError as error:
                failures.append(error)
                continue
            paths = write_all(result, folder, metrics, svg=svg, gis=gis)
            reliable &= result.status is ReconstructionStatus.OK
            print_summary(progress, result, metrics, paths)
    _stop_at(failures, n_logs)
    if not reliable:
        raise typer.Exit(UNRELIABLE)


@app.command()
def simulate(
    out: Annotated[Path, typer.Option("--out", help="Folder for the passes; made if needed.")],
    preset: Annotated[
        str, typer.Option(help="Kind of pass: a name, or a YAML file with settings.")
    ] = "lane-closure",
    episodes: Annotated[int, typer.Option(min=1, help="Number of passes.")] = 1,
    seed: Annotated[int, typer.Option(min=0, help="One seed gives the same passes again.")] = 0,
    split: Annotated[
        LayoutPart, typer.Option(help="Layouts kept for training or for the test, or all.")
    ] = LayoutPart.ALL,
    written_as: Annotated[
        SimulatedAs,
        typer.Option("--as", help="A log in GAIA's format per pass, or one table of episodes."),
    ] = SimulatedAs.LOGS,
    table_format: Annotated[
        TableFormat, typer.Option("--format", help="File format of the logs' tables.")
    ] = TableFormat.PARQUET,
    workers: Annotated[int, typer.Option(min=1, help="Processes that make episodes.")] = 1,
    calibrate_from: Annotated[
        str | None,
        typer.Option(
            metavar="SOURCE",
            help="Fit ranging errors to surveyed logs and write them as a preset, no passes.",
        ),
    ] = None,
    data_dir: DataDirOption = None,
) -> None:
    """Simulate passes along a work zone, with the truth of everything."""
    if calibrate_from is not None:
        _calibrate(calibrate_from, out, data_dir)
        return
    from gaia_uwb.config import dump_config
    from gaia_uwb.files import OutputFolder
    from gaia_uwb.simulate import find_preset

    config = find_preset(preset)
    if split is not LayoutPart.ALL:
        config = config.model_copy(update={"split": split.value})
    folder = OutputFolder(out)
    if written_as is SimulatedAs.EPISODES:
        _simulate_episodes(config, episodes, seed, out, workers)
    else:
        _simulate_logs(config, episodes, seed, out, table_format)
    header = f"# gaia {version()} simulate --preset {preset} --episodes {episodes} --seed {seed}\n"
    folder.write_text("simulation.yaml", header + dump_config(config))
    typer.echo(f"wrote {episodes} pass{'es' if episodes > 1 else ''} to {out}")


@app.command()
def evaluate(
    source: SourceArgument,
    out: OutOption = Path("out"),
    methods: Annotated[
        str, typer.Option(help="Denoisers to compare, with commas between.")
    ] = SCORED,
    solver: SolverOption = None,
    length: Annotated[
        str, typer.Option(help="Steps in a window, or 'whole' for whole runs.")
    ] = "whole",
    seed: Annotated[int, typer.Option(min=0, help="Of the bootstrap.")] = 0,
    true_nlos_labels: Annotated[
        bool, typer.Option("--true-nlos-labels", help="Give wls the true NLOS labels (the paper).")
    ] = False,
    config: ConfigOption = None,
    data_dir: DataDirOption = None,
) -> None:
    """Score denoisers on data with surveyed anchors: results.json, episodes.csv, config.yaml."""
    import json

    from gaia_uwb.config import dump_config
    from gaia_uwb.evaluate import episodes_csv, make_test, results_json, score_method
    from gaia_uwb.files import OutputFolder
    from gaia_uwb.sources import load_scenes

    settings = _settings(config, None, solver)
    names = _methods(methods)
    steps = _length(length)
    folder = OutputFolder(out)
    scenes = load_scenes(source, data_dir=data_dir)
    with progress_bar() as progress:
        test = make_test(
            scenes, steps, settings, each=lambda runs: iter(track(progress, runs, "prepare"))
        )
        scores = [
            score_method(test, name, settings, true_nlos_labels=true_nlos_labels)
            for name in track(progress, names, "score")
        ]
    protocol = {
        "data": source,
        "split": "none (no method is trained)",
        "length": length,
        "solver": settings.solver.kind,
        "true_nlos_labels": true_nlos_labels,
        "version": version(),
    }
    results = results_json(scores, test, protocol, seed=seed)
    folder.write_text("config.yaml", dump_config(settings))
    folder.write_text("episodes.csv", episodes_csv(scores, test))
    path = folder.write_text("results.json", json.dumps(results, indent=2, allow_nan=False) + "\n")
    print_results(results, path)


def main() -> None:
    """Run the command line; the entry point of ``gaia``."""
    import gc

    from gaia_uwb.errors import GaiaError

    # Imports make hundreds of thousands of objects that stay; looking through them again and again
    # for garbage takes a seventh of a short command's time.
    gc.set_threshold(100_000)
    try:
        code = app(standalone_mode=False)
    except GaiaError as error:
        _stop(str(error))
    except MemoryError:
        _stop("not enough memory for this log")
    except OSError as error:
        _stop(f"{error.filename or 'file system'}: {error.strerror or error}")
    except Exception as error:
        # A usage error of typer's; its class lives in another package from version to version.
        if not hasattr(error, "format_message"):
            raise
        _stop(error.format_message() or "expected a command; see gaia --help")
    if code == INTERRUPTED:
        _stop("interrupted", INTERRUPTED)
    sys.exit(code if isinstance(code, int) else 0)


def _stop(message: str, code: int = BAD_INPUT) -> NoReturn:
    sys.stderr.write(f"gaia: {plain(' '.join(message.split()))}\n")
    sys.exit(code)


def _stop_at(failures: Sequence[GaiaError], n_logs: int) -> None:
    """Tell which logs of several were left out; of a single log the error is the command's own."""
    if n_logs == 1 and failures:
        raise failures[0]
    for error in failures:
        sys.stderr.write(f"gaia: left out: {plain(' '.join(str(error).split()))}\n")
    if failures:
        _stop(f"{len(failures)} of {n_logs} logs were left out")


def _folders(out: Path, names: Sequence[str], *, several: bool = False) -> list[Path]:
    """Return a folder for each scene's results, all different; one that is all of it gets out."""
    if len(names) == 1 and not several:
        return [out]
    safe = [plain(name).replace("/", "-").replace("\n", " ").lstrip(".")[:100] for name in names]
    if "" in safe or len(set(safe)) < len(safe):
        safe = [f"{k}-{name}" for k, name in enumerate(safe)]
    return [out / name for name in safe]


def _simulate_logs(
    config: PassConfig, n: int, seed: int, out: Path, table_format: TableFormat
) -> None:
    """Write passes as logs, each in a folder of its own if there are several."""
    from gaia_uwb.datasets.native import write_native
    from gaia_uwb.simulate import simulate as passes

    width = len(str(n - 1))
    with progress_bar() as progress:
        task = progress.add_task("simulate", total=n)
        for k, scene in enumerate(passes(config, n, seed)):
            place = out if n == 1 else out / f"pass-{k:0{width}d}"
            write_native(scene, place, file_format=table_format.value)
            progress.advance(task)


def _simulate_episodes(config: PassConfig, n: int, seed: int, out: Path, workers: int) -> None:
    """Write passes as episodes: one table in parts."""
    from gaia_uwb.datasets.episodes import write_episodes
    from gaia_uwb.simulate import simulate_episodes

    with progress_bar() as progress:
        task = progress.add_task("simulate", total=n)
        for done in write_episodes(simulate_episodes(config, n, seed, workers=workers), out):
            progress.update(task, completed=done)


def _calibrate(source: str, out: Path, data_dir: Path | None) -> None:
    """Write the errors of surveyed logs as a preset file."""
    from gaia_uwb.files import OutputFolder
    from gaia_uwb.sim_calibration import fit_ranging, preset_text
    from gaia_uwb.sources import load_scenes

    folder = OutputFolder(out)
    scenes = load_scenes(source, data_dir=data_dir)
    text = preset_text(fit_ranging(scenes), scenes, version())
    path = folder.write_text("calibrated.yaml", text)
    typer.echo(f"wrote {path}; use it with: gaia simulate --preset {path}")


def _settings(
    config: Path | None, denoiser: str | None, solver: SolverName | None
) -> PipelineConfig:
    """Return the settings: defaults, then the file, then the command line."""
    from gaia_uwb.config import PipelineConfig, load_config
    from gaia_uwb.denoisers import make_denoiser

    settings = PipelineConfig() if config is None else load_config(config)
    if denoiser is not None:
        settings = settings.model_copy(update={"denoiser": denoiser})
    make_denoiser(settings.denoiser)  # an unknown name is told before any work
    if solver is not None:
        kind = settings.solver.model_copy(update={"kind": solver.value})
        settings = settings.model_copy(update={"solver": kind})
    return settings


def _methods(methods: str) -> list[str]:
    from gaia_uwb.denoisers import make_denoiser
    from gaia_uwb.errors import ConfigError

    names = [name.strip() for name in methods.split(",") if name.strip()]
    if not names or len(set(names)) < len(names):
        raise ConfigError(f"--methods: expected different denoisers, got {methods!r}")
    for name in names:
        make_denoiser(name)
    return names


def _length(length: str) -> int | None:
    from gaia_uwb.errors import ConfigError

    if length == "whole":
        return None
    if not length.isdecimal() or int(length) < 1:
        raise ConfigError(f"--length: expected a number of steps or 'whole', got {length!r}")
    return int(length)
