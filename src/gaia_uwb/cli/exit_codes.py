"""How ``gaia`` ends: its exit codes, and the one line that says why."""

from __future__ import annotations

import sys
from typing import NoReturn

from gaia_uwb._shared import printable

UNRELIABLE = 1
"""Done, but a result is unreliable."""
BAD_INPUT = 2
"""Bad input or usage, with one line on stderr."""
INTERRUPTED = 130
"""Stopped by Ctrl-C."""


def stop(message: str, code: int = BAD_INPUT) -> NoReturn:
    """Leave with one line on stderr.

    Parameters
    ----------
    message
        Made printable, so that no name in it can forge lines.
    code
        The exit code.
    """
    sys.stderr.write(f"gaia: {printable(message)}\n")
    sys.exit(code)
