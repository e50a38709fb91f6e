"""The library's front door: from whatever names a log to its scenes, and to a reconstruction.

A log is a folder in GAIA's own format, a folder with a ``gaia.yaml``, or a ROS log (a ``.bag``,
``.mcap`` or ``.db3`` file, or a ROS 2 folder); a folder of such logs is all of them. A registered
name comes before a folder of that name; ``./sim`` is the folder.

>>> from gaia_uwb.api import reconstruct
>>> result = reconstruct("sim:lane-closure")
>>> [anchor.status.value for anchor in result.anchors[:3]]
['ok', 'ok', 'ok']
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from gaia_uwb import pipeline
from gaia_uwb._shared import SourceError, visible
from gaia_uwb.config import PipelineConfig
from gaia_uwb.logs import (
    REGISTRY,
    Vehicle,
    dataset_folder,
    import_function,
    is_described,
    is_native,
    read_described,
    read_native,
)
from gaia_uwb.reconstruction import Reconstruction
from gaia_uwb.scene import Scene


def reconstruct(
    log: Scene | str | Path | Sequence[Scene | str | Path],
    config: PipelineConfig = PipelineConfig(),
    *,
    data_dir: Path | None = None,
    vehicle: Vehicle | None = None,
) -> Reconstruction:
    """Reconstruct a work zone from the log of one drive, or of several drives past it.

    Parameters
    ----------
    log
        A :class:`Scene`, or what :func:`read` takes: the place of a log, the name of a part of a
        data set, or a simulated pass such as ``"sim:lane-closure"``. A list of these are passes of
        one zone, which are fused. Their truth is not used.
    config
        All settings.
    data_dir
        Folder that holds the data sets; by default ``GAIA_DATA_DIR``, else the user's cache.
    vehicle
        Who drove, if that is known (:func:`gaia_uwb.logs.read_vehicle`): where the tags are on it,
        unless a log says so, and what is known of its clock and ranges.

    Returns
    -------
    Reconstruction
        Ranges, anchors and boundary; positions are east and north in metres in the log's local
        frame (with several logs, that of the first by name). ``status`` says whether the boundary
        can be relied upon, and ``reasons`` says why not.

    Raises
    ------
    SourceError
        If there is no such log, or several.
    InputError
        If the log is wrong (the message names the file and the row), the clocks do not overlap, or
        no range is usable, or passes have no frame in common or hold the same drive.
    ConfigError
        If a ``gaia.yaml`` is wrong or the denoiser's name is unknown.

    Examples
    --------
    >>> import gaia_uwb
    >>> result = gaia_uwb.reconstruct("sim:straight/4")
    >>> result.status.value
    'unreliable'
    >>> print(result.anchors[0].status.message)
    side ambiguous: the mirror position fits almost as well

    A second pass in another lane resolves the sides:

    >>> from gaia_uwb.simulate import PRESETS, simulate_zone
    >>> result = gaia_uwb.reconstruct(simulate_zone(PRESETS["straight"], seed=0))
    >>> [anchor.status.value for anchor in result.anchors[:3]]
    ['ok', 'ok', 'ok']
    """
    config = config if vehicle is None else knowing(config, vehicle)
    if isinstance(log, (Scene, str, Path)):
        return pipeline.reconstruct(_scene(log, data_dir, vehicle), config)
    return pipeline.reconstruct([_scene(each, data_dir, vehicle) for each in log], config)


def _scene(log: Scene | str | Path, data_dir: Path | None, vehicle: Vehicle | None) -> Scene:
    if isinstance(log, Scene):
        return _driven_by(vehicle, log)
    return read(log, data_dir=data_dir, vehicle=vehicle)


def _driven_by(vehicle: Vehicle | None, scene: Scene) -> Scene:
    return scene if vehicle is None else vehicle.drove(scene)


def knowing(config: PipelineConfig, *vehicles: Vehicle) -> PipelineConfig:
    """Return settings with what is known of vehicles.

    Parameters
    ----------
    config
        What they are without.
    vehicles
        Of a vehicle that the settings know already, this takes the place of what they know.

    Examples
    --------
    >>> from gaia_uwb.logs import Vehicle
    >>> list(knowing(PipelineConfig(), Vehicle(name="truck 7")).vehicles)
    ['truck 7']
    """
    known = {vehicle.name: vehicle.prior for vehicle in vehicles}
    return config.model_copy(update={"vehicles": config.vehicles | known})


SIMULATOR = "sim"
"""Name of the simulator as a source; the part is a preset."""


def read(
    source: str | Path, *, data_dir: Path | None = None, vehicle: Vehicle | None = None
) -> Scene:
    """Read one log: whatever the command line takes as SOURCE.

    Parameters
    ----------
    source
        Like that of :func:`load_scenes`, but it must name one log.
    data_dir
        Folder that holds the data sets; by default ``GAIA_DATA_DIR``, else the user's cache.
    vehicle
        Like that of :func:`load_scenes`.

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
    >>> read("sim:lane-closure/7").n_anchors
    8
    """
    scenes = load_scenes(source, data_dir=data_dir, vehicle=vehicle)
    if len(scenes) > 1:
        names = ", ".join(scene.name for scene in scenes[:5])
        more = f" and {len(scenes) - 5} more" if len(scenes) > 5 else ""
        raise SourceError(f"{source}: contains {len(scenes)} logs; choose one of {names}{more}")
    return scenes[0]


def load_scenes(
    source: str | Path, *, data_dir: Path | None = None, vehicle: Vehicle | None = None
) -> list[Scene]:
    """Load the scenes that a source names.

    Parameters
    ----------
    source
        A log (a folder in GAIA's own format, a folder with a ``gaia.yaml``, or a ROS log) or a
        folder of logs; or the name of a data set or the simulator, and a part of it after a colon.
        A ``Path`` is never read as a name.
    data_dir
        Folder that holds the data sets, see :func:`gaia_uwb.logs.data_folder`.
    vehicle
        Who drove, if that is known: its tags are where they are on it, unless a log says so.

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
    >>> from gaia_uwb.api import load_scenes
    >>> load_scenes("no-such-place")
    Traceback (most recent call last):
    gaia_uwb.SourceError: no-such-place: neither a folder nor one of outdoor-uwb, sim
    """
    if isinstance(source, Path):
        return [read_log(path, vehicle=vehicle) for path in logs_of(str(source))]
    name, _, part = source.partition(":")
    if name == SIMULATOR:
        from gaia_uwb.simulate import load

        return [_driven_by(vehicle, scene) for scene in load(part)]
    if name in REGISTRY:
        scenes: list[Scene] = import_function(REGISTRY[name].loader)(
            dataset_folder(name, data_dir), part
        )
        return [_driven_by(vehicle, scene) for scene in scenes]
    return [read_log(path, vehicle=vehicle) for path in logs_of(source)]


def load_readable(
    source: str,
    *,
    data_dir: Path | None = None,
    vehicle: Vehicle | None = None,
    each: Callable[[Sequence[Path]], Iterator[Path]] = iter,
) -> tuple[list[Scene], list[tuple[Path, Exception]]]:
    """Load the readable logs in a folder, and return the errors of the others with them.

    Parameters
    ----------
    source, data_dir, vehicle
        Like :func:`load_scenes`.
    each
        Goes through the logs; a progress bar may stand here.

    Returns
    -------
    list of Scene
        None if no log can be read.
    list of (Path, Exception)
        One per log that cannot be read; an error that is no :class:`GaiaError` is a fault of the
        program.

    Raises
    ------
    SourceError, InputError, ConfigError
        Like :func:`load_scenes`, but not for one log of a folder.
    """
    if source.partition(":")[0] in {SIMULATOR, *REGISTRY}:
        return load_scenes(source, data_dir=data_dir, vehicle=vehicle), []
    scenes: list[Scene] = []
    errors: list[tuple[Path, Exception]] = []
    for path in each(logs_of(source)):
        try:
            scenes.append(read_log(path, vehicle=vehicle))
        except Exception as error:  # a fault in one log must not cost the others
            errors.append((path, error))
    return scenes, errors


def read_log(path: Path, *, vehicle: Vehicle | None = None) -> Scene:
    """Read the log at a place, of whatever kind it is.

    Parameters
    ----------
    path
        One of :func:`logs_of`.
    vehicle
        Like that of :func:`load_scenes`.

    Returns
    -------
    Scene
        The log; its ``notes`` say what was skipped or guessed.

    Raises
    ------
    InputError, ConfigError
        If the data or their description are wrong.
    """
    reader = read_described if is_described(path) else read_native
    return reader(path, vehicle=vehicle)


def logs_of(source: str) -> list[Path]:
    """Return the log itself, or the logs in a folder.

    Parameters
    ----------
    source
        The place of a log, or of a folder of logs.

    Raises
    ------
    SourceError
        If there is no such place, or it cannot be read.
    """
    if not source.strip():
        raise SourceError("expected a log or a name, got nothing")
    try:
        return _logs_at(Path(source), source)
    except OSError as error:
        raise SourceError(f"{source}: cannot be read: {error.strerror or error}") from error


def _logs_at(path: Path, source: str) -> list[Path]:
    if is_described(path):
        return [path]
    if path.is_file():
        problem = "is a file; give the folder with trajectory and ranges, or a ROS log"
        raise SourceError(f"{source}: {problem}")
    if not path.is_dir():
        known = ", ".join([*REGISTRY, SIMULATOR])
        raise SourceError(f"{source}: neither a folder nor one of {known}")
    if is_native(path):
        return [path]
    inner = [each for each in visible(path) if is_described(each) or is_native(each)]
    return inner or [path]
