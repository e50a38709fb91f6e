"""Loaded into the workers of a scheduler (``--preload``): zones that do not end well there."""

from __future__ import annotations

import importlib.metadata
import os
import signal
import time
from pathlib import Path
from typing import Any

SLOW, KILLER = "zone-1", "zone-killer"
_version = importlib.metadata.version


def dask_setup(_: object) -> None:
    """Let the slow zone wait midway while a file is there, and the killer end the process."""
    import gaia_uwb.report

    hold = Path(os.environ["GAIA_TEST_HOLD"])
    write_all = gaia_uwb.report.write_all

    def write_all_or_die(result: Any, folder: Path) -> list[Path]:
        paths = write_all(result, folder)
        if folder.name == KILLER:
            os.kill(os.getpid(), signal.SIGKILL)
        if folder.name == SLOW and hold.exists() and not hold.read_text(encoding="utf-8"):
            hold.write_text(f"{os.getpid()}\n", encoding="utf-8")
            while hold.exists():
                time.sleep(0.05)
        return paths

    gaia_uwb.report.write_all = write_all_or_die


def pretend_version(found: str | None) -> None:
    """Let the worker say that it has this version of gaia, or none."""

    def version(name: str) -> str:
        if found is None:
            raise importlib.metadata.PackageNotFoundError(name)
        return found

    importlib.metadata.version = version


def take_back() -> None:
    """Let the worker tell the version that it has."""
    importlib.metadata.version = _version


def set_variable(name: str, value: str) -> None:
    """Set a variable of the worker's environment."""
    os.environ[name] = value


def number_of_tasks(dask_scheduler: Any) -> int:
    """Return how many tasks a scheduler still has."""
    return len(dask_scheduler.tasks)
