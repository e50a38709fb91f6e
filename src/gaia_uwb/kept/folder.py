"""The folder of a kept zone: written whole or not at all.

``zone.npz`` is the zone: everything else counts only if it names it. It is replaced by one rename,
last of all. ``drive-<digest>.npz`` holds a drive's prepared readings, ``block-<digest>.npz`` what
it says in numbers that add up; both are named after what is in them and never change. Files that
the zone does not name are left from a program that was killed, and the next change removes them.
"""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from gaia_uwb._shared import (
    ConfigError,
    InputError,
    read_regular,
    remove_abandoned,
    replace_file,
)
from gaia_uwb.kept.storage import from_bytes, to_bytes

_ZONE, _LOCK = "zone.npz", ".gaia-zone"
_OURS = re.compile(r"(drive|block)-[0-9a-f]{24}\.npz")
_LONGEST = 2**31


class ZoneFolder:
    """A folder that holds one zone.

    Parameters
    ----------
    path
        The folder.
    """

    def __init__(self, path: Path) -> None:
        self.path = path

    @property
    def exists(self) -> bool:
        """Whether there is a zone."""
        return (self.path / _ZONE).is_file()

    def create(self, content: Any) -> None:
        """Write the zone for the first time.

        Parameters
        ----------
        content
            What it holds.

        Raises
        ------
        ConfigError
            If the folder cannot be written to, or holds something already.
        """
        try:
            self.path.mkdir(parents=True, exist_ok=True)
            held = sorted(each.name for each in self.path.iterdir() if each.name != _LOCK)
        except OSError as error:
            problem = error.strerror or str(error)
            raise ConfigError(f"{self.path}: cannot write to this folder: {problem}") from error
        if any(not name.startswith(".gaia-") for name in held):
            raise ConfigError(f"{self.path}: holds {held[0]}: name an empty folder for a new zone")
        with self.alone():
            replace_file(self.path / _ZONE, to_bytes(content))

    def read(self) -> Any:
        """Return what the zone holds.

        Raises
        ------
        InputError
            If there is no zone, or it cannot be read.
        """
        return self.load(_ZONE)

    def load(self, name: str) -> Any:
        """Return what a file holds.

        Parameters
        ----------
        name
            Of :meth:`save`.

        Raises
        ------
        InputError
            If it is not there, or cannot be read.
        """
        path = self.path / name
        try:
            data = read_regular(path, most_bytes=_LONGEST)
        except OSError as error:
            problem = f"cannot be read: {error.strerror or error}"
            raise InputError(problem, source=path) from error
        return from_bytes(data, str(path))

    def save(self, kind: str, content: Any) -> str:
        """Write something that the zone will name, and return the name.

        Parameters
        ----------
        kind
            ``drive`` or ``block``.
        content
            What it holds.
        """
        data = to_bytes(content)
        name = f"{kind}-{hashlib.sha256(data).hexdigest()[:24]}.npz"
        if not (self.path / name).is_file():  # it is whole: it was renamed when it was
            replace_file(self.path / name, data)
        return name

    def replace(self, content: Any, named: Iterable[str]) -> None:
        """Write the zone, and remove what it does not name any more.

        Parameters
        ----------
        content
            What it holds.
        named
            All files that belong to it.
        """
        replace_file(self.path / _ZONE, to_bytes(content))
        wanted = set(named)
        for path in self.path.iterdir():
            if _OURS.fullmatch(path.name) and path.name not in wanted:
                path.unlink(missing_ok=True)
        remove_abandoned(self.path)

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Wait until no other program changes the zone, and keep others waiting.

        Where the file system knows no locks, nobody waits.
        """
        with (self.path / _LOCK).open("a", encoding="utf-8") as lock:
            if os.name == "posix":
                import fcntl

                with suppress(OSError):
                    fcntl.flock(lock, fcntl.LOCK_EX)
            yield
