"""What was skipped of many logs or zones: a table for people, and a log with tracebacks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from gaia_uwb._shared import FAULTS_LOG, OutputFolder, csv_text, faults_text, problem_of

FAILURE_FILES = ("failures.csv", FAULTS_LOG)
"""The table of what was skipped and the log with tracebacks, in a folder of results."""


@dataclass(frozen=True)
class Failure:
    """A log that was skipped, or with an empty ``log`` a zone without a result.

    Parameters
    ----------
    zone, log
        What.
    problem
        Why, in one line.
    traceback
        Of a fault of the program; empty where the input is to blame.
    """

    zone: str
    log: str
    problem: str
    traceback: str = ""

    @classmethod
    def of(cls, zone: str, log: str, error: BaseException) -> Failure:
        """Return the failure that an error is.

        Parameters
        ----------
        zone, log
            What was worked on.
        error
            Whatever was raised.

        Examples
        --------
        >>> Failure.of("north", "", KeyError("cone-1")).problem
        "a fault of the program: KeyError: 'cone-1'"
        """
        problem = problem_of(error)
        return cls(zone, log, problem.text, problem.traceback)


def write_failures(failures: Sequence[Failure], folder: OutputFolder) -> list[Path]:
    """Write ``failures.csv``, and ``failures.log`` where faults are among them.

    Parameters
    ----------
    failures
        In the order of the rows; none makes a table without rows.
    folder
        Of all results.

    Returns
    -------
    list of Path
        What was written.
    """
    rows = [[each.zone, each.log, each.problem] for each in failures]
    paths = [folder.write(FAILURE_FILES[0], csv_text(["zone", "log", "problem"], rows))]
    faults = [(f"{each.zone} {each.log}", each.traceback) for each in failures if each.traceback]
    if not faults:
        folder.remove(FAULTS_LOG)  # of an earlier run
        return paths
    return [*paths, folder.write(FAULTS_LOG, faults_text(faults))]
