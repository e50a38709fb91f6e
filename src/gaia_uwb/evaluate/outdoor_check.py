"""What the static measurements of the public outdoor data set show."""

from __future__ import annotations

from pathlib import Path

from gaia_uwb.evaluate.log_check import CheckReport
from gaia_uwb.logs import StaticFile, load_static

_FEW_STATIC_READINGS = 50


def check_outdoor_static(folder: Path) -> CheckReport:
    """Check the static files of the outdoor data set.

    Parameters
    ----------
    folder
        The data set's folder.

    Raises
    ------
    InputError
        If there are none, or one is malformed.
    """
    files = load_static(folder)

    empty = [file for file in files if not len(file)]
    few = [file for file in files if 0 < len(file) < _FEW_STATIC_READINGS]
    damaged = [file for file in files if file.n_damaged]
    notes = [f"{len(files)} files with {sum(map(len, files))} readings"]
    if empty:
        notes.append(f"{len(empty)} files have no readings: {_names(empty)}")
    if few:
        notes.append(
            f"{len(few)} files have fewer than {_FEW_STATIC_READINGS} readings: {_names(few)}"
        )
    if damaged:
        notes.append(f"{len(damaged)} files have garbled rows: {_names(damaged)}")
    return CheckReport("outdoor-uwb, static files", notes=tuple(notes))


def _names(files: list[StaticFile]) -> str:
    return ", ".join("/".join(file.path.parts[-3:]) for file in files)
