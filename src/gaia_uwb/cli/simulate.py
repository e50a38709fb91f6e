"""``gaia simulate``: passes along work zones, with the truth of everything."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gaia_uwb.cli.options import DataDirOption, OutOption, version
from gaia_uwb.cli.terminal import Progress

if TYPE_CHECKING:
    from collections.abc import Iterable

    from gaia_uwb._shared import OutputFolder
    from gaia_uwb.scene import Scene
    from gaia_uwb.simulate import PassConfig

_SETTINGS = "simulation.yaml"


class SimulatedAs(StrEnum):
    """What a simulated pass is written as."""

    LOGS = "logs"
    EPISODES = "episodes"


class LayoutPart(StrEnum):
    """The parts of a preset's layouts; no layout is in both of the last two."""

    ALL = "all"
    TRAINING = "training"
    TEST = "test"


class TableFormat(StrEnum):
    """File formats of our native tables."""

    CSV = "csv"
    PARQUET = "parquet"


def simulate(
    out: OutOption,
    preset: Annotated[
        str, typer.Option(help="Kind of pass: a preset's name, or a YAML settings file.")
    ] = "lane-closure",
    episodes: Annotated[int, typer.Option(min=1, help="Number of passes.")] = 1,
    seed: Annotated[
        int, typer.Option(min=0, help="Random seed; the same seed reproduces the same passes.")
    ] = 0,
    split: Annotated[
        LayoutPart, typer.Option(help="Use all layouts, or those reserved for training or test.")
    ] = LayoutPart.ALL,
    written_as: Annotated[
        SimulatedAs,
        typer.Option("--as", help="Write one log per pass, or one table of episodes."),
    ] = SimulatedAs.LOGS,
    table_format: Annotated[
        TableFormat, typer.Option("--format", help="File format of the logs' tables.")
    ] = TableFormat.PARQUET,
    lanes: Annotated[
        str | None,
        typer.Option(
            metavar="M,M,...",
            help="Simulate several passes of one zone, one log each: the offset of each from the "
            "usual lane, towards the open side, in metres.",
        ),
    ] = None,
    vehicles: Annotated[
        str | None,
        typer.Option(
            metavar="NAME,NAME,...",
            help="The vehicle of each of the --lanes; vehicles of the same name share their clock "
            "and radios.",
        ),
    ] = None,
    workers: Annotated[int, typer.Option(min=1, help="Number of worker processes.")] = 1,
    calibrate_from: Annotated[
        str | None,
        typer.Option(
            metavar="SOURCE",
            help="Write a preset with ranging errors fitted to surveyed logs, instead of passes.",
        ),
    ] = None,
    data_dir: DataDirOption = None,
) -> None:
    """Simulate passes along a work zone, with the full ground truth."""
    if calibrate_from is not None:
        _calibrate(calibrate_from, out, data_dir)
        return
    from gaia_uwb._shared import ConfigError
    from gaia_uwb.config import dump_config
    from gaia_uwb.logs import results_folder
    from gaia_uwb.simulate import find_preset

    if vehicles is not None and lanes is None:
        raise ConfigError("--vehicles: expected --lanes beside it")
    config = find_preset(preset)
    if split is not LayoutPart.ALL:
        config = config.model_copy(update={"split": split.value})
    folder = results_folder(out, for_log=True)
    folder.claim([_SETTINGS])
    how = f"--episodes {episodes}" if lanes is None else f"--lanes={lanes}"
    if vehicles is not None:
        how += f" --vehicles {vehicles}"
    header = f"# gaia {version()} simulate --preset {preset} {how} --seed {seed}"
    if lanes is None and written_as is SimulatedAs.EPISODES:
        settings = f"{header} --as episodes\n{dump_config(config)}"
        already = _simulate_episodes(config, episodes, seed, folder, settings, workers)
    else:
        already = 0
        if lanes is not None:
            episodes = _simulate_zone(config, lanes, vehicles, seed, out, table_format)
        else:
            _simulate_logs(config, episodes, seed, out, table_format)
        folder.write(_SETTINGS, f"{header}\n{dump_config(config)}")
    note = f"; {already} of them existed already" if already else ""
    typer.echo(f"wrote {episodes} pass{'es' if episodes > 1 else ''} to {out}{note}")


def _simulate_logs(
    config: PassConfig, n: int, seed: int, out: Path, table_format: TableFormat
) -> None:
    """Write passes as logs, each in a folder of its own if there are several."""
    from gaia_uwb.simulate import simulate as passes

    _write_logs(passes(config, n, seed), n, out, table_format)


def _simulate_zone(
    config: PassConfig,
    lanes: str,
    vehicles: str | None,
    seed: int,
    out: Path,
    table_format: TableFormat,
) -> int:
    """Write passes of one zone as logs and return how many."""
    from gaia_uwb._shared import ConfigError
    from gaia_uwb.simulate import simulate_zone

    try:
        lanes_m = [float(lane) for lane in lanes.split(",")]
    except ValueError as error:
        raise ConfigError(f"--lanes: expected comma-separated metres, got {lanes!r}") from error
    names = None if vehicles is None else vehicles.split(",")
    scenes = simulate_zone(config, seed, lanes_m=lanes_m, vehicles=names)
    _write_logs(scenes, len(scenes), out, table_format)
    return len(scenes)


def _write_logs(scenes: Iterable[Scene], n: int, out: Path, table_format: TableFormat) -> None:
    from gaia_uwb.logs import write_native

    width = len(str(n - 1))
    with Progress() as progress:
        progress.update("simulate", 0, n)
        for k, scene in enumerate(scenes):
            place = out if n == 1 else out / f"pass-{k:0{width}d}"
            write_native(scene, place, file_format=table_format.value)
            progress.update("simulate", k + 1, n)


def _simulate_episodes(
    config: PassConfig, n: int, seed: int, folder: OutputFolder, settings: str, workers: int
) -> int:
    """Write passes as episodes, one table in parts, and return how many existed already.

    The settings come first: they let the same command recognise its own parts and resume there.
    """
    from gaia_uwb._shared import SourceError
    from gaia_uwb.logs import count_episodes, write_episodes
    from gaia_uwb.simulate import simulate_episodes

    already = count_episodes(folder.path)
    if already and _text_in(folder.path / _SETTINGS) != settings:
        raise SourceError(f"{folder.path}: already contains episodes from a different command")
    folder.write(_SETTINGS, settings)
    with Progress() as progress:
        progress.update("simulate", already, n)
        made = simulate_episodes(config, n, seed, first=already, workers=workers)
        for done in write_episodes(made, folder.path, append=True):
            progress.update("simulate", already + done, n)
    return already


def _text_in(path: Path) -> str | None:
    """Return a file's text; None if it cannot be read."""
    from gaia_uwb._shared import MAX_BYTES, read_regular

    try:
        return read_regular(path, most_bytes=MAX_BYTES).decode()
    except (OSError, UnicodeDecodeError):
        return None


def _calibrate(source: str, out: Path, data_dir: Path | None) -> None:
    """Write the errors of surveyed logs as a preset file."""
    from gaia_uwb.api import load_scenes
    from gaia_uwb.logs import results_folder
    from gaia_uwb.simulate import fit_ranging, preset_text

    folder = results_folder(out, [source], data_dir=data_dir)
    scenes = load_scenes(source, data_dir=data_dir)
    text = preset_text(fit_ranging(scenes), scenes, version())
    path = folder.write("calibrated.yaml", text)
    typer.echo(f"wrote {path}; use it with: gaia simulate --preset {path}")
