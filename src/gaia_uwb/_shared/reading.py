r"""Open what others name: regular files only, of a bounded size, and folders of a bounded number.

A path from a log or a command line may be a pipe that nobody writes to, a device without end, or
the root of a disk. Whatever reads a file goes through :func:`open_regular`, which waits for none of
these.

>>> from pathlib import Path
>>> read_regular(Path("/dev/null"), most_bytes=10)
Traceback (most recent call last):
OSError: [Errno 22] it is not a regular file: '/dev/null'
"""

from __future__ import annotations

import errno
import os
import stat
from itertools import islice
from pathlib import Path
from typing import BinaryIO


def open_regular(path: Path) -> BinaryIO:
    """Open a file for reading if it is a regular one; a pipe or a device is refused at once.

    Parameters
    ----------
    path
        The file; a symbolic link is followed.

    Raises
    ------
    OSError
        If it cannot be opened, or is anything but a regular file.
    """
    try:
        return open(path, "rb", opener=_open_only_regular)  # Path has no opener
    except ValueError as error:  # a name with a zero byte
        raise OSError(errno.EINVAL, str(error), str(path)) from error


def _open_only_regular(path: str, flags: int) -> int:
    # Without O_NONBLOCK, a pipe would hold us here until somebody writes to it.
    handle = os.open(path, flags | getattr(os, "O_NONBLOCK", 0))
    if stat.S_ISREG(os.fstat(handle).st_mode):
        return handle
    os.close(handle)
    raise OSError(errno.EINVAL, "it is not a regular file", path)


def read_regular(path: Path, *, most_bytes: int) -> bytes:
    """Return the content of a regular file.

    Parameters
    ----------
    path
        The file.
    most_bytes
        A file from which more can be read is refused, whatever size the system tells.

    Raises
    ------
    OSError
        If it cannot be read, is not a regular file, or is too large.
    """
    with open_regular(path) as file:
        content = file.read(most_bytes + 1)
    if len(content) > most_bytes:
        raise OSError(errno.EFBIG, f"larger than {most_bytes:,} bytes", str(path))
    return content


def name_of(path: Path) -> str:
    r"""Return a file's or folder's name as text that every format can hold.

    Parameters
    ----------
    path
        It need not exist. Bytes of its name that are not UTF-8 are written out.

    Examples
    --------
    >>> name_of(Path(os.fsdecode(b"logs/a\xff")))
    'a\\xff'
    """
    return os.fsencode(path.resolve().name).decode("utf-8", "backslashreplace")


def paths_below(folder: Path, *, most: int) -> list[Path] | None:
    """Return everything below a folder, sorted; None where that is more than allowed.

    Parameters
    ----------
    folder
        Where to look. The walk ends as soon as there is too much, so a whole disk costs nothing.
    most
        Number of files and folders.

    Raises
    ------
    OSError
        If the folder cannot be listed.
    """
    found = list(islice(folder.rglob("*"), most + 1))
    return None if len(found) > most else sorted(found)
