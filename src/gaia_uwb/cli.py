"""The command line: reads arguments and sets exit codes; ``terminal.py`` has what people see.

Exit codes: 0 done; 1 done, but a result is marked unreliable; 2 bad input or usage, with one line
on stderr. Heavy modules are imported inside the commands, so that ``gaia --help`` is quick.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer

from gaia_uwb._text import printable
from gaia_uwb.cli_data import data_app
from gaia_uwb.cli_fleet import fleet
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
from gaia_uwb.cli_simulate import simulate
from gaia_uwb.cli_wzdx import wzdx_app
from gaia_uwb.terminal import print_results, print_summary, progress_bar, track

if TYPE_CHECKING:
    from collections.abc import Sequence

    from gaia_uwb.config import PipelineConfig
    from gaia_uwb.errors import GaiaError

UNRELIABLE, BAD_INPUT, INTERRUPTED = 1, 2, 130
SCORED = "raw,median,kalman,pose-kalman,gaia-set"

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


@app.callback(invoke_without_command=True)
def _root(
    show_version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False,
) -> None:
    if show_version:
        typer.echo(f"gaia {version()}")
        raise typer.Exit


@app.command()
def reconstruct(
    sources: Annotated[
        list[str],
        typer.Argument(
            metavar="SOURCE...",
            help="Logs, folders of logs, or NAME[:PART], such as outdoor-uwb:NLOS/B/4 or sim. "
            "Several sources are drives past one zone.",
        ),
    ],
    out: OutOption = Path("out"),
    one_zone: Annotated[
        bool | None,
        typer.Option(
            "--one-zone/--each-alone",
            help="Fuse all logs as passes of one zone, or give each a result of its own. Default: "
            "several sources are fused, the logs in one folder are not.",
        ),
    ] = None,
    denoiser: Annotated[
        str | None,
        typer.Option(
            help="gaia-set (default), raw, median, kalman, pose-kalman; or one of the paper's "
            "networks (mlp, pose-mlp, gaia). Networks take what they were trained on, or a model's "
            "folder, after a colon: gaia:stress."
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
    """Locate the cones and draw the boundary from the log of a drive, or of several drives."""
    from gaia_uwb.api import load_readable
    from gaia_uwb.errors import InputError
    from gaia_uwb.evaluate import reconstruct_and_score
    from gaia_uwb.files import OutputFolder
    from gaia_uwb.reconstruction import ReconstructionStatus
    from gaia_uwb.report import write_all

    settings = _settings(config, denoiser, solver)
    settings = with_prior(settings, side, closure, spacing, known_anchor)
    OutputFolder(out)
    scenes, failures = [], []
    for source in sources:
        readable, unreadable = load_readable(source, data_dir=data_dir)
        scenes += readable
        failures += unreadable
    n_logs = len(scenes) + len(failures)
    reliable = True
    with progress_bar() as progress:
        if one_zone if one_zone is not None else len(sources) > 1:
            runs = [(scenes, out)] if scenes else []
        else:
            folders = _folders(out, [scene.name for scene in scenes], several=n_logs > 1)
            runs = [([scene], folder) for scene, folder in zip(scenes, folders, strict=True)]
        for passes, folder in track(progress, runs, "reconstruct"):
            try:
                result, metrics = reconstruct_and_score(passes, settings)
            except InputError as error:
                if len(passes) > 1:
                    raise
                failures.append(error)
                continue
            paths = write_all(result, folder, metrics, svg=svg, gis=gis)
            reliable &= result.status is ReconstructionStatus.OK
            print_summary(progress, result, metrics, paths)
    _stop_at(failures, n_logs)
    if not reliable:
        raise typer.Exit(UNRELIABLE)


app.command("fleet")(fleet)  # the help lists commands in this order
app.command("simulate")(simulate)


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

    from gaia_uwb.api import load_scenes
    from gaia_uwb.config import dump_config
    from gaia_uwb.evaluate import episodes_csv, make_test, results_json, score_method
    from gaia_uwb.files import OutputFolder

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


app.command("train")(train)


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
    sys.stderr.write(f"gaia: {printable(message)}\n")
    sys.exit(code)


def _stop_at(failures: Sequence[GaiaError], n_logs: int) -> None:
    """Tell which logs of several were left out; of a single log the error is the command's own."""
    if n_logs == 1 and failures:
        raise failures[0]
    for error in failures:
        sys.stderr.write(f"gaia: left out: {printable(str(error))}\n")
    if failures:
        _stop(f"{len(failures)} of {n_logs} logs were left out")


def _folders(out: Path, names: Sequence[str], *, several: bool = False) -> list[Path]:
    """Return a folder for each scene's results, all different; one that is all of it gets out."""
    if len(names) == 1 and not several:
        return [out]
    safe = [printable(name).replace("/", "-").lstrip(".")[:100] for name in names]
    if "" in safe or len(set(safe)) < len(safe):
        safe = [f"{k}-{name}" for k, name in enumerate(safe)]
    return [out / name for name in safe]


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
