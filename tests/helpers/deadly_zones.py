"""Zones that do not end well in a worker: one waits midway while a file is there, one kills it.

Loaded into the workers of a scheduler (``--preload``), or called as a program in the place of
``python -m gaia_uwb``: its processes load it again.
"""

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
    """Prepare a worker of a scheduler."""
    prepare()


def prepare() -> None:
    """Let the slow zone write its process into a file that is there and empty, and wait midway.

    It waits as long as the file is there. The killer ends the process.
    """
    import gaia_uwb.outputs

    hold = Path(os.environ["GAIA_TEST_HOLD"])
    write_all = gaia_uwb.outputs.write_all

    def write_all_or_die(result: Any, folder: Path) -> list[Path]:
        paths = write_all(result, folder)
        if folder.name == KILLER:
            os.kill(os.getpid(), signal.SIGKILL)
        if folder.name == SLOW and hold.exists() and not hold.read_text(encoding="utf-8"):
            hold.write_text(f"{os.getpid()}\n", encoding="utf-8")
            while hold.exists():
                time.sleep(0.05)
        return paths

    gaia_uwb.outputs.write_all = write_all_or_die


def held_process(hold: Path) -> int | None:
    """Return the process that waits in the slow zone, None where none does yet."""
    text = hold.read_text(encoding="utf-8")
    return int(text) if text.endswith("\n") else None


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


if __name__ in ("__main__", "__mp_main__"):  # the latter in the processes of a fleet
    prepare()
if __name__ == "__main__":
    from gaia_uwb.cli import main

    main()
