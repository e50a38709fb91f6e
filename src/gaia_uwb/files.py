"""Write result files so that nobody ever sees half of one.

Each file is written under a hidden temporary name in the folder itself, flushed to the disk, and
renamed: the name shows the old content or the whole new one, also if the program is killed or the
power fails in between. A killed program leaves at most one hidden file (``.<random>-<name>``).

>>> import tempfile
>>> from gaia_uwb.files import OutputFolder
>>> with tempfile.TemporaryDirectory() as place:
...     path = OutputFolder(Path(place) / "out").write_text("note.txt", "done")
...     path.name, path.read_text(encoding="utf-8")
('note.txt', 'done')
"""

from __future__ import annotations

import os
import secrets
from collections.abc import Callable
from pathlib import Path

from gaia_uwb.errors import ConfigError


class OutputFolder:
    """A folder for results, made and tested for writing before any work starts.

    Parameters
    ----------
    path
        The folder; it and its parents are made if needed.

    Raises
    ------
    ConfigError
        If the folder cannot be made or written to.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        probe = self._temporary("probe")
        try:
            path.mkdir(parents=True, exist_ok=True)
            probe.touch(exist_ok=False)
            probe.unlink()
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
        return self.write_bytes(name, text.encode("utf-8"))

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
        temporary = self._temporary(name)
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

    def _temporary(self, name: str) -> Path:
        """Return an unused name in the same folder, for only there a rename is atomic."""
        return self.path / f".{secrets.token_hex(4)}-{name}"


def _reason(error: OSError) -> str:
    return error.strerror or str(error)
