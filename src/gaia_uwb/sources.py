"""From what a user names as SOURCE to scenes: a log, or NAME[:PART] from the registries.

A log is a folder in GAIA's own format, a folder with a ``gaia.yaml``, a ROS 2 folder, or a ``.bag``
or ``.mcap`` file; a folder of such logs is all of them. A registered name comes before a folder of
that name; ``./sim`` is the folder.
"""

from __future__ import annotations

from pathlib import Path

from gaia_uwb.datasets import REGISTRY, import_function
from gaia_uwb.datasets.check import CheckReport, check_scene
from gaia_uwb.datasets.described import is_described, read_described
from gaia_uwb.datasets.fetch import dataset_folder
from gaia_uwb.datasets.native import is_native, read_with_notes
from gaia_uwb.errors import ConfigError, GaiaError, InputError, SourceError
from gaia_uwb.files import visible
from gaia_uwb.scene import Scene

SIMULATOR = "sim"
"""Name of the simulator as a source; the part is a preset."""


def read(source: str | Path, *, data_dir: Path | None = None) -> Scene:
    """Read one log: whatever the command line takes as SOURCE.

    Parameters
    ----------
    source
        Like that of :func:`load_scenes`, but it must name one log.
    data_dir
        Folder that holds the data sets; by default ``GAIA_DATA_DIR``, else the user's cache.

    Returns
    -------
    Scene
        What the log holds.

    Raises
    ------
    SourceError
        Like :func:`load_scenes`, and if there are several logs: the message names them.
    InputError, ConfigError
        Like :func:`load_scenes`.

    Examples
    --------
    >>> from gaia_uwb.sources import read
    >>> read("sim:lane-closure/7").n_anchors
    8
    """
    scenes = load_scenes(source, data_dir=data_dir)
    if len(scenes) > 1:
        names = ", ".join(scene.name for scene in scenes[:5])
        more = f" and {len(scenes) - 5} more" if len(scenes) > 5 else ""
        raise SourceError(f"{source}: holds {len(scenes)} logs, so name one of {names}{more}")
    return scenes[0]


def load_scenes(source: str | Path, *, data_dir: Path | None = None) -> list[Scene]:
    """Load the scenes that a source names.

    Parameters
    ----------
    source
        A log (a folder in GAIA's own format, a folder with a ``gaia.yaml``, a ROS 2 folder, a
        ``.bag`` or ``.mcap`` file) or a folder of logs; or the name of a data set or the simulator,
        and a part of it after a colon. A ``Path`` is never taken for a name.
    data_dir
        Folder that holds the data sets, see :func:`gaia_uwb.datasets.fetch.data_folder`.

    Returns
    -------
    list of Scene
        At least one.

    Raises
    ------
    SourceError
        If there is no such folder, name or part, or the data set has not been fetched.
    InputError
        If the data are wrong: the message names the file and the row or message.
    ConfigError
        If a ``gaia.yaml`` is wrong, or ROS logs need an extra that is not installed.

    Examples
    --------
    >>> from gaia_uwb.sources import load_scenes
    >>> load_scenes("no-such-place")
    Traceback (most recent call last):
    gaia_uwb.errors.SourceError: no-such-place: neither a folder nor one of outdoor-uwb, sim
    """
    if isinstance(source, Path):
        return [_read_log(path)[0] for path in _logs(str(source))]
    name, _, part = source.partition(":")
    if name == SIMULATOR:
        from gaia_uwb.simulate import load

        return load(part)
    if name in REGISTRY:
        scenes: list[Scene] = import_function(REGISTRY[name].loader)(
            dataset_folder(name, data_dir), part
        )
        return scenes
    return [_read_log(path)[0] for path in _logs(source)]


def load_readable(
    source: str, *, data_dir: Path | None = None
) -> tuple[list[Scene], list[GaiaError]]:
    """Load what can be read of the logs in a folder; the errors of the others come beside it.

    Parameters
    ----------
    source, data_dir
        Like :func:`load_scenes`.

    Returns
    -------
    list of Scene
        None if no log can be read.
    list of GaiaError
        One per log that cannot be read.

    Raises
    ------
    SourceError, InputError, ConfigError
        Like :func:`load_scenes`, but not for one log of a folder.
    """
    if source.partition(":")[0] in {SIMULATOR, *REGISTRY}:
        return load_scenes(source, data_dir=data_dir), []
    scenes: list[Scene] = []
    errors: list[GaiaError] = []
    for path in _logs(source):
        try:
            scenes.append(_read_log(path)[0])
        except (InputError, ConfigError) as error:
            errors.append(error)
    return scenes, errors


def check_source(source: str, *, data_dir: Path | None = None) -> list[CheckReport]:
    """Check all that a source names; a scene that cannot be read gets a report that says so.

    Parameters
    ----------
    source, data_dir
        Like :func:`load_scenes`.

    Returns
    -------
    list of CheckReport
        One per scene; for a whole data set, one more on what its scenes do not show.

    Raises
    ------
    SourceError
        If there is no such folder, name or part, or the data set has not been fetched.
    """
    name, _, part = source.partition(":")
    if name == SIMULATOR or name in REGISTRY:
        try:
            reports = [check_scene(scene) for scene in load_scenes(source, data_dir=data_dir)]
            checker = REGISTRY[name].checker if name in REGISTRY and not part else None
            if checker is not None:
                reports.append(import_function(checker)(dataset_folder(name, data_dir)))
        except InputError as error:
            reports = [CheckReport.of_failure(source, error)]
        return reports
    return [_check_log(path) for path in _logs(source)]


def _read_log(path: Path) -> tuple[Scene, tuple[str, ...]]:
    return read_described(path) if is_described(path) else read_with_notes(path)


def _check_log(path: Path) -> CheckReport:
    try:
        return check_scene(*_read_log(path))
    except (InputError, ConfigError) as error:
        return CheckReport.of_failure(str(path), error)


def _logs(source: str) -> list[Path]:
    """Return the log itself, or the logs in a folder."""
    if not source.strip():
        raise SourceError("expected a log or a name as source, got nothing")
    try:
        return _logs_at(Path(source), source)
    except OSError as error:
        raise SourceError(f"{source}: cannot be read: {error.strerror or error}") from error


def _logs_at(path: Path, source: str) -> list[Path]:
    if is_described(path):
        return [path]
    if path.is_file():
        problem = "is a file; name the folder that holds trajectory and ranges, or a .bag or .mcap"
        raise SourceError(f"{source}: {problem}")
    if not path.is_dir():
        known = ", ".join([*REGISTRY, SIMULATOR])
        raise SourceError(f"{source}: neither a folder nor one of {known}")
    if is_native(path):
        return [path]
    inner = [each for each in visible(path) if is_described(each) or is_native(each)]
    return inner or [path]
