"""Which logs are of which zone, and who drove: a folder of zones, or a manifest."""

from __future__ import annotations

import csv
import io
import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from gaia_uwb._shared import InputError, SourceError, read_regular, shown, visible
from gaia_uwb.logs import Vehicle

_MAX_MANIFEST_BYTES = 2**26
_LONGEST_NAME, _LONGEST_LOG = 200, 4096  # bytes, characters; file systems allow little more

_Zones = dict[str, list[tuple[str, str]]]  # by name: logs, and the name of each one's vehicle


@dataclass(frozen=True)
class ZoneLogs:
    """The logs of one zone.

    Parameters
    ----------
    name
        Names the folder of its results.
    logs
        What :func:`gaia_uwb.api.load_scenes` takes.
    vehicles
        Who drove each of them, as far as that is known; empty where no log names a vehicle.
    """

    name: str
    logs: tuple[str, ...]
    vehicles: tuple[Vehicle | None, ...] = ()

    @property
    def driven(self) -> list[tuple[str, Vehicle | None]]:
        """Each log with its vehicle."""
        return list(zip(self.logs, self.vehicles or (None,) * len(self.logs), strict=True))


def find_zones(
    source: Path, out: Path | None = None, vehicles: Sequence[Vehicle] = ()
) -> list[ZoneLogs]:
    """Return the zones of a manifest, or of a folder that holds a folder of logs for each zone.

    Parameters
    ----------
    source
        A manifest: a YAML file (``.yaml`` or ``.yml``) with a list of logs for each zone, or a CSV
        file with the columns ``log`` and ``zone``, and perhaps ``vehicle``, paths relative to its
        own folder. Or a folder; a log that lies in the folder itself is a zone of its own.
    out
        Folder for results; if it lies in the source, what it contains is not a log.
    vehicles
        Those that are known; a single one drove all logs, where none names a vehicle.

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
        longest = max(len(log) for log, _ in logs)
        if longest > _LONGEST_LOG:
            problem = f"zone {shown(name)}: a log's path is too long ({longest:,} characters)"
            raise InputError(problem, source=source)
    named = {vehicle for logs in zones.values() for _, vehicle in logs if vehicle}
    for vehicle in named:
        if not _can_name_a_folder(vehicle + ".yaml"):
            problem = f"vehicle {shown(vehicle)}: the name cannot be that of a file"
            raise InputError(problem, source=source)
    known: dict[str, Vehicle | None] = {name: Vehicle(name=name) for name in named}
    known |= {vehicle.name: vehicle for vehicle in vehicles}
    known[""] = None
    if vehicles and not named:
        if len(vehicles) > 1:
            problem = (
                f"--vehicle gives {len(vehicles)} vehicles, but no log names its own: add a column "
                "vehicle to a CSV manifest"
            )
            raise InputError(problem, source=source)
        known[""] = vehicles[0]
    found = []
    for name in sorted(zones):
        driven = sorted(set(zones[name]))
        who = tuple(known[vehicle] for _, vehicle in driven)
        found.append(ZoneLogs(name, tuple(log for log, _ in driven), who if any(who) else ()))
    return found


def _can_name_a_folder(name: str) -> bool:
    if not name.strip() or name in {".", ".."} or re.search(r"[/\x00-\x1f\x7f]", name):
        return False
    return len(os.fsencode(name)) <= _LONGEST_NAME


def _csv_manifest(source: Path) -> _Zones:
    try:
        text = read_regular(source, most_bytes=_MAX_MANIFEST_BYTES).decode("utf-8-sig")
        rows = list(csv.DictReader(io.StringIO(text, newline="")))
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"cannot read this manifest: {error}", source=source) from error
    zones: _Zones = {}
    for k, row in enumerate(rows, start=2):
        log, zone = row.get("log"), row.get("zone")
        if not log or not zone:
            raise InputError("expected a log and a zone in each row", source=source, row=k)
        vehicle = (row.get("vehicle") or "").strip()
        zones.setdefault(zone, []).append((str(source.parent / log), vehicle))
    return zones


def _yaml_manifest(source: Path) -> _Zones:
    from gaia_uwb._shared import YamlError, read_yaml

    try:
        content = read_yaml(source, most_bytes=_MAX_MANIFEST_BYTES)
    except YamlError as error:
        raise InputError(str(error), source=source) from error
    if content is None:
        return {}
    if not isinstance(content, dict):
        raise InputError("expected a list of logs for each zone", source=source)
    zones: _Zones = {}
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
        zones[name] = [(str(source.parent / log), "") for log in logs]
    return zones


def _folder(source: Path, out: Path | None) -> _Zones:
    from gaia_uwb.logs import is_described, is_native

    def is_log(path: Path) -> bool:
        return is_described(path) or is_native(path)

    def inside(folder: Path) -> list[Path]:
        results = None if out is None else os.path.realpath(out)
        return [path for path in visible(folder) if os.path.realpath(path) != results]

    zones: _Zones = {}
    for path in inside(source):
        if is_log(path):
            zones[path.name] = [(str(path), "")]
        elif path.is_dir():
            logs = [(str(each), "") for each in inside(path) if is_log(each) or each.is_dir()]
            if logs:
                zones[path.name] = logs
    return zones
