"""Where results may go: never into a folder that is read, and never into one that holds a log."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path

from gaia_uwb._shared import ConfigError, GaiaError, OutputFolder, visible
from gaia_uwb.logs.bags import is_ros_file
from gaia_uwb.logs.described import named_elsewhere
from gaia_uwb.logs.download import data_folder
from gaia_uwb.logs.input_description import FILE_NAME
from gaia_uwb.logs.native import LOG_FILES
from gaia_uwb.logs.registry import REGISTRY


def results_folder(
    out: Path,
    sources: Iterable[str | Path] = (),
    *,
    data_dir: Path | None = None,
    for_log: bool = False,
) -> OutputFolder:
    """Return a folder for results that holds no log and is none of the folders that are read.

    Parameters
    ----------
    out
        The folder; created if missing. It may lie inside a folder that is read.
    sources
        What is read, as the command line names it: paths of logs, of folders of logs, of results;
        or names of data sets with their parts.
    data_dir
        Folder that holds the data sets, see :func:`data_folder`.
    for_log
        A log will be written, so one that we wrote there before may be replaced.

    Raises
    ------
    ConfigError
        If the folder is read, holds a log, or cannot be created or written to.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as place:
    ...     results_folder(Path(place), [place])
    Traceback (most recent call last):
    gaia_uwb.ConfigError: ...: is read by this command: results need another folder
    """
    here = os.path.realpath(out)
    for source in sources:
        if any(os.path.realpath(folder) == here for folder in _folders_read(source, data_dir)):
            raise ConfigError(f"{out}: is read by this command: results need another folder")
    found = log_files(out)
    if found and not for_log:
        raise ConfigError(f"{out}: holds a log ({found[0]}): results need another folder")
    folder = OutputFolder(out)
    foreign = sorted(set(found) - folder.names())
    if foreign:
        raise ConfigError(f"{out}: holds a log ({foreign[0]}) that was not written by gaia")
    return folder


def log_files(folder: Path) -> list[str]:
    """Return the names of the files in a folder that belong to a log, of whatever kind.

    Parameters
    ----------
    folder
        It need not exist.

    Examples
    --------
    >>> log_files(Path("no-such-folder"))
    []
    """
    try:
        paths = visible(folder)
    except OSError:  # told when it is created
        return []
    return [
        path.name for path in paths if path.name in {FILE_NAME, *LOG_FILES} or is_ros_file(path)
    ]


def _folders_read(source: str | Path, data_dir: Path | None) -> Iterator[Path]:
    name = str(source).partition(":")[0]
    if isinstance(source, str) and name in REGISTRY:
        yield data_folder(data_dir) / name
        return
    path = Path(source)
    with suppress(OSError):
        if path.is_file():
            yield path.parent
        if not path.is_dir():
            return
        for log in (path, *(each for each in visible(path) if each.is_dir() and log_files(each))):
            yield log
            with suppress(GaiaError):  # told when the log is read
                yield from (each if each.is_dir() else each.parent for each in named_elsewhere(log))
