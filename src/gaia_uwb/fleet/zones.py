"""Many logs: grouped by zone, each zone's passes fused; ``fleet/workers.py`` runs many zones.

A zone is the unit of work: its logs are read and prepared once, one zone at a time in each process,
which bounds the memory. Its results are complete when ``fleet.json`` is there, which is written
last and names what they were made from; an interrupted run resumes with the zones that lack
it. A log that cannot be used is listed, and the rest of its zone is still reconstructed. Results do
not depend on who computes them: each zone is computed alone, and numerical libraries get one
thread.
"""

from __future__ import annotations

import csv
import hashlib
import io
import json
import os
import re
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from importlib.metadata import version
from pathlib import Path

from gaia_uwb._shared import (
    ConfigError,
    GaiaError,
    InputError,
    OutputFolder,
    SourceError,
    csv_text,
    paths_below,
    read_regular,
    shown,
    visible,
)
from gaia_uwb.config import PipelineConfig
from gaia_uwb.fleet.failures import Failure, write_failures
from gaia_uwb.scene import Scene

ONE_THREAD = {
    "OMP_NUM_THREADS": "numpy",
    "OPENBLAS_NUM_THREADS": "numpy",
    "MKL_NUM_THREADS": "numpy",
    "POLARS_MAX_THREADS": "polars",
}
"""Variables that limit the threads of numerical libraries, and the one that reads each as it is
loaded."""

KILLED = GaiaError("the process that worked on it was killed")
"""What is wrong with a zone that ends every process that works on it."""

ZONES = "zones.csv"
"""The table of all zones, beside their folders."""

_DONE = "fleet.json"
_MOST_FILES = 10_000  # in a log's folder
_MAX_MANIFEST_BYTES = 2**26
_LONGEST_NAME, _LONGEST_LOG = 200, 4096  # bytes, characters; file systems allow little more


@dataclass(frozen=True)
class ZoneLogs:
    """The logs of one zone.

    Parameters
    ----------
    name
        Names the folder of its results.
    logs
        What :func:`gaia_uwb.api.load_scenes` takes.
    """

    name: str
    logs: tuple[str, ...]


@dataclass(frozen=True)
class ZoneResult:
    """What came of one zone; ``status`` is ``failed`` where there is no result."""

    zone: str
    status: str
    n_passes: int
    n_anchors: int
    n_located: int
    area_m2: float
    failures: tuple[Failure, ...]

    @classmethod
    def failed(cls, zone: ZoneLogs, error: BaseException) -> ZoneResult:
        """Return the result of a zone without one: failed, and why.

        Parameters
        ----------
        zone
            The zone.
        error
            What ended the work on it.

        Examples
        --------
        >>> ZoneResult.failed(ZoneLogs("north", ()), InputError("no logs")).failures[0].problem
        'no logs'
        """
        return cls(zone.name, "failed", 0, 0, 0, 0.0, (Failure.of(zone.name, "", error),))

    @property
    def has_fault(self) -> bool:
        """Whether the program is to blame for a failure, and not a log."""
        return any(failure.traceback for failure in self.failures)


def find_zones(source: Path, out: Path | None = None) -> list[ZoneLogs]:
    """Return the zones of a manifest, or of a folder that holds a folder of logs for each zone.

    Parameters
    ----------
    source
        A manifest: a YAML file (``.yaml`` or ``.yml``) with a list of logs for each zone, or a CSV
        file with the columns ``log`` and ``zone``, paths relative to its own folder. Or a folder; a
        log that lies in the folder itself is a zone of its own.
    out
        Folder for results; if it lies in the source, what it contains is not a log.

    Returns
    -------
    list of ZoneLogs
        Sorted by name, at least one.

    Raises
    ------
    SourceError
        If there is nothing at ``source``, or no log in it.
    InputError
        If the manifest is wrong: the message names its row, line or zone.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as place:
    ...     manifest = Path(place) / "fleet.yaml"
    ...     _ = manifest.write_text("north: [drives/1, drives/2]")
    ...     [(zone.name, len(zone.logs)) for zone in find_zones(manifest)]
    [('north', 2)]
    """
    if source.is_file():
        is_yaml = source.suffix.lower() in {".yaml", ".yml"}
        zones = _yaml_manifest(source) if is_yaml else _csv_manifest(source)
    elif source.is_dir():
        zones = _folder(source, out)
    else:
        raise SourceError(f"{source}: neither a folder nor a manifest")
    if not zones:
        raise SourceError(f"{source}: contains no logs")
    for name, logs in zones.items():
        if not _can_name_a_folder(name):
            raise InputError(f"zone {shown(name)}: the name cannot be a folder name", source=source)
        longest = max(map(len, logs))
        if longest > _LONGEST_LOG:
            problem = f"zone {shown(name)}: a log's path is too long ({longest:,} characters)"
            raise InputError(problem, source=source)
    return [ZoneLogs(name, tuple(sorted(set(zones[name])))) for name in sorted(zones)]


def _can_name_a_folder(name: str) -> bool:
    if not name.strip() or name in {".", ".."} or re.search(r"[/\x00-\x1f\x7f]", name):
        return False
    return len(os.fsencode(name)) <= _LONGEST_NAME


def _csv_manifest(source: Path) -> dict[str, list[str]]:
    try:
        text = read_regular(source, most_bytes=_MAX_MANIFEST_BYTES).decode("utf-8-sig")
        rows = list(csv.DictReader(io.StringIO(text, newline="")))
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"cannot read this manifest: {error}", source=source) from error
    zones: dict[str, list[str]] = {}
    for k, row in enumerate(rows, start=2):
        log, zone = row.get("log"), row.get("zone")
        if not log or not zone:
            raise InputError("expected a log and a zone in each row", source=source, row=k)
        zones.setdefault(zone, []).append(str(source.parent / log))
    return zones


def _yaml_manifest(source: Path) -> dict[str, list[str]]:
    from gaia_uwb._shared import YamlError, read_yaml

    try:
        content = read_yaml(source, most_bytes=_MAX_MANIFEST_BYTES)
    except YamlError as error:
        raise InputError(str(error), source=source) from error
    if content is None:
        return {}
    if not isinstance(content, dict):
        raise InputError("expected a list of logs for each zone", source=source)
    zones: dict[str, list[str]] = {}
    for name, logs in content.items():
        if not isinstance(name, str):
            problem = f"expected text as the name of a zone, got {shown(name)}; put it in quotes"
            raise InputError(problem, source=source)
        if not isinstance(logs, list) or not logs:
            problem = f"zone {shown(name)}: expected a list of logs, got {shown(logs)}"
            raise InputError(problem, source=source)
        for k, log in enumerate(logs, start=1):
            if not isinstance(log, str) or not log:
                problem = f"zone {shown(name)}, log {k}: expected a path, got {shown(log)}"
                raise InputError(problem, source=source)
        zones[name] = [str(source.parent / log) for log in logs]
    return zones


def _folder(source: Path, out: Path | None) -> dict[str, list[str]]:
    from gaia_uwb.logs import is_described, is_native

    def is_log(path: Path) -> bool:
        return is_described(path) or is_native(path)

    def inside(folder: Path) -> list[Path]:
        results = None if out is None else os.path.realpath(out)
        return [path for path in visible(folder) if os.path.realpath(path) != results]

    zones: dict[str, list[str]] = {}
    for path in inside(source):
        if is_log(path):
            zones[path.name] = [str(path)]
        elif path.is_dir():
            logs = [str(each) for each in inside(path) if is_log(each) or each.is_dir()]
            if logs:
                zones[path.name] = logs
    return zones


def reconstruct_zone(zone: ZoneLogs, folder: Path, config: PipelineConfig) -> ZoneResult:
    """Fuse the passes of one zone and write its results, or read what was written before.

    Parameters
    ----------
    zone
        The zone.
    folder
        For its results.
    config
        All settings.

    Returns
    -------
    ZoneResult
        With the logs that were skipped. Whatever goes wrong is told in it and never raised.
    """
    failures: list[Failure] = []  # of single logs: they are told even where there is no result
    try:
        return _reconstruct_zone(zone, folder, config, failures)
    except Exception as error:  # a fault in one zone must not cost the others
        failed = ZoneResult.failed(zone, error)
        return replace(failed, failures=(*failures, *failed.failures))


def _reconstruct_zone(
    zone: ZoneLogs, folder: Path, config: PipelineConfig, failures: list[Failure]
) -> ZoneResult:
    digest = _digest(zone, config)
    try:
        done = json.loads(read_regular(folder / _DONE, most_bytes=_MAX_MANIFEST_BYTES))
        if done["digest"] == digest:
            skipped = tuple(Failure(**row) for row in done["result"].pop("failures"))
            return ZoneResult(**done["result"], failures=skipped)
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        pass  # not done yet, or done from something else
    result = _fused(zone, folder, config, failures)
    if not result.has_fault:  # one that has is done again: the program may be mended by then
        content = {"digest": digest, "result": asdict(result)}
        OutputFolder(folder).write(_DONE, json.dumps(content, indent=1) + "\n")
    return result


def _fused(
    zone: ZoneLogs, folder: Path, config: PipelineConfig, failures: list[Failure]
) -> ZoneResult:
    from gaia_uwb.locate import in_one_frame
    from gaia_uwb.outputs import write_all
    from gaia_uwb.pipeline import prepare, reconstruct_passes

    OutputFolder(folder).remove(_DONE)
    scenes: list[Scene] = []
    for log in zone.logs:
        try:
            for scene in _new_drives(log, scenes):
                scenes.append(scene)
        except Exception as error:  # a fault in one log must not cost the others
            failures.append(Failure.of(zone.name, log, error))
    episodes = []
    for scene in in_one_frame(scenes) if scenes else ():
        try:
            episodes.append(prepare(scene, config))
        except ConfigError:
            raise
        except Exception as error:
            failures.append(Failure.of(zone.name, scene.name, error))
    if not episodes:
        raise InputError("none of its logs can be used", source=zone.name)
    result = reconstruct_passes(episodes, config)
    write_all(result, folder)
    return ZoneResult(
        zone=zone.name,
        status=result.status.value,
        n_passes=len(result.passes),
        n_anchors=len(result.anchors),
        n_located=sum(anchor.status.has_position for anchor in result.anchors),
        area_m2=result.boundary.area_m2,
        failures=tuple(failures),
    )


def _new_drives(log: str, known: Sequence[Scene]) -> Iterator[Scene]:
    """Yield the drives of a log, without truth; one that is known already is refused."""
    from gaia_uwb.api import load_scenes
    from gaia_uwb.locate import same_drive

    for scene in load_scenes(log):
        twin = next((each for each in known if same_drive(each, scene)), None)
        if twin is not None:
            raise InputError(f"is the same drive as {twin.name}", source=scene.name)
        yield scene.without_truth()


def _digest(zone: ZoneLogs, config: PipelineConfig) -> str:
    """Return what names a zone's logs, with the size and time of each file, and the settings."""
    from gaia_uwb.denoisers import denoiser_identity
    from gaia_uwb.logs import named_elsewhere

    files = []
    for log in zone.logs:
        path, elsewhere = Path(log), []
        with suppress(GaiaError, OSError):  # told when the log is read
            elsewhere = named_elsewhere(path)
        for place in (path, *elsewhere):
            files += _files(place, log)
    settings = config.model_dump(mode="json")
    identity = denoiser_identity(config.denoiser)
    content = [version("gaia-uwb"), settings, identity, zone.logs, files]
    return hashlib.sha256(json.dumps(content).encode()).hexdigest()


def _files(place: Path, log: str) -> list[tuple[str, int, int]]:
    """Return name, size and time of each file at a place.

    A folder with more files than any log has is refused: a typo in a manifest must not walk a whole
    disk.
    """
    files = []
    with suppress(OSError):  # what cannot be looked at cannot be read later either
        inside = paths_below(place, most=_MOST_FILES) if place.is_dir() else [place]
        if inside is None:
            problem = f"contains more than {_MOST_FILES:,} files: name the folder of one log"
            raise InputError(problem, source=log)
        for each in inside:
            if each.is_file():
                about = each.stat()
                files.append((str(each), about.st_size, about.st_mtime_ns))
    return files


def write_tables(results: Sequence[ZoneResult], out: Path) -> list[Path]:
    """Write ``zones.csv`` and the failures, sorted by zone, and return the paths.

    Parameters
    ----------
    results
        Of all zones, in any order.
    out
        Folder of all results.
    """
    folder = OutputFolder(out)
    ordered = sorted(results, key=lambda result: result.zone)
    columns = ["zone", "status", "n_passes", "n_anchors", "n_located", "area_m2"]
    rows = [[getattr(result, column) for column in columns] for result in ordered]
    failures = [failure for result in ordered for failure in result.failures]
    return [
        folder.write(ZONES, csv_text(columns, rows)),
        *write_failures(failures, folder),
    ]
