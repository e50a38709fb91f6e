"""Vehicles that nobody knew before: what the drives of a fleet say of them, over all zones.

Nothing is located for it again: each zone says what it found of the clocks and ranges of its
drives. Lever arms are not among that (``gaia vehicle calibrate`` finds them).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from gaia_uwb._shared import OutputFolder
from gaia_uwb.config import Known, PipelineConfig
from gaia_uwb.episode import Episode
from gaia_uwb.logs import Vehicle, vehicle_text
from gaia_uwb.vehicle_calibration import BIAS, CLOCK, combine, drive_values, usual_values

VEHICLES = "vehicles"
"""The folder of vehicles that were learned, beside the zones' results."""


@dataclass(frozen=True)
class LearnedVehicle:
    """A vehicle that was not known.

    Parameters
    ----------
    name
        What it is called.
    n_zones
        How many zones it drove past.
    path
        Its file; None where its drives tell nothing.
    unknown
        What its drives do not tell.
    """

    name: str
    n_zones: int
    path: Path | None
    unknown: tuple[str, ...]


def said_of_vehicles(
    episodes: Sequence[Episode], config: PipelineConfig
) -> dict[str, dict[str, list[float]]]:
    """Return what the drives past a zone say of vehicles that have a name and are not known.

    Parameters
    ----------
    episodes
        All of them, with what was found of their errors.
    config
        ``vehicles`` holds those that are known.

    Returns
    -------
    dict
        Vehicle -> name of a number -> its value and standard error.
    """
    names = dict.fromkeys(e.vehicle for e in episodes if e.vehicle not in {"", *config.vehicles})
    said = {}
    for name in names:
        values = drive_values([e for e in episodes if e.vehicle == name], config)
        said[name] = {what: [known.value, known.sigma] for what, known in values.items()}
    return said


def learn_vehicles(
    zones: Sequence[Mapping[str, Mapping[str, Sequence[float]]]],
    out: Path,
    config: PipelineConfig = PipelineConfig(),
) -> list[LearnedVehicle]:
    """Write a file for each vehicle that was not known, if its drives tell anything.

    Parameters
    ----------
    zones
        Of each zone, what :func:`said_of_vehicles` returned.
    out
        Folder of all results.
    config
        Settings of the fleet.

    Returns
    -------
    list of LearnedVehicle
        Sorted by name.
    """
    learned = []
    for name in sorted({vehicle for zone in zones for vehicle in zone}):
        drives = [
            {what: Known(value=value, sigma=sigma) for what, (value, sigma) in zone[name].items()}
            for zone in zones
            if name in zone
        ]
        before = usual_values([CLOCK, BIAS], config)
        found = combine(Vehicle(name=name), drives, before)
        folder, path = OutputFolder(out / VEHICLES), None
        if len(found.unknown) < len(before):
            path = folder.write(f"{name}.yaml", vehicle_text(found.vehicle))
        else:  # what an earlier run wrote is no longer so
            folder.remove(f"{name}.yaml")
        learned.append(LearnedVehicle(name, len(drives), path, found.unknown))
    return learned
