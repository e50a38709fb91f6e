"""How good a GNSS fix is: of several at one moment the best counts, and all are counted."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from gaia_uwb._shared import Array, Float64, Int64, counted
from gaia_uwb.logs._logs import LogTable

QUALITIES = (
    "RTK fixed",
    "RTK float",
    "PPP",
    "differential",
    "SBAS",
    "PPS",
    "single",
    "dead reckoning",
    "entered by hand",
    "simulated",
    "of unknown quality",
)
"""From the best to the worst; an index into this is a rank."""

RTK_FIXED, RTK_FLOAT, PPP, DIFFERENTIAL, SBAS, PPS, SINGLE = range(7)
DEAD_RECKONING, BY_HAND, SIMULATED, UNKNOWN = range(7, 11)


def keep_best(
    table: LogTable, moment_s: Float64[Array, "R"], rank: Int64[Array, "R"]
) -> tuple[LogTable, list[str]]:
    """Keep the best fix of each moment, and count what is kept.

    Parameters
    ----------
    table
        The fixes.
    moment_s : (R,)
        When each is of, by the receiver's clock.
    rank : (R,)
        Indices into :data:`QUALITIES`.

    Returns
    -------
    LogTable
        The best fixes, the first of equals, in the order of the file.
    list of str
        Notes.
    """
    order = np.lexsort((np.arange(len(table)), rank, moment_s))
    first = np.append(True, np.diff(moment_s[order]) != 0)[: len(table)]
    kept = np.sort(order[first])
    return table.take(kept), _notes(table.path, rank[kept], len(table) - len(kept))


def _notes(path: Path, rank: Int64[Array, "R"], n_worse: int) -> list[str]:
    codes, numbers = np.unique(rank, return_counts=True)
    parts = [f"{n:,} {QUALITIES[code]}" for code, n in zip(codes, numbers, strict=True)]
    line = f"{path.name}: {counted(len(rank), 'fix', 'fixes')}: {', '.join(parts)}"
    if len(codes) > 1:
        line += "; where the quality changes, the path may step"
    notes = [line]
    if n_worse:
        fixes = counted(n_worse, "fix", "fixes")
        notes.append(
            f"{path.name}: skipped {fixes}, as one of the same moment was as good or better"
        )
    return notes
