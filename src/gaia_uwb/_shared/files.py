"""Write result files so that nobody ever sees half of one, and nobody else's file is lost.

Each file is written under a hidden temporary name in the folder itself, flushed to the disk, and
renamed: the name shows the old content or the whole new one, even if the program is killed or the
power fails in between. A killed program leaves at most one hidden file, whose name says whose it is
(``.gaia-<machine>-<process>-<random>-<name>``); the next run in that folder removes it.

Only what we wrote is ever replaced or removed: before a name is written for the first time, it is
added to the folder's record, ``.gaia-files``. A file that is not listed there belongs to somebody
else, and its name is refused.

>>> import tempfile
>>> from gaia_uwb._shared import OutputFolder
>>> with tempfile.TemporaryDirectory() as place:
...     path = OutputFolder(Path(place) / "out").write("note.txt", "done")
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
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from gaia_uwb._shared.errors import ConfigError
from gaia_uwb._shared.reading import read_regular

_RUN = secrets.token_hex(4)  # a process may get the number of one that was killed
_TEMPORARY = re.compile(r"\.gaia-([0-9a-f]{8})-([0-9]+)-([0-9a-f]{8})-.+", re.DOTALL)
_ABANDONED_S = 86_400.0
_RECORD = ".gaia-files"
_LONGEST_RECORD = 2**24


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

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as place:
    ...     _ = (Path(place) / "note.txt").write_text("theirs")
    ...     OutputFolder(Path(place)).write("note.txt", "ours")
    Traceback (most recent call last):
    gaia_uwb.ConfigError: .../note.txt: was not written by gaia (see .gaia-files): ...
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

    def write(self, name: str, content: str | bytes) -> Path:
        """Write a file and return its path.

        Parameters
        ----------
        name
            The file's name in the folder.
        content
            Its bytes, or its text, which is written as UTF-8 with line ends as they are.

        Raises
        ------
        ConfigError
            If the file cannot be written, or if somebody else's file has this name; what was there
            before is left as it was.
        """
        self.claim([name])
        return replace_file(self.path / name, content)

    def claim(self, names: Iterable[str]) -> None:
        """Put names on the folder's record, so that files of these names may be replaced.

        Parameters
        ----------
        names
            Of files that will be written. Claim them before long work, not after.

        Raises
        ------
        ConfigError
            If there is a file of such a name that is not on the record, or the record cannot be
            written.
        """
        ours = self.names()
        new = [name for name in names if name not in ours]
        for name in new:
            path = self.path / name
            if os.path.lexists(path):
                problem = (
                    f"was not written by gaia (see {_RECORD}): move it, or name another folder"
                )
                raise ConfigError(f"{path}: {problem}")
        if not new:
            return
        self._record(new)

    def _record(self, names: list[str]) -> None:
        record = self.path / _RECORD
        try:
            with record.open("a", encoding="utf-8") as file:
                # A killed run may have left half a line: start on a new one.
                file.write("\n" + "".join(f"{name}\n" for name in names))
                file.flush()
                os.fsync(file.fileno())
        except OSError as error:
            raise ConfigError(f"{record}: cannot write this file: {_reason(error)}") from error

    def names(self) -> set[str]:
        """Return the names on the folder's record: of files that we wrote, or were about to."""
        try:
            content = read_regular(self.path / _RECORD, most_bytes=_LONGEST_RECORD)
        except FileNotFoundError:
            return set()
        except OSError as error:
            problem = f"cannot be read: {_reason(error)}"
            raise ConfigError(f"{self.path / _RECORD}: {problem}") from error
        return set(content.decode("utf-8", "replace").split("\n")) - {""}

    def remove(self, name: str) -> None:
        """Remove a file of an earlier run, if it is there; a file of somebody else's stays.

        Parameters
        ----------
        name
            The file's name in the folder.

        Raises
        ------
        ConfigError
            If the file cannot be removed.
        """
        if name not in self.names():
            return
        path = self.path / name
        try:
            path.unlink(missing_ok=True)
        except OSError as error:
            raise ConfigError(f"{path}: cannot remove this file: {_reason(error)}") from error

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Wait until no other program writes a set of files here, and keep others waiting.

        So that of two runs into one folder the files of one stay, never some of each. Where the
        file system knows no locks, nobody waits.
        """
        path = self.path / _RECORD
        try:
            record = path.open("a", encoding="utf-8")
        except OSError as error:
            raise ConfigError(f"{path}: cannot write this file: {_reason(error)}") from error
        with record:
            if os.name == "posix":
                import fcntl

                with suppress(OSError):
                    fcntl.flock(record, fcntl.LOCK_EX)
            yield


def replace_file(path: Path, content: str | bytes) -> Path:
    """Write a file that the user named, whatever was there, and return its path.

    Parameters
    ----------
    path
        The file.
    content
        Its bytes, or its text, which is written as UTF-8 with line ends as they are.

    Raises
    ------
    ConfigError
        If the file cannot be written; what was there before is left as it was.
    """
    temporary = temporary_path(path.parent, path.name)
    try:
        with temporary.open("xb") as file:
            # A file's name that is no UTF-8 comes with half a pair of surrogates for each odd byte.
            file.write(
                content.encode("utf-8", "backslashreplace") if isinstance(content, str) else content
            )
            file.flush()
            # Without this a power failure could keep the new name and lose the content.
            os.fsync(file.fileno())
        temporary.replace(path)
    except OSError as error:
        raise ConfigError(f"{path}: cannot write this file: {_reason(error)}") from error
    finally:
        temporary.unlink(missing_ok=True)
    return path


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
