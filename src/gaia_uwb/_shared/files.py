"""Write result files so that nobody ever sees half of one.

Each file is written under a hidden temporary name in the folder itself, flushed to the disk, and
renamed: the name shows the old content or the whole new one, even if the program is killed or the
power fails in between. A killed program leaves at most one hidden file, whose name says whose it is
(``.gaia-<machine>-<process>-<random>-<name>``); the next run in that folder removes it.

>>> import tempfile
>>> from gaia_uwb._shared import OutputFolder
>>> with tempfile.TemporaryDirectory() as place:
...     path = OutputFolder(Path(place) / "out").write_text("note.txt", "done")
...     path.name, path.read_text(encoding="utf-8")
('note.txt', 'done')
"""

from __future__ import annotations

import os
import re
import secrets
import shutil
import socket
import time
import zlib
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from gaia_uwb._shared.errors import ConfigError

_RUN = secrets.token_hex(4)  # a process may get the number of one that was killed
_TEMPORARY = re.compile(r"\.gaia-([0-9a-f]{8})-([0-9]+)-([0-9a-f]{8})-.+", re.DOTALL)
_ABANDONED_S = 86_400.0


class OutputFolder:
    """A folder for results, created and tested for writing before any work starts.

    Half-written files that killed runs left there are removed.

    Parameters
    ----------
    path
        The folder; it and its parents are created if missing.

    Raises
    ------
    ConfigError
        If the folder cannot be created or written to.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        probe = temporary_path(path, "probe")
        try:
            path.mkdir(parents=True, exist_ok=True)
            probe.touch(exist_ok=False)
            probe.unlink()
            remove_abandoned(path)
        except OSError as error:
            raise ConfigError(f"{path}: cannot write to this folder: {_reason(error)}") from error

    def write_text(self, name: str, text: str) -> Path:
        """Write ``text`` as UTF-8 and return the file's path.

        Parameters
        ----------
        name
            The file's name in the folder.
        text
            Its content; line ends are written as they are.

        Raises
        ------
        ConfigError
            If the file cannot be written; what was there before is left as it was.
        """
        # A file's name that is no UTF-8 comes with half a pair of surrogates for each odd byte.
        return self.write_bytes(name, text.encode("utf-8", "backslashreplace"))

    def write_bytes(self, name: str, content: bytes) -> Path:
        """Write ``content`` and return the file's path.

        Parameters
        ----------
        name
            The file's name in the folder.
        content
            Its content.

        Raises
        ------
        ConfigError
            If the file cannot be written; what was there before is left as it was.
        """
        return self.write(name, lambda temporary: temporary.write_bytes(content))

    def write(self, name: str, writer: Callable[[Path], object]) -> Path:
        """Let ``writer`` write a file and return the file's path.

        Parameters
        ----------
        name
            The file's name in the folder.
        writer
            Called once with the temporary path that it writes to; it ends like ``name``.

        Raises
        ------
        ConfigError
            If the file cannot be written; what was there before is left as it was.
        """
        path = self.path / name
        temporary = temporary_path(self.path, name)
        try:
            writer(temporary)
            with temporary.open("rb") as written:
                # Without this a power failure could keep the new name and lose the content.
                os.fsync(written.fileno())
            temporary.replace(path)
        except OSError as error:
            raise ConfigError(f"{path}: cannot write this file: {_reason(error)}") from error
        finally:
            temporary.unlink(missing_ok=True)
        return path

    def remove(self, name: str) -> None:
        """Remove a file of an earlier run, if it is there.

        Parameters
        ----------
        name
            The file's name in the folder.

        Raises
        ------
        ConfigError
            If the file cannot be removed.
        """
        path = self.path / name
        try:
            path.unlink(missing_ok=True)
        except OSError as error:
            raise ConfigError(f"{path}: cannot remove this file: {_reason(error)}") from error


def visible(folder: Path) -> list[Path]:
    """Return what lies in a folder, sorted, without hidden names: others may be at work there.

    Parameters
    ----------
    folder
        Where to look.
    """
    return sorted(path for path in folder.iterdir() if not path.name.startswith("."))


def temporary_path(folder: Path, name: str) -> Path:
    """Return an unused hidden name in a folder, for only within a folder a rename is atomic.

    Parameters
    ----------
    folder
        Where the file will be.
    name
        What it will be called.
    """
    owner = f"{_machine()}-{os.getpid()}-{_RUN}"
    return folder / f".gaia-{owner}-{secrets.token_hex(2)}-{name}"


def remove_abandoned(folder: Path) -> None:
    """Remove what killed programs left under temporary names in a folder, not in those below it.

    Only files that certainly have no owner are removed: their process ran on this machine and has
    ended, or they have not been touched for a day. What cannot be removed stays.

    Parameters
    ----------
    folder
        Where to look.
    """
    with suppress(OSError):
        for path in folder.iterdir():
            match = _TEMPORARY.fullmatch(path.name)
            if match is not None and match[3] != _RUN:
                with suppress(OSError):  # its owner, or another run that tidies up, was faster
                    _remove_if_abandoned(path, machine=match[1], process=int(match[2]))


def _remove_if_abandoned(path: Path, *, machine: str, process: int) -> None:
    owned = machine != _machine() or _alive(process)
    if owned and time.time() - path.lstat().st_mtime < _ABANDONED_S:
        return
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink()


def _machine() -> str:
    return f"{zlib.crc32(socket.gethostname().encode()):08x}"


def _alive(process: int) -> bool:
    """Return whether a process of this machine runs; where that cannot be asked, it does."""
    if process == os.getpid():  # the number of an earlier one, since its run was not this one
        return False
    if os.name != "posix":
        return True
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):
        return True
    return True


def _reason(error: OSError) -> str:
    return error.strerror or str(error)
