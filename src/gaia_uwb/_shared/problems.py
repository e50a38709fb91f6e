"""What went wrong with one of many logs or zones, so that the others can go on.

An input that is wrong is told in one line. Anything else that goes wrong is a fault of the program:
also one line, and the traceback with it, for whoever mends it.
"""

from __future__ import annotations

import traceback
from collections.abc import Sequence
from dataclasses import dataclass

from gaia_uwb._shared.errors import GaiaError
from gaia_uwb._shared.text import in_a_line

FAULT = "a fault of the program"
"""How the line begins that tells of a fault."""

FAULTS_LOG = "failures.log"
"""The file that holds tracebacks, in a folder of results."""

_LONGEST_LINE = 600


@dataclass(frozen=True)
class Problem:
    """Why something was not done.

    Parameters
    ----------
    text
        One line.
    traceback
        Of a fault of the program; empty where the input is to blame.
    """

    text: str
    traceback: str = ""

    @property
    def is_fault(self) -> bool:
        """Whether the program is to blame, and not its input."""
        return bool(self.traceback)


def problem_of(error: BaseException) -> Problem:
    """Return what an error means for the user.

    Parameters
    ----------
    error
        Whatever was raised.

    Examples
    --------
    >>> from gaia_uwb._shared import ConfigError
    >>> problem_of(ConfigError("no such denoiser")).text
    'no such denoiser'
    >>> problem_of(ZeroDivisionError("division by zero")).text
    'a fault of the program: ZeroDivisionError: division by zero'
    """
    if isinstance(error, GaiaError):
        return Problem(str(error))
    if isinstance(error, MemoryError):
        return Problem("not enough memory for this log")
    if isinstance(error, OSError):
        place = in_a_line(str(error.filename or "file system"), _LONGEST_LINE)
        return Problem(f"{place}: {in_a_line(error.strerror or str(error), _LONGEST_LINE)}")
    what = in_a_line(f"{type(error).__name__}: {error}", _LONGEST_LINE)
    return Problem(f"{FAULT}: {what}", "".join(traceback.format_exception(error)))


def faults_text(faults: Sequence[tuple[str, str]]) -> str:
    """Return the content of a file with tracebacks.

    Parameters
    ----------
    faults
        For each what was worked on, and the traceback.
    """
    return "\n".join(f"{in_a_line(what, _LONGEST_LINE)}\n{trace}" for what, trace in faults)
