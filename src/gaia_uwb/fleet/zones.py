"""Many logs: grouped by zone, each zone's passes fused; ``fleet/workers.py`` runs many zones.

A zone is the unit of work: its logs are read and prepared once, one zone at a time in each process,
which bounds the memory. Its results are complete when ``fleet.json`` is there, which is written
last and names what they were made from; an interrupted run resumes with the zones that lack
it. A log that cannot be used is listed, and the rest of its zone is still reconstructed. Results do
not depend on who computes them: each zone is computed alone, and numerical libraries get one
thread.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from importlib.metadata import version
from pathlib import Path

from gaia_uwb._shared import (
    ConfigError,
    GaiaError,
    InputError,
    OutputFolder,
    csv_text,
    paths_below,
    read_regular,
)
from gaia_uwb.config import PipelineConfig
from gaia_uwb.fleet.failures import Failure, write_failures
from gaia_uwb.fleet.manifests import ZoneLogs
from gaia_uwb.logs import Vehicle
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
_MAX_BYTES = 2**26


@dataclass(frozen=True)
class ZoneResult:
    """What came of one zone; ``status`` is ``failed`` where there is no result.

    ``vehicles`` has what the drives of each vehicle that was not known say of it: the name of a
    number, its value and standard error.
    """

    zone: str
    status: str
    n_passes: int
    n_anchors: int
    n_located: int
    area_m2: float
    failures: tuple[Failure, ...]
    vehicles: Mapping[str, Mapping[str, Sequence[float]]] = field(default_factory=dict)

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
        done = json.loads(read_regular(folder / _DONE, most_bytes=_MAX_BYTES))
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
    from gaia_uwb.fleet.vehicles import said_of_vehicles
    from gaia_uwb.locate import in_one_frame
    from gaia_uwb.outputs import write_all
    from gaia_uwb.pipeline import prepare, reconstruct_passes

    OutputFolder(folder).remove(_DONE)
    scenes: list[Scene] = []
    for log, vehicle in zone.driven:
        try:
            for scene in _new_drives(log, vehicle, scenes):
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
        vehicles=said_of_vehicles([episode for episode, _ in result.passes], config),
    )


def _new_drives(log: str, vehicle: Vehicle | None, known: Sequence[Scene]) -> Iterator[Scene]:
    """Yield the drives of a log, without truth; one that is known already is refused."""
    from gaia_uwb.api import load_scenes
    from gaia_uwb.locate import same_drive

    for scene in load_scenes(log, vehicle=vehicle):
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
    vehicles = [v and v.model_dump(mode="json") for v in zone.vehicles]
    content = [version("gaia-uwb"), settings, identity, zone.logs, vehicles, files]
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
