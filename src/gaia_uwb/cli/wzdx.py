"""The commands on work-zone feeds: write them, check them."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gaia_uwb._shared import written_out
from gaia_uwb.cli.exit_codes import BAD_INPUT, UNRELIABLE
from gaia_uwb.cli.options import DataDirOption, OutOption

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from datetime import datetime

    from gaia_uwb.wzdx import FeedZone, Problem


wzdx_app = typer.Typer(help="Write and check work-zone feeds (WZDx, CWZ).", no_args_is_help=True)


class ProfileName(StrEnum):
    """The specifications, as the command line names them."""

    WZDX = "wzdx-4.2"
    CWZ = "cwz-1.0"


SchemasOption = Annotated[
    Path | None,
    typer.Option("--schemas", help="Folder with the official JSON schemas, to check against."),
]


@wzdx_app.command()
def validate(
    files: Annotated[
        list[Path],
        typer.Argument(
            metavar="FILE...", help="Feed files; with several, cross-references are checked."
        ),
    ],
    schemas: SchemasOption = None,
) -> None:
    """Check feeds: their members, the rules between them, and optionally the official schemas."""
    from gaia_uwb.wzdx import OfficialSchemas, validate_files

    official = None if schemas is None else OfficialSchemas(schemas)
    if not _print_problems(validate_files(files, official)):
        raise typer.Exit(BAD_INPUT)


@wzdx_app.command()
def write(
    source: Annotated[
        str,
        typer.Argument(
            metavar="SOURCE",
            help="A results folder of 'gaia reconstruct', or a log, as for that command.",
        ),
    ],
    config: Annotated[
        Path,
        typer.Option("--config", help="YAML file with the publisher, road, dates and so on."),
    ],
    out: OutOption,
    update_date: Annotated[
        str | None,
        typer.Option(help="Date of the information, such as 2026-11-22T10:00:00Z [now]."),
    ] = None,
    profile: Annotated[
        ProfileName | None, typer.Option(help="Specification; overrides the one in the file.")
    ] = None,
    schemas: SchemasOption = None,
    data_dir: DataDirOption = None,
) -> None:
    """Write a WorkZoneFeed and a DeviceFeed for one reconstructed work zone."""
    from gaia_uwb.logs import results_folder
    from gaia_uwb.wzdx import (
        OfficialSchemas,
        load_feed_config,
        make_feeds,
        validate_document,
        write_feeds,
    )

    changes = {} if profile is None else {"profile": profile.value}
    settings = load_feed_config(config, changes)
    date = _date(update_date)
    official = None if schemas is None else OfficialSchemas(schemas)
    results_folder(out, [source], data_dir=data_dir)
    zone = _zone(source, data_dir)
    feeds = make_feeds(zone, settings, date)
    found = {
        name: validate_document(feed, official)
        for name, feed in (("WorkZoneFeed", feeds.work_zone), ("DeviceFeed", feeds.device))
    }
    if not _print_problems({name: problems for name, problems in found.items() if problems}):
        raise typer.Exit(BAD_INPUT)
    paths = write_feeds(feeds, out)
    _print_zone(zone, paths)
    if not zone.reliable:
        raise typer.Exit(UNRELIABLE)


def _date(text: str | None) -> datetime:
    """Read the update date; the current time is used only where the user gives none."""
    from datetime import UTC, datetime

    from gaia_uwb._shared import ConfigError
    from gaia_uwb.wzdx import parse_date

    if text is None:
        return datetime.now(UTC)
    try:
        return parse_date(text)
    except ValueError as error:
        raise ConfigError(f"--update-date: {error}, got {text!r}") from error


def _zone(source: str, data_dir: Path | None) -> FeedZone:
    """Read results, or reconstruct a log with the default settings."""
    from gaia_uwb._shared import ConfigError
    from gaia_uwb.wzdx import read_zone, zone_of

    if (Path(source) / "report.json").is_file():
        return read_zone(Path(source))
    from gaia_uwb.api import load_scenes
    from gaia_uwb.pipeline import reconstruct

    scenes = load_scenes(source, data_dir=data_dir)
    if len(scenes) > 1:
        raise ConfigError(
            f"{source}: contains {len(scenes)} logs; a feed describes one, so choose one"
        )
    return zone_of(reconstruct(scenes[0]))


def _print_problems(found: Mapping[Path, list[Problem]] | Mapping[str, list[Problem]]) -> bool:
    """List problems, one line each, and return whether none of them is an error."""
    from gaia_uwb.wzdx import MOST_PROBLEMS

    valid = True
    for name, problems in found.items():
        errors = sum(problem.is_error for problem in problems)
        valid &= not errors
        lines = [f"{name}: {problem}" for problem in problems]
        if len(problems) >= MOST_PROBLEMS:
            lines.append(f"{name}: possibly more; only the first {MOST_PROBLEMS} are listed")
        warnings = len(problems) - errors
        verdict = f"invalid, {_count(errors, 'error')}" if errors else "valid"
        lines.append(
            f"{name}: {verdict}" + (f", {_count(warnings, 'warning')}" if warnings else "")
        )
        typer.echo("\n".join(map(written_out, lines)))
    return valid


def _print_zone(zone: FeedZone, paths: Sequence[Path]) -> None:
    import numpy as np

    lines = []
    for part in zone.parts:
        length_m = float(np.hypot(*np.diff(part.line_m, axis=0).T).sum())
        lines.append(f"{zone.name}: {len(part.cones)} cones along {length_m:.0f} m")
    if zone.unlocated:
        lines.append(f"  skipped, not located: {', '.join(zone.unlocated)}")
    lines += [f"  unreliable: {reason}" for reason in zone.reasons]
    lines += [f"  wrote {path}" for path in paths]
    typer.echo("\n".join(map(written_out, lines)))


def _count(n: int, what: str) -> str:
    return f"{n} {what}{'' if n == 1 else 's'}"
