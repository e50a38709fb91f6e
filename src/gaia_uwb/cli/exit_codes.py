"""How ``gaia`` ends: its exit codes, and the one line that says why.

Where several happen among many logs, the highest counts: a fault before bad input, bad input before
an unreliable result.
"""

from __future__ import annotations

import os
import sys
from contextlib import suppress
from pathlib import Path
from typing import NoReturn

from gaia_uwb._shared import printable

UNRELIABLE = 1
"""Done, but a result is unreliable."""
BAD_INPUT = 2
"""Bad input or usage, with one line on stderr."""
FAULT = 3
"""A fault of the program, with one line on stderr and its traceback in a file."""
INTERRUPTED = 130
"""Stopped by Ctrl-C."""


def tell(message: str) -> None:
    """Write one line to stderr.

    Parameters
    ----------
    message
        Made printable, so that no name in it can forge lines.
    """
    sys.stderr.write(f"gaia: {printable(message)}\n")


def stop(message: str, code: int = BAD_INPUT) -> NoReturn:
    """Leave with one line on stderr.

    Parameters
    ----------
    message
        Like that of :func:`tell`.
    code
        The exit code.
    """
    tell(message)
    sys.exit(code)


def keep_traceback(text: str, folder: Path | None) -> str:
    """Write tracebacks to a file and return where, in words.

    Parameters
    ----------
    text
        The tracebacks.
    folder
        Of the results, if it is known and there; else a file in the system's folder for temporary
        files is used.
    """
    import tempfile

    from gaia_uwb._shared import FAULTS_LOG, GaiaError, OutputFolder

    if folder is not None and folder.is_dir():
        with suppress(GaiaError):  # where it cannot be written, the other place is tried
            return f"traceback in {OutputFolder(folder).write(FAULTS_LOG, text)}"
    try:
        handle, name = tempfile.mkstemp(prefix="gaia-", suffix=f"-{FAULTS_LOG}")
        with os.fdopen(handle, "w", encoding="utf-8", errors="backslashreplace") as file:
            file.write(text)
    except OSError as error:
        return f"its traceback cannot be written: {error.strerror or error}"
    return f"traceback in {name}"
