"""Ranges between cones, the same for GAIA's own format and for described logs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gaia_uwb._shared import Array, Int64, counted
from gaia_uwb.logs._plausible import check_metres, check_seconds
from gaia_uwb.logs._table import Table
from gaia_uwb.scene import ConeRanges

ENDS = ("anchor_a", "anchor_b")
"""The columns of the two cones."""


@dataclass(frozen=True)
class Cones:
    """The ranges between cones that count.

    Parameters
    ----------
    table
        With :data:`ENDS`, ``range_m`` and, where there are times, ``t_s``; ``None`` without ranges.
    notes
        What was left out.
    """

    table: Table | None = None
    notes: tuple[str, ...] = ()

    @property
    def labels(self) -> tuple[str, ...]:
        """The ids of the cones."""
        if self.table is None:
            return ()
        found = (self.table.labels[end][code] for end in ENDS for code in set(self.table[end]))
        return tuple(dict.fromkeys(found))

    def ranges(self, ids: tuple[str, ...]) -> ConeRanges | None:
        """Return the ranges, pointing into ``ids``."""
        if self.table is None:
            return None
        place = {anchor_id: index for index, anchor_id in enumerate(ids)}
        anchor_a, anchor_b = (_codes(self.table, end, place) for end in ENDS)
        return ConeRanges(anchor_a, anchor_b, self.table["range_m"], self.table.get("t_s"))


def cones_in(table: Table) -> Cones:
    """Leave out what is no range, and refuse what cannot be ranges between cones.

    Parameters
    ----------
    table
        With the columns of :class:`Cones`.

    Raises
    ------
    InputError
        If a cone is ranged to itself, no range is left, or a unit is wrong.
    """
    ids = sorted(set(table.labels[ENDS[0]]) | set(table.labels[ENDS[1]]))
    place = {anchor_id: index for index, anchor_id in enumerate(ids)}
    anchor_a, anchor_b = (_codes(table, end, place) for end in ENDS)
    same = anchor_a == anchor_b
    if same.any():
        index = int(np.argmax(same))
        problem = f"expected another cone than anchor_a, got {ids[anchor_a[index]]!r} twice"
        raise table.error(problem, index=index, column=ENDS[1])
    none = ~(table["range_m"] > 0.0)
    if none.all():
        raise table.error("contains no ranges", column="range_m")
    notes = table.remarks
    if none.any():
        rows = counted(int(none.sum()), "row")
        notes = (
            *notes,
            f"{table.path.name}: skipped {rows} without a range (empty, or 0 m and less)",
        )
        table = table.take(~none)
    if "t_s" in table:
        check_seconds(table)
    check_metres(table)
    return Cones(table, notes)


def _codes(table: Table, end: str, place: dict[str, int]) -> Int64[Array, "M"]:
    """Return the places of a column's cones."""
    return np.array([place.get(label, -1) for label in table.labels[end]], np.int64)[table[end]]
