"""The command ``gaia``: one file per command; ``terminal.py`` has what people see.

Heavy modules are imported inside the commands, so that ``gaia --help`` is quick.
"""

from __future__ import annotations

import os
import sys
from typing import Annotated

import typer

from gaia_uwb.cli.data import data_app
from gaia_uwb.cli.evaluate import evaluate
from gaia_uwb.cli.exit_codes import FAULT, INTERRUPTED, keep_traceback, stop
from gaia_uwb.cli.fleet import fleet
from gaia_uwb.cli.options import RunningCommand, version
from gaia_uwb.cli.reconstruct import reconstruct
from gaia_uwb.cli.reproduce import reproduce_app
from gaia_uwb.cli.simulate import simulate
from gaia_uwb.cli.train import train
from gaia_uwb.cli.vehicle import vehicle_app
from gaia_uwb.cli.wzdx import wzdx_app

app = typer.Typer(
    name="gaia",
    help="Turn the log of a drive past a work zone into cone positions and a boundary.",
    epilog="Exit codes: 0 done; 1 done, but a result is unreliable; 2 bad input or usage; "
    "3 a fault of the program; 130 interrupted. Of several, the highest counts.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
app.add_typer(data_app, name="data")
app.add_typer(reproduce_app, name="reproduce")
app.add_typer(vehicle_app, name="vehicle")
app.add_typer(wzdx_app, name="wzdx")


@app.callback(invoke_without_command=True)
def _root(
    show_version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False,
) -> None:
    if show_version:
        typer.echo(f"gaia {version()}")
        raise typer.Exit


for command in (reconstruct, fleet, simulate, evaluate, train):  # in the help's order
    app.command(command.__name__)(command)


def main() -> None:
    """Run the command line; the entry point of ``gaia``."""
    import gc

    from gaia_uwb._shared import problem_of

    # Imports make hundreds of thousands of objects that stay; looking through them again and again
    # for garbage takes a seventh of a short command's time.
    gc.set_threshold(100_000)
    # A name of a file may hold what the terminal's encoding lacks.
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")
    # We draw with our own settings; a damaged file of the user's must not even be read.
    os.environ["MATPLOTLIBRC"] = os.devnull
    os.environ.pop("MPLBACKEND", None)
    running = RunningCommand()
    try:
        code = app(standalone_mode=False, obj=running)
    except (SystemExit, KeyboardInterrupt):
        raise
    except BaseException as error:  # a panic of polars is no Exception
        # A usage error of typer's; its class lives in another package from version to version.
        if hasattr(error, "format_message"):
            stop(error.format_message() or "expected a command; see gaia --help")
        problem = problem_of(error)
        if problem.is_fault:
            where = keep_traceback(problem.traceback, running.out)
            stop(f"{problem.text} ({where})", FAULT)
        stop(problem.text)
    if code == INTERRUPTED:
        stop("interrupted", INTERRUPTED)
    sys.exit(code if isinstance(code, int) else 0)
